"""Simulations, done once for equal setups and shared between sessions; the number kept is bounded."""

from __future__ import annotations

import streamlit as st

from app.dashboard.laboratory.run import Run, run_setup
from app.dashboard.laboratory.setup import Setup

N_RUNS = 12
"""Each holds some MB: a recording and eight signals of the motion at 80 kHz."""


def simulated(setup: Setup) -> Run:
    """Return the run of a setup; it is frozen, so that sessions may share it.

    Raises
    ------
    InputError
        If a value is out of its range, or the machine allows less.
    """
    words = "Simulating …" if _is_ready() else "Preparing the simulator; the first time takes half a minute …"
    with st.spinner(words, show_time=True):
        run = _cached(setup)
    _ready.append(True)
    return run


@st.cache_resource(max_entries=N_RUNS, show_spinner=False)
def _cached(setup: Setup) -> Run:
    return run_setup(setup)


_ready: list[bool] = []


def _is_ready() -> bool:
    return bool(_ready)
