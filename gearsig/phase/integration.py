"""Integration and differentiation of a signal inside a frequency band."""

from __future__ import annotations

from math import ceil

import numpy as np

from gearsig.checks import FloatArray

FADE_PERIODS, SETTLING_PERIODS = 2.0, 5.0
"""Periods of the low cut over which either end is faded, and after which the result has settled."""

FADE_SAMPLES, SETTLING_SAMPLES = 64, 256
"""The same where there is no low cut."""


def n_unsettled(sampling_rate_hz: float, low_cut_hz: float) -> int:
    """Return how many samples at either end of an integrated signal rest on what is not known beyond it."""
    return ceil(SETTLING_PERIODS * sampling_rate_hz / low_cut_hz) if low_cut_hz > 0.0 else SETTLING_SAMPLES


def integrate_band(
    values: FloatArray, sampling_rate_hz: float, n_times: int, band_hz: tuple[float, float]
) -> FloatArray:
    """Return the signal integrated `n_times` (negative: differentiated) within a band.

    Y(f) = X(f) W(f) / (2πi f)ⁿ, with W = 1 from `low` to `high`, rising smoothly from zero at low/4 and falling to zero
    half way between `high` and half the sampling rate. No phase is added. Both ends are faded first: an abrupt end
    would put slow parts into the signal, which integration magnifies. Before that the mean is taken off, or, without a
    low cut, the straight line between both ends, which is put back afterwards.

    Parameters
    ----------
    values : array, (n_samples,)
        Finite; float64; longer than twice `n_unsettled`.
    sampling_rate_hz : float
    n_times : int
        -2 to 2.
    band_hz : (float, float)
        low = 0 keeps the mean, possible for n_times <= 0 only.

    Returns
    -------
    array, (n_samples,)
        Within `n_unsettled` samples of either end the result is disturbed; the caller leaves that out. Beyond, the
        error is below 5e-4 of the amplitude of displacement for a line anywhere between the low cut and 75 times it.

    Notes
    -----
    What lies below the low cut is gone: a slow drift of displacement cannot be had from an accelerometer.
    """
    from scipy import fft

    n, (low, high) = len(values), band_hz
    line = np.zeros(2) if low > 0.0 else _line(values, sampling_rate_hz)
    n_fade = ceil(FADE_PERIODS * sampling_rate_hz / low) if low > 0.0 else FADE_SAMPLES
    time = np.arange(n) / sampling_rate_hz
    x = _faded(values - (values.mean() if low > 0.0 else line[0] + line[1] * time), n_fade)
    n_fft = fft.next_fast_len(n + n_unsettled(sampling_rate_hz, low), real=True)
    lines = fft.rfft(x, n_fft)
    lines *= _gain(np.arange(len(lines)) * (sampling_rate_hz / n_fft), sampling_rate_hz, n_times, low, high)
    y: FloatArray = fft.irfft(lines, n_fft, overwrite_x=True)[:n]
    if n_times == 0 and low == 0.0:
        y = y + line[0] + line[1] * time
    return y + line[1] if n_times == -1 else y


def _line(values: FloatArray, rate: float) -> FloatArray:
    """Offset and slope per second of the line through the first and the last sample."""
    return np.array([values[0], (values[-1] - values[0]) * rate / (len(values) - 1)])


def _faded(x: FloatArray, n_fade: int) -> FloatArray:
    """Return x, which is overwritten, with both ends brought to zero."""
    ramp = _smooth_step((np.arange(n_fade) + 0.5) / n_fade)
    x[:n_fade] *= ramp
    x[-n_fade:] *= ramp[::-1]
    return x


def _gain(f: FloatArray, rate: float, n_times: int, low: float, high: float) -> np.ndarray:
    """W(f) / (2πi f)ⁿ on the lines of the transform."""
    weight = np.ones(len(f))
    if low > 0.0:
        weight *= _smooth_step((f - 0.25 * low) / (0.75 * low))
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
