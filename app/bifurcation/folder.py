"""A bifurcation into a folder: branches in processes of their own, value by value, to be stopped and resumed."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Future, wait
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from app.bifurcation.kept import Kept, load, save
from app.bifurcation.measure import measured
from gearsig.checks import count, one_of, within
from gearsig.errors import GearsigError
from gearsig.processes import n_processors, process_pool
from sims.cracked.continuation import Branch, End
from sims.sweep_run import claimed

DEFINITION, VALUES = "definition.json", "values"
DIRECTIONS = ("both", "up", "down", "rest")
LOOK_S = 0.3
"""How often the parent counts what the processes have written."""


@dataclass(frozen=True)
class Wanted:
    """A bifurcation as it is asked for.

    Parameters
    ----------
    branch : Branch
    direction : str
        "up", "down", "both": each value goes on from where the last one ended; "rest": each starts from the static
        balance, independently of the others.
    phase_cycles : float
        Place in the cycle at which the points are taken.
    with_kind : bool
        Whether the kind of motion is looked for, for some seconds per value.
    """

    branch: Branch
    direction: str = "both"
    phase_cycles: float = 0.0
    with_kind: bool = False

    def __post_init__(self) -> None:
        one_of(self.direction, "direction", DIRECTIONS)
        within(self.phase_cycles, "phase", 0.0, 1.0, remedy="it is a share of a cycle")

    @property
    def branches(self) -> tuple[str, ...]:
        """Names of the branches, as they stand in the results."""
        return ("up", "down") if self.direction == "both" else (self.direction,)

    @property
    def n_values(self) -> int:
        """Runs in all."""
        return len(self.branches) * len(self.branch.values)

    def definition(self) -> dict[str, Any]:
        """What decides the results, as plain values."""
        sweep = self.branch.sweep.definition()
        for unused in ("duration_s", "common_seed", "extension"):
            del sweep[unused]
        return {
            **sweep,
            "signal": self.branch.signal,
            "section": self.branch.section,
            "n_cycles": self.branch.n_cycles,
            "direction": self.direction,
            "phase_cycles": self.phase_cycles,
            "with_kind": self.with_kind,
        }


def run_folder(
    wanted: Wanted, folder: Path, *, n_processes: int | None = None, on_progress: Callable[[int], object] | None = None
) -> dict[str, list[Kept]]:
    """Run whatever the folder does not hold yet; return all values by branch, ascending.

    The branches run beside each other; along a branch one value waits for the other. After Ctrl-C what is complete
    stays, and the same call goes on from there.
    """
    workers = n_processors() if n_processes is None else count(n_processes, "n_processes")
    claimed(folder, wanted.definition(), DEFINITION, "bifurcation")
    (folder / VALUES).mkdir(exist_ok=True)
    jobs = _jobs(wanted)
    try:
        if workers == 1 or len(jobs) == 1:
            for name, places in jobs:
                run_places(wanted, folder, name, places, on_progress)
        else:
            with process_pool(min(workers, len(jobs))) as pool:
                futures = [pool.submit(run_places, wanted, folder, name, places) for name, places in jobs]
                _follow(futures, wanted, folder, on_progress)
    finally:
        for part in (folder / VALUES).glob(".*.part"):
            with suppress(OSError):
                part.unlink()
    return complete(wanted, folder)


def complete(wanted: Wanted, folder: Path) -> dict[str, list[Kept]]:
    """Return the values that the folder holds, by branch, ascending."""
    n = len(wanted.branch.values)
    found = {name: [load(value_path(folder, name, place)) for place in range(n)] for name in wanted.branches}
    return {name: [kept for kept in values if kept is not None] for name, values in found.items()}


def n_complete(wanted: Wanted, folder: Path) -> int:
    """Values that the folder holds."""
    n = len(wanted.branch.values)
    return sum(value_path(folder, name, place).exists() for name in wanted.branches for place in range(n))


def value_path(folder: Path, name: str, place: int) -> Path:
    """Name of one value's file; `place` counts ascending values."""
    return folder / VALUES / f"{name}_{place:05d}.npz"


def run_places(
    wanted: Wanted,
    folder: Path,
    name: str,
    places: Sequence[int],
    on_progress: Callable[[int], object] | None = None,
) -> None:
    """Run values in this order, from the first that the folder does not hold."""
    before: End | None = None
    for place in places:
        path = value_path(folder, name, place)
        kept = load(path)
        if kept is None:
            kept = run_value(wanted, wanted.branch.values[place], before)
            save(kept, path)
        before = kept.end or before
        if on_progress is not None:
            on_progress(n_complete(wanted, folder))


def run_value(wanted: Wanted, value: float, before: End | None) -> Kept:
    """Run one value; what cannot be answered becomes a reason."""
    try:
        run = wanted.branch.run(value, before)
        found = measured(run, wanted.branch, phase_cycles=wanted.phase_cycles, with_kind=wanted.with_kind)
    except GearsigError as error:
        return Kept(value, None, None, str(error))
    return Kept(value, found, run.end)


def _jobs(wanted: Wanted) -> list[tuple[str, tuple[int, ...]]]:
    """Return what must be run one after the other."""
    places = tuple(range(len(wanted.branch.values)))
    if wanted.direction == "rest":
        return [("rest", (place,)) for place in places]
    return [(name, places if name == "up" else places[::-1]) for name in wanted.branches]


def _follow(
    futures: Sequence[Future[None]], wanted: Wanted, folder: Path, on_progress: Callable[[int], object] | None
) -> None:
    waiting: set[Future[None]] = set(futures)
    while waiting:
        done, waiting = wait(waiting, timeout=LOOK_S)
        for future in done:
            future.result()
        if on_progress is not None:
            on_progress(n_complete(wanted, folder))
