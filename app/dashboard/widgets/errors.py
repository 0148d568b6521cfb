"""An error as one clear message: what is wrong, where, what is allowed, what to do."""

from __future__ import annotations

import streamlit as st

from app.dashboard.as_typed import as_typed
from gearsig.errors import GearsigError, InputError

_PLACES = {
    "--fs": "the sampling rate under 'Not in the file?'",
    "--speed-rpm": "the speed under 'Not in the file?'",
}
"""Where the page has what a message names as an option of the command line."""


def show_error(error: GearsigError) -> None:
    """Show an error of the input; texts in it may come from the file."""
    if not isinstance(error, InputError):
        st.error(as_typed(error), icon=":material/help:")
        return
    lines = [f"**{as_typed(error.where)}**: {as_typed(error.what)}" if error.where else as_typed(error.what)]
    if error.allowed:
        lines.append(f"Allowed: {as_typed(error.allowed)}")
    if error.remedy:
        remedy = error.remedy
        for option, place in _PLACES.items():
            remedy = remedy.replace(option, place)
        lines.append(f"What to do: {as_typed(remedy)}")
    st.error("\n\n".join(lines), icon=":material/error:")
