"""The gap diagnosis: where recordings differ from their simulation, which effect causes it, how far it then shrinks."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import partial
from hashlib import sha256
from pathlib import Path
from typing import TypeGuard

import numpy as np

from gearsig.checks import closest_match_hint, listed, short
from gearsig.errors import GearsigError, InputError, RefusalError, answer_or_none
from gearsig.gap._attribution import (
    Attribution,
    attribute,
    likely_beside,
    with_dominant_order_counted,
    with_unknown_within_floor,
)
from gearsig.gap._conditions import Condition, Stage, conditions_of, simulated, warnings_of
from gearsig.gap._curves import angle_curves, average_curves, spectrum_curves
from gearsig.gap._evidence import evidence_of
from gearsig.gap._gearless import diagnose_gearless, place_of_unexpected, unexpected_findings, with_unexpected
from gearsig.gap._inputs import is_gearless, twin_rig, with_stage
from gearsig.gap._labelled import LabelledRecording, labelled_changes
from gearsig.gap._next_recording import next_recordings, next_steps
from gearsig.gap._places import gap_places, ranked_places, with_unchanged_races_lowered, without_multiples
from gearsig.gap._population import load_learned
from gearsig.gap._reduction import ReducedRecording
from gearsig.gap._report import (
    NAMING,
    SETTLED,
    GapCause,
    GapOutcome,
    GapPlace,
    GapReport,
    Interval,
    LabelledFacts,
    NextRecording,
    fitted_text,
    in_order,
    likeliest_first,
    most_probable_two,
    named_cause,
    named_effects,
    names_single_effect,
    unbounded_fits,
)
from gearsig.gap._simulator import CanRunUp, DriveSimulator, GapEffect, GapSimulator, Twin, as_tried
from gearsig.gap._trials import (
    PROCESSES,
    TriedEffect,
    at_recorded_tooth,
    cause_place,
    observed_changes,
    run_for_a_moment,
    start_healthy_trial,
    steps_of,
    try_effects,
)
from gearsig.gap.start_stop._diagnose import diagnose_start_stop, refuse_start_stop
from gearsig.prepared import PreparedRecording
from gearsig.processes import one_pool, start_early
from gearsig.recording import Recording, check_recording, metres_per_second_squared
from gearsig.rig import Rig
from gearsig.severity import (
    CRACK,
    TEETH_COUNT,
    CrackEstimate,
    NoCrackSeen,
    ToothErrorEvidence,
    combined_evidence,
    estimate_crack,
    has_encoders,
    tooth_error_evidence,
)

USER_EFFECT_MESSAGE = (
    "Recognition was not trained on “{title}”: it was simulated, fitted and scored on held-out data like the likeliest "
    "effects. Its probability is the share of “unknown” that its held-out shrink beyond placebos explains, and is not "
    "calibrated."
)
NOT_SIMULATED = (
    "Recognition was not trained on “{title}”, and it could not be simulated on this rig: nothing is known about it."
)

OF_THE_TWIN = (
    "The severity is the one with which the twin comes nearest, and its interval is the fit's. The path to a sensor is "
    "not known: on 19 development cases of another rig the true severity was 1 to 58 times the fitted one, with a "
    "median of 5, and within the interval in 12. Take it as an order of magnitude, more likely too small."
)
"""Measured by `tests/benchmarks/gap_severity.py 70`."""

OF_THE_WAVEFORM = (
    "The severity is the one with which the twin's waveform comes nearest; its interval is right nine times in ten "
    "where the simulator resembles the machine as closely as its own specimens resemble each other."
)

BY_THE_CRACK_ESTIMATE = (
    "The crack estimate says about {name}: {text} {depth}It looks at single teeth alone; the probability here rests on "
    "all features and on trials on the twin as well, so the two can differ."
)
NO_CRACK_ESTIMATE = (
    "The crack estimate says nothing about a crack in {name}: {reason}. The probability here rests "
    "on all features and on trials on the twin."
)
OF_THE_DEPTH = (
    "That depth is also the crack's severity here; its interval held for nine in ten of the machines it was calibrated "
    "on. "
)

NOT_NEARER = (
    "With {title} the twin comes no nearer to data that it was not fitted to: no severity is given, and no twin with "
    "the effect. The only evidence for it is recognition, from how the recordings changed."
)


@one_pool(PROCESSES)
def diagnose_gap(
    recordings: Sequence[Recording],
    simulator: GapSimulator | DriveSimulator,
    *,
    references: Sequence[Recording] = (),
    run_up: Recording | None = None,
    effects: Sequence[str] = (),
    learn: Sequence[LabelledRecording] = (),
    stage: str = "",
    cache: Path | None = None,
    fresh: bool = False,
    on_stage: Stage | None = None,
) -> GapReport:
    """Diagnose the gap between recordings of one machine and its simulation.

    A rig with bearings but no gear pair cannot be simulated: anomalies in its recordings are named if they match a
    damaged race.

    Parameters
    ----------
    recordings : sequence of Recording
        Of one rig, which each recording carries together with its operating point; several operating conditions give
        more evidence.
    simulator : GapSimulator or DriveSimulator
        For continuous running, or for starts and stops; `gearsig.gap.start_stop` describes what is then compared.
    references : sequence of Recording
        Of the same rig when healthy; each recording is compared with the one at its speed and torque.
    run_up : Recording or None
        A run-up or run-down of the same rig when healthy, with a tachometer or an encoder, through the speeds of the
        recordings; requires a reference. It measures the path that the change caused by a tooth fault takes to the
        sensors, see `gearsig.gap._path`.
    effects : sequence of str
        Effects that may be named; empty: all of the simulator's, including those from the user's own files, see
        `sims.effects.add_effect`.
    learn : sequence of LabelledRecording
        Recordings of this rig whose cause is known, or of your own simulation of it; `gearsig.gap.read_labelled` reads
        a folder of them. They add to what is known of other machines: two per effect are worth more than all other
        evidence.
    stage : str
        For a rig with several gear pairs: the pair to diagnose, by its name or that of a shaft that no other pair uses;
        the other pairs are treated as background.
    cache : Path or None
        Folder that keeps simulations and the features of labelled recordings; None: nothing is kept.
    fresh : bool
        Simulate again what the folder already holds.
    on_stage : callable or None
        Called with the current stage and the fraction completed.

    Returns
    -------
    GapReport

    Raises
    ------
    InputError
        If a recording carries no rig or is given twice, an effect does not exist, or the run-up's speed hardly varies.
    RefusalError
        If the rig's data are insufficient, there is no speed, or there are too few revolutions; or if nothing gives the
        angle along the run-up.
    """
    tell = on_stage or (lambda _what, _done: None)
    known = _effects_of(simulator)

    # 1. The inputs must be consistent, and each recording must count once.
    run_ups: Sequence[Recording] = () if run_up is None else (run_up,)
    _check(recordings, references, run_ups, effects, known)
    recordings, references = _named_apart(recordings), _named_apart(references)
    every = [*recordings, *references, *run_ups, *(item.recording for item in learn)]
    _check_distinct(every)
    rig = _check_rigs(every)
    allowed = {name: effect for name, effect in known.items() if not effects or name in effects}

    # 2. Machines that start and stop are compared by their motion, those without gears by their bearings alone.
    if isinstance(simulator, DriveSimulator):
        _refuse_further(learn, run_up, "a machine that starts and stops")
        return diagnose_start_stop(recordings, references, simulator, allowed, tell)
    refuse_start_stop(recordings, simulator.name)
    if stage or len(rig.pairs) > 1:
        rig = with_stage(rig, stage)
        recordings, references, run_ups = (
            [_on_stage(recording, stage) for recording in some] for some in (recordings, references, run_ups)
        )
        learn = [
            replace(
                item,
                recording=_on_stage(item.recording, stage),
                reference=item.reference and _on_stage(item.reference, stage),
            )
            for item in learn
        ]
    prepared, healthy = [PreparedRecording(r) for r in recordings], [PreparedRecording(r) for r in references]
    if is_gearless(rig):
        _refuse_further(learn, run_up, "a rig without gears")
        return diagnose_gearless(prepared, healthy, allowed, tell)

    # 3. Each recording is reduced to features, alongside the healthy twin at its operating point and the reference.
    alone, assumed = twin_rig(rig)
    twin, learned = simulator.twin_of(alone), load_learned()
    start_early(run_for_a_moment, twin)
    _check_user_effects(twin, set(allowed) - set(learned.causes))
    tell("reading the recordings", 0.02)
    conditions, messages = conditions_of(
        prepared,
        healthy,
        twin,
        run_up=PreparedRecording(run_ups[0]) if run_ups else None,
        tell=tell,
        learned=learned,
        on_read=lambda facts, now: start_healthy_trial(twin, facts, now),
    )
    clearest = max(conditions, key=lambda condition: condition.size.structural.value)
    recording = next(item for item in prepared if item.recording.name == clearest.facts.name)
    reference = {item.recording.name: item for item in healthy}.get(clearest.facts.reference)

    # 4. Which effect: evidence from the forests and labelled recordings, then trials of the most probable on the twin.
    tell("recognising", 0.2)
    labelled, left_out = labelled_changes(learn, healthy, conditions, twin, cache, fresh=fresh)
    encoders, encoder_messages = _encoder_evidence(conditions, recordings, references)
    with ThreadPoolExecutor(1) as executor:  # step 5 runs while other processes simulate
        unexpected_job = executor.submit(unexpected_findings, recording, healthy)
        crack_job = executor.submit(_crack_answer, recording, reference)
        attribution = attribute(
            conditions,
            known,
            effects,
            twin,
            cache,
            lambda what, done: tell(what, 0.25 + 0.55 * done),
            fresh=fresh,
            labelled=labelled,
            tooth_error_log_likelihoods={} if encoders is None else encoders.log_likelihoods,
        )
    tried, gap = attribution.tried, _places(clearest)
    probabilities = _posterior(attribution, conditions, clearest, known, gap)

    # 5. What stands out in the clearest recording by itself, whatever the features indicate.
    tell("placing it", 0.82)
    unexpected, unexpected_messages, faults = unexpected_job.result()
    outcome, unseen = with_unexpected(attribution.outcome(probabilities, known), unexpected)
    labels = _labelled_facts(attribution, conditions, clearest, known, gap)
    warnings = (*unseen, *(text for condition in conditions for text in warnings_of(condition)), *faults)

    # 6. Where the gap is; for each cause its place, severity and evidence.
    places = ranked_places(gap, [place_of_unexpected(item, recording.rig) for item in unexpected])
    crack = crack_job.result()
    causes = in_order(
        [
            _with_depth(_cause(name, p, known, tried, conditions, places), crack, tried)
            for name, p in probabilities.items()
        ],
        outcome,
    )
    named = causes[0] if outcome in NAMING else None
    fitted = None if named is None else named.fitted

    # 7. The twin with the effect, and which recordings would give more evidence.
    tell("looking for what would tell more", 0.88)
    after, next_ones = (
        (None, ()) if named is None else _after_and_next(causes, known, tried, twin, conditions, clearest)
    )

    return GapReport(
        rig=rig.name,
        simulator=simulator.name,
        conditions=tuple(c.facts for c in conditions),
        references=tuple(dict.fromkeys(c.facts.reference for c in conditions if c.facts.reference)),
        outcome=outcome,
        size=clearest.size.structural,
        repeatability=clearest.size.repeatability.value,
        places=places,
        causes=causes,
        steps=()
        if named is None or not tried
        else steps_of(
            conditions,
            tried,
            causes,
            likely_beside(causes, known, gap, clearest.now.frame),
            partial(_tried_beside, known, twin, conditions, cache, fresh=fresh),
        ),
        next_recordings=next_ones,
        spectra=spectrum_curves(
            clearest.now,
            clearest.simulated,
            after,
            structural=learned.floor(with_reference=False),
            reference=clearest.reference,
            reference_structural=learned.floor(with_reference=True) if clearest.has_reference else None,
            unit=_unit(recording.recording),
        ),
        angles=angle_curves(
            clearest.now,
            clearest.simulated,
            after,
            healthy=clearest.reference,
        ),
        averages=()
        if clearest.reference is None
        else average_curves(clearest.now, clearest.reference, unit=_unit(recording.recording)),
        notes=(
            *(() if labels is None else (labels.text,)),
            *(() if clearest.path is None else (clearest.path.facts.text,)),
            *left_out,
            *assumed,
            *messages,
            *(
                (USER_EFFECT_MESSAGE if name in tried else NOT_SIMULATED).format(title=known[name].title)
                for name in attribution.untrained
            ),
            *effects_without_setting(twin, allowed),
            *unexpected_messages,
            *_crack_messages(crack, clearest.facts.name, causes, outcome),
            *_fit_messages(named, tried, crack),
            *([TEETH_COUNT] if named is not None and named.place.startswith("tooth") else ()),
            *_waveform_messages(tried, known, clearest),
            *encoder_messages,
        ),
        twin_toml=""
        if fitted is None
        else twin.preset_toml(
            clearest.facts.point, (fitted,), (fitted_text(causes[0], fitted.severity, clearest.facts.name),)
        ),
        warnings=(*warnings, *unbounded_fits(causes, outcome)),
        labelled=labels,
        next_steps=next_steps(
            outcome,
            causes,
            [condition.facts.point for condition in conditions],
            has_reference=all(condition.has_reference for condition in conditions),
            has_encoders=has_encoders(recording.recording),
            is_labelled=labels is not None,
            has_run_up=clearest.path is not None or not isinstance(as_tried(twin), CanRunUp),
        ),
        path=None if clearest.path is None else clearest.path.facts,
    )


def _check(
    recordings: Sequence[Recording],
    references: Sequence[Recording],
    run_ups: Sequence[Recording],
    effects: Sequence[str],
    known: Mapping[str, GapEffect],
) -> None:
    for label, items in (("recordings", recordings), ("references", references), ("run_up", run_ups)):
        for place, recording in enumerate(listed(items, label, object)):
            check_recording(recording, f"{label}[{place}]")
    if not recordings:
        raise InputError("no recording is given", remedy="give one, or better several operating conditions of one rig")
    if run_ups and not references:
        raise InputError(
            "a run-up is given, but no healthy reference",
            where="run_up",
            remedy="give a healthy recording at the recordings' speed as well: the run-up tells which path that takes "
            "to the sensors which has changed since",
        )
    strange = [name for name in listed(effects, "effects", str) if name not in known]
    if strange:
        raise InputError(
            f"the simulator has no effect {strange[0]!r}",
            allowed=", ".join(known),
            remedy=closest_match_hint(strange[0], known),
        )


def _effects_of(simulator: GapSimulator | DriveSimulator) -> Mapping[str, GapEffect]:
    if not hasattr(simulator, "gap_effects"):
        remedy = "sims.registry.gap_simulator(name) returns one"
        raise InputError(f"simulator is {short(simulator)}", allowed="a GapSimulator or DriveSimulator", remedy=remedy)
    return simulator.gap_effects()


def _check_user_effects(twin: Twin, names: Iterable[str]) -> None:
    """Run user-defined effects briefly before the long work: their files may fail."""
    for name in sorted(names):
        for added in twin.candidates(name)[-1:]:
            run_for_a_moment(twin, (added,))


def _unit(recording: Recording) -> str:
    known = [metres_per_second_squared(channel) for channel in recording.channels if channel.is_vibration]
    return "" if None in known else "m/s^2"


def _named_apart(recordings: Sequence[Recording]) -> list[Recording]:
    """Number the recordings where names are repeated."""
    names = [recording.name for recording in recordings]
    if len(set(names)) == len(names):
        return list(recordings)
    return [recording.with_name(f"{recording.name} ({i})") for i, recording in enumerate(recordings, 1)]


def _check_distinct(recordings: Sequence[Recording]) -> None:
    """Refuse copies: they add no evidence, and a recording does not differ from itself."""
    by_digest: dict[bytes, str] = {}
    for recording in recordings:
        digest = sha256(np.ascontiguousarray(recording.samples).tobytes()).digest()
        if digest in by_digest:
            raise InputError(
                f"holds the same samples as {by_digest[digest]}",
                where=recording.name,
                remedy="give each recording once, in one role",
            )
        by_digest[digest] = recording.name


def _on_stage(recording: Recording, stage: str) -> Recording:
    """Return a recording whose rig has the requested pair first."""
    return replace(recording, rig=recording.rig and with_stage(recording.rig, stage))


def _labelled_facts(
    attribution: Attribution[TriedEffect],
    conditions: Sequence[Condition],
    clearest: Condition,
    known: Mapping[str, GapEffect],
    gap: Sequence[GapPlace],
) -> LabelledFacts | None:
    """Return how labelled recordings changed the result; None where there are none."""
    if attribution.labelled is None:
        return None
    without = _posterior(replace(attribution, labelled=None), conditions, clearest, known, gap)
    return LabelledFacts(attribution.labelled.counts, without, attribution.outcome(without, known))


def _refuse_further(learn: Sequence[LabelledRecording], run_up: Recording | None, machines: str) -> None:
    if run_up is not None:
        raise InputError(f"a run-up of {machines} cannot be used", where="run_up", remedy="leave it out")
    if learn:
        raise InputError(
            f"labelled recordings of {machines} cannot be used yet",
            where="learn",
            remedy="give a healthy reference instead",
        )


def _check_rigs(recordings: Sequence[Recording]) -> Rig:
    """Return the rig of the first recording; raise if any recording has none."""
    for recording in recordings:
        if recording.rig is None:
            raise InputError(
                "carries no rig", where=recording.name, remedy="read it with one, or give it one: with_rig"
            )
    return recordings[0].rig or Rig()


def effects_without_setting(twin: Twin, allowed: Mapping[str, GapEffect]) -> list[str]:
    """Return a message with the effects that have no place in the rig, such as a bearing's."""
    titles = [effect.title for name, effect in allowed.items() if not twin.candidates(name)]
    if not titles:
        return []
    message = (
        f"The rig file names nothing that {', '.join(titles)} could be in: none of it can be simulated, and any "
        "probability rests on recognition alone."
    )
    return [message]


def _waveform_messages(
    tried: Mapping[str, TriedEffect], known: Mapping[str, GapEffect], condition: Condition
) -> list[str]:
    """Return how well the twin reproduces tooth faults and the healthy machine, and what follows from that."""
    matches = {known[name].title: trial.match.correlation for name, trial in tried.items() if trial.match is not None}
    if not matches or condition.reference is None:
        return []
    missed_db = 20.0 / np.log(10.0) * condition.gain_scatter
    values = ", ".join(f"{title} {correlation:.2f}" for title, correlation in likeliest_first(matches).items())
    is_decided = any(trial.match is not None and trial.match.is_good for trial in tried.values())
    meant = "the highest is likeliest" if is_decided else "too low to separate them: the twin is not like this machine"
    message = (
        f"Correlation of the recorded change, without mesh harmonics, with that of the twin: {values}; {meant}. "
        f"Relative to each other, the mesh harmonics of the healthy twin miss those of the reference by "
        f"{missed_db:.0f} dB. Each harmonic of a fault is allowed the same error, so its waveform is "
        "weaker evidence where this is large."
    )
    return [message]


def _encoder_evidence(
    conditions: Sequence[Condition], recordings: Sequence[Recording], references: Sequence[Recording]
) -> tuple[ToothErrorEvidence | None, list[str]]:
    """Return the evidence from encoders at all conditions with a reference, and what they show or why nothing."""
    of_name, reference_of_name = ({one.name: one for one in several} for several in (recordings, references))
    refusals: list[str] = []
    evidences = []
    for condition in conditions:
        if condition.facts.reference:
            both = of_name[condition.facts.name], reference_of_name[condition.facts.reference]
            frame = condition.now.frame
            ask = partial(tooth_error_evidence, *both, pair=frame.pair.name)
            evidence = answer_or_none(ask, condition.facts.name, refusals)
            if evidence is not None:
                evidences.append(evidence.with_load(condition.tooth_load_n_per_mm, frame.teeth))
    together = combined_evidence(evidences)
    shown = [] if together is None else [together.text]
    return together, [*shown, *(f"No evidence from the encoders: {refusal}." for refusal in refusals)]


def _fit_messages(named: GapCause | None, tried: Mapping[str, TriedEffect], crack: CrackAnswer) -> list[str]:
    """Return how reliable the stated severity is; nothing for a crack whose depth was estimated."""
    if named is None or (named.name == CRACK and _is_depth(crack)):
        return []
    if named.name in tried and tried[named.name].is_shown:
        return [OF_THE_WAVEFORM]
    nearer = [OF_THE_TWIN] if named.severity is not None and not named.severity.is_unbounded else []
    return [*nearer, *([NOT_NEARER.format(title=named.title)] if not named.fitted and named.shrinkage else [])]


def _posterior(
    attribution: Attribution[TriedEffect],
    conditions: Sequence[Condition],
    clearest: Condition,
    known: Mapping[str, GapEffect],
    gap: Sequence[GapPlace],
) -> dict[str, float]:
    """Return cause → probability, including evidence from the whole gap, its places and lines."""
    posterior = with_unknown_within_floor(attribution.probabilities(), clearest.size.structural)
    posterior = without_multiples(with_unchanged_races_lowered(posterior, conditions), known, conditions)
    return with_dominant_order_counted(posterior, known, gap, clearest.now.frame)


def _places(condition: Condition) -> tuple[GapPlace, ...]:
    try:
        return gap_places(condition)
    except RefusalError:
        return ()


def _cause(
    name: str,
    probability: float,
    known: Mapping[str, GapEffect],
    tried: Mapping[str, TriedEffect],
    conditions: Sequence[Condition],
    places: Sequence[GapPlace],
) -> GapCause:
    if name not in known:
        return named_cause(name, probability, known)
    trial = tried.get(name)
    placing = trial if trial is not None and trial.explains else None
    cause = named_cause(name, probability, known, cause_place(name, placing, conditions, places))
    if trial is None:
        return cause
    frame = conditions[0].now.frame
    return replace(
        cause,
        severity=None if placing is None else placing.severity,
        fitted=None if placing is None else at_recorded_tooth(placing.added, frame, places),
        shrinkage=trial.shrinkage,
        evidence=evidence_of(trial.fit, observed_changes(conditions), frame),
    )


CrackAnswer = CrackEstimate | NoCrackSeen | GearsigError
"""The answer of `gearsig crack`, or the reason why there is none."""


def _crack_answer(recording: PreparedRecording, reference: PreparedRecording | None) -> CrackAnswer:
    """Return the answer of `gearsig crack` for the same files."""
    try:
        return estimate_crack(recording, reference=reference)
    except GearsigError as error:
        return error


def _is_depth(crack: CrackAnswer) -> TypeGuard[CrackEstimate]:
    return isinstance(crack, CrackEstimate) and crack.with_reference


def _with_depth(cause: GapCause, crack: CrackAnswer, tried: Mapping[str, TriedEffect]) -> GapCause:
    """Return a cause; for a crack, with the depth that `estimate_crack` measures.

    A fit to the twin depends on the path to a sensor; the estimate compares the cracked tooth with the mesh.
    """
    if cause.name != CRACK or CRACK not in tried or not _is_depth(crack):
        return cause
    simulated_mm = [float(path.severities[-1]) for path in tried[CRACK].paths]
    fitted = cause.fitted
    if fitted is not None and crack.depth_mm <= max(simulated_mm, default=0.0):
        fitted = replace(fitted, severity=crack.depth_mm)
    return replace(cause, severity=Interval(crack.depth_mm, *crack.interval_mm), fitted=fitted)


def _crack_messages(crack: CrackAnswer, name: str, causes: Sequence[GapCause], outcome: GapOutcome) -> list[str]:
    """Return the answer of `gearsig crack` for the same files, if it sees damage or if a crack is named here.

    Users of both commands learn why the two differ.
    """
    if not isinstance(crack, CrackEstimate) and CRACK not in named_effects(causes, outcome):
        return []
    if isinstance(crack, GearsigError):
        return [NO_CRACK_ESTIMATE.format(name=name, reason=getattr(crack, "reason", crack))]
    has_depth = any(c.name == CRACK and c.severity is not None and c.probability >= SETTLED for c in causes)
    depth = OF_THE_DEPTH if has_depth and _is_depth(crack) else ""
    return [BY_THE_CRACK_ESTIMATE.format(name=name, text=crack.text, depth=depth)]


def _tried_beside(
    known: Mapping[str, GapEffect],
    twin: Twin,
    conditions: Sequence[Condition],
    cache: Path | None,
    name: str,
    *,
    fresh: bool,
) -> TriedEffect | None:
    """Try one more effect; None where the rig has no place for it or it cannot be simulated there."""
    try:
        return try_effects([known[name]], twin, conditions, cache, lambda *_: None, fresh=fresh).get(name)
    except RefusalError:
        return None


def _after_and_next(
    causes: Sequence[GapCause],
    known: Mapping[str, GapEffect],
    tried: Mapping[str, TriedEffect],
    twin: Twin,
    conditions: Sequence[Condition],
    clearest: Condition,
) -> tuple[ReducedRecording | None, tuple[NextRecording, ...]]:
    """Compute the twin with the most probable effect as fitted, and the next recordings, at the same time."""
    fitted, pair = causes[0].fitted, most_probable_two(causes)
    next_ones: tuple[NextRecording, ...] = ()
    with ThreadPoolExecutor(1) as executor:
        after = executor.submit(simulated, twin, clearest.facts, clearest.now, (fitted,)) if fitted else None
        if pair is not None and not names_single_effect(causes) and all(name in tried for name in pair):
            (first, second), titles = (tried[name] for name in pair), (known[pair[0]].title, known[pair[1]].title)
            next_ones = next_recordings(first, second, titles, twin, conditions)
    return (after.result() if after else None), next_ones
