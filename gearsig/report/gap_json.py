"""A gap report as JSON, in a schema that stays: `gap.schema.json`, beside this file, describes every member.

Names end in their unit, or a value stands beside its "unit". Numbers carry nine significant digits; what is not known
or not defined is null, never nan or infinity. Within a version members may be added, never renamed or removed.
"""

from __future__ import annotations

import json
from pathlib import Path

from gearsig import __version__
from gearsig.formatting import rounded
from gearsig.gap.curve_types import AngleCurves, AverageCurves, SpectrumCurves
from gearsig.gap.simulator import Added
from gearsig.gap.types import (
    ConditionFacts,
    GapCause,
    GapPlace,
    GapReport,
    Interval,
    NextRecording,
    Shrinkage,
)
from gearsig.report.files import write_text
from gearsig.report.plain import Json, members, plain

SCHEMA, SCHEMA_VERSION = "gearsig.gap", 1
FLOORS = "structural floors"


def gap_to_dict(report: GapReport) -> Json:
    """Return a gap report as plain dictionaries, lists, texts and numbers.

    Parameters
    ----------
    report : GapReport

    Returns
    -------
    dict
        `json.dumps(..., allow_nan=False)` takes it, and `gap.schema.json` holds for it.
    """
    return {
        "schema": SCHEMA,
        "schema_version": SCHEMA_VERSION,
        "gearsig_version": __version__,
        "outcome": report.outcome.value,
        "verdict": dict(zip(("where", "which", "how_far", "next"), report.verdict, strict=True)),
        **members(report, "rig", "simulator"),
        "conditions": [_condition(facts) for facts in report.conditions],
        "references": list(report.references),
        "size": _interval(report.size, FLOORS),
        "size_in_repeatability_floors": rounded(report.repeatability),
        "places": [_place(place) for place in report.places],
        "causes": [_cause(cause) for cause in report.causes],
        **members(report, "groups", "inseparable"),
        "steps": [{"label": step.label, "left": _interval(step.left, FLOORS)} for step in report.steps],
        "next_recordings": [_next_recording(one) for one in report.next_recordings],
        "spectra": [_spectrum(curves) for curves in report.spectra],
        "angles": [_angles(curves) for curves in report.angles],
        "averages": [_average(curves) for curves in report.averages],
        "doubts": list(report.doubts),
        "notices": list(report.notices),
        "twin_toml": report.twin_toml or None,
    }


def gap_to_json(report: GapReport) -> str:
    """Return a gap report as JSON text, see `gap_to_dict`."""
    return json.dumps(gap_to_dict(report), indent=1, ensure_ascii=False, allow_nan=False) + "\n"


def write_gap_json(report: GapReport, path: str | Path) -> Path:
    """Write a gap report as JSON; the file appears only when it is complete."""
    return write_text(Path(path), gap_to_json(report))


def gap_schema() -> Json:
    """Return the JSON Schema (2020-12) that holds for every report of this version."""
    schema: Json = json.loads(Path(__file__).with_name("gap.schema.json").read_text(encoding="utf-8"))
    return schema


def _interval(interval: Interval, unit: str) -> Json:
    return members(interval, "value", "low", "high") | {"unit": unit}


def _condition(facts: ConditionFacts) -> Json:
    rest = members(facts, "n_revolutions", "duration_s", "sampling_rate_hz", "reference")
    return {"name": facts.name, **plain(facts.point), **rest}


def _place(place: GapPlace) -> Json:
    return {
        **members(place, "kind", "title", "change_db"),
        "change_in_repeatability_floors": rounded(place.repeatability),
        "change_in_structural_floors": rounded(place.structural),
        **members(place, "share", "shaft", "orders", "band_hz", "angle_deg", "tooth", "channel", "follows"),
    }


def _cause(cause: GapCause) -> Json:
    return {
        **members(cause, "name", "group", "title", "is_nuisance", "probability", "unit"),
        "severity": None if cause.severity is None else _interval(cause.severity, cause.unit),
        "fitted": None if cause.fitted is None else _added(cause.fitted, cause.unit),
        "place": cause.place,
        "shrinkage": None if cause.shrinkage is None else _shrinkage(cause.shrinkage),
        **members(cause, "evidence", "remarks"),
    }


def _added(added: Added, unit: str) -> Json:
    return {"effect": added.name, "severity": rounded(added.severity), "unit": unit, "options": plain(added.options)}


def _shrinkage(shrinkage: Shrinkage) -> Json:
    return {
        "before": _interval(shrinkage.before, FLOORS),
        "after": _interval(shrinkage.after, FLOORS),
        "shrink": _interval(shrinkage.shrink, "1"),
        "slope": rounded(shrinkage.slope),
        "placebo_shrink": rounded(shrinkage.placebo),
        "shrink_elsewhere": None if shrinkage.elsewhere is None else rounded(shrinkage.elsewhere),
        "foretold": None if shrinkage.foretold is None else rounded(shrinkage.foretold),
        **members(shrinkage, "held_out", "n_placebos"),
    }


def _next_recording(one: NextRecording) -> Json:
    return {
        **plain(one.point),
        "separates": list(one.separates),
        "distance_in_structural_floors": rounded(one.standard_deviations),
        "distance_now_in_structural_floors": rounded(one.now),
        **members(one, "place", "text"),
    }


def _spectrum(curves: SpectrumCurves) -> Json:
    return {
        **members(curves, "label", "unit", "orders", "measured", "before"),
        "after": plain(curves.after) or None,
        "floor": plain(curves.floor),
        "structural_floor_db": plain(curves.structural_db) or None,
        "reference": plain(curves.reference) or None,
        "reference_floor": plain(curves.reference_floor) or None,
        "reference_structural_floor_db": plain(curves.reference_structural_db) or None,
    }


def _angles(curves: AngleCurves) -> Json:
    return {
        "shaft": curves.shaft,
        "unit": "1",
        "of": curves.unit,
        "n_teeth": curves.teeth,
        **members(curves, "has_mark", "angle_deg", "measured", "before"),
        "after": plain(curves.after) or None,
    }


def _average(curves: AverageCurves) -> Json:
    return {
        **members(curves, "shaft", "channel", "unit"),
        "n_teeth": curves.teeth,
        **members(curves, "has_mark", "angle_deg", "measured", "reference"),
    }
