"""Levels over time and frequency, or over shaft angle and order."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from gearsig.checks import FloatArray, positive
from gearsig.plot import style
from gearsig.plot.display import decibels, plain, unit_text
from gearsig.plot.order_map import DYNAMIC_RANGE_DB, colours
from gearsig.timefreq.types import Ridge, TimeFrequencyMap

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.axes import Axes
    from matplotlib.collections import QuadMesh
    from matplotlib.figure import Figure

N_COLUMNS, N_ROWS = 1200, 500
LEFT_IN, RIGHT_IN, BOTTOM_IN, TOP_IN = 0.85, 1.0, 0.55, 0.55


def time_frequency_figure(
    levels: TimeFrequencyMap,
    ridges: Sequence[Ridge] = (),
    *,
    dynamic_range_db: float = DYNAMIC_RANGE_DB,
    height_in: float = 4.6,
    numbered: bool = False,
) -> Figure:
    """Draw levels over time (or angle) and frequency (or order), with ridges as lines.

    Parameters
    ----------
    levels : TimeFrequencyMap
    ridges : sequence of Ridge
        Dashed where two of them share their place.
    dynamic_range_db : float
        Span of the colours below the largest level.
    height_in : float
    numbered : bool
        Number the ridges from 1, at their right ends.

    Returns
    -------
    Figure
        The frequency axis is logarithmic where the lines are. Where there are more cells than pixels, the largest of
        the cells in a pixel is shown. Between the dashed lines and the ends, a level depends on what was assumed
        outside of the signal.
    """
    positive(dynamic_range_db, "dynamic_range_db", "dB")
    figure = style.new_figure(height_in)
    axes = style.panel(figure, left_in=LEFT_IN, right_in=RIGHT_IN, bottom_in=BOTTOM_IN, top_in=TOP_IN)
    axes.grid(visible=False)
    logarithmic = levels.spacing == "logarithmic"
    if logarithmic:
        axes.set_yscale("log")
    mesh = _draw_levels(axes, levels, dynamic_range_db, logarithmic=logarithmic)
    _colour_bar(figure, mesh, f"dB re 1 {unit_text(levels.unit)}".strip(), height_in)
    _draw_edges(axes, levels)
    for i, ridge in enumerate(ridges, start=1):
        _draw_ridge(axes, ridge)
        if numbered:
            _number(axes, ridge, i)
    style.label_axes(axes, levels.at_label, levels.axis_label, levels.source)
    style.note(axes, f"{levels.method}; {'mean power' if levels.reduction == 'mean' else 'largest'} per column")
    if logarithmic:
        _plain_ticks(axes)
    else:
        style.no_offset(axes)
    return figure


def _draw_levels(axes: Axes, levels: TimeFrequencyMap, dynamic_range_db: float, *, logarithmic: bool) -> QuadMesh:
    at, positions, values = _coarse(levels)
    shown = decibels(values.T, levels.scaling)
    x = _borders(at)
    y = np.exp(_borders(np.log(positions))) if logarithmic else np.maximum(_borders(positions), 0.0)
    top = float(shown.max())
    mesh = axes.pcolormesh(x, y, shown, cmap=colours(), vmin=top - dynamic_range_db, vmax=top, rasterized=True)
    axes.set_xlim(float(x[0]), float(x[-1]))
    axes.set_ylim(float(y[0]), float(y[-1]))
    return mesh


def _draw_edges(axes: Axes, levels: TimeFrequencyMap) -> None:
    begin, end = axes.get_xlim()
    inside = levels.edge < (end - begin) / 2
    for side in (begin + levels.edge, end - levels.edge):
        axes.plot(side[inside], levels.positions[inside], color="white", linewidth=2.2)
        axes.plot(side[inside], levels.positions[inside], color=style.QUIET, linewidth=0.8, linestyle=(0, (4, 3)))


def _draw_ridge(axes: Axes, ridge: Ridge) -> None:
    alone = np.where(ridge.shared, np.nan, ridge.positions)
    together = np.where(ridge.shared, ridge.positions, np.nan)
    axes.plot(ridge.at, alone, color=style.FAULT, linewidth=1.2)
    axes.plot(ridge.at, together, color=style.FAULT, linewidth=1.2, linestyle=(0, (3, 2)))


def _number(axes: Axes, ridge: Ridge, number: int) -> None:
    """Write a ridge's number on a light disc at nine tenths of its course: numbers of ridges that meet stay apart."""
    i = round((0.94 - 0.04 * (number % 3)) * (len(ridge.at) - 1))
    disc = {"boxstyle": "circle,pad=0.15", "facecolor": "white", "edgecolor": style.FAULT, "linewidth": 0.8}
    place = float(ridge.at[i]), float(ridge.positions[i])
    axes.text(*place, str(number), ha="center", va="center", fontsize=style.SMALL_PT, color=style.FAULT, bbox=disc)


def _plain_ticks(axes: Axes) -> None:
    """Label 1, 2 and 5 of each decade in full."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    axes.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:.6g}"))
    axes.yaxis.set_minor_formatter(NullFormatter())


def _coarse(levels: TimeFrequencyMap) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Keep the largest of neighbouring cells where there are more cells than pixels."""
    values, at, positions = levels.values, levels.at, levels.positions
    for axis, n_most in ((0, N_COLUMNS), (1, N_ROWS)):
        n = values.shape[axis]
        if n <= n_most:
            continue
        starts = np.arange(0, n, -(-n // n_most))
        ends = np.append(starts[1:], n) - 1
        values = np.maximum.reduceat(values, starts, axis=axis)
        if axis == 0:
            at = (at[starts] + at[ends]) / 2
        else:
            positions = (positions[starts] + positions[ends]) / 2
    return at, positions, values


def _borders(middles: FloatArray) -> FloatArray:
    """Return the borders of cells from their middles."""
    if len(middles) == 1:
        return np.array([middles[0] - 0.5, middles[0] + 0.5])
    between = (middles[1:] + middles[:-1]) / 2
    result: FloatArray = np.concatenate([[2 * middles[0] - between[0]], between, [2 * middles[-1] - between[-1]]])
    return result


def _colour_bar(figure: Figure, mesh: QuadMesh, label: str, height_in: float) -> None:
    left = (style.WIDTH_IN - RIGHT_IN + 0.15) / style.WIDTH_IN
    size = (0.12 / style.WIDTH_IN, (height_in - BOTTOM_IN - TOP_IN) / height_in)
    axes = figure.add_axes((left, BOTTOM_IN / height_in, *size))
    bar = figure.colorbar(mesh, cax=axes)
    bar.outline.set_visible(False)
    axes.tick_params(colors=style.QUIET, labelcolor=style.INK, labelsize=style.SMALL_PT)
    axes.set_ylabel(plain(label), color=style.INK, fontsize=style.TEXT_PT, parse_math=False)
