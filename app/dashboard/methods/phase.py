"""The phase plane of one channel with the points of a Poincaré section, and what kind of motion they speak for."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, cast

import numpy as np
import streamlit as st

from app.dashboard import state
from app.dashboard.methods.signals import SignalSegment, choose_one, choose_stretch
from app.dashboard.theme import as_plot_text, as_typed, one_line, palette
from app.dashboard.widgets.charts import CONFIG, show_picture
from gearsig.diagnosis import Analysis, ChannelAnalysis
from gearsig.errors import InputError, RefusalError

if TYPE_CHECKING:
    from streamlit.delta_generator import DeltaGenerator

    from gearsig.angle import ShaftAngle
    from gearsig.phase import (
        CycleLock,
        EmbeddingDimension,
        MotionKind,
        MotionQuantity,
        MutualInformation,
        PhasePortrait,
        PoincareSection,
    )
    from gearsig.rig import Rig


# --------------------
# What a phase plane needs: the band that is integrated, and what the section is locked to.
# --------------------


QUANTITIES = ("acceleration", "velocity", "displacement")
OF_MOTION = (*QUANTITIES, "transmission_error", "unknown")
WITHOUT_SPEED_HZ = 10.0
"""Low cut suggested where no shaft's frequency is known."""
SPARE = 1.05
STEADY = 0.05
"""Share of the mean by which the speed may vary while a section is still one of one motion."""


@dataclass(frozen=True)
class PhaseSettings:
    """What `phase_plane` is told."""

    low_cut_hz: float | None
    high_cut_hz: float | None
    quantity: MotionQuantity | None


def choose_band(analysis: Analysis, stretch: SignalSegment) -> PhaseSettings:
    """Let the user choose the band, and say what the channel measures where the recording does not.

    Raises
    ------
    InputError
        If the channel measures something else than motion.
    """
    known = stretch.recording.channels[0].quantity
    if known not in OF_MOTION:
        raise InputError(
            f"channel {stretch.channel!r} measures {known.replace('_', ' ')}: displacement and velocity do not follow "
            "from it",
            allowed="acceleration, velocity, displacement",
            remedy="choose another channel, or correct its quantity in the rig's [[sensor]] table",
        )
    left, right = st.columns(2)
    quantity: MotionQuantity | None = None
    if known == "unknown":
        with right:
            chosen = choose_one("The channel measures", QUANTITIES, _key(f"quantity {stretch.channel}", analysis))
            quantity = cast("MotionQuantity", chosen)
    measured = quantity or known
    with left:
        low = _choose_low_cut(analysis, stretch) if measured in ("acceleration", "velocity") else None
        if low is None:
            st.caption("A displacement is differentiated: nothing slow needs to be cut off.")
    half = stretch.recording.sampling_rate_hz / 2.0
    high = right.number_input(
        "Highest frequency (Hz)",
        value=None,
        placeholder=f"{0.8 * half:.5g}",
        key=_key("high", analysis),
        help=f"Up to {half:.5g} Hz. A lower one shows the slower motion alone, without resonances.",
        persist_state="session",
    )
    return PhaseSettings(low, None if high is None else float(high), quantity)


def _choose_low_cut(analysis: Analysis, stretch: SignalSegment) -> float | None:
    suggested, why = suggested_low_cut_hz(analysis, stretch)
    low = st.number_input(
        "Lowest frequency (Hz)",
        value=None,
        placeholder=f"{suggested:.3g}, {why}",
        key=_key("low", analysis),
        help="Integration magnifies whatever is slow. Too low, noise turns into drift; too high, slow motion is bent.",
        persist_state="session",
    )
    return suggested if low is None else float(low)


def suggested_low_cut_hz(analysis: Analysis, stretch: SignalSegment) -> tuple[float, str]:
    """Return a frequency below the slowest mesh, or else shaft, or what the stretch allows if that is higher, and why.

    Far below the mesh, integrated noise outgrows the motion of the teeth and makes a cloud of the section.
    """
    from gearsig.phase import LEAST_PERIODS, SETTLING_PERIODS

    possible = SPARE * (2.0 * SETTLING_PERIODS + LEAST_PERIODS) / stretch.recording.duration_s
    meshes = _mesh_orders(analysis.rig)
    if stretch.angle is None:
        wanted, why = WITHOUT_SPEED_HZ, "as no shaft's frequency is known"
    elif meshes:
        wanted, why = min(meshes) * _lowest_hz(stretch.angle) / 3.0, "a third of the slowest mesh frequency"
    else:
        slowest = min(_ratios(analysis.rig))
        wanted, why = 0.5 * slowest * _lowest_hz(stretch.angle), "half of the slowest shaft's frequency"
    low, why = (wanted, why) if wanted >= possible else (possible, "as low as the stretch allows")
    return float(f"{low:.3g}"), why


def _lowest_hz(angle: ShaftAngle) -> float:
    return angle.speed_range_rpm[0] / 60.0


def _mesh_orders(rig: Rig | None) -> list[float]:
    orders = [] if rig is None else [rig.mesh_order(pair) for pair in rig.pairs]
    return [order for order in orders if order]


def _ratios(rig: Rig | None) -> list[float]:
    ratios = [] if rig is None else [rig.ratio(name) for name in rig.shaft_names]
    return [ratio for ratio in ratios if ratio] or [1.0]


def choose_lock(analysis: Analysis, stretch: SignalSegment) -> CycleLock | None:
    """Return what gives a point per cycle; None where the speed is not known."""
    from gearsig.phase import find_lock

    if stretch.angle is None:
        st.info("There is no Poincaré section: it takes a shaft angle, and the speed is not known.")
        return None
    lowest, highest = stretch.angle.speed_range_rpm
    if highest - lowest > STEADY * stretch.angle.mean_speed_rpm:
        st.warning(
            f"The speed runs from {lowest:.4g} to {highest:.4g} rpm here: a Poincaré section shows one motion only at "
            "a steady speed. Its points smear, and what is said of them does not hold; choose a steady stretch."
        )
    choices: dict[str, tuple[str, str]] = {}
    rig = analysis.rig
    if rig is not None:
        choices |= {f"mesh cycle of {one_line(pair.name)}": (pair.name, "") for pair in rig.pairs}
        choices |= {f"revolution of {one_line(name)}": ("", name) for name in rig.shaft_names}
    if not choices:
        choices = {"revolution of the shaft": ("", "")}
    key = _key(f"lock {list(choices)}", analysis)
    chosen = st.selectbox("A point once per", list(choices), key=key, persist_state="session")
    pair, shaft = choices[chosen]
    return find_lock(stretch.recording, pair=pair, shaft=shaft, rig=rig, angle=stretch.angle)


def _key(name: str, analysis: Analysis) -> str:
    return state.view_key(f"phase plane {name}", analysis)


# --------------------
# The kind of motion of a path, with its evidence; used beside the phase plane and beside the embedding.
# --------------------


OF_SIGNAL = (
    "Looked at: the signal as measured, {}, embedded by delays. The phase plane asks the same of displacement, where "
    "slow motion weighs more; the answers may differ."
)
OF_DISPLACEMENT = (
    "Looked at: displacement and velocity, {}. Integration makes slow motion weigh more; “Embedding and chaos” asks "
    "the same of the signal as measured, and the answers may differ."
)


def show_motion(analysis: Analysis, stretch: SignalSegment, path: PhasePortrait) -> None:
    """Ask what the section is locked to, and say what kind of motion it is."""
    from gearsig.phase import kind_of_motion

    lock = choose_lock(analysis, stretch)
    if lock is not None:
        with st.spinner("Looking at section, exponent and 0–1 test …", show_time=True):
            show_verdict(kind_of_motion(path, lock), OF_SIGNAL.format(path.source))


def show_verdict(kind: MotionKind, looked_at: str) -> None:
    """Say what kind of motion it is, of which signal, and why."""
    with st.container(border=True):
        after = f" after {kind.period} cycles" if kind.kind == "subharmonic" else ""
        st.markdown(f"Kind of motion: **{kind.kind}**{after}")
        st.markdown(as_typed(looked_at))
        st.markdown("\n".join(f"- {as_typed(sentence)}" for sentence in kind.evidence))
        st.caption(
            "Measured gear vibration is periodic with noise and modulation in most cases: “stochastic” and “undecided” "
            "are then the right answers."
        )


N_FIRST = 100_000
N_KEPT = 4
DRAWN = (1, 2, 5, 10, 20, 50, 100)
"""Revolutions of the reference shaft that are drawn as a line; the points are of the whole stretch."""
N_DRAWN = 4000
"""Samples drawn where the speed is not known."""
MOST_DRAWN = 20_000


def show_phase_plane(analysis: Analysis, channel: ChannelAnalysis) -> None:
    """Show displacement and velocity of one channel."""
    left, right = st.columns(2)
    with left:
        stretch = choose_stretch(analysis, channel, "phase plane", n_first=N_FIRST)
    settings = choose_band(analysis, stretch)
    with right:
        lock = choose_lock(analysis, stretch)
    phase, n_drawn = _choose_view(analysis, stretch, lock)
    with st.spinner("Integrating …", show_time=True):
        portrait = portrait_of(stretch.key, settings, stretch)
    _show_portrait(portrait, lock, phase, n_drawn)
    if lock is not None:
        _show_kind(analysis, stretch, settings, portrait, lock)


def _choose_view(analysis: Analysis, stretch: SignalSegment, lock: CycleLock | None) -> tuple[float, int]:
    """Return where in the cycle the path is looked at, and how many samples of the path are drawn."""
    if lock is None or stretch.angle is None:
        return 0.0, N_DRAWN
    left, right = st.columns(2)
    about = "Another place shows the section from another side; it must not change what kind of motion it is."
    phase = left.slider(
        "Place in the cycle (0 to 1)",
        0.0,
        1.0,
        0.0,
        step=0.05,
        key=_key("phase", analysis),
        help=about,
        persist_state="session",
    )
    turns = right.select_slider(
        "Path drawn (revolutions)",
        DRAWN,
        value=DRAWN[1],
        key=_key("drawn", analysis),
        help="The points are of the whole stretch.",
        persist_state="session",
    )
    per_revolution = 60.0 * stretch.recording.sampling_rate_hz / max(stretch.angle.mean_speed_rpm, 1e-9)
    return float(phase), int(min(max(2.0, turns * per_revolution), MOST_DRAWN))


def _show_portrait(portrait: PhasePortrait, lock: CycleLock | None, phase: float, n_drawn: int) -> None:
    from gearsig.phase import locked_section
    from gearsig.plot import phase_portrait_figure

    section = None
    if lock is not None:
        try:
            section = locked_section(portrait, lock, phase_cycles=phase)
        except RefusalError as error:
            st.info(as_typed(error), icon=":material/help:")
    picture = phase_portrait_figure(portrait, section, n_points=n_drawn)
    show_picture(picture, f"Velocity over displacement, {portrait.source}, with its Poincaré points")
    low, high = portrait.band_hz
    st.caption(
        f"From {portrait.start_s:.3g} to {portrait.end_s:.3g} s of the stretch, {low:.4g} to {high:.4g} Hz: near its "
        "ends an integral rests on what is not known. Motion that repeats with the lock falls onto one point; scatter "
        "is noise, modulation, or motion that does not repeat."
    )


def _show_kind(
    analysis: Analysis, stretch: SignalSegment, settings: PhaseSettings, portrait: PhasePortrait, lock: CycleLock
) -> None:
    """Say what kind of motion it is once that is asked for: it takes some seconds."""
    asked, question = _key("kind asked", analysis), (stretch.key, settings, lock.name, lock.cycles_per_revolution)
    if st.session_state.get(asked) != question:
        st.button(
            "What kind of motion is it?",
            icon=":material/psychology_alt:",
            key=f"{asked} button",
            on_click=_ask,
            args=(asked, question),
            help="Looks whether the section repeats, for the largest Lyapunov exponent, and the 0–1 test for chaos: "
            "some seconds.",
        )
        return
    with st.spinner("Looking at section, exponent and 0–1 test …", show_time=True):
        kind = kind_of(stretch.key, settings, lock.name, lock.cycles_per_revolution, portrait, lock)
    show_verdict(kind, OF_DISPLACEMENT.format(portrait.source))


def _ask(asked: str, question: tuple[object, ...]) -> None:
    st.session_state[asked] = question


@st.cache_resource(max_entries=N_KEPT, show_spinner=False)
def portrait_of(key: str, settings: PhaseSettings, _stretch: SignalSegment) -> PhasePortrait:
    """Return the portrait; `key` stands for the stretch. It is frozen, so that sessions may share it."""
    from gearsig.phase import phase_plane

    del key
    return phase_plane(
        _stretch.recording,
        _stretch.channel,
        low_cut_hz=settings.low_cut_hz,
        high_cut_hz=settings.high_cut_hz,
        quantity=settings.quantity,
    )


@st.cache_resource(max_entries=N_KEPT, show_spinner=False)
def kind_of(
    key: str, settings: PhaseSettings, lock_name: str, cycles: float, _portrait: PhasePortrait, _lock: CycleLock
) -> MotionKind:
    """Return the kind of motion; the first four stand for portrait and lock."""
    from gearsig.phase import kind_of_motion

    del key, settings, lock_name, cycles
    return kind_of_motion(_portrait, _lock)


# --------------------
# Numbers that may be left to the method: an empty field says what it then does.
# --------------------


def whole_number(
    place: DeltaGenerator,
    label: str,
    name: str,
    analysis: Analysis,
    placeholder: str,
    *,
    most: int | None = None,
    about: str = "",
) -> int | None:
    """Return a whole number from 1 on, None where the field is empty."""
    return place.number_input(
        label,
        min_value=1,
        max_value=most,
        value=None,
        step=1,
        placeholder=placeholder,
        key=path_key(name, analysis),
        help=about or None,
        persist_state="session",
    )


def frequency_hz(
    place: DeltaGenerator, label: str, name: str, analysis: Analysis, placeholder: str, *, about: str = ""
) -> float | None:
    """Return a frequency above 0, None where the field is empty or 0."""
    number = place.number_input(
        label,
        min_value=0.0,
        value=None,
        placeholder=placeholder,
        key=path_key(name, analysis),
        help=about or None,
        persist_state="session",
    )
    return number or None


def two_numbers(text: str | None) -> tuple[float, float] | None:
    """Return the numbers of "0.001, 0.004", None where the field is empty."""
    if not text or not text.strip():
        return None
    try:
        first, second = (float(part) for part in text.replace(";", ",").split(","))
    except ValueError:
        raise InputError(f"fit is {text!r}", allowed="two numbers in s, for example 0.001, 0.004") from None
    return first, second


def path_key(name: str, analysis: Analysis) -> str:
    """Key of a widget of the embedded path."""
    return state.view_key(f"embedded path {name}", analysis)


# --------------------
# Views of an embedded path: portrait, divergence of neighbours, recurrences, 0–1 test; parameters at hand.
# --------------------


PHASE_MEASURES_MOST_DRAWN = 6_000
"""Points of a path in space: more is a blot, and a browser without a graphics card turns it slowly."""
METHODS = ("rosenstein", "transverse", "kantz")
SECTION, SIGNAL = "Poincaré points", "signal"
HEIGHT_PX = 560


def show_portrait(analysis: Analysis, stretch: SignalSegment, path: PhasePortrait) -> None:
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
        from gearsig.phase import locked_section

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
    from gearsig.plot import phase_portrait_figure

    figure = phase_portrait_figure(path, section, n_points=PHASE_MEASURES_MOST_DRAWN)
    show_picture(figure, f"Delay embedding of {path.source} with its Poincaré points")


def show_divergence(analysis: Analysis, stretch: SignalSegment, path: PhasePortrait) -> None:
    """Show how neighbours part, and the slope of it."""
    from gearsig.phase import largest_lyapunov_exponent
    from gearsig.plot import divergence_figure

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


def show_recurrence(analysis: Analysis, stretch: SignalSegment, path: PhasePortrait) -> None:
    """Show which points come back close to which, and what that measures."""
    from gearsig.phase import recurrence_measures, recurrence_plot
    from gearsig.plot import recurrence_figure

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


def show_chaos_test(analysis: Analysis, stretch: SignalSegment, path: PhasePortrait) -> None:
    """Show K of the 0–1 test, and the walk it rests on."""
    from gearsig.phase import locked_section, translation_walk, zero_one_test, zero_one_test_of_section
    from gearsig.plot import chaos_test_figure

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
    x, y, z = path.points[-PHASE_MEASURES_MOST_DRAWN:, :3].T
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
    shown = min(PHASE_MEASURES_MOST_DRAWN, path.n_points) / path.sampling_rate_hz
    st.caption(f"The last {shown:.4g} s of the path as a line; the points are of the whole stretch. Drag to turn it.")


# --------------------
# One channel embedded by delays: delay and dimension with their curves, and what can be measured on the path.
# --------------------


PHASE_EMBEDDING_N_FIRST, N_MOST = 40_000, 200_000
PHASE_EMBEDDING_N_KEPT = 6
MOST_DIMENSIONS = 20
VIEWS = {
    "Delay and dimension": None,
    "Portrait and section": show_portrait,
    "Lyapunov exponent": show_divergence,
    "Recurrence": show_recurrence,
    "0–1 test": show_chaos_test,
    "Kind of motion": show_motion,
}


@dataclass(frozen=True)
class Choices:
    """What is embedded, and how; None: the curves decide."""

    low_cut_hz: float | None
    high_cut_hz: float | None
    delay_samples: int | None
    dimension: int | None


def show_embedding(analysis: Analysis, channel: ChannelAnalysis) -> None:
    """Show the parameters, and the chosen view of the path."""
    stretch = choose_stretch(analysis, channel, "embedding", n_first=PHASE_EMBEDDING_N_FIRST, n_most=N_MOST)
    with st.expander("Band, delay and dimension", icon=":material/tune:"):
        choices = _choose(analysis, stretch)
    name = choose_one("View", list(VIEWS), path_key("view", analysis), named=False)
    with st.spinner("Looking for delay and dimension …", show_time=True):
        signal = signal_of(stretch.key, choices.low_cut_hz, choices.high_cut_hz, stretch)
        information = information_of(stretch.key, choices, signal)
        delay = choices.delay_samples or information.delay_samples
        dimension = dimension_of(stretch.key, choices, delay, signal)
    show = VIEWS[name]
    if show is None:
        _show_curves(information, dimension, choices)
        return
    size = choices.dimension or dimension.dimension
    if size == 0:
        size = dimension.dimensions[-1]
        st.info(
            f"No dimension up to {size} unfolds the path: the signal looks stochastic. {size} dimensions are taken; a "
            "narrower band or a dimension of your own may say more.",
            icon=":material/help:",
        )
    show(analysis, stretch, embedded(signal, delay, size, stretch))


def _choose(analysis: Analysis, stretch: SignalSegment) -> Choices:
    half = stretch.recording.sampling_rate_hz / 2.0
    about = f"Up to {half:.5g} Hz. Noise above the motion of interest hides its neighbours."
    first, second, third, fourth = st.columns(4)
    return Choices(
        frequency_hz(first, "Lowest frequency (Hz)", "low", analysis, "all"),
        frequency_hz(second, "Highest frequency (Hz)", "high", analysis, "all", about=about),
        whole_number(
            third,
            "Delay (samples)",
            "delay",
            analysis,
            "from the curve",
            about="None: the first minimum of the mutual information.",
        ),
        whole_number(
            fourth,
            "Dimension",
            "dimension",
            analysis,
            "from the curve",
            most=MOST_DIMENSIONS,
            about="None: the smallest without false neighbours.",
        ),
    )


def _show_curves(information: MutualInformation, dimension: EmbeddingDimension, choices: Choices) -> None:
    from gearsig.plot import embedding_figure

    figure = embedding_figure(information, dimension)
    show_picture(figure, "Mutual information over delay, false neighbours over dimension")
    own = "" if choices.delay_samples is None else f" Neighbours are those at your delay of {dimension.delay_samples}."
    st.caption(
        f"Delay {information.delay_samples} samples by the curve ({information.rule}); a dimension unfolds the path "
        f"where fewer than {dimension.threshold:.0%} of the nearest neighbours are false.{own} E2 near 1 at every "
        "dimension says random."
    )


@st.cache_resource(max_entries=PHASE_EMBEDDING_N_KEPT, show_spinner=False)
def signal_of(key: str, low_cut_hz: float | None, high_cut_hz: float | None, _stretch: SignalSegment) -> PhasePortrait:
    """Return the channel as it is, or within a band; a path of one axis."""
    import numpy as np

    from gearsig.phase import PhasePortrait, phase_plane_of

    del key
    recording, channel = _stretch.recording, _stretch.channel
    rate, values, unit = recording.sampling_rate_hz, recording.values(channel), _stretch.unit
    if low_cut_hz is None and high_cut_hz is None:
        points = np.asarray(values, dtype=np.float64)[:, None]
        if not np.isfinite(points).all():
            raise InputError(
                f"channel {channel!r} has values that are not numbers here", remedy="choose a stretch without gaps"
            )
        return PhasePortrait(points, rate, (channel,), (unit,), "states", channel)
    plane = phase_plane_of(
        values, rate, quantity="displacement", low_cut_hz=low_cut_hz, high_cut_hz=high_cut_hz, source=channel
    )
    points = np.ascontiguousarray(plane.points[:, :1])
    return PhasePortrait(points, rate, (channel,), (unit,), "states", plane.source, plane.start_s, plane.band_hz)


@st.cache_resource(max_entries=PHASE_EMBEDDING_N_KEPT, show_spinner=False)
def information_of(key: str, choices: Choices, _signal: PhasePortrait) -> MutualInformation:
    """Return the mutual information; the first two stand for the signal."""
    from gearsig.phase import average_mutual_information

    del key, choices
    return average_mutual_information(_signal.points[:, 0], _signal.sampling_rate_hz, source=_signal.source)


@st.cache_resource(max_entries=PHASE_EMBEDDING_N_KEPT, show_spinner=False)
def dimension_of(key: str, choices: Choices, delay: int, _signal: PhasePortrait) -> EmbeddingDimension:
    """Return the false neighbours over dimension."""
    from gearsig.phase import embedding_dimension

    del key, choices
    return embedding_dimension(
        _signal.points[:, 0], _signal.sampling_rate_hz, delay_samples=delay, source=_signal.source
    )


def embedded(signal: PhasePortrait, delay: int, dimension: int, stretch: SignalSegment) -> PhasePortrait:
    """Return the path; it takes no memory of its own."""
    from dataclasses import replace

    from gearsig.phase import delay_embedding

    path = delay_embedding(
        signal.points[:, 0],
        signal.sampling_rate_hz,
        delay_samples=delay,
        dimension=dimension,
        unit=stretch.unit,
        source=signal.source,
    )
    return replace(path, start_s=signal.start_s)
