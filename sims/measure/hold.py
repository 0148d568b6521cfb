"""Linear systems on a solver's grid, exact for an input that runs straight from step to step."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike

from gearsig.checks import FloatArray
from gearsig.errors import InputError

Section = tuple[tuple[float, float, float], tuple[float, float, float]]
"""b and a of a second-order filter."""

HIGHEST_FRACTION = 0.2
"""Highest natural frequency as a fraction of the grid's rate: five steps a cycle."""


@lru_cache(maxsize=256)
def discrete(numerator: tuple[float, ...], denominator: tuple[float, ...], step_s: float) -> Section:
    """Ramp-invariant (first-order hold) equivalent of a transfer function in s, of second order at most.

    Poles map exactly, and so does the response to any input that is straight between steps. A sine is not: its gain
    is short by `hold_error`, its phase is right.

    Source: G. F. Franklin, J. D. Powell, M. L. Workman, *Digital Control of Dynamic Systems*, 3rd ed., 1998, ch. 6.

    Returns
    -------
    b, a : tuples of 3 floats
        Numerator and denominator in z⁻¹, a[0] = 1.
    """
    from scipy.signal import cont2discrete

    system = (np.array(numerator), np.array(denominator))
    b, a, _ = cont2discrete(system, step_s, method="foh")
    return _three(b), _three(a)


def low_pass(frequency_hz: float, damping_ratio: float, step_s: float) -> Section:
    """ω²/(s² + 2ζωs + ω²), discrete; refuses a frequency that the grid does not resolve."""
    if frequency_hz * step_s > HIGHEST_FRACTION:
        n_steps = 1 / (frequency_hz * step_s)
        raise InputError(
            f"a natural frequency of {frequency_hz:g} Hz has {n_steps:.2g} steps of {step_s:g} s a cycle",
            allowed=f"at least {1 / HIGHEST_FRACTION:g} steps a cycle",
            remedy="leave it out, or give the motion at a finer step",
        )
    w = 2 * np.pi * frequency_hz
    return discrete((w * w,), (1.0, 2 * damping_ratio * w, w * w), step_s)


def high_pass(frequency_hz: float, step_s: float) -> Section:
    """s/(s + ω), discrete."""
    return discrete((1.0, 0.0), (1.0, 2 * np.pi * frequency_hz), step_s)


def apply_bank(sections: list[Section], gains: FloatArray, inputs: FloatArray, direct: FloatArray) -> FloatArray:
    """Sum of filtered inputs, each filter from the steady state that belongs to the first values.

    Parameters
    ----------
    sections : list
        One per row of `gains`.
    gains : array, (n_sections, n_inputs)
        What of each input goes into each filter.
    inputs : array, (n_steps, n_inputs)
    direct : array, (n_inputs,)
        What of each input goes past the filters.

    Returns
    -------
    array, (n_steps,)
    """
    from sims.measure.hold_kernel import filter_bank

    x = np.ascontiguousarray(inputs, dtype=np.float64)
    out: FloatArray = x @ direct
    if sections:
        b = np.array([section[0] for section in sections])
        a = np.array([section[1][1:] for section in sections])
        filter_bank(x, np.asarray(gains, dtype=np.float64), b, a, out)
    return out


def apply(section: Section, signal: FloatArray) -> FloatArray:
    """Filter one signal, (n_steps,)."""
    return apply_bank([section], np.ones((1, 1)), signal[:, None], np.zeros(1))


def hold_error(frequency_hz: ArrayLike, step_s: float) -> FloatArray:
    """Relative loss of gain for a sine: 1 - sinc²(fΔ), about (πfΔ)²/3; 0.02 % at 2 kHz and 4 µs."""
    loss: FloatArray = 1.0 - np.sinc(np.asarray(frequency_hz, dtype=np.float64) * step_s) ** 2
    return loss


def _three(values: FloatArray) -> tuple[float, float, float]:
    padded = [*np.ravel(values).tolist(), 0.0, 0.0][:3]
    return padded[0], padded[1], padded[2]
