"""All simulators, by name."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cache
from typing import Protocol, runtime_checkable

import numpy as np

from gearsig.checks import closest_match_hint
from gearsig.errors import InputError
from gearsig.gap.simulator import GapSimulator
from sims.effects.effect import EffectSetting
from sims.machine.operation import Operation
from sims.simulator import ParameterValue, Simulator


@cache
def simulators() -> dict[str, Simulator]:
    """Return every simulator by its name."""
    from sims.cracked.simulator import CrackedPair
    from sims.forging.simulator import ForgingManipulator
    from sims.reduced_fe.simulator import ReducedPair

    found: tuple[Simulator, ...] = (CrackedPair(), ReducedPair(), ForgingManipulator())
    return {simulator.name: simulator for simulator in found}


def simulator(name: str) -> Simulator:
    """Return the simulator called `name`."""
    found = simulators()
    if name not in found:
        raise InputError(
            f"there is no model {name!r}", allowed=", ".join(found), remedy=closest_match_hint(name, found)
        )
    return found[name]


@cache
def gap_simulators() -> dict[str, GapSimulator]:
    """Return every simulator that takes part in the gap diagnosis, by its name."""
    from sims.cracked.twin import cracked_gap_simulator
    from sims.reduced_fe.twin import reduced_gap_simulator

    found: tuple[GapSimulator, ...] = (cracked_gap_simulator(), reduced_gap_simulator())
    return {simulator.name: simulator for simulator in found}


def gap_simulator(name: str) -> GapSimulator:
    """Return the simulator called `name` as the gap diagnosis takes it."""
    found = gap_simulators()
    if name not in found:
        raise InputError(
            f"there is no model {name!r} with a gap diagnosis",
            allowed=", ".join(found),
            remedy=closest_match_hint(name, found),
        )
    return found[name]


class HasText(Protocol):
    """A result that explains itself."""

    @property
    def text(self) -> str:
        """For people."""
        ...


@runtime_checkable
class HasUsualRate(Protocol):
    """A simulator whose recordings are usually sampled at a rate of its own."""

    @property
    def usual_sampling_rate_hz(self) -> float:
        """Taken where no rate is asked for."""
        ...


USUAL_SAMPLING_RATE_HZ = 20480.0
"""Of vibration, for all other simulators."""


def usual_sampling_rate_hz(model: Simulator) -> float:
    """Return the rate at which recordings of a model are sampled where none is asked for."""
    return model.usual_sampling_rate_hz if isinstance(model, HasUsualRate) else USUAL_SAMPLING_RATE_HZ


@runtime_checkable
class ChecksConvergence(Protocol):
    """A simulator that can tell how far a smaller step changes its result."""

    def check_convergence(
        self,
        parameters: Mapping[str, ParameterValue],
        effects: Sequence[EffectSetting],
        operation: Operation | None,
        rng: np.random.Generator,
        *,
        preset: str = "",
    ) -> HasText:
        """Check the very machine that would be simulated."""
        ...
