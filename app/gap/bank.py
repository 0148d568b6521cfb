"""What each effect would change on one rig at one operating point: simulated once, kept on disk."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from hashlib import sha256
from itertools import islice
from pathlib import Path

import numpy as np

from app.gap.bank_file import read_bank, write_bank
from app.gap.bank_runs import Reduced, Run, Task, finished_runs
from app.gap.bank_versions import features_digest
from gearsig.checks import FloatArray, count, positive
from gearsig.errors import InputError, RefusalError
from gearsig.gap.simulator import Added, Point

Progress = Callable[[int, int], object]
POINT_DIGITS = 3
"""Speed and torque are rounded to so many digits: recordings of one set point share a bank."""


@dataclass(frozen=True)
class Bank:
    """Simulated features of the sound machine, and what each candidate of one effect changes in them.

    Parameters
    ----------
    point : Point
        At which it was simulated.
    feature_names : tuple of str
        Of `sound`; see `gearsig.gap.features`.
    change_names : tuple of str
        Of the changes, the features' names first; see `gearsig.gap.change`.
    sound : array, (n_seeds, n_features)
        One row per specimen.
    sound_changes : array, (n_seeds, n_changes)
        Another run of the sound specimen against its first: what a change is when nothing has changed.
    added : tuple of Added
        The candidates that could be simulated.
    changes : array, (n_added, n_change_seeds, n_changes)
        Each candidate's run against the sound first run of the same specimen.
    left_out : tuple of (Added, str)
        Candidates that could not be simulated, and why.
    """

    point: Point
    feature_names: tuple[str, ...]
    change_names: tuple[str, ...]
    sound: FloatArray
    sound_changes: FloatArray
    added: tuple[Added, ...]
    changes: FloatArray
    left_out: tuple[tuple[Added, str], ...] = ()


def banks_of(
    runs: Sequence[Run],
    effects: Sequence[str],
    *,
    seeds: Sequence[int],
    folder: Path | None,
    n_change_seeds: int = 1,
    processes: int = 2,
    fresh: bool = False,
    on_progress: Progress = lambda _done, _all: None,
) -> list[dict[str, Bank]]:
    """Return for each operating point the effects' banks, from disk or simulated and kept.

    Parameters
    ----------
    runs : sequence of Run
        Twin, point, length of what is simulated; the point is rounded to `POINT_DIGITS` digits. Noise 0: candidates
        have the noise and start of the sound run, so that only the effect differs.
    effects : sequence of str
        Whose candidates are simulated; each has a file of its own.
    seeds : sequence of int
        Specimens of the sound machine.
    folder : Path or None
        Where they are kept; None: nowhere.
    n_change_seeds : int
        On so many of the specimens, the first ones, each candidate is simulated.
    processes : int
        1: in this process. Otherwise the twins must pickle.
    fresh : bool
        Simulate what is on disk, too, and keep it in its place.
    on_progress : callable
        Told how many of all runs are done; what it raises stops the work, and nothing is kept.

    Raises
    ------
    InputError
        If the folder cannot be made.
    RefusalError
        If the sound machine cannot be simulated or its recording is too short for the features.
    """
    within = seeds[: min(count(n_change_seeds, "n_change_seeds"), len(seeds))]
    wanted = [_Wanted.of(run, name, seeds, within, folder) for run in runs for name in effects]
    found = {w: read_bank(w.path, w.key) if w.path is not None and not fresh else None for w in wanted}
    missing = [w for w in wanted if found[w] is None]
    sound = {w.run.sound_key: w.run for w in missing}
    tasks = [Task(run, seed, None) for run in sound.values() for seed in seeds]
    tasks += [Task(w.run, seed, added) for w in missing for added in w.candidates for seed in within]
    rows = iter(finished_runs(tasks, processes, on_progress) if tasks else ())
    sound_rows = {key: list(islice(rows, len(seeds))) for key in sound}
    for w in missing:
        own = list(islice(rows, len(w.candidates) * len(within)))
        found[w] = bank = _assembled(w.run.point, w.candidates, len(within), sound_rows[w.run.sound_key], own)
        if w.path is not None:
            write_bank(w.path, w.key, bank)
    banks = iter(found[w] for w in wanted)
    return [{name: bank for name, bank in zip(effects, banks, strict=False) if bank is not None} for _ in runs]


@dataclass(frozen=True, eq=False)
class _Wanted:
    """One effect's bank at one point, and where it is kept."""

    run: Run
    candidates: tuple[Added, ...]
    key: str
    path: Path | None

    @classmethod
    def of(cls, run: Run, effect: str, seeds: Sequence[int], within: Sequence[int], folder: Path | None) -> _Wanted:
        """Return what is wanted, at the rounded point."""
        positive(run.duration_s, "duration_s", "s")
        at = replace(run, point=rounded(run.point))
        candidates = tuple(run.twin.candidates(effect))
        key = bank_key(at, candidates, seeds, within)
        path = None if folder is None else _made(folder) / f"bank-{sha256(key.encode()).hexdigest()[:24]}.npz"
        return cls(at, candidates, key, path)


def rounded(point: Point) -> Point:
    """Return the point at which a bank is made."""
    return Point(*(float(f"{v:.{POINT_DIGITS}g}") for v in (point.speed_rpm, point.torque_nm)))


def bank_key(run: Run, candidates: Sequence[Added], seeds: Sequence[int], change_seeds: Sequence[int]) -> str:
    """Return all that a bank's numbers depend on, as text."""
    settings = [[a.name, a.severity, dict(a.options)] for a in candidates]
    runs = [list(seeds), list(change_seeds), run.duration_s, run.sampling_rate_hz, run.noise]
    known = [run.twin.key, features_digest(), [run.point.speed_rpm, run.point.torque_nm], settings, runs]
    return json.dumps(known, sort_keys=True)


def _made(folder: Path) -> Path:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(
            f"cannot be made ({error.strerror})", where=str(folder), remedy="choose another folder with --cache"
        ) from None
    return folder


def _assembled(
    point: Point,
    candidates: Sequence[Added],
    n_seeds: int,
    sound_rows: Sequence[Reduced | str],
    rows: Sequence[Reduced | str],
) -> Bank:
    sound = [row for row in sound_rows if isinstance(row, Reduced)]
    if len(sound) < len(sound_rows):
        why = next(row for row in sound_rows if isinstance(row, str))
        raise RefusalError(f"the sound machine cannot be simulated: {why}", remedy="check the rig file")
    first = sound[0]
    kept, changes, left_out = [], [], []
    for i, added in enumerate(candidates):
        own = rows[i * n_seeds : (i + 1) * n_seeds]
        whole = [row for row in own if isinstance(row, Reduced) and row.change_names == first.change_names]
        if len(whole) == n_seeds:
            kept.append(added)
            changes.append([row.change for row in whole])
        else:
            left_out.append((added, next((r for r in own if isinstance(r, str)), "it has other features")))
    return Bank(
        point,
        first.names,
        first.change_names,
        np.stack([row.values for row in sound]),
        np.stack([row.change for row in sound]),
        tuple(kept),
        np.array(changes).reshape(len(kept), n_seeds, len(first.change_names)),
        tuple(left_out),
    )
