"""A start–stop recording cut into its cycles: start, run, stop, rest."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gearsig.checks import FloatArray
from gearsig.errors import RefusalError
from gearsig.motion.course import Course, is_start_stop
from gearsig.motion.start_stop import course_of_angle
from gearsig.motion.types import PairMotion

FEWEST = 2
LEAST_STANDING = 0.05
"""Of the time: a machine that stands so long has stopped."""
HIGHEST_RATE_HZ = 2000.0
"""Motion of shafts is slower; vibration is not looked at here."""
STARTING_S, SETTLING_S = 0.15, 0.1
"""How long a start rings, and a stop: times of the shares over phases, not of the fits."""
PHASES = ("start", "run", "stop", "rest")


@dataclass(frozen=True)
class CycledMotion:
    """A motion and its cycles.

    Parameters
    ----------
    motion : PairMotion
    course : Course
        Of the driver.
    number : array of int, (n,)
        Cycle of each sample, from 0; −1 ahead of the first start.
    phase : array of int, (n,)
        Place in `PHASES`.
    """

    motion: PairMotion
    course: Course
    number: NDArray[np.int64]
    phase: NDArray[np.int64]

    @property
    def n_cycles(self) -> int:
        """Starts with what follows them, up to the next."""
        return int(self.number.max()) + 1

    def samples_of(self, cycles: tuple[int, ...]) -> NDArray[np.bool_]:
        """Which samples belong to some cycles."""
        found: NDArray[np.bool_] = np.isin(self.number, cycles)
        return found


def cut_cycles(motion: PairMotion) -> CycledMotion:
    """Cut a motion into cycles.

    Raises
    ------
    RefusalError
        If it does not start and stop, or hardly ever: nothing would be left to check a fit on.
    """
    thinned = thin(motion)
    course = course_of_angle(thinned.driver_angle_rad, thinned.sampling_rate_hz)
    where = thinned.source or "the recording"
    if not is_start_stop(course) and course.standing_part < LEAST_STANDING:
        raise RefusalError(
            f"{where} turns all the time: no start and stop is in it, and the start–stop diagnosis rests on them",
            remedy="record starts and stops; compare stationary running with --model cracked or reduced-fe",
        )
    moving = course.moving
    if len(moving) < FEWEST:
        n = f"{len(moving)} start{'' if len(moving) == 1 else 's'}"
        raise RefusalError(
            f"{where} has {n}: what is fitted to one cycle must be checked on another",
            remedy="record several starts and stops; six or more tell most",
        )
    number = np.full(len(thinned.driver_angle_rad), -1, dtype=np.int64)
    phase = np.full(len(number), PHASES.index("rest"), dtype=np.int64)
    rate = thinned.sampling_rate_hz
    for i, stretch in enumerate(moving):
        number[stretch.first :] = i
        begun = min(stretch.first + round(STARTING_S * rate), stretch.last)
        stops = _stop_of(thinned, stretch.first, stretch.last)
        phase[stretch.first : stops] = PHASES.index("run")
        phase[stretch.first : min(begun, stops)] = PHASES.index("start")
        phase[stops : stretch.last + round(SETTLING_S * rate)] = PHASES.index("stop")
    return CycledMotion(thinned, course, number, phase)


def halves(cycles: CycledMotion) -> tuple[tuple[int, ...], tuple[int, ...]]:
    """Every second cycle, and the others: what drifts is in both."""
    n = cycles.n_cycles
    return tuple(range(0, n, 2)), tuple(range(1, n, 2))


def thin(motion: PairMotion) -> PairMotion:
    """Return every n-th sample of a motion that is sampled faster than shafts move: instants stay instants."""
    step = max(1, int(motion.sampling_rate_hz / HIGHEST_RATE_HZ + 1e-9))
    if step == 1:
        return motion

    def every(values: FloatArray) -> FloatArray:
        return values[::step]

    return replace(
        motion,
        sampling_rate_hz=motion.sampling_rate_hz / step,
        driver_angle_rad=every(motion.driver_angle_rad),
        driven_angle_rad=every(motion.driven_angle_rad),
        driver_speed_rad_s=every(motion.driver_speed_rad_s),
        driven_speed_rad_s=every(motion.driven_speed_rad_s),
        driver_acceleration_rad_s2=every(motion.driver_acceleration_rad_s2),
        driven_acceleration_rad_s2=every(motion.driven_acceleration_rad_s2),
        torque_nm=None if motion.torque_nm is None else every(motion.torque_nm),
        force_n=None if motion.force_n is None else every(motion.force_n),
    )


def _stop_of(motion: PairMotion, first: int, last: int) -> int:
    """Sample from which the driver only slows down: the last at which it has 90 % of the stretch's top speed."""
    speed = np.abs(motion.driver_speed_rad_s[first:last])
    fast = np.flatnonzero(speed > 0.9 * np.quantile(speed, 0.98))
    return first + int(fast[-1]) + 1 if len(fast) else last
