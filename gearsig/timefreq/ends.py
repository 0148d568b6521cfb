"""What a signal is taken to be beyond its ends."""

from __future__ import annotations

from typing import Literal

import numpy as np

from gearsig.checks import FloatArray

Edges = Literal["reflect", "zero"]
EDGES = ("reflect", "zero")


def stretch(values: FloatArray, start: int, n: int, edges: Edges) -> FloatArray:
    """Return n samples from `start` on, in double precision, with what is assumed beyond the ends."""
    n_samples = len(values)
    inside = values[max(0, start) : max(0, start + n)]
    if len(inside) == n:
        return inside.astype(np.float64)
    result: FloatArray = np.zeros(n)
    if edges == "zero":
        result[max(0, -start) : max(0, -start) + len(inside)] = inside
        return result
    index = np.abs(np.arange(start, start + n)) % (2 * n_samples - 2)
    result[:] = values[np.minimum(index, 2 * n_samples - 2 - index)]
    return result
