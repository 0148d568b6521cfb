"""A gap report as JSON, in a schema that stays: `gap.schema.json`, beside this file, describes every member.

Names end in their unit, or a value stands beside its "unit". Numbers carry nine significant digits; what is not known
or not defined is null, never nan or infinity. Within a version members may be added, never renamed or removed.
"""

from __future__ import annotations

import json
from collections.abc import Iterable
from pathlib import Path
from reprlib import repr as shortened
from types import NoneType
from typing import Any

import numpy as np

from gearsig import __version__
from gearsig.checks import FloatArray
from gearsig.errors import InputError
from gearsig.formatting import rounded
from gearsig.gap import (
    Added,
    AngleCurves,
    AverageCurves,
    ConditionFacts,
    Evidence,
    GapCause,
    GapOutcome,
    GapPlace,
    GapReport,
    GapStep,
    Interval,
    NextRecording,
    OperatingCondition,
    PlaceKind,
    Shrinkage,
    SpectrumCurves,
)
from gearsig.report._files import Json, members, plain, write_text

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


# --------------------
# gap.json back to a gap report: for programs that go on with what a diagnosis found.
# --------------------


_TYPES: dict[str, tuple[type, ...]] = {
    "object": (dict,),
    "array": (list,),
    "string": (str,),
    "boolean": (bool,),
    "null": (NoneType,),
    "integer": (int,),
    "number": (int, float),
}
"""Types that the schema names, as JSON is read."""


def read_gap_json(path: str | Path) -> GapReport:
    """Read a report that `write_gap_json` wrote.

    Parameters
    ----------
    path : str or Path

    Returns
    -------
    GapReport
        With nine significant digits; what was null is nan.

    Raises
    ------
    InputError
        If the file cannot be read, or is no gap report of this version.
    """
    where = Path(path).name
    try:
        found = json.loads(Path(path).read_text(encoding="utf-8"))
    except OSError as error:
        raise InputError(f"cannot be read ({error.strerror})", where=str(path), remedy="check the path") from None
    except (ValueError, RecursionError):  # some text, or brackets without end
        raise InputError("is not JSON", where=where, remedy="`gearsig gap` writes gap.json") from None
    stated = (found.get("schema"), found.get("schema_version")) if isinstance(found, dict) else (None, None)
    if stated != (SCHEMA, SCHEMA_VERSION):
        raise InputError("is no gap report", where=where, allowed=f"schema {SCHEMA}, version {SCHEMA_VERSION}")
    schema = gap_schema()
    try:
        _check_types(found, schema, schema["$defs"])
        return gap_from_dict(found)
    except (LookupError, TypeError, ValueError, AttributeError, OverflowError) as error:
        raise InputError(f"is damaged or not complete ({error!r})", where=where, remedy="make it anew") from None


def gap_from_dict(found: Json) -> GapReport:
    """Return the report that `gap_to_dict` made `found` of."""
    return GapReport(
        rig=found["rig"],
        simulator=found["simulator"],
        conditions=tuple(_condition_gap_reading(item) for item in found["conditions"]),
        references=tuple(found["references"]),
        outcome=GapOutcome(found["outcome"]),
        size=_interval_gap_reading(found["size"]),
        repeatability=_number(found["size_in_repeatability_floors"]),
        places=tuple(_place_gap_reading(item) for item in found["places"]),
        causes=tuple(_cause_gap_reading(item) for item in found["causes"]),
        groups={group: _number(value) for group, value in found["groups"].items()},
        inseparable=tuple(map(str, found["inseparable"])) if found["inseparable"] is not None else None,
        steps=tuple(GapStep(item["label"], _interval_gap_reading(item["left"])) for item in found["steps"]),
        next_recordings=tuple(_next_recording_gap_reading(item) for item in found["next_recordings"]),
        spectra=tuple(_spectrum_gap_reading(item) for item in found["spectra"]),
        angles=tuple(_angles_gap_reading(item) for item in found["angles"]),
        averages=tuple(_average_gap_reading(item) for item in found.get("averages", ())),
        notices=tuple(found["notices"]),
        twin_toml=found["twin_toml"] or "",
        doubts=tuple(found.get("doubts", ())),
    )


def _check_types(value: object, schema: Json, kinds: Json, where: str = "report") -> None:
    """Raise where a value, or one within it, is of another type than the schema says; members may be missing.

    Of the schema's language it knows the words for types that the schema of gap reports has.
    """
    if "anyOf" in schema:  # a kind, or null
        schema = schema["anyOf"][value is None]
    if "$ref" in schema:
        schema = kinds[schema["$ref"].rpartition("/")[2]]
    named = schema.get("type", ())
    allowed = (named,) if isinstance(named, str) else named
    if allowed and not any(type(value) in _TYPES[name] for name in allowed):
        raise TypeError(f"{where} is {shortened(value)}, not {' or '.join(allowed)}")
    if isinstance(value, dict):
        others = schema.get("additionalProperties", {})
        for key, part in value.items():
            if stated := schema.get("properties", {}).get(key, others):
                _check_types(part, stated, kinds, f"{where}.{key}")
    elif isinstance(value, list) and "items" in schema:
        for place, part in enumerate(value):
            _check_types(part, schema["items"], kinds, f"{where}[{place}]")


def _number(value: float | None) -> float:
    return float("nan") if value is None else float(value)


def _numbers(values: Iterable[float | None] | None) -> FloatArray:
    return np.array([_number(value) for value in values or ()], dtype=np.float64)


def _pair(values: Iterable[str]) -> tuple[str, str]:
    first, second = values
    return first, second


def _interval_gap_reading(found: Json) -> Interval:
    return Interval(_number(found["value"]), _number(found["low"]), _number(found["high"]))


def _severity(found: Json) -> Interval:
    """JSON knows no infinity: nothing bounds what has no upper end."""
    return _interval_gap_reading(found if found["high"] is not None else {**found, "high": float("inf")})


def _point(found: Json) -> OperatingCondition:
    return OperatingCondition(_number(found["speed_rpm"]), _number(found["torque_nm"]))


_LENGTHS = ("n_revolutions", "duration_s", "sampling_rate_hz")


def _condition_gap_reading(found: Json) -> ConditionFacts:
    n_revolutions, duration_s, rate_hz = (_number(found[key]) for key in _LENGTHS)
    point = _point(found)
    return ConditionFacts(found["name"], point, n_revolutions, duration_s, rate_hz, found.get("reference", ""))


def _place_gap_reading(found: Json) -> GapPlace:
    band = found["band_hz"]
    return GapPlace(
        PlaceKind(found["kind"]),
        found["title"],
        _number(found["change_db"]),
        _number(found["change_in_repeatability_floors"]),
        _number(found["change_in_structural_floors"]),
        _number(found["share"]),
        found["shaft"],
        tuple(_number(order) for order in found["orders"]),
        (_number(band[0]), _number(band[1])) if band is not None else None,
        None if found["angle_deg"] is None else _number(found["angle_deg"]),
        found["tooth"],
        found["channel"],
        found.get("follows", False),
    )


def _cause_gap_reading(found: Json) -> GapCause:
    return GapCause(
        found["name"],
        found["group"],
        found["title"],
        found["unit"],
        _number(found["probability"]),
        None if found["severity"] is None else _severity(found["severity"]),
        None if found["fitted"] is None else _added_gap_reading(found["fitted"]),
        found["place"],
        None if found["shrinkage"] is None else _shrinkage_gap_reading(found["shrinkage"]),
        tuple(_evidence(item) for item in found["evidence"]),
        found["is_nuisance"],
        tuple(found.get("remarks", ())),  # files of earlier versions of the program have none
    )


def _added_gap_reading(found: Json) -> Added:
    options: dict[str, Any] = {k: v if isinstance(v, str) else _number(v) for k, v in found["options"].items()}
    return Added(found["effect"], _number(found["severity"]), options)


def _shrinkage_gap_reading(found: Json) -> Shrinkage:
    before, after, shrink = (_interval_gap_reading(found[key]) for key in ("before", "after", "shrink"))
    slope, placebo = _number(found["slope"]), _number(found["placebo_shrink"])
    further = (found.get(name) for name in ("shrink_elsewhere", "foretold"))
    return Shrinkage(
        *(before, after, shrink, slope, placebo, found["held_out"], found.get("n_placebos", 1)),
        *(None if value is None else _number(value) for value in further),
    )


def _evidence(found: Json) -> Evidence:
    predicted, observed, floor = (_number(found[key]) for key in ("predicted_db", "observed_db", "floor_db"))
    return Evidence(found["feature"], predicted, observed, floor, found["speaks_for"], found.get("is_further", False))


def _next_recording_gap_reading(found: Json) -> NextRecording:
    there, now = (_number(found[f"distance_{when}in_structural_floors"]) for when in ("", "now_"))
    return NextRecording(_point(found), _pair(found["separates"]), there, now, found["text"], found.get("place", ""))


def _spectrum_gap_reading(found: Json) -> SpectrumCurves:
    curves = (_numbers(found[key]) for key in ("orders", "measured", "before", "after", "floor", "structural_floor_db"))
    names = ("reference", "reference_floor", "reference_structural_floor_db")  # earlier versions have none
    return SpectrumCurves(found["label"], found["unit"], *curves, *(_numbers(found.get(name)) for name in names))


def _angles_gap_reading(found: Json) -> AngleCurves:
    curves = (_numbers(found[key]) for key in ("angle_deg", "measured", "before", "after"))
    return AngleCurves(found["shaft"], found["of"], found["n_teeth"], found["has_mark"], *curves)


def _average_gap_reading(found: Json) -> AverageCurves:
    curves = (_numbers(found[key]) for key in ("angle_deg", "measured", "reference"))
    return AverageCurves(found["shaft"], found["unit"], found["channel"], found["n_teeth"], found["has_mark"], *curves)
