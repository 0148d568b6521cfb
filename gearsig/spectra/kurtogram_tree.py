"""The tree of halves and thirds, fed piece by piece."""

from __future__ import annotations

import numpy as np

from gearsig.checks import FloatArray
from gearsig.spectra.kurtogram_filters import Splitter, splitter

PIECE_SAMPLES = 1 << 16
"""Samples that go down the tree at once: a level's bands stay near the caches, whatever the signal's length."""


class Stage:
    """All bands of one level, each split into parts; keeps what the next piece's filters still need."""

    def __init__(self, n_bands: int, n_parts: int, *, keep: bool) -> None:
        self.split: Splitter = splitter(n_parts)
        self.moments = np.zeros((n_bands * n_parts, 3))
        self.n_outputs = 0
        self._tail = np.empty((n_bands, 2, 0))
        self._keep = keep

    def push(self, x: FloatArray) -> FloatArray:
        """Take a piece of the bands, (n_bands, 2, n), and return that of the parts, (n_bands·n_parts, 2, n_out)."""
        from gearsig.spectra.kurtogram_kernel import split

        s = self.split
        joined = np.concatenate([self._tail, x], axis=2)
        n_out = max(0, (joined.shape[2] - s.n_taps) // s.n_parts + 1)
        parts = np.empty((len(self.moments) if self._keep else 0, 2, n_out))
        odd = self.n_outputs % 2 == 1
        split(joined, s.cosine, s.sine, s.middle, s.n_parts, n_out, odd, parts, self.moments)
        self._tail = joined[:, :, n_out * s.n_parts :].copy()
        self.n_outputs += n_out
        return parts


def tree_moments(x: FloatArray, n_levels: int, mean: float, scale: float) -> list[tuple[int, FloatArray, int]]:
    """Return (number of bands, their moments Σ|z|², Σ|z|⁴, max|z|², number of samples) for each row of the tree.

    Row 0 is the real signal itself, then 2, 3, 4, 6 … 2^L, 3·2^(L-1) bands. Outputs are only taken where a filter lies
    within the signal. Moments are those of (x - mean)/scale.
    """
    halves = [Stage(2**k, 2, keep=k < n_levels - 1) for k in range(n_levels)]
    thirds = [Stage(2**k, 3, keep=False) for k in range(n_levels)]
    whole = np.zeros(3)
    for start in range(0, len(x), PIECE_SAMPLES):
        piece = x[start : start + PIECE_SAMPLES].astype(np.float64)
        piece -= mean
        piece /= scale
        power = piece * piece
        whole += (power.sum(), float(np.dot(power, power)), 0.0)
        whole[2] = max(whole[2], float(power.max()))
        band: FloatArray = np.zeros((1, 2, len(piece)))
        band[0, 0] = piece
        for half, third in zip(halves, thirds, strict=True):
            third.push(band)
            band = half.push(band)
    rows: list[tuple[int, FloatArray, int]] = [(1, whole[None, :], len(x))]
    for half, third in zip(halves, thirds, strict=True):
        rows += [(len(stage.moments), stage.moments, stage.n_outputs) for stage in (half, third)]
    return rows
