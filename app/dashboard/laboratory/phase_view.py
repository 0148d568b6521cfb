"""Phase portraits beside each other: displacement against velocity of a gear, with the points of a Poincaré section."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import streamlit as st

from app.dashboard.laboratory.run import Run, lines_per_period, times_of
from app.dashboard.look import palette
from app.dashboard.widgets.line_chart import CONFIG
from gearsig.checks import FloatArray

if TYPE_CHECKING:
    from plotly.graph_objects import Figure

MESH_PERIOD = "mesh period"
GEARS = {"Driver": "driver y", "Driven gear": "driven y"}
STROBES = {MESH_PERIOD: None, "revolution of the input shaft": 1.0}
MOST_POINTS = 10_000
"""A browser without a graphics card draws so many at once."""
REVOLUTIONS = 1.3
"""Of the line, so that every tooth is on it; the points are of the whole run."""
HEIGHT_PX = 430
Limits = tuple[tuple[float, float], tuple[float, float]]
Portrait = tuple[FloatArray, FloatArray, FloatArray, FloatArray]


def show_phase(healthy: Run, faulty: Run | None) -> None:
    """Show the portraits of one gear along the line of action."""
    left, right = st.columns(2)
    gear = left.segmented_control(
        "Gear", list(GEARS), default="Driver", key="gear of the laboratory", persist_state="session"
    )
    strobe = right.segmented_control(
        "A point once per",
        list(STROBES),
        default=MESH_PERIOD,
        key="strobe of the laboratory",
        persist_state="session",
    )
    n = STROBES[strobe or MESH_PERIOD] or healthy.machine.mesh.pair.driver.teeth
    runs = [healthy] if faulty is None else [healthy, faulty]
    portraits = [portrait(run, GEARS[gear or "Driver"], n) for run in runs]
    limits = [_limits([p[axis] for p in portraits]) for axis in (0, 1)]
    for column, found, name in zip(st.columns(2), portraits, ("healthy", "faulty"), strict=False):
        figure = portrait_figure(found, (limits[0], limits[1]), faulty=name == "faulty")
        words = f"Velocity over displacement of the {name} machine with its Poincaré points"
        with column:
            st.plotly_chart(figure, width="stretch", key=f"phase of {name}", config=CONFIG, alt=words)
    st.caption(
        "Along the line of action. A closed curve repeats every mesh period, and its points fall together; "
        "scattered points mean a motion that does not repeat."
    )


def portrait(run: Run, signal: str, n_per_revolution: float) -> Portrait:
    """Return displacement (µm) and velocity (mm/s), and both at the strobes."""
    response = run.response
    y, v = 1e6 * response[signal], 1e3 * response[f"{signal} velocity"]
    index = times_of(run, response.time_s, lines_per_period(run, n_per_revolution))
    points = [np.interp(index, response.time_s, values) for values in (y, v)]
    turned = float(np.ptp(response["driver angle"])) / (2.0 * np.pi)
    n = len(y) if turned <= REVOLUTIONS else round(len(y) * REVOLUTIONS / turned)
    every = -(-n // MOST_POINTS)
    return y[-n::every], v[-n::every], points[0], points[1]


def portrait_figure(found: Portrait, limits: Limits, *, faulty: bool) -> Figure:
    """Draw one portrait."""
    from plotly.graph_objects import Figure

    colours, figure = palette(), Figure()
    y, v, y_points, v_points = found
    figure.add_scatter(
        x=y,
        y=v,
        mode="lines",
        line={"width": 0.8, "color": colours.fault if faulty else colours.measured},
        opacity=0.45,
        hoverinfo="skip",
    )
    figure.add_scatter(
        x=y_points,
        y=v_points,
        mode="markers",
        marker={"size": 5, "color": colours.cursors["shaft"], "line": {"width": 0.5, "color": "black"}},
        hovertemplate="%{x:.4g} µm, %{y:.4g} mm/s<extra></extra>",
    )
    figure.update_layout(
        height=HEIGHT_PX,
        margin={"l": 8, "r": 8, "t": 30, "b": 8},
        title={"text": "faulty" if faulty else "healthy", "x": 0.5, "font": {"size": 14}},
        showlegend=False,
        xaxis={"title": "displacement (µm)", "range": limits[0]},
        yaxis={"title": "velocity (mm/s)", "range": limits[1]},
    )
    return figure


def _limits(values: list[FloatArray]) -> tuple[float, float]:
    low, high = min(float(v.min()) for v in values), max(float(v.max()) for v in values)
    margin = 0.06 * (high - low) or 1.0
    return low - margin, high + margin
