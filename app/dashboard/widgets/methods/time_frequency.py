"""Levels over time and frequency, or shaft angle and order: short-time Fourier, wavelets, both synchrosqueezed."""

from __future__ import annotations

from typing import TYPE_CHECKING

import streamlit as st

from app.dashboard.widgets.methods.downloads import offer_downloads
from app.dashboard.widgets.methods.map_choice import choose_map
from app.dashboard.widgets.picture import show_picture
from gearsig.diagnosis.types import Analysis, ChannelAnalysis

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import ArrayLike

    from gearsig.timefreq.types import TimeFrequencyMap

HEIGHT_IN = 4.6


def show_time_frequency(analysis: Analysis, channel: ChannelAnalysis) -> None:
    """Show a map of one channel with the transform's parameters."""
    choice = choose_map(analysis, channel, "time–frequency")
    levels = choice.levels()
    from gearsig.plot.time_frequency import time_frequency_figure

    words = f"Levels of {choice.stretch.channel}: {levels.axis_label} over {levels.at_label}, {levels.method}"
    show_picture(time_frequency_figure(levels, dynamic_range_db=choice.span_db, height_in=HEIGHT_IN), words)
    st.caption("Between the dashed lines and the ends, a level depends on what is assumed outside of the stretch.")
    offer_downloads(analysis, "time–frequency", tables={"Levels": lambda: map_columns(levels)})


def map_columns(levels: TimeFrequencyMap) -> Mapping[str, ArrayLike]:
    """Return a map as columns: time or angle first, then the levels of each line."""
    unit = "Hz" if levels.axis == "frequency" else "orders"
    lines = {f"{p:.7g} {unit}": levels.values[:, i] for i, p in enumerate(levels.positions)}
    return {levels.at_label: levels.at, **lines}
