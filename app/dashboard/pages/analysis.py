"""From a recording to a diagnosis."""

from __future__ import annotations

import streamlit as st

from app.dashboard import state
from app.dashboard.cached import analysis_of
from app.dashboard.state import Chosen, ChosenFile
from app.dashboard.widgets.chooser import choose_recording
from app.dashboard.widgets.machine import show_machine
from app.dashboard.widgets.messages import show_error
from app.dashboard.widgets.verdict import show_verdict
from app.dashboard.widgets.views import show_views
from gearsig.diagnosis import Analysis
from gearsig.errors import GearsigError


def show() -> None:
    """Choose, analyse, show."""
    chosen = choose_recording()
    state.remember(chosen[1] if chosen is not None else None)
    if chosen is None:
        st.info("Give a recording on the left, or begin with a sample.", icon=":material/upload_file:")
        st.page_link(state.START_PAGE, label="Open a recording, or one of the samples", icon=":material/home:")
        return
    analysis = analysed(*chosen)
    if analysis is not None:
        show_verdict(analysis)
        show_views(analysis, *chosen)


def analysed(file: ChosenFile, chosen: Chosen) -> Analysis | None:
    """Return the analysis; where the file or the machine stands against it, say so and offer to mend the machine."""
    try:
        return analysis_of(chosen.request, chosen.content, chosen.reference)
    except GearsigError as error:
        show_error(error)
        show_machine(file, is_told=True)
        return None


try:
    show()
except GearsigError as error:
    show_error(error)
