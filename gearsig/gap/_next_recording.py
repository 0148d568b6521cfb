"""Which further recording would separate the two most probable effects, according to the model."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence

import numpy as np

from gearsig.checks import FloatArray
from gearsig.gap._conditions import Condition
from gearsig.gap._floors import family_members
from gearsig.gap._report import (
    NEXT_STEPS,
    NONE,
    SLOW_RPM,
    UNKNOWN,
    WIDE,
    GapCause,
    GapOutcome,
    NextRecording,
    NextStep,
)
from gearsig.gap._simulator import HasFurtherPlaces, OperatingCondition, Twin, point_text, same_condition
from gearsig.gap._trials import PROCESSES, Reduced, Task, TriedEffect, TwinRun, finished_runs, n_compared, rounded
from gearsig.severity import TOOTH_FAULTS

FACTORS = ((1.0, 0.3), (1.0, 0.6), (0.6, 1.0), (1.4, 1.0))
"""Speeds and torques evaluated in addition to the recordings' own, relative to those of the first recording."""

LENGTH_RATIO = 0.6
"""Length of these runs relative to a trial: only the distance between two effects is needed, and a third of a
diagnosis's time was spent on it."""

MIN_DISTANCE_RATIO = 1.2
"""Minimum ratio to the present distance for a further point to be worth naming."""

PRESENT_SENSORS = ""
"""Stands for all of the rig's own sensors among names of channels."""


def next_recordings(
    first: TriedEffect,
    second: TriedEffect,
    titles: tuple[str, str],
    twin: Twin,
    conditions: Sequence[Condition],
    *,
    simulate: Callable[..., Sequence[Reduced | str]] = finished_runs,
) -> tuple[NextRecording, ...]:
    """Return points and places at which both effects are further apart than in the present recordings, best first.

    Both fitted effects are simulated at the recordings' own and at other speeds and torques, with an additional sensor
    at each place that the twin offers. A sensor is named only if it separates the effects better than any existing one.
    Its simulated housing is hypothetical: the comparison reflects its distance from gears and bearings. One channel is
    compared using the floors of several.

    Parameters
    ----------
    first, second : TriedEffect
    titles : (str, str)
        Titles of both effects.
    twin : Twin
    conditions : sequence of Condition
    simulate : callable
        Runs the tasks, as `finished_runs` does in processes.
    """
    base = conditions[0].facts
    measured, places = twin.with_further_sensors() if isinstance(twin, HasFurtherPlaces) else (twin, {})
    present_points = [condition.facts.point for condition in conditions]
    further = [OperatingCondition(v * base.point.speed_rpm, t * base.point.torque_nm) for v, t in FACTORS]
    points = _distinct([*present_points, *(rounded(point, 2) for point in further)])
    runs = [
        TwinRun(
            measured,
            p,
            LENGTH_RATIO * conditions[0].trial_s * max(1.0, base.point.speed_rpm / p.speed_rpm),
            base.sampling_rate_hz,
        )
        for p in points
    ]
    tasks = [Task(run, tried.fit.added, tuple(places)) for run in runs for tried in (first, second)]
    rows = simulate(tasks, PROCESSES, lambda *_: None, n_together=2)
    at = {
        point: _distances(conditions, of_first, of_second)
        for point, of_first, of_second in zip(points, rows[::2], rows[1::2], strict=True)
    }
    known = [distances for point, distances in at.items() if point in present_points and distances]
    if not known:
        return ()
    now = max(distances[PRESENT_SENSORS] for distances in known)
    best_sensor = max(d for distances in known for channel, d in distances.items() if channel not in places)
    recordings = []
    for point, distances in at.items():
        for channel, apart in _informative_sensors(distances, places, now, best_sensor):
            place = places.get(channel, "")
            text = _text(
                point, place, f"{titles[0]} and {titles[1]} are {apart:.2g}", now, is_new=point not in present_points
            )
            recordings.append(NextRecording(point, (first.name, second.name), apart, now, text, place))
    return tuple(sorted(recordings, key=lambda of_first: -of_first.standard_deviations)[:5])


def _distinct(points: Sequence[OperatingCondition]) -> list[OperatingCondition]:
    """Return the points without those at nearly the same speed and torque as an earlier one."""
    distinct: list[OperatingCondition] = []
    for point in points:
        if not any(same_condition(point, before) for before in distinct):
            distinct.append(point)
    return distinct


def _distances(conditions: Sequence[Condition], first: Reduced | str, second: Reduced | str) -> dict[str, float]:
    """Return the distance of two simulations on all of the rig's own sensors, and on each sensor alone."""
    if not (isinstance(first, Reduced) and isinstance(second, Reduced)):
        return {}
    alone = {name: _family_distance(conditions, change - second.alone[name]) for name, change in first.alone.items()}
    return {PRESENT_SENSORS: _family_distance(conditions, first.change - second.change), **alone}


def _informative_sensors(
    distances: Mapping[str, float], places: Mapping[str, str], now: float, best_sensor: float
) -> Iterator[tuple[str, float]]:
    """Yield the rig's own sensors, and the best additional one if it is better, where the gain is worth it."""
    with_present_sensors = distances.get(PRESENT_SENSORS, 0.0)
    if with_present_sensors >= MIN_DISTANCE_RATIO * now:
        yield PRESENT_SENSORS, with_present_sensors
    further = {name: d for name, d in distances.items() if name in places}
    best = max(further, key=further.__getitem__, default="")
    usual = max([best_sensor, with_present_sensors, *(d for name, d in distances.items() if name not in places)])
    if best and further[best] >= MIN_DISTANCE_RATIO * usual:
        yield best, further[best]


def _text(point: OperatingCondition, place: str, apart: str, now: float, *, is_new: bool) -> str:
    where = f"record at {point_text(point)}"
    if place:
        where = f"{where}, with" if is_new else "at the same speed and load, add"
        where += f" a further sensor at {place}"
    return f"{where}: there {apart} structural floors apart, {now:.2g} so far."


def _family_distance(conditions: Sequence[Condition], difference: FloatArray) -> float:
    """Return the root of the sum over families of the mean squared difference in floors."""
    n = n_compared(conditions)
    names = conditions[0].change.names[:n]
    squares = (difference[:n] / conditions[0].floor.of(names)) ** 2
    return float(np.sqrt(sum(float(squares[rows].mean()) for rows in family_members(names).values())))


# --------------------
# Steps other than another speed, load or place, chosen by which effects are confused, not by the model.
# --------------------


LIKELY = 0.1
"""Probability from which an effect counts as one of those to be separated."""

PASSED_ON = ("transfer_path", "tooth_wear", "surface_roughness", "sliding_friction", "bearing_clearance")
AROUND_A_SHAFT = ("unbalance", "eccentricity", "misalignment")
"""Groups of effects that are mistaken for each other."""


def next_steps(
    outcome: GapOutcome,
    causes: Sequence[GapCause],
    points: Sequence[OperatingCondition],
    *,
    has_reference: bool,
    has_encoders: bool,
    is_labelled: bool,
    has_run_up: bool = False,
) -> tuple[NextStep, ...]:
    """Return steps that would separate the likely causes, best first; empty where there is no gap.

    Parameters
    ----------
    outcome : GapOutcome
    causes : sequence of GapCause
    points : sequence of OperatingCondition
        Points of the recordings.
    has_reference, has_encoders, is_labelled, has_run_up : bool
        Whether every recording has a healthy reference; both shafts have an encoder; recordings of the rig are
        labelled; a run-up of the healthy machine was given, or the simulator cannot run up for comparison.
    """
    if outcome is GapOutcome.NO_GAP:
        return ()
    likely = [cause.name for cause in causes if cause.probability >= LIKELY]
    speeds = [point.speed_rpm for point in points]
    slow = {round(point.torque_nm, 3) for point in points if point.speed_rpm <= SLOW_RPM}
    is_which_tooth_fault = sum(name in TOOTH_FAULTS for name in likely) > 1
    passed_on = any(sum(name in group for name in likely) > 1 for group in (PASSED_ON, AROUND_A_SHAFT))
    is_worth = {
        "healthy": not has_reference,
        "encoders": is_which_tooth_fault and not has_encoders,
        "slow_loads": is_which_tooth_fault and len(slow) < 2,
        "run_up": is_which_tooth_fault and has_reference and not has_run_up,
        "other_speed": passed_on and max(speeds) < WIDE * min(speeds),
        "less_gain": "clipping" in likely and len({*likely} - {NONE, UNKNOWN}) > 1,
        "label": not is_labelled and outcome is not GapOutcome.EFFECT and not {NONE, UNKNOWN}.issuperset(likely),
    }
    return tuple(NextStep(code, NEXT_STEPS[code]) for code, worth in is_worth.items() if worth)
