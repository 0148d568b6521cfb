"""Times at which a shaft passes given angles: the inverse of a piecewise cubic, solved exactly."""

from __future__ import annotations

from numba import njit


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator,unused-ignore]
def times_at(knots, angle, speed, k, first, step, out):  # type: ignore[no-untyped-def]
    """Solve θ(t) = first + i·step for each i, θ the Hermite cubic through knots, values `angle` and slopes `speed`.

    The search starts at interval k, which must not lie beyond the first angle. Newton's method in u = (t - t₀)/h of the interval, starting where the last solution's tangent points to, kept in a
    bracket: where the speed touches zero it falls back to bisection. The angles must lie within the knots' range.
    """
    n = knots.shape[0]
    u = 0.0
    for i in range(out.shape[0]):
        target = first + i * step
        moved = False
        while k < n - 2 and angle[k + 1] < target:
            k += 1
            moved = True
        h = knots[k + 1] - knots[k]
        rise = angle[k + 1] - angle[k]
        m0 = speed[k] * h
        m1 = speed[k + 1] * h
        # θ - θ₀ = ((c u + b) u + m0) u
        c = m0 + m1 - 2.0 * rise
        b = 3.0 * rise - 2.0 * m0 - m1
        wanted = target - angle[k]
        if wanted <= 0.0 or rise <= 0.0:
            u = 0.0
        elif wanted >= rise:
            u = 1.0
        else:
            low, high = 0.0, 1.0
            if moved or i == 0:
                u = wanted / rise
            else:
                slope = (3.0 * c * u + 2.0 * b) * u + m0
                u += step / slope if slope > 0.0 else 0.0
            if not low < u < high:
                u = wanted / rise
            for _ in range(60):
                error = ((c * u + b) * u + m0) * u - wanted
                slope = (3.0 * c * u + 2.0 * b) * u + m0
                if error > 0.0:
                    high = u
                else:
                    low = u
                change = error / slope if slope > 0.0 else 2.0
                following = u - change
                if not low <= following <= high:
                    following = 0.5 * (low + high)
                    change = u - following
                u = following
                # Newton's error squares itself: after a step of 1e-8 the next one is below rounding.
                if abs(change) < 1e-8 or high - low < 1e-15:
                    break
        out[i] = knots[k] + u * h


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator,unused-ignore]
def speeds_at(knots, speed, times, out):  # type: ignore[no-untyped-def]
    """Speed at sorted times, linear between the knots' slopes: enough for choosing a cut-off frequency."""
    k = 0
    n = knots.shape[0]
    for i in range(times.shape[0]):
        while k < n - 2 and knots[k + 1] < times[i]:
            k += 1
        part = (times[i] - knots[k]) / (knots[k + 1] - knots[k])
        part = min(max(part, 0.0), 1.0)
        out[i] = speed[k] + part * (speed[k + 1] - speed[k])


