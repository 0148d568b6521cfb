"""Runs a sweep on all processors, into a folder, so that it can be stopped and resumed."""

from __future__ import annotations

import csv
import json
from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from concurrent.futures import as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import closing, suppress
from dataclasses import dataclass
from io import StringIO
from pathlib import Path
from typing import Any

from gearsig.checks import count
from gearsig.errors import GearsigError, InputError
from gearsig.processes import n_processors, process_pool
from sims.files import file_set, write_set
from sims.sweep import Point, Sweep

DEFINITION = "sweep.json"
INDEX = "index.csv"

Progress = Callable[[int, int, "Outcome"], object]


@dataclass(frozen=True)
class Outcome:
    """What became of a point: its recording, or the reason why there is none."""

    point: Point
    recording: Path | None
    reason: str = ""


@dataclass(frozen=True)
class SweepResult:
    """What a run of a sweep did.

    Parameters
    ----------
    n_points : int
    n_found : int
        Points that stood in the folder already.
    outcomes : tuple of Outcome
        Points of this run, in the order of the grid.
    index_path : Path
        Table of all points: index, values, seed, file (empty where there is none), reason.
    """

    n_points: int
    n_found: int
    outcomes: tuple[Outcome, ...]
    index_path: Path

    @property
    def failures(self) -> tuple[Outcome, ...]:
        """Points that gave no recording."""
        return tuple(o for o in self.outcomes if o.recording is None)


def run_sweep(
    sweep: Sweep, folder: str | Path, *, n_processes: int | None = None, on_progress: Progress | None = None
) -> SweepResult:
    """Simulate every point that the folder does not hold yet.

    Each point becomes a recording, its rig file and its truth, all or none. A point that cannot be simulated does not
    stop the others. After Ctrl-C, whatever is complete stays, and the same call goes on from there.

    Parameters
    ----------
    sweep : Sweep
    folder : str or Path
        Made if it is not there; empty, or begun by the same sweep.
    n_processes : int or None
        None: one per processor. With more than 1 the caller's script needs the usual ``if __name__ == "__main__":``,
        as processes are spawned.
    on_progress : callable or None
        Called as ``on_progress(n_done, n_points, outcome)``, in the order of completion.

    Raises
    ------
    InputError
        If the folder cannot be made, holds other things, or another sweep.
    """
    workers = n_processors() if n_processes is None else count(n_processes, "n_processes")
    target = claimed(Path(folder), sweep.definition())
    points = sweep.points()
    missing = [p for p in points if not recording_path(sweep, target, p).exists()]
    n_found = len(points) - len(missing)
    done: dict[int, Outcome] = {}
    try:
        with closing(_run(sweep, missing, target, min(workers, max(len(missing), 1)))) as running:
            for outcome in running:
                done[outcome.point.index] = outcome
                if on_progress is not None:
                    on_progress(n_found + len(done), len(points), outcome)
    finally:
        _remove_unfinished(target)
        index = _write_index(sweep, target, points, done)
    return SweepResult(len(points), n_found, tuple(done[i] for i in sorted(done)), index)


def recording_path(sweep: Sweep, folder: Path, point: Point) -> Path:
    """Name of a point's recording."""
    digits = len(str(max(sweep.n_points - 1, 1)))
    return folder / f"point_{point.index:0{digits}d}{sweep.extension}"


def n_complete(sweep: Sweep, folder: str | Path) -> int:
    """Points that the folder holds."""
    return sum(recording_path(sweep, Path(folder), point).exists() for point in sweep.points())


def claimed(folder: Path, definition: Mapping[str, Any], name: str = DEFINITION, kind: str = "sweep") -> Path:
    """Make the folder or accept it; leave the definition in it.

    Parameters
    ----------
    folder : Path
    definition : mapping
        Plain values that decide the results.
    name : str
        Of its file.
    kind : str
        What it defines, for the errors.

    Raises
    ------
    InputError
        If the folder cannot be made, holds other things, or was begun by another definition.
    """
    text = json.dumps(definition, indent=2, ensure_ascii=False) + "\n"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        if (folder / name).exists():
            _check_same(folder / name, text, kind)
        elif any(folder.iterdir()):
            raise InputError(
                f"holds files that belong to no {kind}", where=str(folder), remedy="choose another with -o"
            )
        else:
            written(folder / name, text)
    except OSError as error:
        raise InputError(
            f"cannot be written ({error.strerror or error})", where=str(folder), remedy="choose another with -o"
        ) from None
    return folder


def _check_same(definition: Path, text: str, kind: str) -> None:
    try:
        there, wanted = json.loads(definition.read_text(encoding="utf-8")), json.loads(text)
    except ValueError:
        raise InputError(
            f"is not the definition of a {kind}", where=str(definition), remedy="choose another folder"
        ) from None
    if there != wanted:
        differing = [key for key in wanted if not isinstance(there, dict) or there.get(key) != wanted[key]]
        raise InputError(
            f"holds another {kind}: {', '.join(differing) or 'its definition'} differs",
            where=str(definition.parent),
            remedy="choose another folder, or give the same options as before",
        )


def _run(sweep: Sweep, points: Sequence[Point], folder: Path, n_workers: int) -> Generator[Outcome, None, None]:
    if n_workers == 1:
        for point in points:
            yield _run_one(sweep, point, folder)
    else:
        yield from _run_local(sweep, points, folder, n_workers)


def _run_local(sweep: Sweep, points: Sequence[Point], folder: Path, n_workers: int) -> Iterator[Outcome]:
    """Run points in local processes; where one kills its process, the unfinished ones get a process each."""
    unfinished = {point.index: point for point in points}
    try:
        with process_pool(n_workers) as pool:
            futures = [pool.submit(_run_one, sweep, point, folder) for point in points]
            for future in as_completed(futures):
                outcome = future.result()
                del unfinished[outcome.point.index]
                yield outcome
    except BrokenProcessPool:
        for point in unfinished.values():
            try:
                with process_pool(1) as pool:
                    outcome = pool.submit(_run_one, sweep, point, folder).result()
            except BrokenProcessPool:
                outcome = Outcome(point, None, "the process that simulated it was killed: perhaps it ran out of memory")
            yield outcome


def _run_one(sweep: Sweep, point: Point, folder: Path) -> Outcome:
    """Simulate a point and write it; every error becomes a reason."""
    try:
        names = file_set(recording_path(sweep, folder, point), replace=True)
        write_set(sweep.simulate(point), names)
    except GearsigError as error:
        return Outcome(point, None, str(error))
    except Exception as error:  # noqa: BLE001 - one point must not stop the others; the reason is passed on
        text = f"{type(error).__name__}: {' '.join(str(error).split())}"
        return Outcome(point, None, f"unexpected error, please report: {text}")
    return Outcome(point, names.recording)


def _write_index(sweep: Sweep, folder: Path, points: Sequence[Point], done: dict[int, Outcome]) -> Path:
    text = StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow(["index", *(axis.name for axis in sweep.axes), "seed", "file", "reason"])
    for point in points:
        path = recording_path(sweep, folder, point)
        outcome = done.get(point.index)
        reason = "" if path.exists() else (outcome.reason if outcome else "not yet simulated")
        table.writerow(
            [point.index, *(f"{v:.12g}" for v in point.values), point.seed, path.name if path.exists() else "", reason]
        )
    return written(folder / INDEX, text.getvalue())


def written(path: Path, text: str) -> Path:
    """Write a text whole or not at all."""
    part = path.with_name(f".{path.name}.part")
    part.write_text(text, encoding="utf-8")
    return part.replace(path)


def _remove_unfinished(folder: Path) -> None:
    """Remove what workers that were stopped in the middle left."""
    import shutil

    for part in folder.glob(".point_*-*"):
        with suppress(OSError):
            shutil.rmtree(part)
