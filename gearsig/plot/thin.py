"""Thin long lines to what a screen can show, without losing a peak."""

from __future__ import annotations

import numpy as np

from gearsig.checks import FloatArray, count, frozen_array
from gearsig.errors import InputError

N_POINTS = 4000
"""Points of a thinned line: more than twice the pixel columns of a figure."""


def thin(x: FloatArray, y: FloatArray, n_points: int = N_POINTS) -> tuple[FloatArray, FloatArray]:
    """Return the line with at most `n_points` points, the smallest and largest value of every stretch among them.

    Parameters
    ----------
    x, y : array, (n,)
        A line; finite. Shorter ones come back unchanged.
    n_points : int
        At least 4.

    Returns
    -------
    x, y : array
        Points of the line in their order, first and last included: nothing is averaged or made up.

    Raises
    ------
    InputError
        If the lengths differ or a value is not finite.

    Notes
    -----
    For display only: a thinned line has no sampling rate, and its spectrum means nothing.

    Examples
    --------
    >>> x = np.arange(1_000_000.0)
    >>> _, y = thin(x, np.where(x == 123_456, 9.0, np.sin(x)))
    >>> len(y) <= 4000, float(y.max())
    (True, 9.0)
    """
    x, y = frozen_array(x, "x", ndim=1), frozen_array(y, "y", ndim=1)
    count(n_points, "n_points", minimum=4)
    if len(x) != len(y):
        raise InputError(f"x has {len(x)} points, y has {len(y)}", allowed="equal lengths")
    if len(y) <= n_points:
        return x, y
    kept = _extremes(y, (n_points - 2) // 2)
    return x[kept], y[kept]


def envelope(x: FloatArray, y: FloatArray, n_columns: int = N_POINTS // 4) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the smallest and largest value of `y` in at most `n_columns` columns of equal numbers of points.

    Parameters
    ----------
    x, y : array, (n,)
        A line; finite.
    n_columns : int

    Returns
    -------
    x : array
        Where the largest value of each column lies: a peak keeps its position.
    low, high : array
        Short lines come back unchanged, low and high being `y`.
    """
    x, y = frozen_array(x, "x", ndim=1), frozen_array(y, "y", ndim=1)
    count(n_columns, "n_columns", minimum=1)
    if len(x) != len(y):
        raise InputError(f"x has {len(x)} points, y has {len(y)}", allowed="equal lengths")
    if len(y) <= n_columns:
        return x, y, y
    starts = np.arange(0, len(y), -(-len(y) // n_columns))
    highest = np.array(
        [start + int(part.argmax()) for start, part in zip(starts, np.split(y, starts[1:]), strict=True)]
    )
    return x[highest], np.minimum.reduceat(y, starts), y[highest]


def _extremes(y: FloatArray, n_buckets: int) -> np.ndarray[tuple[int], np.dtype[np.intp]]:
    """Return the indices of both extremes of each bucket and of both ends, ascending."""
    length = -(-len(y) // n_buckets)  # rounded up, so that there are never more than n_buckets
    n_full = len(y) // length
    table = y[: n_full * length].reshape(n_full, length)
    starts = np.arange(n_full) * length
    parts = [starts + table.argmin(axis=1), starts + table.argmax(axis=1), [0, len(y) - 1]]
    tail = y[n_full * length :]
    if tail.size:
        parts.append(n_full * length + np.array([tail.argmin(), tail.argmax()]))
    return np.unique(np.concatenate(parts))
