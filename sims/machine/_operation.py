"""How a machine is run: speed and torque over time."""

# mypy: allow-untyped-defs, allow-untyped-calls

from __future__ import annotations

from dataclasses import dataclass
from math import cos, sin

import numpy as np

from gearsig.checks import FloatArray, frozen_array
from gearsig.compiled import njit
from gearsig.errors import InputError
from sims.compiled import UNCOUNTED


@dataclass(frozen=True)
class Profile:
    """A quantity over time: straight lines between given points, held before the first and after the last.

    Parameters
    ----------
    times_s : array, (n,)
        Rising; time 0 is the start of the recording.
    values : array, (n,)

    Examples
    --------
    >>> run_up = Profile.of([0.0, 10.0], [300.0, 1500.0])
    >>> float(run_up.at(2.5))
    600.0
    """

    times_s: FloatArray
    values: FloatArray

    def __post_init__(self) -> None:
        times = frozen_array(self.times_s, "times_s of a profile", ndim=1)
        values = frozen_array(self.values, "values of a profile", ndim=1)
        if len(times) != len(values) or len(times) == 0 or np.any(np.diff(times) <= 0):
            raise InputError(
                f"{len(times)} times for {len(values)} values of a profile, or times that do not rise",
                allowed="one value per time, times rising",
            )
        object.__setattr__(self, "times_s", times)
        object.__setattr__(self, "values", values)

    def as_dict(self) -> dict[str, list[float]]:
        """Times and values as plain numbers."""
        return {"times_s": self.times_s.tolist(), "values": self.values.tolist()}

    @classmethod
    def constant(cls, value: float) -> Profile:
        """Return a quantity that stays the same."""
        return cls(np.zeros(1), np.array([float(value)]))

    @classmethod
    def of(cls, times_s: object, values: object) -> Profile:
        """Return a profile through points given as any sequences."""
        return cls(np.asarray(times_s, dtype=np.float64), np.asarray(values, dtype=np.float64))

    @property
    def largest(self) -> float:
        """Largest magnitude."""
        return float(np.max(np.abs(self.values)))

    def at(self, time_s: FloatArray | float) -> FloatArray:
        """Value at the given times."""
        result: FloatArray = np.asarray(np.interp(time_s, self.times_s, self.values))
        return result


@dataclass(frozen=True)
class Operation:
    """Set speed and set torque of the input shaft.

    Parameters
    ----------
    speed_rpm : Profile
        Not below 0.
    torque_nm : Profile
        Not below 0; the load on the output is this times the ratio. 0 lets the teeth rattle.
    """

    speed_rpm: Profile
    torque_nm: Profile

    def __post_init__(self) -> None:
        for name, profile, unit in (("speed_rpm", self.speed_rpm, "rpm"), ("torque_nm", self.torque_nm, "N m")):
            if np.min(profile.values) < 0.0:
                raise InputError(f"{name} falls to {np.min(profile.values):g} {unit}", allowed=f"at least 0 {unit}")

    @classmethod
    def steady(cls, speed_rpm: float, torque_nm: float) -> Operation:
        """Return constant speed and torque."""
        return cls(Profile.constant(speed_rpm), Profile.constant(torque_nm))


# Compiled: set speed and torque over time.


@njit(cache=True, nogil=True, error_model="numpy", **UNCOUNTED)
def profile(points, t):
    """Value and slope at t: straight between points, held outside; (2, n) times and values."""
    n = points.shape[1]
    if t <= points[0, 0]:
        return points[1, 0], 0.0
    if t >= points[0, n - 1]:
        return points[1, n - 1], 0.0
    low, high = 0, n - 1
    while high - low > 1:
        middle = (low + high) // 2
        if points[0, middle] <= t:
            low = middle
        else:
            high = middle
    slope = (points[1, high] - points[1, low]) / (points[0, high] - points[0, low])
    return points[1, low] + slope * (t - points[0, low]), slope


@njit(cache=True, nogil=True, error_model="numpy", **UNCOUNTED)
def profile_value(points, t):
    """Value at t."""
    return profile(points, t)[0]


@njit(cache=True, nogil=True, error_model="numpy", **UNCOUNTED)
def set_speed(k, speed, t):
    """Set speed in rad/s and its slope, swings included."""
    value, slope = profile(speed, t)
    factor, rate = 1.0, 0.0
    for i in range(k.n_swings):
        amplitude, omega, phase = k.swings[i, 0], k.swings[i, 1], k.swings[i, 2]
        factor += amplitude * sin(omega * t + phase)
        rate += amplitude * omega * cos(omega * t + phase)
    return value * factor, slope * factor + value * rate


@njit(cache=True, nogil=True, error_model="numpy", **UNCOUNTED)
def torque_ripple(k, theta):
    """Drive torque over its set value at the rotor's angle."""
    factor = 1.0
    for i in range(k.n_ripples):
        factor += k.ripples[i, 1] * cos(k.ripples[i, 0] * theta + k.ripples[i, 2])
    return factor
