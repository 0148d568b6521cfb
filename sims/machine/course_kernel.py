"""Compiled: set speed and torque over time."""

# mypy: allow-untyped-defs, allow-untyped-calls
from __future__ import annotations

from math import cos, sin

from numba import njit

from sims.compiled import UNCOUNTED


@njit(cache=True, nogil=True, error_model="numpy", **UNCOUNTED)
def course(points, t):
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
def course_value(points, t):
    """Value at t."""
    return course(points, t)[0]


@njit(cache=True, nogil=True, error_model="numpy", **UNCOUNTED)
def set_speed(k, speed, t):
    """Set speed in rad/s and its slope, swings included."""
    value, slope = course(speed, t)
    factor, rate = 1.0, 0.0
    for i in range(k.n_swings):
        amplitude, omega, phase = k.swings[i, 0], k.swings[i, 1], k.swings[i, 2]
        factor += amplitude * sin(omega * t + phase)
        rate += amplitude * omega * cos(omega * t + phase)
    return value * factor, slope * factor + value * rate
