"""Envelopes and waveforms of orders by the Vold–Kalman filter, from plain arrays; which solver suits which problem."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations, combinations_with_replacement
from math import comb, factorial
from typing import Any, Literal

import numpy as np
from numba import njit
from numpy.typing import NDArray

from gearsig.checks import FloatArray
from gearsig.errors import RefusalError
from gearsig.orders.vold_kalman._banded import eliminate, rotate, solve_band
from gearsig.orders.vold_kalman._grouping import Group
from gearsig.orders.vold_kalman._single import envelope_alone, waveform_alone
from gearsig.orders.vold_kalman._tracks import (
    HALF_POWER,
    Generation,
    cosine_and_sine,
    envelope_weight,
    waveform_weight,
    write_envelope,
    write_modulated,
    write_phasors,
)

# Adding up the cells' parts of the coarse normal equations.


Array = NDArray[Any]
ComplexArray = NDArray[np.complex128]
BoolArray = NDArray[np.bool_]


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator,unused-ignore]
def add_products(matrix: Array, k: int, m: int, first: int, pairs: NDArray[np.int64], grams: Array) -> None:
    """Add each cell's products of pieces s <= t, (n_cells, n_pairs), to the splines that the pieces belong to.

    matrix[t - s, cell + s] at unknowns k and m and, conjugate, m and k; the first cell is `first`.
    """
    for cell in range(grams.shape[0]):
        for i in range(grams.shape[1]):
            s, t = pairs[i, 0], pairs[i, 1]
            value = grams[cell, i]
            matrix[t - s, first + cell + s, k, m] += value
            if m != k:
                matrix[t - s, first + cell + s, m, k] += np.conj(value)


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator,unused-ignore]
def add_projections(right: Array, k: int, first: int, projected: Array) -> None:
    """Add each cell's projections on its pieces, (n_cells, n_pieces), to the splines that the pieces belong to."""
    for cell in range(projected.shape[0]):
        for s in range(projected.shape[1]):
            right[first + cell + s, k] += projected[cell, s]


# The second-generation Vold–Kalman problem on a coarse grid: the envelope as a quintic spline.
#
# A narrow-band envelope changes little from sample to sample. The least-squares problem is restricted to splines
# x_k(n) = Σ_i a_ki φ(n/d - i) with one knot every d samples (Ritz–Galerkin); all sums over samples stay exact. The
# error is that of the best spline, 2.4 (dω_h/π)^2p with ω_h half the bandwidth in rad/sample; the rounding error falls
# from ε/ω_h^2p to ε/(dω_h)^2p. Both meet near 1e-8 where d is chosen by `samples_per_cell`.


DEGREE = 5
"""Of the spline: 2p - 1 for p = 3, as the error's order 2p asks; with p = 2 it is more than needed."""
PIECES = DEGREE + 1
CELL_ANGLE = {2: 0.0234, 3: 0.0993}
"""d·ω_h for two and three poles where truncation 2.4 (dω_h/π)^2p and rounding ~10 ε/(dω_h)^2p are equal."""
MAX_CELL = 2**16
MAX_INT64_CELL = 2600
"""Up to here 66 d⁵, the largest value of 5! d⁵ φ, fits 64 bits; that the sums before it wrap around does no harm."""
CHUNK_SAMPLES = 2**15


def samples_per_cell(lowest_bandwidth: float, highest_bandwidth: float, p: int) -> int:
    """Return d, 0 for one pole; bandwidths in cycles per sample.

    The geometric mean of both bandwidths shares the loss evenly between truncation and rounding.
    """
    if p not in CELL_ANGLE:
        return 0
    return min(MAX_CELL, int(CELL_ANGLE[p] / (np.pi * np.sqrt(lowest_bandwidth * highest_bandwidth))))


def expected_error(lowest_bandwidth: float, highest_bandwidth: float, d: int, p: int) -> float:
    """Return the sum of truncation and rounding error that d leads to, relative to the largest component."""
    truncation = 2.4 * (d * highest_bandwidth) ** (2 * p)
    return float(truncation + 2e-15 / (np.pi * d * lowest_bandwidth) ** (2 * p))


def solve_by_splines(
    y: FloatArray, cycles: FloatArray, active: BoolArray | None, weights: FloatArray, p: int, d: int, *, mirror: bool
) -> ComplexArray:
    """Minimise Σ_n |y_n - Σ_k x_kn e^{2πi c_kn}|² + Σ_k Σ_n r_kn² |∇^p x_kn|² over splines with knots d samples apart.

    With mirror images, x_k* e^{-2πi c_k} is part of the data equation as well, and of the second sum. The unknowns are
    then the real coefficients of cos and -sin: u + iv = 2x, with weight r/√2 each.

    Parameters
    ----------
    y : array, (n,)
    cycles : array, (n_orders, n)
        c.
    active : array of bool, (n_orders, n), or None
        Where an order is part of the data equation; None: everywhere.
    weights : array, (n_orders, n - p) or (n_orders, 1)
        r, of each row of the structural equation or constant.
    p, d : int
        Poles; samples per cell, at least p + 1.
    mirror : bool

    Returns
    -------
    array, (n_orders, n), complex
        2x.

    Raises
    ------
    RefusalError
        If the orders cannot be told apart.
    """
    basis, differences = sampled_basis(d, p)
    matrix, right = _data_terms(y, cycles, active, basis, mirror)
    unknown_weights = np.repeat(weights, 2, axis=0) / 2**0.5 if mirror else weights
    _add_structure(matrix, unknown_weights, differences, len(y), p)
    # A last knot at the last sample leaves a spline that vanishes on all samples.
    n_splines = -(-(len(y) - 1) // d) + DEGREE
    coefficients = _solve_spline_system(matrix[:, :n_splines], right[:n_splines])
    envelope = np.asarray(coefficients.view(np.complex128) if mirror else 2.0 * coefficients, dtype=np.complex128)
    return _sampled(envelope, basis, len(y), len(right))


def sampled_basis(d: int, p: int) -> tuple[FloatArray, FloatArray]:
    """Return the B-splines' values in a cell, (d, 6), and their p-th differences, (d, 7).

    Column s belongs to the spline that began 5 - s cells earlier. The difference is the forward one, so the last p rows
    of a cell reach into the spline that begins with the next cell (column 6). Integers throughout: the difference of
    rounded values would have few digits left.
    """
    kind: Any = np.int64 if d < MAX_INT64_CELL else np.object_
    grid: NDArray[Any] = np.arange((PIECES + 2) * d).astype(kind)
    powers = grid * grid * grid * grid * grid
    spline: NDArray[Any] = np.zeros((PIECES + 2) * d, dtype=kind)  # one empty cell before, one after
    for i in range(PIECES + 1):
        spline[(i + 1) * d :] += (-1) ** i * comb(PIECES, i) * powers[: (PIECES + 1 - i) * d]
    difference = np.append(np.diff(spline, p), np.zeros(p, dtype=kind))
    scale = float(factorial(DEGREE) * d**DEGREE)

    def cells(values: NDArray[Any]) -> FloatArray:
        return values.astype(np.float64).reshape(-1, d)[::-1].T / scale

    return np.ascontiguousarray(cells(spline)[:, 1:-1]), np.ascontiguousarray(cells(difference)[:, 1:])


def _pairs(basis: FloatArray) -> tuple[NDArray[np.int64], FloatArray]:
    """Return all pairs s <= t of columns, (n_pairs, 2), and their products, (d, n_pairs)."""
    pairs = np.array(list(combinations_with_replacement(range(basis.shape[1]), 2)), dtype=np.int64)
    return pairs, basis[:, pairs[:, 0]] * basis[:, pairs[:, 1]]


def _data_terms(
    y: FloatArray, cycles: FloatArray, active: BoolArray | None, basis: FloatArray, mirror: bool
) -> tuple[NDArray[Any], NDArray[Any]]:
    """Return the data equation's part of the normal equations of the coefficients.

    matrix[o, i, k, l] couples coefficient i + o of unknown k to coefficient i of unknown l; right[i, k]. The unknowns
    are x_k, or with mirror images the coefficients of cos and -sin of each order in turn. The matrix is real for one
    order: its own phasor cancels.
    """
    n_orders, n = cycles.shape
    d = len(basis)
    n_cells = -(-n // d)
    pairs, products = _pairs(basis)
    n_unknowns = 2 * n_orders if mirror else n_orders
    matrix = np.zeros(
        (PIECES + 1, n_cells + PIECES, n_unknowns, n_unknowns),
        np.float64 if mirror or n_orders == 1 else np.complex128,
    )
    right = np.zeros((n_cells + PIECES, n_unknowns), np.float64 if mirror else np.complex128)
    per_chunk = max(1, CHUNK_SAMPLES // d)
    for first in range(0, n_cells, per_chunk):
        last = min(first + per_chunk, n_cells)
        samples = slice(first * d, min(last * d, n))
        values, regressors = _padded_chunk(y, cycles, active, samples, (last - first, d), mirror=mirror)
        # Where cos² + sin² is 1 throughout, its products are the same in every cell.
        whole = np.tile(products.sum(axis=0), (last - first, 1)) if active is None and last * d <= n else None
        _add_data_terms(matrix, right, first, values, regressors, basis, pairs, products, whole)
    return matrix, right


def _add_data_terms(
    matrix: NDArray[Any],
    right: NDArray[Any],
    first: int,
    values: FloatArray,
    regressors: list[NDArray[Any]],
    basis: FloatArray,
    pairs: NDArray[np.int64],
    products: FloatArray,
    whole: FloatArray | None,
) -> None:
    """Add a chunk's part: e_k* y on the right, e_k* e_m in the matrix, e a phasor, or cos and -sin of each in turn."""
    square: FloatArray = np.zeros(0)
    for k, e_k in enumerate(regressors):
        add_projections(right, k, first, _summed(values * e_k.conj(), basis))
        for m, e_m in enumerate(regressors[:k]):
            add_products(matrix, k, m, first, pairs, _summed(e_k.conj() * e_m, products))
        if whole is not None and np.iscomplexobj(e_k):
            square = whole
        elif whole is not None and k % 2:
            square = whole - square
        else:
            square = _summed(e_k.real**2 + e_k.imag**2 if np.iscomplexobj(e_k) else e_k * e_k, products)
        add_products(matrix, k, k, first, pairs, square)


def _summed(samples: NDArray[Any], columns: FloatArray) -> NDArray[Any]:
    """Return each cell's sums over its samples, weighted by real columns: not a complex product with zeros in it."""
    if np.iscomplexobj(samples):
        return np.asarray(samples.real @ columns + 1j * (samples.imag @ columns))
    return np.asarray(samples @ columns)


def _padded_chunk(
    y: FloatArray, cycles: FloatArray, active: BoolArray | None, samples: slice, shape: tuple[int, int], *, mirror: bool
) -> tuple[FloatArray, list[NDArray[Any]]]:
    """Return the signal and the regressors as (cell, sample in it); zero past the end, where inactive.

    Phasors, or with mirror images Re(a e^{iΘ}) = u cos Θ - v sin Θ: cosine and minus sine of each order in turn.
    """
    length = samples.stop - samples.start
    values: FloatArray = np.zeros(shape)
    values.reshape(-1)[:length] = y[samples]
    regressors: list[NDArray[Any]] = []
    for k in range(len(cycles)):
        cosine, sine = np.zeros(shape), np.zeros(shape)
        cosine_and_sine(cycles[k, samples], cosine.reshape(-1)[:length], sine.reshape(-1)[:length])
        if active is not None:
            for part in (cosine, sine):
                part.reshape(-1)[:length] *= active[k, samples]
        regressors.extend((cosine, -sine) if mirror else (cosine + 1j * sine,))
    return values, regressors


def _add_structure(matrix: NDArray[Any], weights: FloatArray, differences: FloatArray, n: int, p: int) -> None:
    """Add r²·(∇^p φ_i)(∇^p φ_j), summed over the rows that lie wholly inside the signal."""
    d = len(differences)
    n_cells, n_rows = -(-n // d), n - p
    pairs, products = _pairs(differences)
    per_chunk = max(1, CHUNK_SAMPLES // d)
    whole = products.sum(axis=0)
    for k, r in enumerate(weights):
        for first in range(0, n_cells, per_chunk):
            last = min(first + per_chunk, n_cells)
            rows = slice(first * d, min(last * d, n_rows))
            if len(r) == 1 and rows.stop == last * d:
                grams = np.tile(r[0] ** 2 * whole, (last - first, 1))
            else:
                squares = np.zeros((last - first) * d)
                squares[: max(0, rows.stop - rows.start)] = (r if len(r) == 1 else r[rows]) ** 2
                grams = squares.reshape(-1, d) @ products
            add_products(matrix, k, k, first, pairs, grams)


def _solve_spline_system(matrix: NDArray[Any], right: NDArray[Any]) -> NDArray[Any]:
    """Solve the Hermitian banded system by Cholesky's method; unknowns ordered by spline, then by order.

    A real matrix takes real and imaginary part of the right-hand side as two.
    """
    from scipy.linalg import LinAlgError, solveh_banded

    n_offsets, n_splines, n_orders, _ = matrix.shape
    band = np.zeros((n_offsets * n_orders, n_splines * n_orders), matrix.dtype)
    for offset in range(n_offsets):
        for k in range(n_orders):
            for m in range(n_orders):
                if (below := offset * n_orders + k - m) >= 0:
                    band[below, m::n_orders] = matrix[offset, :, k, m]
    b = right.reshape(-1).view(matrix.dtype).reshape(n_splines * n_orders, -1)
    try:
        x = solveh_banded(band, b, lower=True, overwrite_ab=True, check_finite=False)
    except LinAlgError:
        raise RefusalError(
            "the orders cannot be told apart in this recording", remedy="leave one of them out or record longer"
        ) from None
    return np.ascontiguousarray(x).view(right.dtype).reshape(n_splines, n_orders)


def _sampled(coefficients: ComplexArray, basis: FloatArray, n: int, n_splines: int) -> ComplexArray:
    """Return the splines at all samples, (n_orders, n)."""
    d = len(basis)
    a = np.zeros((coefficients.shape[1], n_splines), np.complex128)
    a[:, : len(coefficients)] = coefficients.T
    x = np.empty((len(a), n), np.complex128)
    n_cells = -(-n // d)
    per_chunk = max(1, CHUNK_SAMPLES // d)
    for k in range(len(a)):
        windows = np.lib.stride_tricks.sliding_window_view(a[k], PIECES)
        for first in range(0, n_cells, per_chunk):
            cells = slice(first, min(first + per_chunk, n_cells))
            samples = slice(cells.start * d, min(cells.stop * d, n))
            both = (windows.real[cells] @ basis.T, windows.imag[cells] @ basis.T)
            length = samples.stop - samples.start
            x.real[k, samples], x.imag[k, samples] = both[0].reshape(-1)[:length], both[1].reshape(-1)[:length]
    return x


# How much worse a joint Vold–Kalman problem is conditioned for orders that stay closer than the filter is wide.


POINTS_PER_SEGMENT = 16
GROWTH = 1.5


def closeness(cycles: FloatArray, active: NDArray[np.bool_] | None, bandwidths: FloatArray, p: int) -> float:
    """Return the factor by which rounding errors grow, 1 where no two orders stay within a bandwidth.

    Two orders at a distance g below the bandwidth B can exchange what they hold at the price of (g/B)^2p, which divides
    the smallest eigenvalue of the normal equations. Within a segment W the price is that of the distance's rms or of
    going up and down again in W, p/W, whichever is higher (factor from trials); the cheapest segment counts. Orders
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
    smallest, segment = np.inf, 1.0 / width
    while len(difference) > 1:
        n = min(int(segment) + 1, len(difference) - 1)
        step = max(1, n // POINTS_PER_SEGMENT)
        slopes = np.diff(difference[::step]) / step
        m = min(len(slopes), max(1, round(n / step)))
        total = np.concatenate([[0.0], np.cumsum(slopes**2)])
        rms = float(np.sqrt(max(float((total[m:] - total[:-m]).min()), 0.0) / m))
        smallest = min(smallest, max(p / n, rms))
        if n >= len(difference) - 1 or rms > smallest:
            break
        segment *= GROWTH
    return float(smallest)


Solver = Literal["splines", "elimination", "rotations"]

MAX_ELIMINATED_STRENGTH = 1.5e5
"""r·|D| up to which the normal equations are solved: their rounding error is below 5e-7 there."""
MIN_CELL = 3
"""Samples. Below, the band is so wide that the coarse grid saves nothing, and elimination loses no digits."""

CHEAP_CELL, MAX_TOGETHER = 16, 8
"""Samples per cell from which, and orders up to which, the coarse grid is faster than several solutions (trials)."""
ACCURATE = 1e-7
ENOUGH = 5e-7
"""Expected error up to which the fastest solver is taken."""


def solve_envelopes(
    y: FloatArray,
    cycles: FloatArray,
    active: BoolArray | None,
    bandwidths: FloatArray,
    p: int,
    *,
    mirror: bool = True,
) -> ComplexArray:
    """Return the complex envelopes of the second generation, jointly for all orders.

    Data equation y_n = Σ_k (x_kn e^{2πi c_kn} + x_kn* e^{-2πi c_kn}) + η_n, structural equation ∇^p x_kn = ε_kn and its
    conjugate, minimised as Σ|η_n|² + 2 Σ r_kn² |ε_kn|². Envelopes are 2 x_k: y ≈ Σ Re(2 x_k e^{2πi c_k}). Textbooks
    leave the conjugate terms out, though the signal is real; the order's mirror image at -f then passes with the gain
    at 2f, and with several percent near the ends.

    Parameters
    ----------
    y : array, (n,)
    cycles : array, (n_orders, n)
        c, the phase of each order in cycles.
    active : array of bool, (n_orders, n), or None
        Where an order is part of the data; None: everywhere. Elsewhere its envelope continues as a polynomial.
    bandwidths : array, (n_orders, n) or (n_orders, 1)
        -3 dB, in cycles per sample.
    p : int
        Poles, 1 to 3.
    mirror : bool
        False: without the conjugate terms, as the textbooks.

    Returns
    -------
    array, (n_orders, n), complex

    Raises
    ------
    RefusalError
        If the orders cannot be told apart.

    References
    ----------
    H. Vold, M. Mains, J. Blough, "Theoretical foundations for high performance order tracking with the Vold-Kalman
    tracking filter", 1997. C. Feldbauer, R. Höldrich, "Realization of a Vold-Kalman tracking filter – a least squares
    problem", 2000. J. Tůma, "Setting the passband width in the Vold-Kalman order tracking filter", 2005.
    """
    n = len(y)
    # A row of the structural equation holds p + 1 samples; its weight is that of the middle one.
    weights = envelope_weight(_of_rows(bandwidths, n, p), p)
    if len(cycles) == 1:
        return envelope_alone(y, cycles[0], None if active is None else active[0], weights[0], p, mirror=mirror)[None]
    solver, _ = chosen_solver(bandwidths, p, closeness(cycles, active, bandwidths, p))
    if solver == "splines":
        return solve_by_splines(y, cycles, active, weights, p, cell_of(bandwidths, p), mirror=mirror)
    weights = np.broadcast_to(weights, (len(cycles), n - p))
    return _solve_envelopes_by_samples(y, cycles, active, weights, p, solver, mirror=mirror)


def solve_waveforms(y: FloatArray, cycles: FloatArray, active: BoolArray | None, bandwidths: FloatArray) -> FloatArray:
    """Return the waveforms of the first generation, jointly for all orders.

    Data equation y_n = Σ_k x_kn + η_n, structural equation x_kn - 2 cos ω_k(n+1) x_k(n+1) + x_k(n+2) = ε_kn, minimised
    as Σ η_n² + Σ r_kn² ε_kn².

    Parameters
    ----------
    y, cycles, active, bandwidths
        As in `solve_envelopes`.

    Returns
    -------
    array, (n_orders, n)

    References
    ----------
    H. Vold, J. Leuridan, "High resolution order tracking at extreme slew rates, using Kalman tracking filters", 1993.
    """
    width = _of_rows(bandwidths, len(y), 2)
    if len(cycles) == 1:
        return waveform_alone(y, cycles[0], None if active is None else active[0], width[0])[None]
    frequency = (cycles[:, 2:] - cycles[:, :-2]) / 2.0
    # Outside the active part the order may stand still: any finite weight does there.
    inside = np.clip(frequency, 0.75 * width, 0.5 - 0.75 * width)
    stencils = np.ones((*frequency.shape, 3))
    stencils[:, :, 1] = -2.0 * np.cos(2.0 * np.pi * frequency)
    data = np.ones(cycles.shape) if active is None else active.astype(np.float64)
    weights = waveform_weight(width, inside)
    # |D|, the largest gain of the stencil, is 2^p for differences and for the first generation at most that.
    solver = _sample_by_sample(4.0 * float(weights.max()), closeness(cycles, active, bandwidths, 2))[0]
    return _solve_by_samples(data, y.astype(np.float64), weights, stencils, solver)


def _solve_by_samples(
    data: NDArray[Any], observed: NDArray[Any], weights: FloatArray, stencils: FloatArray, solver: Solver
) -> NDArray[Any]:
    return solve_band(data, observed, weights, stencils, forward=eliminate if solver == "elimination" else rotate)


def cell_of(bandwidths: FloatArray, p: int) -> int:
    """Return the samples per cell of the coarse grid; 0 where the problem is solved sample by sample."""
    d = samples_per_cell(float(bandwidths.min()), float(bandwidths.max()), p)
    return d if d >= MIN_CELL else 0


def chosen_solver(bandwidths: FloatArray, p: int, close: float) -> tuple[Solver, float]:
    """Return how several orders of the second generation are solved for, and the expected error.

    Relative to the largest component of the signal; `close` is the factor of `closeness`.
    """
    d = cell_of(bandwidths, p)
    solvers = [_sample_by_sample(2.0**p * float(envelope_weight(bandwidths.min()[None], p)[0]), close)]
    if d:
        solvers.insert(0, ("splines", close * expected_error(float(bandwidths.min()), float(bandwidths.max()), d, p)))
    return next((option for option in solvers if option[1] <= ENOUGH), min(solvers, key=lambda option: option[1]))


def _sample_by_sample(strength: float, close: float) -> tuple[Solver, float]:
    """Return elimination or rotations and their error for r·|D|, the former's growing with its square (trials)."""
    elimination, rotations = 2e-17 * strength**2 * close, 1e-15 * strength * close**0.5
    if strength <= MAX_ELIMINATED_STRENGTH and elimination <= max(ENOUGH, rotations):
        return "elimination", elimination
    return "rotations", rotations


def accuracy_of(cycles: FloatArray, active: BoolArray | None, bandwidths: FloatArray, p: int) -> float:
    """Return the expected error of `solve_envelopes`, relative to the largest component of the signal."""
    if len(bandwidths) == 1:
        return error_alone(bandwidths)
    return chosen_solver(bandwidths, p, closeness(cycles, active, bandwidths, p))[1]


def cheap_together(cycles: FloatArray, active: BoolArray | None, bandwidths: FloatArray, p: int) -> bool:
    """Return whether one solution of the second generation for all orders takes less time than several for groups."""
    few = 1 < len(bandwidths) <= MAX_TOGETHER
    return few and cell_of(bandwidths, p) >= CHEAP_CELL and accuracy_of(cycles, active, bandwidths, p) <= ACCURATE


def waveform_accuracy_of(cycles: FloatArray, active: BoolArray, bandwidths: FloatArray) -> float:
    """Return the expected error of `solve_waveforms`, relative to the largest component of the signal."""
    if len(bandwidths) == 1:
        return error_alone(bandwidths)
    frequency = np.abs(np.diff(cycles, axis=1))[active[:, 1:] & active[:, :-1]]
    narrowest = np.pi * float(bandwidths.min())
    sine = min(np.sin(2 * np.pi * float(frequency.min())), np.sin(2 * np.pi * float(frequency.max())))
    strength = 4.0 * float(HALF_POWER) / (2.0 * narrowest * max(sine, narrowest))
    return _sample_by_sample(strength, closeness(cycles, active, bandwidths, 2))[1]


def error_alone(bandwidths: FloatArray) -> float:
    """Return the rounding error for one order: a rounding step per sample, as far as the filter's memory reaches."""
    return 1e-12 + 1e-15 / float(bandwidths.min())


def envelopes_of_waveforms(x: FloatArray, cycles: FloatArray) -> ComplexArray:
    """Return complex envelopes of narrow-band waveforms x = Re(a e^{2πi c}).

    For constant a the neighbours are x(n±1) = x cos α± ∓ q sin α±, α the phase step; both give the quadrature q by
    least squares, and a = (x + iq) e^{-2πi c}.
    """
    a = np.empty(x.shape, np.complex128)
    for waveform, angle, envelope in zip(x, cycles, a, strict=True):
        write_envelope(np.ascontiguousarray(waveform), np.ascontiguousarray(angle), envelope)
    return a


def _solve_envelopes_by_samples(
    y: FloatArray,
    cycles: FloatArray,
    active: BoolArray | None,
    weights: FloatArray,
    p: int,
    solver: Solver,
    *,
    mirror: bool,
) -> ComplexArray:
    """Solve for the complex x, or with mirror images for the real coefficients of cos and -sin, as by splines."""
    data: NDArray[Any] = np.empty(cycles.shape, np.complex128)
    for row, angle in zip(data, cycles, strict=True):
        write_phasors(np.ascontiguousarray(angle), row)
    if active is not None:
        data *= active
    if mirror:
        data = np.stack([data.real, -data.imag], axis=1).reshape(-1, len(y))
        weights = np.repeat(weights, 2, axis=0) / 2**0.5
    x = _solve_by_samples(data, y.astype(data.dtype), weights, _differences(weights, p), solver)
    return np.asarray(x[::2] + 1j * x[1::2] if mirror else 2.0 * x, dtype=np.complex128)


def _differences(weights: FloatArray, p: int) -> FloatArray:
    """Return the stencil of the p-th difference for every row, without copies."""
    stencil = [(-1.0) ** (p - i) * comb(p, i) for i in range(p + 1)]
    return np.broadcast_to(stencil, (*weights.shape, p + 1))


def _of_rows(bandwidths: FloatArray, n: int, p: int) -> FloatArray:
    """Return the bandwidth at the middle of each row of the structural equation."""
    if bandwidths.shape[1] == 1:
        return bandwidths
    middle = p // 2
    return bandwidths[:, middle : n - p + middle]


# Groups of orders solved for in turn, each on the signal less the others' waveforms.


Rows = Group | slice


@dataclass(frozen=True)
class Problem:
    """All orders: phase in cycles, where they are data, -3 dB bandwidth in cycles per sample; (n_orders, n)."""

    cycles: FloatArray
    valid: BoolArray
    bandwidths: FloatArray
    p: int
    generation: Generation
    mirror: bool


def solve_groups(
    y: FloatArray, problem: Problem, groups: Sequence[Group], *, share: bool
) -> tuple[ComplexArray, FloatArray, float]:
    """Return envelopes (nan where not valid), waveforms (0 there), and the remaining error relative to the signal.

    Without `share`, each group sees the whole signal, and takes what leaks through its bands of the others: near the
    ends, that is some percent even of far ones. With it, each sees the signal less the others' waveforms, in several
    sweeps (Gauss–Seidel by groups), which lead to the solution for all orders together.
    """
    solutions: NDArray[Any] = np.empty(
        problem.cycles.shape, np.complex128 if problem.generation == "second" else np.float64
    )
    waveforms = np.zeros(problem.cycles.shape)
    rows = [_rows(group) for group in groups]
    if len(groups) == 1 or not share:
        for g in rows:
            solutions[g], waveforms[g] = _solve_group(y, problem, g)
        return _envelopes(solutions, problem), waveforms, 0.0
    rest = y.astype(np.float64)
    largest = float(np.abs(rest).max()) or 1.0
    before, error = 1.0, 1.0
    for _ in range(20):
        change = 0.0
        for g in rows:
            rest += waveforms[g].sum(axis=0)
            solutions[g], new = _solve_group(rest, problem, g)
            change = max(change, float(np.abs(new - waveforms[g]).max()) / largest)
            waveforms[g] = new
            rest -= new.sum(axis=0)
        # Each sweep changes the waveforms by the same fraction of what the last one did.
        error = change * min(1.0, change / before)
        before = change
        if error < 2e-7:  # of the signal's largest value: not worth a further sweep
            break
    return _envelopes(solutions, problem), waveforms, error


def _rows(group: Group) -> Rows:
    """Return neighbours as a slice, which takes no copy."""
    return slice(int(group[0]), int(group[-1]) + 1) if np.all(np.diff(group) == 1) else group


def _solve_group(y: FloatArray, problem: Problem, g: Rows) -> tuple[NDArray[Any], FloatArray]:
    """Return the solution of one group (envelopes, or waveforms of the first generation), and its waveforms.

    Where an order is not valid, the solution goes on all the same, and the waveform is 0.
    """
    cycles, valid, widths = problem.cycles[g], problem.valid[g], problem.bandwidths[g]
    active = None if valid.all() else valid
    if problem.generation == "first":
        continued = solve_waveforms(y, cycles, active, widths)
        return continued, continued if active is None else np.where(valid, continued, 0.0)
    envelopes = solve_envelopes(y, cycles, active, widths, problem.p, mirror=problem.mirror)
    waveforms = np.empty(cycles.shape)
    for envelope, angle, out in zip(envelopes, cycles, waveforms, strict=True):
        write_modulated(envelope, angle, out)
    if active is not None:
        waveforms *= valid
    return envelopes, waveforms


def _envelopes(solutions: NDArray[Any], problem: Problem) -> ComplexArray:
    """Return the envelopes, nan where not valid."""
    envelopes = (
        envelopes_of_waveforms(solutions, problem.cycles) if problem.generation == "first" else solutions
    ).astype(np.complex128, copy=False)
    if not problem.valid.all():
        envelopes[~problem.valid] = np.nan
    return envelopes
