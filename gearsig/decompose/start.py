"""Where the modes' centre frequencies start."""

from __future__ import annotations

import numpy as np

from gearsig.checks import FloatArray
from gearsig.decompose.types import VmdSettings
from gearsig.errors import InputError

_MOST_CELLS = 2000


def first_centres(
    settings: VmdSettings, sampling_rate: float, spectrum: FloatArray, rng: np.random.Generator | None
) -> FloatArray:
    """Return the first centre frequencies in cycles per sample, (n_modes,).

    "uniform": k/2K; "random": one draw per mode, uniform over the logarithm from 1/n to 1/2, ascending; "peaks": see
    `peak_centres`. `spectrum` is the signal's cosine transform, (n_samples,).

    Raises
    ------
    InputError
        On given frequencies outside 0 to half the sampling rate, or "random" without a generator.
    """
    K = settings.n_modes
    centres: FloatArray = np.zeros(K)
    if settings.start == "uniform":
        centres = 0.5 / K * np.arange(K)
    elif settings.start == "random":
        centres = _random(K, len(spectrum), rng)
    elif settings.start == "peaks":
        centres = peak_centres(np.square(spectrum), settings.penalty, K)
    elif settings.start != "zero":
        centres = np.array(settings.start, dtype=np.float64) / sampling_rate
        if not ((centres >= 0.0) & (centres <= 0.5)).all():  # written so that NaN fails too
            raise InputError(
                f"start is {settings.start}", allowed=f"0 to {sampling_rate / 2:g}, half the sampling rate"
            )
    if settings.zero_mode:
        centres[0] = 0.0
    return centres


def _random(K: int, n_samples: int, rng: np.random.Generator | None) -> FloatArray:
    if rng is None:
        raise InputError('start is "random" without a generator', where="rng", remedy="give numpy's default_rng(seed)")
    n = n_samples - n_samples % 2  # as the reference program, which drops the last sample of an odd length
    low = np.log(1.0 / n)
    return np.sort(np.exp(low + (np.log(0.5) - low) * rng.random(K)))


def peak_centres(power: FloatArray, penalty: float, n_modes: int) -> FloatArray:
    """Return where modes of this penalty would each take most energy, one after the other, (n_modes,), ascending.

    Each takes the place ω of largest Σ P(q) g²(q - ω), g = 1/(1 + penalty (q - ω)²), goes to the centroid of that
    product, and leaves P (1 - g)² to the next.

    Parameters
    ----------
    power : array, (n_lines,)
        Power at q/2n cycles per sample.
    penalty : float
    n_modes : int
    """
    # Cells of a quarter of the half-gain distance, but no more of them than lines or than a matrix can have.
    n_cells = int(min(len(power), max(16, np.ceil(2.0 * np.sqrt(penalty))), _MOST_CELLS))
    edges = np.arange(n_cells) * len(power) // n_cells
    frequency = np.arange(len(power)) * (0.5 / len(power))
    energy = np.add.reduceat(power, edges)
    place = np.add.reduceat(power * frequency, edges) / np.where(energy > 0.0, energy, 1.0)
    middle = (np.arange(n_cells) + 0.5) * (0.5 / n_cells)
    left = energy.copy()
    centres = np.zeros(n_modes)
    for k in range(n_modes):
        best = middle[int(np.argmax(_gain(middle[:, None] - middle, penalty) ** 2 @ left))]
        for _ in range(3):  # the centroid moves the filter, which moves the centroid: a few steps settle it
            taken = left * _gain(place - best, penalty) ** 2
            best = float(taken @ place / taken.sum()) if taken.sum() > 0.0 else best
        centres[k] = best
        left *= (1.0 - _gain(place - best, penalty)) ** 2
    return np.sort(centres)


def _gain(distance: FloatArray, penalty: float) -> FloatArray:
    return np.asarray(1.0 / (1.0 + penalty * distance * distance))
