"""Levels along a run-up, over order and time."""

from __future__ import annotations

import streamlit as st

from app.dashboard.widgets.picture import show_picture
from app.dashboard.widgets.range_slider import choose_end
from gearsig.diagnosis.types import Analysis, ChannelAnalysis
from gearsig.report.lines import highest_order_of_interest, line_cursors


def show_order_map(analysis: Analysis, channel: ChannelAnalysis) -> None:
    """Show the map of a channel, or say why there is none."""
    order_map = channel.order_map
    if order_map is None:
        st.info("The speed changes by less than 1 %, or is not known. A map is made of a run-up or coast-down.")
        return
    from gearsig.plot.order_map import order_map_figure

    end = float(order_map.positions[-1])
    first = end
    if channel.order_spectrum is not None:
        first = min(end, highest_order_of_interest(analysis, channel.order_spectrum))
    label = "Highest order shown" if order_map.axis == "order" else "Highest frequency shown (Hz)"
    highest = choose_end(label, analysis, end, first)
    on_orders = order_map.axis == "order"
    cursors = [c for c in line_cursors(analysis, order_map) if c.kind == "mesh"] if on_orders else []
    show_picture(
        order_map_figure(order_map, cursors, highest=highest),
        f"Levels of {channel.channel} over {order_map.axis} and time, with the speed",
    )
    st.caption("Upright lines turn with the shaft; bent bands are resonances that stay at their frequency.")
