"""Speed profiles of the reference shaft, whose angle is known in closed form.

Every profile starts at angle 0 at time 0 and turns at its first speed before that, so that filters can settle ahead of
the recording.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from gearsig.checks import FloatArray


class SpeedProfile(Protocol):
    """Angle and speed of the reference shaft over time."""

    def revolutions(self, time_s: FloatArray) -> FloatArray:
        """Shaft angle in revolutions, exact, 0 at time 0."""
        ...

    def speed_rpm(self, time_s: FloatArray) -> FloatArray:
        """Speed in rpm, 60 times the derivative of `revolutions`."""
        ...


@dataclass(frozen=True)
class ConstantProfile:
    """θ(t) = n t."""

    rpm: float

    def revolutions(self, time_s: FloatArray) -> FloatArray:
        """Shaft angle in revolutions."""
        return np.asarray(time_s, dtype=np.float64) * (self.rpm / 60)

    def speed_rpm(self, time_s: FloatArray) -> FloatArray:
        """Speed in rpm."""
        return np.full(np.shape(time_s), float(self.rpm))


@dataclass(frozen=True)
class LinearRamp:
    """θ(t) = n₀ t + (n₁ - n₀) t²/(2T): run-up or run-down between two speeds; both speeds are held outside 0…T."""

    start_rpm: float
    end_rpm: float
    duration_s: float

    def revolutions(self, time_s: FloatArray) -> FloatArray:
        """Shaft angle in revolutions."""
        t = np.asarray(time_s, dtype=np.float64)
        inside = np.clip(t, 0.0, self.duration_s)
        n0, n1 = self.start_rpm / 60, self.end_rpm / 60
        ramp = n0 * inside + (n1 - n0) * inside**2 / (2 * self.duration_s)
        outside: FloatArray = np.where(t < 0, n0 * t, np.maximum(t - self.duration_s, 0.0) * n1)
        return ramp + outside

    def speed_rpm(self, time_s: FloatArray) -> FloatArray:
        """Speed in rpm."""
        inside = np.clip(np.asarray(time_s, dtype=np.float64), 0.0, self.duration_s)
        return self.start_rpm + (self.end_rpm - self.start_rpm) * inside / self.duration_s


@dataclass(frozen=True)
class Wander:
    """θ(t) = n̄ t + n̄ a (1 - cos 2πft)/(2πf): a speed that swings sinusoidally by ±a about its mean.

    Parameters
    ----------
    mean_rpm : float
    relative_amplitude : float
        a, 0 to 0.9.
    frequency_hz : float
        f of the swing.
    """

    mean_rpm: float
    relative_amplitude: float
    frequency_hz: float

    def revolutions(self, time_s: FloatArray) -> FloatArray:
        """Shaft angle in revolutions."""
        t, n, w = np.asarray(time_s, dtype=np.float64), self.mean_rpm / 60, 2 * np.pi * self.frequency_hz
        swing = (1 - np.cos(w * np.maximum(t, 0.0))) / w
        return n * (t + self.relative_amplitude * swing)

    def speed_rpm(self, time_s: FloatArray) -> FloatArray:
        """Speed in rpm."""
        t = np.maximum(np.asarray(time_s, dtype=np.float64), 0.0)
        swing: FloatArray = np.sin(2 * np.pi * self.frequency_hz * t)
        return self.mean_rpm * (1 + self.relative_amplitude * swing)


def time_at_revolutions(profile: SpeedProfile, revolutions: FloatArray, start_s: float, end_s: float) -> FloatArray:
    """Times between `start_s` and `end_s` at which the shaft passes the given angles, by bisection.

    60 halvings bring any interval of practical length down to rounding; bisection needs no speed above zero.

    Parameters
    ----------
    profile : SpeedProfile
    revolutions : array, (n,)
        Angles in revolutions, within those of the interval.
    start_s, end_s : float

    Returns
    -------
    array, (n,)
        Times in seconds.
    """
    wanted = np.asarray(revolutions, dtype=np.float64)
    low, high = np.full(wanted.shape, start_s), np.full(wanted.shape, end_s)
    for _ in range(60):
        middle = 0.5 * (low + high)
        past = profile.revolutions(middle) >= wanted
        low, high = np.where(past, low, middle), np.where(past, middle, high)
    result: FloatArray = 0.5 * (low + high)
    return result
