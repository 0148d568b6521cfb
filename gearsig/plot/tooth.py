"""The outline of a tooth with cracks at its root."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from gearsig.checks import FloatArray
from gearsig.plot import series, style
from gearsig.plot.display import plain

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

SIZE_IN = 5.0


def tooth_figure(
    x_mm: FloatArray,
    y_mm: FloatArray,
    *,
    cracks_mm: Mapping[str, tuple[FloatArray, FloatArray]] | None = None,
    limiting_lines: bool = True,
    title: str = "",
) -> Figure:
    """Draw a tooth, its loaded flank on the right, with cracks as lines from their mouth to their tip.

    Parameters
    ----------
    x_mm, y_mm : arrays, (n,)
        Half outline from the root circle to the tip: x along the tooth's centre line from the gear's centre, y across.
        The other half is its mirror image.
    cracks_mm : mapping or None
        Name → x and y of the crack's points, in the same axes.
    limiting_lines : bool
        Draws the line from each crack's tip to the corner of the tooth: what lies beyond it carries no load.
    title : str

    Returns
    -------
    Figure
        Drawn true to scale.
    """
    x = series.checked_axis(x_mm, "x_mm")
    y = series.checked_values(y_mm, len(x), "y_mm")
    figure = style.new_figure(SIZE_IN, 0.8 * SIZE_IN + 0.9)
    axes = style.panel(figure, left_in=0.75, top_in=0.45)
    axes.grid(visible=False)
    deepest = min((float(np.min(points)) for points, _ in (cracks_mm or {}).values()), default=float(x[0]))
    _draw_tooth(axes, x, y, min(deepest, float(x[0])) - 0.2 * float(x[-1] - x[0]))
    axes.axvline(0.0, color=style.QUIET, linewidth=0.7, linestyle="-.", zorder=1)
    for number, (label, (crack_x, crack_y)) in enumerate((cracks_mm or {}).items()):
        points = series.checked_values(crack_x, len(crack_x), f"x of {label!r}")
        beside = series.checked_values(crack_y, len(points), f"y of {label!r}")
        _draw_crack(axes, beside, points, label, number)
        if limiting_lines:
            looks = {"color": style.FAULT, "linewidth": 0.7, "linestyle": ":"}
            axes.plot([beside[-1], y[-1]], [points[-1], x[-1]], **looks)  # type: ignore[arg-type]
    axes.set_aspect("equal", adjustable="datalim")
    style.label_axes(axes, "across the tooth (mm)", "from the gear's centre (mm)", title)
    style.no_offset(axes)
    return figure


def _draw_tooth(axes: Axes, x: FloatArray, y: FloatArray, bottom: float) -> None:
    """Draw the outline with a piece of the root circle either side, and the body down to `bottom`."""
    radius, start = float(np.hypot(x[0], y[0])), float(np.arctan2(y[0], x[0]))
    root = np.linspace(1.25 * start, start, 20)[:-1]
    along, across = np.append(radius * np.cos(root), x), np.append(radius * np.sin(root), y)
    across, along = np.concatenate((across, -across[::-1])), np.concatenate((along, along[::-1]))
    axes.plot(across, along, color=style.INK, linewidth=1.3)
    across, along = np.append(across, [across[-1], across[0]]), np.append(along, [bottom, bottom])
    axes.fill(across, along, facecolor=style.FLOOR, alpha=0.16, linewidth=0)


def _draw_crack(axes: Axes, across: FloatArray, along: FloatArray, label: str, number: int) -> None:
    axes.plot(across, along, color=style.FAULT, linewidth=2.2, zorder=3, solid_capstyle="butt")
    axes.plot(across[-1:], along[-1:], "o", color=style.FAULT, markersize=4.5, zorder=3)
    axes.annotate(
        plain(label, 24),
        (float(across[-1]), float(along[-1])),
        xytext=(7, -1),  # cracks run up to the right: the lower right of a tip is free
        textcoords="offset points",
        ha="left",
        va="top",
        fontsize=style.SMALL_PT,
        color=style.FAULT,
        parse_math=False,
        zorder=4 + number,
    )
