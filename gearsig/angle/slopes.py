"""Slopes of an angle known at knots: local polynomials, limited so that the cubic between the knots never decreases."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gearsig.checks import FloatArray


def monotone_slopes(t: FloatArray, y: FloatArray) -> FloatArray:
    """Return slopes at the knots of non-decreasing data.

    The slope is that of the quartic through the knot and two neighbours on each side (fewer at the ends and for short
    data), so polynomials up to degree four, and with them constant acceleration, are exact. Slopes are then limited to
    three times the smaller adjacent secant, which is sufficient for a monotone Hermite cubic.

    Source: F. N. Fritsch, R. E. Carlson, *Monotone piecewise cubic interpolation*, SIAM J. Numer. Anal. 17 (1980).
    """
    n = len(t)
    secants = np.diff(y) / np.diff(t)
    if n == 2:
        return np.repeat(secants, 2)
    slopes = np.empty(n)
    width = min(5, n)
    middle = width // 2
    inner = np.arange(n - width + 1)
    slopes[inner + middle] = _lagrange_slope(t, y, inner, width, middle)
    # At the ends a lower degree: a one-sided quartic would amplify timing errors several times.
    end = min(4, n)
    for i in range(middle):
        slopes[i] = _lagrange_slope(t, y, np.array([0]), end, i)[0]
    for i in range(n - width + middle + 1, n):
        slopes[i] = _lagrange_slope(t, y, np.array([n - end]), end, i - (n - end))[0]
    limit = 3.0 * np.minimum(np.append(secants, secants[-1]), np.insert(secants, 0, secants[0]))
    return np.clip(slopes, 0.0, limit)


def _lagrange_slope(t: FloatArray, y: FloatArray, start: NDArray[np.integer[Any]], width: int, at: int) -> FloatArray:
    """Slope at node `at` of the polynomial through `width` nodes from each `start`.

    With nodes t_j: p'(t_a) = Σ_{j≠a} (y_j - y_a) · w_j/w_a / (t_a - t_j), w the barycentric weights.

    Source: J.-P. Berrut, L. N. Trefethen, *Barycentric Lagrange interpolation*, SIAM Review 46 (2004), eq. 9.4.
    """
    nodes = t[start[:, None] + np.arange(width)]
    values = y[start[:, None] + np.arange(width)]
    gaps = nodes[:, :, None] - nodes[:, None, :]
    gaps[:, np.arange(width), np.arange(width)] = 1.0
    # Scaling by the span keeps the products away from under- and overflow.
    span = (nodes[:, -1] - nodes[:, 0])[:, None]
    weights = 1.0 / np.prod(gaps / span[:, :, None], axis=2)
    slope = np.zeros(len(nodes))
    for j in range(width):
        if j != at:
            step = (values[:, j] - values[:, at]) / (nodes[:, j] - nodes[:, at])
            slope -= weights[:, j] / weights[:, at] * step
    return slope
