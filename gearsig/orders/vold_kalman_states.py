"""Recursions of the Vold–Kalman filter for one order: information filter from both ends, smoother back to them.

The state z holds the order's value x and its differences up to p - 1. The structural equation is the noise ε of the
highest one, with variance q = 1/r². What the samples so far say is kept as zᵀSz - 2gᵀz. A step disturbs the last
component (index p) and then sums up: with s the last row of S,

    ρ = 1/(1 + q s_p),  G = q ρ s,  S -= G sᵀ,  g -= G g_p,   and on the way back   ε = Gᵀz - q ρ g_p.

As large a number as r² never meets one as small as the data: rounding grows with the filter's memory, 1/bandwidth, not
with r² as in the normal equations. Both halves of the signal are run over in the same loop, each from its end (row 0
forwards, row 1 backwards in time): a step waits for the one before it, and two that do not wait for each other fit
into the time of one.

B. D. O. Anderson, J. B. Moore, "Optimal Filtering", 1979, chapters 6 and 7.
"""

from __future__ import annotations

from typing import Any

from numba import njit
from numpy.typing import NDArray

from gearsig.checks import FloatArray

Array = NDArray[Any]
State = tuple[Any, ...]
FINITE = {"nnan", "ninf", "nsz", "contract"}
"""With nothing infinite, a complex number times a real one costs two products, not four."""


@njit(cache=True, nogil=True, fastmath=FINITE, error_model="numpy")  # type: ignore[untyped-decorator,unused-ignore]
def forward_one(
    front: Array, back: Array, level: FloatArray, q: FloatArray, gains: FloatArray, s: FloatArray, g: Array
) -> None:
    """Run over a part of both halves: x' = x + ε.

    Parameters
    ----------
    front, back : arrays, (n,), real or complex
        Data (0 where inactive) of either half, from its end on; on return q ρ g.
    level : array, (2, n)
        1 where the order is part of the data, 0 elsewhere.
    q : array, (2, n)
        Variance of the step after each sample.
    gains : array, (2, n, 1)
        On return, G of the step after each sample.
    s, g : arrays, (2, 1)
        Form before this part and, on return, after it. Before any data: zero.
    """
    a, b = (s[0, 0], g[0, 0]), (s[1, 0], g[1, 0])
    for i in range(len(front)):
        a = _step_one(a, front, level, q, gains, 0, i)
        b = _step_one(b, back, level, q, gains, 1, i)
    s[0, 0], g[0, 0] = a
    s[1, 0], g[1, 0] = b


@njit(cache=True, nogil=True, fastmath=FINITE, error_model="numpy", forceinline=True)  # type: ignore[untyped-decorator,unused-ignore]
def _step_one(form: State, x: Array, level: FloatArray, q: FloatArray, gains: FloatArray, row: int, i: int) -> State:
    """Add the data of a sample, and go to the next."""
    s_x, g_x = form
    s_x += level[row, i]
    g_x += x[i]
    rho = 1.0 / (1.0 + q[row, i] * s_x)
    gains[row, i, 0] = q[row, i] * rho * s_x
    x[i] = q[row, i] * rho * g_x
    return rho * s_x, rho * g_x


@njit(cache=True, nogil=True, fastmath=FINITE, error_model="numpy")  # type: ignore[untyped-decorator,unused-ignore]
def backward_one(front: Array, back: Array, gains: FloatArray, z: Array) -> None:
    """Turn q ρ g into the solution; z, (2, 1), is the state after this part and, on return, before it."""
    a, b = z[0, 0], z[1, 0]
    for i in range(len(front) - 1, -1, -1):
        a += front[i] - gains[0, i, 0] * a
        b += back[i] - gains[1, i, 0] * b
        front[i], back[i] = a, b
    z[0, 0], z[1, 0] = a, b


@njit(cache=True, nogil=True, fastmath=FINITE, error_model="numpy")  # type: ignore[untyped-decorator,unused-ignore]
def forward_two(
    front: Array,
    back: Array,
    level: FloatArray,
    q: FloatArray,
    kappa: FloatArray,
    gains: FloatArray,
    s: FloatArray,
    g: Array,
) -> None:
    """Run over a part of both halves: v' = v - κx + ε, x' = x + v', so x_(n+1) - (2 - κ) x_n + x_(n-1) = ε.

    κ = 0: two poles. κ = 2 - 2 cos ω: first generation. As `forward_one`; s holds xx, xv, vv. The gain of x is kept
    less κ, as the way back needs it.
    """
    a = (s[0, 0], s[0, 1], s[0, 2], g[0, 0], g[0, 1])
    b = (s[1, 0], s[1, 1], s[1, 2], g[1, 0], g[1, 1])
    for i in range(len(front)):
        a = _step_two(a, front, level, q, kappa, gains, 0, i)
        b = _step_two(b, back, level, q, kappa, gains, 1, i)
    s[0, 0], s[0, 1], s[0, 2], g[0, 0], g[0, 1] = a
    s[1, 0], s[1, 1], s[1, 2], g[1, 0], g[1, 1] = b


@njit(cache=True, nogil=True, fastmath=FINITE, error_model="numpy", forceinline=True)  # type: ignore[untyped-decorator,unused-ignore]
def _step_two(
    form: State, x: Array, level: FloatArray, q: FloatArray, kappa: FloatArray, gains: FloatArray, row: int, i: int
) -> State:
    """Add the data of a sample, and go to the next."""
    s_xx, s_xv, s_vv, g_x, g_v = form
    k = kappa[row, i]
    # v = v' + κx
    m_xv = s_xv + k * s_vv
    m_xx = s_xx + level[row, i] + k * (s_xv + m_xv)
    g_x += x[i] + k * g_v
    rho = 1.0 / (1.0 + q[row, i] * s_vv)
    q_rho = q[row, i] * rho
    gain_x = q_rho * m_xv
    gains[row, i, 0], gains[row, i, 1] = gain_x - k, q_rho * s_vv
    x[i] = q_rho * g_v
    m_xx -= gain_x * m_xv
    m_xv *= rho
    g_x -= gain_x * g_v
    # x = x' - v'
    return m_xx, m_xv - m_xx, s_vv * rho - 2.0 * m_xv + m_xx, g_x, rho * g_v - g_x


@njit(cache=True, nogil=True, fastmath=FINITE, error_model="numpy")  # type: ignore[untyped-decorator,unused-ignore]
def backward_two(front: Array, back: Array, gains: FloatArray, z: Array) -> None:
    """Turn q ρ g into the solution, as `backward_one`; z, (2, 2), holds x and v."""
    a, b = (z[0, 0], z[0, 1]), (z[1, 0], z[1, 1])
    for i in range(len(front) - 1, -1, -1):
        a = _back_two(a, front, gains, 0, i)
        b = _back_two(b, back, gains, 1, i)
    z[0, 0], z[0, 1] = a
    z[1, 0], z[1, 1] = b


@njit(cache=True, nogil=True, fastmath=FINITE, error_model="numpy", forceinline=True)  # type: ignore[untyped-decorator,unused-ignore]
def _back_two(z: State, x: Array, gains: FloatArray, row: int, i: int) -> State:
    z_x, z_v = z
    z_x -= z_v
    z_v += x[i] - gains[row, i, 0] * z_x - gains[row, i, 1] * z_v
    x[i] = z_x
    return z_x, z_v


@njit(cache=True, nogil=True, fastmath=FINITE, error_model="numpy")  # type: ignore[untyped-decorator,unused-ignore]
def forward_three(
    front: Array, back: Array, level: FloatArray, q: FloatArray, gains: FloatArray, s: FloatArray, g: Array
) -> None:
    """Run over a part of both halves: a' = a + ε, v' = v + a', x' = x + v'.

    As `forward_one`; s holds xx, xv, xa, vv, va, aa.
    """
    a = (s[0, 0], s[0, 1], s[0, 2], s[0, 3], s[0, 4], s[0, 5], g[0, 0], g[0, 1], g[0, 2])
    b = (s[1, 0], s[1, 1], s[1, 2], s[1, 3], s[1, 4], s[1, 5], g[1, 0], g[1, 1], g[1, 2])
    for i in range(len(front)):
        a = _step_three(a, front, level, q, gains, 0, i)
        b = _step_three(b, back, level, q, gains, 1, i)
    s[0, 0], s[0, 1], s[0, 2], s[0, 3], s[0, 4], s[0, 5], g[0, 0], g[0, 1], g[0, 2] = a
    s[1, 0], s[1, 1], s[1, 2], s[1, 3], s[1, 4], s[1, 5], g[1, 0], g[1, 1], g[1, 2] = b


@njit(cache=True, nogil=True, fastmath=FINITE, error_model="numpy", forceinline=True)  # type: ignore[untyped-decorator,unused-ignore]
def _step_three(form: State, x: Array, level: FloatArray, q: FloatArray, gains: FloatArray, row: int, i: int) -> State:
    """Add the data of a sample, and go to the next."""
    xx, xv, xa, vv, va, aa, g_x, g_v, g_a = form
    xx += level[row, i]
    g_x += x[i]
    rho = 1.0 / (1.0 + q[row, i] * aa)
    q_rho = q[row, i] * rho
    gain_x, gain_v = q_rho * xa, q_rho * va
    gains[row, i, 0], gains[row, i, 1], gains[row, i, 2] = gain_x, gain_v, q_rho * aa
    x[i] = q_rho * g_a
    xx, xv, vv = xx - gain_x * xa, xv - gain_x * va, vv - gain_v * va
    xa, va, aa = rho * xa, rho * va, rho * aa
    g_x, g_v, g_a = g_x - gain_x * g_a, g_v - gain_v * g_a, rho * g_a
    # v = v' - a'
    xa, va, aa, g_a = xa - xv, va - vv, aa - 2.0 * va + vv, g_a - g_v
    # x = x' - v'
    return xx, xv - xx, xa, vv - 2.0 * xv + xx, va - xa, aa, g_x, g_v - g_x, g_a


@njit(cache=True, nogil=True, fastmath=FINITE, error_model="numpy")  # type: ignore[untyped-decorator,unused-ignore]
def backward_three(front: Array, back: Array, gains: FloatArray, z: Array) -> None:
    """Turn q ρ g into the solution, as `backward_one`; z, (2, 3), holds x, v and a."""
    a, b = (z[0, 0], z[0, 1], z[0, 2]), (z[1, 0], z[1, 1], z[1, 2])
    for i in range(len(front) - 1, -1, -1):
        a = _back_three(a, front, gains, 0, i)
        b = _back_three(b, back, gains, 1, i)
    z[0, 0], z[0, 1], z[0, 2] = a
    z[1, 0], z[1, 1], z[1, 2] = b


@njit(cache=True, nogil=True, fastmath=FINITE, error_model="numpy", forceinline=True)  # type: ignore[untyped-decorator,unused-ignore]
def _back_three(z: State, x: Array, gains: FloatArray, row: int, i: int) -> State:
    z_x, z_v, z_a = z
    z_x -= z_v
    z_v -= z_a
    z_a += x[i] - gains[row, i, 0] * z_x - gains[row, i, 1] * z_v - gains[row, i, 2] * z_a
    x[i] = z_x
    return z_x, z_v, z_a
