"""Views of an embedded path: portrait, divergence of neighbours, recurrences, 0–1 test; parameters at hand."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import streamlit as st

from app.dashboard.as_typed import as_plot_text, as_typed
from app.dashboard.look import palette
from app.dashboard.widgets.line_chart import CONFIG
from app.dashboard.widgets.methods.choice import choose_one
from app.dashboard.widgets.methods.phase_numbers import path_key, two_numbers, whole_number
from app.dashboard.widgets.methods.phase_settings import choose_lock
from app.dashboard.widgets.methods.stretch import Stretch
from app.dashboard.widgets.picture import show_picture
from gearsig.diagnosis.types import Analysis
from gearsig.errors import RefusalError

if TYPE_CHECKING:
    from gearsig.phase.types import PhasePortrait, PoincareSection

MOST_DRAWN = 6_000
"""Points of a path in space: more is a blot, and a browser without a graphics card turns it slowly."""
METHODS = ("rosenstein", "transverse", "kantz")
SECTION, SIGNAL = "Poincaré points", "signal"
HEIGHT_PX = 560


def show_portrait(analysis: Analysis, stretch: Stretch, path: PhasePortrait) -> None:
    """Show the path in the plane or in space, with the points of its section."""
    left, middle, right = st.columns((1, 2, 2))
    with left:
        seen = choose_one("Drawn in", ("plane", "space"), path_key("portrait", analysis))
    with middle:
        lock = choose_lock(analysis, stretch)
    phase = right.slider(
        "Place in the cycle (0 to 1)",
        0.0,
        1.0,
        0.0,
        step=0.05,
        key=path_key("phase", analysis),
        persist_state="session",
    )
    section = None
    if lock is not None:
        from gearsig.phase.section import locked_section

        try:
            section = locked_section(path, lock, phase_cycles=float(phase))
        except RefusalError as error:
            st.info(as_typed(error), icon=":material/help:")
    if seen == "space" and path.n_axes >= 3:
        _show_space(path, section, analysis)
        return
    if seen == "space":
        st.info(f"The path has {path.n_axes} dimension(s): give at least 3 to see it in space.")
    if path.n_axes == 1:
        st.info("One dimension makes no portrait: give a larger one.")
        return
    from gearsig.plot.phase import phase_portrait_figure

    figure = phase_portrait_figure(path, section, n_points=MOST_DRAWN)
    show_picture(figure, f"Delay embedding of {path.source} with its Poincaré points")


def show_divergence(analysis: Analysis, stretch: Stretch, path: PhasePortrait) -> None:
    """Show how neighbours part, and the slope of it."""
    from gearsig.phase.lyapunov import largest_lyapunov_exponent
    from gearsig.plot.phase import divergence_figure

    del stretch
    columns = st.columns(4)
    method = columns[0].selectbox(
        "Method",
        METHODS,
        format_func=str.capitalize,
        key=path_key("lyapunov", analysis),
        help=ABOUT_METHODS,
        persist_state="session",
    )
    theiler = whole_number(columns[1], "Theiler window (samples)", "theiler", analysis, "one mean period")
    steps = whole_number(columns[2], "Steps followed", "steps", analysis, "30 mean periods")
    asked = columns[3].text_input(
        "Fit from, to (s)",
        placeholder="by the rule",
        key=path_key("fit", analysis),
        help="Two numbers, for example 0.001, 0.004. None: from where the delayed values no longer overlap to where "
        "the distance nears that of unrelated points.",
        persist_state="session",
    )
    with st.spinner("Following neighbours …", show_time=True):
        found = largest_lyapunov_exponent(
            path,
            method=method,  # type: ignore[arg-type]  # one of METHODS
            theiler_samples=theiler,
            n_steps=steps,
            fit_s=two_numbers(asked),
        )
    show_picture(divergence_figure(found), f"Mean logarithm of the distance of neighbours over time, {path.source}")
    st.caption(
        f"{found.n_references} pairs of neighbours, at least {found.theiler_samples} samples apart in time. The "
        "dashed line is the distance of unrelated points; shaded is what was fitted."
    )


def show_recurrence(analysis: Analysis, stretch: Stretch, path: PhasePortrait) -> None:
    """Show which points come back close to which, and what that measures."""
    from gearsig.phase.recurrence import recurrence_measures, recurrence_plot
    from gearsig.plot.phase import recurrence_figure

    del stretch
    columns = st.columns(4)
    rate = columns[0].slider(
        "Recurrence rate (%)",
        1,
        30,
        5,
        key=path_key("recurrence rate", analysis),
        help="Share of pairs that count as close; the radius follows from it.",
        persist_state="session",
    )
    n_points = columns[1].select_slider(
        "Points drawn",
        (200, 500, 1000, 2000, 3000),
        value=1000,
        key=path_key("points", analysis),
        persist_state="session",
    )
    stride = whole_number(columns[2], "Every so-many-th sample", "stride", analysis, "16 per mean period")
    shortest = columns[3].number_input(
        "Shortest line (points)", min_value=2, value=2, step=1, key=path_key("line", analysis), persist_state="session"
    )
    share = float(rate) / 100.0
    with st.spinner("Comparing points …", show_time=True):
        plot = recurrence_plot(path, recurrence_rate=share, n_points=int(n_points), stride=stride)
        measures = recurrence_measures(path, recurrence_rate=share, shortest_line=int(shortest), stride=stride)
    show_picture(recurrence_figure(plot, measures), f"Recurrence plot of {path.source}", width=900)
    st.caption(
        f"The measures are of {measures.n_points} points, {measures.duration_s:.4g} s, pairs nearer in time than "
        f"{measures.theiler_points} points left out. Lines along the diagonal are motion that repeats."
    )


def show_chaos_test(analysis: Analysis, stretch: Stretch, path: PhasePortrait) -> None:
    """Show K of the 0–1 test, and the walk it rests on."""
    from gearsig.phase.chaos_test import translation_walk, zero_one_test, zero_one_test_of_section
    from gearsig.phase.section import locked_section
    from gearsig.plot.phase import chaos_test_figure

    columns = st.columns(4)
    with columns[0]:
        of = choose_one("Of the", (SECTION, SIGNAL), path_key("test of", analysis))
    damping = columns[1].number_input(
        "Damping",
        min_value=0.0,
        value=1.0,
        step=0.5,
        key=path_key("damping", analysis),
        help="Keeps noise on regular motion from being read as chaos; 0 is the plain test.",
        persist_state="session",
    )
    every: int | None = None
    if of == SECTION:
        with columns[2]:
            lock = choose_lock(analysis, stretch)
        if lock is None:
            return
        section = locked_section(path, lock)
        values = np.ascontiguousarray(section.points[:, 0])
    else:
        section, values = None, np.ascontiguousarray(path.points[:, 0])
        every = whole_number(columns[2], "Every so-many-th sample", "every", analysis, "from the mutual information")
    c = columns[3].slider(
        "Walk at c (rad)", 0.63, 2.51, 1.2, step=0.01, key=path_key("c", analysis), persist_state="session"
    )
    if section is not None:
        test = zero_one_test_of_section(section, damping=float(damping))
    else:
        test = zero_one_test(values, damping=float(damping), every=every, source=path.source)
    walk = translation_walk(values, float(c), every=test.every)
    show_picture(chaos_test_figure(test, walk, float(c)), f"K of the 0–1 test over c, and its walk, {path.source}")
    st.caption(
        "K near 0: regular, a bounded walk. K near 1: chaos or noise, a walk like Brownian motion; only the false "
        "neighbours tell these two apart." + (f" Every {test.every}-th value is used." if test.every > 1 else "")
    )
    if test.reason:
        st.warning(f"Undecided: {as_typed(test.reason)}.")


ABOUT_METHODS = (
    "rosenstein: nearest neighbours; transverse: their distance across the path, for coarsely sampled signals; kantz: "
    "ten neighbours each, for noisy signals with many points"
)


def _show_space(path: PhasePortrait, section: PoincareSection | None, analysis: Analysis) -> None:
    from plotly.graph_objects import Figure

    colours, figure = palette(), Figure()
    x, y, z = path.points[-MOST_DRAWN:, :3].T
    figure.add_scatter3d(
        x=x, y=y, z=z, mode="lines", line={"width": 1.5, "color": colours.measured}, opacity=0.5, hoverinfo="skip"
    )
    if section is not None:
        x, y, z = section.points[:, :3].T
        figure.add_scatter3d(
            x=x, y=y, z=z, mode="markers", marker={"size": 2.5, "color": colours.fault}, hoverinfo="skip"
        )
    unit = f" ({path.units[0]})" if path.units[0] else ""
    titles = {
        f"{axis}axis": {"title": {"text": as_plot_text(name + unit)}}
        for axis, name in zip("xyz", path.axis_names[:3], strict=True)
    }
    figure.update_layout(
        height=HEIGHT_PX,
        margin={"l": 0, "r": 0, "t": 0, "b": 0},
        showlegend=False,
        scene={**titles, "aspectmode": "cube"},
    )
    st.plotly_chart(figure, width="stretch", key=path_key("space", analysis), config=CONFIG, alt="Path in space")
    shown = min(MOST_DRAWN, path.n_points) / path.sampling_rate_hz
    st.caption(f"The last {shown:.4g} s of the path as a line; the points are of the whole stretch. Drag to turn it.")
