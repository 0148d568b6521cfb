"""How far the gap shrinks: from before, through each added effect, to what is left."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import TYPE_CHECKING

from gearsig.errors import InputError
from gearsig.gap.types import GapStep, Interval
from gearsig.plot import style
from gearsig.plot.rows import BAR, RowPanel, row_panel

if TYPE_CHECKING:
    from matplotlib.figure import Figure

LEFT_OVER = "what is left"


def gap_waterfall_figure(steps: Sequence[GapStep], *, held_out: str = "", title: str = "") -> Figure:
    """Draw the gap before, what each effect takes away, and what is left, with 90 % intervals.

    Parameters
    ----------
    steps : sequence of GapStep
        The first is the gap before anything is added.
    held_out : str
        What it was scored on; written below the axis.
    title : str

    Returns
    -------
    Figure
        The shaded stretch is the structural floor: healthy machines are in it.

    Raises
    ------
    InputError
        Without steps.
    """
    if not steps:
        raise InputError("no steps to draw", allowed="the gap before, and one for each effect")
    panel = row_panel(len(steps) + (len(steps) > 1), left_in=3.0, right_in=1.6)
    axes = panel.axes
    axes.axvspan(0.0, 1.0, facecolor=style.FLOOR, alpha=0.16, linewidth=0, zorder=0.5)
    axes.axvline(1.0, color=style.FLOOR, linewidth=0.9, zorder=1)
    _whole(panel, 0, steps[0], style.FAULT)
    for row, (before, step) in enumerate(pairwise(steps), start=1):
        _step(panel, row, before.left, step)
    if len(steps) > 1:
        _whole(panel, len(steps), GapStep(LEFT_OVER, steps[-1].left), style.MEASURED)
    axes.set_xlim(0.0, 1.06 * max(1.2, *(step.left.high for step in steps)))
    scored = f", on {held_out}" if held_out else ""
    style.label_axes(axes, f"gap (structural floors{scored}; 90 % intervals)", "", title)
    style.no_offset(axes)
    return panel.figure


def _whole(panel: RowPanel, row: int, step: GapStep, colour: str) -> None:
    panel.axes.barh(row, step.left.value, height=BAR, color=colour, alpha=0.85, linewidth=0, zorder=2)
    _interval(panel, row, step.left)
    panel.name(row, step.label, bold=True)
    panel.say(row, f"{step.left.value:.2g}", below=f"{step.left.low:.2g} to {step.left.high:.2g}")


def _step(panel: RowPanel, row: int, before: Interval, step: GapStep) -> None:
    """Draw what an effect takes away; what it adds, where it makes the gap larger, in the colour of faults."""
    left = step.left
    smaller = left.value <= before.value
    low, high = sorted((left.value, before.value))
    colour = style.MESH if smaller else style.FAULT
    panel.axes.barh(row, high - low, left=low, height=BAR, color=colour, alpha=0.75, linewidth=0, zorder=2)
    for x in (before.value, left.value):
        ends = (row - 1 + BAR / 2, row - BAR / 2) if x == before.value else (row + BAR / 2, row + 1 - BAR / 2)
        panel.axes.plot([x, x], ends, color=style.QUIET, linewidth=0.8, linestyle=":", zorder=1.5)
    _interval(panel, row, left)
    panel.name(row, f"with {step.label}")
    share = 100.0 * (1.0 - left.value / before.value) if before.value > 0 else 0.0
    sign = "−" if smaller else "+"
    panel.say(row, f"{sign}{high - low:.2g}", below=f"{sign}{abs(share):.0f} % of the gap", colour=colour)


def _interval(panel: RowPanel, row: int, left: Interval) -> None:
    panel.axes.errorbar(
        [left.value],
        [row],
        xerr=[[max(left.value - left.low, 0.0)], [max(left.high - left.value, 0.0)]],
        fmt="none",
        ecolor=style.INK,
        elinewidth=1.1,
        capsize=3.5,
        zorder=3,
    )
