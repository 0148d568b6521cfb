"""When the motor drives, when the brake holds, when the press strikes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gearsig.checks import FloatArray, not_negative, one_of, positive
from gearsig.errors import InputError
from sims.machine.operation import Course

START_STOP, CONTINUOUS = MODES = ("start-stop", "continuous")


@dataclass(frozen=True)
class Cycle:
    """How the manipulator works: drive, stop, forge, again; or drive all the time.

    Parameters
    ----------
    mode : str
        One of `MODES`.
    on_s, off_s : float
        How long the torque is on, then off; above 0.
    rise_s : float
        In which the valve opens or closes; above 0.
    brake_nm : float
        On the motor's shaft while the torque is off.
    brake_delay_s : float
        From closed valve to brake.
    press_nm : float
        Largest torque of a press blow on the wheel, positive forwards; a parabola over time.
    press_delay_s, press_duration_s : float
        From the torque's end to the blow, and its length.
    """

    mode: str = START_STOP
    on_s: float = 1.0
    off_s: float = 2.0
    rise_s: float = 0.02
    brake_nm: float = 0.0
    brake_delay_s: float = 0.0
    press_nm: float = 0.0
    press_delay_s: float = 1.0
    press_duration_s: float = 0.02

    def __post_init__(self) -> None:
        one_of(self.mode, "mode", MODES)
        for name in ("on_s", "off_s", "rise_s", "press_duration_s"):
            positive(getattr(self, name), name, "s")
        for name in ("brake_delay_s", "press_delay_s"):
            not_negative(getattr(self, name), name, "s")
        not_negative(self.brake_nm, "brake_nm", "N m")
        if self.mode == START_STOP:
            self._check_times()

    def _check_times(self) -> None:
        if self.rise_s >= min(self.on_s, self.off_s):
            raise InputError(f"rise_s is {self.rise_s:g} s", allowed="less than on_s and off_s")
        if self.press_nm and self.press_delay_s + self.press_duration_s > self.off_s:
            raise InputError(
                f"the press blow ends {self.press_delay_s + self.press_duration_s:g} s after the torque",
                allowed=f"within off_s, {self.off_s:g} s",
            )
        if self.brake_nm and self.brake_delay_s + 2.0 * self.rise_s >= self.off_s:
            raise InputError(f"brake_delay_s is {self.brake_delay_s:g} s", allowed=f"well within {self.off_s:g} s")

    def starts_s(self, duration_s: float) -> FloatArray:
        """Times at which the torque comes on."""
        if self.mode == CONTINUOUS:
            return np.zeros(1)
        return np.arange(0.0, duration_s, self.on_s + self.off_s)


@dataclass(frozen=True)
class Schedule:
    """Courses of a run: torque and brake of the motor, torque of the press on the wheel, in N m."""

    torque_nm: Course
    brake_nm: Course
    press_nm: Course

    def stretches(self, duration_s: float) -> FloatArray:
        """Times between which all courses are straight, from 0 to `duration_s`."""
        knots = np.concatenate([c.times_s for c in (self.torque_nm, self.brake_nm, self.press_nm)])
        inside = knots[(knots > 0.0) & (knots < duration_s)]
        return np.unique(np.round(np.concatenate([[0.0], inside, [duration_s]]), 12))

    def straight(self, start_s: float, end_s: float) -> FloatArray:
        """Start time, then value and slope of torque, brake and press over one stretch."""
        values = [start_s]
        for course in (self.torque_nm, self.brake_nm, self.press_nm):
            first, last = (float(course.at(time)) for time in (start_s, end_s))
            values += [first, (last - first) / (end_s - start_s)]
        return np.array(values)


def schedule(cycle: Cycle, torque_nm: Course, duration_s: float) -> Schedule:
    """Return the courses of a run from rest; a stop must fit into the record.

    Raises
    ------
    InputError
        If a stop is longer than the record.
    """
    positive(duration_s, "duration_s", "s")
    if cycle.mode == CONTINUOUS:
        gate = Course.of([0.0, cycle.rise_s], [0.0, 1.0])
        nothing = Course.constant(0.0)
        return Schedule(_product(torque_nm, gate), nothing, nothing)
    if cycle.off_s >= duration_s:
        raise InputError(
            f"a stop of off_s = {cycle.off_s:g} s is longer than the record of {duration_s:g} s",
            allowed="a stop that ends within the record",
            remedy="raise --duration or lower off_s",
        )
    starts = cycle.starts_s(duration_s)
    ends = starts + cycle.on_s
    gate = _pulses(starts, ends, cycle.rise_s)
    brake_on = ends + cycle.rise_s + cycle.brake_delay_s
    brake = _pulses(brake_on, starts + cycle.on_s + cycle.off_s - cycle.rise_s, cycle.rise_s, cycle.brake_nm)
    return Schedule(_product(torque_nm, gate), brake, _blows(ends + cycle.press_delay_s, cycle))


def _pulses(starts: FloatArray, ends: FloatArray, rise_s: float, height: float = 1.0) -> Course:
    """Rise from each start, fall from each end, in `rise_s`."""
    if height == 0.0:
        return Course.constant(0.0)
    times = np.stack([starts, starts + rise_s, ends, ends + rise_s], axis=1).ravel()
    values = np.tile([0.0, height, height, 0.0], len(starts))
    keep = np.concatenate([[True], np.diff(times) > 1e-12])
    return Course.of(times[keep], values[keep])


def _blows(starts: FloatArray, cycle: Cycle, n_points: int = 9) -> Course:
    """Parabolas of the press's torque, as straight pieces."""
    if cycle.press_nm == 0.0:
        return Course.constant(0.0)
    x = np.linspace(0.0, 1.0, n_points)
    times = (starts[:, None] + cycle.press_duration_s * x).ravel()
    return Course.of(times, np.tile(4.0 * cycle.press_nm * x * (1.0 - x), len(starts)))


def _product(first: Course, second: Course) -> Course:
    """Product at the knots of both, straight between."""
    times = np.unique(np.concatenate([first.times_s, second.times_s]))
    return Course.of(times, first.at(times) * second.at(times))
