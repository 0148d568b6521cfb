"""A machine that starts and stops: its figures, as in the report."""

from __future__ import annotations

import streamlit as st

from app.dashboard.as_typed import as_typed
from app.dashboard.widgets.picture import show_picture
from gearsig.diagnosis.types import Analysis


def show_start_stop(analysis: Analysis) -> None:
    """Show course, planes of the teeth, impacts and force from motion, one below the other."""
    from gearsig.report.start_stop_figures import start_stop_figures

    if analysis.motion is None:
        return
    for drawn in start_stop_figures(analysis.motion):
        show_picture(drawn.figure, drawn.alternative)
        st.caption(as_typed(drawn.caption))
