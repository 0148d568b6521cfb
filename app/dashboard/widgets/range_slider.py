"""A stretch of an axis, chosen with two handles."""

from __future__ import annotations

import streamlit as st

from app.dashboard import state
from gearsig.diagnosis.types import Analysis

N_STEPS = 1000


def choose_range(
    label: str,
    analysis: Analysis,
    end: float,
    *,
    start: float = 0.0,
    shown: tuple[float, float] | None = None,
    name: str = "",
) -> tuple[float, float]:
    """Return the chosen stretch between `start` and `end`; never an empty one.

    Parameters
    ----------
    label : str
        Not from a file.
    analysis : Analysis
    start, end : float
        Of the axis.
    shown : (float, float) or None
        Chosen at first; None: all of it.
    name : str
        Of the view, where the same label occurs in several.
    """
    step = (end - start) / N_STEPS
    first = shown if shown is not None else (start, end)
    value = (max(start, first[0]), min(end, first[1]))
    key = state.view_key(f"{name} {label} {start!r} to {end!r}", analysis)
    low, high = st.slider(label, start, end, value=value, step=step, format="%.5g", key=key)
    return (low, high) if high > low else (max(start, high - step), min(end, high + step))


def choose_end(label: str, analysis: Analysis, end: float, shown: float) -> float:
    """Return the chosen end of what is shown from zero, `shown` at first."""
    step = end / N_STEPS
    key = state.view_key(f"{label} to {end!r}", analysis)
    return st.slider(label, step, end, value=min(shown, end), step=step, format="%.5g", key=key)
