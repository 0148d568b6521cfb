"""The Vold–Kalman filter for a single order, exact at any bandwidth: second and first generation.

An information filter runs inward from both ends, and a smoother runs back to them. The state z holds the order's value
x and its differences v, a up to the (p - 1)-th. The structural equation is the noise ε of the highest difference, with
variance q = 1/r². The information from the samples so far is kept as zᵀSz - 2gᵀz. A step disturbs the last component
(index p) and then accumulates the differences: with s the last row of S,

    ρ = 1/(1 + q s_p),  G = q ρ s,  S -= G sᵀ,  g -= G g_p,   and in the backward pass   ε = Gᵀz - q ρ g_p.

Numbers as large as r² are never combined with numbers as small as the data: rounding grows with the filter's memory,
1/bandwidth, not with r² as in the normal equations. One loop processes both halves of the signal, each from its end
(row 0 forwards, row 1 backwards in time): each step depends on the previous one, but the two halves are independent, so
that both take the time of one.

Together with its mirror image at negative frequency, an order has a pair of real numbers u, v (the envelope u + iv) for
each component of the state: the signal is y = u cos Θ - v sin Θ, so S starts from the row (cos Θ, -sin Θ) and its
entries are blocks of 2 by 2. With P the last block on the diagonal, R = 1/(I + qP) takes the place of ρ. The recursions
are written once; numba compiles them for numbers and for blocks.

B. D. O. Anderson, J. B. Moore, "Optimal Filtering", 1979, chapters 6 and 7.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

import numpy as np
from numba import types
from numba.extending import overload
from numpy.typing import NDArray

from gearsig.checks import FloatArray
from gearsig.compiled import njit
from gearsig.errors import RefusalError
from gearsig.orders.vold_kalman._tracks import HALF_POWER, cosine_and_sine

Array = NDArray[Any]
ComplexArray = NDArray[np.complex128]
BoolArray = NDArray[np.bool_]
Entry = Any
"""A number, or a block of 2 by 2 as a tuple, row by row."""
State = tuple[Any, ...]
F = TypeVar("F", bound=Callable[..., Any])

# With infinities excluded, a complex times a real number costs two products, not four.
_OPTIONS: dict[str, Any] = {"nogil": True, "fastmath": {"nnan", "ninf", "nsz", "contract"}, "error_model": "numpy"}
_kernel: Callable[[F], F] = njit(cache=True, **_OPTIONS)
_copying: Callable[[F], F] = njit(cache=True, nogil=True, error_model="numpy")


def _by(choose: Callable[..., F]) -> Callable[..., Any]:
    """Return a function that numba compiles as the implementation that `choose` returns for its argument types."""

    def function(*args: Any) -> Any:
        raise NotImplementedError("for compiled functions")

    overload(function, jit_options=_OPTIONS | {"forceinline": True}, strict=False)(choose)
    return function


def _for(of_numbers: F, of_blocks: F) -> Callable[..., Any]:
    """Return a function whose first argument is an entry, a number or a block; further arguments may be anything."""
    return _by(lambda entry, *_: of_blocks if isinstance(entry, types.BaseTuple) else of_numbers)


_product = _for(
    lambda a, b: a * b,
    lambda a, b: (
        a[0] * b[0] + a[1] * b[2],
        a[0] * b[1] + a[1] * b[3],
        a[2] * b[0] + a[3] * b[2],
        a[2] * b[1] + a[3] * b[3],
    ),
)
_difference = _for(lambda a, b: a - b, lambda a, b: (a[0] - b[0], a[1] - b[1], a[2] - b[2], a[3] - b[3]))
_scaled = _for(lambda a, factor: factor * a, lambda a, f: (f * a[0], f * a[1], f * a[2], f * a[3]))
_transposed = _for(lambda a: a, lambda a: (a[0], a[2], a[1], a[3]))
# A symmetric block from its upper triangle, so that the lower one need not be computed.
_upper = _for(lambda a: a, lambda a: (a[0], a[1], a[1], a[3]))
# An entry times a component of the state: a number, or the pair (real part, imaginary part).
_applied = _for(lambda a, z: a * z, lambda a, z: complex(a[0] * z.real + a[1] * z.imag, a[2] * z.real + a[3] * z.imag))


def _block_with_data(s: Entry, g: complex, _x: complex, data: FloatArray, row: int, i: int) -> tuple[Entry, complex]:
    """Add hhᵀ and h y with h = (cos Θ, -sin Θ); data holds signal, cosine and sine."""
    y, c, n = data[0, row, i], data[1, row, i], -data[2, row, i]
    off_diagonal = s[1] + c * n
    return (s[0] + c * c, off_diagonal, off_diagonal, s[3] + n * n), g + complex(y * c, y * n)


_with_data = _for(lambda s, g, x, data, row, i: (s + data[0, row, i], g + x), _block_with_data)


def _number_damped(s: float, q: float) -> tuple[float, float]:
    rho = 1.0 / (1.0 + q * s)
    return rho, rho * s


def _block_damped(s: Entry, q: float) -> tuple[Entry, Entry]:
    determinant = s[0] * s[3] - s[1] * s[1]
    f = 1.0 / (1.0 + q * (s[0] + s[3]) + q * q * determinant)
    off_diagonal, qd = s[1] * f, q * determinant
    r = (f + q * s[3] * f, -q * off_diagonal, -q * off_diagonal, f + q * s[0] * f)
    return r, ((s[0] + qd) * f, off_diagonal, off_diagonal, (s[3] + qd) * f)


_damped = _for(_number_damped, _block_damped)  # (R = 1/(I + q s), s R) of a symmetric entry

# Gains of a step that the backward pass needs: first R (symmetric), then q s_j R of the other components.
N_GAINS = {1: 3, 2: 7, 3: 11}
"""Numbers kept per step if entries are blocks, by number of poles; for numbers, one per pole."""


def _keep_number(a: float, gains: FloatArray, row: int, i: int, k: int) -> None:
    gains[row, i, k] = a


def _keep_block(a: Entry, gains: FloatArray, row: int, i: int, k: int) -> None:
    if k == 0:
        gains[row, i, 0], gains[row, i, 1], gains[row, i, 2] = a[0], a[1], a[3]
    else:
        gains[row, i, 4 * k - 1], gains[row, i, 4 * k], gains[row, i, 4 * k + 1], gains[row, i, 4 * k + 2] = a


def _block_kept(_unit: Entry, gains: FloatArray, row: int, i: int, k: int) -> Entry:
    if k == 0:
        return gains[row, i, 0], gains[row, i, 1], gains[row, i, 1], gains[row, i, 2]
    return gains[row, i, 4 * k - 1], gains[row, i, 4 * k], gains[row, i, 4 * k + 1], gains[row, i, 4 * k + 2]


_keep = _for(_keep_number, _keep_block)
_kept = _for(lambda _unit, gains, row, i, k: gains[row, i, k], _block_kept)  # `unit` selects number or block


# One forward step, by number of poles: add a sample's data and go to the next. The form holds S's upper triangle and g.


def _forward_step(
    form: State, x: Array, data: FloatArray, q: FloatArray, _kappa: Any, gains: FloatArray, row: int, i: int
) -> State:
    """One pole: x' = x + ε."""
    xx, g_x = _with_data(form[0], form[1], x[i], data, row, i)
    r, xx = _damped(xx, q[row, i])
    _keep(r, gains, row, i, 0)
    g_x = _applied(r, g_x)
    x[i] = q[row, i] * g_x
    return xx, g_x


def _step_two(
    form: State, x: Array, data: FloatArray, q: FloatArray, kappa: Any, gains: FloatArray, row: int, i: int
) -> State:
    """Two poles: v' = v - κx + ε, x' = x + v', so x_(n+1) - (2 - κ) x_n + x_(n-1) = ε.

    κ None: second generation. κ = 2 - 2 cos ω: first; the gain of x is then stored minus κ for the backward pass.
    """
    xx, xv, vv, g_x, g_v = form
    xx, g_x = _with_data(xx, g_x, x[i], data, row, i)
    if kappa is not None:  # v = v' + κx
        k = kappa[row, i]
        xv_before = xv
        xv = xv + k * vv
        xx += k * (xv_before + xv)
        g_x += k * g_v
    r, vv = _damped(vv, q[row, i])
    xv_r = _product(xv, r)
    gain_x = _scaled(xv_r, q[row, i])
    _keep(r, gains, row, i, 0)
    if kappa is None:
        _keep(gain_x, gains, row, i, 1)
    else:
        _keep(gain_x - kappa[row, i], gains, row, i, 1)
    xx = _upper(_difference(xx, _product(gain_x, _transposed(xv))))
    g_x -= _applied(gain_x, g_v)
    g_v = _applied(r, g_v)
    x[i] = q[row, i] * g_v
    # x = x' - v'
    xv = _difference(xv_r, xx)
    return xx, xv, _upper(_difference(_difference(vv, _transposed(xv_r)), xv)), g_x, g_v - g_x


def _step_three(
    form: State, x: Array, data: FloatArray, q: FloatArray, _kappa: Any, gains: FloatArray, row: int, i: int
) -> State:
    """Three poles: a' = a + ε, v' = v + a', x' = x + v'."""
    xx, xv, xa, vv, va, aa, g_x, g_v, g_a = form
    xx, g_x = _with_data(xx, g_x, x[i], data, row, i)
    r, aa = _damped(aa, q[row, i])
    xa_r, va_r = _product(xa, r), _product(va, r)
    gain_x, gain_v = _scaled(xa_r, q[row, i]), _scaled(va_r, q[row, i])
    _keep(r, gains, row, i, 0)
    _keep(gain_x, gains, row, i, 1)
    _keep(gain_v, gains, row, i, 2)
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
    return xx, x_v, xa, vv, va, aa, g_x, g_v - g_x, g_a - g_v


_step = _by(lambda form, *_: {2: _forward_step, 5: _step_two, 9: _step_three}[len(form)])


# One backward step, from the state after it to the state before: z_j - z_(j+1) for all components except the last, and
# R z_p - Σ (q s_j R)ᵀ z_j + q R g for the last.


def _backward_step(z: State, x: Array, gains: FloatArray, row: int, i: int, unit: Entry) -> State:
    z_x = _applied(_kept(unit, gains, row, i, 0), z[0]) + x[i]
    x[i] = z_x
    return (z_x,)


def _back_two(z: State, x: Array, gains: FloatArray, row: int, i: int, unit: Entry) -> State:
    z_x, z_v = z
    z_x -= z_v
    gain_x = _transposed(_kept(unit, gains, row, i, 1))
    z_v = _applied(_kept(unit, gains, row, i, 0), z_v) - _applied(gain_x, z_x) + x[i]
    x[i] = z_x
    return z_x, z_v


def _back_three(z: State, x: Array, gains: FloatArray, row: int, i: int, unit: Entry) -> State:
    z_x, z_v, z_a = z
    z_x -= z_v
    z_v -= z_a
    gain_x, gain_v = _transposed(_kept(unit, gains, row, i, 1)), _transposed(_kept(unit, gains, row, i, 2))
    z_a = _applied(_kept(unit, gains, row, i, 0), z_a) - _applied(gain_x, z_x) - _applied(gain_v, z_v) + x[i]
    x[i] = z_x
    return z_x, z_v, z_a


_back = _by(lambda z, *_: (_backward_step, _back_two, _back_three)[len(z) - 1])


@_kernel
def filter_halves(
    front: Array, back: Array, data: FloatArray, q: FloatArray, kappa: Any, gains: FloatArray, a: State, b: State
) -> tuple[State, State]:
    """Filter a part of both halves, and return their forms after it.

    Parameters
    ----------
    front, back : arrays, (n,), real or complex
        Data (0 where inactive) of each half, starting from its end, if entries are numbers; on return q R g.
    data : array, (1, 2, n) or (3, 2, n)
        If entries are numbers: 1 where the order is part of the data, 0 elsewhere. If they are blocks: signal, cosine
        and sine, zero where inactive.
    q : array, (2, n)
        Variance of the step after each sample.
    kappa : array, (2, n), or None
        See `_step_two`.
    gains : array, (2, n, n_gains)
        On return, the gains of the step after each sample.
    a, b : tuples
        Form of each half before this part: S's upper triangle row by row, then g. Zero before any data.
    """
    for i in range(len(front)):
        a = _step(a, front, data, q, kappa, gains, 0, i)
        b = _step(b, back, data, q, kappa, gains, 1, i)
    return a, b


@_kernel
def smooth_halves(front: Array, back: Array, gains: FloatArray, a: State, b: State, unit: Entry) -> tuple[State, State]:
    """Turn q R g into the solution; a and b are the states after this part, the states before it are returned."""
    for i in range(len(front) - 1, -1, -1):
        a = _back(a, front, gains, 0, i, unit)
        b = _back(b, back, gains, 1, i, unit)
    return a, b


# Driver of the recursions: both halves run to the middle, are joined there, and run back to the ends. Sample i of the
# first half is paired with sample n - 1 - i. For odd n, an unobserved sample is added at the end; it fits any solution
# and so changes nothing.

Prepare = Callable[[int, int, Array, Array], tuple[FloatArray, FloatArray, FloatArray | None]]
"""Callable (i, j, front, back): writes front and back, returns (data, q, kappa) for samples i to j of both halves."""
BLOCK_SAMPLES, GAIN_BYTES = 2**12, 256 * 2**20
"""Samples of each half per block, to fit the cache; memory for the gains, beyond which parts are computed twice."""
TIME_REVERSAL = {
    1: np.array([[1.0]]),
    2: np.array([[1.0, -1.0], [0.0, -1.0]]),
    3: np.array([[1.0, -2.0, 1.0], [0.0, -1.0, 1.0], [0.0, 0.0, 1.0]]),
}
"""Converts value and differences at the last of p samples into those at the first, in reversed time."""


def _smoothed_halves(
    n: int,
    p: int,
    prepare: Prepare,
    *,
    middle_q: float,
    dtype: Any,
    pair: bool,
    gain_bytes: int,
    block_samples: int = BLOCK_SAMPLES,
) -> Array:
    """Return the solution of one order's problem, (n,).

    Parameters
    ----------
    n, p : int
        Samples, poles.
    prepare : callable
    middle_q : float
        q of the step after sample ⌈n/2⌉ in the first half's direction; used with three poles.
    dtype : type
        Of the solution.
    pair : bool
        Whether the components of the state are pairs and the entries of S blocks of 2 by 2.
    gain_bytes : int
        Memory for the gains. Longer signals keep only one part's gains and compute each part a second time, backwards.
    block_samples : int

    Raises
    ------
    RefusalError
        If the data do not determine the order.
    """
    half = -(-n // 2)
    x = np.empty(2 * half, dtype)
    front, back = x[:half], x[::-1][:half]
    n_blocks = -(-half // block_samples)
    # Blocks of about the same size, so that none is a single sample.
    blocks = [(half * m // n_blocks, half * (m + 1) // n_blocks) for m in range(n_blocks)]
    n_gains = N_GAINS[p] if pair else p
    per_part = min(len(blocks), max(1, gain_bytes // (16 * n_gains * block_samples)))
    parts = [blocks[m : m + per_part] for m in range(0, len(blocks), per_part)]
    buffer = np.empty((per_part, 2 * block_samples * n_gains))
    zero, unit = ((0.0,) * 4, (1.0, 0.0, 0.0, 1.0)) if pair else (0.0, 1.0)
    empty = (zero,) * (p * (p + 1) // 2) + (dtype(0).item(),) * p

    def gains_of(kept: FloatArray, length: int) -> FloatArray:
        return kept[: 2 * length * n_gains].reshape(2, length, n_gains)

    def filter_part(part: list[tuple[int, int]], forms: tuple[State, State]) -> tuple[State, State]:
        for (i, j), kept in zip(part, buffer, strict=False):
            data, q, kappa = prepare(i, j, front[i:j], back[i:j])
            forms = filter_halves(front[i:j], back[i:j], data, q, kappa, gains_of(kept, j - i), *forms)
        return forms

    entries = [(empty, empty)]
    for part in parts:
        entries.append(filter_part(part, entries[-1]))
    z = _joined(p, *entries[-1], middle_q, pair=pair)
    for part, entry in reversed(list(zip(parts, entries[:-1], strict=True))):
        if part is not parts[-1]:
            filter_part(part, entry)
        for (i, j), kept in reversed(list(zip(part, buffer, strict=False))):
            z = smooth_halves(front[i:j], back[i:j], gains_of(kept, j - i), *z, unit)
    return x[:n]


def _joined(p: int, front: State, back: State, q: float, *, pair: bool) -> tuple[State, State]:
    """Return the states after the last step of each half, from the information in both halves.

    Each form holds the rows of the structural equation up to its own state. With two poles, both states are the same
    two samples, and each row is in one of the forms. With one pole, the first half leaves the row across the middle to
    the second. With three, one row is in neither: the first half takes one more step, with ε = √q η as a further
    unknown.
    """
    turn = TIME_REVERSAL[p]
    n_steps = max(0, p - 2)
    to_back = np.concatenate([turn @ np.triu(np.ones((p, p))) if n_steps else turn, np.zeros((p, n_steps))], axis=1)
    if n_steps:
        to_back[:, p:] = q**0.5 * turn.sum(axis=1, keepdims=True)
    size = 2 if pair else 1
    turns = np.kron(to_back, np.eye(size))
    matrix = turns.T @ _dense(back[:-p], p, size) @ turns
    matrix[: p * size, : p * size] += _dense(front[:-p], p, size)
    matrix[p * size :, p * size :] += np.eye(n_steps * size)
    right = to_back.T @ np.array(back[-p:])
    right[:p] += np.array(front[-p:])
    try:
        solution = np.linalg.solve(matrix, right.view(np.float64) if pair else right)
    except np.linalg.LinAlgError:
        raise RefusalError(
            "the data do not determine the order", remedy="widen the band or take a longer recording"
        ) from None
    x = solution.view(right.dtype)
    return tuple(x[:p].tolist()), tuple((to_back @ x).tolist())


def _dense(entries: State, p: int, size: int) -> FloatArray:
    """Return the full S, (p·size, p·size), from its upper triangle of numbers or 2-by-2 blocks, row by row."""
    blocks = np.zeros((p, p, size, size))
    rows, columns = np.triu_indices(p)
    upper = np.array(entries).reshape(-1, size, size)
    blocks[rows, columns], blocks[columns, rows] = upper, upper.transpose(0, 2, 1)
    return blocks.transpose(0, 2, 1, 3).reshape(p * size, p * size)


# Input of the recursions, block by block: both halves of the signal, each from its end.


@_copying
def fold(values: Array, first: int, last: int, out: FloatArray) -> None:
    """Write values[first], values[first + 1]… and values[last], values[last - 1]… as the two rows of `out`.

    Beyond its ends, `values` continues with its first and last value.
    """
    highest, n = len(values) - 1, out.shape[1]
    if first >= 0 and first + n <= highest + 1 and last <= highest and last + 1 >= n:  # plain copies: vectorised
        for i in range(n):
            out[0, i] = values[first + i]
        for i in range(n):
            out[1, i] = values[last - i]
        return
    for i in range(n):
        out[0, i] = values[min(max(first + i, 0), highest)]
        out[1, i] = values[min(max(last - i, 0), highest)]


@_copying
def demodulate(signal: FloatArray, cosine: FloatArray, sine: FloatArray, out: Array) -> None:
    """Write y e^{-iΘ} to `out`."""
    for i in range(len(out)):
        out[i] = complex(signal[i] * cosine[i], -signal[i] * sine[i])


@_copying
def oscillator(cycles: FloatArray, bandwidth: FloatArray, kappa: FloatArray, q: FloatArray) -> None:
    """Write κ = 2 - 2 cos ω and q = 1/r² of each row of the first generation's structural equation.

    q = 4 tan² h sin(ω - h) sin(ω + h)/(√2 - 1), with h half the bandwidth in rad. Where the band comes close to zero or
    half the sampling rate (where the order is not part of the data), q keeps its value 3/4 of a bandwidth away.

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
        lowest = 0.5 * (2.0 * c * c - 1.0 - c * (4.0 * c * c - 3.0))
        kappa[i] = 4.0 * sin_half[i] * sin_half[i]
        q[i] = 4.0 * s * s * max(product, lowest) / (c * c * HALF_POWER * HALF_POWER)


def envelope_alone(
    y: FloatArray,
    cycles: FloatArray,
    active: BoolArray | None,
    weights: FloatArray,
    p: int,
    *,
    mirror: bool,
    gain_bytes: int = GAIN_BYTES,
    block_samples: int = BLOCK_SAMPLES,
) -> ComplexArray:
    """Return the envelope 2x of one order; the counterpart of `solve_envelopes` for a single order.

    Parameters
    ----------
    y, cycles, active : arrays, (n,)
    weights : array, (n - p,) or (1,)
        r of each row of the structural equation.
    p : int
    mirror : bool
    gain_bytes, block_samples : int
        Memory for the gains; samples of each half per block.

    Returns
    -------
    array, (n,), complex

    Raises
    ------
    RefusalError
        If the data do not determine the order.
    """
    n = len(y)
    q = (2.0 if mirror else 1.0) / weights**2

    def prepare(i: int, j: int, front: Array, back: Array) -> tuple[FloatArray, FloatArray, None]:
        level, of_steps = _levels(active, n, i, j), _of_steps(q, n, p, i, j)
        data = np.empty((3, 2, j - i))  # signal (zero where inactive), cosine and sine
        np.multiply(_of_samples(y, n, i, j), level, out=data[0])
        cosine_and_sine(_of_samples(cycles, n, i, j).reshape(-1), data[1].reshape(-1), data[2].reshape(-1))
        if mirror:
            data[1:] *= level
            return data, of_steps, None
        signal, cosine, sine = data
        demodulate(signal[0], cosine[0], sine[0], front)
        demodulate(signal[1], cosine[1], sine[1], back)
        return level[None], of_steps, None

    middle = float(q[min(-(-n // 2) + 1 - p, len(q) - 1)])
    x = _smoothed_halves(
        n,
        p,
        prepare,
        middle_q=middle,
        dtype=np.complex128,
        pair=mirror,
        gain_bytes=gain_bytes,
        block_samples=block_samples,
    )
    if not mirror:
        x *= 2.0
    return x


def waveform_alone(y: FloatArray, cycles: FloatArray, active: BoolArray | None, bandwidth: FloatArray) -> FloatArray:
    """Return the waveform of one order, (n,), see `solve_waveforms` for several; bandwidth (n - 2,) or (1,)."""
    n = len(y)

    def prepare(i: int, j: int, front: Array, back: Array) -> tuple[FloatArray, FloatArray, FloatArray]:
        level, signal = _levels(active, n, i, j), _of_samples(y, n, i, j)
        np.multiply(level[0], signal[0], out=front)
        np.multiply(level[1], signal[1], out=back)
        around = _of_samples(cycles, n, i - 1, j + 1)
        widths = [bandwidth] * 2 if len(bandwidth) == 1 else _of_steps(bandwidth, n, 2, i, j)
        kappa, q = np.empty((2, j - i)), np.empty((2, j - i))
        for row in range(2):
            oscillator(around[row], widths[row], kappa[row], q[row])
        return level[None], q, kappa

    return _smoothed_halves(n, 2, prepare, middle_q=0.0, dtype=np.float64, pair=False, gain_bytes=GAIN_BYTES)


def _levels(active: BoolArray | None, n: int, i: int, j: int) -> FloatArray:
    """Return 1 where samples are data, 0 elsewhere, (2, j - i)."""
    level = np.ones((2, j - i)) if active is None else _of_samples(active, n, i, j)
    if i == 0 and n % 2:
        level[1, 0] = 0.0
    return level


def _of_samples(values: Array, n: int, i: int, j: int) -> FloatArray:
    """Return the values at a block's samples, (2, j - i)."""
    out = np.empty((2, j - i))
    fold(values, i, n + n % 2 - 1 - i, out)
    return out


def _of_steps(values: FloatArray, n: int, p: int, i: int, j: int) -> FloatArray:
    """Return the values, given per row of the structural equation, for a block's steps, (2, j - i).

    With one pole, the first half leaves the step across the middle to the second: there, q is 0.
    """
    out = np.empty((2, j - i))
    fold(values, i + 1 - p, n + n % 2 - 2 - i, out)
    if p == 1 and j == -(-n // 2):
        out[0, -1] = 0.0
    return out
