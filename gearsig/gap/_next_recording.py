"""Which further recording would tell the two likeliest effects apart, by the model."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence

import numpy as np

from gearsig.checks import FloatArray
from gearsig.gap._conditions import SEED, Condition
from gearsig.gap._floors import family_members
from gearsig.gap._simulator import HasFurtherPlaces, OperatingCondition, Twin
from gearsig.gap._trials import PROCESSES, Reduced, Task, TriedEffect, TwinRun, finished_runs, n_compared
from gearsig.gap._types import NextRecording
from gearsig.gap._words import point_text, same_condition

FACTORS = ((1.0, 0.3), (1.0, 0.6), (0.6, 1.0), (1.4, 1.0))
"""Speeds and torques that are looked at, over those of the first recording, beside the recordings' own."""

ENOUGH = 1.2
"""Times the distance that there is now, from which a further point is worth naming."""

OWN = ""
"""Stands for the rig's own sensors together among names of channels."""


def next_recordings(
    first: TriedEffect,
    second: TriedEffect,
    titles: tuple[str, str],
    twin: Twin,
    conditions: Sequence[Condition],
    *,
    simulate: Callable[..., Sequence[Reduced | str]] = finished_runs,
) -> tuple[NextRecording, ...]:
    """Return points and places at which both effects lie further apart than in the recordings there are, best first.

    Both fitted effects are simulated at the recordings' own and at other speeds and torques, with a further sensor at
    each place that the twin has. A sensor is named only if it shows more than any that there is. Its housing is a drawn
    one: what is compared is how far from gears and bearings it sits. One channel is held against the floors of several.

    Parameters
    ----------
    first, second : Tried
    titles : (str, str)
        Of both effects, for people.
    twin : Twin
    conditions : sequence of Condition
    simulate : callable
        Runs the tasks, as `finished_runs` does in processes.
    """
    base = conditions[0].facts
    measured, places = twin.with_further_sensors() if isinstance(twin, HasFurtherPlaces) else (twin, {})
    here = [condition.facts.point for condition in conditions]
    points = _distinct([*here, *(_rounded(v * base.point.speed_rpm, t * base.point.torque_nm) for v, t in FACTORS)])
    runs = [
        TwinRun(
            measured, p, conditions[0].trial_s * max(1.0, base.point.speed_rpm / p.speed_rpm), base.sampling_rate_hz, 1
        )
        for p in points
    ]
    tasks = [Task(run, SEED, tried.fit.added, tuple(places)) for run in runs for tried in (first, second)]
    rows = simulate(tasks, PROCESSES, lambda *_: None, n_together=2)
    at = {
        point: _distances(conditions, one, other)
        for point, one, other in zip(points, rows[::2], rows[1::2], strict=True)
    }
    known = [distances for point, distances in at.items() if point in here and distances]
    if not known:
        return ()
    now = max(distances[OWN] for distances in known)
    best_sensor = max(d for distances in known for channel, d in distances.items() if channel not in places)
    found = []
    for point, distances in at.items():
        for channel, apart in _worth_naming(distances, places, now, best_sensor):
            place = places.get(channel, "")
            text = _text(point, place, f"{titles[0]} and {titles[1]} lie {apart:.2g}", now, is_new=point not in here)
            found.append(NextRecording(point, (first.name, second.name), apart, now, text, place))
    return tuple(sorted(found, key=lambda one: -one.standard_deviations)[:5])


def _rounded(speed_rpm: float, torque_nm: float) -> OperatingCondition:
    """Return a point that is easily set."""
    return OperatingCondition(*(float(f"{value:.2g}") for value in (speed_rpm, torque_nm)))


def _distinct(points: Sequence[OperatingCondition]) -> list[OperatingCondition]:
    """Return the points without those at nearly the speed and torque of one before them."""
    found: list[OperatingCondition] = []
    for point in points:
        if not any(same_condition(point, other) for other in found):
            found.append(point)
    return found


def _distances(conditions: Sequence[Condition], one: Reduced | str, other: Reduced | str) -> dict[str, float]:
    """Return the distance of two simulations on the rig's own sensors together, and on each sensor alone."""
    if not (isinstance(one, Reduced) and isinstance(other, Reduced)):
        return {}
    alone = {name: _apart(conditions, change - other.alone[name]) for name, change in one.alone.items()}
    return {OWN: _apart(conditions, one.change - other.change), **alone}


def _worth_naming(
    distances: Mapping[str, float], places: Mapping[str, str], now: float, best_sensor: float
) -> Iterator[tuple[str, float]]:
    """Yield the rig's own sensors, and the best further one if it shows more than they, where it is worth it."""
    own = distances.get(OWN, 0.0)
    if own >= ENOUGH * now:
        yield OWN, own
    further = {name: d for name, d in distances.items() if name in places}
    best = max(further, key=further.__getitem__, default="")
    usual = max([best_sensor, own, *(d for name, d in distances.items() if name not in places)])
    if best and further[best] >= ENOUGH * usual:
        yield best, further[best]


def _text(point: OperatingCondition, place: str, apart: str, now: float, *, is_new: bool) -> str:
    where = f"record at {point_text(point)}"
    if place:
        where = f"{where}, with" if is_new else "at the same speed and load, add"
        where += f" a further sensor at {place}"
    return f"{where}: there {apart} structural floors apart, {now:.2g} so far."


def _apart(conditions: Sequence[Condition], difference: FloatArray) -> float:
    """Root of the sum over families of the mean squared difference in floors."""
    n = n_compared(conditions)
    names = conditions[0].change.names[:n]
    squares = (difference[:n] / conditions[0].floor.of(names)) ** 2
    return float(np.sqrt(sum(float(squares[rows].mean()) for rows in family_members(names).values())))
