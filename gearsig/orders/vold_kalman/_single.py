"""The Vold–Kalman filter for one order by itself, exact at any bandwidth: second generation, first generation."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from gearsig.checks import FloatArray
from gearsig.errors import RefusalError
from gearsig.orders.vold_kalman._tracks import HALF_POWER, cosine_and_sine

# --------------------
# Recursions of the Vold–Kalman filter for one order: information filter from both ends, smoother back to them.
#
# The state z holds the order's value x and its differences up to p - 1. The structural equation is the noise ε of the
# highest one, with variance q = 1/r². What the samples so far say is kept as zᵀSz - 2gᵀz. A step disturbs the last
# component (index p) and then sums up: with s the last row of S,
#
#     ρ = 1/(1 + q s_p),  G = q ρ s,  S -= G sᵀ,  g -= G g_p,   and on the way back   ε = Gᵀz - q ρ g_p.
#
# As large a number as r² never meets one as small as the data: rounding grows with the filter's memory, 1/bandwidth,
# not with r² as in the normal equations. Both halves of the signal are run over in the same loop, each from its end
# (row 0 forwards, row 1 backwards in time): a step waits for the one before it, and two that do not wait for each other
# fit into the time of one.
#
# B. D. O. Anderson, J. B. Moore, "Optimal Filtering", 1979, chapters 6 and 7.
# --------------------


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


# --------------------
# Recursions of the Vold–Kalman filter for one order together with its mirror image at negative frequency.
#
# As `vold_kalman_states`, with a pair of real numbers u, v (the envelope u + iv) for each component of the state: the
# signal is y = u cos Θ - v sin Θ, so S starts from the row (cos Θ, -sin Θ) and its blocks are 2 by 2. With P the last
# block on the diagonal, R = 1/(I + qP) takes the place of ρ.
# --------------------


Block = tuple[float, float, float, float]
"""2 by 2, row by row."""
N_GAINS = {1: 3, 2: 7, 3: 11}
"""Kept per step, by poles: R (symmetric) and q s_j R of the other components."""


@njit(cache=True, nogil=True, fastmath=FINITE, error_model="numpy")  # type: ignore[untyped-decorator,unused-ignore]
def forward_pair_one(
    front: Array, back: Array, data: FloatArray, q: FloatArray, gains: FloatArray, s: FloatArray, g: Array
) -> None:
    """Run over a part of both halves: x' = x + ε.

    Parameters
    ----------
    front, back : arrays, (n,), complex
        On return, q R g of either half, from its end on.
    data : array, (3, 2, n)
        Signal, cosine and sine; zero where inactive.
    q : array, (2, n)
        Variance of the step after each sample.
    gains : array, (2, n, n_gains)
        On return, those of the step after each sample.
    s, g : arrays, (2, 1, 4) and (2, 1)
        Form before this part and, on return, after it. Before any data: zero.
    """
    a, b = (_block(s, 0, 0), g[0, 0]), (_block(s, 1, 0), g[1, 0])
    for i in range(len(front)):
        a = _step_one_vold_kalman_pairs(a, front, data, q, gains, 0, i)
        b = _step_one_vold_kalman_pairs(b, back, data, q, gains, 1, i)
    _store(s, 0, 0, a[0])
    _store(s, 1, 0, b[0])
    g[0, 0], g[1, 0] = a[1], b[1]


@njit(cache=True, nogil=True, fastmath=FINITE, error_model="numpy", forceinline=True)  # type: ignore[untyped-decorator,unused-ignore]
def _step_one_vold_kalman_pairs(
    form: State, x: Array, data: FloatArray, q: FloatArray, gains: FloatArray, row: int, i: int
) -> State:
    """Add the data of a sample, and go to the next."""
    s_x, g_x = form
    s_x, g_x = _with_data(s_x, g_x, data, row, i)
    r, s_x = _damped(s_x, q[row, i])
    _store_symmetric(gains, row, i, r)
    g_x = _applied(r, g_x)
    x[i] = q[row, i] * g_x
    return s_x, g_x


@njit(cache=True, nogil=True, fastmath=FINITE, error_model="numpy")  # type: ignore[untyped-decorator,unused-ignore]
def backward_pair_one(front: Array, back: Array, gains: FloatArray, z: Array) -> None:
    """Turn q R g into the solution; z, (2, 1), is the state after this part and, on return, before it."""
    a, b = z[0, 0], z[1, 0]
    for i in range(len(front) - 1, -1, -1):
        a = _applied(_symmetric(gains, 0, i), a) + front[i]
        b = _applied(_symmetric(gains, 1, i), b) + back[i]
        front[i], back[i] = a, b
    z[0, 0], z[1, 0] = a, b


@njit(cache=True, nogil=True, fastmath=FINITE, error_model="numpy")  # type: ignore[untyped-decorator,unused-ignore]
def forward_pair_two(
    front: Array, back: Array, data: FloatArray, q: FloatArray, gains: FloatArray, s: FloatArray, g: Array
) -> None:
    """Run over a part of both halves: v' = v + ε, x' = x + v'. As `forward_pair_one`; s holds xx, xv, vv."""
    a = (_block(s, 0, 0), _block(s, 0, 1), _block(s, 0, 2), g[0, 0], g[0, 1])
    b = (_block(s, 1, 0), _block(s, 1, 1), _block(s, 1, 2), g[1, 0], g[1, 1])
    for i in range(len(front)):
        a = _step_two_vold_kalman_pairs(a, front, data, q, gains, 0, i)
        b = _step_two_vold_kalman_pairs(b, back, data, q, gains, 1, i)
    for row, form in ((0, a), (1, b)):
        _store(s, row, 0, form[0])
        _store(s, row, 1, form[1])
        _store(s, row, 2, form[2])
        g[row, 0], g[row, 1] = form[3], form[4]


@njit(cache=True, nogil=True, fastmath=FINITE, error_model="numpy", forceinline=True)  # type: ignore[untyped-decorator,unused-ignore]
def _step_two_vold_kalman_pairs(
    form: State, x: Array, data: FloatArray, q: FloatArray, gains: FloatArray, row: int, i: int
) -> State:
    """Add the data of a sample, and go to the next."""
    xx, xv, vv, g_x, g_v = form
    xx, g_x = _with_data(xx, g_x, data, row, i)
    r, vv = _damped(vv, q[row, i])
    xv_r = _product(xv, r)
    gain_x = _scaled(q[row, i], xv_r)
    _store_symmetric(gains, row, i, r)
    _store_at(gains, row, i, 3, gain_x)
    xx = _upper(_difference(xx, _product(gain_x, _transposed(xv))))
    g_x -= _applied(gain_x, g_v)
    g_v = _applied(r, g_v)
    x[i] = q[row, i] * g_v
    # x = x' - v'
    xv = _difference(xv_r, xx)
    return xx, xv, _upper(_difference(_difference(vv, _transposed(xv_r)), xv)), g_x, g_v - g_x


@njit(cache=True, nogil=True, fastmath=FINITE, error_model="numpy")  # type: ignore[untyped-decorator,unused-ignore]
def backward_pair_two(front: Array, back: Array, gains: FloatArray, z: Array) -> None:
    """Turn q R g into the solution, as `backward_pair_one`; z, (2, 2), holds x and v."""
    a, b = (z[0, 0], z[0, 1]), (z[1, 0], z[1, 1])
    for i in range(len(front) - 1, -1, -1):
        a = _back_two_vold_kalman_pairs(a, front, gains, 0, i)
        b = _back_two_vold_kalman_pairs(b, back, gains, 1, i)
    z[0, 0], z[0, 1] = a
    z[1, 0], z[1, 1] = b


@njit(cache=True, nogil=True, fastmath=FINITE, error_model="numpy", forceinline=True)  # type: ignore[untyped-decorator,unused-ignore]
def _back_two_vold_kalman_pairs(z: State, x: Array, gains: FloatArray, row: int, i: int) -> State:
    z_x, z_v = z
    z_x -= z_v
    z_v = _applied(_symmetric(gains, row, i), z_v) - _applied(_transposed(_at(gains, row, i, 3)), z_x) + x[i]
    x[i] = z_x
    return z_x, z_v


@njit(cache=True, nogil=True, fastmath=FINITE, error_model="numpy")  # type: ignore[untyped-decorator,unused-ignore]
def forward_pair_three(
    front: Array, back: Array, data: FloatArray, q: FloatArray, gains: FloatArray, s: FloatArray, g: Array
) -> None:
    """Run over a part of both halves: a' = a + ε, v' = v + a', x' = x + v'.

    As `forward_pair_one`; s holds xx, xv, xa, vv, va, aa.
    """
    a = (
        (_block(s, 0, 0), _block(s, 0, 1), _block(s, 0, 2), _block(s, 0, 3), _block(s, 0, 4), _block(s, 0, 5)),
        (g[0, 0], g[0, 1], g[0, 2]),
    )
    b = (
        (_block(s, 1, 0), _block(s, 1, 1), _block(s, 1, 2), _block(s, 1, 3), _block(s, 1, 4), _block(s, 1, 5)),
        (g[1, 0], g[1, 1], g[1, 2]),
    )
    for i in range(len(front)):
        a = _step_three_vold_kalman_pairs(a, front, data, q, gains, 0, i)
        b = _step_three_vold_kalman_pairs(b, back, data, q, gains, 1, i)
    for row, form in ((0, a), (1, b)):
        for k in range(6):
            _store(s, row, k, form[0][k])
        g[row, 0], g[row, 1], g[row, 2] = form[1]


@njit(cache=True, nogil=True, fastmath=FINITE, error_model="numpy", forceinline=True)  # type: ignore[untyped-decorator,unused-ignore]
def _step_three_vold_kalman_pairs(
    form: State, x: Array, data: FloatArray, q: FloatArray, gains: FloatArray, row: int, i: int
) -> State:
    """Add the data of a sample, and go to the next."""
    (xx, xv, xa, vv, va, aa), (g_x, g_v, g_a) = form
    xx, g_x = _with_data(xx, g_x, data, row, i)
    r, aa = _damped(aa, q[row, i])
    xa_r, va_r = _product(xa, r), _product(va, r)
    gain_x, gain_v = _scaled(q[row, i], xa_r), _scaled(q[row, i], va_r)
    _store_symmetric(gains, row, i, r)
    _store_at(gains, row, i, 3, gain_x)
    _store_at(gains, row, i, 7, gain_v)
    to_a, to_v = _transposed(xa), _transposed(va)
    xx, xv = _upper(_difference(xx, _product(gain_x, to_a))), _difference(xv, _product(gain_x, to_v))
    vv = _upper(_difference(vv, _product(gain_v, to_v)))
    g_x, g_v, g_a = g_x - _applied(gain_x, g_a), g_v - _applied(gain_v, g_a), _applied(r, g_a)
    x[i] = q[row, i] * g_a
    # v = v' - a'
    xa, va = _difference(xa_r, xv), _difference(va_r, vv)
    aa = _upper(_difference(_difference(aa, _transposed(va_r)), va))
    # x = x' - v'
    va, x_v = _difference(va, xa), _difference(xv, xx)
    vv = _upper(_difference(_difference(vv, _transposed(xv)), x_v))
    return (xx, x_v, xa, vv, va, aa), (g_x, g_v - g_x, g_a - g_v)


@njit(cache=True, nogil=True, fastmath=FINITE, error_model="numpy")  # type: ignore[untyped-decorator,unused-ignore]
def backward_pair_three(front: Array, back: Array, gains: FloatArray, z: Array) -> None:
    """Turn q R g into the solution, as `backward_pair_one`; z, (2, 3), holds x, v and a."""
    a, b = (z[0, 0], z[0, 1], z[0, 2]), (z[1, 0], z[1, 1], z[1, 2])
    for i in range(len(front) - 1, -1, -1):
        a = _back_three_vold_kalman_pairs(a, front, gains, 0, i)
        b = _back_three_vold_kalman_pairs(b, back, gains, 1, i)
    z[0, 0], z[0, 1], z[0, 2] = a
    z[1, 0], z[1, 1], z[1, 2] = b


@njit(cache=True, nogil=True, fastmath=FINITE, error_model="numpy", forceinline=True)  # type: ignore[untyped-decorator,unused-ignore]
def _back_three_vold_kalman_pairs(z: State, x: Array, gains: FloatArray, row: int, i: int) -> State:
    z_x, z_v, z_a = z
    z_x -= z_v
    z_v -= z_a
    gain_x, gain_v = _transposed(_at(gains, row, i, 3)), _transposed(_at(gains, row, i, 7))
    z_a = _applied(_symmetric(gains, row, i), z_a) - _applied(gain_x, z_x) - _applied(gain_v, z_v) + x[i]
    x[i] = z_x
    return z_x, z_v, z_a


@njit(cache=True, nogil=True, fastmath=FINITE, error_model="numpy", forceinline=True)  # type: ignore[untyped-decorator,unused-ignore]
def _with_data(s: Block, g: complex, data: FloatArray, row: int, i: int) -> tuple[Block, complex]:
    """Add hhᵀ and h y with h = (cos Θ, -sin Θ)."""
    y, c, n = data[0, row, i], data[1, row, i], -data[2, row, i]
    beside = s[1] + c * n
    return (s[0] + c * c, beside, beside, s[3] + n * n), g + complex(y * c, y * n)


@njit(cache=True, nogil=True, fastmath=FINITE, error_model="numpy", forceinline=True)  # type: ignore[untyped-decorator,unused-ignore]
def _damped(s: Block, q: float) -> tuple[Block, Block]:
    """Return R = 1/(I + q s) and s R, for a symmetric block."""
    determinant = s[0] * s[3] - s[1] * s[1]
    f = 1.0 / (1.0 + q * (s[0] + s[3]) + q * q * determinant)
    beside, qd = s[1] * f, q * determinant
    r = (f + q * s[3] * f, -q * beside, -q * beside, f + q * s[0] * f)
    return r, ((s[0] + qd) * f, beside, beside, (s[3] + qd) * f)


@njit(cache=True, nogil=True, fastmath=FINITE, error_model="numpy", forceinline=True)  # type: ignore[untyped-decorator,unused-ignore]
def _product(a: Block, b: Block) -> Block:
    return (
        a[0] * b[0] + a[1] * b[2],
        a[0] * b[1] + a[1] * b[3],
        a[2] * b[0] + a[3] * b[2],
        a[2] * b[1] + a[3] * b[3],
    )


@njit(cache=True, nogil=True, fastmath=FINITE, error_model="numpy", forceinline=True)  # type: ignore[untyped-decorator,unused-ignore]
def _difference(a: Block, b: Block) -> Block:
    return a[0] - b[0], a[1] - b[1], a[2] - b[2], a[3] - b[3]


@njit(cache=True, nogil=True, fastmath=FINITE, error_model="numpy", forceinline=True)  # type: ignore[untyped-decorator,unused-ignore]
def _transposed(a: Block) -> Block:
    return a[0], a[2], a[1], a[3]


@njit(cache=True, nogil=True, fastmath=FINITE, error_model="numpy", forceinline=True)  # type: ignore[untyped-decorator,unused-ignore]
def _upper(a: Block) -> Block:
    """Return a symmetric block from its upper triangle: what is below is then not computed at all."""
    return a[0], a[1], a[1], a[3]


@njit(cache=True, nogil=True, fastmath=FINITE, error_model="numpy", forceinline=True)  # type: ignore[untyped-decorator,unused-ignore]
def _scaled(factor: float, a: Block) -> Block:
    return factor * a[0], factor * a[1], factor * a[2], factor * a[3]


@njit(cache=True, nogil=True, fastmath=FINITE, error_model="numpy", forceinline=True)  # type: ignore[untyped-decorator,unused-ignore]
def _applied(a: Block, z: complex) -> complex:
    """Return the block times the pair (real part, imaginary part)."""
    return complex(a[0] * z.real + a[1] * z.imag, a[2] * z.real + a[3] * z.imag)


@njit(cache=True, nogil=True, fastmath=FINITE, error_model="numpy", forceinline=True)  # type: ignore[untyped-decorator,unused-ignore]
def _block(s: FloatArray, row: int, k: int) -> Block:
    return s[row, k, 0], s[row, k, 1], s[row, k, 2], s[row, k, 3]


@njit(cache=True, nogil=True, fastmath=FINITE, error_model="numpy", forceinline=True)  # type: ignore[untyped-decorator,unused-ignore]
def _store(s: FloatArray, row: int, k: int, a: Block) -> None:
    s[row, k, 0], s[row, k, 1], s[row, k, 2], s[row, k, 3] = a


@njit(cache=True, nogil=True, fastmath=FINITE, error_model="numpy", forceinline=True)  # type: ignore[untyped-decorator,unused-ignore]
def _at(gains: FloatArray, row: int, i: int, k: int) -> Block:
    return gains[row, i, k], gains[row, i, k + 1], gains[row, i, k + 2], gains[row, i, k + 3]


@njit(cache=True, nogil=True, fastmath=FINITE, error_model="numpy", forceinline=True)  # type: ignore[untyped-decorator,unused-ignore]
def _store_at(gains: FloatArray, row: int, i: int, k: int, a: Block) -> None:
    gains[row, i, k], gains[row, i, k + 1], gains[row, i, k + 2], gains[row, i, k + 3] = a


@njit(cache=True, nogil=True, fastmath=FINITE, error_model="numpy", forceinline=True)  # type: ignore[untyped-decorator,unused-ignore]
def _symmetric(gains: FloatArray, row: int, i: int) -> Block:
    return gains[row, i, 0], gains[row, i, 1], gains[row, i, 1], gains[row, i, 2]


@njit(cache=True, nogil=True, fastmath=FINITE, error_model="numpy", forceinline=True)  # type: ignore[untyped-decorator,unused-ignore]
def _store_symmetric(gains: FloatArray, row: int, i: int, a: Block) -> None:
    gains[row, i, 0], gains[row, i, 1], gains[row, i, 2] = a[0], a[1], a[3]


# --------------------
# How the recursions of one order are driven: both halves to the middle, joined there, and back to the ends.
#
# Sample i of the first half goes with sample n - 1 - i. Where n is odd, an unobserved sample is added at the end: it
# fits whatever the others say, so it changes nothing.
# --------------------


Forward = Callable[[int, int, Array, Array, FloatArray, FloatArray, Array], None]
"""Filter samples i to j of both halves: (i, j, front, back, gains, s, g)."""
Backward = Callable[[Array, Array, FloatArray, Array], None]
"""Smooth them, from the last to the first: (front, back, gains, z)."""
BLOCK_SAMPLES = 2**12
"""Of each half: what a block needs fits the cache."""
GAIN_BYTES = 256 * 2**20
"""Memory for the gains. Longer signals keep those of a part only, and compute each part a second time, backwards."""
SEEN_FROM_BEHIND = {
    1: np.array([[1.0]]),
    2: np.array([[1.0, -1.0], [0.0, -1.0]]),
    3: np.array([[1.0, -2.0, 1.0], [0.0, -1.0, 1.0], [0.0, 0.0, 1.0]]),
}
"""Turns value and differences at the last of p samples into those at the first, counted the other way."""


def smoothed_halves(
    n: int,
    p: int,
    n_gains: int,
    forward: Forward,
    backward: Backward,
    *,
    middle_q: float,
    dtype: Any = np.complex128,
    pair: bool = False,
    gain_bytes: int = GAIN_BYTES,
) -> Array:
    """Return the solution of one order's problem, (n,).

    Parameters
    ----------
    n, p : int
        Samples, poles.
    n_gains : int
        Numbers that `forward` keeps per step for `backward`.
    forward, backward : callable
    middle_q : float
        q of the step after sample ⌈n/2⌉ in the first half's direction; used with three poles.
    dtype : type
        Of the solution.
    pair : bool
        Whether the components of the state are pairs, and S of blocks of 2 by 2.
    gain_bytes : int

    Raises
    ------
    RefusalError
        If the data do not determine the order.
    """
    half = -(-n // 2)
    x = np.empty(2 * half, dtype)
    front, back = x[:half], x[::-1][:half]
    blocks = _equal_blocks(half)
    per_part = min(len(blocks), max(1, gain_bytes // (16 * n_gains * BLOCK_SAMPLES)))
    parts = [blocks[m : m + per_part] for m in range(0, len(blocks), per_part)]
    buffer = np.empty((per_part, 2 * BLOCK_SAMPLES * n_gains))
    n_entries = p * (p + 1) // 2
    s, g = np.zeros((2, n_entries, 4) if pair else (2, n_entries)), np.zeros((2, p), dtype)

    def filter_part(part: list[tuple[int, int]]) -> None:
        for (i, j), kept in zip(part, buffer, strict=False):
            forward(i, j, front[i:j], back[i:j], _gains(kept, j - i, n_gains), s, g)

    entries = []
    for part in parts:
        entries.append((s.copy(), g.copy()))
        filter_part(part)
    z = _joined(p, s, g, middle_q)
    for part, entry in reversed(list(zip(parts, entries, strict=True))):
        if part is not parts[-1]:
            s[:], g[:] = entry
            filter_part(part)
        for (i, j), kept in reversed(list(zip(part, buffer, strict=False))):
            backward(front[i:j], back[i:j], _gains(kept, j - i, n_gains), z)
    return x[:n]


def _equal_blocks(n: int) -> list[tuple[int, int]]:
    """Return (first, one past the last) of blocks of about the same size, so that none is a single sample."""
    n_blocks = -(-n // BLOCK_SAMPLES)
    return [(n * m // n_blocks, n * (m + 1) // n_blocks) for m in range(n_blocks)]


def _gains(buffer: FloatArray, n: int, n_gains: int) -> FloatArray:
    """Return the part of a block's buffer that n samples take."""
    return buffer[: 2 * n * n_gains].reshape(2, n, n_gains)


def _joined(p: int, s: FloatArray, g: Array, q: float) -> Array:
    """Return the states after the last step of either half, (2, p), from what both halves say.

    Each form holds the rows of the structural equation up to its own state. With two poles both states are the same two
    samples, and each row is in one of the forms. With one pole, the first half leaves the row across the middle to the
    second. With three, one row is in neither: the first half takes one more step, with ε = √q η as a further unknown.
    """
    turn = SEEN_FROM_BEHIND[p]
    n_steps = max(0, p - 2)
    to_back = np.concatenate([turn @ np.triu(np.ones((p, p))) if n_steps else turn, np.zeros((p, n_steps))], axis=1)
    if n_steps:
        to_back[:, p:] = q**0.5 * turn.sum(axis=1, keepdims=True)
    pair = s.ndim == 3
    size = 2 if pair else 1
    turns = np.kron(to_back, np.eye(size))
    matrix = turns.T @ _dense(s[1], p) @ turns
    matrix[: p * size, : p * size] += _dense(s[0], p)
    matrix[p * size :, p * size :] += np.eye(n_steps * size)
    right = to_back.T @ g[1]
    right[:p] += g[0]
    try:
        solution = np.linalg.solve(matrix, right.view(np.float64) if pair else right)
    except np.linalg.LinAlgError:
        raise RefusalError(
            "the data do not determine the order", remedy="widen the band or take a longer recording"
        ) from None
    x = solution.view(g.dtype)
    return np.stack([x[:p], to_back @ x])


def _dense(entries: FloatArray, p: int) -> FloatArray:
    """Return S from its upper triangle, row by row, of numbers or of blocks of 2 by 2."""
    size = 2 if entries.ndim == 2 else 1
    blocks = np.zeros((p, p, size, size))
    rows, columns = np.triu_indices(p)
    blocks[rows, columns] = entries.reshape(-1, size, size)
    blocks[columns, rows] = entries.reshape(-1, size, size).transpose(0, 2, 1)
    return blocks.transpose(0, 2, 1, 3).reshape(p * size, p * size)


# --------------------
# What the recursions of one order take, block by block: both halves of the signal, each from its end.
# --------------------


@njit(cache=True, nogil=True, error_model="numpy")  # type: ignore[untyped-decorator,unused-ignore]
def fold(values: Array, first: int, last: int, out: FloatArray) -> None:
    """Write values[first], values[first + 1]… and values[last], values[last - 1]… as the two rows of `out`.

    Beyond its ends, `values` continues with its first and last one.
    """
    highest, n = len(values) - 1, out.shape[1]
    if first >= 0 and first + n <= highest + 1 and last <= highest and last + 1 >= n:  # plain copies: several at once
        for i in range(n):
            out[0, i] = values[first + i]
        for i in range(n):
            out[1, i] = values[last - i]
        return
    for i in range(n):
        out[0, i] = values[min(max(first + i, 0), highest)]
        out[1, i] = values[min(max(last - i, 0), highest)]


@njit(cache=True, nogil=True, error_model="numpy")  # type: ignore[untyped-decorator,unused-ignore]
def demodulate(signal: FloatArray, cosine: FloatArray, sine: FloatArray, out: Array) -> None:
    """Write y e^{-iΘ}."""
    for i in range(len(out)):
        out[i] = complex(signal[i] * cosine[i], -signal[i] * sine[i])


@njit(cache=True, nogil=True, error_model="numpy")  # type: ignore[untyped-decorator,unused-ignore]
def oscillator(cycles: FloatArray, bandwidth: FloatArray, kappa: FloatArray, q: FloatArray) -> None:
    """Write κ = 2 - 2 cos ω and q = 1/r² of each row of the first generation's structural equation.

    q = 4 tan² h sin(ω - h) sin(ω + h)/(√2 - 1), h half the bandwidth in rad. Where the band comes close to zero or half
    the sampling rate (the order is no part of the data there), q stays at what 3/4 of a bandwidth from there gives.

    Parameters
    ----------
    cycles : array, (n + 2,)
        Phase of the order, in either direction of time.
    bandwidth : array, (n,) or (1,)
        -3 dB, in cycles per sample.
    kappa, q : arrays, (n,)
    """
    n = len(kappa)
    cos_half, sin_half = np.empty(n), np.empty(n)
    cosine_and_sine((cycles[2:] - cycles[:-2]) / 4.0, cos_half, sin_half)
    cos_h, sin_h = np.empty(len(bandwidth)), np.empty(len(bandwidth))
    cosine_and_sine(bandwidth / 2.0, cos_h, sin_h)
    step = 0 if len(bandwidth) == 1 else 1
    for i in range(n):
        c, s = cos_h[step * i], sin_h[step * i]
        cos_omega, sin_omega = 1.0 - 2.0 * sin_half[i] * sin_half[i], 2.0 * sin_half[i] * cos_half[i]
        product = (sin_omega * c - cos_omega * s) * (sin_omega * c + cos_omega * s)
        # sin(h/2) sin(5h/2) = (cos 2h - cos 3h)/2
        least = 0.5 * (2.0 * c * c - 1.0 - c * (4.0 * c * c - 3.0))
        kappa[i] = 4.0 * sin_half[i] * sin_half[i]
        q[i] = 4.0 * s * s * max(product, least) / (c * c * HALF_POWER * HALF_POWER)


ComplexArray = NDArray[np.complex128]
BoolArray = NDArray[np.bool_]


def envelope_alone(
    y: FloatArray,
    cycles: FloatArray,
    active: BoolArray | None,
    weights: FloatArray,
    p: int,
    *,
    mirror: bool,
    gain_bytes: int = GAIN_BYTES,
) -> ComplexArray:
    """Return the envelope 2x of one order, as `solve_envelopes` does for several.

    Parameters
    ----------
    y, cycles, active : arrays, (n,)
    weights : array, (n - p,) or (1,)
        r of each row of the structural equation.
    p : int
    mirror : bool
    gain_bytes : int
        Memory for the gains.

    Returns
    -------
    array, (n,), complex

    Raises
    ------
    RefusalError
        If the data do not determine it.
    """
    n = len(y)
    q = (2.0 if mirror else 1.0) / weights**2
    middle = float(q[min(-(-n // 2) + 1 - p, len(q) - 1)])
    if mirror:
        steps = _pair_steps(y, cycles, active, q, p)
        return smoothed_halves(n, p, N_GAINS[p], *steps, middle_q=middle, pair=True, gain_bytes=gain_bytes)
    x = smoothed_halves(n, p, p, *_single_steps(y, cycles, active, q, p), middle_q=middle, gain_bytes=gain_bytes)
    x *= 2.0
    return x


def waveform_alone(
    y: FloatArray, cycles: FloatArray, active: BoolArray | None, bandwidth: FloatArray, *, gain_bytes: int = GAIN_BYTES
) -> FloatArray:
    """Return the waveform of one order, as `solve_waveforms` does for several; bandwidth (n - 2,) or (1,)."""
    steps = _oscillator_steps(y, cycles, active, bandwidth)
    return smoothed_halves(len(y), 2, 2, *steps, middle_q=0.0, dtype=np.float64, gain_bytes=gain_bytes)


def _oscillator_steps(
    y: FloatArray, cycles: FloatArray, active: BoolArray | None, bandwidth: FloatArray
) -> tuple[Forward, Backward]:
    """Return how a block of the first generation is filtered, and how it is smoothed."""
    n = len(y)

    def forward(i: int, j: int, front: Array, back: Array, gains: FloatArray, s: FloatArray, g: Array) -> None:
        level, signal = _levels(active, n, i, j), _of_samples(y, n, i, j)
        np.multiply(level[0], signal[0], out=front)
        np.multiply(level[1], signal[1], out=back)
        around = _of_samples(cycles, n, i - 1, j + 1)
        widths = [bandwidth] * 2 if len(bandwidth) == 1 else _of_steps(bandwidth, n, 2, i, j)
        kappa, q = np.empty((2, j - i)), np.empty((2, j - i))
        for row in range(2):
            oscillator(around[row], widths[row], kappa[row], q[row])
        forward_two(front, back, level, q, kappa, gains, s, g)

    return forward, backward_two


def _single_steps(
    y: FloatArray, cycles: FloatArray, active: BoolArray | None, q: FloatArray, p: int
) -> tuple[Forward, Backward]:
    """Return how a block of the second generation, without mirror image, is filtered and smoothed."""
    n = len(y)
    filtered = {1: forward_one, 2: forward_two, 3: forward_three}[p]
    smoothed = {1: backward_one, 2: backward_two, 3: backward_three}[p]
    still = [np.zeros((2, BLOCK_SAMPLES))] if p == 2 else []  # κ

    def forward(i: int, j: int, front: Array, back: Array, gains: FloatArray, s: FloatArray, g: Array) -> None:
        level = _levels(active, n, i, j)
        signal, cosine, sine = _signal_and_phasor(y, cycles, level, i, j)
        demodulate(signal[0], cosine[0], sine[0], front)
        demodulate(signal[1], cosine[1], sine[1], back)
        filtered(front, back, level, _of_steps(q, n, p, i, j), *still, gains, s, g)

    return forward, smoothed


def _pair_steps(
    y: FloatArray, cycles: FloatArray, active: BoolArray | None, q: FloatArray, p: int
) -> tuple[Forward, Backward]:
    """Return how a block of the second generation, with mirror image, is filtered and smoothed."""
    n = len(y)
    filtered = {1: forward_pair_one, 2: forward_pair_two, 3: forward_pair_three}[p]
    smoothed = {1: backward_pair_one, 2: backward_pair_two, 3: backward_pair_three}[p]

    def forward(i: int, j: int, front: Array, back: Array, gains: FloatArray, s: FloatArray, g: Array) -> None:
        level = _levels(active, n, i, j)
        data = _signal_and_phasor(y, cycles, level, i, j)
        data[1:] *= level
        filtered(front, back, data, _of_steps(q, n, p, i, j), gains, s, g)

    return forward, smoothed


def _levels(active: BoolArray | None, n: int, i: int, j: int) -> FloatArray:
    """Return 1 where samples are data, 0 where not, (2, j - i)."""
    level = np.ones((2, j - i)) if active is None else _of_samples(active, n, i, j)
    if i == 0 and n % 2:
        level[1, 0] = 0.0
    return level


def _signal_and_phasor(y: FloatArray, cycles: FloatArray, level: FloatArray, i: int, j: int) -> FloatArray:
    """Return signal (zero where it is no data), cosine and sine, each folded, (3, 2, j - i)."""
    n = len(y)
    out = np.empty((3, 2, j - i))
    np.multiply(_of_samples(y, n, i, j), level, out=out[0])
    cosine_and_sine(_of_samples(cycles, n, i, j).reshape(-1), out[1].reshape(-1), out[2].reshape(-1))
    return out


def _of_samples(values: Array, n: int, i: int, j: int) -> FloatArray:
    """Return the values at a block's samples, (2, j - i)."""
    out = np.empty((2, j - i))
    fold(values, i, n + n % 2 - 1 - i, out)
    return out


def _of_steps(values: FloatArray, n: int, p: int, i: int, j: int) -> FloatArray:
    """Return the values of the structural equation's rows, (n - p,) or (1,), that a block's steps belong to.

    With one pole, the first half leaves the step across the middle to the second: there, q is 0.
    """
    out = np.empty((2, j - i))
    fold(values, i + 1 - p, n + n % 2 - 2 - i, out)
    if p == 1 and j == -(-n // 2):
        out[0, -1] = 0.0
    return out
