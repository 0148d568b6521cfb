"""What a method says about its own answer."""

from __future__ import annotations

from collections.abc import Sequence

import streamlit as st

from app.dashboard.as_typed import as_typed


def show_notes(notes: Sequence[str], *, quiet: bool = False) -> None:
    """Show notes as one warning, or quietly as small print; names in them come from files."""
    if not notes:
        return
    text = as_typed(notes[0]) if len(notes) == 1 else "\n".join(f"- {as_typed(note)}" for note in notes)
    if quiet:
        st.caption(text)
    else:
        st.warning(text, icon=":material/warning:")
