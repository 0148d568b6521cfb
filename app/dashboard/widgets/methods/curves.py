"""Several curves in one chart with a legend: plain lines of the user's zoom, coloured by their place in the list."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import streamlit as st

from app.dashboard.as_typed import as_plot_text, as_typed
from app.dashboard.look import palette
from app.dashboard.widgets.line_chart import CONFIG, Axes
from gearsig.checks import FloatArray

LEGEND_PX = 40
LEFT_PX = 76
"""The same for all charts, so that those below each other share their axis."""


@dataclass(frozen=True)
class Curve:
    """A curve, already thinned; nan where it has a gap.

    Parameters
    ----------
    x, y : array, (n,)
    name : str
        In the legend.
    colour : int
        Which of the page's colours; -1 is grey.
    dotted : bool
    """

    x: FloatArray
    y: FloatArray
    name: str
    colour: int = 0
    dotted: bool = False


def show_curves(curves: Sequence[Curve], axes: Axes, key: str, *, height_px: int = 320) -> None:
    """Show curves; `key` is the widget's, unique on the page."""
    from plotly.graph_objects import Figure

    colours, figure = palette(), Figure()
    cycle = (colours.measured, colours.fault, *(colours.cursors[kind] for kind in ("mesh", "bearing", "shaft")))
    for curve in curves:
        colour = colours.quiet if curve.colour < 0 else cycle[curve.colour % len(cycle)]
        figure.add_scatter(
            x=curve.x,
            y=curve.y,
            name=as_plot_text(curve.name),
            mode="lines",
            line={"color": colour, "width": 1.3, "dash": "dot" if curve.dotted else "solid"},
            hovertemplate="%{x:.5g}, %{y:.4g}",
        )
    figure.update_layout(
        height=height_px + LEGEND_PX,
        margin={"l": LEFT_PX, "r": 8, "t": 8, "b": 8},
        hovermode="closest",
        showlegend=len(curves) > 1,
        legend={"orientation": "h", "y": 1.0, "yanchor": "bottom", "x": 0.0, "xanchor": "left"},
        xaxis={"title": as_plot_text(axes.x), "range": axes.x_limits, "exponentformat": "none"},
        yaxis={
            "title": as_plot_text(axes.y),
            "range": axes.y_limits,
            "exponentformat": "e",
            "minexponent": 4,
            "automargin": False,
        },
    )
    st.plotly_chart(figure, width="stretch", key=key, config=CONFIG, alt=as_typed(f"{axes.y} over {axes.x}"))
