"""Adding up the cells' parts of the coarse normal equations."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

Array = NDArray[Any]


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator,unused-ignore]
def add_products(matrix: Array, k: int, m: int, first: int, pairs: NDArray[np.int64], grams: Array) -> None:
    """Add each cell's products of pieces s <= t, (n_cells, n_pairs), to the splines that the pieces belong to.

    matrix[t - s, cell + s] at unknowns k and m and, conjugate, m and k; the first cell is `first`.
    """
    for cell in range(grams.shape[0]):
        for i in range(grams.shape[1]):
            s, t = pairs[i, 0], pairs[i, 1]
            value = grams[cell, i]
            matrix[t - s, first + cell + s, k, m] += value
            if m != k:
                matrix[t - s, first + cell + s, m, k] += np.conj(value)


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator,unused-ignore]
def add_projections(right: Array, k: int, first: int, projected: Array) -> None:
    """Add each cell's projections on its pieces, (n_cells, n_pieces), to the splines that the pieces belong to."""
    for cell in range(projected.shape[0]):
        for s in range(projected.shape[1]):
            right[first + cell + s, k] += projected[cell, s]
