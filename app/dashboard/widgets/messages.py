"""Messages on a page: an error with what is allowed and what to do; warnings of an answer."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import streamlit as st

from app.dashboard.theme import as_typed
from gearsig.diagnosis import CannotTell
from gearsig.errors import GearsigError, InputError

_PLACES = {
    "--fs": "the sampling rate, below or under Machine",
    "--speed-rpm": "the constant speed, below or under Machine",
    "given with --reference": "chosen on the left as healthy machine",
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
    "set lowest to": "set the lowest line shown to",
}
"""What the page calls the options of the command line and of functions that messages name."""


def show_error(error: GearsigError) -> None:
    """Show an error of the input; texts in it may come from the file."""
    if not isinstance(error, InputError):
        st.error(as_typed(in_page_words(str(error))), icon=":material/help:")
        return
    what = as_typed(in_page_words(error.what))
    lines = [f"**{as_typed(_PLACES.get(error.where, error.where))}**: {what}" if error.where else what]
    if error.allowed:
        lines.append(f"Allowed: {as_typed(error.allowed)}")
    if error.remedy:
        lines.append(f"What to do: {as_typed(in_page_words(error.remedy))}")
    st.error("\n\n".join(lines), icon=":material/error:")


def in_page_words(text: str) -> str:
    """Return a text with the page's names of what the command line calls by its options."""
    for option, place in _PLACES.items():
        text = text.replace(option, place)
    return text


def show_warnings(warnings: Sequence[str], *, quiet: bool = False) -> None:
    """Show what an answer says about itself, as one warning or quietly as small print; names in it come from files."""
    if not warnings:
        return
    text = as_typed(warnings[0]) if len(warnings) == 1 else "\n".join(f"- {as_typed(text)}" for text in warnings)
    if quiet:
        st.caption(text)
    else:
        st.warning(text, icon=":material/warning:")


def show_unknown_speed(reason: CannotTell) -> None:
    """Say why there is no speed and what would give it."""
    remedy = f"\n\nWhat would give it: {as_typed(reason.remedy)}" if reason.remedy else ""
    hint = "\n\nA constant speed can be given under *Machine*."
    st.info(f"The speed is not known: {as_typed(reason.reason)}{remedy}{hint}", icon=":material/help:")


def show_facts(columns: Iterable[Any], facts: Mapping[str, str]) -> None:
    """Show names with what is known of them, one in each column; texts may come from files."""
    for column, (name, text) in zip(columns, facts.items(), strict=True):
        column.caption(name)
        column.markdown(f"**{as_typed(text)}**")
