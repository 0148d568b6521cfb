"""How neighbouring stretches of a path part."""

from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator,unused-ignore]
def mean_log_distance(points, here, there, block, across, sums, counts):  # type: ignore[no-untyped-def]
    """Add ln|x(i + k) - x(j + k)| for all pairs i, j and steps k to sums[block, k]; distances of zero are left out.

    Points are the path in time, (n, d); here and there hold the pairs, with a sample before and after each step. With
    `across` only the part of the distance across the path counts: the part along x(i + k + 1) - x(i + k - 1) is taken
    off.
    """
    d = points.shape[1]
    for r in range(here.shape[0]):
        i, j, b = here[r], there[r], block[r]
        for k in range(sums.shape[1]):
            square, along, speed = 0.0, 0.0, 0.0
            for a in range(d):
                difference = points[i + k, a] - points[j + k, a]
                square += difference * difference
                if across:
                    step = points[i + k + 1, a] - points[i + k - 1, a]
                    along += difference * step
                    speed += step * step
            if speed > 0.0:
                square -= along * along / speed
            if square > 0.0:
                sums[b, k] += 0.5 * np.log(square)
                counts[b, k] += 1


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator,unused-ignore]
def log_mean_distance(points, here, starts, near, block, sums, counts):  # type: ignore[no-untyped-def]
    """Add ln of the mean distance of a neighbourhood, Kantz's mean, to sums[block, k].

    Neighbours of reference r are near[starts[r] : starts[r + 1]]; the distance is that of the last coordinate.
    """
    n, d = points.shape
    n_steps = sums.shape[1]
    for r in range(here.shape[0]):
        i, b = here[r], block[r]
        for k in range(min(n_steps, n - i)):
            total, m = 0.0, 0
            for q in range(starts[r], starts[r + 1]):
                j = near[q]
                if j + k < n:
                    total += abs(points[i + k, d - 1] - points[j + k, d - 1])
                    m += 1
            if m > 0 and total > 0.0:
                sums[b, k] += np.log(total / m)
                counts[b, k] += 1
