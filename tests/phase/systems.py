"""Motions with known dynamics: published exponents, limit cycles, period doublings, quasi-periodic motion."""

import numpy as np
from numba import njit

LORENZ_EXPONENT, ROSSLER_EXPONENT, HENON_EXPONENT = 0.9056, 0.0714, 0.4192
"""J. C. Sprott, *Chaos and Time-Series Analysis* (2003), appendix A; per unit of time, per iteration for the map."""


@njit(cache=True)
def _rate(is_lorenz, x, y, z):
    if is_lorenz:
        return 10.0 * (y - x), x * (28.0 - z) - y, x * y - 8.0 / 3.0 * z
    return -y - z, x + 0.2 * y, 0.2 + z * (x - 5.7)


@njit(cache=True)
def _states(is_lorenz, x, y, z, n, dt):
    """Return (n, 3) states, the transient left out; Runge–Kutta 4 in steps of dt/4; scalars compile quickly."""
    h, out = dt / 4, np.empty((n, 3))
    for i in range(-3000, n):
        for _ in range(4):
            a = _rate(is_lorenz, x, y, z)
            b = _rate(is_lorenz, x + h / 2 * a[0], y + h / 2 * a[1], z + h / 2 * a[2])
            c = _rate(is_lorenz, x + h / 2 * b[0], y + h / 2 * b[1], z + h / 2 * b[2])
            d = _rate(is_lorenz, x + h * c[0], y + h * c[1], z + h * c[2])
            x += h / 6 * (a[0] + 2 * b[0] + 2 * c[0] + d[0])
            y += h / 6 * (a[1] + 2 * b[1] + 2 * c[1] + d[1])
            z += h / 6 * (a[2] + 2 * b[2] + 2 * c[2] + d[2])
        if i >= 0:
            out[i, 0], out[i, 1], out[i, 2] = x, y, z
    return out


def lorenz(n, dt):
    return _states(True, 1.0, 1.0, 20.0, n, dt)


def rossler(n, dt):
    return _states(False, 1.0, 1.0, 0.0, n, dt)


@njit(cache=True)
def henon(n):
    x, y, out = 0.1, 0.1, np.empty(n)
    for i in range(-200, n):
        x, y = 1.0 - 1.4 * x * x + y, 0.3 * x
        if i >= 0:
            out[i] = x
    return out


@njit(cache=True)
def logistic(n, r=4.0):
    x, out = 0.3, np.empty(n)
    for i in range(-2000, n):
        x = r * x * (1.0 - x)
        if i >= 0:
            out[i] = x
    return out


@njit(cache=True)
def duffing(force, n_periods, per_period=64, n_transient=300):
    """x'' + 0.3 x' - x + x³ = force · cos(1.2 t): (n, 2) displacement and velocity after the transient."""
    w = 1.2
    h = 2 * np.pi / w / per_period / 2
    x, v, t, out = 1.0, 0.0, 0.0, np.empty((n_periods * per_period, 2))
    for i in range(-n_transient * per_period, n_periods * per_period):
        if i >= 0:
            out[i, 0], out[i, 1] = x, v
        for _ in range(2):
            a1 = force * np.cos(w * t) - 0.3 * v + x - x**3
            x2, v2 = x + h / 2 * v, v + h / 2 * a1
            a2 = force * np.cos(w * (t + h / 2)) - 0.3 * v2 + x2 - x2**3
            x3, v3 = x + h / 2 * v2, v + h / 2 * a2
            a3 = force * np.cos(w * (t + h / 2)) - 0.3 * v3 + x3 - x3**3
            x4, v4 = x + h * v3, v + h * a3
            a4 = force * np.cos(w * (t + h)) - 0.3 * v4 + x4 - x4**3
            x, v = x + h / 6 * (v + 2 * v2 + 2 * v3 + v4), v + h / 6 * (a1 + 2 * a2 + 2 * a3 + a4)
            t += h
    return out


DUFFING_PERIOD_S = 2 * np.pi / 1.2


def quasi_periodic(n, period=50.3, ratio=1.2856486930664501):
    """Two sines whose frequencies, 1 to √2/1.1, have no common multiple."""
    t = 2 * np.pi * np.arange(n) / period
    return np.sin(t) + 0.6 * np.sin(ratio * t)


def narrow_band_noise(n, rng):
    from scipy.signal import butter, lfilter

    return lfilter(*butter(2, [0.03, 0.05], "bandpass"), rng.normal(size=n))
