"""Methods in phase space: phase plane and its section; embedding by delays and measures of its path."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from gearsig import phase, plot
from gearsig.checks import FloatArray
from gearsig.errors import InputError, RefusalError
from gearsig.formatting import counted, percent
from gearsig.methods._table import SHAFT, Method, MethodAnswer, MethodOption, angle_or_none, unit_of, verbatim
from gearsig.plot import with_unit
from gearsig.prepared import PreparedRecording

N_DRAWN, N_IN_SPACE = 20_000, 6_000
"""Maximum points of a path in the plane and in space: more overlap too much, and are slow to rotate in a browser."""
PAIR = MethodOption(
    "pair", "A point once per mesh cycle of", "name", "", empty="the first pair",
    known=lambda prepared, _: [pair.name for pair in prepared.rig.pairs],
)  # fmt: skip


def _lowest_hz(prepared: PreparedRecording, channel: str = "") -> tuple[float, str]:
    """Return a frequency below the slowest mesh, else shaft, or the part's limit if that is higher, and the reason.

    Far below the mesh, integrated noise exceeds the motion of the teeth and turns the section into a cloud.
    """
    del channel
    possible = 1.05 * phase.lowest_low_cut_hz(prepared.recording.duration_s)
    rig, angle = prepared.rig, angle_or_none(prepared)
    meshes = [order for pair in rig.pairs if (order := rig.mesh_order(pair))]
    ratios = [ratio for name in rig.shaft_names if (ratio := rig.ratio(name))]
    slowest_hz = 0.0 if angle is None else angle.speed_range_rpm[0] / 60.0
    if angle is None:
        low, why = 10.0, "as no shaft's frequency is known"
    elif meshes:
        low, why = min(meshes) * slowest_hz / 3.0, "a third of the slowest mesh frequency"
    else:
        low, why = 0.5 * min(ratios or [1.0]) * slowest_hz, "half of the slowest shaft's frequency"
    if low < possible:
        low, why = possible, "as low as the part allows"
    return float(f"{low:.3g}"), why


def _modulation_text(prepared: PreparedRecording, channel: str) -> str:
    low, why = _lowest_hz(prepared, channel)
    return f"{low:.3g}, {why}"


def _lock(prepared: PreparedRecording, pair: str, shaft: str) -> phase.CycleLock:
    """Return the cycle that gives one point each: of the requested shaft, else of the mesh of a pair."""
    if not (pair or shaft) and prepared.rig.pairs:
        pair = prepared.rig.pairs[0].name
    return phase.find_lock(prepared.recording, pair=pair, shaft=shaft, rig=prepared.rig, angle=prepared.shaft_angle)


def _speed_messages(prepared: PreparedRecording) -> tuple[str, ...]:
    angle = angle_or_none(prepared)
    # a section shows a single motion only if the speed varies by less than 5 %
    if angle is None or angle.is_steady(0.05):
        return ()
    low, high = angle.speed_range_rpm
    return (
        (
            f"the speed varies from {low:.4g} to {high:.4g} rpm here: a Poincaré section shows a single motion only at "
            "steady speed. Its points smear, and statements about them do not hold; choose a steady part"
        ),
    )


def _plane(
    prepared: PreparedRecording, channel: str, lowest_hz: float | None, highest_hz: float | None, quantity: str
) -> phase.PhasePortrait:
    recording = prepared.recording
    known = recording.channels[recording.index(channel)].quantity
    if known not in ("acceleration", "velocity", "displacement", "transmission_error", "unknown"):
        raise InputError(
            f"channel {channel!r} measures {known.replace('_', ' ')}: displacement and velocity do not follow from it",
            allowed="acceleration, velocity, displacement",
            remedy="choose another channel, or correct its quantity in the rig's [[sensor]] table",
        )
    stated: Any = quantity if known == "unknown" else None
    low = lowest_hz
    if low is None and (stated or known) in ("acceleration", "velocity"):
        low = _lowest_hz(prepared)[0]
    return prepared.keep(
        ("methods", "plane", channel, low, highest_hz, stated),
        lambda: phase.phase_plane(recording, channel, low_cut_hz=low, high_cut_hz=highest_hz, quantity=stated),
    )


def _phase_plane(
    prepared: PreparedRecording,
    channel: str,
    lowest_hz: float | None,
    highest_hz: float | None,
    quantity: str,
    pair: str,
    shaft: str,
    place: float,
    revolutions: int,
    section_only: bool = False,
) -> MethodAnswer:
    portrait = _plane(prepared, channel, lowest_hz, highest_hz, quantity)
    section = None
    try:
        section = phase.poincare_section(portrait, _lock(prepared, pair, shaft), phase_cycles=place)
    except RefusalError:
        if section_only:
            raise
    caption = "velocity over displacement" + (", a point once per cycle" if section is not None else "")
    numbers: dict[str, Any] = {"band_hz": list(portrait.band_hz)}
    table: dict[str, Any] = {"time (s)": portrait.start_s + np.arange(len(portrait.points)) / portrait.sampling_rate_hz}
    table |= _columns(portrait)
    if section is not None:
        numbers["scatter"] = [float(v) for v in section.points.std(axis=0) / section.extent]
        numbers["section"], numbers["points"] = section.section, len(section.points)
        if section_only:
            table = {"time (s)": section.times_s, **_columns(replace(portrait, points=section.points))}
    angle, n_drawn = angle_or_none(prepared), N_DRAWN
    if angle is not None:
        per_turn = 60.0 * portrait.sampling_rate_hz / max(angle.mean_speed_rpm, 1e-9)
        n_drawn = int(min(max(2.0, revolutions * per_turn), N_DRAWN))
    low, high = portrait.band_hz
    return MethodAnswer(
        channel,
        caption,
        lambda: plot.phase_portrait_figure(portrait, section, n_points=n_drawn),
        table,
        numbers=numbers,
        notes=(
            (
                f"Shown are {portrait.start_s:.3g} to {portrait.end_s:.3g} s of the part, {low:.4g} to {high:.4g} Hz; "
                "its ends are left out, as integration is uncertain there. Motion that repeats in each cycle falls on "
                "one point; scatter is noise, modulation, or motion that does not repeat."
            ),
        ),
        warnings=_speed_messages(prepared) if section is not None else (),
    )


def _poincare(prepared: PreparedRecording, channel: str, **options: Any) -> MethodAnswer:
    return _phase_plane(prepared, channel, **options, section_only=True)


# Embedding by delays.


def _embedded(
    prepared: PreparedRecording,
    channel: str,
    lowest_hz: float | None,
    highest_hz: float | None,
    delay: int | None,
    dimension: int | None,
) -> tuple[phase.PhasePortrait, phase.MutualInformation, phase.EmbeddingDimension, tuple[str, ...]]:
    """Return the path, the curves from which delay and dimension follow, and warnings."""

    def embed() -> tuple[phase.PhasePortrait, phase.MutualInformation, phase.EmbeddingDimension, tuple[str, ...]]:
        values, rate_hz, start_s, source = _in_band(prepared, channel, lowest_hz, highest_hz)
        information = phase.average_mutual_information(values, rate_hz, source=source)
        chosen = delay or information.delay_samples
        curves = phase.embedding_dimension(values, rate_hz, delay_samples=chosen, source=source)
        n_axes, messages = dimension or curves.dimension, tuple[str, ...]()
        if n_axes == 0:
            n_axes = curves.dimensions[-1]
            messages = (
                (
                    f"no dimension up to {n_axes} unfolds the path: the signal looks stochastic. {n_axes} dimensions "
                    "are used; a narrower band or a dimension of your own may show more"
                ),
            )
        path = phase.delay_embedding(
            values, rate_hz, delay_samples=chosen, dimension=n_axes, unit=unit_of(prepared, channel), source=source
        )
        return replace(path, start_s=start_s), information, curves, messages

    return prepared.keep(("methods", "embedding", channel, lowest_hz, highest_hz, delay, dimension), embed)


def _in_band(
    prepared: PreparedRecording, channel: str, low_hz: float | None, high_hz: float | None
) -> tuple[FloatArray, float, float, str]:
    """Return the channel unchanged, or within a band, with its rate, start and name."""
    recording = prepared.recording
    values, rate_hz = recording.values(channel), recording.sampling_rate_hz
    if not low_hz and not high_hz:
        if not np.isfinite(values).all():
            raise InputError(
                f"channel {channel!r} has values that are not numbers here", remedy="choose a part without gaps"
            )
        return np.asarray(values, dtype=np.float64), rate_hz, 0.0, channel
    plane = phase.phase_plane(
        values, rate_hz, quantity="displacement", low_cut_hz=low_hz or None, high_cut_hz=high_hz or None, source=channel
    )
    return np.ascontiguousarray(plane.points[:, 0]), plane.sampling_rate_hz, plane.start_s, plane.source


def _columns(path: phase.PhasePortrait) -> dict[str, FloatArray]:
    return {
        with_unit(n, u): path.points[:, i] for i, (n, u) in enumerate(zip(path.axis_names, path.units, strict=True))
    }


def _embedding(prepared: PreparedRecording, channel: str, **options: Any) -> MethodAnswer:
    _, information, curves, messages = _embedded(prepared, channel, **options)
    delay = counted(information.delay_samples, "sample")
    yours = f" Neighbours are those at your delay of {curves.delay_samples}." if options["delay"] else ""
    return MethodAnswer(
        channel,
        "mutual information over delay, false neighbours over dimension",
        lambda: plot.embedding_figure(information, curves),
        {"delay (s)": information.delays_s, "mutual information (nats)": information.information_nats},
        tables={
            "dimension": {
                "dimension": np.asarray(curves.dimensions),
                "false neighbours": curves.false_fraction,
                "Cao E1": np.append(curves.growth, np.nan),
                "Cao E2": np.append(curves.determinism, np.nan),
            }
        },
        numbers={"delay_samples": information.delay_samples, "dimension": curves.dimension},
        notes=(
            (
                f"Delay {delay} by the curve ({information.rule}); a dimension unfolds the path if fewer than "
                f"{percent(curves.threshold)} of the nearest neighbours are false.{yours} E2 near 1 at each dimension "
                "means random."
            ),
        ),
        warnings=messages,
    )


def _portrait(
    prepared: PreparedRecording, channel: str, pair: str, shaft: str, place: float, in_space: bool, **options: Any
) -> MethodAnswer:
    path, *_, messages = _embedded(prepared, channel, **options)
    if path.n_axes == 1:
        raise RefusalError("a portrait needs more than one dimension", remedy="give a larger one")
    if in_space and path.n_axes < 3:
        raise RefusalError(f"the path has {path.n_axes} dimensions", remedy="give at least 3 to see it in space")
    section, warnings = None, [*messages]
    try:
        section = phase.poincare_section(path, _lock(prepared, pair, shaft), phase_cycles=place)
        warnings += _speed_messages(prepared)
    except RefusalError as refusal:
        warnings.append(f"there is no Poincaré section: {refusal}")
    return MethodAnswer(
        channel,
        "delay embedding" + (" with its Poincaré points" if section is not None else ""),
        lambda: plot.phase_portrait_figure(path, section, n_points=N_IN_SPACE),
        _columns(path),
        tables={} if section is None else {"section": _columns(replace(path, points=section.points))},
        numbers={"n_axes": path.n_axes, "delay": path.axis_names[-1]},
        path=path.points[-N_IN_SPACE:, :3] if in_space else None,
        warnings=warnings,
    )


def _lyapunov(
    prepared: PreparedRecording,
    channel: str,
    method: Any,
    theiler: int | None,
    steps: int | None,
    fit_s: tuple[float, float] | None,
    **options: Any,
) -> MethodAnswer:
    path, *_, messages = _embedded(prepared, channel, **options)
    exponent = phase.largest_lyapunov_exponent(path, method=method, theiler_samples=theiler, n_steps=steps, fit_s=fit_s)
    return MethodAnswer(
        channel,
        "mean logarithm of the distance of neighbours over time",
        lambda: plot.divergence_figure(exponent),
        {"time (s)": exponent.times_s, "mean ln distance": exponent.log_distance},
        numbers={
            "exponent_per_s": exponent.exponent_per_s,
            "uncertainty_per_s": exponent.uncertainty_per_s,
            "verdict": exponent.verdict,
            "fit_s": list(exponent.fit_s),
        },
        notes=(
            (
                f"{exponent.n_references} pairs of neighbours, at least {exponent.theiler_samples} samples apart in "
                "time. The dashed line is the distance of unrelated points; shaded is what was fitted."
            ),
        ),
        warnings=messages,
    )


def _recurrence(
    prepared: PreparedRecording,
    channel: str,
    rate_percent: float,
    n_points: int,
    every: int | None,
    shortest: int,
    **options: Any,
) -> MethodAnswer:
    path, *_, messages = _embedded(prepared, channel, **options)
    rate = rate_percent / 100.0
    pairs = phase.recurrence_plot(path, recurrence_rate=rate, n_points=n_points, stride=every)
    measures = phase.recurrence_measures(path, recurrence_rate=rate, shortest_line=shortest, stride=every)
    numbers = {name: value for name, value in vars(measures).items() if isinstance(value, int | float)}
    first, second = np.nonzero(np.triu(pairs.recurrent))
    return MethodAnswer(
        channel,
        "recurrence plot: which points return close to each other",
        lambda: plot.recurrence_figure(pairs, measures),
        {"time (s)": pairs.times_s[first], "recurs at (s)": pairs.times_s[second]},
        numbers=numbers,
        notes=(
            (
                f"The measures are from {measures.n_points} points, {measures.duration_s:.4g} s, without pairs closer "
                f"in time than {measures.theiler_points} points. Lines along the diagonal are motion that repeats."
            ),
        ),
        warnings=messages,
    )


def _chaos_test(
    prepared: PreparedRecording,
    channel: str,
    of: str,
    damping: float,
    every: int | None,
    c_rad: float,
    pair: str,
    shaft: str,
    **options: Any,
) -> MethodAnswer:
    path, *_, messages = _embedded(prepared, channel, **options)
    if of == "section":
        section = phase.poincare_section(path, _lock(prepared, pair, shaft))
        values = np.ascontiguousarray(section.points[:, 0])
        test = phase.zero_one_test_of_section(section, damping=damping)
    else:
        values = np.ascontiguousarray(path.points[:, 0])
        test = phase.zero_one_test(values, damping=damping, every=every, source=path.source)
    walk = phase.translation_walk(values, c_rad, every=test.every)
    undecided = (f"undecided: {test.reason}",) if test.reason else ()
    return MethodAnswer(
        channel,
        "K of the 0–1 test over c, and its walk",
        lambda: plot.chaos_test_figure(test, walk, c_rad),
        {"c (rad)": test.c_rad, "K": test.k_of_c},
        tables={"walk": {"p": walk[:, 0], "q": walk[:, 1]}},
        numbers={"k": test.k, "verdict": test.verdict, "every": test.every},
        notes=(
            "K near 0: regular, a bounded walk. K near 1: chaos or noise, a walk like Brownian motion; only the false "
            "neighbours distinguish these." + (f" One in {test.every} values is used." if test.every > 1 else ""),
        ),
        warnings=(*messages, *undecided),
    )


def _kind(
    prepared: PreparedRecording, channel: str, of: str, pair: str, shaft: str, quantity: str, **options: Any
) -> MethodAnswer:
    lock = _lock(prepared, pair, shaft)
    if of == "plane":
        path = _plane(prepared, channel, options["lowest_hz"], options["highest_hz"], quantity)
    else:
        path, *_ = _embedded(prepared, channel, **options)
    kind = phase.kind_of_motion(path, lock)
    section = phase.poincare_section(path, lock)
    after = f" after {kind.period} cycles" if kind.kind == "subharmonic" else ""
    scope = {
        "plane": "displacement and velocity; integration gives slow motion more weight",
        "signal": "the signal as measured, embedded by delays",
    }[of]
    return MethodAnswer(
        channel,
        f"kind of motion: {kind.kind}{after}",
        lambda: plot.phase_portrait_figure(path, section, n_points=N_IN_SPACE),
        _columns(replace(path, points=section.points)),
        numbers={"kind": kind.kind, "period": kind.period, "evidence": list(kind.evidence), "of": of},
        facts=(f"Kind of motion: **{kind.kind}**{after}", f"Based on {scope}."),
        notes=(
            *kind.evidence,
            (
                "Measured gear vibration is periodic with noise and modulation in most cases: “stochastic” and "
                "“undecided” are then the right answers."
            ),
        ),
        warnings=_speed_messages(prepared),
    )


LOW = MethodOption(
    "lowest_hz", "Lowest frequency (Hz)", "number", None,
    "Integration amplifies slow motion. Too low, noise turns into drift; too high, slow motion is distorted.",
    unit="Hz", minimum=0.0, known=_modulation_text,
)  # fmt: skip
HIGH = MethodOption(
    "highest_hz", "Highest frequency (Hz)", "number", None,
    "A lower one shows only the slower motion, without resonances.", "0.8 of half the sampling rate", unit="Hz",
    minimum=0.0,
)  # fmt: skip
QUANTITY = MethodOption(
    "quantity", "An unnamed quantity is", "choice", "acceleration",
    "If the recording does not say what the channel measures.",
    choices=verbatim("acceleration", "velocity", "displacement"), more=True,
)  # fmt: skip
PLACE = MethodOption(
    "place", "Place in the cycle (0 to 1)", "number", 0.0,
    "Another place shows the section from another side; the kind of motion must not change.", minimum=0.0,
    maximum=1.0, more=True,
)  # fmt: skip
PLANE = (
    LOW,
    HIGH,
    PAIR,
    SHAFT,
    MethodOption(
        "revolutions", "Path drawn (revolutions)", "count", 2, "The points are from the whole part.",
        choices=verbatim(1, 2, 5, 10, 20, 50, 100),
    ),
    QUANTITY,
    PLACE,
)  # fmt: skip
EMBEDDING = (
    replace(LOW, about="", empty="all", known=None, more=True),
    replace(HIGH, about="Noise above the motion of interest hides its neighbours.", empty="all", more=True),
    MethodOption(
        "delay", "Delay (samples)", "count", None, "", "the first minimum of the mutual information", more=True,
    ),
    MethodOption(
        "dimension", "Dimension", "count", None, "", "the smallest without false neighbours", maximum=20, more=True,
    ),
)  # fmt: skip


def _row(title: str, about: str, answer: Any, *options: MethodOption) -> Method:
    return Method(title, about, answer, options, "Phase", 40_000, 200_000)


IN_PHASE = {
    "phase-plane": Method(
        "Phase plane",
        "Velocity over displacement, with a point once per mesh cycle or revolution: does the motion repeat?",
        _phase_plane,
        PLANE,
        "Phase",
        100_000,
    ),
    "poincare": Method("Poincaré section", "The motion once per mesh cycle: does it repeat?", _poincare, PLANE),
    "embedding": _row(
        "Delay and dimension",
        "The delay and the dimension that unfold the motion's path from this one channel.",
        _embedding,
        *EMBEDDING,
    ),
    "portrait": _row(
        "Portrait and section",
        "The motion's path from this one channel, embedded by delays, in the plane or in space.",
        _portrait,
        MethodOption("in_space", "Drawn in space", "switch", False),
        PAIR,
        SHAFT,
        PLACE,
        *EMBEDDING,
    ),
    "lyapunov": _row(
        "Lyapunov exponent",
        "How fast neighbouring paths diverge: the largest Lyapunov exponent.",
        _lyapunov,
        MethodOption(
            "method", "Method", "choice", "rosenstein",
            ("rosenstein: nearest neighbours; transverse: their distance across the path, for coarsely sampled "
            "signals; kantz: ten neighbours each, for noisy signals with many points"),
            choices=verbatim("rosenstein", "transverse", "kantz"),
        ),
        MethodOption("theiler", "Theiler window (samples)", "count", None, "", "one mean period"),
        MethodOption("steps", "Steps followed", "count", None, "", "30 mean periods"),
        MethodOption(
            "fit_s", "Fit from, to (s)", "span", None,
            "From where delayed values no longer overlap to where the distance nears that of unrelated points.",
            "as the curve suggests",
            unit="s",
        ),
        *EMBEDDING,
    ),
    "recurrence": _row(
        "Recurrence",
        "Which points of the path return close to each other, with measures of it.",
        _recurrence,
        MethodOption(
            "rate_percent", "Recurrence rate (%)", "number", 5.0,
            "Share of pairs that count as close; the radius follows from it.",
            choices={float(n): str(n) for n in range(1, 31)}, minimum=0.01, maximum=50.0,
        ),
        MethodOption(
            "n_points", "Points drawn", "count", 1000, choices=verbatim(200, 500, 1000, 2000, 3000),
        ),
        MethodOption("every", "Take every n-th sample", "count", None, "", "16 per mean period"),
        MethodOption("shortest", "Shortest line (points)", "count", 2, minimum=2),
        *EMBEDDING,
    ),
    "chaos-test": _row(
        "0–1 test",
        "Regular or chaotic, by the 0–1 test, and the walk it is based on.",
        _chaos_test,
        MethodOption("of", "Of the", "choice", "section", choices={"section": "Poincaré points", "signal": "signal"}),
        MethodOption(
            "damping", "Damping", "number", 1.0,
            "Keeps noise on regular motion from being read as chaos; 0 is the plain test.", minimum=0.0,
        ),
        MethodOption(
            "every", "Take every n-th sample", "count", None, "Of the signal.", "from the mutual information",
        ),
        MethodOption("c_rad", "Walk at c (rad)", "number", 1.2, minimum=0.1, maximum=3.0),
        PAIR,
        SHAFT,
        *EMBEDDING,
    ),
    "motion": _row(
        "Kind of motion",
        "Periodic, subharmonic, quasi-periodic or chaotic: by section, largest Lyapunov exponent and 0–1 test.",
        _kind,
        MethodOption(
            "of", "Asked of", "choice", "signal",
            "Displacement and velocity give slow motion more weight; the answers may differ.",
            choices={"signal": "Signal as measured", "plane": "Phase plane"},
        ),
        PAIR,
        SHAFT,
        QUANTITY,
        *EMBEDDING,
    ),
}  # fmt: skip
