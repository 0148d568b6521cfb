"""The phase plane of a channel, and its embedding by delays: section, kind of motion, exponents, recurrences."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, cast

import numpy as np
import streamlit as st

from app.dashboard.methods.frame import MethodPage, SignalSegment, cached, content_key
from app.dashboard.theme import as_plot_text, as_typed, one_line, palette
from app.dashboard.widgets.charts import CONFIG, show_picture
from gearsig.errors import InputError, RefusalError
from gearsig.phase import (
    CycleLock,
    EmbeddingDimension,
    MotionKind,
    MotionQuantity,
    MutualInformation,
    PhasePortrait,
    PoincareSection,
    average_mutual_information,
    delay_embedding,
    embedding_dimension,
    find_lock,
    kind_of_motion,
    largest_lyapunov_exponent,
    lowest_low_cut_hz,
    phase_plane,
    poincare_section,
    recurrence_measures,
    recurrence_plot,
    translation_walk,
    zero_one_test,
    zero_one_test_of_section,
)
from gearsig.plot import (
    chaos_test_figure,
    divergence_figure,
    embedding_figure,
    phase_portrait_figure,
    recurrence_figure,
)

# --------------------
# Poincaré section and kind of motion, of the phase plane and of the embedding.
# --------------------


def _choose_lock(page: MethodPage, place: Any, segment: SignalSegment) -> CycleLock | None:
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
    return find_lock(segment.recording, pair=pair, shaft=shaft, rig=rig, angle=segment.angle)


def _choose_phase(page: MethodPage, place: Any) -> float:
    about = "Another place shows the section from another side; it must not change what kind of motion it is."
    return float(page.ask(place.slider, "Place in the cycle (0 to 1)", 0.0, 1.0, 0.0, step=0.05, about=about))


def _section(path: PhasePortrait, lock: CycleLock | None, phase_cycles: float) -> PoincareSection | None:
    """Return the section; None, with the reason on the page, where there is none."""
    if lock is None:
        return None
    try:
        return poincare_section(path, lock, phase_cycles=phase_cycles)
    except RefusalError as error:
        st.info(as_typed(error), icon=":material/help:")
        return None


@cached(4, "Looking at section, exponent and 0–1 test …")
def kind_of(path: PhasePortrait, lock: CycleLock) -> MotionKind:
    """Return the kind of motion."""
    return kind_of_motion(path, lock)


def _show_kind(kind: MotionKind, scope: str) -> None:
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


# --------------------
# The phase plane.
# --------------------

QUANTITIES = ("acceleration", "velocity", "displacement")
MAX_DRAWN = 20_000


@dataclass(frozen=True)
class PlaneSettings:
    """Settings of `phase_plane`."""

    low_cut_hz: float | None
    high_cut_hz: float | None
    quantity: MotionQuantity | None


def show_phase_plane(page: MethodPage) -> None:
    """Show displacement and velocity of one channel."""
    left, right = st.columns(2)
    with left:
        segment = page.segment(n_first=100_000)
    settings = _choose_band(page, segment)
    with right.container():
        lock = _choose_lock(page, st, segment)
    phase, n_drawn = _choose_view(page, segment, lock)
    plane = plane_of(segment, settings)
    figure = phase_portrait_figure(plane, _section(plane, lock, phase), n_points=n_drawn)
    show_picture(figure, f"Velocity over displacement, {plane.source}, with its Poincaré points")
    low, high = plane.band_hz
    st.caption(
        f"From {plane.start_s:.3g} to {plane.end_s:.3g} s of the segment, {low:.4g} to {high:.4g} Hz: near its "
        "ends an integral rests on what is not known. Motion that repeats with the lock falls onto one point; scatter "
        "is noise, modulation, or motion that does not repeat."
    )
    if lock is not None:
        _offer_kind(page, plane, lock)


@cached(4, "Integrating …")
def plane_of(segment: SignalSegment, settings: PlaneSettings) -> PhasePortrait:
    """Return the phase plane."""
    return phase_plane(
        segment.recording,
        segment.channel,
        low_cut_hz=settings.low_cut_hz,
        high_cut_hz=settings.high_cut_hz,
        quantity=settings.quantity,
    )


def _choose_band(page: MethodPage, segment: SignalSegment) -> PlaneSettings:
    """Let the user choose the band, and say what the channel measures where the recording does not.

    Raises
    ------
    InputError
        If the channel measures something else than motion.
    """
    known = segment.recording.channels[0].quantity
    if known not in (*QUANTITIES, "transmission_error", "unknown"):
        raise InputError(
            f"channel {segment.channel!r} measures {known.replace('_', ' ')}: displacement and velocity do not follow "
            "from it",
            allowed="acceleration, velocity, displacement",
            remedy="choose another channel, or correct its quantity in the rig's [[sensor]] table",
        )
    left, right = st.columns(2)
    quantity: MotionQuantity | None = None
    if known == "unknown":
        chosen = page.choose(right, "The channel measures", QUANTITIES, key=f"quantity {segment.channel}")
        quantity = cast("MotionQuantity", chosen)
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
    return PlaneSettings(low, None if high is None else float(high), quantity)


def suggested_low_cut_hz(page: MethodPage, segment: SignalSegment) -> tuple[float, str]:
    """Return a frequency below the slowest mesh, or else shaft, or what the segment allows if that is higher, and why.

    Far below the mesh, integrated noise outgrows the motion of the teeth and makes a cloud of the section.
    """
    possible = 1.05 * lowest_low_cut_hz(segment.recording.duration_s)
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


def _choose_view(page: MethodPage, segment: SignalSegment, lock: CycleLock | None) -> tuple[float, int]:
    """Return where in the cycle the path is looked at, and how many samples of the path are drawn."""
    if lock is None or segment.angle is None:
        return 0.0, 4000
    left, right = st.columns(2)
    phase = _choose_phase(page, left)
    about = "The points are of the whole segment."
    revolutions = page.ask(
        right.select_slider, "Path drawn (revolutions)", (1, 2, 5, 10, 20, 50, 100), value=2, about=about
    )
    per_revolution = 60.0 * segment.recording.sampling_rate_hz / max(segment.angle.mean_speed_rpm, 1e-9)
    return phase, int(min(max(2.0, revolutions * per_revolution), MAX_DRAWN))


def _offer_kind(page: MethodPage, plane: PhasePortrait, lock: CycleLock) -> None:
    """Say what kind of motion it is once that is asked for: it takes some seconds."""
    asked, question = page.key("kind asked"), content_key((plane, lock))
    if st.session_state.get(asked) != question:
        st.button(
            "What kind of motion is it?",
            icon=":material/psychology_alt:",
            key=f"{asked} button",
            on_click=st.session_state.__setitem__,
            args=(asked, question),
            help="Looks whether the section repeats, for the largest Lyapunov exponent, and the 0–1 test for chaos: "
            "some seconds.",
        )
        return
    _show_kind(
        kind_of(plane, lock),
        f"Looked at: displacement and velocity, {plane.source}. Integration makes slow motion weigh more; “Embedding "
        "and chaos” asks the same of the signal as measured, and the answers may differ.",
    )


# --------------------
# One channel embedded by delays: delay and dimension with their curves, and what can be measured on the path.
# --------------------

MAX_DRAWN_IN_SPACE = 6_000
"""Points of a path in space: more is a blot, and a browser without a graphics card turns it slowly."""


@dataclass(frozen=True)
class EmbeddingSettings:
    """What is embedded, and how; None: the curves decide."""

    low_cut_hz: float | None
    high_cut_hz: float | None
    delay_samples: int | None
    dimension: int | None


def show_embedding(page: MethodPage) -> None:
    """Show the parameters, and the chosen view of the path."""
    segment = page.segment(n_first=40_000, n_max=200_000)
    with st.expander("Band, delay and dimension", icon=":material/tune:"):
        settings = _choose_embedding(page, segment)
    view = VIEWS[page.choose(st, "View", list(VIEWS), named=False)]
    signal = signal_in_band(segment, settings.low_cut_hz, settings.high_cut_hz)
    information = information_of(signal)
    delay = settings.delay_samples or information.delay_samples
    dimension = dimension_of(signal, delay)
    if view is None:
        _show_curves(information, dimension, settings)
        return
    n_axes = settings.dimension or dimension.dimension
    if n_axes == 0:
        n_axes = dimension.dimensions[-1]
        st.info(
            f"No dimension up to {n_axes} unfolds the path: the signal looks stochastic. {n_axes} dimensions are "
            "taken; a narrower band or a dimension of your own may say more.",
            icon=":material/help:",
        )
    path = delay_embedding(
        signal.points[:, 0],
        signal.sampling_rate_hz,
        delay_samples=delay,
        dimension=n_axes,
        unit=segment.unit,
        source=signal.source,
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


def _choose_embedding(page: MethodPage, segment: SignalSegment) -> EmbeddingSettings:
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
    return EmbeddingSettings(low or None, high or None, delay, dimension)


def _show_curves(information: MutualInformation, dimension: EmbeddingDimension, settings: EmbeddingSettings) -> None:
    figure = embedding_figure(information, dimension)
    show_picture(figure, "Mutual information over delay, false neighbours over dimension")
    yours = f" Neighbours are those at your delay of {dimension.delay_samples}." if settings.delay_samples else ""
    st.caption(
        f"Delay {information.delay_samples} samples by the curve ({information.rule}); a dimension unfolds the path "
        f"where fewer than {dimension.threshold:.0%} of the nearest neighbours are false.{yours} E2 near 1 at every "
        "dimension says random."
    )


@cached(6, "Filtering …")
def signal_in_band(segment: SignalSegment, low_cut_hz: float | None, high_cut_hz: float | None) -> PhasePortrait:
    """Return the channel as it is, or within a band; a path of one axis."""
    channel, unit, rate_hz = segment.channel, segment.unit, segment.recording.sampling_rate_hz
    if low_cut_hz is None and high_cut_hz is None:
        points = np.asarray(segment.values, dtype=np.float64)[:, None]
        if not np.isfinite(points).all():
            raise InputError(
                f"channel {channel!r} has values that are not numbers here", remedy="choose a segment without gaps"
            )
        return PhasePortrait(points, rate_hz, (channel,), (unit,), "states", channel)
    plane = phase_plane(
        segment.values, rate_hz, quantity="displacement", low_cut_hz=low_cut_hz, high_cut_hz=high_cut_hz, source=channel
    )
    points = np.ascontiguousarray(plane.points[:, :1])
    return PhasePortrait(points, rate_hz, (channel,), (unit,), "states", plane.source, plane.start_s, plane.band_hz)


@cached(6, "Looking for the delay …")
def information_of(signal: PhasePortrait) -> MutualInformation:
    """Return the mutual information."""
    return average_mutual_information(signal.points[:, 0], signal.sampling_rate_hz, source=signal.source)


@cached(6, "Looking for the dimension …")
def dimension_of(signal: PhasePortrait, delay_samples: int) -> EmbeddingDimension:
    """Return the false neighbours over dimension."""
    values, rate_hz = signal.points[:, 0], signal.sampling_rate_hz
    return embedding_dimension(values, rate_hz, delay_samples=delay_samples, source=signal.source)


# --------------------
# Views of the embedded path.
# --------------------


def _show_portrait(page: MethodPage, segment: SignalSegment, path: PhasePortrait) -> None:
    """Show the path in the plane or in space, with the points of its section."""
    left, middle, right = st.columns((1, 2, 2))
    in_space = page.choose(left, "Drawn in", ("plane", "space")) == "space"
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
    figure = phase_portrait_figure(path, section, n_points=MAX_DRAWN_IN_SPACE)
    show_picture(figure, f"Delay embedding of {path.source} with its Poincaré points")


def _show_space(page: MethodPage, path: PhasePortrait, section: PoincareSection | None) -> None:
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
    st.plotly_chart(figure, width="stretch", key=page.key("space"), config=CONFIG, alt="Path in space")
    shown_s = min(MAX_DRAWN_IN_SPACE, path.n_points) / path.sampling_rate_hz
    st.caption(f"The last {shown_s:.4g} s of the path as a line; the points are of the whole segment. Drag to turn it.")


def _show_divergence(page: MethodPage, segment: SignalSegment, path: PhasePortrait) -> None:
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
    with st.spinner("Following neighbours …", show_time=True):
        exponent = largest_lyapunov_exponent(
            path, method=method, theiler_samples=theiler, n_steps=steps, fit_s=two_numbers(fit)
        )
    text = f"Mean logarithm of the distance of neighbours over time, {path.source}"
    show_picture(divergence_figure(exponent), text)
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


def _show_recurrence(page: MethodPage, segment: SignalSegment, path: PhasePortrait) -> None:
    """Show which points come back close to which, and what that measures."""
    del segment
    one, two, three, four = st.columns(4)
    about = "Share of pairs that count as close; the radius follows from it."
    rate = page.ask(one.slider, "Recurrence rate (%)", 1, 30, 5, about=about) / 100.0
    n_points = page.ask(two.select_slider, "Points drawn", (200, 500, 1000, 2000, 3000), value=1000)
    stride = _whole_number(page, three, "Every so-many-th sample", "16 per mean period")
    shortest = page.ask(four.number_input, "Shortest line (points)", min_value=2, value=2, step=1)
    with st.spinner("Comparing points …", show_time=True):
        plot = recurrence_plot(path, recurrence_rate=rate, n_points=n_points, stride=stride)
        measures = recurrence_measures(path, recurrence_rate=rate, shortest_line=shortest, stride=stride)
    show_picture(recurrence_figure(plot, measures), f"Recurrence plot of {path.source}", width=900)
    st.caption(
        f"The measures are of {measures.n_points} points, {measures.duration_s:.4g} s, pairs nearer in time than "
        f"{measures.theiler_points} points left out. Lines along the diagonal are motion that repeats."
    )


def _show_chaos_test(page: MethodPage, segment: SignalSegment, path: PhasePortrait) -> None:
    """Show K of the 0–1 test, and the walk it rests on."""
    one, two, three, four = st.columns(4)
    of_section = page.choose(one, "Of the", ("Poincaré points", "signal"), key="test of") == "Poincaré points"
    about = "Keeps noise on regular motion from being read as chaos; 0 is the plain test."
    damping = float(page.ask(two.number_input, "Damping", min_value=0.0, value=1.0, step=0.5, about=about))
    if of_section:
        with three.container():
            lock = _choose_lock(page, st, segment)
        if lock is None:
            return
        section = poincare_section(path, lock)
        values = np.ascontiguousarray(section.points[:, 0])
        test = zero_one_test_of_section(section, damping=damping)
    else:
        every = _whole_number(page, three, "Every so-many-th sample", "from the mutual information")
        values = np.ascontiguousarray(path.points[:, 0])
        test = zero_one_test(values, damping=damping, every=every, source=path.source)
    c = float(page.ask(four.slider, "Walk at c (rad)", 0.63, 2.51, 1.2, step=0.01))
    walk = translation_walk(values, c, every=test.every)
    show_picture(chaos_test_figure(test, walk, c), f"K of the 0–1 test over c, and its walk, {path.source}")
    st.caption(
        "K near 0: regular, a bounded walk. K near 1: chaos or noise, a walk like Brownian motion; only the false "
        "neighbours tell these two apart." + (f" Every {test.every}-th value is used." if test.every > 1 else "")
    )
    if test.reason:
        st.warning(f"Undecided: {as_typed(test.reason)}.")


def _show_motion(page: MethodPage, segment: SignalSegment, path: PhasePortrait) -> None:
    """Ask what the section is locked to, and say what kind of motion it is."""
    lock = _choose_lock(page, st, segment)
    if lock is not None:
        _show_kind(
            kind_of(path, lock),
            f"Looked at: the signal as measured, {path.source}, embedded by delays. The phase plane asks the same of "
            "displacement, where slow motion weighs more; the answers may differ.",
        )


View = Callable[[MethodPage, SignalSegment, PhasePortrait], None]
VIEWS: dict[str, View | None] = {
    "Delay and dimension": None,
    "Portrait and section": _show_portrait,
    "Lyapunov exponent": _show_divergence,
    "Recurrence": _show_recurrence,
    "0–1 test": _show_chaos_test,
    "Kind of motion": _show_motion,
}
