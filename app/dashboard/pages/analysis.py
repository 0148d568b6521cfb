"""From a recording to a diagnosis."""

from __future__ import annotations

import streamlit as st

from app.dashboard import state
from app.dashboard.cached import analysis_of
from app.dashboard.widgets.chooser import choose_recording
from app.dashboard.widgets.messages import show_error
from app.dashboard.widgets.verdict import show_findings, show_verdict, show_welcome
from app.dashboard.widgets.views import show_tabs
from gearsig.errors import GearsigError


def show() -> None:
    """Choose, analyse, show."""
    chosen = choose_recording()
    state.remember(chosen)
    if chosen is None:
        show_welcome()
        return
    with st.spinner("Reading and analysing …", show_time=True):
        analysis = analysis_of(chosen.request, chosen.content, chosen.reference)
    show_verdict(analysis)
    show_findings(analysis)
    show_tabs(analysis, chosen.request)


try:
    show()
except GearsigError as error:
    show_error(error)
