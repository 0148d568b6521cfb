"""The second-generation Vold–Kalman problem on a coarse grid: the envelope as a quintic spline.

A narrow-band envelope changes little from sample to sample. The least-squares problem is restricted to splines
x_k(n) = Σ_i a_ki φ(n/d - i) with one knot every d samples (Ritz–Galerkin); all sums over samples stay exact. The error
is that of the best spline, 2.4 (dω_h/π)^2p with ω_h half the bandwidth in rad/sample; the rounding error falls from
ε/ω_h^2p to ε/(dω_h)^2p. Both meet near 1e-8 where d is chosen by `samples_per_cell`.
"""

from __future__ import annotations

from itertools import combinations_with_replacement
from math import comb, factorial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gearsig.checks import FloatArray
from gearsig.errors import RefusalError
from gearsig.orders.vold_kalman_assembly import add_products, add_projections
from gearsig.orders.vold_kalman_phasor import cosine_and_sine

ComplexArray = NDArray[np.complex128]
BoolArray = NDArray[np.bool_]

DEGREE = 5
"""Of the spline: 2p - 1 for p = 3, as the error's order 2p asks; with p = 2 it is more than needed."""
PIECES = DEGREE + 1
CELL_ANGLE = {2: 0.0234, 3: 0.0993}
"""d·ω_h for two and three poles where truncation 2.4 (dω_h/π)^2p and rounding ~10 ε/(dω_h)^2p are equal."""
LARGEST_CELL = 2**16
LARGEST_INT64_CELL = 2600
"""Up to here 66 d⁵, the largest value of 5! d⁵ φ, fits 64 bits; that the sums before it wrap around does no harm."""
CHUNK_SAMPLES = 2**15


def samples_per_cell(lowest_bandwidth: float, highest_bandwidth: float, p: int) -> int:
    """Return d, 0 for one pole; bandwidths in cycles per sample.

    The geometric mean of both bandwidths shares the loss evenly between truncation and rounding.
    """
    if p not in CELL_ANGLE:
        return 0
    return min(LARGEST_CELL, int(CELL_ANGLE[p] / (np.pi * np.sqrt(lowest_bandwidth * highest_bandwidth))))


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
    coefficients = _solved(matrix[:, :n_splines], right[:n_splines])
    envelope = np.asarray(coefficients.view(np.complex128) if mirror else 2.0 * coefficients, dtype=np.complex128)
    return _sampled(envelope, basis, len(y), len(right))


def sampled_basis(d: int, p: int) -> tuple[FloatArray, FloatArray]:
    """Return the B-splines' values in a cell, (d, 6), and their p-th differences, (d, 7).

    Column s belongs to the spline that began 5 - s cells earlier. The difference is the forward one, so the last p rows
    of a cell reach into the spline that begins with the next cell (column 6). Integers throughout: the difference of
    rounded values would have few digits left.
    """
    kind: Any = np.int64 if d < LARGEST_INT64_CELL else np.object_
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
    add = _add_real_terms if mirror else _add_complex_terms
    per_chunk = max(1, CHUNK_SAMPLES // d)
    for first in range(0, n_cells, per_chunk):
        last = min(first + per_chunk, n_cells)
        samples = slice(first * d, min(last * d, n))
        values, phasors = _padded_chunk(y, cycles, active, samples, (last - first, d))
        # Where cos² + sin² is 1 throughout, its products are the same in every cell.
        whole = np.tile(products.sum(axis=0), (last - first, 1)) if active is None and last * d <= n else None
        add(matrix, right, first, values, phasors, basis, pairs, products, whole)
    return matrix, right


def _add_complex_terms(
    matrix: NDArray[Any],
    right: NDArray[Any],
    first: int,
    values: FloatArray,
    phasors: list[tuple[FloatArray, FloatArray]],
    basis: FloatArray,
    pairs: NDArray[np.int64],
    products: FloatArray,
    whole: FloatArray | None,
) -> None:
    """Add a chunk's part for the complex unknowns: e_k* y on the right, e_k* e_m in the matrix."""
    for k, (c_k, s_k) in enumerate(phasors):
        add_projections(right, k, first, (values * c_k) @ basis - 1j * ((values * s_k) @ basis))
        own = whole if whole is not None else (c_k * c_k + s_k * s_k) @ products
        add_products(matrix, k, k, first, pairs, own)
        for m, (c_m, s_m) in enumerate(phasors[:k]):
            coupling = (c_k * c_m + s_k * s_m) @ products + 1j * ((c_k * s_m - s_k * c_m) @ products)
            add_products(matrix, k, m, first, pairs, coupling)


def _add_real_terms(
    matrix: NDArray[Any],
    right: NDArray[Any],
    first: int,
    values: FloatArray,
    phasors: list[tuple[FloatArray, FloatArray]],
    basis: FloatArray,
    pairs: NDArray[np.int64],
    products: FloatArray,
    whole: FloatArray | None,
) -> None:
    """Add a chunk's part for the real unknowns: Re(a e^{iΘ}) = u cos Θ - v sin Θ."""
    regressors = [part for c, s in phasors for part in (c, -s)]
    own: FloatArray = np.zeros(0)
    for k, of_k in enumerate(regressors):
        add_projections(right, k, first, (values * of_k) @ basis)
        for m, of_m in enumerate(regressors[:k]):
            add_products(matrix, k, m, first, pairs, (of_k * of_m) @ products)
        own = whole - own if whole is not None and k % 2 else (of_k * of_k) @ products
        add_products(matrix, k, k, first, pairs, own)


def _padded_chunk(
    y: FloatArray, cycles: FloatArray, active: BoolArray | None, samples: slice, shape: tuple[int, int]
) -> tuple[FloatArray, list[tuple[FloatArray, FloatArray]]]:
    """Return the signal and each order's (cosine, sine) as (cell, sample in it); zero past the end, where inactive."""
    length = samples.stop - samples.start
    values: FloatArray = np.zeros(shape)
    values.reshape(-1)[:length] = y[samples]
    phasors: list[tuple[FloatArray, FloatArray]] = []
    for k in range(len(cycles)):
        cosine, sine = np.zeros(shape), np.zeros(shape)
        cosine_and_sine(cycles[k, samples], cosine.reshape(-1)[:length], sine.reshape(-1)[:length])
        if active is not None:
            for part in (cosine, sine):
                part.reshape(-1)[:length] *= active[k, samples]
        phasors.append((cosine, sine))
    return values, phasors


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


def _solved(matrix: NDArray[Any], right: NDArray[Any]) -> NDArray[Any]:
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
