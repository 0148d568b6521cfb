"""The views of one analysis, of which only the open one is computed."""

from __future__ import annotations

from collections.abc import Callable

import streamlit as st

from app.dashboard import state
from app.dashboard.methods import show_methods
from app.dashboard.state import AnalysisRequest
from app.dashboard.widgets import views
from app.dashboard.widgets.spectrum import show_average
from app.dashboard.widgets.views import (
    show_channels,
    show_indicators,
    show_order_map,
    show_report,
    show_speed,
    show_start_stop,
)
from gearsig.diagnosis import Analysis

OF_RECORDING: dict[str, Callable[[Analysis], None]] = {"Channels": show_channels, "Speed": show_speed}
OF_MOTION: dict[str, Callable[[Analysis], None]] = {"Starts and stops": show_start_stop}
"""Of machines that start and stop, where the teeth could be examined."""
OF_CHANNEL: dict[str, views.ChannelView] = {
    "Spectrum": views.show_frequency_spectrum,
    "Order spectrum": views.show_order_spectrum,
    "Order map": show_order_map,
    "Envelope": views.show_envelope,
    "Synchronous average": show_average,
    "More methods": show_methods,
}


def show_tabs(analysis: Analysis, request: AnalysisRequest) -> None:
    """Show the views as tabs."""
    of_motion = OF_MOTION if analysis.motion is not None else {}
    names = (*of_motion, *OF_RECORDING, *OF_CHANNEL, "Indicators", "Report")
    for name, tab in zip(names, st.tabs(names, key=state.TAB, on_change="rerun"), strict=True):
        if tab.open:
            with tab:
                _show(name, analysis, request)


@st.fragment
def _show(name: str, analysis: Analysis, request: AnalysisRequest) -> None:
    """Show one view; what the user changes in it reruns only this."""
    if name in OF_MOTION:
        OF_MOTION[name](analysis)
    elif name in OF_RECORDING:
        OF_RECORDING[name](analysis)
    elif name in OF_CHANNEL:
        views.show_of_channel(analysis, OF_CHANNEL[name])
    elif name == "Indicators":
        show_indicators(analysis)
    else:
        show_report(analysis, request)
