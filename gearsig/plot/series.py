"""Several curves in one figure: checked against their axis, coloured by their order, named above the panel."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from gearsig.checks import FloatArray, frozen_array
from gearsig.errors import InputError
from gearsig.plot import style
from gearsig.plot.display import plain

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

MOST_CURVES = 8
LEGEND_IN = 0.28
"""Height of the row of names above a panel."""
NAMES_AT_IN = 0.42
"""Middle of that row below the figure's top, under a title."""


def series_colours(n: int) -> tuple[str, ...]:
    """Return `n` colours from dark blue to orange: lightness grows with the order, so that all readers see it.

    Source of the scale: S. van der Walt, N. Smith, *plasma* (Matplotlib, 2015), without its pale end.
    """
    from matplotlib import colormaps
    from matplotlib.colors import to_hex

    scale = colormaps["plasma"]
    return tuple(to_hex(scale(0.04 + 0.72 * i / max(n - 1, 1))) for i in range(n))


def checked_axis(values: FloatArray, name: str) -> FloatArray:
    """Return an ascending axis of at least two points."""
    axis = frozen_array(values, name, ndim=1)
    if len(axis) < 2 or not bool((axis[1:] > axis[:-1]).all()):
        raise InputError(f"{name} has {len(axis)} value(s) that do not all ascend", allowed="two or more, ascending")
    return axis


def checked_curves(curves: Mapping[str, FloatArray], n: int, name: str, *, gaps: bool = False) -> dict[str, FloatArray]:
    """Return curves of `n` points each; with `gaps`, NaN leaves a piece out.

    Raises
    ------
    InputError
        If there is none, there are more than a figure can tell apart, or a length is wrong.
    """
    if not 1 <= len(curves) <= MOST_CURVES:
        raise InputError(f"{name} holds {len(curves)} curves", allowed=f"1 to {MOST_CURVES}")
    checked = {}
    for label, values in curves.items():
        checked[label] = checked_values(values, n, f"{name}[{label!r}]", gaps=gaps)
    return checked


def checked_values(values: FloatArray, n: int, name: str, *, gaps: bool = False) -> FloatArray:
    """Return an array of `n` points."""
    array = frozen_array(values, name, ndim=1, finite=not gaps)
    if len(array) != n:
        raise InputError(f"{name} has {len(array)} points, its axis {n}", allowed="equal lengths")
    return array


def legend_row(figure: Figure, lines: Sequence[Line2D], *, left_in: float, top_in: float, heading: str = "") -> None:
    """Name curves in one row whose middle is `top_in` below the figure's top: it never covers data.

    Parameters
    ----------
    figure : Figure
    lines : sequence of Line2D
        Their labels are the names.
    left_in, top_in : float
    heading : str
        Written before the names, e.g. "crack depth".
    """
    width, height = figure.get_size_inches()
    at = 1.0 - top_in / height
    if heading:
        figure.text(
            left_in / width,
            at,
            plain(heading, 40),
            ha="left",
            va="center",
            fontsize=style.SMALL_PT,
            color=style.QUIET,
            parse_math=False,
        )
        left_in += 0.085 * style.SMALL_PT / 8.5 * (len(plain(heading, 40)) + 1)
    legend = figure.legend(
        lines,
        [plain(str(line.get_label()), 30) for line in lines],
        loc="center left",
        bbox_to_anchor=(left_in / width, at),
        ncols=len(lines),
        fontsize=style.SMALL_PT,
        frameon=False,
        labelcolor=style.INK,
        handlelength=1.6,
        columnspacing=1.3,
        borderpad=0.0,
        borderaxespad=0.0,
    )
    for text in legend.get_texts():
        text.set_parse_math(False)


def shade(axes: Axes, limits: tuple[float, float], colour: str = style.FLOOR, alpha: float = 0.14) -> None:
    """Shade a stretch of the axis behind the data."""
    axes.axvspan(*limits, facecolor=colour, alpha=alpha, linewidth=0, zorder=0.5)


def write(axes: Axes, x: float, y: float, text: str, *, colour: str = style.QUIET, ha: str = "center") -> None:
    """Write into the panel: `x` in data, `y` as a share of its height (above one: above the panel)."""
    axes.text(
        x,
        y,
        plain(text, 40),
        transform=axes.get_xaxis_transform(),
        ha=ha,
        va="bottom" if y > 0.98 else "center",
        fontsize=style.SMALL_PT,
        color=colour,
        parse_math=False,
        zorder=4,
    )


def checked_limits(limits: tuple[float, float], name: str) -> tuple[float, float]:
    """Return ascending limits."""
    low, high = limits
    if not low < high:
        raise InputError(f"{name} is {low:g} to {high:g}", allowed="ascending")
    return float(low), float(high)


def headline(figure: Figure, title: str) -> None:
    """Write the title above the row of names."""
    if not title:
        return
    width, height = figure.get_size_inches()
    figure.text(
        0.85 / width,
        1.0 - 0.08 / height,
        plain(title, 110),
        ha="left",
        va="top",
        fontsize=style.TEXT_PT,
        fontweight="bold",
        color=style.INK,
        parse_math=False,
    )
