"""All simulators, by name."""

from __future__ import annotations

from functools import cache
from hashlib import sha256
from pathlib import Path

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


# Which state of the simulators' code made a result.

_ROOMS = ("cracked", "effects", "forging", "gear_pair", "machine", "measure", "mesh", "reduced_fe")


def sources_digest() -> str:
    """Return a short hash of the code that simulates: kept results of another state are not taken for this one's."""
    from sims.effects import user_files

    of_users = sha256(b"".join(path.read_bytes() for path in user_files())).hexdigest()[:8] if user_files() else ""
    return _listed_sources() + of_users


@cache
def _listed_sources() -> str:
    sims_folder = Path(__file__).parent
    digest = sha256()
    for room in _ROOMS:
        for path in sorted((sims_folder / room).rglob("*.py")):
            digest.update(path.relative_to(sims_folder).as_posix().encode() + b"\0" + path.read_bytes())
    return digest.hexdigest()[:16]
