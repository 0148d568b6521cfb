"""What each effect would change on one rig at one operating point: simulated once, kept on disk."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path

import numpy as np

from app.gap.bank_file import read_bank, write_bank
from app.gap.bank_runs import Reduced, Run, Task, finished_runs
from app.gap.bank_versions import features_digest
from gearsig.checks import FloatArray, count, positive
from gearsig.errors import InputError, RefusalError
from gearsig.gap.simulator import Added, Point, Twin

Progress = Callable[[int, int], object]
POINT_DIGITS = 3
"""Speed and torque are rounded to so many digits: recordings of one set point share a bank."""


@dataclass(frozen=True)
class Bank:
    """Simulated features of the sound machine, and what each candidate changes in them.

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

    def of_effect(self, name: str) -> tuple[tuple[Added, ...], FloatArray]:
        """Return one effect's candidates and their changes."""
        rows = [i for i, a in enumerate(self.added) if a.name == name]
        return tuple(self.added[i] for i in rows), self.changes[rows]


def bank_of(
    twin: Twin,
    point: Point,
    effects: Sequence[str],
    *,
    seeds: Sequence[int],
    duration_s: float,
    sampling_rate_hz: float,
    folder: Path | None,
    n_change_seeds: int = 1,
    noise: int = 1,
    processes: int = 2,
    on_progress: Progress = lambda _done, _all: None,
) -> Bank:
    """Return the bank from disk, or simulate it and keep it.

    Parameters
    ----------
    twin : Twin
        It must pickle where `processes` is above 1.
    point : Point
        Rounded to `POINT_DIGITS` digits.
    effects : sequence of str
        Whose candidates are simulated.
    seeds : sequence of int
        Specimens of the sound machine.
    duration_s, sampling_rate_hz : float
    folder : Path or None
        Where it is kept; None: nowhere.
    n_change_seeds : int
        On so many of the specimens, the first ones, each candidate is simulated.
    noise : int
        Run of the candidates; 0: with the noise and start of the sound run, so that only the effect differs.
    processes : int
        1: in this process.
    on_progress : callable
        Told how many of all runs are done; what it raises stops the work, and nothing is kept.

    Raises
    ------
    InputError
        If the folder cannot be made.
    RefusalError
        If the sound machine cannot be simulated or its recording is too short for the features.
    """
    at = rounded(point)
    positive(duration_s, "duration_s", "s")
    within_seeds = seeds[: min(count(n_change_seeds, "n_change_seeds"), len(seeds))]
    candidates = [added for name in effects for added in twin.candidates(name)]
    key = bank_key(twin, at, candidates, seeds, within_seeds, duration_s, sampling_rate_hz, noise)
    path = None if folder is None else _made(folder) / f"bank-{sha256(key.encode()).hexdigest()[:24]}.npz"
    if path is not None and (found := read_bank(path, key)) is not None:
        return found
    tasks = [Task(seed, None) for seed in seeds]
    tasks += [Task(seed, added) for added in candidates for seed in within_seeds]
    run = Run(twin, at, duration_s, sampling_rate_hz, noise)
    bank = _assembled(at, candidates, len(seeds), len(within_seeds), finished_runs(run, tasks, processes, on_progress))
    if path is not None:
        write_bank(path, key, bank)
    return bank


def rounded(point: Point) -> Point:
    """Return the point at which a bank is made."""
    return Point(*(float(f"{v:.{POINT_DIGITS}g}") for v in (point.speed_rpm, point.torque_nm)))


def bank_key(
    twin: Twin,
    point: Point,
    candidates: Sequence[Added],
    seeds: Sequence[int],
    change_seeds: Sequence[int],
    duration_s: float,
    sampling_rate_hz: float,
    noise: int,
) -> str:
    """Return all that a bank's numbers depend on, as text."""
    settings = [[a.name, a.severity, dict(a.options)] for a in candidates]
    runs = [list(seeds), list(change_seeds), duration_s, sampling_rate_hz, noise]
    known = [twin.key, features_digest(), [point.speed_rpm, point.torque_nm], settings, runs]
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
    point: Point, candidates: Sequence[Added], n_sound: int, n_seeds: int, rows: Sequence[Reduced | str]
) -> Bank:
    sound = [row for row in rows[:n_sound] if isinstance(row, Reduced)]
    if len(sound) < n_sound:
        why = next(row for row in rows[:n_sound] if isinstance(row, str))
        raise RefusalError(f"the sound machine cannot be simulated: {why}", remedy="check the rig file")
    first = sound[0]
    kept, changes, left_out = [], [], []
    for i, added in enumerate(candidates):
        own = rows[n_sound + i * n_seeds : n_sound + (i + 1) * n_seeds]
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
