"""Weights of nodes for means along a line of cells of three nodes (order 2) or two (order 1)."""

from __future__ import annotations

import numpy as np

from gearsig.checks import FloatArray


def line_weights(nodes: FloatArray, low: float, high: float, order: int = 2) -> FloatArray:
    """Weights of the nodes of cells, whose middle nodes lie halfway, for the mean from `low` to `high`.

    Ends beyond the line are moved to its ends; low = high interpolates. The weights add up to 1.
    """
    low, high = max(low, float(nodes[0])), min(high, float(nodes[-1]))
    weights = np.zeros(len(nodes))
    gauss, gauss_weight = np.polynomial.legendre.leggauss(2)
    for k in range(0, len(nodes) - order, order):
        start, end = nodes[k], nodes[k + order]
        a, b = max(low, start), min(high, end)
        if low == high and start <= low <= end:
            at, share = np.array([low]), np.array([1.0])
        elif b > a:
            at, share = (a + b) / 2.0 + (b - a) / 2.0 * gauss, gauss_weight / 2.0 * (b - a) / (high - low)
        else:
            continue
        weights[k : k + order + 1] += _shape((at - start) / (end - start), order) @ share
        if low == high:
            break
    return weights


def whole_weights(places: FloatArray, order: int = 2) -> FloatArray:
    """Weights of the integral over a whole line, divided by its length: they add up to 1. Simpson's or trapezoids."""
    weights = np.zeros(len(places))
    share = np.array([1.0, 4.0, 1.0]) / 6.0 if order == 2 else np.array([0.5, 0.5])
    for k in range(0, len(places) - order, order):
        weights[k : k + order + 1] += (places[k + order] - places[k]) * share
    weights /= places[-1] - places[0]
    return weights


def parabolic_weights(n_nodes: int, order: int = 2) -> FloatArray:
    """Weights of the mean over equal cells from 0 to 1 with the density 6t(1 − t); they add up to 1."""
    weights = np.zeros(n_nodes)
    gauss, gauss_weight = np.polynomial.legendre.leggauss(3)
    n_cells = (n_nodes - 1) // order
    for k in range(n_cells):
        t = (k + (gauss + 1.0) / 2.0) / n_cells
        share = gauss_weight / 2.0 / n_cells * 6.0 * t * (1.0 - t)
        weights[order * k : order * (k + 1) + 1] += _shape((gauss + 1.0) / 2.0, order) @ share
    return weights


def _shape(t: FloatArray, order: int) -> FloatArray:
    """Shape functions of a cell at 0 ≤ t ≤ 1, (order + 1, n)."""
    if order == 1:
        return np.array([1 - t, t])
    return np.array([(1 - t) * (1 - 2 * t), 4 * t * (1 - t), t * (2 * t - 1)])
