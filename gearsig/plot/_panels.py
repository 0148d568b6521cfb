"""Panels of lines, levels and rows: one description for printed and for interactive figures."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from gearsig.checks import FloatArray
from gearsig.errors import InputError
from gearsig.plot import _style as style
from gearsig.plot._cursors import Cursor
from gearsig.plot._maps import draw_level_map

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.collections import Collection, QuadMesh
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D
    from pandas import DataFrame

    from gearsig.orders import TrackedOrder


@dataclass(frozen=True)
class ChartLine:
    """A line to draw; nan leaves a gap.

    Parameters
    ----------
    x, y : array, (n,)
    name : str
    colour : int or str
        0: measured; 1: a fault, or what a method removes; -1: pale; higher numbers: other colours; or the colour
        itself.
    band : (low, high) or None
        A pale band behind the line.
    dotted : bool
    peaks : bool
        For spectra: with more points than pixels, join the highest, over a pale band down to the lowest.
    dots : bool
        Draw points without joining them.
    """

    x: FloatArray
    y: FloatArray
    name: str = ""
    colour: int | str = 0
    band: tuple[FloatArray, FloatArray] | None = None
    dotted: bool = False
    peaks: bool = False
    dots: bool = False


@dataclass(frozen=True)
class LinePanel:
    """Lines over one axis, or paths and points in a plane.

    Parameters
    ----------
    lines : sequence of ChartLine
    x, y : str
        Names of the axes with units.
    limits : (float, float) or None
        Of the value axis; None: chosen to fit the lines.
    logarithmic : bool
        Whether the value axis is logarithmic.
    cursors : sequence of Cursor
        Lines that the machine implies.
    x_limits : (float, float) or None
        None: from the first to the last point of the lines.
    spans : sequence of (low, high, colour)
        Shaded parts of the x axis.
    is_plane : bool
        Whether `x` need not ascend.
    title : str
        What the panel shows, if that is not obvious.
    dates : bool
        Whether x is days since 1970.
    """

    lines: Sequence[ChartLine]
    x: str
    y: str
    limits: tuple[float, float] | None = None
    logarithmic: bool = False
    cursors: Sequence[Cursor] = ()
    x_limits: tuple[float, float] | None = None
    spans: Sequence[tuple[float, float, str]] = ()
    is_plane: bool = False
    title: str = ""
    dates: bool = False


@dataclass(frozen=True)
class LevelPanel:
    """Levels over two axes, with lines over them.

    Parameters
    ----------
    levels : array, (n_y, n_x)
        In dB.
    at, positions : array, (n_x,) and (n_y,)
        Ascending; `at` in equal steps.
    x, y, unit : str
        Names of the axes with units; reference of the levels.
    logarithmic : bool
        Whether the axis of positions is logarithmic.
    lines : sequence of ChartLine
    cursors : sequence of Cursor
        On the x axis.
    span : float or None
        Of the colours below the maximum level; None: chosen by the user.
    title : str
    square : bool
        Whether both axes have the same quantity and length and levels are yes or no, without a colour bar.
    """

    levels: FloatArray
    at: FloatArray
    positions: FloatArray
    x: str
    y: str
    unit: str
    logarithmic: bool = False
    lines: Sequence[ChartLine] = ()
    cursors: Sequence[Cursor] = ()
    span: float | None = None
    title: str = ""
    square: bool = False


@dataclass(frozen=True)
class ChartRow:
    """A named bar.

    Parameters
    ----------
    name : str
    start, end : float
        Of the bar.
    colour : int or str
        As in `ChartLine`.
    beside, below : str
        Text to the right of the row, and paler text below it.
    verdict : int or str or None
        Colour of `beside`; None: the text colour.
    interval : (float, float) or None
        Uncertainty of the bar's end.
    mark : float or None
        Value to compare the bar's end with.
    band : float or None
        Half width of the insignificant range around zero.
    is_total : bool
        Whether the bar is a level rather than a change.
    """

    name: str
    start: float
    end: float
    colour: int | str = 0
    beside: str = ""
    below: str = ""
    verdict: int | str | None = None
    interval: tuple[float, float] | None = None
    mark: float | None = None
    band: float | None = None
    is_total: bool = False


@dataclass(frozen=True)
class RowPanel:
    """Bars in rows over one axis.

    Parameters
    ----------
    rows : sequence of ChartRow
        At least one.
    x : str
        Name of the axis with its unit.
    bar, mark, band : str
        Names of these for the legend.
    limits : (float, float) or None
        Of the axis; None: chosen to fit the bars.
    span : (float, float) or None
        Range of the axis shaded behind all rows as insignificant.
    """

    rows: Sequence[ChartRow]
    x: str
    bar: str = ""
    mark: str = ""
    band: str = ""
    limits: tuple[float, float] | None = None
    span: tuple[float, float] | None = None


def cell_limits(positions: FloatArray, *, logarithmic: bool = False) -> tuple[float, float]:
    """Return the outer limits of the cells of ascending positions: half a step beyond the first and the last.

    If no position is negative, the limits do not extend below 0.

    Examples
    --------
    >>> cell_limits(np.array([1.0, 2.0, 3.0])), cell_limits(np.array([0.0, 1.0]))
    ((0.5, 3.5), (0.0, 1.5))
    """
    at = np.log(positions) if logarithmic else np.asarray(positions, dtype=np.float64)
    if len(at) < 2:
        return float(positions[0]), float(positions[-1])
    ends = at[0] - (at[1] - at[0]) / 2.0, at[-1] + (at[-1] - at[-2]) / 2.0
    low, high = np.exp(ends) if logarithmic else ends
    return float(low if logarithmic or positions[0] < 0 else max(low, 0.0)), float(high)


def pooled_levels(
    levels: FloatArray, positions: FloatArray, n_columns: int, n_rows: int, *, logarithmic: bool = False
) -> tuple[FloatArray, NDArray[np.intp]]:
    """Return the maximum known level of each pixel, and a row of `levels` for each row of pixels.

    Rows of pixels divide the range of `cell_limits` equally. A row without a position shows the nearest one, as the
    speeds of a run-up are unequally spaced and the next higher one would not match the orders drawn over the map.

    Parameters
    ----------
    levels : array, (n_y, n_x)
    positions : array, (n_y,)
        Ascending; rows of pixels have equal steps of it, or of its logarithm.
    n_columns, n_rows : int
        Maximum numbers.
    logarithmic : bool
    """
    n_columns = min(levels.shape[1], n_columns)
    columns = np.linspace(0, levels.shape[1], n_columns + 1).astype(int)[:-1]
    if len(positions) < 2:
        return np.fmax.reduceat(levels, columns, axis=1), np.zeros(len(positions), dtype=np.intp)
    ends, at = cell_limits(positions, logarithmic=logarithmic), np.asarray(positions, dtype=np.float64)
    if logarithmic:
        ends, at = (float(np.log(ends[0])), float(np.log(ends[1]))), np.log(at)
    steps = np.append(np.diff(at), 2.0 * (at[0] - ends[0]))
    if len(at) <= n_rows and np.allclose(steps, steps[0], rtol=1e-3):
        n_rows = len(at)
    edges = np.linspace(*ends, n_rows + 1)
    first, past = np.searchsorted(at, edges[:-1]), np.searchsorted(at, edges[1:])
    is_empty = first == past
    nearest = np.searchsorted((at[:-1] + at[1:]) / 2.0, (edges[:-1] + edges[1:]) / 2.0)
    rows = np.where(is_empty, nearest, first)
    # one additional row, for empty rows of pixels past the last position
    largest = np.fmax.reduceat(np.vstack([levels, levels[-1:]]), first, axis=0)
    pooled = np.where(is_empty[:, None], levels[nearest], largest)
    return np.fmax.reduceat(pooled, columns, axis=1), rows


def curve_panel(
    x: FloatArray,
    curves: Mapping[str, FloatArray],
    x_label: str = "",
    y_label: str = "",
    title: str = "",
    *,
    log_y: bool = False,
) -> LinePanel:
    """Return a panel of curves over one axis, coloured by their order.

    Parameters
    ----------
    x : array, (n,)
    curves : mapping
        Name → array, (n,); one to eight.
    x_label, y_label, title : str
    log_y : bool

    Raises
    ------
    InputError
        If a curve's length differs from that of its axis, or there are more than eight.
    """
    style.check_number(len(curves), f"{len(curves)} curves in one panel")
    for name, values in curves.items():
        if len(values) != len(x):
            raise InputError(f"{name} has {len(values)} points, its axis {len(x)}", allowed="equal lengths")
    lines = [ChartLine(x, values, name, colour) for name, values, colour in style.coloured(curves)]
    return LinePanel(lines, x_label, y_label, logarithmic=log_y, title=title)


def tracked_panel(tracked: Sequence[TrackedOrder]) -> LinePanel:
    """Return the panel of tracked orders: peak amplitudes over speed if it varies by more than 5 %, else over time.

    Parameters
    ----------
    tracked : sequence of TrackedOrder
        At least one, of one channel and the same blocks.
    """
    first = tracked[0]
    sweeps = float(np.ptp(first.speed_rpm)) > 0.05 * float(np.mean(first.speed_rpm))
    x, label = (first.speed_rpm, "speed (rpm)") if sweeps else (first.time_s, "time (s)")
    rising = np.argsort(x, kind="stable")
    lines = [ChartLine(x[rising], t.amplitude[rising], f"order {t.order:.6g}", k) for k, t in enumerate(tracked)]
    return LinePanel(lines, label, style.with_unit("amplitude peak", first.unit))


def panels_figure(
    panels: Sequence[LinePanel | LevelPanel],
    *,
    n_columns: int = 1,
    title: str = "",
    heading: str = "",
    height_in: float | None = None,
) -> Figure:
    """Draw panels in rows, with one legend above if all panels have the same names, else one above each.

    Parameters
    ----------
    panels : sequence of LinePanel or LevelPanel
        Row by row.
    n_columns : int
    title : str
    heading : str
        Text before the names, e.g. "roughness".
    height_in : float or None
        Of a row; None: the default for lines or levels.

    Raises
    ------
    InputError
        If there is no panel.
    """
    if not panels:
        raise InputError("no panel is given", allowed="at least 1")
    rows = [panels[i : i + n_columns] for i in range(0, len(panels), n_columns)]
    of_levels = any(isinstance(panel, LevelPanel) for panel in panels)
    names = {tuple(line.name for line in panel.lines) for panel in panels if isinstance(panel, LinePanel)}
    is_named = not of_levels and len(names) == 1 and (len(next(iter(names))) > 1 or bool(heading))
    figure, axes = style.panels(
        [height_in or (3.2 if any(isinstance(panel, LevelPanel) for panel in row) else 2.2) for row in rows],
        (1.0,) * n_columns,
        right_in=1.0 if of_levels else 0.2,
        top_in=0.45 + (0.25 if is_named else 0.0) + (0.2 if panels[0].title else 0.0),
        row_gap_in=0.62 if is_named and not any(panel.title for panel in panels) else 0.78,
    )
    lines: list[Line2D] = []
    for place, panel in zip(axes, panels, strict=False):
        lines = _draw_panel(place, panel)
        if not is_named and isinstance(panel, LinePanel) and len(lines) > 1:
            place.legend(  # above the panel: it never covers data
                fontsize=style.SMALL_PT,
                frameon=False,
                labelcolor=style.INK,
                loc="lower right",
                bbox_to_anchor=(1.0, 1.0),
                ncols=len(lines),
                borderaxespad=0.0,
            )
        style.label_axes(place, panel.x, panel.y, panel.title)
    for unused in axes[len(panels) :]:
        unused.set_visible(False)
    style.head(figure, title, lines if is_named else (), heading)
    return figure


def _draw_panel(axes: Axes, panel: LinePanel | LevelPanel) -> list[Line2D]:
    """Draw a panel; return its lines."""
    if panel.logarithmic:
        axes.set_yscale("log")
    if isinstance(panel, LevelPanel):
        draw_level_map(axes, panel.at, panel.positions, panel.levels, panel.unit)
    lines = [_draw(axes, line, thinned=isinstance(panel, LinePanel)) for line in panel.lines]
    for cursor in panel.cursors:
        axes.axvline(cursor.position, color=style.QUIET, lw=0.7, ls=":", zorder=1)
    if isinstance(panel, LinePanel):
        if panel.limits is not None:
            axes.set_ylim(*panel.limits)
        ends = [end for line in panel.lines for end in (float(line.x[0]), float(line.x[-1]))]
        axes.set_xlim(min(ends), max(ends))
    return lines


_CYCLE = (style.MEASURED, style.FAULT, style.MESH, style.BEARING, style.SHAFT)


def line_colour(colour: int | str) -> str:
    """Return the colour of a `ChartLine` for printed figures."""
    if isinstance(colour, str):
        return colour
    return style.QUIET if colour < 0 else _CYCLE[colour % len(_CYCLE)]


def _draw(axes: Axes, line: ChartLine, *, thinned: bool) -> Line2D:
    colour = line_colour(line.colour)
    if line.peaks and _has_many_ascending(line.x):
        x, _, y = style.envelope(line.x, line.y, style.N_POINTS // 2)
    else:
        x, y = _thinned(line.x, line.y) if thinned else (line.x, line.y)
    if line.band is not None:
        axes.fill_between(line.x, *line.band, color=colour, alpha=0.2, linewidth=0)
    return axes.plot(x, y, color=colour, lw=1.1, ls=":" if line.dotted else "-", label=line.name)[0]


# --------------------
# The inverse: the content of a figure as panels.
# --------------------


UNDER_A_LINE = "_under a line"
"""Label of an area filled below a line that is also drawn."""


def panels_of(figure: Figure) -> list[list[list[LinePanel | LevelPanel]]]:
    """Return the content of a figure of lines, bars and points as rows of columns of panels, to be zoomed.

    Axes at the same place, for two quantities over one axis, are panels of one column. A map of equal steps becomes a
    panel without contour lines, as hovering shows the values. Empty if a figure contains what no panel can show: polar
    axes, categorical axes, surfaces, or filled areas other than those below a line (`UNDER_A_LINE`).
    """
    from matplotlib.collections import QuadMesh
    from matplotlib.ticker import FixedFormatter

    places: dict[tuple[float, float], list[LinePanel | LevelPanel]] = {}
    for axes in figure.axes:
        if not axes.axison or axes.get_label() == "<colorbar>":
            continue
        is_named = any(isinstance(a.get_major_formatter(), FixedFormatter) for a in (axes.xaxis, axes.yaxis))
        drawn: list[Collection] = list(axes.collections)
        if axes.name != "rectilinear" or is_named or not all(map(_fits_a_panel, drawn)):
            return []
        box = axes.get_position()
        panel = (
            _level_panel(axes)
            if axes.images or any(isinstance(c, QuadMesh) for c in drawn)
            else _line_panel(axes, _names_of_looks(figure, axes))
        )
        places.setdefault((-round(box.y1, 2), round(box.x0, 2)), []).append(panel)
    rows = [[places[place] for place in sorted(places) if place[0] == y] for y in sorted({y for y, _ in places})]
    return [row for row in rows if any(panel for panels in row for panel in panels)]


def _fits_a_panel(drawn: Collection) -> bool:
    """Whether a panel can show it: vertical lines, a map of equal steps, its contour lines, or an area below a line."""
    from matplotlib.collections import LineCollection, QuadMesh
    from matplotlib.contour import ContourSet

    if isinstance(drawn, QuadMesh):
        steps = np.diff(_axes_of_mesh(drawn)[0])
        return bool(len(steps) and np.all(steps > 0.0) and np.ptp(steps) < 1e-3 * steps.mean())
    if isinstance(drawn, ContourSet):
        return not drawn.filled
    return isinstance(drawn, LineCollection) or drawn.get_label() == UNDER_A_LINE


def _axes_of_mesh(mesh: QuadMesh) -> tuple[FloatArray, FloatArray]:
    """Return the positions of a map's columns and rows: the centres of cells, or their corners."""
    corners = np.asarray(mesh.get_coordinates(), dtype=np.float64)
    x, y = corners[0, :, 0], corners[:, 0, 1]
    if np.asarray(mesh.get_array()).shape == corners.shape[:2]:  # shaded from corner to corner
        return x, y
    return (x[:-1] + x[1:]) / 2.0, (y[:-1] + y[1:]) / 2.0


def _names_of_looks(figure: Figure, axes: Axes) -> dict[tuple[str, bool], str]:
    """Return the legend names of lines, by colour and whether they are broken."""
    from matplotlib.lines import Line2D

    legends = [legend for legend in (*figure.legends, axes.get_legend()) if legend is not None]
    return {
        (_colour(handle.get_color()), _is_broken(handle)): text.get_text()
        for legend in legends
        for handle, text in zip(legend.legend_handles, legend.get_texts(), strict=True)
        if isinstance(handle, Line2D)
    }


def _own_name(drawn: Any) -> str:
    """Return the name given to a line; matplotlib's automatic names begin with an underscore."""
    name = str(drawn.get_label() or "")
    return "" if name.startswith("_") else name


def _is_broken(line: Line2D) -> bool:
    return line.get_linestyle() not in ("-", "None")


def _colour(colour: Any) -> str:
    from matplotlib.colors import to_hex

    return to_hex(colour).upper()


def _number_of(colour: str) -> int | str:
    known = [colour_code.upper() for colour_code in _CYCLE]
    if colour in known:
        return known.index(colour)
    quiet = (style.QUIET, style.FLOOR, style.INK, style.RULE)
    return -1 if colour in {colour_code.upper() for colour_code in quiet} else colour


def _text_of(axes: Axes) -> str:
    named = {*_names_of_upright_lines(axes).values(), *(str(line.get_label()) for line in axes.lines)}
    words = [axes.get_title(loc="left"), *(text.get_text() for text in axes.texts)]
    return " · ".join(word for word in words if word and word not in named)


def _names_of_upright_lines(axes: Axes) -> dict[float, str]:
    """Return the texts at vertical lines, by position."""
    upright = axes.get_xaxis_transform()
    at = {float(np.ravel(line.get_xdata())[0]) for line in axes.lines if line.get_transform() == upright}
    texts = {float(text.get_position()[0]): text.get_text() for text in axes.texts if text.get_transform() == upright}
    return {x: text for x, text in texts.items() if x in at}


def _x_label(axes: Axes) -> str:
    """Return the name of the x axis; of stacked panels with the same range, only the last one shows it."""
    left = round(axes.get_position().x0, 2)
    alike = [other for other in _panels_beside(axes) if other.get_xlim() == axes.get_xlim()]
    names = [other.get_xlabel() for other in (axes, *alike) if round(other.get_position().x0, 2) == left]
    return next(filter(None, names), "")


def _y_label(axes: Axes) -> str:
    """Return the name of the y axis; of side-by-side panels with the same range, only the first one shows it."""
    top = round(axes.get_position().y1, 2)
    alike = [other for other in _panels_beside(axes) if other.get_ylim() == axes.get_ylim()]
    names = [other.get_ylabel() for other in (axes, *alike) if round(other.get_position().y1, 2) == top]
    return next(filter(None, names), "")


def _panels_beside(axes: Axes) -> list[Axes]:
    figure = axes.get_figure(root=True)
    return [other for other in (figure.axes if figure is not None else ()) if other.get_label() != "<colorbar>"]


def _level_panel(axes: Axes) -> LevelPanel:
    from matplotlib.collections import QuadMesh

    mesh = next((drawn for drawn in axes.collections if isinstance(drawn, QuadMesh)), None)
    if mesh is not None:
        levels = np.asarray(mesh.get_array(), dtype=np.float64)
        unit = mesh.colorbar.ax.get_ylabel() if mesh.colorbar is not None else ""
        low, high = (float(np.max(limit)) for limit in mesh.get_clim())
        is_logarithmic, words = axes.get_yscale() == "log", _text_of(axes)
        names = (_x_label(axes), _y_label(axes), unit)
        return LevelPanel(levels, *_axes_of_mesh(mesh), *names, is_logarithmic, span=high - low or 1.0, title=words)
    image = axes.images[0]
    left, right, low, high = image.get_extent()
    values, unit = np.asarray(np.ma.filled(np.ma.asarray(image.get_array(), dtype=np.float64), np.nan)), ""
    if image.colorbar is not None:
        unit, values = image.colorbar.ax.get_ylabel(), np.clip(values, *image.get_clim())
    at, positions = (np.linspace(a, b, n) for a, b, n in ((left, right, values.shape[1]), (low, high, values.shape[0])))
    span = float(np.nanmax(values) - np.nanmin(values)) or 1.0
    names = (axes.get_xlabel(), axes.get_ylabel(), unit)
    return LevelPanel(
        values, at, positions, *names, span=span, title=_text_of(axes), square=axes.get_aspect() in ("equal", 1.0)
    )


def _line_panel(axes: Axes, names: Mapping[tuple[str, bool], str]) -> LinePanel:
    from matplotlib.patches import Rectangle

    lines: list[ChartLine] = []
    cursors: list[Cursor] = []
    limits = axes.get_xlim()
    named = _names_of_upright_lines(axes)

    def take(x: Any, y: Any, colour: Any, label: str = "", **looks: Any) -> None:
        is_quiet = isinstance(number := _number_of(name := _colour(colour)), int) and number < 0
        by_looks = names.get((name, looks.get("dotted", False)), "") or names.get((name, False), "")
        # a legend of the whole figure may name a line of another panel in the same colour
        about = label or ("" if is_quiet else by_looks)
        lines.append(ChartLine(np.asarray(x, float), np.asarray(y, float), about, number, **looks))

    for line in axes.lines:
        x, y = line.get_xdata(), line.get_ydata()
        joined = line.get_linestyle() != "None"
        if line.get_transform() == axes.get_xaxis_transform():
            is_fault = _number_of(_colour(line.get_color())) == 1
            at = float(np.ravel(x)[0])
            cursors.append(Cursor(at, "finding" if is_fault else "", named.get(at, "")))
        elif line.get_transform() == axes.get_yaxis_transform():
            take(limits, np.ravel(y)[[0, 0]], line.get_color(), _own_name(line), dotted=True)
        elif len(np.ravel(x)):
            take(x, y, line.get_color(), _own_name(line), dotted=_is_broken(line), dots=not joined)
    collections: list[Any] = [drawn for drawn in axes.collections if drawn.get_label() != UNDER_A_LINE]
    for collection in collections:  # vertical lines
        ends = np.array(collection.get_segments()).reshape(-1, 2, 2)
        gaps = np.concatenate([ends, np.full((len(ends), 1, 2), np.nan)], axis=1)
        gaps[:, 2, 0] = ends[:, 1, 0]
        take(gaps[..., 0].ravel(), gaps[..., 1].ravel(), collection.get_edgecolor()[0], _own_name(collection))
    in_bars = {patch for bars in axes.containers for patch in bars}
    for bars in axes.containers:
        corners = [(b.get_x(), b.get_width(), b.get_y(), b.get_height()) for b in bars]
        x = [at for left, width, *_ in corners for at in (left, left, left + width, left + width, left + width)]
        y = [at for *_, low, height in corners for at in (low, low + height, low + height, low, np.nan)]
        take(x, y, bars[0].get_facecolor())
    spans = [
        (patch.get_x(), patch.get_x() + patch.get_width(), _colour(patch.get_facecolor()))
        for patch in axes.patches
        if isinstance(patch, Rectangle) and patch not in in_bars
    ]
    is_plane = any(line.dots or bool(np.any(np.diff(line.x) < 0.0)) for line in lines)
    fixed = is_plane or not axes.get_autoscaley_on()
    return LinePanel(
        lines,
        _x_label(axes),
        axes.get_ylabel(),
        axes.get_ylim() if fixed else None,
        axes.get_yscale() == "log",
        cursors,
        limits,
        spans,
        is_plane,
        _text_of(axes),
    )


# --------------------
# The content of any figure as a table.
# --------------------


def figure_table(figure: Figure) -> DataFrame:
    """Return the content of a figure as a table: panel, series, x, y, and the level of what is coloured by one.

    Lines and points are given by position, images and meshes by cell centres, bars by centre and height, filled areas
    and surfaces by their corners. For polar panels, x is the angle in rad and y the radius. Panels and series are named
    as in titles, axes and legends.
    """
    import pandas as pd

    rows = [
        pd.DataFrame({"panel": _panel_name(axes, number), "series": series_name, "x": x, "y": y, "level": level})
        for number, axes in enumerate(figure.axes, 1)
        if axes.get_label() != "<colorbar>" and axes.get_visible()
        for series_name, x, y, level in _drawn_series(axes)
        if len(x)
    ]
    return pd.concat(rows, ignore_index=True) if rows else pd.DataFrame(columns=["panel", "series", "x", "y", "level"])


def _panel_name(axes: Axes, number: int) -> str:
    over = " over ".join(filter(None, [axes.get_ylabel(), _x_label(axes)]))
    words = [axes.get_title(loc="left"), axes.get_title(), over]
    return next(filter(None, words), f"panel {number}")


_Series = tuple[str, FloatArray, FloatArray, FloatArray]


def _drawn_series(axes: Axes) -> Iterator[_Series]:
    """Yield name, positions and levels of everything drawn in data coordinates."""
    from matplotlib.collections import PathCollection, QuadMesh

    def row(name: str, x: Any, y: Any, level: Any = np.nan) -> _Series:
        at = np.ravel(np.asarray(x, dtype=np.float64))
        return name, at, np.ravel(np.asarray(y, dtype=np.float64)), np.broadcast_to(np.ravel(level), at.shape)

    for i, line in enumerate(axes.lines, 1):
        if line.get_transform() == axes.transData:
            yield row(_own_name(line) or f"line {i}", line.get_xdata(orig=False), line.get_ydata(orig=False))
    for bars in axes.containers:
        patches = [bar for bar in bars if hasattr(bar, "get_width")]
        ends = [bar.get_y() + bar.get_height() for bar in patches]
        yield row(_own_name(bars) or "bars", [bar.get_x() + bar.get_width() / 2.0 for bar in patches], ends)
    for i, image in enumerate(axes.images, 1):
        values = np.ma.filled(np.ma.asarray(image.get_array(), dtype=np.float64), np.nan)
        if values.ndim == 2:  # not a photograph
            (left, right, low, high), (n_rows, n_columns) = image.get_extent(), values.shape
            at = left + (np.arange(n_columns) + 0.5) * (right - left) / n_columns
            upwards = low + (np.arange(n_rows) + 0.5) * (high - low) / n_rows
            x, y = np.meshgrid(at, upwards if image.origin == "lower" else upwards[::-1])
            yield row(f"image {i}", x, y, values)
    drawn: list[Collection] = list(axes.collections)
    for i, collection in enumerate(drawn, 1):
        levels = collection.get_array()
        name = _own_name(collection) or f"area {i}"
        if isinstance(collection, QuadMesh):
            edges = np.asarray(collection.get_coordinates(), dtype=np.float64)
            middles = (edges[:-1, :-1] + edges[1:, :-1] + edges[:-1, 1:] + edges[1:, 1:]) / 4.0
            yield row(name, middles[..., 0], middles[..., 1], np.ma.filled(np.ma.asarray(levels, float), np.nan))
            continue
        if isinstance(collection, PathCollection):
            places = np.ma.filled(np.ma.asarray(collection.get_offsets(), dtype=np.float64), np.nan)
            known = levels is not None and np.size(levels) == len(places)
            yield row(name, places[:, 0], places[:, 1], np.asarray(levels, dtype=np.float64) if known else np.nan)
            continue
        corners = [np.asarray(path.vertices, dtype=np.float64) for path in collection.get_paths()]
        known = levels is not None and np.size(levels) == len(corners)
        level_of_cell = np.ravel(np.asarray(levels, dtype=np.float64)) if known else np.full(len(corners), np.nan)
        repeated = np.repeat(level_of_cell, [len(places) for places in corners])
        joined = np.concatenate([np.empty((0, 2)), *corners])
        yield row(name, joined[:, 0], joined[:, 1], repeated)


def _thinned(x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Thin the points if x ascends; other paths are drawn in full."""
    return style.thin(x, y) if _has_many_ascending(x) else (x, y)


def _has_many_ascending(x: FloatArray) -> bool:
    return len(x) > style.N_POINTS and bool((x[1:] > x[:-1]).all())
