"""Results as JSON: the codec between dataclasses and JSON, and stable schemas for analyses and gap reports.

Names end in their unit, or a value is accompanied by its "unit". Numbers have nine significant digits; nan and
infinity, which JSON lacks, are null and read as nan. Within a version members may be added, never renamed or removed.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import MISSING, dataclass, field, fields, is_dataclass, replace
from enum import Enum
from math import inf, isnan
from pathlib import Path
from reprlib import repr as shortened
from types import NoneType, UnionType
from typing import Any, NoReturn, Union, get_args, get_origin

import numpy as np

from gearsig import __version__
from gearsig.angle import ShaftAngle
from gearsig.cache import write_text
from gearsig.checks import type_hints_of
from gearsig.diagnosis import Analysis, CannotTell, ChannelAnalysis, LongAnalysis, changes
from gearsig.errors import InputError
from gearsig.formatting import rounded
from gearsig.gap import (
    AddedEffect,
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
from gearsig.recording import Recording
from gearsig.severity import CrackEstimate, NoCrackSeen

# --------------------
# The codec: members named by fields or a layout, values typed by hints.
# --------------------


Json = dict[str, Any]


@dataclass(frozen=True)
class Layout:
    """How a dataclass is written to a file if its members differ from its fields.

    Parameters
    ----------
    names : mapping
        Field → member, if they differ.
    inline : tuple of str
        Fields that are dataclasses whose members are merged with the others.
    null_if_empty : tuple of str
        Fields with texts or arrays that are written as null if they are empty.
    left_out : tuple of str
        Fields that are not written; such a file cannot be read back.
    properties : tuple of str
        Properties written after the fields, for other programs.
    """

    names: Mapping[str, str] = field(default_factory=dict)
    inline: tuple[str, ...] = ()
    null_if_empty: tuple[str, ...] = ()
    left_out: tuple[str, ...] = ()
    properties: tuple[str, ...] = ()


Layouts = Mapping[type, Layout]
_AS_FIELDS = Layout()


def head(schema: str, version: int = 1) -> Json:
    """Return the first members of a file: its schema, schema version and the version of gearsig."""
    return {"schema": schema, "schema_version": version, "gearsig_version": __version__}


def document(schema: str, content: Json, version: int = 1) -> str:
    """Return the text of a file with its head and content."""
    return json.dumps(head(schema, version) | plain(content), indent=2, ensure_ascii=False, allow_nan=False) + "\n"


def members(value: object, *names: str) -> Json:
    """Return attributes and properties of a value by name, in the given order, each converted by `plain`.

    Examples
    --------
    >>> members(1.0 + 2.0j, "real", "imag")
    {'real': 1.0, 'imag': 2.0}
    """
    return {name: plain(getattr(value, name)) for name in names}


def plain(value: Any, *, arrays: bool = True, layouts: Layouts | None = None) -> Any:  # noqa: PLR0911  one line per kind
    """Convert a value to JSON types: dictionaries, lists, texts, numbers of nine digits and null.

    Parameters
    ----------
    value : object
    arrays : bool
        Whether arrays become lists; otherwise ``{"shape": […]}``.
    layouts : mapping, optional
        Dataclass → `Layout`; other dataclasses are written by their fields.
    """

    def written(part: Any) -> Any:
        return plain(part, arrays=arrays, layouts=layouts)

    if isinstance(value, np.ndarray):
        return [written(part) for part in value.tolist()] if arrays else {"shape": list(value.shape)}
    if is_dataclass(value):
        layout = (layouts or {}).get(type(value), _AS_FIELDS)
        result: Json = {}
        for item in fields(value):
            part = getattr(value, item.name)
            if item.name in layout.inline:
                result |= written(part)
            elif item.name not in layout.left_out:
                is_null = item.name in layout.null_if_empty and not len(part)
                result[layout.names.get(item.name, item.name)] = None if is_null else written(part)
        return result | {name: written(getattr(value, name)) for name in layout.properties}
    if isinstance(value, Mapping):
        return {str(key): written(part) for key, part in value.items()}
    if isinstance(value, (list, tuple)):
        return [written(part) for part in value]
    if isinstance(value, Enum):
        return str(value.value)
    if value is None or isinstance(value, (str, bool)):
        return value
    if isinstance(value, Path):
        return str(value)
    return int(value) if isinstance(value, (int, np.integer)) else rounded(value)


def from_plain(hint: Any, value: Any, where: str, layouts: Layouts | None = None) -> Any:  # noqa: PLR0911  one line per kind
    """Restore a value of type `hint` from what `plain` returned.

    Parameters
    ----------
    hint : type
        A dataclass, enumeration, `Path`, text, number, array, tuple or mapping of these, or a union with None.
    value : object
        As `json.loads` returns it; unknown members are ignored, so that later versions may add some.
    where : str
        Path of the value, for errors.
    layouts : mapping, optional
        Those it was written with.

    Raises
    ------
    InputError
        If a value has another type, or a member without default is missing.
    """
    origin, arguments = get_origin(hint), get_args(hint)
    if origin in (Union, UnionType):
        kinds = [kind for kind in arguments if kind is not NoneType]
        if value is None and NoneType in arguments:
            return None
        if len(kinds) > 1:
            kinds = [str] if str in kinds and isinstance(value, str) else [kind for kind in kinds if kind is not str]
        if kinds[0] in _JSON_NAMES and NoneType in arguments:
            return _typed(value, kinds[0], where, " or null")
        return from_plain(kinds[0], value, where, layouts)
    if is_dataclass(hint) and isinstance(hint, type):
        return _dataclass_from_plain(hint, _typed(value, dict, where), where, layouts)
    if origin is np.ndarray:
        parts = _typed(value, list, where)
        return np.array([from_plain(float, v, f"{where}[{i}]") for i, v in enumerate(parts)], dtype=np.float64)
    if origin is tuple:
        parts = _typed(value, list, where)
        kinds = [arguments[0]] * len(parts) if arguments[-1] is Ellipsis else list(arguments)
        if len(kinds) != len(parts):
            _fail(f"{where} has {len(parts)} values, not {len(kinds)}")
        return tuple(
            from_plain(k, v, f"{where}[{i}]", layouts) for i, (k, v) in enumerate(zip(kinds, parts, strict=True))
        )
    if isinstance(origin, type) and issubclass(origin, Mapping):
        parts = _typed(value, dict, where)
        return {key: from_plain(arguments[1], v, f"{where}.{key}", layouts) for key, v in parts.items()}
    if isinstance(hint, type) and issubclass(hint, (Enum, Path)):
        try:
            return hint(_typed(value, str, where))
        except ValueError:
            _fail(f"{where} is {shortened(value)}, which is not known")
    if hint is float:
        return _number(value, where)
    return _typed(value, hint, where)


def _dataclass_from_plain(kind: type, value: Json, where: str, layouts: Layouts | None) -> Any:
    layout = (layouts or {}).get(kind, _AS_FIELDS)
    hints = type_hints_of(kind)
    result = {}
    for item in fields(kind):
        name = layout.names.get(item.name, item.name)
        if item.name in layout.inline:
            result[item.name] = from_plain(hints[item.name], value, where, layouts)
        elif name not in value:
            if item.default is MISSING and item.default_factory is MISSING:
                _fail(f"{where} has no member {name!r}")
        elif value[name] is None and item.name in layout.null_if_empty:
            result[item.name] = "" if hints[item.name] is str else np.zeros(0)
        else:
            result[item.name] = from_plain(hints[item.name], value[name], f"{where}.{name}", layouts)
    return kind(**result)


def _number(value: Any, where: str) -> float:
    if value is None:
        return float("nan")
    if type(value) not in (int, float):
        _fail(f"{where} is {shortened(value)}, not number or null")
    try:
        return float(value)
    except OverflowError:
        _fail(f"{where} is too large")


_JSON_NAMES = {dict: "object", list: "array", str: "string", bool: "boolean", int: "integer"}


def _typed(value: Any, kind: type, where: str, or_null: str = "") -> Any:
    if type(value) is not kind:  # not isinstance: True is not an integer
        _fail(f"{where} is {shortened(value)}, not {_JSON_NAMES[kind]}{or_null}")
    return value


def _fail(what: str) -> NoReturn:
    raise InputError(what, remedy="make the file again")


# --------------------
# An analysis.
# --------------------


def analysis_to_dict(analysis: Analysis, *, arrays: bool = False) -> Json:
    """Return an analysis as plain dictionaries, lists, texts and numbers.

    Parameters
    ----------
    analysis : Analysis
    arrays : bool
        Whether to include the values of spectra, maps and averages, which are large for a long recording.

    Returns
    -------
    dict
        Accepted by `json.dumps(..., allow_nan=False)`.

    Notes
    -----
    Unknown or undefined values are null. The members:

    - ``schema``: "gearsig.analysis", ``schema_version``: 1, ``gearsig_version``
    - ``outcome``: "fault", "suspicion", "cannot tell" or "no fault"
    - ``verdict``: one sentence
    - ``findings``: most important first; each with ``code``, ``kind`` ("fault", "suspicion", "data problem", "cannot
      tell", "notice", "information"), ``title``, ``where``, ``strength`` (or null), ``confidence``,
      ``confidence_basis``, ``evidence``, ``surer``
    - ``speed``: ``known``; if true ``shaft``, ``method``, ``mean_rpm``, ``lowest_rpm``, ``highest_rpm``,
      ``relative_uncertainty``, ``quality``, ``n_revolutions``, ``notes``; if false ``question``, ``reason``, ``remedy``
    - ``indicators``: each with ``name``, ``value``, ``unit``, ``channel``, ``computed_on``, ``shaft``, ``gear``,
      ``band``, ``note``; ``reference_value`` and ``change_db``, null if there is no reference or it lacks the indicator
    - ``recording``: ``source``, ``sha256``, ``reader``, ``history``, ``warnings``, ``sampling_rate_hz``, ``n_samples``,
      ``duration_s``, ``channels``, ``speed_source``
    - ``rig``: what is known of the machine, or null
    - ``channels``: for each analysed channel, the description of its spectra and averages; arrays as
      ``{"shape": […]}``, or as lists if requested; ``order_levels`` always with their
      values, and ``largest``, ``largest_at_rpm``, ``largest_at_hz``
    - ``settings``: the parameters in effect
    - ``crack``: null if not requested and none is clear; else ``answer`` ("crack", "none seen", "cannot tell") with
      ``text``, ``shaft``, ``gear``, ``tooth``, ``angle_deg``, ``depth_mm``, ``interval_mm`` and the like; with
      ``below_mm``; or with ``reason`` and ``remedy``
    - ``reference``: null, or ``source``, ``sha256``, ``outcome``, ``verdict`` of the reference recording
    - ``level_changes``: changes since the reference of lines, sidebands, bearing parts and noise by channel: ``label``,
      ``kind``, ``where``, ``harmonic``, ``unit``, ``level_db`` and ``reference_db`` (rms, dB re one unit),
      ``change_db``, ``repeatability_db`` (half against half), ``p_value``, ``is_change``, ``stands_out``; empty
      without a reference
    """
    return head("gearsig.analysis") | {
        "outcome": analysis.outcome.value,
        "verdict": analysis.verdict,
        "findings": [plain(finding, arrays=False) for finding in analysis.findings],
        "speed": _speed(analysis.shaft_angle, arrays=arrays),
        "indicators": _indicators(analysis),
        "recording": _recording_facts(analysis.recording),
        "rig": plain(analysis.rig, arrays=False),
        "channels": [_channel(channel, arrays=arrays) for channel in analysis.channels],
        "settings": plain(analysis.settings, arrays=False),
        "crack": _crack(analysis.crack),
        "reference": _reference(analysis.reference),
        "level_changes": [plain(c, arrays=False) | {"change_db": rounded(c.change_db)} for c in analysis.level_changes],
    }


def analysis_to_json(analysis: Analysis, *, arrays: bool = False) -> str:
    """Return an analysis as JSON text; see `analysis_to_dict`."""
    indent = None if arrays else 2
    return json.dumps(analysis_to_dict(analysis, arrays=arrays), indent=indent, ensure_ascii=False, allow_nan=False)


def write_json(analysis: Analysis, path: str | Path, *, arrays: bool = False) -> Path:
    """Write an analysis as JSON; the file appears only when it is complete."""
    return write_text(Path(path), analysis_to_json(analysis, arrays=arrays) + "\n")


def _recording_facts(recording: Recording) -> Json:
    origin, speed = recording.provenance, recording.speed_source
    return {
        **members(origin, "source", "sha256", "reader"),
        "history": list(origin.history),
        "warnings": list(recording.warnings),
        "sampling_rate_hz": recording.sampling_rate_hz,
        "n_samples": recording.n_samples,
        "duration_s": rounded(recording.duration_s),
        "channels": [plain(channel, arrays=False) for channel in recording.channels],
        "speed_source": None if speed is None else {"kind": type(speed).__name__, **plain(speed, arrays=False)},
    }


def _speed(angle: ShaftAngle | CannotTell, *, arrays: bool) -> Json:
    if isinstance(angle, CannotTell):
        return {"known": False, **plain(angle, arrays=False)}
    lowest, highest = angle.speed_range_rpm
    result = {
        "known": True,
        **members(angle, "shaft", "method"),
        "mean_rpm": rounded(angle.mean_speed_rpm),
        "lowest_rpm": rounded(lowest),
        "highest_rpm": rounded(highest),
        "relative_uncertainty": rounded(angle.relative_speed_uncertainty),
        **members(angle, "quality", "n_revolutions", "notes"),
    }
    return result | (members(angle, "time_s", "revolutions") if arrays else {})


def _indicators(analysis: Analysis) -> list[Json]:
    nothing: Json = {"reference_value": None, "change_db": None}
    return [
        plain(indicator, arrays=False) | (nothing if change is None else plain(change, arrays=False))
        for indicator, change in zip(analysis.indicators, changes(analysis), strict=True)
    ]


def _crack(answer: CrackEstimate | NoCrackSeen | CannotTell | None) -> Json | None:
    if answer is None:
        return None
    if isinstance(answer, CannotTell):
        return {"answer": "cannot tell", **plain(answer, arrays=False)}
    kind, content = "crack" if isinstance(answer, CrackEstimate) else "none seen", plain(answer, arrays=False)
    content.pop("searched", None)  # only for the figure
    return {"answer": kind, "text": answer.text, **content}


def _reference(reference: Analysis | None) -> Json | None:
    if reference is None:
        return None
    return members(reference.recording.provenance, "source", "sha256") | members(reference, "outcome", "verdict")


def _channel(channel: ChannelAnalysis, *, arrays: bool) -> Json:
    result: Json = plain(channel, arrays=arrays)
    result["averages"] = [plain(average, arrays=arrays) for average in channel.averages.values()]
    result["order_levels"] = [
        plain(level, arrays=True)
        | dict(zip(("largest", "largest_at_rpm", "largest_at_hz"), map(rounded, level.largest), strict=True))
        for level in channel.order_levels
    ]
    return result


def long_analysis_to_json(analysis: LongAnalysis) -> str:
    """Return a long analysis as JSON text, with each part as in `analysis_to_dict`."""
    levels = ("channel_names", "units", "time_s", "rms", "peak", "crest_factor", "kurtosis")
    parts = [
        {"start_s": p.start_s, "end_s": p.end_s, "reason": p.reason, "analysis": analysis_to_dict(p.analysis)}
        for p in analysis.parts
    ]
    content = {
        "outcome": analysis.outcome.value,
        "verdict": analysis.verdict,
        "duration_s": analysis.duration_s,
        "overview": members(analysis.overview, *levels),
        "parts": parts,
    }
    return json.dumps(content, ensure_ascii=False, allow_nan=False)


# --------------------
# A gap report; `gap.schema.json`, beside this file, describes all members.
# --------------------


GAP_SCHEMA, GAP_VERSION = "gearsig.gap", 3
FLOORS = "structural floors"


GAP_LAYOUTS = {
    GapReport: Layout({"repeatability": "size_in_repeatability_floors"}, null_if_empty=("twin_toml",)),
    ConditionFacts: Layout(inline=("point",)),
    GapPlace: Layout({"repeatability": "change_in_repeatability_floors", "structural": "change_in_structural_floors"}),
    AddedEffect: Layout({"name": "effect"}),
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
"""Dataclasses whose members differ in name from their fields, or may be null."""


def gap_to_dict(report: GapReport) -> Json:
    """Return a gap report as plain dictionaries, lists, texts and numbers.

    Parameters
    ----------
    report : GapReport

    Returns
    -------
    dict
        Accepted by `json.dumps(..., allow_nan=False)`; conforms to `gap.schema.json`.
    """
    result = head(GAP_SCHEMA, GAP_VERSION) | {
        "outcome": report.outcome.value,
        "verdict": dict(zip(("where", "which", "how_far", "next"), report.verdict, strict=True)),
        "kind": None if report.kind is None else plain(report.kind, layouts=GAP_LAYOUTS),
        **plain(report, layouts=GAP_LAYOUTS),
    }
    _state_units(result)
    return result


def _state_units(result: Json) -> None:
    """Add a unit to each value, as units are elsewhere in the report or fixed."""
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
    """Return a gap report as JSON text; see `gap_to_dict`."""
    return json.dumps(gap_to_dict(report), indent=1, ensure_ascii=False, allow_nan=False) + "\n"


def write_gap_json(report: GapReport, path: str | Path) -> Path:
    """Write a gap report as JSON; the file appears only when it is complete."""
    return write_text(Path(path), gap_to_json(report))


def gap_schema() -> Json:
    """Return the JSON Schema (2020-12) for reports of this version."""
    schema: Json = json.loads(Path(__file__).with_name("gap.schema.json").read_text(encoding="utf-8"))
    return schema


OLD_NAMES = {"doubts": "warnings", "foretold": "predicted", "notices": "notes", "remarks": "notes", "left": "remaining"}
"""Member of version 1 or 2 → its present name."""


def _renamed(members: Json) -> Json:
    return {OLD_NAMES.get(name, name): value for name, value in members.items()}


def read_gap_json(path: str | Path) -> GapReport:
    """Read a report written by `write_gap_json`.

    Parameters
    ----------
    path : str or Path

    Returns
    -------
    GapReport
        With nine significant digits; null becomes nan.

    Raises
    ------
    InputError
        If the file cannot be read, or is not a gap report of this or an earlier version.
    """
    where = Path(path).name
    try:
        content = json.loads(Path(path).read_text(encoding="utf-8"), object_hook=_renamed)
    except OSError as error:
        raise InputError(f"cannot be read ({error.strerror})", where=str(path), remedy="check the path") from None
    except (ValueError, RecursionError):  # other text, or endless nesting
        raise InputError("is not JSON", where=where, remedy="`gearsig gap` writes gap.json") from None
    stated = (content.get("schema"), content.get("schema_version")) if isinstance(content, dict) else (None, None)
    if stated not in [(GAP_SCHEMA, version) for version in range(1, GAP_VERSION + 1)]:
        raise InputError("is no gap report", where=where, allowed=f"schema {GAP_SCHEMA}, versions 1 to {GAP_VERSION}")
    try:
        return gap_from_dict(content)
    except InputError as error:
        raise InputError(f"is damaged or not complete ({error.what})", where=where, remedy="make it again") from None


def gap_from_dict(content: Json) -> GapReport:
    """Restore a report from the dictionary that `gap_to_dict` returned.

    Raises
    ------
    InputError
        If a member is missing or has another type.
    """
    report: GapReport = from_plain(GapReport, content, "report", GAP_LAYOUTS)
    return replace(report, causes=tuple(map(_unbounded, report.causes)))


def _unbounded(cause: GapCause) -> GapCause:
    """Restore the infinite upper limit of a severity, which JSON cannot represent."""
    if cause.severity is None or not isnan(cause.severity.high):
        return cause
    return replace(cause, severity=replace(cause.severity, high=inf))
