"""A simulation beside a recording, without looking for causes."""

from __future__ import annotations

import streamlit as st

from app.dashboard import compare
from app.dashboard.cached import recorded
from app.dashboard.theme import as_typed
from app.dashboard.widgets.chooser import choose_recording
from app.dashboard.widgets.messages import show_error
from gearsig.errors import GearsigError

WELCOME = """
Give a **recording** and its rig file, and a **simulation** of the machine: a file of any simulator, or one that is run
here at the recording's speed. The page lays one over the other by order, band and angle, and says for every difference
whether the records' own scatter explains it. For the cause of what differs, see the page *Gap*.
"""


def show() -> None:
    """Choose, read or simulate, compare, show."""
    st.subheader("Comparison of a simulation with a recording", anchor=False)
    opened = choose_recording(with_reference=False)
    simulation = compare.choose_simulation()
    align_by = compare.choose_alignment(simulation[0] if simulation is not None else None)
    if opened is None or simulation is None:
        st.markdown(WELCOME)
        return
    _, chosen = opened
    what, content = simulation
    recording = recorded(chosen.request, chosen.content)
    simulated = compare.simulated_of(what, chosen.request, content, recording)
    st.caption(as_typed(f"{simulated.provenance.source or 'simulation of this page'} beside {chosen.request.name}"))
    pairs = compare.choose_pairs(simulated, recording)
    comparison = compare.compared(chosen.request, what, pairs, align_by, recording, simulated)
    command = compare.command_of(chosen.request, what, pairs, align_by)
    compare.show_comparison(comparison, recording.rig)
    compare.show_downloads(comparison, command)


try:
    show()
except GearsigError as error:
    show_error(error)
