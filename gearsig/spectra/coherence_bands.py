"""Carrier bands: where they lie, how they weigh the spectrum's lines, and how many cells there may be."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from gearsig.checks import FloatArray, count
from gearsig.errors import InputError, RefusalError

MOST_CELLS = 1 << 26
"""1.6 GB of results; beyond it a typing error is likelier than a wish."""
FEWEST_PRODUCTS = 8
"""Fewer independent products than that leave coherence near 1 to chance."""
FIRST_LINE = 4
"""Of α: below it, Hann's main lobe makes neighbouring lines coherent by itself."""


@dataclass(frozen=True)
class CarrierBands:
    """Bands of 2·`half` - 1 lines every `half` lines; band i is centred on line (first + i)·half.

    Parameters
    ----------
    half, first, n_bands : int
    weight : array, (2·half - 1,)
        Raised cosine, 1 in the middle; the bands' weights add up to 1.
    """

    half: int
    first: int
    n_bands: int
    weight: FloatArray

    @property
    def centres(self) -> np.ndarray[tuple[int], np.dtype[np.signedinteger[Any]]]:
        """Middle lines, (n_bands,)."""
        return (self.first + np.arange(self.n_bands)) * self.half

    @property
    def products_per_band(self) -> float:
        """Lines that would average as well with equal weights: (ΣG)²/ΣG²."""
        return float(self.weight.sum() ** 2 / np.dot(self.weight, self.weight))


def lay_bands(n_lines: int, n_bands: int, n_highest: float, inflation: float, n_alphas: int) -> CarrierBands:
    """Cut `n_lines` lines into `n_bands` spacings and keep the bands that cyclic shifts of `n_highest` lines allow.

    Bands below half the highest shift are left out: there, a real signal's lines and their shifted ones are each
    other's mirror images, and cells repeat or correlate with themselves.
    """
    half = (n_lines - 1) // count(n_bands, "n_bands", minimum=2)
    weight = 0.5 + 0.5 * np.cos(np.pi * np.arange(1 - half, half) / max(half, 1))
    first = max(1, int(np.ceil(n_highest / 2 / half)) + 1) if half else 1
    bands = CarrierBands(half, first, (n_lines - 1) // half - first if half else 0, weight)
    if half < 1 or bands.products_per_band / inflation < FEWEST_PRODUCTS:
        most = int((n_lines - 1) / (FEWEST_PRODUCTS * inflation) * 1.3)
        raise RefusalError(
            f"{n_bands} bands of {n_lines} lines leave fewer than {FEWEST_PRODUCTS} independent products in a cell",
            remedy=f"take at most {most} bands, or record longer" if most >= 2 else "record longer",
        )
    if bands.n_bands < 1:
        raise InputError(
            "the highest cyclic frequency is so high that no carrier band is left above half of it",
            remedy="lower it, or take more bands",
        )
    if bands.n_bands * n_alphas > MOST_CELLS:
        raise InputError(
            f"{n_alphas} cyclic frequencies × {bands.n_bands} bands are too many cells",
            allowed=f"at most {MOST_CELLS}",
            remedy="lower the highest cyclic frequency, take fewer bands or a shorter stretch",
        )
    return bands
