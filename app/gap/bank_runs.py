"""The simulations of a bank, in processes of their own or in this one."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import as_completed
from dataclasses import dataclass, field

import numpy as np

from gearsig.checks import FloatArray
from gearsig.errors import GearsigError
from gearsig.gap.gathered import Gathered
from gearsig.gap.simulator import Added, Point, Twin
from gearsig.processes import can_be_sent, process_pool

SoundKey = tuple[Point, float, float]


@dataclass(frozen=True)
class Run:
    """Where and how long a twin runs."""

    twin: Twin
    point: Point
    duration_s: float
    sampling_rate_hz: float
    noise: int

    @property
    def sound_key(self) -> SoundKey:
        """What the twin's sound runs depend on; twins need not hash."""
        return self.point, self.duration_s, self.sampling_rate_hz


@dataclass(frozen=True)
class Task:
    """One simulation: a specimen with an effect, or sound; each of the `further` channels is looked at by itself."""

    run: Run
    seed: int
    added: Added | None
    further: tuple[str, ...] = ()


@dataclass(frozen=True)
class Reduced:
    """One simulation's features, of a sound specimen only, and its change against the specimen's sound first run.

    `alone` has each channel's own change where there are further channels; they have no part in `change`.
    """

    names: tuple[str, ...]
    values: FloatArray
    change_names: tuple[str, ...]
    change: FloatArray
    alone: Mapping[str, FloatArray] = field(default_factory=dict)


def finished_runs(
    tasks: Sequence[Task], processes: int, on_progress: Callable[[int, int], object], *, n_together: int = 1
) -> list[Reduced | str]:
    """Return what each task gave, or why it could not be simulated, in the order of the tasks.

    So many tasks on end go to one process: those that share a sound run then simulate it once. A twin that other
    processes could not know, as it is defined in the caller's script, runs in this one.
    """
    found: list[Reduced | str] = [""] * len(tasks)
    if processes == 1 or not can_be_sent(tasks[:1]):
        known: Known = {}
        for i, task in enumerate(tasks):
            found[i] = _reduced(task, known)
            on_progress(i + 1, len(tasks))
        return found
    with process_pool(processes) as pool:
        starts = range(0, len(tasks), n_together)
        waiting = {pool.submit(reduced_in_worker, tasks[i : i + n_together]): i for i in starts}
        done = 0
        for future in as_completed(waiting):
            rows = future.result()
            found[waiting[future] : waiting[future] + len(rows)] = rows
            done += len(rows)
            on_progress(done, len(tasks))
    return found


Known = dict[tuple[SoundKey, int], Gathered]
_KNOWN: Known = {}
"""Sound first runs by point, length and seed, of the one twin that a worker works for."""


def reduced_in_worker(tasks: Sequence[Task]) -> list[Reduced | str]:
    """Return what tasks give, in a process that lives for one twin only."""
    return [_reduced(task, _KNOWN) for task in tasks]


def _reduced(task: Task, known: Known) -> Reduced | str:
    from gearsig.gap.change import change_once
    from gearsig.gap.features import once

    run = task.run
    key = run.sound_key, task.seed
    try:
        if key not in known:
            known[key] = _gathered(run, task.seed, None, 0)
        sound = known[key]
        # A sound specimen is measured again with other noise: against itself everything would be zero.
        now = _gathered(run, task.seed, task.added, run.noise if task.added is not None else max(run.noise, 1))
        alone = {}
        if task.further:
            alone = {name: change_once(_of(now, name), _of(sound, name))[1] for name in sound.channels}
            own = [name for name in sound.channels if name not in task.further]
            now, sound = _of(now, *own), _of(sound, *own)
        names, values = once(sound) if task.added is None else ((), np.empty(0))
        return Reduced(names, values, *change_once(now, sound), alone)
    except GearsigError as error:
        return str(error)


def _of(gathered: Gathered, *channels: str) -> Gathered:
    return gathered.with_channels({name: gathered.channels[name] for name in channels})


def _gathered(run: Run, seed: int, added: Added | None, noise: int) -> Gathered:
    from gearsig.gap.gather import gather

    recording = run.twin.run(
        run.point,
        () if added is None else (added,),
        seed=seed,
        duration_s=run.duration_s,
        sampling_rate_hz=run.sampling_rate_hz,
        noise=noise,
    )
    assert recording.rig is not None  # noqa: S101  part of the protocol
    return gather(recording, recording.rig)
