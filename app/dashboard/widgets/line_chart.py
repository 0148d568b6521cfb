"""Lines over one axis that the user can zoom and read off, with named cursors across them (plotly)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np
import streamlit as st

from app.dashboard.as_typed import as_plot_text, as_typed
from app.dashboard.look import DASHES, Palette, palette
from gearsig.checks import FloatArray
from gearsig.plot.cursors import LONGEST, Cursor, place
from gearsig.plot.display import plain

if TYPE_CHECKING:
    from plotly.graph_objects import Figure

WIDTH_IN = 10.5
"""Width for which labels are placed; they keep apart on wider pages as well."""
HEIGHT_PX = 400
ROW_PX = 17
CONFIG = {"displaylogo": False, "modeBarButtonsToRemove": ["select2d", "lasso2d"], "scrollZoom": False}


@dataclass(frozen=True)
class Line:
    """A line to draw, already thinned, a pale band (low, high) behind it, and its colour by meaning."""

    x: FloatArray
    y: FloatArray
    name: str
    band: tuple[FloatArray, FloatArray] | None = None
    colour: Literal["measured", "fault"] = "measured"


@dataclass(frozen=True)
class Axes:
    """Names, limits and scale; texts may come from files."""

    x: str
    y: str
    x_limits: tuple[float, float]
    y_limits: tuple[float, float] | None = None
    logarithmic: bool = False
    x_step: float | None = None


def show_lines(
    lines: Sequence[Line],
    axes: Axes,
    key: str,
    *,
    cursors: Sequence[Cursor] = (),
    marked: Sequence[tuple[float, float]] = (),
    height_px: int = HEIGHT_PX,
) -> None:
    """Show lines with cursors and marked points.

    Parameters
    ----------
    lines : sequence of Line
    axes : Axes
    key : str
        Of the widget, unique on the page.
    cursors : sequence of Cursor
        In the unit of the x axis.
    marked : sequence of (x, y)
        Points that findings name.
    height_px : int
    """
    figure = line_figure(lines, axes, cursors=cursors, marked=marked, height_px=height_px)
    words = as_typed(f"{axes.y} over {axes.x}")
    st.plotly_chart(figure, width="stretch", key=key, config=CONFIG, alt=words)


def line_figure(
    lines: Sequence[Line],
    axes: Axes,
    *,
    cursors: Sequence[Cursor] = (),
    marked: Sequence[tuple[float, float]] = (),
    height_px: int = HEIGHT_PX,
) -> Figure:
    """Return the figure that `show_lines` shows."""
    from plotly.graph_objects import Figure

    colours = palette()
    figure = Figure()
    for line in lines:
        _add_line(figure, line, colours)
    n_rows = _add_cursors(figure, cursors, axes.x_limits, colours)
    if marked:
        ring = {"symbol": "circle-open", "size": 13, "color": colours.fault, "line": {"width": 2}}
        x, y = zip(*marked, strict=True)
        figure.add_scatter(x=x, y=y, yaxis="y2", mode="markers", marker=ring, name="finding", hoverinfo="skip")
    _lay_out(figure, axes, n_rows, height_px)
    return figure


def _add_line(figure: Figure, line: Line, colours: Palette) -> None:
    name, colour = as_plot_text(line.name), colours.fault if line.colour == "fault" else colours.measured
    for edge, fill in zip(line.band or (), (None, "tonexty"), strict=False):
        figure.add_scatter(
            x=line.x,
            y=edge,
            yaxis="y2",
            mode="lines",
            line={"width": 0},
            fill=fill,
            fillcolor=_pale(colour),
            hoverinfo="skip",
        )
    figure.add_scatter(
        x=line.x,
        y=line.y,
        yaxis="y2",
        mode="lines",
        name=name,
        line={"width": 1.1, "color": colour},
        hovertemplate="%{x:.6g}: %{y:.4g}<extra></extra>",
    )


def _add_cursors(figure: Figure, cursors: Sequence[Cursor], limits: tuple[float, float], colours: Palette) -> int:
    """Draw each kind of cursor as one line of many pieces, on a hidden axis from 0 to 1; return the rows of labels."""
    placed = place(cursors, limits, WIDTH_IN)
    for kind in dict.fromkeys(cursor.kind for cursor, _ in placed):
        own = [cursor for cursor, _ in placed if cursor.kind == kind]
        x = [v for cursor in own for v in (cursor.position, cursor.position, None)]
        words = [v for cursor in own for v in [as_plot_text(f"{cursor.label}: {cursor.position:.6g}")] * 3]
        figure.add_scatter(
            x=x,
            y=[0, 1, None] * len(own),
            mode="lines",
            name=kind,
            text=words,
            hovertemplate="%{text}<extra></extra>",
            line={"color": colours.cursors.get(kind, colours.quiet), "width": 1, "dash": DASHES.get(kind, "dot")},
            opacity=0.65,
        )
    rows = 0
    for cursor, label in placed:
        if label is not None:
            rows = max(rows, label.row + 1)
            figure.add_annotation(
                x=cursor.position,
                y=1,
                yref="paper",
                yanchor="bottom",
                yshift=2 + ROW_PX * label.row,
                text=as_plot_text(plain(cursor.label, LONGEST)),
                showarrow=False,
                font={"size": 12, "color": colours.cursors.get(cursor.kind, colours.quiet)},
            )
    return rows


def _lay_out(figure: Figure, axes: Axes, n_rows: int, height_px: int) -> None:
    top = 12 + ROW_PX * n_rows
    # plotly takes the limits of a logarithmic axis as powers of ten
    limits = axes.y_limits
    if limits is not None and axes.logarithmic:
        limits = (float(np.log10(limits[0])), float(np.log10(limits[1])))
    figure.update_layout(
        height=height_px + ROW_PX * n_rows,
        margin={"l": 8, "r": 8, "t": top, "b": 8},
        hovermode="closest",
        showlegend=False,
        dragmode="zoom",
        xaxis={"title": as_plot_text(axes.x), "range": axes.x_limits, "exponentformat": "none", "dtick": axes.x_step},
        yaxis2={
            "overlaying": "y",
            "side": "left",
            "title": as_plot_text(axes.y),
            "type": "log" if axes.logarithmic else "linear",
            "range": limits,
            "exponentformat": "e",
            "minexponent": 4,
            **_ticks(axes),
        },
        yaxis={"range": [0, 1], "visible": False, "fixedrange": True},  # of the cursors, behind the lines
    )


def _ticks(axes: Axes) -> dict[str, object]:
    """Return the ticks of the value axis: whole decades where there are several, else plotly's choice of its own.

    Left alone, an overlaying axis would take its ticks from the one below, wherever they fall.
    """
    low, high = axes.y_limits or (1.0, 1.0)
    several = axes.logarithmic and high > 100 * low
    return {"tickmode": "linear", "tick0": 0, "dtick": 1} if several else {"tickmode": "auto"}


def _pale(colour: str) -> str:
    red, green, blue = (int(colour[i : i + 2], 16) for i in (1, 3, 5))
    return f"rgba({red},{green},{blue},0.22)"
