"""Levels in dB, and how well they repeat."""

from __future__ import annotations

import numpy as np

from gearsig.checks import FloatArray
from gearsig.compare.types import LevelPair

DEEPEST_DB = 160.0
"""Below the strongest level of a channel, nothing is told apart: that is rounding."""


def decibel(power: FloatArray, strongest: float) -> FloatArray:
    """Return 10 lg of mean squares, none more than `DEEPEST_DB` below the strongest."""
    least = max(strongest * 10.0 ** (-DEEPEST_DB / 10.0), 1e-300)
    levels: FloatArray = 10.0 * np.log10(np.maximum(power, least))
    return levels


def power_levels(simulated: FloatArray, recorded: FloatArray, *, smooth: int = 5) -> tuple[LevelPair, ...]:
    """Return levels of mean squares, each (2, n): of the first and of the second half.

    The level's standard error is half the difference between the halves; or its rms over `smooth` neighbours,
    where that is larger: two halves agree by chance now and then.
    """
    both = []
    for power in (simulated, recorded):
        strongest = float(power.max(initial=0.0))
        a, b = decibel(power[0], strongest), decibel(power[1], strongest)
        both.append((decibel(power.mean(axis=0), strongest), _smoothed(np.abs(a - b) / 2.0, smooth)))
    (own, own_error), (other, other_error) = both
    errors = np.hypot(own_error, other_error)
    return tuple(LevelPair(float(s), float(r), float(e)) for s, r, e in zip(own, other, errors, strict=True))


def _smoothed(errors: FloatArray, n: int) -> FloatArray:
    width = min(n, len(errors))
    width -= (width + 1) % 2  # odd: as many neighbours on either side
    if width < 2:
        return errors
    padded = np.pad(errors**2, width // 2, mode="reflect")
    result: FloatArray = np.maximum(errors, np.sqrt(np.convolve(padded, np.ones(width) / width, mode="valid")))
    return result


def amplitude_error_db(amplitude: FloatArray, noise: FloatArray) -> FloatArray:
    """Return the standard error of a line's level: the part of its noise that is in phase with it."""
    ratio = np.divide(noise, np.sqrt(2.0) * amplitude, out=np.ones_like(noise), where=amplitude > noise / np.sqrt(2.0))
    result: FloatArray = 20.0 * np.log10(1.0 + ratio)
    return result
