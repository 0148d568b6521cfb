"""Panels of lines and of levels: one description for figures that are printed and figures that are zoomed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from gearsig.checks import FloatArray
from gearsig.errors import InputError
from gearsig.plot import _series as series
from gearsig.plot import _style as style
from gearsig.plot._cursors import Cursor
from gearsig.plot._maps import draw_level_map

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class ChartLine:
    """A line to draw; nan where it has a gap.

    Parameters
    ----------
    x, y : array, (n,)
    name : str
    colour : int
        0 what was measured, 1 a fault or what a method takes out, -1 quiet; further numbers are further colours.
    band : (low, high) or None
        A pale band behind it.
    dotted : bool
    peaks : bool
        Where there are more points than pixels, join the highest, over a pale band down to the lowest: of spectra.
    """

    x: FloatArray
    y: FloatArray
    name: str
    colour: int = 0
    band: tuple[FloatArray, FloatArray] | None = None
    dotted: bool = False
    peaks: bool = False


@dataclass(frozen=True)
class LinePanel:
    """Lines over one axis.

    Parameters
    ----------
    lines : sequence of ChartLine
    x, y : str
        Names of the axes with units.
    limits : (float, float) or None
        Of the value axis; None: about what is shown.
    logarithmic : bool
        The value axis.
    cursors : sequence of Cursor
        Lines that the machine implies.
    """

    lines: Sequence[ChartLine]
    x: str
    y: str
    limits: tuple[float, float] | None = None
    logarithmic: bool = False
    cursors: Sequence[Cursor] = ()


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
        Names of the axes with units; what the levels refer to.
    logarithmic : bool
        The axis of positions.
    lines : sequence of ChartLine
    cursors : sequence of Cursor
        On the x axis.
    span : float or None
        Of the colours below the largest level; None: what the reader wants.
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


def pooled_levels(
    levels: FloatArray, positions: FloatArray, n_columns: int, n_rows: int, *, logarithmic: bool = False
) -> tuple[FloatArray, NDArray[np.intp]]:
    """Return the largest level of each pixel, and the first row of `levels` in each row of pixels.

    Parameters
    ----------
    levels : array, (n_y, n_x)
    positions : array, (n_y,)
        Ascending; rows of pixels lie at equal steps of it, or of its logarithm.
    n_columns, n_rows : int
        At most.
    logarithmic : bool
    """
    n_rows, n_columns = min(len(positions), n_rows), min(levels.shape[1], n_columns)
    steps = (np.geomspace if logarithmic else np.linspace)(positions[0], positions[-1], n_rows)
    rows = np.searchsorted(positions, steps).clip(0, len(positions) - 1)
    edges = np.linspace(0, levels.shape[1], n_columns + 1).astype(int)[:-1]
    if n_rows > 1:
        levels = np.maximum.reduceat(levels, rows, axis=0)
    return np.maximum.reduceat(levels, edges, axis=1), rows


def panels_figure(panels: Sequence[LinePanel | LevelPanel], *, title: str = "") -> Figure:
    """Draw panels below each other.

    Parameters
    ----------
    panels : sequence of LinePanel or LevelPanel
    title : str

    Raises
    ------
    InputError
        If there is no panel.
    """
    if not panels:
        raise InputError("no panel is given", allowed="at least 1")
    heights = tuple(3.2 if isinstance(panel, LevelPanel) else 2.2 for panel in panels)
    right_in = 1.0 if any(isinstance(panel, LevelPanel) for panel in panels) else 0.2
    figure, axes = style.panels(heights, right_in=right_in, top_in=0.45, row_gap_in=0.62)
    for place, panel in zip(axes, panels, strict=True):
        if isinstance(panel, LevelPanel):
            place.set_yscale("log" if panel.logarithmic else "linear")
            draw_level_map(place, panel.at, panel.positions, panel.levels, panel.unit)
        elif panel.logarithmic:
            place.set_yscale("log")
        for line in panel.lines:
            _draw(place, line, thinned=isinstance(panel, LinePanel))
        for cursor in panel.cursors:
            place.axvline(cursor.position, color=style.QUIET, lw=0.7, ls=":", zorder=1)
        if isinstance(panel, LinePanel):
            if panel.limits is not None:
                place.set_ylim(*panel.limits)
            ends = [end for line in panel.lines for end in (float(line.x[0]), float(line.x[-1]))]
            place.set_xlim(min(ends), max(ends))
            if len(panel.lines) > 1:
                place.legend(fontsize=style.SMALL_PT - 1, frameon=False, labelcolor=style.INK, loc="upper right")
        style.label_axes(place, panel.x, panel.y)
    series.headline(figure, title)
    return figure


def line_colour(number: int) -> str:
    """Return the colour of a `ChartLine` on paper."""
    cycle = (style.MEASURED, style.FAULT, style.MESH, style.BEARING, style.SHAFT)
    return style.QUIET if number < 0 else cycle[number % len(cycle)]


def _draw(axes: Axes, line: ChartLine, *, thinned: bool) -> None:
    colour = line_colour(line.colour)
    ascending = len(line.x) > series.N_POINTS and bool(np.all(np.diff(line.x) > 0.0))
    if line.peaks and ascending:
        x, _, y = series.envelope(line.x, line.y, series.N_POINTS // 2)
    else:
        x, y = series.thin(line.x, line.y) if thinned and ascending else (line.x, line.y)
    if line.band is not None:
        axes.fill_between(line.x, *line.band, color=colour, alpha=0.2, linewidth=0)
    axes.plot(x, y, color=colour, lw=1.0, ls=":" if line.dotted else "-", label=line.name)
