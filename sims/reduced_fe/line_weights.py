"""Weights of nodes for means along a line of three-node cells."""

from __future__ import annotations

import numpy as np

from gearsig.checks import FloatArray


def line_weights(nodes: FloatArray, low: float, high: float) -> FloatArray:
    """Weights of the nodes of three-node cells whose middles lie halfway, for the mean from `low` to `high`.

    Ends beyond the line are moved to its ends; low = high interpolates. The weights add up to 1.
    """
    low, high = max(low, float(nodes[0])), min(high, float(nodes[-1]))
    weights = np.zeros(len(nodes))
    gauss, gauss_weight = np.polynomial.legendre.leggauss(2)
    for k in range(0, len(nodes) - 2, 2):
        start, end = nodes[k], nodes[k + 2]
        a, b = max(low, start), min(high, end)
        if low == high and start <= low <= end:
            at, share = np.array([low]), np.array([1.0])
        elif b > a:
            at, share = (a + b) / 2.0 + (b - a) / 2.0 * gauss, gauss_weight / 2.0 * (b - a) / (high - low)
        else:
            continue
        weights[k : k + 3] += _shape((at - start) / (end - start)) @ share
        if low == high:
            break
    return weights


def simpson_weights(places: FloatArray) -> FloatArray:
    """Weights of the integral over a whole line, divided by its length: they add up to 1."""
    weights = np.zeros(len(places))
    for k in range(0, len(places) - 2, 2):
        weights[k : k + 3] += (places[k + 2] - places[k]) * np.array([1.0, 4.0, 1.0]) / 6.0
    weights /= places[-1] - places[0]
    return weights


def parabolic_weights(n_nodes: int) -> FloatArray:
    """Weights of the mean over equal cells from 0 to 1 with the density 6t(1 − t); they add up to 1."""
    weights = np.zeros(n_nodes)
    gauss, gauss_weight = np.polynomial.legendre.leggauss(3)
    n_cells = (n_nodes - 1) // 2
    for k in range(n_cells):
        t = (k + (gauss + 1.0) / 2.0) / n_cells
        share = gauss_weight / 2.0 / n_cells * 6.0 * t * (1.0 - t)
        weights[2 * k : 2 * k + 3] += _shape((gauss + 1.0) / 2.0) @ share
    return weights


def _shape(t: FloatArray) -> FloatArray:
    """Shape functions of a three-node cell at 0 ≤ t ≤ 1, (3, n)."""
    return np.array([(1 - t) * (1 - 2 * t), 4 * t * (1 - t), t * (2 * t - 1)])
