"""The views of the two machines, of which only the open one is computed."""

from __future__ import annotations

import streamlit as st

from app.dashboard.laboratory.bifurcation_view import show_safely
from app.dashboard.laboratory.mesh_view import show_mesh
from app.dashboard.laboratory.phase_view import show_phase
from app.dashboard.laboratory.run import Run
from app.dashboard.laboratory.spectrum_view import show_amplitude, show_envelope
from app.dashboard.laboratory.time_view import show_time

NAMES = ("Time", "Spectrum", "Envelope", "Phase portrait", "Bifurcation", "Mesh")
TAB = "tab of the laboratory"


def show_views(healthy: Run, faulty: Run | None, channel: str) -> None:
    """Show the views as tabs."""
    for name, tab in zip(NAMES, st.tabs(NAMES, key=TAB, on_change="rerun"), strict=True):
        if tab.open:
            with tab:
                _show(name, healthy, faulty, channel)


@st.fragment
def _show(name: str, healthy: Run, faulty: Run | None, channel: str) -> None:
    """Show one view; what the user changes in it reruns only this."""
    if name == "Time":
        show_time(healthy, faulty)
    elif name == "Spectrum":
        show_amplitude(healthy, faulty, channel)
    elif name == "Envelope":
        show_envelope(healthy, faulty, channel)
    elif name == "Phase portrait":
        show_phase(healthy, faulty)
    elif name == "Bifurcation":
        show_safely(healthy, faulty)
    else:
        show_mesh(healthy, faulty)
