"""Forward pass of a banded least-squares problem by the normal equations, sample by sample.

Gauss's elimination without pivots (L D L*) of the normal equations, formed on the way. Several times faster than
rotations; the error grows with r², so it is for weak weights only.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from gearsig.checks import FloatArray

Array = NDArray[Any]


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator,unused-ignore]
def eliminate(
    triangle: Array,
    right: Array,
    start: int,
    stop: int,
    data: Array,
    observed: Array,
    weights: FloatArray,
    stencils: FloatArray,
) -> bool:
    """Add the rows of each sample from start to stop, and eliminate its unknowns; False at a pivot not above zero."""
    n_orders, n = data.shape
    p = stencils.shape[2] - 1
    width = triangle.shape[1]
    for t in range(start, stop):
        first = (t - start) * n_orders
        for k in range(n_orders):
            own = np.conj(data[k, t])
            right[first + k] += own * observed[t]
            for m in range(k, n_orders):
                triangle[first + k, m - k] += own * data[m, t]
        if t + p < n:
            for k in range(n_orders):
                square = weights[k, t] * weights[k, t]
                for i in range(p + 1):
                    of_i = square * stencils[k, t, i]
                    for j in range(i, p + 1):
                        triangle[first + i * n_orders + k, (j - i) * n_orders] += of_i * stencils[k, t, j]
        for c in range(n_orders):
            row = first + c
            pivot = triangle[row, 0].real
            if not pivot > 0.0:
                return False
            inverse = 1.0 / pivot
            value = right[row]
            for i in range(1, width - c):
                factor = np.conj(triangle[row, i]) * inverse
                for m in range(i, width - c):
                    triangle[row + i, m - i] -= factor * triangle[row, m]
                right[row + i] -= factor * value
    return True
