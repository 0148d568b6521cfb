"""How much worse a joint Vold–Kalman problem is conditioned for orders that stay closer than the filter is wide."""

from __future__ import annotations

from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from gearsig.checks import FloatArray

POINTS_PER_STRETCH = 16
GROWTH = 1.5


def closeness(cycles: FloatArray, active: NDArray[np.bool_] | None, bandwidths: FloatArray, p: int) -> float:
    """Return the factor by which rounding errors grow, 1 where no two orders stay within a bandwidth.

    Two orders at a distance g below the bandwidth B can exchange what they hold at the price of (g/B)^2p, which divides
    the smallest eigenvalue of the normal equations. Within a stretch W the price is that of the distance's rms or of
    going up and down again in W, p/W, whichever is higher (factor from trials); the cheapest stretch counts. Orders
    that cross swiftly are close for too short a time to exchange much.

    Parameters
    ----------
    cycles : array, (n_orders, n)
        Phase of each order.
    active : array of bool, (n_orders, n), or None
    bandwidths : array, (n_orders, n) or (n_orders, 1)
        -3 dB, in cycles per sample.
    p : int
    """
    worst = 1.0
    for k, m in combinations(range(len(cycles)), 2):
        width = float(max(bandwidths[k].max(), bandwidths[m].max()))
        together = slice(None) if active is None else np.flatnonzero(active[k] & active[m])
        difference = cycles[k, together] - cycles[m, together]
        distance = _smallest_distance(difference, width, p)
        if distance < width:
            worst = max(worst, (width / max(distance, 1e-3 * width)) ** (2 * p))
    return worst


def _smallest_distance(difference: FloatArray, width: float, p: int) -> float:
    """Return the smallest of max(p/W, rms slope of the phase difference over W samples), W from 1/width on."""
    smallest, stretch = np.inf, 1.0 / width
    while len(difference) > 1:
        n = min(int(stretch) + 1, len(difference) - 1)
        step = max(1, n // POINTS_PER_STRETCH)
        slopes = np.diff(difference[::step]) / step
        m = min(len(slopes), max(1, round(n / step)))
        total = np.concatenate([[0.0], np.cumsum(slopes**2)])
        rms = float(np.sqrt(max(float((total[m:] - total[:-m]).min()), 0.0) / m))
        smallest = min(smallest, max(p / n, rms))
        if n >= len(difference) - 1 or rms > smallest:
            break
        stretch *= GROWTH
    return float(smallest)
