"""Texts on a page: names from files as they were typed, errors in the page's words, warnings, tables, facts."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from math import isnan
from typing import TYPE_CHECKING, Any, Literal

import streamlit as st

from gearsig.diagnosis import CannotTell
from gearsig.errors import GearsigError, InputError
from gearsig.formatting import sentence, with_minus

if TYPE_CHECKING:
    from pandas import DataFrame


# --------------------
# Untrusted text, shown as it was typed: file, channel and machine names are never markup.
# --------------------


_MARKUP = re.compile(r"([!-/:-@\[-`{-~])")  # ASCII punctuation, all of which Markdown lets a backslash escape
# Streamlit and its Markdown dialect replace these after the escapes are gone: emoji and icons (:name:), arrows (->),
# addresses (http:, www., a@b). A word joiner, which has no width, breaks the pattern but keeps the appearance.
_REPLACED = re.compile(r"(?<=[:@])(?=\S)|(?<=[-<>~=])(?=[-<>~=])|(?<=www)(?=\.)|(?<=www\.)", re.IGNORECASE)
_JOINER = "\u2060"
# Marks that reverse the direction of text, and invisible ones, may make one name look like another.
_INVISIBLE = re.compile(r"[\u200b-\u200f\u202a-\u202e\u2060-\u2069\ufeff]")
_UNIT = re.compile(r"(?<=\d) (?=(?:%|dB|k?Hz|rpm|[mµ]?m|m/s|N·m|k?N|m?s|J|g|of)(?![\w·]))")


def as_typed(text: object) -> str:
    r"""Return Markdown that shows `text` literally; where it wraps, numbers stay with their units.

    Examples
    --------
    >>> as_typed("*a1*: 2.3 mm (34 %) at 1500 rpm, 12 of 29")
    '\\*a1\\*\\: 2\\.3\xa0mm \\(34\xa0\\%\\) at 1500\xa0rpm\\, 12\xa0of 29'
    """
    return _MARKUP.sub(r"\\\1", _REPLACED.sub(_JOINER, _UNIT.sub("\u00a0", one_line(text))))


def one_line(text: object) -> str:
    """Return `text` on one line without control characters."""
    line = "".join(c if c.isprintable() else " " for c in _INVISIBLE.sub(" ", str(text)))
    return " ".join(line.split())


def capitalised(text: str) -> str:
    """Return `text` with a capital first letter, the others as they are."""
    return text[:1].upper() + text[1:]


# --------------------
# Messages: an error with what is allowed and what to do; warnings of an answer.
# --------------------


FORM_TABLES = {
    "shaft": "Shafts",
    "pair": "Gear pairs",
    "bearing": "Bearings",
    "sensor": "Sensors",
    "speed": "Speed",
    "operating_point": "Nominal operating point",
    "machine": "Size and mounting",
}
"""What the form of the machine calls the tables of a rig file."""
FORM_LABELS = {
    "direction": "turns",
    "driver_teeth": "driver teeth",
    "driven_teeth": "driven teeth",
    "module_mm": "module (mm)",
    "face_width_mm": "width (mm)",
    "pressure_angle_deg": "pressure angle (°)",
    "n_rolling_elements": "elements",
    "rolling_element_diameter_mm": "Ø element (mm)",
    "pitch_diameter_mm": "Ø pitch (mm)",
    "contact_angle_deg": "contact angle (°)",
    "bpfo_order": "BPFO (order of its shaft)",
    "bpfi_order": "BPFI (order of its shaft)",
    "bsf_order": "BSF (order of its shaft)",
    "ftf_order": "FTF (order of its shaft)",
    "bearing": "catalogue",
    "speed_rpm": "Speed (rpm)",
    "speed_tolerance_percent": "Speed tolerance (± %)",
    "torque_nm": "Torque (N·m)",
    "power_kw": "Rated power (kW)",
    "shaft_height_mm": "Shaft height (mm)",
    "pulses_per_revolution": "Pulses per revolution",
    "units_per_revolution": "Units per revolution",
    "rpm_per_unit": "rpm per unit",
    "sampling_rate_hz": "Sampling rate (Hz)",
}
"""What the form of the machine calls the keys of a rig file; other keys keep their own names."""
PAGE_TEXTS = {
    "--fs or sampling_rate_hz in the rig file": "the sampling rate, below or under Machine",
    "--fs": "the sampling rate, below or under Machine",
    "gearsig analyze RECORDING --tach-times FILE (in Python speed=gearsig.recording.read_pulse_times(path))": "open "
    "that one, and give them as Speed from pulse times under Machine",
    "give them with --tach-times FILE": "choose them as Speed from pulse times under Machine",
    "--tach-times": "pulse times under Machine",
    "--sim-speed-rpm": "the simulation's speed",
    "--speed-rpm": "the constant speed, below or under Machine",
    "given with --reference": "chosen on the left as healthy machine",
    "with --reference-fs": "on the left",
    "--reference-fs or sampling_rate_hz in the rig file": "its sampling rate on the left",
    "--reference-fs": "its sampling rate on the left",
    "--reference": "the healthy machine on the left",
    "low_cut_hz": "the lowest frequency",
    "high_cut_hz": "the highest frequency",
    "n_modes": "K",
    "n_levels": "the number of levels",
    "highest_modulation_hz": "the highest modulation",
    "highest_alpha_hz": "the highest cyclic frequency",
    "highest_order": "the highest cyclic order",
    "window_length": "the window",
    "half_width": "the band around the ridge",
    "; `gearsig rig example` prints one to start from": ", or the same in the form under Machine",
    "`gearsig rig bearings` lists them": "the column catalogue lists them",
    "set lowest to": "set the lowest line shown to",
    "[speed] in the rig file": "the speed under Machine",
    "[machine] in the rig file": "size and mounting under Machine",
    "[machine] of the rig file": "size and mounting under Machine",
    "operating_point.": "nominal ",
    "the teeth in a rig file": "the teeth under Machine",
    "Give the bearings in the rig file": "Describe the bearings under Machine",
    "/s^2": "/s²",
}
"""What the page calls the options of the command line, of functions and of rig files that appear in messages."""
_ROW = re.compile(r"(?:[^\[\]]*: )?\[\[(\w+)\]\] (\d+)(?:: (\w+))?")
_TABLE = re.compile(r"(?:(an?)|(?:the rig(?: file)?'s|its)) \[\[(\w+)\]\](?: tables?)?(?: in the rig file)?")
_KEY = re.compile(rf"\b(?:{'|'.join(key for key in FORM_LABELS if '_' in key)})\b")
_SINGLE = re.compile(r"(?:[^\[\]]*: )?\[(speed|operating_point|machine)\](?:: (\w+))?")
_FILE = re.compile(r"(?:rig|rig\.toml)|[^\[\]]*: (\w+)")
"""The name that a machine without a rig file has, or a key of the file itself."""


def show_error(error: GearsigError) -> None:
    """Show an input error; texts in it may come from the file."""
    if not isinstance(error, InputError):
        st.error(as_typed(in_page_text(str(error))), icon=":material/help:")
        return
    what = as_typed(in_page_text(error.what))
    lines = [f"**{as_typed(place_in_form(error.where))}**: {what}" if error.where else what]
    if error.allowed:
        lines.append(f"Allowed: {as_typed(in_page_text(error.allowed))}")
    if error.remedy:
        lines.append(f"What to do: {as_typed(in_page_text(error.remedy))}")
    st.error("\n\n".join(lines), icon=":material/error:")


def place_in_form(where: str) -> str:
    """Return what the page calls the place of an error, e.g. in a rig file.

    Examples
    --------
    >>> place_in_form("rig.toml: [[bearing]] 1: pitch_diameter_mm"), place_in_form("rig: [speed]"), place_in_form("rig")
    ('Bearings, row 1, Ø pitch (mm)', 'Speed', 'Machine')
    """
    row = _ROW.fullmatch(where)
    if row is not None and row[1] in FORM_TABLES:
        return ", ".join(filter(None, (FORM_TABLES[row[1]], f"row {row[2]}", FORM_LABELS.get(row[3], row[3]))))
    single, whole = _SINGLE.fullmatch(where), _FILE.fullmatch(where)
    if single is not None:
        return ", ".join(filter(None, (FORM_TABLES[single[1]], FORM_LABELS.get(single[2], single[2]))))
    key = whole[1] if whole is not None else None
    if whole is not None and (key is None or key in FORM_LABELS):
        return FORM_LABELS[key] if key is not None else "Machine"
    return PAGE_TEXTS.get(where, where)


def in_page_text(text: str) -> str:
    """Return a text with command-line options and rig-file keys replaced by the page's names for them.

    Examples
    --------
    >>> in_page_text("add a [[shaft]] with that name"), in_page_text("speed_rpm must be given")
    ('add a row of Shafts with that name', 'Speed (rpm) must be given')
    """
    for option, place in PAGE_TEXTS.items():
        text = text.replace(option, place)
    text = _ROW.sub(lambda match: place_in_form(match[0]), text)
    text = _TABLE.sub(lambda match: f"{'a row of ' if match[1] else ''}{FORM_TABLES.get(match[2], match[2])}", text)
    return _KEY.sub(lambda match: FORM_LABELS[match[0]], text)


def show_warnings(warnings: Sequence[str], *, quiet: bool = False) -> None:
    """Show an answer's warnings in one box, or quietly as small print; names in them come from files."""
    if not warnings:
        return
    lines = [as_typed(in_page_text(sentence(text))) for text in warnings]
    text = lines[0] if len(lines) == 1 else "\n".join(f"- {line}" for line in lines)
    if quiet:
        st.caption(text)
    else:
        st.warning(text, icon=":material/warning:")


def show_checks(checks: Iterable[tuple[bool, str]]) -> None:
    """Show line by line which statements hold and which do not; texts may come from files."""
    with st.container(key="checks", gap=None):
        for holds, text in checks:
            mark = ":green[:material/check:]" if holds else ":orange[:material/priority_high:]"
            st.markdown(f"{mark} {as_typed(text)}")


def show_unknown_speed(reason: CannotTell) -> None:
    """Say why there is no speed and what would give it."""
    remedy = f"\n\nWhat would help: {as_typed(in_page_text(reason.remedy))}" if reason.remedy else ""
    hint = "\n\nA constant speed, or a file of tachometer pulse times, can be given under *Machine*."
    st.info(f"The speed is not known: {as_typed(reason.reason)}{remedy}{hint}", icon=":material/help:")


# --------------------
# Tables of results that can be sorted and searched, tables of text whose cells wrap, and single facts.
# --------------------


def show_table(
    columns: DataFrame | Mapping[str, Any] | Sequence[Mapping[str, Any]],
    *,
    formats: Mapping[str, str | Callable[[float], str]] | None = None,
    number: str = ".5g",
    **looks: Any,
) -> None:
    """Show a table that sorts by its numbers, although they are written with the minus sign of axes and texts.

    Parameters
    ----------
    columns : DataFrame, mapping of columns, or sequence of rows
    formats : mapping or None
        Formats of single columns, or functions that format their numbers.
    number : str
        Format of the other numbers.
    **looks
        As `streamlit.dataframe` takes them.
    """
    import pandas as pd

    frame = pd.DataFrame(columns)
    named = {name: number for name in frame if frame[name].dtype.kind in "fiu"} | dict(formats or {})
    written: dict[Any, Any] = {
        name: form if callable(form) else partial(number_text, form=form) for name, form in named.items()
    }
    st.dataframe(frame.style.format(written, na_rep=""), hide_index=True, **looks)


def number_text(value: float, form: str) -> str:
    """Return a number as text; empty if it is not known, which the table marks itself.

    Examples
    --------
    >>> number_text(-1.5e-07, ".4g"), number_text(3.0, "+.1f"), number_text(float("nan"), ".3g")
    ('−1.5e−07', '+3.0', '')
    """
    return "" if value is None or isnan(value) else with_minus(format(value, form)).replace("e-", "e−")


def show_wrapping_table(columns: Mapping[str, Sequence[Any]], *, border: bool | Literal["horizontal"] = True) -> None:
    """Show a short table whose cells wrap; nothing if it has no rows. Texts may come from files."""
    import pandas as pd

    frame = pd.DataFrame({name: [as_typed(text) for text in texts] for name, texts in columns.items()})
    if len(frame):
        st.table(frame, border=border, hide_index=True)


def show_facts(columns: Iterable[Any], facts: Mapping[str, str]) -> None:
    """Show names with their values, one in each column; texts may come from files."""
    for column, (name, text) in zip(columns, facts.items(), strict=True):
        column.caption(name)
        column.markdown(f"**{as_typed(text)}**")
