"""The synchronous average along the angle: average above, residual below."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from gearsig.orders.types import SynchronousAverage
from gearsig.plot import style
from gearsig.plot.display import plain, with_unit
from gearsig.plot.marks import AngleMark
from gearsig.plot.thin import thin

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

PANEL_IN = 1.75
BAND_ANGLES = 1500


def average_figure(
    averages: Sequence[SynchronousAverage], *, n_teeth: int | None = None, marks: Sequence[AngleMark] = ()
) -> Figure:
    """Draw averages of one shaft below each other over the angle, with bands of ± 2 standard errors.

    Parameters
    ----------
    averages : sequence of SynchronousAverage
        E.g. average and residual; at least one.
    n_teeth : int or None
        Draws a tick per tooth.
    marks : sequence of AngleMark

    Returns
    -------
    Figure
    """
    height = 0.6 + PANEL_IN * len(averages)
    figure = style.new_figure(height)
    first: Axes | None = None
    for i, average in enumerate(averages):
        bottom = 0.55 + PANEL_IN * (len(averages) - 1 - i)
        axes = style.panel(figure, bottom_in=bottom, top_in=height - bottom - PANEL_IN + 0.38, sharex=first)
        first = first or axes
        _draw(axes, average)
        for mark in marks:
            axes.axvline(mark.angle_deg, color=style.FAULT, linewidth=0.9, linestyle="--", zorder=1.5)
        last = i == len(averages) - 1
        axes.tick_params(labelbottom=last)
        shaft = f", shaft {average.shaft}" if average.shaft else ""
        title = f"{average.kind}{shaft}, channel {average.channel}, {average.n_revolutions} revolutions"
        x = f"angle of {average.shaft or 'the shaft'} (deg)" if last else ""
        style.label_axes(axes, x, with_unit("amplitude", average.unit), title)
        style.no_offset(axes)
    if first is not None:
        first.set_xlim(0, 360)
        first.set_xticks(range(0, 361, 45))
        if n_teeth:
            first.set_xticks(np.arange(n_teeth + 1) * 360.0 / n_teeth, minor=True)
        for mark in marks:
            _name(first, mark)
    return figure


def _draw(axes: Axes, average: SynchronousAverage) -> None:
    n = len(average.values)
    angle = np.arange(n) * 360.0 / n
    axes.axhline(0, color=style.QUIET, linewidth=0.6, zorder=1)
    step = max(1, n // BAND_ANGLES)
    low, high = average.values - 2 * average.standard_error, average.values + 2 * average.standard_error
    axes.fill_between(angle[::step], low[::step], high[::step], color=style.FLOOR, alpha=0.4, linewidth=0, zorder=2)
    axes.plot(*thin(angle, average.values), color=style.MEASURED, linewidth=0.9, zorder=3)


def _name(axes: Axes, mark: AngleMark) -> None:
    axes.annotate(
        plain(mark.label, 24),
        (mark.angle_deg, 1.0),
        xycoords=("data", "axes fraction"),
        xytext=(4 if mark.angle_deg < 300 else -4, -1),
        textcoords="offset points",
        ha="left" if mark.angle_deg < 300 else "right",
        va="top",
        fontsize=style.SMALL_PT,
        fontweight="bold",
        color=style.FAULT,
        zorder=5,
        bbox={"facecolor": "white", "edgecolor": "none", "pad": 1.0, "alpha": 0.85},
        parse_math=False,
    )
