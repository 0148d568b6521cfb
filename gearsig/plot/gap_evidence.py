"""The evidence for a cause: what it predicts beside what was observed."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from gearsig.errors import InputError
from gearsig.gap.types import Evidence
from gearsig.plot import series, style
from gearsig.plot.rows import BAR, row_panel

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

MOST_ROWS = 10


def gap_evidence_figure(evidence: Sequence[Evidence], *, title: str = "") -> Figure:
    """Draw predicted and observed changes, feature by feature, with the floor about zero.

    Parameters
    ----------
    evidence : sequence of Evidence
        Strongest first; those past the tenth are left out.
    title : str

    Returns
    -------
    Figure
        Grey: within the floor, where a change says nothing.

    Raises
    ------
    InputError
        Without evidence.
    """
    if not evidence:
        raise InputError("no evidence to draw", allowed="one or more")
    shown = evidence[:MOST_ROWS]
    panel = row_panel(len(shown), left_in=3.6, right_in=1.15, row_in=0.44, top_in=0.66)
    for row, one in enumerate(shown):
        _draw_row(panel.axes, row, one)
        panel.name(row, one.feature)
        text, colour = _stance(one)
        panel.say(row, text, colour=colour)
    panel.axes.axvline(0.0, color=style.QUIET, linewidth=0.9, zorder=1)
    reach = max(max(abs(e.predicted_db), abs(e.observed_db), e.floor_db) for e in shown)
    lowest = min(min(e.predicted_db, e.observed_db, -e.floor_db) for e in shown)
    panel.axes.set_xlim(lowest - 0.06 * reach, reach * 1.08)
    style.label_axes(panel.axes, "change (dB)")
    style.no_offset(panel.axes)
    series.legend_row(panel.figure, _keys(), left_in=3.6, top_in=0.46)
    series.headline(panel.figure, title)
    return panel.figure


def _stance(one: Evidence) -> tuple[str, str]:
    """Return what stands beside a row, and its colour."""
    if one.speaks_for:
        return "for", style.MESH
    return ("further", style.QUIET) if one.is_further else ("against", style.FAULT)


def _draw_row(axes: Axes, row: int, one: Evidence) -> None:
    axes.barh(
        row, 2.0 * one.floor_db, left=-one.floor_db, height=0.8, color=style.FLOOR, alpha=0.2, linewidth=0, zorder=1
    )
    axes.barh(row, one.observed_db, height=0.6 * BAR, color=style.MEASURED, alpha=0.85, linewidth=0, zorder=2)
    axes.plot(
        [one.predicted_db], [row], "D", markersize=7, markerfacecolor="white", markeredgecolor=style.MESH,
        markeredgewidth=1.8, zorder=3,
    )  # fmt: skip


def _keys() -> list[Line2D]:
    from matplotlib.lines import Line2D

    return [
        Line2D([], [], color=style.MEASURED, linewidth=6, label="observed"),
        Line2D(
            [], [], linestyle="none", marker="D", markersize=7, markerfacecolor="white", markeredgecolor=style.MESH,
            markeredgewidth=1.8, label="predicted",
        ),
        Line2D([], [], color=style.FLOOR, alpha=0.35, linewidth=9, label="structural floor"),
    ]  # fmt: skip
