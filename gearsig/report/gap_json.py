"""A gap report as JSON, in a schema that stays: `gap.schema.json`, beside this file, describes every member.

Names end in their unit, or a value stands beside its "unit". Numbers carry nine significant digits; what is not known
or not defined is null, never nan or infinity. Within a version members may be added, never renamed or removed.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from gearsig import __version__
from gearsig.checks import FloatArray
from gearsig.gap.simulator import Added, Point
from gearsig.gap.types import (
    AngleCurves,
    ConditionFacts,
    Evidence,
    GapCause,
    GapPlace,
    GapReport,
    Interval,
    NextRecording,
    Shrinkage,
    SpectrumCurves,
)
from gearsig.report.files import write_text
from gearsig.report.numbers import rounded

SCHEMA, SCHEMA_VERSION = "gearsig.gap", 1
FLOORS = "structural floors"
Json = dict[str, Any]


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
        "rig": report.rig,
        "simulator": report.simulator,
        "conditions": [_condition(facts) for facts in report.conditions],
        "references": list(report.references),
        "size": _interval(report.size, FLOORS),
        "size_in_repeatability_floors": rounded(report.repeatability),
        "places": [_place(place) for place in report.places],
        "causes": [_cause(cause) for cause in report.causes],
        "groups": {group: rounded(probability) for group, probability in report.groups.items()},
        "inseparable": None if report.inseparable is None else list(report.inseparable),
        "steps": [{"label": step.label, "left": _interval(step.left, FLOORS)} for step in report.steps],
        "next_recordings": [_next_recording(one) for one in report.next_recordings],
        "spectra": [_spectrum(curves) for curves in report.spectra],
        "angles": [_angles(curves) for curves in report.angles],
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
    return {
        "value": rounded(interval.value),
        "low": rounded(interval.low),
        "high": rounded(interval.high),
        "unit": unit,
    }


def _point(point: Point) -> Json:
    return {"speed_rpm": rounded(point.speed_rpm), "torque_nm": rounded(point.torque_nm)}


def _condition(facts: ConditionFacts) -> Json:
    return {
        "name": facts.name,
        **_point(facts.point),
        "n_revolutions": rounded(facts.n_revolutions),
        "duration_s": rounded(facts.duration_s),
        "sampling_rate_hz": rounded(facts.sampling_rate_hz),
    }


def _place(place: GapPlace) -> Json:
    return {
        "kind": place.kind.value,
        "title": place.title,
        "change_db": rounded(place.change_db),
        "change_in_repeatability_floors": rounded(place.repeatability),
        "change_in_structural_floors": rounded(place.structural),
        "share": rounded(place.share),
        "shaft": place.shaft,
        "orders": _numbers(place.orders),
        "band_hz": None if place.band_hz is None else _numbers(place.band_hz),
        "angle_deg": None if place.angle_deg is None else rounded(place.angle_deg),
        "tooth": place.tooth,
        "channel": place.channel,
    }


def _cause(cause: GapCause) -> Json:
    return {
        "name": cause.name,
        "group": cause.group,
        "title": cause.title,
        "is_nuisance": cause.is_nuisance,
        "probability": rounded(cause.probability),
        "unit": cause.unit,
        "severity": None if cause.severity is None else _interval(cause.severity, cause.unit),
        "fitted": None if cause.fitted is None else _added(cause.fitted, cause.unit),
        "place": cause.place,
        "shrinkage": None if cause.shrinkage is None else _shrinkage(cause.shrinkage),
        "evidence": [_evidence(evidence) for evidence in cause.evidence],
        "remarks": list(cause.remarks),
    }


def _added(added: Added, unit: str) -> Json:
    options = {name: v if isinstance(v, str) else rounded(v) for name, v in added.options.items()}
    return {"effect": added.name, "severity": rounded(added.severity), "unit": unit, "options": options}


def _shrinkage(shrinkage: Shrinkage) -> Json:
    return {
        "before": _interval(shrinkage.before, FLOORS),
        "after": _interval(shrinkage.after, FLOORS),
        "shrink": _interval(shrinkage.shrink, "1"),
        "slope": rounded(shrinkage.slope),
        "placebo_shrink": rounded(shrinkage.placebo),
        "held_out": shrinkage.held_out,
    }


def _evidence(evidence: Evidence) -> Json:
    return {
        "feature": evidence.feature,
        "predicted_db": rounded(evidence.predicted_db),
        "observed_db": rounded(evidence.observed_db),
        "floor_db": rounded(evidence.floor_db),
        "speaks_for": evidence.speaks_for,
    }


def _next_recording(one: NextRecording) -> Json:
    return {
        **_point(one.point),
        "separates": list(one.separates),
        "distance_in_structural_floors": rounded(one.standard_deviations),
        "distance_now_in_structural_floors": rounded(one.now),
        "place": one.place,
        "text": one.text,
    }


def _spectrum(curves: SpectrumCurves) -> Json:
    return {
        "label": curves.label,
        "unit": curves.unit,
        "orders": _numbers(curves.orders),
        "measured": _numbers(curves.measured),
        "before": _numbers(curves.before),
        "after": _numbers(curves.after) or None,
        "floor": _numbers(curves.floor),
        "structural_floor_db": _numbers(curves.structural_db) or None,
    }


def _angles(curves: AngleCurves) -> Json:
    return {
        "shaft": curves.shaft,
        "unit": "1",
        "of": curves.unit,
        "n_teeth": curves.teeth,
        "has_mark": curves.has_mark,
        "angle_deg": _numbers(curves.angle_deg),
        "measured": _numbers(curves.measured),
        "before": _numbers(curves.before),
        "after": _numbers(curves.after) or None,
    }


def _numbers(values: FloatArray | tuple[float, ...]) -> list[float | None]:
    return [rounded(value) for value in values]
