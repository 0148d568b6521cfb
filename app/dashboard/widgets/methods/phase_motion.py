"""The kind of motion of a path, with its evidence; used beside the phase plane and beside the embedding."""

from __future__ import annotations

from typing import TYPE_CHECKING

import streamlit as st

from app.dashboard.as_typed import as_typed
from app.dashboard.widgets.methods.phase_settings import choose_lock
from app.dashboard.widgets.methods.stretch import Stretch
from gearsig.diagnosis.types import Analysis

if TYPE_CHECKING:
    from gearsig.phase.kind import MotionKind
    from gearsig.phase.types import PhasePortrait

OF_SIGNAL = (
    "Looked at: the signal as measured, {}, embedded by delays. The phase plane asks the same of displacement, where "
    "slow motion weighs more; the answers may differ."
)
OF_DISPLACEMENT = (
    "Looked at: displacement and velocity, {}. Integration makes slow motion weigh more; “Embedding and chaos” asks "
    "the same of the signal as measured, and the answers may differ."
)


def show_motion(analysis: Analysis, stretch: Stretch, path: PhasePortrait) -> None:
    """Ask what the section is locked to, and say what kind of motion it is."""
    from gearsig.phase.kind import kind_of_motion

    lock = choose_lock(analysis, stretch)
    if lock is not None:
        with st.spinner("Looking at section, exponent and 0–1 test …", show_time=True):
            show_verdict(kind_of_motion(path, lock), OF_SIGNAL.format(path.source))


def show_verdict(kind: MotionKind, looked_at: str) -> None:
    """Say what kind of motion it is, of which signal, and why."""
    with st.container(border=True):
        after = f" after {kind.period} cycles" if kind.kind == "subharmonic" else ""
        st.markdown(f"Kind of motion: **{kind.kind}**{after}")
        st.markdown(as_typed(looked_at))
        st.markdown("\n".join(f"- {as_typed(sentence)}" for sentence in kind.evidence))
        st.caption(
            "Measured gear vibration is periodic with noise and modulation in most cases: “stochastic” and “undecided” "
            "are then the right answers."
        )
