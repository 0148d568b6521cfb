"""Order and frequency maps along a run."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from gearsig.checks import FloatArray
from gearsig.orders.types import OrderMap
from gearsig.plot import style
from gearsig.plot.cursors import Cursor, draw, place
from gearsig.plot.display import decibels, plain, unit_text

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.axes import Axes
    from matplotlib.colors import Colormap
    from matplotlib.figure import Figure

DYNAMIC_RANGE_DB = 60.0
N_COLUMNS, N_ROWS = 1200, 500
LEFT_IN, RIGHT_IN, BOTTOM_IN, TOP_IN, SPEED_IN = 0.75, 1.0, 0.55, 0.7, 1.25


def order_map_figure(
    order_map: OrderMap, cursors: Sequence[Cursor] = (), *, highest: float | None = None, height_in: float = 4.6
) -> Figure:
    """Draw levels over order (or frequency) and time, with the speed beside them.

    Parameters
    ----------
    order_map : OrderMap
    cursors : sequence of Cursor
        In the map's axis.
    highest : float or None
        Highest order or frequency shown; None: all.

    Returns
    -------
    Figure
        Colours span 60 dB below the largest value. Where there are more cells than pixels, the largest value of the
        cells in a pixel is shown.
    """
    figure = style.new_figure(height_in)
    left = LEFT_IN + SPEED_IN
    speed = style.panel(
        figure, left_in=LEFT_IN, right_in=style.WIDTH_IN - left + 0.12, bottom_in=BOTTOM_IN, top_in=TOP_IN
    )
    axes = style.panel(figure, left_in=left, right_in=RIGHT_IN, bottom_in=BOTTOM_IN, top_in=TOP_IN)
    axes.sharey(speed)
    axes.tick_params(labelleft=False)
    axes.grid(visible=False)
    stop = len(order_map.positions)
    if highest is not None:
        stop = max(int(np.searchsorted(order_map.positions, highest, side="right")), min(2, stop))
    positions, time, values = _coarse(order_map.positions[:stop], order_map.time_s, order_map.values[:, :stop])
    level = decibels(values, order_map.scaling)
    x, y = _edges(positions), _edges(time)
    top = float(level.max())
    mesh = axes.pcolormesh(x, y, level, cmap=colours(), vmin=top - DYNAMIC_RANGE_DB, vmax=top, rasterized=True)
    _colour_bar(figure, mesh, f"dB re 1 {unit_text(order_map.unit)}".strip(), height_in)
    limits = (float(x[0]), float(x[-1]))
    axes.set_xlim(*limits)
    speed.set_ylim(float(y[0]), float(y[-1]))
    speed.plot(order_map.speed_rpm, order_map.time_s, color=style.MEASURED, linewidth=1.2)
    _spare_the_right_end(speed)
    width = style.WIDTH_IN - left - RIGHT_IN
    draw(axes, place(cursors, limits, width), (width, height_in - BOTTOM_IN - TOP_IN), through=False)
    name = f"order (of {order_map.shaft or 'the shaft'})" if order_map.axis == "order" else "frequency (Hz)"
    style.label_axes(axes, name)
    style.label_axes(speed, "speed (rpm)", "time (s)")
    figure.text(
        LEFT_IN / style.WIDTH_IN,
        1 - 0.14 / height_in,
        plain(order_map.source, 110),
        fontsize=style.TEXT_PT,
        fontweight="bold",
        va="top",
        color=style.INK,
        parse_math=False,
    )
    style.no_offset(speed)
    return figure


def _spare_the_right_end(axes: Axes) -> None:
    """Leave out a number that would run into those of the panel on the right."""
    from matplotlib.ticker import MaxNLocator

    low, high = axes.get_xlim()
    ticks = MaxNLocator(3).tick_values(low, high)
    axes.set_xticks([t for t in ticks if low <= t <= high - 0.2 * (high - low)])


def colours() -> Colormap:
    """Return a map from white over blue to nearly black: even steps of lightness, the same for every reader."""
    from matplotlib.colors import LinearSegmentedColormap

    return LinearSegmentedColormap.from_list(
        "level", ["#FFFFFF", "#C9DDF0", "#6FA8D6", "#1F6FB0", "#0B3A69", "#06172E"]
    )


def _coarse(x: FloatArray, y: FloatArray, values: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Keep the largest value of neighbouring cells where there are more cells than pixels."""
    for axis, n_most in ((1, N_COLUMNS), (0, N_ROWS)):
        n = values.shape[axis]
        if n > n_most:
            starts = np.arange(0, n, -(-n // n_most))
            values = np.maximum.reduceat(values, starts, axis=axis)
            ends = np.append(starts[1:], n) - 1
            if axis == 1:
                x = (x[starts] + x[ends]) / 2
            else:
                y = (y[starts] + y[ends]) / 2
    return x, y, values


def _edges(middles: FloatArray) -> FloatArray:
    """Return the borders of cells from their middles."""
    if len(middles) == 1:
        return np.array([middles[0] - 0.5, middles[0] + 0.5])
    between = (middles[1:] + middles[:-1]) / 2
    result: FloatArray = np.concatenate([[2 * middles[0] - between[0]], between, [2 * middles[-1] - between[-1]]])
    return result


def _colour_bar(figure: Figure, mesh: object, label: str, height_in: float) -> None:
    from matplotlib.cm import ScalarMappable

    assert isinstance(mesh, ScalarMappable)  # noqa: S101 - what pcolormesh returns, said to the type checker
    left = (style.WIDTH_IN - RIGHT_IN + 0.15) / style.WIDTH_IN
    axes = figure.add_axes(
        (left, BOTTOM_IN / height_in, 0.12 / style.WIDTH_IN, (height_in - BOTTOM_IN - TOP_IN) / height_in)
    )
    bar = figure.colorbar(mesh, cax=axes)
    bar.outline.set_visible(False)
    axes.tick_params(colors=style.QUIET, labelcolor=style.INK, labelsize=style.SMALL_PT)
    axes.set_ylabel(plain(label), color=style.INK, fontsize=style.TEXT_PT, parse_math=False)
