"""The choice of a method, so that a newcomer is not shown all at once."""

from __future__ import annotations

import streamlit as st

from app.dashboard import state
from app.dashboard.widgets.errors import show_error
from app.dashboard.widgets.methods.choice import choose_one
from app.dashboard.widgets.methods.order_tracking import show_order_tracking
from app.dashboard.widgets.methods.time_frequency import show_time_frequency
from app.dashboard.widgets.views import ChannelView
from gearsig.diagnosis.types import Analysis, ChannelAnalysis
from gearsig.errors import GearsigError

METHODS: dict[str, tuple[ChannelView, str]] = {
    "Time–frequency": (
        show_time_frequency,
        "Levels over time and frequency, or over shaft angle and order: shows what comes and goes, and what sweeps.",
    ),
    "Orders (Vold–Kalman)": (
        show_order_tracking,
        "Takes single orders out of the signal as waveforms, also where they cross or lie close together.",
    ),
}
METHOD = "method"


def show_methods(analysis: Analysis, channel: ChannelAnalysis) -> None:
    """Show the chosen method's parameters and its answer for one channel."""
    name = choose_one("Method", list(METHODS), state.view_key(METHOD, analysis), named=False)
    show, about = METHODS[name]
    st.caption(about)
    try:
        show(analysis, channel)
    except GearsigError as error:
        show_error(error)
