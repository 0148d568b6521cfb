"""Levels of orders over speed: a run-up or run-down, order by order."""

from __future__ import annotations

from collections.abc import Sequence
from string import ascii_uppercase
from typing import TYPE_CHECKING

import numpy as np

from gearsig.diagnosis.types import OrderLevel
from gearsig.errors import InputError
from gearsig.plot import series, style
from gearsig.plot.display import unit_text

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

DECADES = 3.5
"""Below the largest level at most: what lies deeper is noise."""


def order_levels_figure(
    levels: Sequence[OrderLevel], *, resonances_hz: Sequence[float] = (), title: str = "", height_in: float = 4.0
) -> Figure:
    """Draw amplitudes of orders over speed, the largest of each marked.

    Parameters
    ----------
    levels : sequence of OrderLevel
        1 to 8, of one channel.
    resonances_hz : sequence of float
        Each order is marked where it crosses them.
        By letters, which the title names.
    title : str
    height_in : float

    Returns
    -------
    Figure

    Raises
    ------
    InputError
        Without levels, or with more than a figure can tell apart.
    """
    if not 1 <= len(levels) <= series.MOST_CURVES:
        raise InputError(f"{len(levels)} levels", allowed=f"1 to {series.MOST_CURVES}")
    figure = style.new_figure(height_in)
    axes = style.panel(figure, top_in=0.85 if resonances_hz else 0.65)
    lines = []
    for level, colour in zip(levels, series.series_colours(len(levels)), strict=True):
        lines += axes.plot(level.speed_rpm, level.amplitude, color=colour, linewidth=1.2, label=level.name)
        amplitude, rpm, _ = level.largest
        axes.plot([rpm], [amplitude], "o", color=colour, markersize=5, zorder=4)
    _scale(axes, levels)
    for letter, hertz in zip(ascii_uppercase, resonances_hz, strict=False):
        _mark_crossings(axes, levels, hertz, letter)
    unit = f" ({unit_text(levels[0].unit)})" if levels[0].unit else ""
    style.label_axes(axes, "speed (rpm)", f"amplitude{unit}")
    style.no_offset(axes)
    series.legend_row(figure, lines, left_in=0.85, top_in=series.NAMES_AT_IN)
    named = [f"{letter} {hertz:.4g} Hz" for letter, hertz in zip(ascii_uppercase, resonances_hz, strict=False)]
    series.headline(figure, f"{title}; resonances: {', '.join(named)}" if named else title)
    return figure


def _scale(axes: Axes, levels: Sequence[OrderLevel]) -> None:
    top = max(float(level.amplitude.max()) for level in levels) or 1.0
    bottom = min(float(level.amplitude.min()) for level in levels)
    axes.set_yscale("log")
    axes.set_ylim(max(bottom / 1.5, top / 10**DECADES), 2.0 * top)
    axes.set_xlim(min(float(x.speed_rpm[0]) for x in levels), max(float(x.speed_rpm[-1]) for x in levels))


def _mark_crossings(axes: Axes, levels: Sequence[OrderLevel], hertz: float, letter: str) -> None:
    """Mark where each order passes a frequency, by its letter."""
    crossed = []
    for level in levels:
        rpm = 60.0 * hertz / level.order
        if level.speed_rpm[0] < rpm < level.speed_rpm[-1]:
            crossed.append((rpm, float(np.interp(rpm, level.speed_rpm, level.amplitude))))
    for rpm, amplitude in crossed:
        axes.plot([rpm, rpm], [axes.get_ylim()[0], amplitude], color=style.FAULT, linewidth=0.8, linestyle=":")
        axes.plot([rpm], [amplitude], "v", color=style.FAULT, markersize=6, zorder=5)
        series.write(axes, rpm, 1.02, letter, colour=style.FAULT)
