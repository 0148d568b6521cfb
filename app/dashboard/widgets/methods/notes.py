"""What a method says about its own answer."""

from __future__ import annotations

from collections.abc import Sequence

import streamlit as st

from app.dashboard.as_typed import as_typed


def show_notes(notes: Sequence[str]) -> None:
    """Show notes as one warning; names in them come from files."""
    if notes:
        text = as_typed(notes[0]) if len(notes) == 1 else "\n".join(f"- {as_typed(note)}" for note in notes)
        st.warning(text, icon=":material/warning:")
