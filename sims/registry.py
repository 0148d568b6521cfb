"""All simulators, by name."""

from __future__ import annotations

from functools import cache

from gearsig.checks import known_name
from gearsig.gap import DriveSimulator, GapSimulator
from sims.simulator import Simulator


@cache
def simulators() -> dict[str, Simulator]:
    """Return every simulator by its name."""
    from sims.cracked import CrackedPair
    from sims.forging import ForgingManipulator
    from sims.reduced_fe import ReducedPair

    all_simulators: tuple[Simulator, ...] = (CrackedPair(), ReducedPair(), ForgingManipulator())
    return {simulator.name: simulator for simulator in all_simulators}


def simulator(name: str) -> Simulator:
    """Return the simulator called `name`."""
    return simulators()[known_name(name, simulators(), f"there is no model {name!r}")]


@cache
def gap_simulators() -> dict[str, GapSimulator | DriveSimulator]:
    """Return every simulator that takes part in the gap diagnosis, by its name."""
    from sims.cracked import cracked_gap_simulator
    from sims.forging import forging_gap_simulator
    from sims.reduced_fe import reduced_gap_simulator

    all_simulators = (cracked_gap_simulator(), reduced_gap_simulator(), forging_gap_simulator())
    return {simulator.name: simulator for simulator in all_simulators}


def gap_simulator(name: str) -> GapSimulator | DriveSimulator:
    """Return the simulator called `name` as the gap diagnosis takes it."""
    return gap_simulators()[known_name(name, gap_simulators(), f"there is no model {name!r} with a gap diagnosis")]
