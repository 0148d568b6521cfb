"""gap.json back to a gap report: for programs that go on with what a diagnosis found."""

from __future__ import annotations

import json
from collections.abc import Iterable
from pathlib import Path
from reprlib import repr as shortened
from types import NoneType
from typing import Any

import numpy as np

from gearsig.checks import FloatArray
from gearsig.errors import InputError
from gearsig.gap.curve_types import AngleCurves, AverageCurves, SpectrumCurves
from gearsig.gap.simulator import Added, Point
from gearsig.gap.types import (
    ConditionFacts,
    Evidence,
    GapCause,
    GapOutcome,
    GapPlace,
    GapReport,
    GapStep,
    Interval,
    NextRecording,
    PlaceKind,
    Shrinkage,
)
from gearsig.report.gap_json import SCHEMA, SCHEMA_VERSION, gap_schema
from gearsig.report.plain import Json

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
        conditions=tuple(_condition(item) for item in found["conditions"]),
        references=tuple(found["references"]),
        outcome=GapOutcome(found["outcome"]),
        size=_interval(found["size"]),
        repeatability=_number(found["size_in_repeatability_floors"]),
        places=tuple(_place(item) for item in found["places"]),
        causes=tuple(_cause(item) for item in found["causes"]),
        groups={group: _number(value) for group, value in found["groups"].items()},
        inseparable=tuple(map(str, found["inseparable"])) if found["inseparable"] is not None else None,
        steps=tuple(GapStep(item["label"], _interval(item["left"])) for item in found["steps"]),
        next_recordings=tuple(_next_recording(item) for item in found["next_recordings"]),
        spectra=tuple(_spectrum(item) for item in found["spectra"]),
        angles=tuple(_angles(item) for item in found["angles"]),
        averages=tuple(_average(item) for item in found.get("averages", ())),
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


def _interval(found: Json) -> Interval:
    return Interval(_number(found["value"]), _number(found["low"]), _number(found["high"]))


def _severity(found: Json) -> Interval:
    """JSON knows no infinity: nothing bounds what has no upper end."""
    return _interval(found if found["high"] is not None else {**found, "high": float("inf")})


def _point(found: Json) -> Point:
    return Point(_number(found["speed_rpm"]), _number(found["torque_nm"]))


_LENGTHS = ("n_revolutions", "duration_s", "sampling_rate_hz")


def _condition(found: Json) -> ConditionFacts:
    n_revolutions, duration_s, rate_hz = (_number(found[key]) for key in _LENGTHS)
    point = _point(found)
    return ConditionFacts(found["name"], point, n_revolutions, duration_s, rate_hz, found.get("reference", ""))


def _place(found: Json) -> GapPlace:
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


def _cause(found: Json) -> GapCause:
    return GapCause(
        found["name"],
        found["group"],
        found["title"],
        found["unit"],
        _number(found["probability"]),
        None if found["severity"] is None else _severity(found["severity"]),
        None if found["fitted"] is None else _added(found["fitted"]),
        found["place"],
        None if found["shrinkage"] is None else _shrinkage(found["shrinkage"]),
        tuple(_evidence(item) for item in found["evidence"]),
        found["is_nuisance"],
        tuple(found.get("remarks", ())),  # files of earlier versions of the program have none
    )


def _added(found: Json) -> Added:
    options: dict[str, Any] = {k: v if isinstance(v, str) else _number(v) for k, v in found["options"].items()}
    return Added(found["effect"], _number(found["severity"]), options)


def _shrinkage(found: Json) -> Shrinkage:
    before, after, shrink = (_interval(found[key]) for key in ("before", "after", "shrink"))
    slope, placebo = _number(found["slope"]), _number(found["placebo_shrink"])
    further = (found.get(name) for name in ("shrink_elsewhere", "foretold"))
    return Shrinkage(
        *(before, after, shrink, slope, placebo, found["held_out"], found.get("n_placebos", 1)),
        *(None if value is None else _number(value) for value in further),
    )


def _evidence(found: Json) -> Evidence:
    predicted, observed, floor = (_number(found[key]) for key in ("predicted_db", "observed_db", "floor_db"))
    return Evidence(found["feature"], predicted, observed, floor, found["speaks_for"], found.get("is_further", False))


def _next_recording(found: Json) -> NextRecording:
    there, now = (_number(found[f"distance_{when}in_structural_floors"]) for when in ("", "now_"))
    return NextRecording(_point(found), _pair(found["separates"]), there, now, found["text"], found.get("place", ""))


def _spectrum(found: Json) -> SpectrumCurves:
    curves = (_numbers(found[key]) for key in ("orders", "measured", "before", "after", "floor", "structural_floor_db"))
    names = ("reference", "reference_floor", "reference_structural_floor_db")  # earlier versions have none
    return SpectrumCurves(found["label"], found["unit"], *curves, *(_numbers(found.get(name)) for name in names))


def _angles(found: Json) -> AngleCurves:
    curves = (_numbers(found[key]) for key in ("angle_deg", "measured", "before", "after"))
    return AngleCurves(found["shaft"], found["of"], found["n_teeth"], found["has_mark"], *curves)


def _average(found: Json) -> AverageCurves:
    curves = (_numbers(found[key]) for key in ("angle_deg", "measured", "reference"))
    return AverageCurves(found["shaft"], found["unit"], found["channel"], found["n_teeth"], found["has_mark"], *curves)
