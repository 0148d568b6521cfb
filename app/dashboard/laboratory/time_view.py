"""Signals over time: healthy beside faulty on one scale, and what the effect adds."""

from __future__ import annotations

import numpy as np
import streamlit as st

from app.dashboard.laboratory.expected import entries
from app.dashboard.laboratory.run import Run
from app.dashboard.widgets.line_chart import Axes, Line, show_lines
from gearsig.checks import FloatArray
from gearsig.plot.thin import thin

N_POINTS = 3000
HEIGHT_PX = 300
MOTION = {
    "driver, along the line of action": ("driver y", 1e6, "displacement (µm)"),
    "driven gear, along the line of action": ("driven y", 1e6, "displacement (µm)"),
    "transmission error": ("transmission_error_m", 1e6, "transmission error (µm)"),
    "mesh force": ("mesh_force_n", 1e-3, "mesh force (kN)"),
}
STRETCHES = {"1 revolution": 1.0, "3 revolutions": 3.0, "all": float("inf")}


def show_time(healthy: Run, faulty: Run | None) -> None:
    """Show a signal of both machines, and the difference."""
    left, right = st.columns(2)
    names = (*healthy.vibration_channels, *MOTION)
    name = left.selectbox("Signal", names, format_func=_shown, key="signal of the laboratory", persist_state="session")
    shown = right.segmented_control(
        "Shown, of the input shaft",
        list(STRETCHES),
        default="3 revolutions",
        key="stretch of the laboratory",
        persist_state="session",
    )
    end = _end_s(healthy, STRETCHES[shown or "3 revolutions"])
    own, unit = signal_of(healthy, name, end)
    if faulty is None:
        show_lines([Line(*thin(*own, N_POINTS), "healthy")], Axes("time (s)", unit, (0.0, end)), "time of healthy")
        return
    other, _ = signal_of(faulty, name, end)
    limits = _limits(own[1], other[1])
    marks = entries(faulty)
    for column, line, title in zip(st.columns(2), (own, other), ("healthy", "faulty"), strict=True):
        colour = "measured" if title == "healthy" else "fault"
        with column:
            show_lines(
                [Line(*thin(*line, N_POINTS), title, colour=colour)],  # type: ignore[arg-type]  # one of the two
                Axes("time (s)", unit, (0.0, end), limits),
                f"time of {title}",
                height_px=HEIGHT_PX,
            )
    st.markdown("**What the effect adds**: faulty less healthy")
    difference = other[1] - own[1]
    show_lines(
        [Line(*thin(own[0], difference, N_POINTS), "difference", colour="fault")],
        Axes("time (s)", unit, (0.0, end), _limits(difference)),
        "time of difference",
        cursors=marks,
        height_px=HEIGHT_PX,
    )


def signal_of(run: Run, name: str, end_s: float) -> tuple[tuple[FloatArray, FloatArray], str]:
    """Return (time, values) of a channel or of the motion up to `end_s`, and the name of the value axis."""
    if name in MOTION:
        signal, factor, unit = MOTION[name]
        time, values = run.response.time_s, factor * run.response[signal]
    else:
        values, unit = run.recording.values(name), "acceleration (m/s²)"
        time = np.arange(len(values)) / run.recording.sampling_rate_hz
    inside = time <= end_s
    return (time[inside], values[inside]), unit


def _shown(name: str) -> str:
    return name[:1].upper() + name[1:] if name in MOTION else f"Sensor {name}"


def _end_s(run: Run, revolutions: float) -> float:
    turns = run.setup.revolutions_per_s
    return min(revolutions / turns if turns > 0 else float("inf"), run.setup.duration_s)


def _limits(*values: FloatArray) -> tuple[float, float]:
    low, high = (float(f([f(v) for v in values])) for f in (np.min, np.max))
    margin = 0.06 * (high - low) or 1.0
    return low - margin, high + margin
