"""Lines over one axis that can be zoomed and read off, with named cursors across them (plotly); pictures; ranges."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from io import BytesIO
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import streamlit as st

from app.dashboard import state
from app.dashboard.theme import DARK_PAPER, DASHES, Palette, as_plot_text, as_typed, is_dark, palette
from gearsig.checks import FloatArray
from gearsig.diagnosis import Analysis
from gearsig.plot import LONGEST, Cursor, place, plain

if TYPE_CHECKING:
    from matplotlib.figure import Figure as PictureFigure
    from plotly.graph_objects import Figure

WIDTH_IN = 10.5
"""Width for which labels are placed; they keep apart on wider pages as well."""
ROW_PX, LEGEND_PX = 17, 40
CONFIG = {"displaylogo": False, "modeBarButtonsToRemove": ["select2d", "lasso2d"], "scrollZoom": False}
MEASURED, FAULT, QUIET = 0, 1, -1
"""Colours of lines by meaning; further numbers are further colours."""


@dataclass(frozen=True)
class ChartLine:
    """A line to draw, already thinned; nan where it has a gap.

    Parameters
    ----------
    x, y : array, (n,)
    name : str
    colour : int
        See `MEASURED`.
    band : (low, high) or None
        A pale band behind it.
    dotted : bool
    """

    x: FloatArray
    y: FloatArray
    name: str
    colour: int = MEASURED
    band: tuple[FloatArray, FloatArray] | None = None
    dotted: bool = False


@dataclass(frozen=True)
class Axes:
    """Names, limits and scale; texts may come from files."""

    x: str
    y: str
    x_limits: tuple[float, float]
    y_limits: tuple[float, float] | None = None
    logarithmic: bool = False
    x_step: float | None = None


def padded_limits(curves: Sequence[FloatArray], *, flat: float = 1.0) -> tuple[float, float]:
    """Return limits about all known values of several curves, `flat` to both sides where they do not change."""
    known = [curve for curve in curves if np.isfinite(curve).any()]
    low = min((float(np.nanmin(curve)) for curve in known), default=0.0)
    high = max((float(np.nanmax(curve)) for curve in known), default=1.0)
    margin = 0.06 * (high - low) or flat
    return low - margin, high + margin


def show_chart(figure: Figure, key: str, alternative: str) -> None:
    """Show a figure of plotly; `key` is the widget's, unique on the page."""
    st.plotly_chart(figure, width="stretch", key=key, config=CONFIG, alt=as_typed(alternative))


def show_lines(
    lines: Sequence[ChartLine],
    axes: Axes,
    key: str,
    *,
    cursors: Sequence[Cursor] = (),
    marked: Sequence[tuple[float, float]] = (),
    height_px: int = 400,
    legend: bool = False,
) -> None:
    """Show lines with cursors and marked points.

    Parameters
    ----------
    lines : sequence of ChartLine
    axes : Axes
    key : str
        Of the widget, unique on the page.
    cursors : sequence of Cursor
        In the unit of the x axis.
    marked : sequence of (x, y)
        Points that findings name.
    height_px : int
        Without labels and legend.
    legend : bool
        Name several lines above the chart; all such charts have the same left margin, so that those below each other
        share their axis.
    """
    from plotly.graph_objects import Figure

    colours, figure = palette(), Figure()
    cycle = (colours.measured, colours.fault, *(colours.cursors[kind] for kind in ("mesh", "bearing", "shaft")))
    for line in lines:
        colour = colours.quiet if line.colour == QUIET else cycle[line.colour % len(cycle)]
        _add_line(figure, line, colour, tag="" if legend else "<extra></extra>")
    n_rows = _add_cursors(figure, cursors, axes.x_limits, colours)
    if marked:
        ring = {"symbol": "circle-open", "size": 13, "color": colours.fault, "line": {"width": 2}}
        x, y = zip(*marked, strict=True)
        figure.add_scatter(x=x, y=y, yaxis="y2", mode="markers", marker=ring, name="finding", hoverinfo="skip")
    above_px = LEGEND_PX if legend else ROW_PX * n_rows
    figure.update_layout(
        height=height_px + above_px,
        margin={"l": 76 if legend else 8, "r": 8, "t": 8 if legend else 12 + above_px, "b": 8},
        hovermode="closest",
        showlegend=legend and len(lines) > 1,
        legend={"orientation": "h", "y": 1.0, "yanchor": "bottom", "x": 0.0, "xanchor": "left"},
        dragmode="zoom",
        xaxis={"title": as_plot_text(axes.x), "range": axes.x_limits, "exponentformat": "none", "dtick": axes.x_step},
        yaxis={"range": [0, 1], "visible": False, "fixedrange": True},  # of the cursors, behind the lines
        yaxis2={"automargin": not legend, **_value_axis(axes)},
    )
    show_chart(figure, key, f"{axes.y} over {axes.x}")


def _add_line(figure: Figure, line: ChartLine, colour: str, *, tag: str) -> None:
    pale = f"rgba({','.join(str(int(colour[i : i + 2], 16)) for i in (1, 3, 5))},0.22)"
    for edge, fill in zip(line.band or (), (None, "tonexty"), strict=False):
        figure.add_scatter(
            x=line.x,
            y=edge,
            yaxis="y2",
            mode="lines",
            line={"width": 0},
            fill=fill,
            fillcolor=pale,
            hoverinfo="skip",
        )
    figure.add_scatter(
        x=line.x,
        y=line.y,
        yaxis="y2",
        mode="lines",
        name=as_plot_text(line.name),
        line={"width": 1.1, "color": colour, "dash": "dot" if line.dotted else "solid"},
        hovertemplate="%{x:.6g}: %{y:.4g}" + tag,
    )


def _add_cursors(figure: Figure, cursors: Sequence[Cursor], limits: tuple[float, float], colours: Palette) -> int:
    """Draw each kind of cursor as one line of many pieces, on a hidden axis from 0 to 1; return the rows of labels."""
    placed = place(cursors, limits, WIDTH_IN)
    for kind in dict.fromkeys(cursor.kind for cursor, _ in placed):
        same = [cursor for cursor, _ in placed if cursor.kind == kind]
        x = [v for cursor in same for v in (cursor.position, cursor.position, None)]
        words = [v for cursor in same for v in [as_plot_text(f"{cursor.label}: {cursor.position:.6g}")] * 3]
        figure.add_scatter(
            x=x,
            y=[0, 1, None] * len(same),
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


def _value_axis(axes: Axes) -> dict[str, object]:
    """Return the value axis, with ticks at whole decades where there are several, else where plotly chooses.

    Left alone, an overlaying axis would take its ticks from the one below, wherever they fall.
    """
    limits, ticks = axes.y_limits, dict[str, object](tickmode="auto")
    if limits is not None and axes.logarithmic:
        if limits[1] > 100 * limits[0]:
            ticks = {"tickmode": "linear", "tick0": 0, "dtick": 1}
        # plotly takes the limits of a logarithmic axis as powers of ten
        limits = (float(np.log10(limits[0])), float(np.log10(limits[1])))
    return {
        "overlaying": "y",
        "side": "left",
        "title": as_plot_text(axes.y),
        "type": "log" if axes.logarithmic else "linear",
        "range": limits,
        "exponentformat": "e",
        "minexponent": 4,
        **ticks,
    }


DOTS_PER_INCH = 180
DARK_GROUND = np.frombuffer(bytes.fromhex(DARK_PAPER.removeprefix("#")), np.uint8) / 255
BRIGHTEST = 0.93
# Turns the hue by half a circle and keeps the lightness: the matrix of hue-rotate(180deg) in the W3C's Filter Effects
# Module, with which the reports turn their figures over, too.
HALF_TURN = np.array([[-0.574, 1.430, 0.144], [0.426, 0.430, 0.144], [0.426, 1.430, -0.856]])


def show_picture(figure: PictureFigure, words: str, width: int | Literal["stretch"] = "stretch") -> None:
    """Show a figure; `words` say what it shows, for those who do not see it."""
    st.image(picture_bytes(figure, dark=is_dark()), width=width, alt=as_typed(words))


def picture_bytes(figure: PictureFigure, *, dark: bool) -> bytes:
    """Return the figure as PNG; `dark` turns light and dark over and keeps the hues."""
    from PIL import Image

    pixels, buffer = BytesIO(), BytesIO()
    figure.savefig(pixels, format="png", dpi=DOTS_PER_INCH, pil_kwargs={"compress_level": 0})
    image = Image.open(pixels).convert("RGB")
    if dark:
        turned = np.clip((1 - np.asarray(image, dtype=np.float32) / 255) @ HALF_TURN.T, 0, 1)
        image = Image.fromarray((255 * (DARK_GROUND + (BRIGHTEST - DARK_GROUND) * turned)).astype(np.uint8))
    image.save(buffer, format="png", compress_level=1)
    return buffer.getvalue()


def choose_range(
    label: str,
    source: Analysis | str,
    end: float,
    *,
    start: float = 0.0,
    shown: tuple[float, float] | None = None,
    name: str = "",
) -> tuple[float, float]:
    """Return the chosen segment between `start` and `end`; never an empty one.

    Parameters
    ----------
    label : str
        Not from a file.
    source : Analysis or str
        What the view is of, see `state.view_key`.
    start, end : float
        Of the axis.
    shown : (float, float) or None
        Chosen at first; None: all of it.
    name : str
        Of the view, where the same label occurs in several.
    """
    step = (end - start) / 1000
    first = shown if shown is not None else (start, end)
    value = (max(start, first[0]), min(end, first[1]))
    key = state.view_key(f"{name} {label} {start!r} to {end!r}", source)
    low, high = st.slider(label, start, end, value=value, step=step, format="%.5g", key=key)
    return (low, high) if high > low else (max(start, high - step), min(end, high + step))


def choose_end(label: str, analysis: Analysis, end: float, shown: float) -> float:
    """Return the chosen end of what is shown from zero, `shown` at first."""
    step = end / 1000
    key = state.view_key(f"{label} to {end!r}", analysis)
    return st.slider(label, step, end, value=min(shown, end), step=step, format="%.5g", key=key)


def download(label: str, data: Any, name: str, mime: str, *, primary: bool = False) -> None:
    """Show a download button; the page is not run again for it.

    Parameters
    ----------
    label : str
    data : bytes, or callable that returns them
        A callable is called at the click.
    name : str
        Of the file.
    mime : str
    primary : bool
        Whether it is the page's main button.
    """
    st.download_button(
        label,
        data,
        file_name=name,
        mime=mime,
        on_click="ignore",
        type="primary" if primary else "secondary",
        icon=":material/download:",
    )
