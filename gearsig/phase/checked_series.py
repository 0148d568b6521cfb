"""Checks of a series before it is embedded, and its mean period."""

from __future__ import annotations

import numpy as np

from gearsig.checks import FloatArray, frozen_array
from gearsig.errors import InputError, RefusalError

MOST_PERIOD_SAMPLES = 1 << 20
"""The mean period is found on the first so many samples."""


def checked_series(values: FloatArray, *, minimum: int, name: str = "values") -> FloatArray:
    """Return a finite float64 series of at least `minimum` samples that is not constant.

    Raises
    ------
    InputError
        On NaN, a wrong shape, or too few samples.
    RefusalError
        If the series is constant: there is no motion to look at.
    """
    x = frozen_array(values, name, ndim=1)
    if len(x) < minimum:
        raise InputError(
            f"{name} has {len(x)} sample(s)", allowed=f"at least {minimum}", remedy="record longer or ask for less"
        )
    low, high = float(x.min()), float(x.max())
    if high - low <= 8.0 * np.finfo(x.dtype).eps * max(abs(low), abs(high)):
        raise RefusalError(
            f"{name} is constant at {low:g}: nothing moves, so there is nothing to embed",
            remedy="check the sensor, or take a channel or a stretch that vibrates",
        )
    return np.asarray(x, dtype=np.float64)


def mean_period_samples(x: FloatArray) -> float:
    """Return one over the mean frequency of the power spectrum, in samples; at least 2.

    T = Σ|X(f)|² / Σ f |X(f)|², the mean taken off before.

    Source: M. T. Rosenstein, J. J. Collins, C. J. De Luca, *A practical method for calculating largest Lyapunov
    exponents from small data sets*, Physica D 65 (1993).
    """
    from scipy import fft

    part = x[:MOST_PERIOD_SAMPLES]
    lines = fft.rfft(part - part.mean(), fft.next_fast_len(len(part), real=True))
    power = np.square(lines.real) + np.square(lines.imag)
    frequency = np.arange(len(power)) / (2.0 * (len(power) - 1))
    return max(2.0, float(power.sum() / np.dot(frequency, power)))
