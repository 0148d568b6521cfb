"""Recurrent pairs and the lines they form, without the matrix."""

from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator,unused-ignore]
def recurrence_matrix(points, radius, out):  # type: ignore[no-untyped-def]
    """out[i, j] = |x(i) - x(j)| < radius, Euclidean."""
    n, d = points.shape
    limit = radius * radius
    for i in range(n):
        out[i, i] = True
        for j in range(i):
            square = 0.0
            for a in range(d):
                difference = points[i, a] - points[j, a]
                square += difference * difference
            out[i, j] = out[j, i] = square < limit


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator,unused-ignore]
def line_lengths(points, radius, theiler, diagonal, vertical):  # type: ignore[no-untyped-def]
    """Count lines by length: diagonal[l] in the upper triangle, vertical[l] in all columns; index 0 holds no line.

    Pairs within `theiler` points in time count as not recurrent. The matrix is symmetric: a column below the excluded
    band is a row above it, so one pass over the upper triangle finds the vertical lines of both halves.
    """
    n, d = points.shape
    limit = radius * radius
    column_run = np.zeros(n, dtype=np.int64)
    diagonal_run = np.zeros(n, dtype=np.int64)  # by j - i
    for i in range(n):
        run = 0
        for j in range(i + theiler + 1, n):
            square = 0.0
            for a in range(d):
                difference = points[i, a] - points[j, a]
                square += difference * difference
            lag = j - i
            if square < limit:
                diagonal_run[lag] += 1
                column_run[j] += 1  # along i at fixed j: column of the upper triangle
                run += 1  # along j at fixed i: column of the lower triangle
            else:
                diagonal[diagonal_run[lag]] += 1
                diagonal_run[lag] = 0
                vertical[column_run[j]] += 1
                column_run[j] = 0
                vertical[run] += 1
                run = 0
        vertical[run] += 1
        if i + theiler + 1 < n:
            j = i + theiler + 1  # the next row enters this column's excluded band: its run ends here
            vertical[column_run[j]] += 1
            column_run[j] = 0
    for lag in range(theiler + 1, n):
        diagonal[diagonal_run[lag]] += 1
