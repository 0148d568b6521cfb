"""Several curves in one figure: checked against their axis, coloured by their order, named above the panel."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from gearsig.checks import FloatArray, count, frozen_array
from gearsig.errors import InputError
from gearsig.formatting import counted
from gearsig.plot import _style as style
from gearsig.plot._style import plain

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D


MAX_CURVES = 8
NAMES_AT_IN = 0.42
"""Middle of the row of names below the figure's top, under a title."""
N_POINTS = 4000
"""Points of a thinned line: more than twice the pixel columns of a figure."""


CYCLES = "mesh cycles (tooth passages)"
"""Label of an axis over the mesh."""


def padded(values: FloatArray) -> tuple[float, float]:
    """Return limits of an axis that leave a little room around values."""
    low, high = float(values.min()), float(values.max())
    margin = 0.06 * (high - low) or 1.0
    return low - margin, high + margin


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
        raise InputError(
            f"{name} has {counted(len(axis), 'value')} that do not all ascend", allowed="two or more, ascending"
        )
    return axis


def checked_curves(curves: Mapping[str, FloatArray], n: int, name: str, *, gaps: bool = False) -> dict[str, FloatArray]:
    """Return curves of `n` points each; with `gaps`, NaN leaves a piece out.

    Raises
    ------
    InputError
        If there is none, there are more than a figure can tell apart, or a length is wrong.
    """
    check_number(len(curves), f"{name} holds {len(curves)} curves")
    return {label: checked_values(values, n, f"{name}[{label!r}]", gaps=gaps) for label, values in curves.items()}


def check_number(n: int, problem: str, n_max: int = MAX_CURVES) -> None:
    """Refuse none, or more than a figure can tell apart."""
    if not 1 <= n <= n_max:
        raise InputError(problem, allowed=f"1 to {n_max}")


def checked_values(values: FloatArray, n: int, name: str, *, gaps: bool = False) -> FloatArray:
    """Return an array of `n` points."""
    array = frozen_array(values, name, ndim=1, finite=not gaps)
    if len(array) != n:
        raise InputError(f"{name} has {len(array)} points, its axis {n}", allowed="equal lengths")
    return array


def coloured(curves: Mapping[str, FloatArray]) -> Iterator[tuple[str, FloatArray, str]]:
    """Yield name, values and colour of each curve."""
    for (name, values), colour in zip(curves.items(), series_colours(len(curves)), strict=True):
        yield name, values, colour


def plot_curves(axes: Axes, x: FloatArray, curves: Mapping[str, FloatArray], width: float = 1.5) -> list[Line2D]:
    """Draw curves over the whole axis, the first on top where they coincide; return the lines for the legend."""
    lines = [
        axes.plot(x, values, color=colour, linewidth=width, label=name, zorder=3 - 0.01 * i)[0]
        for i, (name, values, colour) in enumerate(coloured(curves))
    ]
    axes.set_xlim(float(x[0]), float(x[-1]))
    return lines


def head(figure: Figure, title: str, lines: Sequence[Line2D] = (), heading: str = "") -> None:
    """Write the title and, below it, the row of names."""
    if title:
        width, height = figure.get_size_inches()
        looks: dict[str, Any] = {"colour": style.INK, "fontsize": style.TEXT_PT, "fontweight": "bold"}
        style.put_text(figure, 0.85 / width, 1.0 - 0.08 / height, title, n_max=110, va="top", **looks)
    if lines:
        legend_row(figure, lines, heading=heading)


def legend_row(
    figure: Figure, lines: Sequence[Line2D], *, left_in: float = 0.85, top_in: float = NAMES_AT_IN, heading: str = ""
) -> None:
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
        style.put_text(figure, left_in / width, at, heading, n_max=40, va="center")
        left_in += 0.085 * (len(plain(heading, 40)) + 1)
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
    """Shade a segment of the axis behind the data."""
    axes.axvspan(*limits, facecolor=colour, alpha=alpha, linewidth=0, zorder=0.5)


def write(axes: Axes, x: float, y: float, text: str, *, colour: str = style.QUIET, ha: str = "center") -> None:
    """Write into the panel: `x` in data, `y` as a share of its height (above one: above the panel)."""
    style.put_text(
        axes,
        x,
        y,
        text,
        colour=colour,
        n_max=40,
        transform=axes.get_xaxis_transform(),
        ha=ha,
        va="bottom" if y > 0.98 else "center",
        zorder=4,
    )


def checked_limits(limits: tuple[float, float], name: str) -> tuple[float, float]:
    """Return ascending limits."""
    low, high = limits
    if not low < high:
        raise InputError(f"{name} is {low:g} to {high:g}", allowed="ascending")
    return float(low), float(high)


def thin(x: FloatArray, y: FloatArray, n_points: int = N_POINTS) -> tuple[FloatArray, FloatArray]:
    """Return the line with at most `n_points` points, the smallest and largest value of every segment among them.

    Parameters
    ----------
    x, y : array, (n,)
        A line; finite. Shorter ones come back unchanged.
    n_points : int
        At least 4.

    Returns
    -------
    x, y : array
        Points of the line in their order, first and last included: nothing is averaged or made up.

    Raises
    ------
    InputError
        If the lengths differ or a value is not finite.

    Notes
    -----
    For display only: a thinned line has no sampling rate, and its spectrum means nothing.

    Examples
    --------
    >>> x = np.arange(1_000_000.0)
    >>> _, y = thin(x, np.where(x == 123_456, 9.0, np.sin(x)))
    >>> len(y) <= 4000, float(y.max())
    (True, 9.0)
    """
    x, y = frozen_array(x, "x", ndim=1), frozen_array(y, "y", ndim=1)
    count(n_points, "n_points", minimum=4)
    if len(x) != len(y):
        raise InputError(f"x has {len(x)} points, y has {len(y)}", allowed="equal lengths")
    if len(y) <= n_points:
        return x, y
    kept = _extremes(y, (n_points - 2) // 2)
    return x[kept], y[kept]


def envelope(x: FloatArray, y: FloatArray, n_columns: int = N_POINTS // 4) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the smallest and largest value of `y` in at most `n_columns` columns of equal numbers of points.

    Parameters
    ----------
    x, y : array, (n,)
        A line; finite.
    n_columns : int

    Returns
    -------
    x : array
        Where the largest value of each column lies: a peak keeps its position.
    low, high : array
        Short lines come back unchanged, low and high being `y`.

    Raises
    ------
    InputError
        If the lengths differ or a value is not finite.
    """
    x, y = frozen_array(x, "x", ndim=1), frozen_array(y, "y", ndim=1)
    count(n_columns, "n_columns", minimum=1)
    if len(x) != len(y):
        raise InputError(f"x has {len(x)} points, y has {len(y)}", allowed="equal lengths")
    if len(y) <= n_columns:
        return x, y, y
    starts = np.arange(0, len(y), -(-len(y) // n_columns))
    highest = np.array(
        [start + int(part.argmax()) for start, part in zip(starts, np.split(y, starts[1:]), strict=True)]
    )
    return x[highest], np.minimum.reduceat(y, starts), y[highest]


def _extremes(y: FloatArray, n_buckets: int) -> np.ndarray[tuple[int], np.dtype[np.intp]]:
    """Return the indices of both extremes of each bucket and of both ends, ascending."""
    length = -(-len(y) // n_buckets)  # rounded up, so that there are never more than n_buckets
    n_full = len(y) // length
    table = y[: n_full * length].reshape(n_full, length)
    starts = np.arange(n_full) * length
    parts = [starts + table.argmin(axis=1), starts + table.argmax(axis=1), [0, len(y) - 1]]
    tail = y[n_full * length :]
    if tail.size:
        parts.append(n_full * length + np.array([tail.argmin(), tail.argmax()]))
    return np.unique(np.concatenate(parts))
