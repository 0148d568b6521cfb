"""Fourier sums over unequally spaced angles."""

from __future__ import annotations

from typing import Any

import numpy as np

from gearsig.checks import FloatArray
from gearsig.spectra.blocks import ComplexArray

_SPREAD = 8
"""Grid points on either side of a sample: error about 1e-8 of the sum of magnitudes."""


class TurnSums:
    """c[k] = Σ_j p_j exp(-2πi k θ_j) for k = 0 … n, with θ in parts of the whole angle, 0 ≤ θ < 1.

    Samples are spread over an equal grid by a Gaussian, transformed, and the Gaussian's transform divided out.

    References
    ----------
    L. Greengard and J.-Y. Lee, "Accelerating the nonuniform fast Fourier transform", 2004.
    """

    def __init__(self, theta: FloatArray, n: int) -> None:
        from scipy.fft import next_fast_len

        self.n = n
        n_modes = 2 * n + 1
        self.n_grid = next_fast_len(2 * n_modes + 2 * _SPREAD)
        ratio = self.n_grid / n_modes
        self._tau = np.pi * _SPREAD / (n_modes**2 * ratio * (ratio - 0.5))
        self._spread = self._spreading(theta)

    def __call__(self, p: ComplexArray) -> ComplexArray:
        """Return the sums for one set of values, (n + 1,)."""
        from scipy.fft import fft

        k = np.arange(self.n + 1)
        lines: ComplexArray = fft(self._spread @ p)[: self.n + 1]
        lines *= np.sqrt(np.pi / self._tau) * np.exp(self._tau * k.astype(np.float64) ** 2) / self.n_grid
        return lines

    def _spreading(self, theta: FloatArray) -> Any:
        from scipy.sparse import csr_array

        nearest = np.floor(theta * self.n_grid).astype(np.int64)
        offsets = np.arange(1 - _SPREAD, _SPREAD + 1)
        points = nearest[:, None] + offsets
        distance = 2.0 * np.pi * (points / self.n_grid - theta[:, None])
        weights = np.exp(-(distance**2) / (4.0 * self._tau))
        rows = (points % self.n_grid).ravel()
        columns = np.repeat(np.arange(len(theta)), 2 * _SPREAD)
        return csr_array((weights.ravel(), (rows, columns)), shape=(self.n_grid, len(theta)))
