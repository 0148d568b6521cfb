"""The phase plane of a channel, and its embedding by delays: section, kind of motion, exponents, recurrences."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import streamlit as st

from app.dashboard.methods.frame import MethodPage, SignalSegment, cached
from app.dashboard.theme import as_plot_text, as_typed, one_line, palette
from app.dashboard.widgets.charts import show_chart, show_picture
from gearsig import phase, plot
from gearsig.errors import InputError, RefusalError

MAX_DRAWN, MAX_DRAWN_IN_SPACE = 20_000, 6_000
"""Points of a path: more is a blot, and a browser without a graphics card turns it slowly in space."""
kind_of = cached(4, "Looking at section, exponent and 0–1 test …")(phase.kind_of_motion)
plane_of = cached(4, "Integrating …")(phase.phase_plane)
information_of = cached(6, "Looking for the delay …")(phase.average_mutual_information)
dimension_of = cached(6, "Looking for the dimension …")(phase.embedding_dimension)
exponent_of = cached(4, "Following neighbours …")(phase.largest_lyapunov_exponent)
recurrence_of = cached(4, "Comparing points …")(phase.recurrence_plot)
measures_of = cached(4, "Comparing points …")(phase.recurrence_measures)


def _choose_lock(page: MethodPage, place: Any, segment: SignalSegment) -> phase.CycleLock | None:
    """Return what gives a point per cycle; None where the speed is not known."""
    if segment.angle is None:
        place.info("There is no Poincaré section: it takes a shaft angle, and the speed is not known.")
        return None
    lowest, highest = segment.angle.speed_range_rpm
    # a section is one of one motion only while the speed varies by less than 5 %
    if highest - lowest > 0.05 * segment.angle.mean_speed_rpm:
        place.warning(
            f"The speed runs from {lowest:.4g} to {highest:.4g} rpm here: a Poincaré section shows one motion only at "
            "a steady speed. Its points smear, and what is said of them does not hold; choose a steady segment."
        )
    locks: dict[str, tuple[str, str]] = {}
    rig = page.analysis.rig
    if rig is not None:
        locks |= {f"mesh cycle of {one_line(pair.name)}": (pair.name, "") for pair in rig.pairs}
        locks |= {f"revolution of {one_line(name)}": ("", name) for name in rig.shaft_names}
    locks = locks or {"revolution of the shaft": ("", "")}
    pair, shaft = locks[page.ask(place.selectbox, "A point once per", list(locks), key=f"lock {list(locks)}")]
    return phase.find_lock(segment.recording, pair=pair, shaft=shaft, rig=rig, angle=segment.angle)


def _choose_phase(page: MethodPage, place: Any) -> float:
    about = "Another place shows the section from another side; it must not change what kind of motion it is."
    return float(page.ask(place.slider, "Place in the cycle (0 to 1)", 0.0, 1.0, 0.0, step=0.05, about=about))


def _section(
    path: phase.PhasePortrait, lock: phase.CycleLock | None, phase_cycles: float
) -> phase.PoincareSection | None:
    """Return the section; None, with the reason on the page, where there is none."""
    if lock is None:
        return None
    try:
        return phase.poincare_section(path, lock, phase_cycles=phase_cycles)
    except RefusalError as error:
        st.info(as_typed(error), icon=":material/help:")
        return None


def _show_kind(kind: phase.MotionKind, scope: str) -> None:
    """Say what kind of motion it is, of which signal, and why."""
    with st.container(border=True):
        after = f" after {kind.period} cycles" if kind.kind == "subharmonic" else ""
        st.markdown(f"Kind of motion: **{kind.kind}**{after}")
        st.markdown(as_typed(scope))
        st.markdown("\n".join(f"- {as_typed(sentence)}" for sentence in kind.evidence))
        st.caption(
            "Measured gear vibration is periodic with noise and modulation in most cases: “stochastic” and “undecided” "
            "are then the right answers."
        )


def show_phase_plane(page: MethodPage) -> None:
    """Show displacement and velocity of one channel."""
    left, right = st.columns(2)
    with left:
        segment = page.segment(n_first=100_000)
    settings = _choose_band(page, segment)
    with right.container():
        lock = _choose_lock(page, st, segment)
    phase_cycles, n_drawn = _choose_view(page, segment, lock)
    plane = plane_of(segment.recording, segment.channel, **settings)
    figure = plot.phase_portrait_figure(plane, _section(plane, lock, phase_cycles), n_points=n_drawn)
    show_picture(figure, f"Velocity over displacement, {plane.source}, with its Poincaré points")
    low, high = plane.band_hz
    st.caption(
        f"From {plane.start_s:.3g} to {plane.end_s:.3g} s of the segment, {low:.4g} to {high:.4g} Hz: near its "
        "ends an integral rests on what is not known. Motion that repeats with the lock falls onto one point; scatter "
        "is noise, modulation, or motion that does not repeat."
    )
    about = "Takes some seconds: does the section repeat, the largest Lyapunov exponent, the 0–1 test for chaos."
    question = "What kind of motion is it?"
    if lock is not None and page.asked(
        "kind asked", (plane, lock), question, icon=":material/psychology_alt:", about=about
    ):
        _show_kind(
            kind_of(plane, lock),
            f"Analysed: displacement and velocity, {plane.source}. Integration makes slow motion weigh more; "
            "“Embedding and chaos” asks the same of the signal as measured, and the answers may differ.",
        )


def _choose_band(page: MethodPage, segment: SignalSegment) -> dict[str, Any]:
    """Return band and quantity as `phase_plane` takes them; the user says what the recording does not.

    Raises
    ------
    InputError
        If the channel measures something else than motion.
    """
    known = segment.recording.channels[0].quantity
    quantities = ("acceleration", "velocity", "displacement")
    if known not in (*quantities, "transmission_error", "unknown"):
        raise InputError(
            f"channel {segment.channel!r} measures {known.replace('_', ' ')}: displacement and velocity do not follow "
            "from it",
            allowed="acceleration, velocity, displacement",
            remedy="choose another channel, or correct its quantity in the rig's [[sensor]] table",
        )
    left, right = st.columns(2)
    quantity = None
    if known == "unknown":
        quantity = page.choose(right, "The channel measures", quantities, key=f"quantity {segment.channel}")
    low = None
    if (quantity or known) in ("acceleration", "velocity"):
        suggested, why = suggested_low_cut_hz(page, segment)
        about = (
            "Integration magnifies whatever is slow. Too low, noise turns into drift; too high, slow motion is bent."
        )
        placeholder = f"{suggested:.3g}, {why}"
        low = page.ask(left.number_input, "Lowest frequency (Hz)", value=None, placeholder=placeholder, about=about)
        low = suggested if low is None else float(low)
    else:
        left.caption("A displacement is differentiated: nothing slow needs to be cut off.")
    half = segment.recording.sampling_rate_hz / 2.0
    about = f"Up to {half:.5g} Hz. A lower one shows the slower motion alone, without resonances."
    placeholder = f"{0.8 * half:.5g}"
    high = page.ask(right.number_input, "Highest frequency (Hz)", value=None, placeholder=placeholder, about=about)
    return {"low_cut_hz": low, "high_cut_hz": None if high is None else float(high), "quantity": quantity}


def suggested_low_cut_hz(page: MethodPage, segment: SignalSegment) -> tuple[float, str]:
    """Return a frequency below the slowest mesh, or else shaft, or what the segment allows if that is higher, and why.

    Far below the mesh, integrated noise outgrows the motion of the teeth and makes a cloud of the section.
    """
    possible = 1.05 * phase.lowest_low_cut_hz(segment.recording.duration_s)
    rig = page.analysis.rig
    meshes = [order for pair in rig.pairs if (order := rig.mesh_order(pair))] if rig is not None else []
    ratios = [ratio for name in rig.shaft_names if (ratio := rig.ratio(name))] if rig is not None else []
    lowest_hz = 0.0 if segment.angle is None else segment.angle.speed_range_rpm[0] / 60.0
    if segment.angle is None:
        low, why = 10.0, "as no shaft's frequency is known"
    elif meshes:
        low, why = min(meshes) * lowest_hz / 3.0, "a third of the slowest mesh frequency"
    else:
        low, why = 0.5 * min(ratios or [1.0]) * lowest_hz, "half of the slowest shaft's frequency"
    if low < possible:
        low, why = possible, "as low as the segment allows"
    return float(f"{low:.3g}"), why


def _choose_view(page: MethodPage, segment: SignalSegment, lock: phase.CycleLock | None) -> tuple[float, int]:
    """Return where in the cycle the path is looked at, and how many samples of the path are drawn."""
    if lock is None or segment.angle is None:
        return 0.0, 4000
    left, right = st.columns(2)
    phase_cycles = _choose_phase(page, left)
    about = "The points are of the whole segment."
    revolutions = page.ask(
        right.select_slider, "Path drawn (revolutions)", (1, 2, 5, 10, 20, 50, 100), value=2, about=about
    )
    per_revolution = 60.0 * segment.recording.sampling_rate_hz / max(segment.angle.mean_speed_rpm, 1e-9)
    return phase_cycles, int(min(max(2.0, revolutions * per_revolution), MAX_DRAWN))


def show_embedding(page: MethodPage) -> None:
    """Show the parameters of the embedding by delays, and the chosen view of the path."""
    segment = page.segment(n_first=40_000, n_max=200_000)
    with st.expander("Band, delay and dimension", icon=":material/tune:"):
        low, high, own_delay, own_dimension = _choose_embedding(page, segment)
    view = VIEWS[page.choose(st, "View", list(VIEWS), named=False)]
    signal = _signal_in_band(segment, low, high)
    values, rate_hz, source = signal.points[:, 0], signal.sampling_rate_hz, signal.source
    information = information_of(values, rate_hz, source=source)
    delay = own_delay or information.delay_samples
    dimension = dimension_of(values, rate_hz, delay_samples=delay, source=source)
    if view is None:
        _show_curves(information, dimension, own_delay)
        return
    n_axes = own_dimension or dimension.dimension
    if n_axes == 0:
        n_axes = dimension.dimensions[-1]
        st.info(
            f"No dimension up to {n_axes} unfolds the path: the signal looks stochastic. {n_axes} dimensions are "
            "taken; a narrower band or a dimension of your own may say more.",
            icon=":material/help:",
        )
    path = phase.delay_embedding(
        values, rate_hz, delay_samples=delay, dimension=n_axes, unit=segment.unit, source=source
    )
    view(page, segment, replace(path, start_s=signal.start_s))


def _whole_number(
    page: MethodPage, place: Any, label: str, placeholder: str, *, max_value: int | None = None, about: str = ""
) -> int | None:
    """Return a whole number from 1 on, None where the field is empty: the placeholder says what then happens."""
    number: int | None = page.ask(
        place.number_input,
        label,
        min_value=1,
        max_value=max_value,
        value=None,
        step=1,
        placeholder=placeholder,
        key=f"{label} {placeholder}",
        about=about,
    )
    return number


def _choose_embedding(
    page: MethodPage, segment: SignalSegment
) -> tuple[float | None, float | None, int | None, int | None]:
    """Return lowest and highest frequency in Hz, delay in samples, dimension; None: the curves decide."""
    one, two, three, four = st.columns(4)
    half = segment.recording.sampling_rate_hz / 2.0
    about = f"Up to {half:.5g} Hz. Noise above the motion of interest hides its neighbours."
    empty: dict[str, Any] = {"min_value": 0.0, "value": None, "placeholder": "all"}
    low = page.ask(one.number_input, "Lowest frequency (Hz)", **empty)
    high = page.ask(two.number_input, "Highest frequency (Hz)", about=about, **empty)
    about = "None: the first minimum of the mutual information."
    delay = _whole_number(page, three, "Delay (samples)", "from the curve", about=about)
    about = "None: the smallest without false neighbours."
    dimension = _whole_number(page, four, "Dimension", "from the curve", max_value=20, about=about)
    return low or None, high or None, delay, dimension


def _show_curves(
    information: phase.MutualInformation, dimension: phase.EmbeddingDimension, own_delay: int | None
) -> None:
    figure = plot.embedding_figure(information, dimension)
    show_picture(figure, "Mutual information over delay, false neighbours over dimension")
    yours = f" Neighbours are those at your delay of {dimension.delay_samples}." if own_delay else ""
    st.caption(
        f"Delay {information.delay_samples} samples by the curve ({information.rule}); a dimension unfolds the path "
        f"where fewer than {dimension.threshold:.0%} of the nearest neighbours are false.{yours} E2 near 1 at every "
        "dimension says random."
    )


def _signal_in_band(segment: SignalSegment, low_cut_hz: float | None, high_cut_hz: float | None) -> phase.PhasePortrait:
    """Return the channel as it is, or within a band; a path of one axis."""
    channel, unit, rate_hz = segment.channel, segment.unit, segment.recording.sampling_rate_hz
    if low_cut_hz is None and high_cut_hz is None:
        points = np.asarray(segment.values, dtype=np.float64)[:, None]
        if not np.isfinite(points).all():
            raise InputError(
                f"channel {channel!r} has values that are not numbers here", remedy="choose a segment without gaps"
            )
        return phase.PhasePortrait(points, rate_hz, (channel,), (unit,), "states", channel)
    plane = plane_of(
        segment.values, rate_hz, quantity="displacement", low_cut_hz=low_cut_hz, high_cut_hz=high_cut_hz, source=channel
    )
    return replace(
        plane, points=np.ascontiguousarray(plane.points[:, :1]), axis_names=(channel,), units=(unit,), kind="states"
    )


def _show_portrait(page: MethodPage, segment: SignalSegment, path: phase.PhasePortrait) -> None:
    """Show the path in the plane or in space, with the points of its section."""
    left, middle, right = st.columns((1, 2, 2))
    in_space = page.choose(left, "Drawn in", {"plane": False, "space": True})
    with middle.container():
        lock = _choose_lock(page, st, segment)
    section = _section(path, lock, _choose_phase(page, right))
    if in_space and path.n_axes >= 3:
        _show_space(page, path, section)
        return
    if in_space:
        st.info(f"The path has {path.n_axes} dimension(s): give at least 3 to see it in space.")
    if path.n_axes == 1:
        st.info("One dimension makes no portrait: give a larger one.")
        return
    figure = plot.phase_portrait_figure(path, section, n_points=MAX_DRAWN_IN_SPACE)
    show_picture(figure, f"Delay embedding of {path.source} with its Poincaré points")


def _show_space(page: MethodPage, path: phase.PhasePortrait, section: phase.PoincareSection | None) -> None:
    from plotly.graph_objects import Figure

    colours, figure = palette(), Figure()
    x, y, z = path.points[-MAX_DRAWN_IN_SPACE:, :3].T
    line = {"width": 1.5, "color": colours.measured}
    figure.add_scatter3d(x=x, y=y, z=z, mode="lines", line=line, opacity=0.5, hoverinfo="skip")
    if section is not None:
        x, y, z = section.points[:, :3].T
        marker = {"size": 2.5, "color": colours.fault}
        figure.add_scatter3d(x=x, y=y, z=z, mode="markers", marker=marker, hoverinfo="skip")
    unit = f" ({path.units[0]})" if path.units[0] else ""
    titles = {
        f"{axis}axis": {"title": {"text": as_plot_text(name + unit)}}
        for axis, name in zip("xyz", path.axis_names[:3], strict=True)
    }
    margin = {"l": 0, "r": 0, "t": 0, "b": 0}
    figure.update_layout(height=560, margin=margin, showlegend=False, scene={**titles, "aspectmode": "cube"})
    show_chart(figure, page.key("space"), "Path in space")
    shown_s = min(MAX_DRAWN_IN_SPACE, path.n_points) / path.sampling_rate_hz
    st.caption(f"The last {shown_s:.4g} s of the path as a line; the points are of the whole segment. Drag to turn it.")


def _show_divergence(page: MethodPage, segment: SignalSegment, path: phase.PhasePortrait) -> None:
    """Show how neighbours part, and the slope of it."""
    del segment
    one, two, three, four = st.columns(4)
    about = (
        "rosenstein: nearest neighbours; transverse: their distance across the path, for coarsely sampled signals; "
        "kantz: ten neighbours each, for noisy signals with many points"
    )
    methods = ("rosenstein", "transverse", "kantz")
    method = page.ask(one.selectbox, "Method", methods, format_func=str.capitalize, key="lyapunov", about=about)
    theiler = _whole_number(page, two, "Theiler window (samples)", "one mean period")
    steps = _whole_number(page, three, "Steps followed", "30 mean periods")
    about = (
        "Two numbers, for example 0.001, 0.004. None: from where the delayed values no longer overlap to where the "
        "distance nears that of unrelated points."
    )
    fit = page.ask(four.text_input, "Fit from, to (s)", placeholder="by the rule", about=about)
    exponent = exponent_of(path, method=method, theiler_samples=theiler, n_steps=steps, fit_s=two_numbers(fit))
    text = f"Mean logarithm of the distance of neighbours over time, {path.source}"
    show_picture(plot.divergence_figure(exponent), text)
    st.caption(
        f"{exponent.n_references} pairs of neighbours, at least {exponent.theiler_samples} samples apart in time. The "
        "dashed line is the distance of unrelated points; shaded is what was fitted."
    )


def two_numbers(text: str | None) -> tuple[float, float] | None:
    """Return the numbers of "0.001, 0.004", None where the field is empty."""
    if not text or not text.strip():
        return None
    try:
        first, second = (float(part) for part in text.replace(";", ",").split(","))
    except ValueError:
        raise InputError(f"fit is {text!r}", allowed="two numbers in s, for example 0.001, 0.004") from None
    return first, second


def _show_recurrence(page: MethodPage, segment: SignalSegment, path: phase.PhasePortrait) -> None:
    """Show which points come back close to which, and what that measures."""
    del segment
    one, two, three, four = st.columns(4)
    about = "Share of pairs that count as close; the radius follows from it."
    rate = page.ask(one.slider, "Recurrence rate (%)", 1, 30, 5, about=about) / 100.0
    n_points = page.ask(two.select_slider, "Points drawn", (200, 500, 1000, 2000, 3000), value=1000)
    stride = _whole_number(page, three, "Every so-many-th sample", "16 per mean period")
    shortest = page.ask(four.number_input, "Shortest line (points)", min_value=2, value=2, step=1)
    pairs = recurrence_of(path, recurrence_rate=rate, n_points=n_points, stride=stride)
    measures = measures_of(path, recurrence_rate=rate, shortest_line=shortest, stride=stride)
    show_picture(plot.recurrence_figure(pairs, measures), f"Recurrence plot of {path.source}", width=900)
    st.caption(
        f"The measures are of {measures.n_points} points, {measures.duration_s:.4g} s, pairs nearer in time than "
        f"{measures.theiler_points} points left out. Lines along the diagonal are motion that repeats."
    )


def _show_chaos_test(page: MethodPage, segment: SignalSegment, path: phase.PhasePortrait) -> None:
    """Show K of the 0–1 test, and the walk it rests on."""
    one, two, three, four = st.columns(4)
    of_section = page.choose(one, "Of the", {"Poincaré points": True, "signal": False}, key="test of")
    about = "Keeps noise on regular motion from being read as chaos; 0 is the plain test."
    damping = float(page.ask(two.number_input, "Damping", min_value=0.0, value=1.0, step=0.5, about=about))
    if of_section:
        with three.container():
            lock = _choose_lock(page, st, segment)
        if lock is None:
            return
        section = phase.poincare_section(path, lock)
        values = np.ascontiguousarray(section.points[:, 0])
        test = phase.zero_one_test_of_section(section, damping=damping)
    else:
        every = _whole_number(page, three, "Every so-many-th sample", "from the mutual information")
        values = np.ascontiguousarray(path.points[:, 0])
        test = phase.zero_one_test(values, damping=damping, every=every, source=path.source)
    c = float(page.ask(four.slider, "Walk at c (rad)", 0.63, 2.51, 1.2, step=0.01))
    walk = phase.translation_walk(values, c, every=test.every)
    show_picture(plot.chaos_test_figure(test, walk, c), f"K of the 0–1 test over c, and its walk, {path.source}")
    st.caption(
        "K near 0: regular, a bounded walk. K near 1: chaos or noise, a walk like Brownian motion; only the false "
        "neighbours tell these two apart." + (f" Every {test.every}-th value is used." if test.every > 1 else "")
    )
    if test.reason:
        st.warning(f"Undecided: {as_typed(test.reason)}.")


def _show_motion(page: MethodPage, segment: SignalSegment, path: phase.PhasePortrait) -> None:
    """Ask what the section is locked to, and say what kind of motion it is."""
    lock = _choose_lock(page, st, segment)
    if lock is not None:
        _show_kind(
            kind_of(path, lock),
            f"Analysed: the signal as measured, {path.source}, embedded by delays. The phase plane asks the same of "
            "displacement, where slow motion weighs more; the answers may differ.",
        )


View = Callable[[MethodPage, SignalSegment, phase.PhasePortrait], None]
VIEWS: dict[str, View | None] = {
    "Delay and dimension": None,
    "Portrait and section": _show_portrait,
    "Lyapunov exponent": _show_divergence,
    "Recurrence": _show_recurrence,
    "0–1 test": _show_chaos_test,
    "Kind of motion": _show_motion,
}
