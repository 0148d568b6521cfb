"""Signals over time and what is wrong with them."""

from __future__ import annotations

import numpy as np
import streamlit as st

from app.dashboard import state
from app.dashboard.as_typed import as_typed
from app.dashboard.cached import channel_problems
from app.dashboard.widgets.line_chart import Axes, Line, show_lines
from app.dashboard.widgets.range_slider import choose_range
from gearsig.checks import FloatArray
from gearsig.diagnosis.types import Analysis
from gearsig.plot.display import unit_text, with_unit
from gearsig.plot.thin import thin
from gearsig.recording.types import Recording

N_SHOWN = 4
N_MOST = 12
PANEL_PX = 190


def show_channels(analysis: Analysis) -> None:
    """Show chosen channels over a window of time, and the table of channels with their problems."""
    recording = analysis.recording
    for warning in recording.warnings:
        st.warning(as_typed(warning), icon=":material/warning:")
    _show_quality(analysis)
    names = st.multiselect(
        "Channels shown",
        recording.channel_names,
        default=recording.channel_names[:N_SHOWN],
        max_selections=N_MOST,
        key=state.view_key("channels shown", analysis),
    )
    window = choose_range("Time shown (s)", analysis, recording.duration_s, name="time")
    for name in names:
        channel = recording.channels[recording.index(name)]
        time, values = stretch(recording, name, window)
        st.markdown(f"**{as_typed(name)}** {as_typed(channel.position)}")
        label = with_unit(
            channel.quantity.replace("_", " ") if channel.quantity != "unknown" else "value", channel.unit
        )
        show_lines(
            [Line(*thin(time, values), name)],
            Axes("time (s)", label, window),
            state.view_key(f"time of {name}", analysis),
            height_px=PANEL_PX,
        )


def stretch(recording: Recording, name: str, window_s: tuple[float, float]) -> tuple[FloatArray, FloatArray]:
    """Return times and samples inside a window, at least two samples."""
    rate, n = recording.sampling_rate_hz, recording.n_samples
    start = min(max(int(window_s[0] * rate), 0), max(n - 2, 0))
    stop = min(max(int(np.ceil(window_s[1] * rate)) + 1, start + 2), n)
    return np.arange(start, stop) / rate, recording.values(name)[start:stop]


def _show_quality(analysis: Analysis) -> None:
    recording = analysis.recording
    problems = channel_problems(state.view_key("problems", analysis), recording)
    table = {
        "channel": recording.channel_names,
        "quantity": [c.quantity.replace("_", " ") for c in recording.channels],
        "unit": [unit_text(c.unit) or "not known" for c in recording.channels],
        "position": [c.position for c in recording.channels],
        "smallest": [float(row.min()) for row in recording.samples],
        "mean": [float(row.mean(dtype=np.float64)) for row in recording.samples],
        "largest": [float(row.max()) for row in recording.samples],
        "data quality": [
            ", ".join(p.kind for p in problems if p.channel == c.name) or ("good" if c.is_vibration else "not examined")
            for c in recording.channels
        ],
    }
    number = st.column_config.NumberColumn(format="%.4g")
    config = {
        "channel": st.column_config.TextColumn(width="small"),
        **dict.fromkeys(("smallest", "mean", "largest"), number),
    }
    st.dataframe(table, hide_index=True, column_config=config, width="stretch")
    for problem in problems:
        text = f"**{as_typed(problem.channel)}** is {problem.kind}: {as_typed(problem.evidence)}. "
        st.warning(f"{text}{as_typed(problem.remedy)}.", icon=":material/warning:")
