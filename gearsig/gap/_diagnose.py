"""The gap diagnosis: where recordings differ from their simulation, which effect causes it, how far it shrinks then."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from itertools import combinations
from pathlib import Path

import numpy as np

from gearsig.checks import closest_match_hint
from gearsig.errors import InputError, RefusalError
from gearsig.gap._attribution import attribute, is_calibrated
from gearsig.gap._conditions import (
    Condition,
    Stage,
    conditions_of,
    numbered,
    prepare_recordings,
    simulated,
    warnings_of,
)
from gearsig.gap._curves import angle_curves, average_curves, spectrum_curves
from gearsig.gap._evidence import evidence_of
from gearsig.gap._floors import load_population
from gearsig.gap._gearless import beside_standing, diagnose_gearless, standing_place, stood_out
from gearsig.gap._next_recording import next_recordings
from gearsig.gap._places import gap_places, ranked_places
from gearsig.gap._simulator import Added, DriveSimulator, GapEffect, GapSimulator, Twin
from gearsig.gap._trials import TriedEffect, at_its_tooth, cause_place, observed_changes, steps_of
from gearsig.gap._types import (
    NAMING,
    GapCause,
    GapOutcome,
    GapPlace,
    GapReport,
    NextRecording,
    group_probabilities,
)
from gearsig.gap._verdict import in_order, likeliest_two, named_cause, rivals
from gearsig.gap._words import fitted_words
from gearsig.gap.start_stop._diagnose import diagnose_start_stop, drive_report, refuse_start_stop
from gearsig.recording import Recording, metres_per_second_squared
from gearsig.rig import Bearing, GearPair, Rig

# --------------------
# Whether a rig file says enough for a gap diagnosis, and in which of its two ways it can be diagnosed.
# --------------------


EXAMPLE = "`gearsig rig example` prints a file to start from"


def is_gearless(rig: Rig) -> bool:
    """Return whether the rig has bearings only, so that there is nothing to set a simulator to.

    Raises
    ------
    RefusalError
        If the rig's data suffice neither for a simulation nor for a search for the bearings, with all that is missing.
    """
    if rig.pairs:
        _check_teeth(rig)
        return False
    if not rig.bearings:
        raise RefusalError(
            "the rig file describes neither a gear pair nor a bearing: there is nothing to set a simulator to, and "
            "nothing to look for",
            remedy=f"describe the gear pair (teeth, module) or the bearings (geometry or orders); {EXAMPLE}",
        )
    if not known_bearings(rig):
        names = ", ".join(repr(bearing.name) for bearing in rig.bearings)
        raise RefusalError(
            f"the rig has no gear pair, and of no bearing ({names}) the orders and the speed of its shaft are known",
            remedy="give the bearings' geometry or orders, on the shaft whose speed is known",
        )
    return True


def known_bearings(rig: Rig) -> tuple[Bearing, ...]:
    """Return the bearings whose orders per revolution of the reference shaft are known."""
    return tuple(b for b in rig.bearings if b.orders() and rig.ratio(b.shaft) is not None)


def _check_teeth(rig: Rig) -> None:
    missing = [f"{' and '.join(names)} of pair {pair.name!r}" for pair in rig.pairs if (names := _unknown(pair))]
    if all(pair.driver_teeth and pair.driven_teeth for pair in rig.pairs):
        return  # what else a simulator needs, it says itself
    several = f"; the rig has {len(rig.pairs)} gear pairs, and the simulators have one" if len(rig.pairs) > 1 else ""
    raise RefusalError(
        f"the rig data are missing that a simulation needs: {', '.join(missing)}{several}",
        remedy="complete the rig file; `gearsig analyze` says what can be said without them",
    )


def _unknown(pair: GearPair) -> list[str]:
    gears = [name for name, teeth in (("driver", pair.driver_teeth), ("driven", pair.driven_teeth)) if teeth is None]
    teeth = {0: [], 1: [f"teeth of the {' '.join(gears)} gear"], 2: ["teeth of both gears"]}[len(gears)]
    return [*teeth, *(["module"] if pair.module_mm is None else [])]


UNCALIBRATED = (
    "The probabilities are not calibrated on blind cases yet, and how often they are right has not been measured: "
    "take them as a ranking only."
)

OWN_EFFECT = (
    "The recognition has never seen “{title}”: it was simulated, fitted and scored on held-out data like the likeliest "
    "effects. Its probability is the share of “unknown” that its held-out shrink beyond placebos explains, and is not "
    "calibrated."
)
NOT_SIMULATED = (
    "The recognition has never seen “{title}”, and it could not be simulated on this rig: nothing is said of it."
)

OF_THE_TWIN = (
    "The severity is the one with which the twin comes nearest, and its interval is the fit's. The path to a sensor is "
    "not known: on 19 development cases of another rig the true severity was 1 to 58 times the fitted one, in the "
    "middle 5 times, and within the interval in 12. Take it for an order of magnitude, rather too small."
)
"""By `tests/benchmarks/gap_severity.py 70`."""

NOT_NEARER = (
    "With {title} the twin comes no nearer to data that it was not fitted to: no severity is given, and no twin with "
    "the effect. What speaks for it is how the recordings changed, by recognition alone."
)


def diagnose_gap(
    recordings: Sequence[Recording],
    simulator: GapSimulator | DriveSimulator,
    *,
    rigs: Sequence[Rig] = (),
    references: Sequence[Recording] = (),
    reference_rigs: Sequence[Rig] = (),
    effects: Sequence[str] = (),
    names: Sequence[str] = (),
    reference_names: Sequence[str] = (),
    cache: Path | None = None,
    fresh: bool = False,
    on_stage: Stage | None = None,
) -> GapReport:
    """Diagnose the gap between recordings of one machine and its simulation.

    A rig with bearings and no gear pair cannot be simulated: what stands out of its recordings is named where it is a
    damaged race, see `gearsig.gap`.

    Parameters
    ----------
    recordings : sequence of Recording
        Of one rig; several operating conditions tell more.
    simulator : GapSimulator or DriveSimulator
        Of running that goes on, or of starts and stops: what is compared is told in `gearsig.gap.start_stop`.
    rigs : sequence of Rig
        One per recording, with its operating point; empty: those that the recordings carry.
    references : sequence of Recording
        Of the same rig when it was healthy; each recording is compared with the one at its speed and torque.
    reference_rigs : sequence of Rig
    effects : sequence of str
        Which effects may be named; empty: all that the simulator has, those of the user's own files included, see
        `sims.effects.add_effect`.
    names, reference_names : sequence of str
        Of the recordings and references, for people.
    cache : Path or None
        Folder that keeps simulations; None: nothing is kept.
    fresh : bool
        Simulate anew what the folder holds already.
    on_stage : callable or None
        Is told what is being done, and which share of the whole is complete.

    Returns
    -------
    GapReport

    Raises
    ------
    InputError
        If the lists do not fit each other or an effect does not exist.
    RefusalError
        If the rig's data do not suffice, there is no speed, or too few revolutions.
    """
    tell = on_stage or (lambda _what, _done: None)
    known = simulator.gap_effects()

    # 1. What is given must fit together, and each recording count once.
    _check(recordings, names, effects, known)
    own_names = tuple(names) or numbered("recording", recordings)
    healthy_names = tuple(reference_names) or numbered("reference", references)
    _check_distinct([*recordings, *references], [*own_names, *healthy_names])
    own_rigs, healthy_rigs = _rigs(recordings, rigs), _rigs(references, reference_rigs)
    allowed = {name: effect for name, effect in known.items() if not effects or name in effects}

    # 2. Machines that start and stop are compared by their motion, those without gears by their bearings alone.
    if isinstance(simulator, DriveSimulator):
        return drive_report(
            diagnose_start_stop(
                recordings, own_rigs, references, healthy_rigs, simulator, allowed, own_names, healthy_names, tell
            )
        )
    refuse_start_stop(recordings, own_rigs, own_names, simulator.name)
    prepared, healthy = prepare_recordings(recordings, own_rigs), prepare_recordings(references, healthy_rigs)
    if is_gearless(own_rigs[0]):
        return diagnose_gearless(prepared, healthy, own_names, healthy_names, allowed, tell)

    # 3. Each recording is reduced to features, beside the healthy twin at its point and the reference.
    twin, population = simulator.twin_of(own_rigs[0]), load_population()
    _check_own(twin, set(allowed) - set(population.causes))
    tell("reading the recordings", 0.02)
    conditions, notices = conditions_of(
        prepared, healthy, twin, names=own_names, reference_names=healthy_names, tell=tell, population=population
    )
    clearest = max(conditions, key=lambda condition: condition.size.structural.value)
    recording = prepared[conditions.index(clearest)]

    # 4. Which effect: what the forests say, and of the likeliest what trials on the twin say.
    tell("recognising", 0.2)
    attribution = attribute(
        conditions, known, effects, twin, cache, lambda what, done: tell(what, 0.25 + 0.55 * done), fresh=fresh
    )
    tried, probabilities = attribution.tried, attribution.probabilities()

    # 5. What stands out of the clearest recording by itself, whatever the features say.
    tell("placing it", 0.82)
    standing, remarks, faults = stood_out(recording, healthy, clearest.facts.name)
    outcome, unseen = beside_standing(attribution.calibration.outcome(probabilities), standing)
    warnings = (*unseen, *(text for condition in conditions for text in warnings_of(condition)), *faults)

    # 6. Where, and of each cause where it sits, how severe it is and what speaks for it.
    places = ranked_places(_places(clearest), [standing_place(one, recording.rig) for one in standing])
    causes = in_order([_cause(name, p, known, tried, conditions, places) for name, p in probabilities.items()], outcome)
    named = causes[0] if outcome in NAMING else None
    fitted = None if named is None else named.fitted
    after = None if fitted is None else simulated(twin, clearest.facts, clearest.now, (fitted,))

    # 7. What would tell more.
    tell("looking for what would tell more", 0.88)
    next_ones = () if named is None else _next(causes, known, tried, twin, conditions)

    uncalibrated = () if is_calibrated() else (UNCALIBRATED,)
    reference = clearest.reference
    return GapReport(
        rig=own_rigs[0].name,
        simulator=simulator.name,
        conditions=tuple(c.facts for c in conditions),
        references=tuple(dict.fromkeys(c.facts.reference for c in conditions if c.facts.reference)),
        outcome=outcome,
        size=clearest.size.structural,
        repeatability=clearest.size.repeatability.value,
        places=places,
        causes=causes,
        groups=group_probabilities(causes),
        inseparable=rivals(causes) if outcome is GapOutcome.CANNOT_SEPARATE else None,
        steps=steps_of(conditions, tried, causes) if tried and named is not None else (),
        next_recordings=next_ones,
        spectra=spectrum_curves(
            clearest.now,
            clearest.simulated,
            after,
            structural=population.simulation_floor,
            reference=reference,
            reference_structural=None if reference is None else population.reference_floor,
            unit=_unit(recording.recording),
        ),
        angles=angle_curves(
            clearest.now,
            clearest.simulated,
            after,
            healthy=reference,
            simulated_healthy=clearest.simulated if reference is not None else None,
        ),
        averages=() if reference is None else average_curves(clearest.now, reference, unit=_unit(recording.recording)),
        notices=(
            *uncalibrated,
            *notices,
            *(
                (OWN_EFFECT if name in tried else NOT_SIMULATED).format(title=known[name].title)
                for name in attribution.unheard_of
            ),
            *_without_place(twin, allowed),
            *remarks,
            *_of_the_fit(named),
        ),
        twin_toml="" if fitted is None else _preset(twin, clearest, causes[0], fitted),
        warnings=warnings,
    )


def _check(
    recordings: Sequence[Recording], names: Sequence[str], effects: Sequence[str], known: Mapping[str, GapEffect]
) -> None:
    if not recordings:
        raise InputError("no recording is given", remedy="give one, or better several operating conditions of one rig")
    if names and len(names) != len(recordings):
        raise InputError(f"{len(names)} names for {len(recordings)} recordings", allowed="one each")
    strange = [name for name in effects if name not in known]
    if strange:
        raise InputError(
            f"the simulator has no effect {strange[0]!r}",
            allowed=", ".join(known),
            remedy=closest_match_hint(strange[0], known),
        )


def _check_own(twin: Twin, names: Iterable[str]) -> None:
    """Run effects that are somebody's own for a moment, before the long work: their files may fail."""
    for name in sorted(names):
        for added in twin.candidates(name)[-1:]:
            twin.run(twin.point, (added,), seed=0, duration_s=0.05, sampling_rate_hz=20480.0)


def _unit(recording: Recording) -> str:
    known = [metres_per_second_squared(channel) for channel in recording.channels if channel.is_vibration]
    return "" if None in known else "m/s^2"


def _check_distinct(recordings: Sequence[Recording], names: Sequence[str]) -> None:
    """Refuse copies: they tell nothing more, and a recording does not differ from itself."""
    for (one, name), (other, other_name) in combinations(zip(recordings, names, strict=True), 2):
        if np.array_equal(one.samples, other.samples):
            raise InputError(
                f"holds the same samples as {name}", where=other_name, remedy="give each recording once, in one role"
            )


def _rigs(recordings: Sequence[Recording], rigs: Sequence[Rig]) -> tuple[Rig, ...]:
    if rigs:
        if len(rigs) != len(recordings):
            raise InputError(f"{len(rigs)} rigs for {len(recordings)} recordings", allowed="one each")
        if any(
            r.rig is not None and r.rig.sensors not in ((), rig.sensors)
            for r, rig in zip(recordings, rigs, strict=True)
        ):
            raise InputError(
                "a recording carries a rig with other sensors than the one given for it",
                remedy="read its file again with that rig",
            )
        return tuple(rigs)
    found = tuple(r.rig for r in recordings)
    if any(rig is None for rig in found):
        raise InputError("a recording carries no rig", remedy="give rigs, one for each recording")
    return tuple(rig for rig in found if rig is not None)


def _without_place(twin: Twin, allowed: Mapping[str, GapEffect]) -> list[str]:
    """Name the effects that the rig has no place for, a bearing, say."""
    titles = [effect.title for name, effect in allowed.items() if not twin.candidates(name)]
    if not titles:
        return []
    remark = (
        f"The rig file names nothing that {', '.join(titles)} could be in: none of it can be simulated, and any "
        "probability rests on recognition alone."
    )
    return [remark]


def _of_the_fit(named: GapCause | None) -> list[str]:
    """Say what the fitted severity is worth, or that there is none."""
    if named is None:
        return []
    nearer = [OF_THE_TWIN] if named.severity is not None else []
    return [*nearer, *([NOT_NEARER.format(title=named.title)] if not named.fitted and named.shrinkage else [])]


def _places(condition: Condition) -> tuple[GapPlace, ...]:
    try:
        return gap_places(
            condition.now,
            condition.other,
            condition.floor,
            is_reference=condition.reference is not None,
            change=condition.change,
        )
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
        severity=None if placing is None else placing.fit.severity,
        fitted=None if placing is None else at_its_tooth(placing.fit.added, frame, places),
        shrinkage=trial.shrinkage,
        evidence=evidence_of(trial.fit, observed_changes(conditions), frame),
    )


def _preset(twin: Twin, condition: Condition, cause: GapCause, fitted: Added) -> str:
    note = fitted_words(cause, fitted.severity, condition.facts.name)
    return twin.preset_toml(condition.facts.point, (fitted,), (note,))


def _next(
    causes: Sequence[GapCause],
    known: Mapping[str, GapEffect],
    tried: Mapping[str, TriedEffect],
    twin: Twin,
    conditions: Sequence[Condition],
) -> tuple[NextRecording, ...]:
    pair = likeliest_two(causes)
    if pair is None or any(name not in tried for name in pair):
        return ()
    first, second = pair
    return next_recordings(tried[first], tried[second], (known[first].title, known[second].title), twin, conditions)
