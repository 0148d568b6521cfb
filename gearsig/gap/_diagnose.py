"""The gap diagnosis: where recordings differ from their simulation, which effect causes it, how far it shrinks then."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import combinations
from pathlib import Path

import numpy as np

from gearsig.checks import closest_match_hint
from gearsig.errors import InputError, RefusalError
from gearsig.gap._attribution import attribute, is_calibrated
from gearsig.gap._conditions import Condition, Stage, conditions_of, doubts_of, observed, simulated
from gearsig.gap._curves import angle_curves, average_curves, spectrum_curves
from gearsig.gap._evidence import evidence_of
from gearsig.gap._floors import load_population
from gearsig.gap._gearless import beside_standing, diagnose_gearless, standing_place, stood_out
from gearsig.gap._next_recording import next_recordings
from gearsig.gap._places import gap_places, ranked_places
from gearsig.gap._simulator import Added, DriveSimulator, GapEffect, GapSimulator, Twin
from gearsig.gap._trials import TriedEffect, at_its_tooth, cause_place, n_compared, steps_of
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
MOMENT_S, MOMENT_HZ = 0.05, 20480.0
"""Of a run that only shows whether an effect runs."""

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
    _check(recordings, names, effects, known)
    called = tuple(reference_names) or _numbered("reference", references)
    _check_distinct([*recordings, *references], [*(names or _numbered("recording", recordings)), *called])
    own_rigs, other_rigs = _rigs(recordings, rigs), _rigs(references, reference_rigs)
    if isinstance(simulator, DriveSimulator):
        allowed = {name: effect for name, effect in known.items() if not effects or name in effects}
        shown = tuple(names) or _numbered("recording", recordings)
        return drive_report(
            diagnose_start_stop(recordings, own_rigs, references, other_rigs, simulator, allowed, shown, called, tell)
        )
    refuse_start_stop(recordings, own_rigs, names or _numbered("recording", recordings), simulator.name)
    if is_gearless(own_rigs[0]):
        allowed = {name: effect for name, effect in known.items() if not effects or name in effects}
        return diagnose_gearless(recordings, own_rigs, references, other_rigs, names, called, allowed, tell)
    twin = simulator.twin_of(own_rigs[0])
    _check_own(twin, effects or tuple(known))
    tell("reading the recordings", 0.02)
    conditions, notices = conditions_of(recordings, own_rigs, references, other_rigs, twin, names, tell, called)
    if not is_calibrated():
        notices.insert(0, UNCALIBRATED)
    tell("recognising", 0.2)
    weighed = attribute(
        conditions, known, effects, twin, cache, lambda what, done: tell(what, 0.25 + 0.55 * done), fresh=fresh
    )
    tried, probabilities = weighed.tried, weighed.probabilities()
    notices += [
        (OWN_EFFECT if name in tried else NOT_SIMULATED).format(title=known[name].title) for name in weighed.unheard_of
    ]
    notices += _without_meaning(twin, known, effects)
    tell("placing it", 0.82)
    clearest = max(conditions, key=lambda condition: condition.size.structural.value)
    k = conditions.index(clearest)
    standing, remarks, faults = stood_out(recordings[k], own_rigs[k], references, other_rigs, clearest.facts.name)
    notices += remarks
    outcome, unseen = beside_standing(weighed.calibration.outcome(probabilities), standing)
    doubts = (*unseen, *(text for condition in conditions for text in doubts_of(condition)), *faults)
    places = ranked_places(_places(clearest), [standing_place(one, own_rigs[k]) for one in standing])
    causes = tuple(_cause(name, p, known, tried, conditions, places) for name, p in probabilities.items())
    causes = in_order(causes, outcome)
    fitted = causes[0].fitted if outcome in NAMING else None
    if outcome in NAMING and causes[0].severity is not None:
        notices.append(OF_THE_TWIN)
    if outcome in NAMING and fitted is None and causes[0].shrinkage is not None:
        notices.append(NOT_NEARER.format(title=causes[0].title))
    after = None if fitted is None else simulated(twin, clearest.facts, clearest.now, (fitted,))
    tell("looking for what would tell more", 0.88)
    pair = likeliest_two(causes)
    size = clearest.size
    reference = clearest.reference
    return GapReport(
        rig=own_rigs[0].name,
        simulator=simulator.name,
        conditions=tuple(c.facts for c in conditions),
        references=tuple(dict.fromkeys(c.facts.reference for c in conditions if c.facts.reference)),
        outcome=outcome,
        size=size.structural,
        repeatability=size.repeatability.value,
        places=places,
        causes=causes,
        groups=group_probabilities(causes),
        inseparable=rivals(causes) if outcome is GapOutcome.CANNOT_SEPARATE else None,
        steps=steps_of(conditions, tried, causes) if tried and outcome in NAMING else (),
        next_recordings=_next(pair, known, tried, twin, conditions, outcome),
        spectra=spectrum_curves(
            clearest.now,
            clearest.simulated,
            after,
            structural=load_population().floor(with_reference=False),
            reference=reference,
            reference_structural=None if reference is None else load_population().floor(with_reference=True),
            unit=_unit(recordings[k]),
        ),
        angles=angle_curves(
            clearest.now,
            clearest.simulated,
            after,
            sound=reference,
            simulated_sound=clearest.simulated if reference is not None else None,
        ),
        averages=() if reference is None else average_curves(clearest.now, reference, unit=_unit(recordings[k])),
        notices=tuple(notices),
        twin_toml="" if fitted is None else _preset(twin, clearest, causes[0], fitted),
        doubts=doubts,
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


def _check_own(twin: Twin, names: Sequence[str]) -> None:
    """Run effects that are somebody's own for a moment, before the long work: their files may fail."""
    for name in sorted(set(names) - set(load_population().causes)):
        for added in twin.candidates(name)[-1:]:
            twin.run(twin.point, (added,), seed=0, duration_s=MOMENT_S, sampling_rate_hz=MOMENT_HZ)


def _unit(recording: Recording) -> str:
    known = [metres_per_second_squared(channel) for channel in recording.channels if channel.is_vibration]
    return "" if None in known else "m/s^2"


def _numbered(what: str, recordings: Sequence[Recording]) -> tuple[str, ...]:
    return tuple(f"{what} {i + 1}" for i in range(len(recordings)))


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


def _without_meaning(twin: Twin, known: Mapping[str, GapEffect], effects: Sequence[str]) -> list[str]:
    """Name the effects that the rig has no place for, a bearing, say."""
    titles = [known[name].title for name in effects or known if not twin.candidates(name)]
    if not titles:
        return []
    remark = (
        f"The rig file names nothing that {', '.join(titles)} could be in: none of it can be simulated, and any "
        "probability rests on recognition alone."
    )
    return [remark]


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
    tried: dict[str, TriedEffect],
    conditions: Sequence[Condition],
    places: Sequence[GapPlace],
) -> GapCause:
    if name not in known:
        return named_cause(name, probability, known)
    one = tried.get(name)
    place = cause_place(name, one if one is not None and one.explains else None, conditions, places)
    base = named_cause(name, probability, known, place)
    if one is None:
        return base
    n = n_compared(conditions)
    seen = [observed(c, k, n) for k, c in enumerate(conditions)]
    frame = conditions[0].now.frame
    if one.explains:
        base = replace(base, severity=one.fit.severity, fitted=at_its_tooth(one.fit.added, frame, places))
    return replace(
        base,
        shrinkage=one.shrinkage,
        evidence=evidence_of(one.fit, seen, frame),
    )


def _preset(twin: Twin, condition: Condition, cause: GapCause, fitted: Added) -> str:
    note = fitted_words(cause, fitted.severity, condition.facts.name)
    return twin.preset_toml(condition.facts.point, (fitted,), (note,))


def _next(
    pair: tuple[str, str] | None,
    known: Mapping[str, GapEffect],
    tried: dict[str, TriedEffect],
    twin: Twin,
    conditions: Sequence[Condition],
    outcome: GapOutcome,
) -> tuple[NextRecording, ...]:
    if pair is None or outcome not in NAMING or any(name not in tried for name in pair):
        return ()
    first, second = pair
    return next_recordings(tried[first], tried[second], (known[first].title, known[second].title), twin, conditions)
