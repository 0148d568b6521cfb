"""An error as one clear message: what is wrong, where, what is allowed, what to do."""

from __future__ import annotations

import streamlit as st

from app.dashboard.as_typed import as_typed
from gearsig.errors import GearsigError, InputError

_PLACES = {
    "--fs": "the sampling rate under 'Not in the file?'",
    "--speed-rpm": "the speed under 'Not in the file?'",
    "low_cut_hz": "the lowest frequency",
    "high_cut_hz": "the highest frequency",
    "n_modes": "K",
}
"""What the page calls the options of the command line and of functions that messages name."""


def show_error(error: GearsigError) -> None:
    """Show an error of the input; texts in it may come from the file."""
    if not isinstance(error, InputError):
        st.error(as_typed(_in_words_of_the_page(str(error))), icon=":material/help:")
        return
    lines = [f"**{as_typed(error.where)}**: {as_typed(error.what)}" if error.where else as_typed(error.what)]
    if error.allowed:
        lines.append(f"Allowed: {as_typed(error.allowed)}")
    if error.remedy:
        lines.append(f"What to do: {as_typed(_in_words_of_the_page(error.remedy))}")
    st.error("\n\n".join(lines), icon=":material/error:")


def _in_words_of_the_page(text: str) -> str:
    for option, place in _PLACES.items():
        text = text.replace(option, place)
    return text
