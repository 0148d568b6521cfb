"""A comparison on the page: verdict, downloads, figures, tables."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import streamlit as st

from app.dashboard.methods.signals import show_notes
from app.dashboard.theme import as_typed
from app.dashboard.widgets.charts import download, show_picture
from gearsig.comparison import ChannelComparison, Comparison, LineLevel, missing_words
from gearsig.plot import unit_text
from gearsig.report import FIGURES, alignment_texts, channel_rows, comparison_to_json, orders_csv

LINES = "Lines"


def show_comparison(comparison: Comparison) -> None:
    """Show verdict, findings, and one channel's agreement, figures and lines."""
    st.markdown(f"**{as_typed(comparison.verdict)}**")
    if comparison.findings:
        st.markdown("\n".join(f"- {as_typed(text)}" for text in comparison.findings))
    show_notes(comparison.notes)
    st.caption(as_typed(f"{_facts(comparison)} Aligned: {'; '.join(alignment_texts(comparison))}."))
    channel = _choose_channel(comparison.channels)
    rows = channel_rows(channel)
    st.dataframe(
        {"agreement": [name for name, _ in rows], "": [text for _, text in rows]},
        hide_index=True,
        width="stretch",
        column_config={"": st.column_config.TextColumn(width="large")},
    )
    tabs = st.tabs((*FIGURES, LINES), key="comparison tab", on_change="rerun")
    for name, tab in zip((*FIGURES, LINES), tabs, strict=True):
        if not tab.open:
            continue
        with tab:
            if name == LINES:
                _show_lines(channel)
                continue
            for one in FIGURES[name](comparison, channel):
                show_picture(one.figure, one.alternative)
                st.caption(as_typed(one.caption))


def show_downloads(comparison: Comparison, page: Any, command: str) -> None:
    """Offer the page, the data and the lines; `page` makes the page's bytes when it is asked for."""
    with st.container(horizontal=True):
        download("Page (HTML)", page, "compare.html", "text/html", primary=True)
        download("JSON", lambda: comparison_to_json(comparison).encode(), "compare.json", "application/json")
        download("Lines (CSV)", lambda: orders_csv(comparison).encode(), "orders.csv", "text/csv")
    if command:
        with st.expander("The same from the command line", icon=":material/terminal:"):
            st.code(command, language="bash", wrap_lines=True)


def _facts(comparison: Comparison) -> str:
    own, other = comparison.simulated, comparison.recorded
    return (
        f"Recording: {other.duration_s:.4g} s, {other.mean_speed_rpm:.6g} rpm, {other.n_revolutions:.4g} revolutions. "
        f"Simulation: {own.duration_s:.4g} s, {own.mean_speed_rpm:.6g} rpm, {own.n_revolutions:.4g} revolutions."
    )


def _choose_channel(channels: Sequence[ChannelComparison]) -> ChannelComparison:
    if len(channels) == 1:
        return channels[0]
    names = [channel.name for channel in channels]
    chosen = st.segmented_control(
        "Channel", names, default=names[0], key="comparison channel", label_visibility="collapsed"
    )
    return channels[names.index(chosen)] if chosen in names else channels[0]


def _show_lines(channel: ChannelComparison) -> None:
    unit = f" re 1 {unit_text(channel.unit)}" if channel.unit else ""
    shown = [line for line in (*channel.lines, *channel.other_lines) if line.is_seen]
    st.dataframe(
        {
            "line": [line.label for line in shown],
            "order": [line.order for line in shown],
            f"recorded (dB{unit})": [round(line.level.recorded_db, 1) for line in shown],
            f"simulated (dB{unit})": [round(line.level.simulated_db, 1) for line in shown],
            "difference (dB)": [round(line.level.difference_db, 1) for line in shown],
            "±": [round(2 * line.level.repeatability_db, 1) for line in shown],
            "remark": [_remark(line) for line in shown],
        },
        hide_index=True,
        width="stretch",
        column_config={"order": st.column_config.NumberColumn(format="%.6g")},
    )
    st.caption("Levels are rms. ± is twice the standard error that follows from the halves of both records.")


def _remark(line: LineLevel) -> str:
    return missing_words(line) or ("" if line.level.is_beyond else "within the scatter")
