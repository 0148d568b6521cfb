"""Panels of curves over any axis, in rows and columns."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

from gearsig.checks import FloatArray
from gearsig.errors import InputError
from gearsig.plot import _series as series
from gearsig.plot import _style as style

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D


@dataclass(frozen=True)
class CurvePanel:
    """One panel.

    Parameters
    ----------
    x : array, (n,)
    curves : mapping
        Name → array, (n,); one to eight.
    x_label, y_label, title : str
    marks : sequence of float
        Places on the x axis with a thin upright line.
    looks : str
        "line", "dots", or "both".
    log_y : bool
    """

    x: FloatArray
    curves: Mapping[str, FloatArray]
    x_label: str = ""
    y_label: str = ""
    title: str = ""
    marks: Sequence[float] = ()
    looks: Literal["line", "dots", "both"] = "line"
    log_y: bool = False


def curves_figure(
    panels: Sequence[CurvePanel], *, n_columns: int = 1, title: str = "", heading: str = "", height_in: float = 2.2
) -> Figure:
    """Draw panels of curves; the names stand above them, where all panels have the same ones in one row.

    Parameters
    ----------
    panels : sequence of CurvePanel
        Row by row.
    n_columns : int
    title : str
    heading : str
        Before the names, e.g. "roughness".
    height_in : float
        Of a row.

    Returns
    -------
    Figure

    Raises
    ------
    InputError
        If there is no panel, a curve's length is not that of its axis, or one panel has more than eight curves.
    """
    if not panels:
        raise InputError("no panel is given", allowed="at least 1")
    n_rows = -(-len(panels) // n_columns)
    shared = len({tuple(panel.curves) for panel in panels}) == 1
    named = shared and (len(panels[0].curves) > 1 or bool(heading))
    figure, axes = style.panels(
        (height_in,) * n_rows,
        (1.0,) * n_columns,
        top_in=0.42 + (0.25 if named else 0.0) + (0.2 if panels[0].title else 0.0),
        row_gap_in=0.78 if any(panel.title for panel in panels) else 0.6,
    )
    lines: list[Line2D] = []
    for place, panel in zip(axes, panels, strict=False):
        series.check_number(len(panel.curves), f"{len(panel.curves)} curves in one panel")
        lines = []
        for k, (name, values, colour) in enumerate(series.coloured(panel.curves)):
            if len(values) != len(panel.x):
                raise InputError(f"{name} has {len(values)} points, its axis {len(panel.x)}", allowed="equal lengths")
            line = {"line": "-", "dots": "", "both": "-"}[panel.looks]
            marker = {"line": "", "dots": ".", "both": "o"}[panel.looks]
            x, y = (panel.x, values) if panel.looks != "line" else _thinned(panel.x, values)
            drawn = place.plot(x, y, line, marker=marker, ms=3.0, color=colour, lw=1.3, label=name)
            drawn[0].set_zorder(3 - 0.01 * k)
            lines += drawn
        for mark in panel.marks:
            place.axvline(mark, color=style.QUIET, lw=0.7, ls=":", zorder=1)
        if panel.log_y:
            place.set_yscale("log")
        style.label_axes(place, panel.x_label, panel.y_label, panel.title)
        if not shared and len(panel.curves) > 1:
            place.legend(fontsize=style.SMALL_PT - 1, frameon=False, labelcolor=style.INK)
    for unused in axes[len(panels) :]:
        unused.set_visible(False)
    series.head(figure, title, lines if named else (), heading)
    return figure


def _thinned(x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Fewer points where x ascends; what runs to and fro is drawn whole."""
    return series.thin(x, y) if len(x) > series.N_POINTS and bool((x[1:] > x[:-1]).all()) else (x, y)
