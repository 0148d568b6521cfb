"""A gap report as JSON, in a schema that stays: `gap.schema.json`, beside this file, describes every member.

Names end in their unit, or a value stands beside its "unit". Numbers carry nine significant digits; what is not known
or not defined is null, never nan or infinity. Within a version members may be added, never renamed or removed.
"""

from __future__ import annotations

import json
from dataclasses import replace
from math import inf, isnan
from pathlib import Path

from gearsig.cache import write_text
from gearsig.errors import InputError
from gearsig.gap import (
    Added,
    AngleCurves,
    AverageCurves,
    ConditionFacts,
    GapCause,
    GapPlace,
    GapReport,
    NextRecording,
    Shrinkage,
    SpectrumCurves,
)
from gearsig.report._json import Json, Layout, from_plain, head, plain

SCHEMA, SCHEMA_VERSION = "gearsig.gap", 3
FLOORS = "structural floors"


LAYOUTS = {
    GapReport: Layout({"repeatability": "size_in_repeatability_floors"}, null_if_empty=("twin_toml",)),
    ConditionFacts: Layout(inline=("point",)),
    GapPlace: Layout({"repeatability": "change_in_repeatability_floors", "structural": "change_in_structural_floors"}),
    Added: Layout({"name": "effect"}),
    Shrinkage: Layout({"placebo": "placebo_shrink", "elsewhere": "shrink_elsewhere"}),
    NextRecording: Layout(
        {"standard_deviations": "distance_in_structural_floors", "now": "distance_now_in_structural_floors"},
        inline=("point",),
    ),
    SpectrumCurves: Layout(
        {"structural_db": "structural_floor_db", "reference_structural_db": "reference_structural_floor_db"},
        null_if_empty=("after", "structural_db", "reference", "reference_floor", "reference_structural_db"),
    ),
    AngleCurves: Layout({"unit": "of", "teeth": "n_teeth"}, null_if_empty=("after",)),
    AverageCurves: Layout({"teeth": "n_teeth"}),
}
"""Where members are called otherwise than the fields, or are null."""


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
    result = head(SCHEMA, SCHEMA_VERSION) | {
        "outcome": report.outcome.value,
        "verdict": dict(zip(("where", "which", "how_far", "next"), report.verdict, strict=True)),
        "kind": None if report.kind is None else plain(report.kind, layouts=LAYOUTS),
        **plain(report, layouts=LAYOUTS),
    }
    _state_units(result)
    return result


def _state_units(result: Json) -> None:
    """Put the unit beside each value, which in the report stands elsewhere or is always the same."""
    for interval in (result["size"], *(step["remaining"] for step in result["steps"])):
        interval["unit"] = FLOORS
    for curves in result["angles"]:
        curves["unit"] = "1"
    for cause in result["causes"]:
        for value in (cause["severity"], cause["fitted"]):
            if value is not None:
                value["unit"] = cause["unit"]
        if (shrinkage := cause["shrinkage"]) is not None:
            shrinkage["before"]["unit"] = shrinkage["after"]["unit"] = FLOORS
            shrinkage["shrink"]["unit"] = "1"


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


OLD_NAMES = {"doubts": "warnings", "foretold": "predicted", "notices": "notes", "remarks": "notes", "left": "remaining"}
"""Member of version 1 or 2 → what it is called now."""


def _renamed(members: Json) -> Json:
    return {OLD_NAMES.get(name, name): value for name, value in members.items()}


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
        If the file cannot be read, or is no gap report of this version or an earlier one.
    """
    where = Path(path).name
    try:
        content = json.loads(Path(path).read_text(encoding="utf-8"), object_hook=_renamed)
    except OSError as error:
        raise InputError(f"cannot be read ({error.strerror})", where=str(path), remedy="check the path") from None
    except (ValueError, RecursionError):  # some text, or brackets without end
        raise InputError("is not JSON", where=where, remedy="`gearsig gap` writes gap.json") from None
    stated = (content.get("schema"), content.get("schema_version")) if isinstance(content, dict) else (None, None)
    if stated not in [(SCHEMA, version) for version in range(1, SCHEMA_VERSION + 1)]:
        raise InputError("is no gap report", where=where, allowed=f"schema {SCHEMA}, versions 1 to {SCHEMA_VERSION}")
    try:
        return gap_from_dict(content)
    except InputError as error:
        raise InputError(f"is damaged or not complete ({error.what})", where=where, remedy="make it anew") from None


def gap_from_dict(content: Json) -> GapReport:
    """Return the report that `gap_to_dict` made `content` of.

    Raises
    ------
    InputError
        If a member is missing or of another type.
    """
    report: GapReport = from_plain(GapReport, content, "report", LAYOUTS)
    return replace(report, causes=tuple(map(_unbounded, report.causes)))


def _unbounded(cause: GapCause) -> GapCause:
    """JSON knows no infinity: nothing bounds a severity that has no upper end."""
    if cause.severity is None or not isnan(cause.severity.high):
        return cause
    return replace(cause, severity=replace(cause.severity, high=inf))
