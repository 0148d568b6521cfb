"""Mean power of windowed blocks of a signal: the one transform behind amplitude spectra and densities."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gearsig.checks import FloatArray, count, frozen_array, within
from gearsig.errors import InputError
from gearsig.spectra.types import Scaling
from gearsig.spectra.window import Window, make_window

ComplexArray = NDArray[np.complexfloating[Any, Any]]

BATCH_SAMPLES = 1 << 19
"""Samples transformed at once: 4 MB of float64, which stays near the caches and bounds the memory."""


@dataclass(frozen=True)
class BlockPlan:
    """How a signal is cut into blocks.

    `n_averages` is the number of *independent* blocks: overlapping ones share data, see `independent_averages`.
    """

    window: Window
    n_per_block: int
    step: int
    n_blocks: int
    n_averages: int


def checked_signal(values: FloatArray, *, minimum: int = 2) -> FloatArray:
    """Return `values` as a one-dimensional finite array with at least `minimum` samples."""
    x = frozen_array(values, "values", ndim=1)
    if len(x) < minimum:
        raise InputError(f"values has {len(x)} sample(s)", allowed=f"at least {minimum}", remedy="record longer")
    return x


def plan_blocks(n_samples: int, n_per_block: int | None, overlap: float, window: str) -> BlockPlan:
    """Lay blocks of `n_per_block` samples over the signal; None is one block of everything."""
    n = n_samples if n_per_block is None else count(n_per_block, "n_per_block", minimum=2)
    if n > n_samples:
        raise InputError(
            f"n_per_block is {n} for {n_samples} samples", allowed=f"2 to {n_samples}", remedy="shorten the block"
        )
    within(overlap, "overlap", 0.0, 0.95)
    step = max(1, round(n * (1.0 - overlap)))
    w = make_window(window, n)
    n_blocks = 1 + (n_samples - n) // step
    return BlockPlan(w, n, step, n_blocks, independent_averages(w.values, step, n_blocks))


def independent_averages(w: FloatArray, step: int, n_blocks: int) -> int:
    """Return how many independent blocks would average noise as well as `n_blocks` overlapping ones, rounded down.

    K_eff = K / (1 + 2 Σ_m (1 - m/K) ρ²(m)), with ρ(m) = Σ w[n] w[n + m·step] / Σ w².

    References
    ----------
    P. D. Welch, "The use of fast Fourier transform for the estimation of power spectra", 1967.
    """
    if n_blocks == 1:
        return 1
    energy = float(np.dot(w, w))
    inflation = 1.0
    for m in range(1, min(n_blocks, (len(w) - 1) // step + 1)):
        rho = float(np.dot(w[: -m * step], w[m * step :])) / energy
        inflation += 2.0 * (1.0 - m / n_blocks) * rho * rho
    return max(1, int(n_blocks / inflation + 1e-9))


def mean_power(x: FloatArray, plan: BlockPlan) -> FloatArray:
    """Return the one-sided mean power per line, averaged over the blocks: a bin-centred sine reads A²/2.

    P_k = c_k |X_k|² / (Σw)², c_k = 2 but for DC and, where the block length is even, Nyquist, which have no mirror
    image. Computed in double precision whatever the input.
    """
    total = np.zeros(plan.n_per_block // 2 + 1)
    for power in block_powers(x, plan):
        total += power.sum(axis=0)
    return total / plan.n_blocks


def block_powers(x: FloatArray, plan: BlockPlan, n_lines: int | None = None) -> Iterator[FloatArray]:
    """Yield the one-sided power of some blocks after the other, (n_blocks_in_batch, n_lines)."""
    from scipy.fft import rfft

    w = plan.window.values
    blocks = np.lib.stride_tricks.sliding_window_view(x, plan.n_per_block)[:: plan.step]
    without_mirror = [0] if plan.n_per_block % 2 else [0, plan.n_per_block // 2]
    per_batch = max(1, BATCH_SAMPLES // plan.n_per_block)
    for start in range(0, plan.n_blocks, per_batch):
        batch = blocks[start : start + per_batch].astype(np.float64)
        batch *= w
        lines = rfft(batch, axis=1, overwrite_x=True)
        power = lines.real**2
        power += lines.imag**2
        power *= 2.0 / float(w.sum()) ** 2
        power[:, without_mirror] /= 2.0
        yield power[:, :n_lines]


def scaled(power: FloatArray, scaling: Scaling, noise_bandwidth: float, n_per_block: int) -> FloatArray:
    """Return one-sided mean power in another scaling.

    Peak amplitude is √2 times the rms amplitude, but at DC and Nyquist, where both are the value itself.
    """
    if scaling == "power":
        return power
    if scaling == "power density":
        return power / noise_bandwidth
    rms: FloatArray = np.sqrt(power)
    if scaling == "amplitude peak":
        rms[..., 1 : (n_per_block + 1) // 2] *= np.sqrt(2.0)
    return rms


def scaled_unit(unit: str, scaling: Scaling, per: str = "Hz") -> str:
    """Return the unit of a spectrum written out, e.g. "(m/s^2)^2/Hz".

    Examples
    --------
    >>> scaled_unit("m/s^2", "power density"), scaled_unit("Pa", "power"), scaled_unit("g", "amplitude rms")
    ('(m/s^2)^2/Hz', 'Pa^2', 'g')
    """
    if scaling not in ("power", "power density"):
        return unit
    square = squared_unit(unit)
    return f"{square or 1}/{per}" if scaling == "power density" else square


def squared_unit(unit: str) -> str:
    """Return the square of a unit, in brackets where it is compound; nothing for no unit."""
    return f"({unit})^2" if any(c in unit for c in "/*^ ") else unit and f"{unit}^2"
