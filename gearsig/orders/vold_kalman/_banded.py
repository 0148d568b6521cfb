"""Banded least-squares problems of the Vold–Kalman filter, sample by sample, in bounded memory."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from gearsig.checks import FloatArray
from gearsig.errors import RefusalError

Array = NDArray[Any]
Forward = Callable[[Array, Array, int, int, Array, Array, FloatArray, FloatArray], bool]
TRIANGLE_BYTES = 256 * 2**20
"""Memory for the triangle. Longer problems keep it in parts only and compute each part a second time, backwards."""


def solve_band(
    data: Array,
    observed: Array,
    weights: FloatArray,
    stencils: FloatArray,
    *,
    forward: Forward,
    triangle_bytes: int = TRIANGLE_BYTES,
) -> Array:
    """Minimise Σ_n |b_n - Σ_k d_kn x_kn|² + Σ_k Σ_n w_kn² |Σ_i s_kni x_k(n+i)|².

    Parameters
    ----------
    data : array, (n_orders, n), real or complex
        d.
    observed : array, (n,)
        b; the solution has its type.
    weights : array, (n_orders, n - p)
        w.
    stencils : array, (n_orders, n - p, p + 1)
        s.
    forward : `rotate` or `eliminate`
        Turns the rows of a part into its triangle.
    triangle_bytes : int
        Memory for the triangle.

    Returns
    -------
    array, (n_orders, n)

    Raises
    ------
    RefusalError
        If the orders cannot be told apart.
    """
    n_orders, n = data.shape
    p = stencils.shape[2] - 1
    width = (p + 1) * n_orders
    per_part = max(p + 1, int(triangle_bytes / (n_orders * width * data.itemsize)))
    starts = np.arange(0, n, per_part)
    rows = (min(per_part, n) + p) * n_orders
    triangle, right = np.empty((rows, width), data.dtype), np.empty(rows, observed.dtype)
    heads = np.zeros((len(starts) + 1, p * n_orders, width), data.dtype)
    head_rights = np.zeros((len(starts) + 1, p * n_orders), observed.dtype)
    for i, start in enumerate(starts):
        stop = min(start + per_part, n)
        _enter(triangle, right, heads[i], head_rights[i])
        if not forward(triangle, right, start, stop, data, observed, weights, stencils):
            raise _alike()
        used = (stop - start) * n_orders
        heads[i + 1], head_rights[i + 1] = triangle[used : used + p * n_orders], right[used : used + p * n_orders]
    x = np.zeros((n + p, n_orders), observed.dtype)
    for i in range(len(starts) - 1, -1, -1):
        start, stop = starts[i], min(starts[i] + per_part, n)
        if i < len(starts) - 1:
            _enter(triangle, right, heads[i], head_rights[i])
            forward(triangle, right, start, stop, data, observed, weights, stencils)
        if not _substitute(triangle, right, x.reshape(-1)[start * n_orders :], (stop - start) * n_orders):
            raise _alike()
    return np.ascontiguousarray(x[:n].T)


def _enter(triangle: Array, right: Array, head: Array, head_right: Array) -> None:
    """Begin a part with the rows that the part before left over; an empty row is zero."""
    triangle[:] = 0
    right[:] = 0
    triangle[: len(head)] = head
    right[: len(head)] = head_right


def _alike() -> RefusalError:
    return RefusalError("the orders cannot be told apart in this recording", remedy="leave one of them out")


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator,unused-ignore]
def _substitute(triangle: Array, right: Array, x: Array, n: int) -> bool:
    """Solve the triangle backwards for x[:n], given x[n:]; False if a diagonal is zero."""
    width = triangle.shape[1]
    for j in range(n - 1, -1, -1):
        if triangle[j, 0].real == 0.0:
            return False
        rest = right[j]
        for m in range(1, min(width, len(x) - j)):
            rest -= triangle[j, m] * x[j + m]
        x[j] = rest / triangle[j, 0].real
    return True


# Forward pass of a banded least-squares problem by the normal equations, sample by sample.
#
# Gauss's elimination without pivots (L D L*) of the normal equations, formed on the way. Several times faster than
# rotations; the error grows with r², so it is for weak weights only.


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


# Forward pass of a banded least-squares problem by Givens rotations, sample by sample.
#
# Rows of the data equation and of the structural equation are rotated one after the other into a banded triangle (the
# square-root information filter). The normal equations, whose condition is the square of this problem's, are never
# formed: the error is about r times the rounding error, not r².
#
# J. A. George, M. T. Heath, "Solution of sparse linear least squares problems using Givens rotations", 1980.


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
