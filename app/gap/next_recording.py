"""Which further recording would tell the two likeliest effects apart, by the model."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from app.gap.bank_runs import Reduced, Run, Task, finished_runs
from app.gap.candidates import PROCESSES, Tried, n_compared
from app.gap.conditions import SEED, Condition
from gearsig.checks import FloatArray
from gearsig.gap.families import family_members
from gearsig.gap.simulator import Point, Twin
from gearsig.gap.types import NextRecording

FACTORS = ((1.0, 0.3), (1.0, 0.6), (0.6, 1.0), (1.4, 1.0))
"""Speeds and torques that are looked at, over those of the first recording."""

ENOUGH = 1.2
"""Times the distance that there is now, from which a further point is worth naming."""


def next_recordings(
    first: Tried, second: Tried, twin: Twin, conditions: Sequence[Condition]
) -> tuple[NextRecording, ...]:
    """Return points at which both effects' predictions lie further apart than at those there are, best first."""
    base = conditions[0]
    n = n_compared(conditions)
    names = base.change.names[:n]
    floors = base.floor.of(names)
    now = max(_apart(names, first.fit.at(k) - second.fit.at(k), floors) for k in range(len(conditions)))
    points = [Point(v * base.facts.point.speed_rpm, t * base.facts.point.torque_nm) for v, t in FACTORS]
    runs = [
        Run(twin, p, base.run_s * max(1.0, base.facts.point.speed_rpm / p.speed_rpm), base.facts.sampling_rate_hz, 1)
        for p in points
    ]
    tasks = [Task(run, SEED, tried.fit.added) for run in runs for tried in (first, second)]
    rows = finished_runs(tasks, PROCESSES, lambda *_: None)
    found = []
    for point, a, b in zip(points, rows[::2], rows[1::2], strict=True):
        if not (isinstance(a, Reduced) and isinstance(b, Reduced)):
            continue
        apart = _apart(names, (a.change - b.change)[:n], floors)
        if apart >= ENOUGH * now:
            text = (
                f"record at {point.speed_rpm:.3g} rpm and {point.torque_nm:.3g} N m: there {_words(first.name)} and "
                f"{_words(second.name)} lie {apart:.2g} structural floors apart, {now:.2g} so far."
            )
            found.append(NextRecording(point, (first.name, second.name), apart, now, text))
    return tuple(sorted(found, key=lambda one: -one.standard_deviations))


def _apart(names: Sequence[str], difference: FloatArray, floors: FloatArray) -> float:
    """Root of the sum over families of the mean squared difference in floors."""
    squares = (difference / floors) ** 2
    return float(np.sqrt(sum(float(squares[rows].mean()) for rows in family_members(names).values())))


def _words(name: str) -> str:
    return name.replace("_", " ")
