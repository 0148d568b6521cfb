"""Phases of a machine that starts and stops: run-up, running, run-down, rest."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gearsig.checks import FloatArray
from gearsig.motion.course import Course, Stretch
from gearsig.motion.derivatives import local_polynomial

RUNNING_PART = 0.9
"""Of a stretch's highest speed: from when it is first reached until it is last seen, the machine runs."""
RUN_UP, RUNNING, RUN_DOWN, AT_REST = "run-up", "running", "run-down", "at rest"
SPEED_BANDWIDTH_HZ = 50.0
"""In which a shaft starts and stops; what is faster is ringing."""


@dataclass(frozen=True)
class Phase:
    """A time with a name: one of `RUN_UP`, `RUNNING`, `RUN_DOWN`, `AT_REST`."""

    name: str
    start_s: float
    end_s: float


def shaft_speed_rad_s(angle_rad: FloatArray, sampling_rate_hz: float) -> FloatArray:
    """Return the speed of a shaft within 50 Hz, (n,), from its angle."""
    smoother = local_polynomial(sampling_rate_hz, min(SPEED_BANDWIDTH_HZ, 0.1 * sampling_rate_hz))
    return smoother.apply(angle_rad, 1)


def find_phases(course: Course, speed_rad_s: FloatArray, sampling_rate_hz: float) -> tuple[Phase, ...]:
    """Cut every stretch in motion where it first reaches, and where it last has, 90 % of its highest speed.

    Parameters
    ----------
    course : Course
    speed_rad_s : array, (n,)
        The smoothed one that the course was found from: ringing would pass for running.
    sampling_rate_hz : float

    Returns
    -------
    tuple of Phase
        One after the other from the record's begin to its end; a phase of no length is left out. A stretch that is
        cut by the record's end has no run-down, one that is cut by its begin no run-up.
    """
    phases: list[Phase] = []
    for stretch in course.stretches:
        if stretch.direction:
            phases += _of_motion(stretch, np.abs(speed_rad_s[stretch.first : stretch.last]), sampling_rate_hz)
        else:
            phases.append(Phase(AT_REST, stretch.start_s, stretch.end_s))
    return tuple(phases)


def _of_motion(stretch: Stretch, speed_rad_s: FloatArray, rate_hz: float) -> list[Phase]:
    fast = np.flatnonzero(speed_rad_s >= RUNNING_PART * float(speed_rad_s.max()))
    up, down = stretch.start_s + fast[0] / rate_hz, stretch.start_s + (fast[-1] + 1) / rate_hz
    edges = [(RUN_UP, stretch.start_s, up), (RUNNING, up, down), (RUN_DOWN, down, stretch.end_s)]
    return [Phase(name, float(a), float(b)) for name, a, b in edges if b - a > 0.5 / rate_hz]
