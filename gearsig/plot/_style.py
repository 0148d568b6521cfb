"""The common style of all figures: sizes, fonts, and colours with fixed meanings.

Everything is set on the figure itself. Matplotlib's global settings and `pyplot` are never touched, so that several
threads can draw figures at the same time, and figures are freed with their last reference.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import cache, partial
from io import BytesIO
from math import log10
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from gearsig.checks import FloatArray, count, frozen_array
from gearsig.errors import InputError
from gearsig.formatting import counted, unit_text
from gearsig.spectra import Scaling

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Colormap
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D
    from matplotlib.projections.polar import PolarAxes


Scale = Literal["log", "decibel", "linear"]
"""How values are drawn: on a logarithmic axis, in decibels on a linear axis, or unchanged."""


SOUND_REFERENCE_PA = 20e-6
"""Reference sound pressure in air (ISO 1683)."""


def decibels(values: FloatArray, scaling: Scaling, unit: str = "") -> FloatArray:
    """Return values in dB re one unit, or re 20 µPa of sound: 20 lg of amplitudes, 10 lg of powers.

    Sound levels refer to RMS values, as in ISO 80000-8: peak amplitudes are reduced by 3 dB.
    Zeros are drawn 200 dB (amplitudes) or 100 dB (powers) below the maximum.
    """
    factor = 10.0 if scaling in ("power", "power density") else 20.0
    result: FloatArray = factor * np.log10(above_zero(values))
    if not is_sound_pressure(unit):
        return result
    return result - 20.0 * log10(SOUND_REFERENCE_PA) - (10.0 * log10(2.0) if scaling == "amplitude peak" else 0.0)


def level_name(scaling: str, unit: str) -> str:
    """Return the quantity of levels in dB: the scaling, or the sound pressure level.

    Examples
    --------
    >>> level_name("amplitude peak", "Pa"), level_name("amplitude peak", "m/s^2")
    ('sound pressure level', 'amplitude peak')
    """
    return "sound pressure level" if unit == "Pa" and scaling.startswith("amplitude") else scaling


def decibel_text(unit: str) -> str:
    """Return the unit of levels in dB with its reference.

    Examples
    --------
    >>> decibel_text("m/s^2"), decibel_text("Pa"), decibel_text("Pa^2/Hz"), decibel_text("")
    ('dB re 1 m/s²', 'dB re 20 µPa', 'dB re (20 µPa)²/Hz', 'dB re 1')
    """
    if is_sound_pressure(unit):
        reference = "20 µPa" if unit == "Pa" else "(20 µPa)"  # for amplitudes; squared for powers
        return f"dB re {unit_text(unit.replace('Pa', reference))}"
    return f"dB re 1 {unit_text(unit)}".rstrip()


def is_sound_pressure(unit: str) -> bool:
    """Whether values are sound pressures, or powers of them."""
    return unit.partition("^2")[0] == "Pa"


def above_zero(values: FloatArray) -> FloatArray:
    """Return values raised to at least a tiny share of the maximum, so that they have a logarithm."""
    largest = float(np.max(values, initial=0.0))
    lowest = 1e-10 * largest if largest > 0 else 1e-10
    return np.maximum(np.asarray(values, dtype=np.float64), max(lowest, float(np.finfo(np.float64).tiny)))


def with_unit(name: str, unit: str) -> str:
    """Return a quantity with its unit in brackets, or alone if the unit is not known."""
    return f"{name} ({unit_text(unit)})" if unit else name


def plain(text: str, n_max: int = 60) -> str:
    """Return one line that the figures' font can draw, cut in the middle to `n_max` characters.

    Names come from files: characters that the font lacks become "?".
    """
    drawable = _drawable_code_points()
    return "".join(c if ord(c) in drawable else "?" for c in cut(text, n_max))


def cut(text: str, n_max: int = 60) -> str:
    """Return a text from a file on one line, without control characters, cut in the middle to `n_max` characters."""
    line = " ".join("".join(c if c.isprintable() else " " for c in text).split())
    if len(line) <= n_max:
        return line
    tail = n_max // 3
    return f"{line[: n_max - tail - 1]}…{line[-tail:]}"


@cache
def _drawable_code_points() -> frozenset[int]:
    from matplotlib.font_manager import FontProperties, findfont, get_font

    return frozenset(get_font(findfont(FontProperties(family=["DejaVu Sans"]))).get_charmap())


# The colours of Okabe and Ito (Color Universal Design, 2008), which colour-blind readers can distinguish.
MEASURED = "#0072B2"
FAULT = "#D55E00"
SIMULATED = "#C98A00"  # their orange, darkened, to go with the blue of measured data
FLOOR = "#7A7A7A"
MESH = "#00795A"  # their bluish green, darkened for thin lines and small print
SHAFT = "#9A6A00"  # their orange, darkened likewise
BEARING = "#A8447E"  # their reddish purple, darkened likewise
INK = "#23272E"
QUIET = "#5B626C"
RULE = "#D9DDE2"

CURSOR_COLOURS = {"mesh": MESH, "sideband": MESH, "shaft": SHAFT, "bearing": BEARING, "hunting": QUIET}
"""Colour of each kind of order line."""

MICRO, MILLI, KILO = 1e6, 1e3, 1e-3
"""Factors from SI units to the axis units µm, mm (also ms, mrad) and kN."""

DOTS_PER_INCH = 100
WIDTH_IN = 9.0
TEXT_PT = 9.5
SMALL_PT = 9.0  # 7 pt when a figure of this width is printed on A4
LINE_PT = 0.9


def new_figure(height_in: float, width_in: float = WIDTH_IN) -> Figure:
    """Return an empty figure, by default 900 pixels wide, which notebooks show even where `pyplot` is not imported."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width_in, height_in), dpi=DOTS_PER_INCH, facecolor="white")
    figure._repr_png_ = partial(_png_of, figure)  # type: ignore[attr-defined]
    return figure


def _png_of(figure: Figure) -> bytes:
    buffer = BytesIO()
    figure.savefig(buffer, format="png")
    return buffer.getvalue()


def _apply_common_look(axes: Axes) -> None:
    """Apply the common style to axes: pale ticks and rules, no box."""
    axes.set_facecolor("none")
    axes.spines[["top", "right"]].set_visible(False)
    axes.spines[["left", "bottom"]].set(color=QUIET, linewidth=0.8)
    axes.tick_params(which="both", colors=QUIET, labelcolor=INK, labelsize=SMALL_PT, width=0.8, direction="out")
    axes.tick_params(which="minor", length=2, width=0.5)
    axes.grid(visible=True, axis="y", which="major", color=RULE, linewidth=0.7)
    axes.set_axisbelow(True)


def panels(
    heights_in: Sequence[float],
    widths: Sequence[float] = (1.0,),
    *,
    left_in: float = 0.85,
    right_in: float = 0.2,
    bottom_in: float = 0.55,
    top_in: float = 0.68,
    row_gap_in: float = 0.5,
    column_gap_in: float = 0.95,
    width_in: float = WIDTH_IN,
    share_x: bool = False,
) -> tuple[Figure, list[Axes]]:
    """Return a figure with rows and columns of panels.

    Parameters
    ----------
    heights_in : sequence of float
        Of the rows, from the top.
    widths : sequence of float
        Of the columns, relative to each other; together they fill the figure.
    left_in, right_in, bottom_in, top_in : float
        Margins for labels, title and legend row; a title alone needs 0.42.
    row_gap_in, column_gap_in : float
    width_in : float
        Of the figure.
    share_x : bool
        Whether panels of a column share the x axis, with numbers under the last row only.

    Returns
    -------
    Figure
    list of Axes
        Row by row.
    """
    n_rows, n_columns = len(heights_in), len(widths)
    height_in = top_in + sum(heights_in) + row_gap_in * (n_rows - 1) + bottom_in
    figure = new_figure(height_in, width_in)
    free_in = width_in - left_in - right_in - column_gap_in * (n_columns - 1)
    grid = figure.add_gridspec(
        n_rows,
        n_columns,
        left=left_in / width_in,
        right=1.0 - right_in / width_in,
        bottom=bottom_in / height_in,
        top=1.0 - top_in / height_in,
        height_ratios=heights_in,
        width_ratios=widths,
        hspace=row_gap_in * n_rows / sum(heights_in),
        wspace=column_gap_in * n_columns / free_in,
    )
    result: list[Axes] = []
    for row in range(n_rows):
        for column in range(n_columns):
            axes = figure.add_subplot(grid[row, column], sharex=result[column] if share_x and row else None)
            _apply_common_look(axes)
            if share_x:
                axes.tick_params(labelbottom=row == n_rows - 1)
            result.append(axes)
    return figure, result


def size_in(axes: Axes) -> tuple[float, float]:
    """Return width and height of a panel in inches."""
    figure = axes.get_figure(root=True)
    assert figure is not None  # noqa: S101 - every panel belongs to one
    width, height = figure.get_size_inches()
    place = axes.get_position()
    return float(place.width * width), float(place.height * height)


def colours() -> Colormap:
    """Return a colour map from white through blue to nearly black, with even steps of lightness for all readers."""
    from matplotlib.colors import LinearSegmentedColormap

    return LinearSegmentedColormap.from_list(
        "level", ["#FFFFFF", "#C9DDF0", "#6FA8D6", "#1F6FB0", "#0B3A69", "#06172E"]
    )


def font_folder() -> Path:
    """Return the folder of the figures' fonts, which are part of matplotlib."""
    from matplotlib import get_data_path

    return Path(get_data_path()) / "fonts" / "ttf"


def level_colours(*, dark: bool = False) -> NDArray[np.uint8]:
    """Return 256 colours for levels as (256, 3) bytes, starting from the background; high is light on dark.

    Parameters
    ----------
    dark : bool
        Whether the background is dark.
    """
    scale = (255 * colours()(np.linspace(0, 1, 256))[:, :3]).round().astype(np.uint8)
    return scale[::-1] if dark else scale


def colour_bar(axes: Axes, drawn: ScalarMappable, label: str = "", *, gap_in: float = 0.15, **looks: Any) -> Axes:
    """Draw a colour bar to the right of a panel, of equal height; `looks` are passed to `Figure.colorbar`."""
    figure = axes.get_figure(root=True)
    assert figure is not None  # noqa: S101 - every panel belongs to one
    width, place = figure.get_size_inches()[0], axes.get_position()
    right_of_it = (place.x1 + gap_in / width, place.y0, 0.12 / width, place.height)
    bar_axes = figure.add_axes(right_of_it, label="<colorbar>")  # matplotlib's own label for colour bars
    figure.colorbar(drawn, cax=bar_axes, **looks).outline.set_visible(False)
    bar_axes.tick_params(colors=QUIET, labelcolor=INK, labelsize=SMALL_PT)
    bar_axes.set_ylabel(plain(label), color=INK, fontsize=TEXT_PT, parse_math=False)
    return bar_axes


def put_text(
    target: Axes | Figure,
    x: float,
    y: float,
    text: str,
    *,
    colour: str = QUIET,
    fontsize: float = SMALL_PT,
    n_max: int = 90,
    **looks: Any,
) -> None:
    """Write small pale text; names from files are never read as markup. `looks` are passed to `Axes.text`."""
    target.text(x, y, plain(text, n_max), color=colour, fontsize=fontsize, parse_math=False, **looks)


def polar_panel(figure: Figure) -> PolarAxes:
    """Add bare polar axes with zero at the top and clockwise angle."""
    from matplotlib.projections.polar import PolarAxes

    axes = figure.add_axes((0.02, 0.02, 0.96, 0.96), projection="polar")
    assert isinstance(axes, PolarAxes)  # noqa: S101 - what projection="polar" returns, said to the type checker
    axes.set_facecolor("none")
    axes.set_theta_zero_location("N")
    axes.set_theta_direction(-1)
    axes.set_axis_off()
    return axes


def label_axes(axes: Axes, x: str = "", y: str = "", title: str = "") -> None:
    """Name the axes and the panel; names from files are never read as markup."""
    axes.set_xlabel(plain(x, 110), color=INK, fontsize=TEXT_PT, parse_math=False)
    axes.set_ylabel(plain(y, 60), color=INK, fontsize=TEXT_PT, parse_math=False)
    if title:
        axes.set_title(plain(title, 110), loc="left", color=INK, fontsize=TEXT_PT, fontweight="bold", parse_math=False)


def no_offset(*panels: Axes) -> None:
    """Write tick labels of linear axes in full: "1999.8", not "-0.2 + 2e3"; "8e−05", not "8" and a factor elsewhere."""
    from matplotlib.ticker import FuncFormatter, ScalarFormatter

    for axis in (axis for axes in panels for axis in (axes.xaxis, axes.yaxis)):
        if isinstance(axis.get_major_formatter(), ScalarFormatter):
            axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:.8g}".replace("-", "−")))


def number_decades(axis: Axis, n_digits: int = 6) -> None:
    """Label 1, 2 and 5 of each decade of a logarithmic axis in full."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:.{n_digits}g}"))
    axis.set_minor_formatter(NullFormatter())


def note(axes: Axes, text: str) -> None:
    """Write a pale note into the upper right corner, above the panel."""
    above = 1.0 + 0.06 / size_in(axes)[1]
    put_text(axes, 1.0, above, text, transform=axes.transAxes, ha="right", va="bottom")


# --------------------
# Several curves in one figure: checked against their axis, coloured in order, named above the panel.
# --------------------


MAX_CURVES = 8
NAMES_AT_IN = 0.42
"""Distance in inches from the figure's top to the middle of the legend row, under a title."""
N_POINTS = 4000
"""Number of points of a thinned line: more than twice the pixel columns of a figure."""


CYCLES = "mesh cycles (tooth passages)"
"""Label of an axis of mesh cycles."""


def padded(values: FloatArray) -> tuple[float, float]:
    """Return axis limits that leave a little room around values."""
    low, high = float(values.min()), float(values.max())
    margin = 0.06 * (high - low) or 1.0
    return low - margin, high + margin


def series_colours(n: int) -> tuple[str, ...]:
    """Return `n` colours from dark blue to orange, with lightness increasing so that all readers see the order.

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
    """Return curves of `n` points each; with `gaps`, NaN interrupts a curve.

    Raises
    ------
    InputError
        If there is none, there are more than a reader can distinguish, or a length is wrong.
    """
    check_number(len(curves), f"{name} holds {len(curves)} curves")
    return {label: checked_values(values, n, f"{name}[{label!r}]", gaps=gaps) for label, values in curves.items()}


def check_number(n: int, problem: str, n_max: int = MAX_CURVES) -> None:
    """Refuse no curves, or more than a reader can distinguish."""
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
    """Draw curves over the whole axis, the first on top where they coincide; return lines for the legend."""
    lines = [
        axes.plot(x, values, color=colour, linewidth=width, label=name, zorder=3 - 0.01 * i)[0]
        for i, (name, values, colour) in enumerate(coloured(curves))
    ]
    axes.set_xlim(float(x[0]), float(x[-1]))
    return lines


def head(figure: Figure, title: str, lines: Sequence[Line2D] = (), heading: str = "") -> None:
    """Write the title and, below it, the legend row."""
    if title:
        width, height = figure.get_size_inches()
        looks: dict[str, Any] = {"colour": INK, "fontsize": TEXT_PT, "fontweight": "bold"}
        put_text(figure, 0.85 / width, 1.0 - 0.08 / height, title, n_max=110, va="top", **looks)
    if lines:
        legend_row(figure, lines, heading=heading)


def legend_row(
    figure: Figure, lines: Sequence[Line2D], *, left_in: float = 0.85, top_in: float = NAMES_AT_IN, heading: str = ""
) -> None:
    """Draw a legend in one row whose middle is `top_in` below the figure's top, so that it never covers data.

    Parameters
    ----------
    figure : Figure
    lines : sequence of Line2D
        Their labels are shown.
    left_in, top_in : float
    heading : str
        Written before the names, e.g. "crack depth".
    """
    width, height = figure.get_size_inches()
    at = 1.0 - top_in / height
    if heading:
        put_text(figure, left_in / width, at, heading, n_max=40, va="center")
        left_in += 0.085 * (len(plain(heading, 40)) + 1)
    legend = figure.legend(
        lines,
        [plain(str(line.get_label()), 30) for line in lines],
        loc="center left",
        bbox_to_anchor=(left_in / width, at),
        ncols=len(lines),
        fontsize=SMALL_PT,
        frameon=False,
        labelcolor=INK,
        handlelength=1.6,
        columnspacing=1.3,
        borderpad=0.0,
        borderaxespad=0.0,
    )
    for text in legend.get_texts():
        text.set_parse_math(False)


def upper_right(figure: Figure, right_in: float = 0.2) -> tuple[float, float]:
    """Return the upper right corner of a figure within its margins, as fractions of its size."""
    width, height = figure.get_size_inches()
    return 1.0 - right_in / float(width), 1.0 - 0.08 / float(height)


def shade(axes: Axes, limits: tuple[float, float], colour: str = FLOOR, alpha: float = 0.14) -> None:
    """Shade a range of the axis behind the data."""
    axes.axvspan(*limits, facecolor=colour, alpha=alpha, linewidth=0, zorder=0.5)


def write(axes: Axes, x: float, y: float, text: str, *, colour: str = QUIET, ha: str = "center") -> None:
    """Write into a panel: `x` in data coordinates, `y` as a fraction of its height (above 1: above the panel)."""
    put_text(
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
    """Return a line thinned to at most `n_points` points, including the minimum and maximum of each segment.

    Parameters
    ----------
    x, y : array, (n,)
        A line; finite. Shorter ones are returned unchanged.
    n_points : int
        At least 4.

    Returns
    -------
    x, y : array
        Points of the line in order, including the first and last; nothing is averaged or interpolated.

    Raises
    ------
    InputError
        If the lengths differ or a value is not finite.

    Notes
    -----
    For display only: a thinned line has no sampling rate, and its spectrum is meaningless.

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
    """Return the minimum and maximum of `y` in at most `n_columns` columns of equal numbers of points.

    Parameters
    ----------
    x, y : array, (n,)
        A line; finite.
    n_columns : int

    Returns
    -------
    x : array
        Position of each column's maximum, so that a peak keeps its position.
    low, high : array
        Short lines are returned unchanged, with `low` and `high` equal to `y`.

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
    length = -(-len(y) // n_buckets)  # rounded up, for at most n_buckets buckets
    n_full = len(y) // length
    table = y[: n_full * length].reshape(n_full, length)
    starts = np.arange(n_full) * length
    parts = [starts + table.argmin(axis=1), starts + table.argmax(axis=1), [0, len(y) - 1]]
    tail = y[n_full * length :]
    if tail.size:
        parts.append(n_full * length + np.array([tail.argmin(), tail.argmax()]))
    return np.unique(np.concatenate(parts))
