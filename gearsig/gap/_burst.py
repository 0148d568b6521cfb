"""The shape of what one tooth does: how its energy is spread over the pitches before and after.

A crack changes the mesh as long as its tooth carries, a spall in the middle of that, a chipped tooth where it leaves
too early, a pitch error where it comes too early or too late. What of it reaches a sensor rings through the
machine's own resonances; the order in which energy comes survives that better than its spectrum does.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from gearsig.checks import FloatArray
from gearsig.gap._features import NamedValue, decibel
from gearsig.gap._reduction import ComplexArray

STEPS_PER_PITCH = 64
HIGHEST_MESH_ORDER = 10
"""Above it sensors hear their own resonances; `STEPS_PER_PITCH` are three times what that many orders need."""

LOWEST_MESH_ORDER = 0.5
"""At and below which a machine moves as a whole."""

PEAK_PITCHES = 0.25
"""Within which the loudest part of a burst is sought, and by which its course is counted."""

COURSE_PITCHES = (-1.5, 3.0)
"""From the loudest part on; so are the ranges below. A tooth carries for one to two pitches, and what it strikes rings
on."""

N_QUARTERS = round((COURSE_PITCHES[1] - COURSE_PITCHES[0]) / PEAK_PITCHES)

ECHO_LAGS_PITCHES = np.arange(0.3, 2.15, 0.15)
ECHO_PITCHES = (-2.2, 2.8)
"""Range whose autocorrelation is taken, smoothed over `SMOOTH_STEPS`."""

SMOOTH_STEPS = 6
NEAR_PITCHES = (-2.0, 3.5)
"""Beyond which energy is elsewhere."""

LEAST_SHARE, LEAST_ECHO = 1e-4, 1e-3
"""Added before the logarithm: smaller ones are noise."""

WAYS = ("plain", "even")
"""As the lines are, or with their magnitudes made even over a mesh order: the path's resonances weigh less then."""


def burst_lines(highest: int, teeth: int) -> np.ndarray:
    """Return the orders of a shaft that single teeth show in: neither the mesh's own nor the lowest ones."""
    orders = np.arange(min(highest, HIGHEST_MESH_ORDER * teeth))
    kept: np.ndarray = orders[(orders > LOWEST_MESH_ORDER * teeth) & (orders % teeth != 0)]
    return kept


def clearness(lines: ComplexArray, noise: FloatArray, teeth: int) -> float:
    """Return the power of the lines that single teeth show in over the noise on them."""
    kept = burst_lines(lines.shape[1], teeth)
    return float(np.sum(np.abs(lines[:, kept]) ** 2) / max(float(noise[:, kept].sum()), 1e-300))


def burst_features(lines: ComplexArray, noise: FloatArray, teeth: int) -> Iterator[NamedValue]:
    """Yield shares of a burst's energy, in ten times their decadic logarithm.

    With the envelope's square e(φ) = |Σ_n D_n exp(i n φ)|² over one revolution, mean of the channels, each scaled to 1,
    about its loudest quarter of a pitch: the share of each quarter from 1.5 pitches before to 3 after; the
    autocorrelation of e at lags from 0.3 to 2.1 pitches; the share further away. All of it twice: with D as it is, and
    with D/√(mean of |D|² over a mesh order + noise).

    Parameters
    ----------
    lines : complex array, (n_channels, n)
        Difference of a shaft's averages, by orders of the shaft from 0 on.
    noise : array, (n_channels, n)
        Power of the noise on them.
    teeth : int
    """
    from scipy.ndimage import convolve1d, uniform_filter1d

    for way in WAYS:
        by_channel = [_energy(*channel, teeth, even=way == "even") for channel in zip(lines, noise, strict=True)]
        energy, width = np.mean(by_channel, axis=0), round(PEAK_PITCHES * STEPS_PER_PITCH)
        within = uniform_filter1d(energy, width, mode="wrap", origin=-(width // 2))  # from each step on
        energy = np.roll(energy, -int(np.argmax(within)))
        course = _cut(energy, COURSE_PITCHES).reshape(N_QUARTERS, width).sum(axis=1)
        shares = course / max(float(course.sum()), 1e-300)
        for i, share in enumerate(shares):
            yield f"burst.{way}.course.{i}", decibel(share + LEAST_SHARE)
        smooth = convolve1d(_cut(energy, ECHO_PITCHES), _window(SMOOTH_STEPS), mode="reflect")
        whole = max(float(np.sum(smooth**2)), 1e-300)
        for i, lag in enumerate((ECHO_LAGS_PITCHES * STEPS_PER_PITCH).astype(int)):
            echo = float(np.sum(smooth[:-lag] * smooth[lag:])) / whole
            yield f"burst.{way}.echo.{i}", decibel(echo + LEAST_ECHO)
        elsewhere = max(1.0 - float(_cut(energy, NEAR_PITCHES).sum()), 0.0)
        yield f"burst.{way}.elsewhere", decibel(elsewhere + LEAST_ECHO)


def _energy(lines: ComplexArray, noise: FloatArray, teeth: int, *, even: bool) -> FloatArray:
    """Return the envelope's square over one revolution, `STEPS_PER_PITCH` steps per pitch; its sum is 1."""
    from scipy.fft import ifft
    from scipy.ndimage import convolve1d

    kept = burst_lines(len(lines), teeth)
    spectrum = np.zeros(STEPS_PER_PITCH * teeth, dtype=np.complex128)
    spectrum[kept] = lines[kept]
    if even:
        expected = convolve1d(np.abs(lines) ** 2, _window(teeth), mode="mirror") + noise
        spectrum[kept] /= np.sqrt(expected[kept] + 1e-300)
    energy: FloatArray = np.abs(ifft(spectrum)) ** 2
    energy /= max(float(energy.sum()), 1e-300)
    return energy


def _window(n_points: int) -> FloatArray:
    window: FloatArray = np.hanning(n_points + 2)[1:-1]
    window /= window.sum()
    return window


def _cut(energy: FloatArray, pitches: tuple[float, float]) -> FloatArray:
    """Return what lies between two angles from the first step, counted round."""
    first, end = (int(pitch * STEPS_PER_PITCH) for pitch in pitches)
    return energy[np.arange(first, end) % len(energy)]
