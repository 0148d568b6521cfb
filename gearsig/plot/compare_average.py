"""Two aligned synchronous averages: over a revolution, over some teeth, and tooth by tooth."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from gearsig.checks import FloatArray
from gearsig.compare.types import LevelPair
from gearsig.errors import InputError
from gearsig.orders.types import SynchronousAverage
from gearsig.plot import series, style
from gearsig.plot.compare import SIDES, difference_bars
from gearsig.plot.display import with_unit
from gearsig.plot.thin import thin

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

LEFT_IN, RIGHT_IN, BOTTOM_IN, TOP_IN = 0.85, 0.2, 0.55, 0.68
PANEL_IN, GAP_IN = 1.5, 0.5
TEETH_ZOOMED, DEGREES_ZOOMED = 4, 60.0
OWN_SCALE_RATIO = 4.0
"""From this ratio of sizes on each is drawn over its own rms: else one is a flat line."""


def average_overlay_figure(
    recorded: SynchronousAverage,
    simulated: SynchronousAverage,
    tooth_levels: Sequence[LevelPair] = (),
    *,
    n_teeth: int | None = None,
    title: str = "",
) -> Figure:
    """Draw both averages over a revolution, the first teeth of it enlarged, and each tooth's difference in dB.

    Parameters
    ----------
    recorded, simulated : SynchronousAverage
        Of one shaft, aligned, at the same angles. Bands: twice the standard error.
    tooth_levels : sequence of LevelPair
        One per tooth from angle 0 on; empty: no such panel.
    n_teeth : int or None
        Draws a tick per tooth.
    title : str

    Returns
    -------
    Figure
        Where one is more than four times as large as the other, each is drawn over its own rms, and the axis says so.

    Raises
    ------
    InputError
        If the angles differ.
    """
    if len(recorded.values) != len(simulated.values):
        raise InputError(f"{len(recorded.values)} and {len(simulated.values)} angles", allowed="the same angles")
    n_panels = 3 if tooth_levels else 2
    height = TOP_IN + BOTTOM_IN + n_panels * PANEL_IN + (n_panels - 1) * GAP_IN
    figure = style.new_figure(height)
    panels = [_panel(figure, height, i, n_panels) for i in range(n_panels)]
    scales, label = _scales(recorded, simulated)
    end = 360.0 * TEETH_ZOOMED / n_teeth if n_teeth else DEGREES_ZOOMED
    for axes, limit in zip(panels[:2], (360.0, end), strict=True):
        curves = _overlay(axes, (recorded, simulated), scales, limit)
        style.label_axes(axes, "", label)
        style.no_offset(axes)
    if n_teeth:
        panels[0].set_xticks(np.arange(n_teeth + 1) * 360.0 / n_teeth, minor=True)
    panels[0].set_xticks(range(0, 361, 45))
    last = f"angle of {recorded.shaft or 'the shaft'} (deg)"
    style.label_axes(panels[1], last, label)
    if tooth_levels:
        difference_bars(panels[2], np.arange(1.0, len(tooth_levels) + 1), tooth_levels, 0.75)
        panels[2].set_xlim(0.3, len(tooth_levels) + 0.7)
        style.label_axes(panels[2], "tooth, from angle 0", "sim. − rec. (dB)")
    series.headline(figure, title)
    series.legend_row(figure, curves, left_in=LEFT_IN, top_in=series.NAMES_AT_IN)
    return figure


def _panel(figure: Figure, height: float, i: int, n: int) -> Axes:
    bottom = BOTTOM_IN + (n - 1 - i) * (PANEL_IN + GAP_IN)
    return style.panel(figure, left_in=LEFT_IN, right_in=RIGHT_IN, bottom_in=bottom, top_in=height - bottom - PANEL_IN)


def _scales(recorded: SynchronousAverage, simulated: SynchronousAverage) -> tuple[tuple[float, float], str]:
    sizes = [float(np.sqrt(np.mean(a.values**2))) for a in (recorded, simulated)]
    alike = min(sizes) > 0 and max(sizes) / min(sizes) <= OWN_SCALE_RATIO
    if alike:
        return (1.0, 1.0), with_unit("average", recorded.unit)
    return (sizes[0] or 1.0, sizes[1] or 1.0), "over its own rms"


def _overlay(
    axes: Axes, averages: tuple[SynchronousAverage, SynchronousAverage], scales: tuple[float, float], end: float
) -> list:  # type: ignore[type-arg]  # of Line2D, imported for checking only
    axes.axhline(0, color=style.QUIET, linewidth=0.6, zorder=1)
    curves = []
    for average, scale, (name, colour) in zip(averages, scales, SIDES, strict=True):
        angle, values, error = _closed(average)
        shown = angle <= end
        x, y, e = angle[shown], values[shown] / scale, 2.0 * error[shown] / scale
        axes.fill_between(x, y - e, y + e, color=colour, alpha=0.2, linewidth=0, zorder=1.5)
        curves += axes.plot(*thin(x, y), color=colour, linewidth=1.0, label=name, alpha=0.9, zorder=2)
    axes.set_xlim(0.0, end)
    return curves


def _closed(average: SynchronousAverage) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Angle, values and errors with the first one once more at 360°."""
    n = len(average.values)
    around = np.arange(n + 1) % n
    return np.arange(n + 1) * 360.0 / n, average.values[around], average.standard_error[around]
