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
