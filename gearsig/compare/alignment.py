"""The angle by which the simulation is turned so that the same teeth meet."""

from __future__ import annotations

import numpy as np

from gearsig.checks import FloatArray
from gearsig.compare.averages import ComplexArray, HalvedLines
from gearsig.compare.types import Alignment

PER_CYCLE = 16
"""Shifts tried per cycle of the highest order, before the best one is refined."""

LEAST_ALIKE = 0.5
"""Correlation of what tells teeth apart; patterns of different gears reach 0.3 to 0.4 at the best of all teeth."""


def align(
    shaft: str, simulated: HalvedLines, recorded: HalvedLines, n_teeth: int | None, *, by_marks: bool
) -> Alignment:
    """Return the shift of the simulation's average with the largest correlation, or none where marks are trusted.

    ρ(s) = Σ_c Re Σ_n Y_c[n] X_c*[n] e^{2πi n s} / (|X_c| |Y_c|) / n_channels, with the lines X of the simulation
    and Y of the recording, all channels c together: the same shaft turns under all sensors.

    Parameters
    ----------
    shaft : str
    simulated, recorded : HalvedLines
        Up to the same order.
    n_teeth : int or None
        To tell whether the shift is certain to the tooth.
    by_marks : bool
        Whether to leave the simulation as it is: both count from a mark.
    """
    x, y = simulated.whole, recorded.whole
    cross = _cross(x, y)
    best = _best_shift(cross)
    shifts = [
        _best_shift(_cross(a, b))
        for a, b in ((simulated.first, y), (simulated.second, y), (x, recorded.first), (x, recorded.second))
    ]
    spread = np.hypot(_apart(shifts[0], shifts[1]), _apart(shifts[2], shifts[3])) / 2.0
    certain = None if n_teeth is None else _is_certain(x, y, best, shifts, n_teeth)
    if by_marks:
        gain = float(_score(cross, np.array([best]))[0] - _score(cross, np.zeros(1))[0])
        return Alignment(shaft, "marks", 0.0, 0.0, certain, 360.0 * best, gain)
    return Alignment(shaft, "correlation", 360.0 * best, 360.0 * float(spread), certain)


def _cross(x: ComplexArray, y: ComplexArray) -> ComplexArray:
    """Cross spectrum, each channel over its own size, mean over the channels; the mean value counts for nothing."""
    product = y * np.conj(x)
    product[:, 0] = 0.0
    size = np.sqrt(np.sum(np.abs(x[:, 1:]) ** 2, axis=1) * np.sum(np.abs(y[:, 1:]) ** 2, axis=1))
    cross: ComplexArray = np.divide(product, size[:, None], out=np.zeros_like(product), where=size[:, None] > 0)
    mean: ComplexArray = cross.mean(axis=0)
    return mean


def _score(cross: ComplexArray, shifts: FloatArray) -> FloatArray:
    scores: FloatArray = np.real(np.exp(2j * np.pi * np.outer(shifts, np.arange(len(cross)))) @ cross)
    return scores


def _best_shift(cross: ComplexArray) -> float:
    """Return the shift with the highest score, -0.5 to 0.5 revolutions."""
    from scipy.fft import ifft, next_fast_len
    from scipy.optimize import minimize_scalar

    if not np.any(cross):
        return 0.0
    n = next_fast_len(PER_CYCLE * len(cross))
    start = int(np.argmax(np.real(ifft(cross, n)))) / n
    found = minimize_scalar(
        lambda s: -float(_score(cross, np.array([s]))[0]),
        bounds=(start - 1.0 / n, start + 1.0 / n),
        method="bounded",
        options={"xatol": 1e-9},
    )
    return float((found.x + 0.5) % 1.0 - 0.5)


def _apart(a: float, b: float) -> float:
    """Return the distance of two angles, 0 to 0.5 revolutions."""
    return abs((a - b + 0.5) % 1.0 - 0.5)


def _is_certain(x: ComplexArray, y: ComplexArray, best: float, shifts: list[float], n_teeth: int) -> bool:
    """Say whether all halves choose the same tooth, and what differs from tooth to tooth is alike in both records.

    The mesh harmonics are left out of the second test: they say nothing of which tooth is which.
    """
    if max(_apart(best, shift) for shift in shifts) >= 0.5 / n_teeth:
        return False
    telling = np.arange(x.shape[1]) % n_teeth != 0
    alike = _score(_cross(np.where(telling, x, 0.0), np.where(telling, y, 0.0)), np.array([best]))[0]
    return bool(alike > LEAST_ALIKE)
