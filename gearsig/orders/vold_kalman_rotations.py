"""Forward pass of a banded least-squares problem by Givens rotations, sample by sample.

Rows of the data equation and of the structural equation are rotated one after the other into a banded triangle (the
square-root information filter). The normal equations, whose condition is the square of this problem's, are never
formed: the error is about r times the rounding error, not r².

J. A. George, M. T. Heath, "Solution of sparse linear least squares problems using Givens rotations", 1980.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from gearsig.checks import FloatArray

Array = NDArray[Any]


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator,unused-ignore]
def rotate(
    triangle: Array,
    right: Array,
    start: int,
    stop: int,
    data: Array,
    observed: Array,
    weights: FloatArray,
    stencils: FloatArray,
) -> bool:
    """Rotate the data row and the structural rows of each sample from start to stop into the triangle."""
    n_orders, n = data.shape
    p = stencils.shape[2] - 1
    row = np.zeros(triangle.shape[1], dtype=triangle.dtype)
    nothing = observed[0] * 0
    for t in range(start, stop):
        first = (t - start) * n_orders
        row[:] = 0
        for k in range(n_orders):
            row[k] = data[k, t]
        _insert(triangle, right, first, row, observed[t])
        if t + p >= n:
            continue
        for k in range(n_orders):
            row[:] = 0
            for i in range(p + 1):
                row[i * n_orders + k] = weights[k, t] * stencils[k, t, i]
            _insert(triangle, right, first, row, nothing)
    return True


@njit(cache=True, nogil=True, inline="always")  # type: ignore[untyped-decorator,unused-ignore]
def _insert(triangle: Array, right: Array, first: int, row: Array, value: Any) -> None:
    """Rotate one row, with its right-hand side, into the triangle; the first empty place takes what is left.

    With diagonal d (real) of triangle row R and leading entry v_c of the row: h² = d² + |v_c|²,
    R' = (d R + v_c* v)/h, v' = (d v - v_c R)/h.
    """
    width = len(row)
    for c in range(width):
        lead = row[c]
        size2 = lead.real * lead.real + lead.imag * lead.imag
        if size2 == 0.0:
            continue
        j = first + c
        diagonal = triangle[j, 0].real
        h = np.sqrt(diagonal * diagonal + size2)
        cosine = diagonal / h
        sine = lead / h
        turned = np.conj(sine)
        for m in range(c, width):
            old, new = triangle[j, m - c], row[m]
            triangle[j, m - c] = cosine * old + turned * new
            row[m] = cosine * new - sine * old
        old_right = right[j]
        right[j] = cosine * old_right + turned * value
        value = cosine * value - sine * old_right
        if diagonal == 0.0:
            return
