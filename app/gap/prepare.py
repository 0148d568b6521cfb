"""Recordings, references and the twin, reduced and set beside each other."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from app.gap.conditions import Condition, Healthy, compare, facts_of, matching_reference, simulated
from app.gap.doubts import strange_pattern, strange_teeth
from gearsig.errors import RefusalError
from gearsig.gap.floors import gap_size
from gearsig.gap.gather import gather
from gearsig.gap.gathered import Gathered
from gearsig.gap.population import load_population
from gearsig.gap.simulator import Twin
from gearsig.gap.types import ConditionFacts
from gearsig.recording.si_units import metres_per_second_squared
from gearsig.recording.types import Recording
from gearsig.rig.types import Rig

CLEAR_WITHOUT = 3.0
"""Structural floors from which a reference that far from the simulator is worth a remark."""

LARGEST_DRIFT = 0.4
"""Of the speed over a record, relative: more is a run-up; effects that let the speed wander stay far below."""

Stage = Callable[[str, float], object]


def conditions_of(
    recordings: Sequence[Recording],
    rigs: Sequence[Rig],
    references: Sequence[Recording],
    reference_rigs: Sequence[Rig],
    twin: Twin,
    names: Sequence[str],
    tell: Stage,
    reference_names: Sequence[str] = (),
) -> tuple[list[Condition], list[str]]:
    """Return the conditions, and what is worth a remark.

    Raises
    ------
    RefusalError
        If a speed cannot be known or there are too few revolutions: in a recording, or in every reference.
    """
    found: list[Condition] = []
    notices: list[str] = []
    called = reference_names or [f"reference {i + 1}" for i in range(len(references))]
    healthy = _references(references, reference_rigs, called, notices)
    for i, (recording, rig) in enumerate(zip(recordings, rigs, strict=True)):
        name = names[i] if names else f"recording {i + 1}"
        tell(f"simulating the sound machine at the point of {name}", 0.05 + 0.15 * i / len(recordings))
        now = _gathered(recording, rig, name, notices)
        notices += strange_teeth(now, name)
        facts = facts_of(recording, rig, now, name, twin)
        notices += _assumed(recording, rig, facts)
        match, why = matching_reference(now, rig, healthy)
        if why:
            notices.append(f"{name} is compared with the simulation: {why}.")
        reference = None if match is None else match.gathered
        if match is not None:
            facts = replace(facts, reference=match.name)
            now = _with_channels_of(now, match.gathered, healthy, name, notices)
        _check_steady(now, reference, name)
        simulation = simulated(twin, facts, now)
        change = compare(now, simulation, reference)
        found.append(Condition(facts, now, simulation, reference, change))
        if reference is not None:
            notices += strange_pattern(now, reference, name)
            notices += _strange_reference(reference, simulation, name)
    if not references:
        notices.append("No healthy reference: a recording of the same rig when it was sound would make it much surer.")
    return found, notices


def _with_channels_of(
    now: Gathered, reference: Gathered, healthy: Sequence[Healthy], name: str, notices: list[str]
) -> Gathered:
    """Return a recording with the channels that its reference has as well, and say what was made of the others."""
    if not any(set(reference.channels) & set(one.gathered.channels) for one in healthy):
        notices.append(f"{name}: its only channel is taken for the reference's only one, which has another name.")
    left_out = [channel for channel in now.channels if channel not in reference.channels]
    if left_out:
        notices.append(f"{name}: {', '.join(left_out)} is left out, for the reference has no such channel.")
    return now.with_channels({channel: now.channels[channel] for channel in reference.channels})


def _check_steady(now: Gathered, reference: Gathered | None, name: str) -> None:
    """Refuse a run-up, but beside one of the reference's: the simulation is at one speed."""
    drift, usual = now.speed[0], 0.0 if reference is None else reference.speed[0]
    if abs(drift - usual) > LARGEST_DRIFT:
        start, end = (60.0 * now.speed_hz * (1.0 + half * drift) for half in (-0.5, 0.5))
        raise RefusalError(
            f"{name}: the speed goes from about {start:.0f} to {end:.0f} rpm; the simulation it is compared with is at "
            "one speed",
            remedy="cut out parts at steady speed and give them as operating conditions, or give a reference of the "
            "same run",
        )


def _references(
    references: Sequence[Recording], rigs: Sequence[Rig], names: Sequence[str], notices: list[str]
) -> list[Healthy]:
    """Reduce the references; one of several that cannot be read is left out, and said."""
    healthy: list[Healthy] = []
    for recording, rig, name in zip(references, rigs, names, strict=True):
        try:
            healthy.append(Healthy(_gathered(recording, rig, name, notices), rig, name))
        except RefusalError as refusal:
            if not healthy and recording is references[-1]:
                raise
            notices.append(f"{refusal.reason}; this reference is left out.")
            continue
        notices += strange_teeth(healthy[-1].gathered, name)
    return healthy


def _gathered(recording: Recording, rig: Rig, name: str, notices: list[str]) -> Gathered:
    """Reduce a recording without its dead channels; a refusal names the recording."""
    from gearsig.recording.quality import find_problems

    dead = {p.channel: p for p in find_problems(recording) if p.kind == "dead"}
    live = [channel for channel in recording.vibration_names() if channel not in dead]
    if not live:
        seen = "; ".join(f"{p.channel}: {p.evidence}" for p in dead.values()) or "there is none"
        raise RefusalError(f"{name}: no vibration channel is live ({seen})", remedy="check sensors, cables and inputs")
    try:
        found = gather(_in_si(recording, live, name, notices), rig, live)
    except RefusalError as refusal:
        raise RefusalError(f"{name}: {refusal.reason}", remedy=refusal.remedy) from None
    notices += [f"{name}: channel {p.channel} is dead ({p.evidence}) and left out." for p in dead.values()]
    return found


def _in_si(recording: Recording, live: Sequence[str], name: str, notices: list[str]) -> Recording:
    """Return a recording in m/s², as simulations are; say of which channels that cannot be known."""
    factors = {c.name: metres_per_second_squared(c) for c in recording.channels if c.name in live}
    unknown = [channel for channel, factor in factors.items() if factor is None]
    if unknown:
        notices.append(
            f"{name}: {', '.join(unknown)} is no acceleration in a known unit; it is compared as if it were m/s², so "
            "that without a reference its level says nothing."
        )
    scale = np.array([factors.get(c.name) or 1.0 for c in recording.channels])
    if np.all(scale == 1.0):
        return recording
    channels = tuple(replace(c, unit="m/s^2") if factors.get(c.name) else c for c in recording.channels)
    return replace(recording, samples=recording.samples * scale[:, None], channels=channels)


def _assumed(recording: Recording, rig: Rig, facts: ConditionFacts) -> list[str]:
    """Say what is doubtful of a recording, and what of its operating point was not given."""
    texts = [f"{facts.name}: {warning}." for warning in recording.warnings]
    if recording.speed_source is None:
        texts.append(
            f"{facts.name}: no tachometer and no known speed; {facts.point.speed_rpm:.4g} rpm were found in the"
            " vibration."
        )
    if rig.nominal_torque_nm(rig.pairs[0].driver) is None:
        texts.append(
            f"{facts.name}: the torque is not given; {facts.point.torque_nm:.3g} N·m are usual for the gears' size."
        )
    return texts


def _strange_reference(reference: Gathered, simulation: Gathered, name: str) -> list[str]:
    """Say so where the reference itself is far from the simulation of a sound machine."""
    floor = load_population().simulation_floor
    size = gap_size(compare(reference, simulation, None), floor).structural.value
    if size < CLEAR_WITHOUT:
        return []
    remark = (
        f"The reference of {name} is itself {size:.1f} structural floors from the simulation of a sound machine: "
        "if it was not healthy, only what changed since is seen."
    )
    return [remark]
