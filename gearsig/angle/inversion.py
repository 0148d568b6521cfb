"""Times at which a shaft passes given angles: the inverse of a piecewise cubic, solved exactly."""

from __future__ import annotations

import numpy as np
from numba import njit

# Points per block that start from one cubic guess; short enough for the guess to be good, long enough to pay.
_BLOCK = 32

# Slope of the inverse, over an interval's length, beyond which the shaft all but stands: no cubic guess follows that.
_STEEPEST = 1e3


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator,unused-ignore]
def times_at(knots, angle, speed, k, first, step, out):  # type: ignore[no-untyped-def]
    """Solve θ(t) = first + i·step for each i, θ the Hermite cubic through knots, values `angle` and slopes `speed`.

    The search starts at interval k, which must not lie beyond the first angle; all angles lie within the knots'
    range. In
    u = (t - t₀)/h of an interval, θ - θ₀ = ((c u + b) u + a) u. The ends of each block are solved one by one, the
    points between by two
    Newton steps from the cubic through the ends of the inverse function; these steps do not wait for each other.
    """
    n, n_knots = out.shape[0], knots.shape[0]
    i = 0
    while i < n:
        while k < n_knots - 2 and angle[k + 1] < first + i * step:
            k += 1
        h, rise = knots[k + 1] - knots[k], angle[k + 1] - angle[k]
        a, m1 = speed[k] * h, speed[k + 1] * h
        c, b = a + m1 - 2.0 * rise, 3.0 * rise - 2.0 * a - m1
        stop = n
        if k < n_knots - 2:
            stop = max(i + 1, min(n, int(np.floor((angle[k + 1] - first) / step)) + 1))
        low = solve_cubic(a, b, c, rise, first + i * step - angle[k], 0.0)
        out[i] = knots[k] + low * h
        i += 1
        while i < stop:
            last = min(i + _BLOCK, stop) - 1
            high = solve_cubic(a, b, c, rise, first + last * step - angle[k], low)
            offset = first - angle[k]
            if last > i and not _between(a, b, c, low, high, offset, step, i, last, knots[k], h, out):
                for j in range(i, last):
                    low = solve_cubic(a, b, c, rise, offset + j * step, low)
                    out[j] = knots[k] + low * h
            out[last] = knots[k] + high * h
            low = high
            i = last + 1


@njit(cache=True, nogil=True, fastmath={"contract", "reassoc", "arcp"})  # type: ignore[untyped-decorator,unused-ignore]
def _between(a, b, c, low, high, offset, step, start, last, t0, h, out):  # type: ignore[no-untyped-def]
    """Fill out[start:last] between solved points `low` (at start - 1) and `high` (at last); say if Newton settled."""
    slope_low, slope_high = (3.0 * c * low + 2.0 * b) * low + a, (3.0 * c * high + 2.0 * b) * high + a
    if slope_low <= 0.0 or slope_high <= 0.0:
        return False
    width = (last - start + 1) * step
    m0, m1, rise = width / slope_low, width / slope_high, high - low
    if max(m0, m1) > _STEEPEST:
        return False
    guess_c, guess_b = m0 + m1 - 2.0 * rise, 3.0 * rise - 2.0 * m0 - m1
    per_point = 1.0 / (last - start + 1)
    worst = 0.0
    for j in range(start, last):
        s = (j - start + 1) * per_point
        wanted = offset + j * step
        u = low + ((guess_c * s + guess_b) * s + m0) * s
        # The slope hardly changes between the two steps: one division serves both.
        per_slope = 1.0 / ((3.0 * c * u + 2.0 * b) * u + a)
        u -= (((c * u + b) * u + a) * u - wanted) * per_slope
        change = (((c * u + b) * u + a) * u - wanted) * per_slope
        worst = max(worst, abs(change))
        out[j] = t0 + (u - change) * h
    # Newton's error squares itself: after a step of 1e-8 the next one would be below rounding.
    return worst < 1e-8


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator,unused-ignore]
def solve_cubic(a, b, c, rise, wanted, start):  # type: ignore[no-untyped-def]
    """Return u in 0 to 1 with ((c u + b) u + a) u = wanted, for a cubic rising to `rise`; Newton in a bracket."""
    if wanted <= 0.0 or rise <= 0.0:
        return 0.0
    if wanted >= rise:
        return 1.0
    low, high = 0.0, 1.0
    u = start if 0.0 < start < 1.0 else wanted / rise
    for _ in range(100):
        error = ((c * u + b) * u + a) * u - wanted
        slope = (3.0 * c * u + 2.0 * b) * u + a
        if error > 0.0:
            high = u
        else:
            low = u
        following = u - error / slope if slope > 0.0 else -1.0
        # Where the speed touches zero, Newton may leave the bracket; halving does not.
        if not low <= following <= high:
            following = 0.5 * (low + high)
        change = abs(following - u)
        u = following
        if change < 1e-8 or high - low < 1e-15:
            break
    return u


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator,unused-ignore]
def scales_at(knots, speed, times, factor, lowest, out):  # type: ignore[no-untyped-def]
    """Take factor · speed at sorted times, kept between `lowest` and 1, and return the smallest of them.

    The speed is taken as linear between the knots' slopes: enough for choosing a cut-off frequency.
    """
    k = 0
    n = knots.shape[0]
    smallest = 1.0
    rise = (speed[1] - speed[0]) / (knots[1] - knots[0])
    for i in range(times.shape[0]):
        while k < n - 2 and knots[k + 1] < times[i]:
            k += 1
            rise = (speed[k + 1] - speed[k]) / (knots[k + 1] - knots[k])
        scale = factor * (speed[k] + rise * (times[i] - knots[k]))
        out[i] = min(max(scale, lowest), 1.0)
        smallest = min(smallest, out[i])
    return smallest
