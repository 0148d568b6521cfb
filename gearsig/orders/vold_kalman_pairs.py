"""Recursions of the Vold–Kalman filter for one order together with its mirror image at negative frequency.

As `vold_kalman_states`, with a pair of real numbers u, v (the envelope u + iv) for each component of the state: the
signal is y = u cos Θ - v sin Θ, so S starts from the row (cos Θ, -sin Θ) and its blocks are 2 by 2. With P the last
block on the diagonal, R = 1/(I + qP) takes the place of ρ.
"""

from __future__ import annotations

from typing import Any

from numba import njit
from numpy.typing import NDArray

from gearsig.checks import FloatArray
from gearsig.orders.vold_kalman_states import FINITE

Array = NDArray[Any]
State = tuple[Any, ...]
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
        a = _step_one(a, front, data, q, gains, 0, i)
        b = _step_one(b, back, data, q, gains, 1, i)
    _store(s, 0, 0, a[0])
    _store(s, 1, 0, b[0])
    g[0, 0], g[1, 0] = a[1], b[1]


@njit(cache=True, nogil=True, fastmath=FINITE, error_model="numpy", forceinline=True)  # type: ignore[untyped-decorator,unused-ignore]
def _step_one(form: State, x: Array, data: FloatArray, q: FloatArray, gains: FloatArray, row: int, i: int) -> State:
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
        a = _step_two(a, front, data, q, gains, 0, i)
        b = _step_two(b, back, data, q, gains, 1, i)
    for row, form in ((0, a), (1, b)):
        _store(s, row, 0, form[0])
        _store(s, row, 1, form[1])
        _store(s, row, 2, form[2])
        g[row, 0], g[row, 1] = form[3], form[4]


@njit(cache=True, nogil=True, fastmath=FINITE, error_model="numpy", forceinline=True)  # type: ignore[untyped-decorator,unused-ignore]
def _step_two(form: State, x: Array, data: FloatArray, q: FloatArray, gains: FloatArray, row: int, i: int) -> State:
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
        a = _back_two(a, front, gains, 0, i)
        b = _back_two(b, back, gains, 1, i)
    z[0, 0], z[0, 1] = a
    z[1, 0], z[1, 1] = b


@njit(cache=True, nogil=True, fastmath=FINITE, error_model="numpy", forceinline=True)  # type: ignore[untyped-decorator,unused-ignore]
def _back_two(z: State, x: Array, gains: FloatArray, row: int, i: int) -> State:
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
        a = _step_three(a, front, data, q, gains, 0, i)
        b = _step_three(b, back, data, q, gains, 1, i)
    for row, form in ((0, a), (1, b)):
        for k in range(6):
            _store(s, row, k, form[0][k])
        g[row, 0], g[row, 1], g[row, 2] = form[1]


@njit(cache=True, nogil=True, fastmath=FINITE, error_model="numpy", forceinline=True)  # type: ignore[untyped-decorator,unused-ignore]
def _step_three(form: State, x: Array, data: FloatArray, q: FloatArray, gains: FloatArray, row: int, i: int) -> State:
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
        a = _back_three(a, front, gains, 0, i)
        b = _back_three(b, back, gains, 1, i)
    z[0, 0], z[0, 1], z[0, 2] = a
    z[1, 0], z[1, 1], z[1, 2] = b


@njit(cache=True, nogil=True, fastmath=FINITE, error_model="numpy", forceinline=True)  # type: ignore[untyped-decorator,unused-ignore]
def _back_three(z: State, x: Array, gains: FloatArray, row: int, i: int) -> State:
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
