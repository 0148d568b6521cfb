"""Sweeps: grids of simulations over parameters, effects, speed and torque."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from contextlib import closing
from dataclasses import KW_ONLY, dataclass, field, fields
from itertools import product
from math import isfinite, prod
from pathlib import Path
from typing import Any

from gearsig.cache import remove_parts, write_text
from gearsig.checks import count, one_of, positive
from gearsig.errors import GearsigError, InputError, not_written, unexpected_text
from gearsig.formatting import csv_rows
from gearsig.processes import killed_text, n_processors, run_jobs
from gearsig.recording import WRITERS
from sims.effects import EffectSetting, OptionValue, effect
from sims.effects import effects as all_effects
from sims.files import file_set, is_whole, write_set
from sims.machine import Operation, Profile
from sims.registry import Simulation, simulator
from sims.simulator import checked_value, parameter

MAX_POINTS = 100_000
"""Each point is a file; a larger grid is taken for a typing error."""
OPERATION_AXES = ("speed_rpm", "torque_nm")
"""Axes that are neither a parameter nor an effect."""


@dataclass(frozen=True)
class Axis:
    """A quantity that a sweep varies, with its values.

    Parameters
    ----------
    name : str
        "speed_rpm", "torque_nm", a parameter or an effect.
    values : tuple of float
        In the unit of the parameter or of the effect's severity.
    options : mapping
        Options of an effect: which gear, which tooth.
    """

    name: str
    values: tuple[float, ...]
    options: Mapping[str, OptionValue] = field(default_factory=dict)

    def __post_init__(self) -> None:
        object.__setattr__(self, "values", tuple(float(v) for v in self.values))
        if not self.values or not all(isfinite(v) for v in self.values):
            raise InputError(f"axis {self.name} has the values {self.values}", allowed="at least one finite number")
        if len(set(self.values)) < len(self.values):
            raise InputError(f"axis {self.name} has a value twice", allowed="different values")


@dataclass(frozen=True)
class SweepPoint:
    """One simulation of a sweep.

    Parameters
    ----------
    index : int
        Position in the grid; the last axis runs fastest.
    values : tuple of float
        One per axis.
    seed : int
        Of all random draws.
    """

    index: int
    values: tuple[float, ...]
    seed: int


@dataclass(frozen=True)
class Sweep(Simulation):
    """A grid of simulations: the fields of a simulation, the same at every point except for those on an axis.

    Parameters
    ----------
    axes : tuple of Axis
    common_seed : bool
        False: every point draws its own noise, roughness and tolerances, from the seed and its position in the grid.
        Such points are independent, for statistics and training. True: all draw the same (common random numbers), so
        that points differ only in what was varied, for differences between neighbours.
    extension : str
        File extension of the recordings, which sets their format.
    """

    axes: tuple[Axis, ...]
    _: KW_ONLY
    common_seed: bool = False
    extension: str = ".h5"

    def __post_init__(self) -> None:
        super().__post_init__()
        object.__setattr__(self, "axes", tuple(self.axes))
        one_of(self.extension, "extension of the recordings", WRITERS)
        positive(self.duration_s, "duration_s", "s")
        names = [axis.name for axis in self.axes]
        if not names or len(set(names)) < len(names):
            raise InputError(f"axes are {', '.join(names) or 'none'}", allowed="at least one, none twice")
        if self.n_points > MAX_POINTS:
            raise InputError(f"the grid has {self.n_points} points", allowed=f"up to {MAX_POINTS}")
        self._check_axes()

    @property
    def n_points(self) -> int:
        """Size of the grid."""
        return prod(len(axis.values) for axis in self.axes)

    def points(self) -> tuple[SweepPoint, ...]:
        """All points, the last axis running fastest."""
        grid = product(*(axis.values for axis in self.axes))
        return tuple(SweepPoint(i, values, self._seed(i)) for i, values in enumerate(grid))

    def definition(self) -> dict[str, Any]:
        """Everything that determines the results, as plain values."""
        return {
            "model": self.model,
            "preset": self.preset,
            "axes": [{"name": a.name, "values": list(a.values), "options": dict(a.options)} for a in self.axes],
            "parameters": dict(self.parameters),
            "effects": [{"name": s.name, "severity": s.severity, "options": dict(s.options)} for s in self.effects],
            "speed_rpm": self.speed_rpm and self.speed_rpm.as_dict(),
            "torque_nm": self.torque_nm and self.torque_nm.as_dict(),
            "duration_s": self.duration_s,
            "sampling_rate_hz": self.sampling_rate_hz,
            "seed": self.seed,
            "common_seed": self.common_seed,
            "extension": self.extension,
        }

    def _seed(self, index: int) -> int:
        import numpy as np

        if self.common_seed:
            return self.seed
        return int(np.random.SeedSequence([self.seed, index]).generate_state(1, np.uint32)[0])

    def at(self, point: SweepPoint) -> Simulation:
        """Return the simulation of a point."""
        values = {f.name: getattr(self, f.name) for f in fields(Simulation)} | {"seed": point.seed}
        for axis, value in zip(self.axes, point.values, strict=True):
            if axis.name in OPERATION_AXES:
                values[axis.name] = Profile.constant(value)
            elif axis.name in all_effects():
                values["effects"] = (*values["effects"], EffectSetting(axis.name, value, axis.options))
            else:
                values["parameters"] = {**values["parameters"], axis.name: value}
        return Simulation(**values)

    def _check_axes(self) -> None:
        """Reject unknown names and values outside their ranges; limits of the machine show when a point is run."""
        model = simulator(self.model)
        for axis in self.axes:
            if axis.name in OPERATION_AXES:
                for value in axis.values:
                    Operation(Profile.constant(value), Profile.constant(value))
            elif axis.name in model.effects:
                effect(axis.name).complete(axis.options)
                for value in axis.values:
                    effect(axis.name).check_severity(value)
            else:
                for value in axis.values:
                    checked_value(parameter(model.parameters, axis.name), value)


# Running a sweep on all processors into a folder, so that it can be stopped and resumed.

DEFINITION = "sweep.json"
INDEX = "index.csv"

Progress = Callable[[int, int, "SweepOutcome"], object]


@dataclass(frozen=True)
class SweepOutcome:
    """Outcome of a point: its recording, or the reason why there is none."""

    point: SweepPoint
    recording: Path | None
    reason: str = ""


@dataclass(frozen=True)
class SweepResult:
    """Outcome of a run of a sweep.

    Parameters
    ----------
    n_points : int
    n_found : int
        Points that were already in the folder.
    outcomes : tuple of Outcome
        Points of this run, in the order of the grid.
    index_path : Path
        Table of all points: index, values, seed, file (empty where there is none), reason.
    """

    n_points: int
    n_found: int
    outcomes: tuple[SweepOutcome, ...]
    index_path: Path

    @property
    def failures(self) -> tuple[SweepOutcome, ...]:
        """Points without a recording."""
        return tuple(o for o in self.outcomes if o.recording is None)


def run_sweep(
    sweep: Sweep, folder: str | Path, *, n_processes: int | None = None, on_progress: Progress | None = None
) -> SweepResult:
    """Simulate every point that is not yet in the folder.

    Each point becomes a recording, its rig file and its truth, all or none. A point that cannot be simulated does not
    stop the others. After Ctrl-C, complete points stay, and the same call resumes from there.

    Parameters
    ----------
    sweep : Sweep
    folder : str or Path
        Created if missing; otherwise empty, or begun by the same sweep.
    n_processes : int or None
        None: one per processor. With more than 1 the caller's script needs the usual ``if __name__ == "__main__":``,
        as processes are spawned.
    on_progress : callable or None
        Called as ``on_progress(n_done, n_points, outcome)``, in the order of completion.

    Raises
    ------
    InputError
        If the folder cannot be created, or holds other files or another sweep.
    """
    workers = n_processors() if n_processes is None else count(n_processes, "n_processes")
    target = claimed(Path(folder), sweep.definition())
    points = sweep.points()
    missing = [p for p in points if not is_whole(recording_path(sweep, target, p))]
    n_found = len(points) - len(missing)
    done: dict[int, SweepOutcome] = {}
    try:
        n_workers = min(workers, max(len(missing), 1))
        jobs = ((sweep, point, target) for point in missing)
        with closing(run_jobs(_run_one, jobs, n_workers=n_workers, if_killed=_killed)) as running:
            for _, outcome in running:
                done[outcome.point.index] = outcome
                if on_progress is not None:
                    on_progress(n_found + len(done), len(points), outcome)
    finally:
        remove_parts(target)
        index = _write_index(sweep, target, points, done)
    return SweepResult(len(points), n_found, tuple(done[i] for i in sorted(done)), index)


def recording_path(sweep: Sweep, folder: Path, point: SweepPoint) -> Path:
    """Path of a point's recording."""
    digits = len(str(max(sweep.n_points - 1, 1)))
    return folder / f"point_{point.index:0{digits}d}{sweep.extension}"


def n_complete(sweep: Sweep, folder: str | Path) -> int:
    """Number of points whose recordings are in the folder."""
    return sum(recording_path(sweep, Path(folder), point).exists() for point in sweep.points())


def claimed(folder: Path, definition: Mapping[str, Any], name: str = DEFINITION, kind: str = "sweep") -> Path:
    """Create the folder or accept an existing one, and write the definition to it.

    Parameters
    ----------
    folder : Path
    definition : mapping
        Plain values that determine the results.
    name : str
        Of the definition's file.
    kind : str
        What it defines, for error messages.

    Raises
    ------
    InputError
        If the folder cannot be created, holds other files, or was begun with another definition.
    """
    text = json.dumps(definition, indent=2, ensure_ascii=False) + "\n"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        if (folder / name).exists():
            _check_same(folder / name, text, kind)
        elif any(path.suffix != ".part" for path in folder.iterdir()):  # such a run that was killed at once
            raise InputError(
                f"holds files that belong to no {kind}", where=str(folder), remedy="choose another with -o"
            )
        else:
            write_text(folder / name, text)
    except OSError as error:
        raise not_written(error, folder, "choose another with -o") from None
    return folder


def _check_same(definition: Path, text: str, kind: str) -> None:
    try:
        kept, requested = json.loads(definition.read_text(encoding="utf-8")), json.loads(text)
    except ValueError:
        raise InputError(
            f"is not the definition of a {kind}", where=str(definition), remedy="choose another folder"
        ) from None
    if kept != requested:
        differing = [key for key in requested if not isinstance(kept, dict) or kept.get(key) != requested[key]]
        raise InputError(
            f"holds another {kind}: {', '.join(differing) or 'its definition'} differs",
            where=str(definition.parent),
            remedy="choose another folder, or give the same options as before",
        )


SweepJob = tuple[Sweep, SweepPoint, Path]


def _killed(job: SweepJob) -> SweepOutcome:
    return SweepOutcome(job[1], None, killed_text("simulated it"))


def _run_one(job: SweepJob) -> SweepOutcome:
    """Simulate a point and write it; every error becomes the outcome's reason."""
    sweep, point, folder = job
    try:
        names = file_set(recording_path(sweep, folder, point), replace=True)
        write_set(sweep.at(point).run(), names)
    except GearsigError as error:
        return SweepOutcome(point, None, str(error))
    except Exception as error:  # noqa: BLE001 - one point must not stop the others; the reason is passed on
        return SweepOutcome(point, None, unexpected_text(error))
    return SweepOutcome(point, names.recording)


def _write_index(sweep: Sweep, folder: Path, points: Sequence[SweepPoint], done: dict[int, SweepOutcome]) -> Path:
    rows = []
    for point in points:
        path = recording_path(sweep, folder, point)
        outcome = done.get(point.index)
        reason = "" if path.exists() else (outcome.reason if outcome else "not yet simulated")
        file = path.name if path.exists() else ""
        rows.append([point.index, *(f"{v:.12g}" for v in point.values), point.seed, file, reason])
    header = ["index", *(axis.name for axis in sweep.axes), "seed", "file", "reason"]
    return write_text(folder / INDEX, csv_rows(header, rows))
