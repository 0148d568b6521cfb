"""Integration and differentiation of a signal inside a frequency band."""

from __future__ import annotations

from math import ceil

import numpy as np

from gearsig.checks import FloatArray

SETTLING_PERIODS = 3.0
"""Periods of the low cut that either end needs: what lies nearer to an end is disturbed by what is not known beyond."""


def integrate_band(
    values: FloatArray, sampling_rate_hz: float, n_times: int, band_hz: tuple[float, float]
) -> FloatArray:
    """Return the signal integrated `n_times` (negative: differentiated) within a band.

    Y(f) = X(f) W(f) / (2πi f)ⁿ, with W = 1 from `low` to `high`, rising smoothly from zero at low/2 and falling to zero
    half way between `high` and half the sampling rate. No phase is added. Both ends are continued by their point
    reflection.

    Parameters
    ----------
    values : array, (n_samples,)
        Finite; float64.
    sampling_rate_hz : float
    n_times : int
        -2 to 2.
    band_hz : (float, float)
        low = 0 keeps the mean, possible for n_times <= 0 only.

    Returns
    -------
    array, (n_samples,)
        Within 3/low of either end the result is disturbed; the caller leaves that out.

    Notes
    -----
    What lies below the low cut is gone: a slow drift of displacement cannot be had from an accelerometer.
    """
    from scipy import fft

    n = len(values)
    low, high = band_hz
    n_pad = min(n - 1, ceil(SETTLING_PERIODS * sampling_rate_hz / low)) if low > 0.0 else min(n - 1, 64)
    x = np.concatenate(
        [2.0 * values[0] - values[n_pad:0:-1], values, 2.0 * values[-1] - values[-2 : -2 - n_pad : -1]],
    )
    n_fft = fft.next_fast_len(len(x), real=True)
    lines = fft.rfft(x, n_fft, overwrite_x=True)
    lines *= _gain(np.arange(len(lines)) * (sampling_rate_hz / n_fft), sampling_rate_hz, n_times, low, high)
    y: FloatArray = fft.irfft(lines, n_fft, overwrite_x=True)[n_pad : n_pad + n]
    return y


def _gain(f: FloatArray, rate: float, n_times: int, low: float, high: float) -> np.ndarray:
    """W(f) / (2πi f)ⁿ on the lines of the transform."""
    weight = np.ones(len(f))
    if low > 0.0:
        weight *= _smooth_step((f - 0.5 * low) / (0.5 * low))
    stop = 0.5 * (high + 0.5 * rate)
    if stop > high:
        weight *= _smooth_step((stop - f) / (stop - high))
    if n_times == 0:
        return weight
    inside = weight > 0.0
    gain = np.zeros(len(f), dtype=np.complex128)
    if n_times < 0:
        inside &= f > 0.0  # the mean differentiates to zero
    gain[inside] = weight[inside] * (2j * np.pi * f[inside]) ** (-float(n_times))
    return gain


def _smooth_step(u: FloatArray) -> FloatArray:
    """Rise from 0 at u = 0 to 1 at u = 1 with three continuous derivatives, so that ringing dies out fast."""
    v = np.clip(u, 0.0, 1.0)
    step: FloatArray = v**4 * (35.0 - 84.0 * v + 70.0 * v**2 - 20.0 * v**3)
    return step
