"""The recordings of a gap diagnosis, reduced, each beside what it is compared with."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

from gearsig.errors import InputError, RefusalError
from gearsig.gap.change import change_features, difference_features
from gearsig.gap.features import Features
from gearsig.gap.floors import REPEATABLE, GapSize, StructuralFloor, gap_size, pooled_scatter
from gearsig.gap.gather import gather
from gearsig.gap.gathered import Gathered
from gearsig.gap.population import load_population
from gearsig.gap.prediction import Observed
from gearsig.gap.simulator import Added, Point, Twin
from gearsig.gap.types import ConditionFacts
from gearsig.gap.which_shaft import over_floors
from gearsig.recording.types import Recording
from gearsig.rig.types import Rig
from gearsig.severity.reference import LARGEST_SPEED_DIFFERENCE

SEED = 0
"""Of the twin's specimen: its flanks and housing are not the machine's in any case."""

LARGEST_TORQUE_DIFFERENCE = 0.25
"""Stated torques of a recording and its reference, relative."""

LONGEST_RUN_S, MOST_REVOLUTIONS = 5.0, 24.0
"""Of a simulation: longer ones say no more; but so many revolutions of the slower shaft at least."""
TRIAL_S, TRIAL_REVOLUTIONS = 2.0, 20.0
"""The same of a run that tries an effect: it differs from the sound run by that effect only, not by noise."""


@dataclass(frozen=True)
class Condition:
    """One recording, and what it is compared with.

    Parameters
    ----------
    facts : ConditionFacts
    now, simulated : Gathered
        The recording, and the sound twin at its point.
    reference : Gathered or None
    change : Features
        Against the reference, or else against the twin.
    """

    facts: ConditionFacts
    now: Gathered
    simulated: Gathered
    reference: Gathered | None
    change: Features

    @property
    def other(self) -> Gathered:
        """What it is compared with."""
        return self.reference if self.reference is not None else self.simulated

    @property
    def floor(self) -> StructuralFloor:
        """How far healthy machines lie from what it is compared with."""
        return load_population().floor(with_reference=self.reference is not None)

    @cached_property
    def size(self) -> GapSize:
        """How large the whole gap is."""
        return gap_size(self.change, self.floor)

    @property
    def trial_s(self) -> float:
        """Length of a simulation that tries an effect at this point."""
        return max(TRIAL_S, TRIAL_REVOLUTIONS / _slower_hz(self.now))

    @property
    def over_floors(self) -> dict[str, float]:
        """Changes over the larger of both floors, with their signs."""
        return over_floors(self.change, self.floor, is_reference=self.reference is not None)


def run_length_s(now: Gathered) -> float:
    """Return the length of a simulation that the features can be read from."""
    return max(LONGEST_RUN_S, MOST_REVOLUTIONS / _slower_hz(now))


def _slower_hz(now: Gathered) -> float:
    return min(now.frame.shaft_orders) * now.speed_hz


def simulated(
    twin: Twin, facts: ConditionFacts, now: Gathered, added: Sequence[Added] = (), noise: int = 0
) -> Gathered:
    """Return the twin's run at a recording's point, reduced."""
    recording = twin.run(
        facts.point,
        added,
        seed=SEED,
        duration_s=run_length_s(now),
        sampling_rate_hz=facts.sampling_rate_hz,
        noise=noise,
    )
    if recording.rig is None:
        raise InputError("the simulator's recording has no rig", remedy="a twin's recordings must carry the rig")
    return with_channels_of(gather(recording, recording.rig), now)


def with_channels_of(simulation: Gathered, now: Gathered) -> Gathered:
    """Return a simulation with the recording's channels: those of equal name, or else in their order."""
    if set(now.channels) <= set(simulation.channels):
        return simulation.with_channels({name: simulation.channels[name] for name in now.channels})
    own = list(simulation.channels.values())
    return simulation.with_channels({name: own[i % len(own)] for i, name in enumerate(now.channels)})


def compare(now: Gathered, simulation: Gathered, reference: Gathered | None) -> Features:
    """Return the change against the reference, or else against the simulation as far as it is credible."""
    if reference is not None:
        return change_features(now, reference)
    return difference_features(now, simulation, load_population().credibility)


def facts_of(recording: Recording, rig: Rig, now: Gathered, name: str, twin: Twin) -> ConditionFacts:
    """Return what is known of a recording's operating point: measured speed, stated torque of the driver.

    Raises
    ------
    RefusalError
        If the stated torque is 0.
    """
    stated_nm = _torque_nm(rig)
    if stated_nm == 0.0:
        raise RefusalError(
            f"{name}: the rig file states a torque of 0, at which nothing presses the simulated teeth together",
            remedy="give the drag of the driven side, some percent of the rated torque; without torque_nm a usual one "
            "is assumed",
        )
    return ConditionFacts(
        name,
        Point(60.0 * now.speed_hz, twin.point.torque_nm if stated_nm is None else stated_nm),
        now.n_revolutions,
        recording.duration_s,
        recording.sampling_rate_hz,
    )


@dataclass(frozen=True)
class Healthy:
    """A sound machine's recording, reduced, with its rig and its name."""

    gathered: Gathered
    rig: Rig
    name: str


def matching_reference(now: Gathered, rig: Rig, references: Sequence[Healthy]) -> tuple[Healthy | None, str]:
    """Return the reference at the recording's point, with the channels of both, or none and why."""
    if not references:
        return None, ""
    nearest = min(references, key=lambda one: _distance(now, rig, one))
    found = nearest.gathered
    change = now.speed_hz / found.speed_hz - 1.0
    if abs(change) > LARGEST_SPEED_DIFFERENCE:
        return None, f"no reference within {100 * LARGEST_SPEED_DIFFERENCE:.0f} % of its speed"
    if _torque_difference(rig, nearest.rig) > LARGEST_TORQUE_DIFFERENCE:
        here, there = _torque_nm(rig), _torque_nm(nearest.rig)
        return None, f"the reference at its speed has {there:.3g} N m, the recording {here:.3g} N m"
    named = _with_names_of(found, now)
    if named is None:
        return None, f"the reference has the channels {', '.join(found.channels)}"
    return replace(nearest, gathered=named), ""


def _with_names_of(reference: Gathered, now: Gathered) -> Gathered | None:
    """Return the reference with those of the recording's channels that it has, or the only one of each; else None."""
    if common := [name for name in now.channels if name in reference.channels]:
        return reference.with_channels({name: reference.channels[name] for name in common})
    if len(reference.channels) == len(now.channels) == 1:
        return reference.with_channels(dict(zip(now.channels, reference.channels.values(), strict=True)))
    return None


def _distance(now: Gathered, rig: Rig, reference: Healthy) -> float:
    speed = abs(now.speed_hz / reference.gathered.speed_hz - 1.0)
    return 10.0 * speed + _torque_difference(rig, reference.rig)


def _torque_difference(rig: Rig, reference: Rig) -> float:
    """Return by which part of the reference's torque the recording's differs from it; 0 where one is not stated."""
    here_nm, there_nm = _torque_nm(rig), _torque_nm(reference)
    if here_nm is None or there_nm is None:
        return 0.0
    return abs(here_nm / there_nm - 1.0) if there_nm else math.inf


def _torque_nm(rig: Rig) -> float | None:
    return rig.nominal_torque_nm(rig.pairs[0].driver)


def observed(condition: Condition, index: int, n: int, change: Features | None = None) -> Observed:
    """Return a condition's distances and floors of the first `n` features; `change` instead of its own."""
    used = change or condition.change
    structural = condition.floor
    both = (structural.of(used.names) ** 2 + (REPEATABLE * pooled_scatter(used)) ** 2) ** 0.5
    return Observed(index, structural.from_centre(used.names, used.values)[:n], both[:n])


def halves(gathered: Gathered) -> tuple[Gathered, Gathered]:
    """Return the blocks of revolutions with even and with odd numbers."""
    n = gathered.n_blocks
    first = second = gathered
    for block in reversed(range(n)):
        first, second = (first.without(block), second) if block % 2 else (first, second.without(block))
    return first, second
