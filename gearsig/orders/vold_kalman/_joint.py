"""Joint solvers for several orders, by splines on a coarse grid or sample by sample, and the choice between them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations, combinations_with_replacement
from math import comb, factorial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gearsig.checks import FloatArray
from gearsig.compiled import njit
from gearsig.errors import RefusalError
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

Array = NDArray[Any]
ComplexArray = NDArray[np.complex128]
BoolArray = NDArray[np.bool_]
Group = NDArray[np.intp]

ENOUGH = 5e-7
"""Expected error up to which splines, the faster method, are used."""


@dataclass(frozen=True)
class Problem:
    """All orders, (n_orders, n): phase in cycles, where they are part of the data, -3 dB bandwidth in cycles/sample."""

    cycles: FloatArray
    valid: BoolArray
    bandwidths: FloatArray
    p: int
    generation: Generation
    mirror: bool

    def of(self, group: Group) -> Problem:
        """Return the problem for a group of orders; adjacent rows as views, without a copy."""
        rows = _rows(group)
        return replace(self, cycles=self.cycles[rows], valid=self.valid[rows], bandwidths=self.bandwidths[rows])

    @property
    def expected_error(self) -> float:
        """Expected error of the joint solution for all orders, relative to the largest component of the signal."""
        if self.generation == "second" or len(self.bandwidths) == 1:
            return accuracy_of(self.cycles, self.valid, self.bandwidths, self.p)
        frequency = np.abs(np.diff(self.cycles, axis=1))[self.valid[:, 1:] & self.valid[:, :-1]]
        narrowest = np.pi * float(self.bandwidths.min())
        sine = min(np.sin(2 * np.pi * float(frequency.min())), np.sin(2 * np.pi * float(frequency.max())))
        strength = 4.0 * float(HALF_POWER) / (2.0 * narrowest * max(sine, narrowest))
        return rotations_error(strength, rounding_growth(self.cycles, self.valid, self.bandwidths, 2))

    @property
    def cheap_together(self) -> bool:
        """Whether one solution for all orders takes less time than several for groups (from trials)."""
        if self.generation == "first" or not 1 < len(self.bandwidths) <= 8:
            return False
        lowest, highest = float(self.bandwidths.min()), float(self.bandwidths.max())
        return samples_per_cell(lowest, highest, self.p) >= 16 and self.expected_error <= 1e-7


def solve_groups(
    y: FloatArray, problem: Problem, groups: Sequence[Group], *, share: bool
) -> tuple[ComplexArray, FloatArray, float]:
    """Return envelopes (nan where not valid), waveforms (0 there), and the remaining error relative to the signal.

    Without `share`, each group is fitted to the whole signal and picks up what leaks through its bands from the others:
    near the ends, a few percent even of distant orders. With `share`, each group is fitted to the signal minus the
    others' waveforms, in several sweeps (Gauss–Seidel by groups), which converge to the joint solution for all orders.
    """
    solutions: NDArray[Any] = np.empty(
        problem.cycles.shape, np.complex128 if problem.generation == "second" else np.float64
    )
    waveforms = np.zeros(problem.cycles.shape)
    rows, parts = [_rows(group) for group in groups], [problem.of(group) for group in groups]
    if len(groups) == 1 or not share:
        for g, part in zip(rows, parts, strict=True):
            solutions[g], waveforms[g] = _solve_group(y, part)
        return _envelopes(solutions, problem), waveforms, 0.0
    residual = y.astype(np.float64)
    largest = float(np.abs(residual).max()) or 1.0
    before, error = 1.0, 1.0
    for _ in range(20):
        change = 0.0
        for g, part in zip(rows, parts, strict=True):
            residual += waveforms[g].sum(axis=0)
            solutions[g], new = _solve_group(residual, part)
            change = max(change, float(np.abs(new - waveforms[g]).max()) / largest)
            waveforms[g] = new
            residual -= new.sum(axis=0)
        # The change per sweep decreases by a constant factor.
        error = change * min(1.0, change / before)
        before = change
        if error < 2e-7:  # of the signal's largest value: another sweep is not worthwhile
            break
    return _envelopes(solutions, problem), waveforms, error


def _rows(group: Group) -> Group | slice:
    return slice(int(group[0]), int(group[-1]) + 1) if np.all(np.diff(group) == 1) else group


def _solve_group(y: FloatArray, problem: Problem) -> tuple[Array, FloatArray]:
    """Return the solution of one group (envelopes, or waveforms of the first generation), and its waveforms.

    Where an order is not valid, the solution continues, but the waveform is 0.
    """
    cycles, valid, widths = problem.cycles, problem.valid, problem.bandwidths
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


def _envelopes(solutions: Array, problem: Problem) -> ComplexArray:
    """Return the solutions as complex envelopes, (n_orders, n); nan where not valid."""
    envelopes = solutions.astype(np.complex128, copy=problem.generation == "first")
    if problem.generation == "first":
        for waveform, angle, envelope in zip(solutions, problem.cycles, envelopes, strict=True):
            write_envelope(np.ascontiguousarray(waveform), np.ascontiguousarray(angle), envelope)
    if not problem.valid.all():
        envelopes[~problem.valid] = np.nan
    return envelopes


def solve_envelopes(
    y: FloatArray, cycles: FloatArray, active: BoolArray | None, bandwidths: FloatArray, p: int, *, mirror: bool = True
) -> ComplexArray:
    """Return the complex envelopes of the second generation, jointly for all orders.

    Data equation y_n = Σ_k (x_kn e^{2πi c_kn} + x_kn* e^{-2πi c_kn}) + η_n, structural equation ∇^p x_kn = ε_kn and its
    conjugate; Σ|η_n|² + 2 Σ r_kn² |ε_kn|² is minimised. Envelopes are 2 x_k: y ≈ Σ Re(2 x_k e^{2πi c_k}). Textbooks
    omit the conjugate terms although the signal is real; the order's mirror image at -f then passes with the gain at
    2f, and with several percent near the ends.

    Parameters
    ----------
    y : array, (n,)
    cycles : array, (n_orders, n)
        c, the phase of each order in cycles.
    active : array of bool, (n_orders, n), or None
        Where each order is part of the data; None: everywhere. Elsewhere its envelope continues as a polynomial.
    bandwidths : array, (n_orders, n) or (n_orders, 1)
        -3 dB, in cycles per sample.
    p : int
        Poles, 1 to 3.
    mirror : bool
        False: without the conjugate terms, as in textbooks.

    Returns
    -------
    array, (n_orders, n), complex

    Raises
    ------
    RefusalError
        If the orders cannot be distinguished.

    References
    ----------
    H. Vold, M. Mains, J. Blough, "Theoretical foundations for high performance order tracking with the Vold-Kalman
    tracking filter", 1997. C. Feldbauer, R. Höldrich, "Realization of a Vold-Kalman tracking filter – a least squares
    problem", 2000. J. Tůma, "Setting the passband width in the Vold-Kalman order tracking filter", 2005.
    """
    n = len(y)
    # A row of the structural equation spans p + 1 samples; its weight is that of the middle one.
    weights = envelope_weight(_of_rows(bandwidths, n, p), p)
    if len(cycles) == 1:
        return envelope_alone(y, cycles[0], None if active is None else active[0], weights[0], p, mirror=mirror)[None]
    cell, _ = chosen_cell(bandwidths, p, rounding_growth(cycles, active, bandwidths, p))
    if cell:
        return solve_by_splines(y, cycles, active, weights, p, cell, mirror=mirror)
    # Unknowns as for splines: the complex x, or with mirror images the real coefficients of cos and -sin.
    data: Array = np.empty(cycles.shape, np.complex128)
    for row, angle in zip(data, cycles, strict=True):
        write_phasors(np.ascontiguousarray(angle), row)
    if active is not None:
        data *= active
    weights = np.broadcast_to(weights, (len(cycles), n - p))
    if mirror:
        data = np.stack([data.real, -data.imag], axis=1).reshape(-1, n)
        weights = np.repeat(weights, 2, axis=0) / 2**0.5
    stencil = [(-1.0) ** (p - i) * comb(p, i) for i in range(p + 1)]
    stencils = np.broadcast_to(stencil, (*weights.shape, p + 1))
    x = solve_band(data, y.astype(data.dtype), weights, stencils)
    return np.asarray(x[::2] + 1j * x[1::2] if mirror else 2.0 * x, dtype=np.complex128)


def solve_waveforms(y: FloatArray, cycles: FloatArray, active: BoolArray | None, bandwidths: FloatArray) -> FloatArray:
    """Return the waveforms of the first generation, jointly for all orders.

    Data equation y_n = Σ_k x_kn + η_n, structural equation x_kn - 2 cos ω_k(n+1) x_k(n+1) + x_k(n+2) = ε_kn;
    Σ η_n² + Σ r_kn² ε_kn² is minimised.

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
    # Outside the active part the frequency may be zero: any finite weight will do there.
    inside = np.clip(frequency, 0.75 * width, 0.5 - 0.75 * width)
    stencils = np.ones((*frequency.shape, 3))
    stencils[:, :, 1] = -2.0 * np.cos(2.0 * np.pi * frequency)
    data = np.ones(cycles.shape) if active is None else active.astype(np.float64)
    return solve_band(data, y.astype(np.float64), waveform_weight(width, inside), stencils)


def _of_rows(bandwidths: FloatArray, n: int, p: int) -> FloatArray:
    """Return the bandwidth at the middle of each row of the structural equation."""
    if bandwidths.shape[1] == 1:
        return bandwidths
    middle = p // 2
    return bandwidths[:, middle : n - p + middle]


def chosen_cell(bandwidths: FloatArray, p: int, close: float) -> tuple[int, float]:
    """Return the grid cell in samples (0: sample by sample) for the second generation, and the expected error.

    The error is relative to the largest component of the signal; `close` is the factor from `rounding_growth`.
    """
    lowest, highest = float(bandwidths.min()), float(bandwidths.max())
    d = samples_per_cell(lowest, highest, p)
    by_splines = close * expected_error(lowest, highest, d, p) if d else np.inf
    by_rotations = rotations_error(2.0**p * float(envelope_weight(bandwidths.min()[None], p)[0]), close)
    return (d, by_splines) if by_splines <= max(ENOUGH, by_rotations) else (0, by_rotations)


def rotations_error(strength: float, close: float) -> float:
    """Return the sample-by-sample solver's error for r·|D| (trials); D's largest gain is 2^p, less for waveforms."""
    return float(1e-15 * strength * np.sqrt(close))


def accuracy_of(cycles: FloatArray, active: BoolArray | None, bandwidths: FloatArray, p: int) -> float:
    """Return the expected error of `solve_envelopes`, relative to the largest component of the signal."""
    if len(bandwidths) == 1:
        return single_order_error(bandwidths)
    return chosen_cell(bandwidths, p, rounding_growth(cycles, active, bandwidths, p))[1]


def single_order_error(bandwidths: FloatArray) -> float:
    """Return the rounding error for one order: one rounding step per sample over the filter's memory."""
    return 1e-12 + 1e-15 / float(bandwidths.min())


def rounding_growth(cycles: FloatArray, active: NDArray[np.bool_] | None, bandwidths: FloatArray, p: int) -> float:
    """Return the factor by which rounding errors grow; 1 if no two orders stay within a bandwidth.

    Two orders at a distance g below the bandwidth B can exchange content at a cost of (g/B)^2p, which multiplies the
    smallest eigenvalue of the normal equations. Within a segment W, g is the rms distance or p/W, the cost of rising
    and falling again within W, whichever is larger (factor from trials); the cheapest segment counts. Orders that cross
    quickly are close for too short a time to exchange much.

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
        step = max(1, n // 16)
        slopes = np.diff(difference[::step]) / step
        m = min(len(slopes), max(1, round(n / step)))
        total = np.concatenate([[0.0], np.cumsum(slopes**2)])
        rms = float(np.sqrt(max(float((total[m:] - total[:-m]).min()), 0.0) / m))
        smallest = min(smallest, max(p / n, rms))
        if n >= len(difference) - 1 or rms > smallest:
            break
        segment *= 1.5
    return float(smallest)


# The second-generation Vold–Kalman problem on a coarse grid: the envelope as a quintic spline.
#
# A narrow-band envelope changes little from sample to sample. The least-squares problem is restricted to splines
# x_k(n) = Σ_i a_ki φ(n/d - i) with one knot every d samples (Ritz–Galerkin); all sums over samples stay exact. The
# error is that of the best spline, 2.4 (dω_h/π)^2p with ω_h half the bandwidth in rad/sample; the rounding error falls
# from ε/ω_h^2p to ε/(dω_h)^2p. With d from `samples_per_cell`, both are about 1e-8.


DEGREE = 5
"""Degree of the spline: 2p - 1 for p = 3, as an error of order 2p requires; more than needed for p = 2."""
PIECES = DEGREE + 1
CELL_ANGLE = {2: 0.0234, 3: 0.0993}
"""d·ω_h for two and three poles where truncation 2.4 (dω_h/π)^2p and rounding ~10 ε/(dω_h)^2p are equal."""
MAX_INT64_CELL = 2600
"""Largest d for which 66 d⁵, the maximum of 5! d⁵ φ, fits 64 bits; intermediate sums may wrap around harmlessly."""


def samples_per_cell(lowest_bandwidth: float, highest_bandwidth: float, p: int) -> int:
    """Return d; 0 for one pole and for bands too wide for a grid to save time. Bandwidths are in cycles per sample.

    The geometric mean of both bandwidths divides the loss evenly between truncation and rounding.
    """
    d = int(CELL_ANGLE.get(p, 0.0) / (np.pi * np.sqrt(lowest_bandwidth * highest_bandwidth)))
    return min(2**16, d) if d >= 3 else 0


def expected_error(lowest_bandwidth: float, highest_bandwidth: float, d: int, p: int) -> float:
    """Return the sum of truncation and rounding error for a given d, relative to the largest component."""
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
        Where each order is part of the data equation; None: everywhere.
    weights : array, (n_orders, n - p) or (n_orders, 1)
        r, for each row of the structural equation or constant.
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
        If the orders cannot be distinguished.
    """
    basis, differences = _sampled_basis(d, p)
    matrix, right = _data_terms(y, cycles, active, basis, mirror)
    unknown_weights = np.repeat(weights, 2, axis=0) / 2**0.5 if mirror else weights
    _add_structure(matrix, unknown_weights, differences, len(y), p)
    # A last knot at the last sample leaves a spline that vanishes on all samples.
    n_splines = -(-(len(y) - 1) // d) + DEGREE
    coefficients = _solve_spline_system(matrix[:, :n_splines], right[:n_splines])
    envelope = np.asarray(coefficients.view(np.complex128) if mirror else 2.0 * coefficients, dtype=np.complex128)
    return _sampled(envelope, basis, len(y), len(right))


def _sampled_basis(d: int, p: int) -> tuple[FloatArray, FloatArray]:
    """Return the B-splines' values in a cell, (d, 6), and their p-th differences, (d, 7).

    Column s belongs to the spline that began 5 - s cells earlier. Forward differences are used, so the last p rows of a
    cell reach into the spline that begins with the next cell (column 6). All numbers are integers: differences of
    rounded values would have few significant digits.
    """
    kind: Any = np.int64 if d < MAX_INT64_CELL else np.object_
    grid: Array = np.arange((PIECES + 2) * d).astype(kind)
    powers = grid * grid * grid * grid * grid
    spline: Array = np.zeros((PIECES + 2) * d, dtype=kind)  # one empty cell before, one after
    for i in range(PIECES + 1):
        spline[(i + 1) * d :] += (-1) ** i * comb(PIECES, i) * powers[: (PIECES + 1 - i) * d]
    difference = np.append(np.diff(spline, p), np.zeros(p, dtype=kind))
    scale = float(factorial(DEGREE) * d**DEGREE)

    def cells(values: Array) -> FloatArray:
        return values.astype(np.float64).reshape(-1, d)[::-1].T / scale

    return np.ascontiguousarray(cells(spline)[:, 1:-1]), np.ascontiguousarray(cells(difference)[:, 1:])


def _pairs(basis: FloatArray) -> tuple[NDArray[np.int64], FloatArray]:
    """Return all pairs s <= t of columns, (n_pairs, 2), and their products, (d, n_pairs)."""
    pairs = np.array(list(combinations_with_replacement(range(basis.shape[1]), 2)), dtype=np.int64)
    return pairs, basis[:, pairs[:, 0]] * basis[:, pairs[:, 1]]


def _chunks(d: int, n: int, n_rows: int) -> Iterator[tuple[int, int, slice]]:
    """Yield (first cell, one past the last, rows in them) for chunks of the cells that cover n samples."""
    n_cells, per_chunk = -(-n // d), max(1, 2**15 // d)
    for first in range(0, n_cells, per_chunk):
        last = min(first + per_chunk, n_cells)
        yield first, last, slice(first * d, max(first * d, min(last * d, n_rows)))


def _data_terms(
    y: FloatArray, cycles: FloatArray, active: BoolArray | None, basis: FloatArray, mirror: bool
) -> tuple[Array, Array]:
    """Return the contribution of the data equation to the normal equations of the coefficients.

    matrix[o, i, k, l] couples coefficient i + o of unknown k to coefficient i of unknown l; right[i, k]. The unknowns
    are x_k, or with mirror images the coefficients of cos and -sin of each order in turn. The matrix is real for one
    order: its own phasor cancels.
    """
    n_orders, n = cycles.shape
    d = len(basis)
    n_splines = -(-n // d) + PIECES
    pairs, products = _pairs(basis)
    n_unknowns = 2 * n_orders if mirror else n_orders
    is_real = mirror or n_orders == 1
    matrix = np.zeros((PIECES + 1, n_splines, n_unknowns, n_unknowns), np.float64 if is_real else np.complex128)
    right = np.zeros((n_splines, n_unknowns), np.float64 if mirror else np.complex128)
    square: FloatArray = np.zeros(0)
    for first, last, samples in _chunks(d, n, n):
        values, regressors = _padded_chunk(y, cycles, active, samples, (last - first, d), mirror=mirror)
        # If cos² + sin² is 1 throughout, its products are the same in every cell.
        whole = np.tile(products.sum(axis=0), (last - first, 1)) if active is None and last * d <= n else None
        # e_k* y on the right, e_k* e_m in the matrix; e is a phasor, or cos and -sin of each order in turn.
        for k, e_k in enumerate(regressors):
            for s, projected in enumerate(_summed(values * e_k.conj(), basis).T):
                right[first + s : first + s + len(projected), k] += projected
            for m, e_m in enumerate(regressors[:k]):
                _add_products(matrix, k, m, first, pairs, _summed(e_k.conj() * e_m, products))
            if whole is not None and np.iscomplexobj(e_k):
                square = whole
            elif whole is not None and k % 2:
                square = whole - square
            else:
                square = _summed(e_k.real**2 + e_k.imag**2 if np.iscomplexobj(e_k) else e_k * e_k, products)
            _add_products(matrix, k, k, first, pairs, square)
    return matrix, right


def _summed(samples: Array, columns: FloatArray) -> Array:
    """Return each cell's sums over its samples, weighted by real columns; avoids complex products with zeros."""
    if np.iscomplexobj(samples):
        return np.asarray(samples.real @ columns + 1j * (samples.imag @ columns))
    return np.asarray(samples @ columns)


def _padded_chunk(
    y: FloatArray, cycles: FloatArray, active: BoolArray | None, samples: slice, shape: tuple[int, int], *, mirror: bool
) -> tuple[FloatArray, list[Array]]:
    """Return the signal and the regressors as (cell, sample in it); zero past the end and where inactive.

    The regressors are phasors, or, with mirror images, Re(a e^{iΘ}) = u cos Θ - v sin Θ: cosine and minus sine of each
    order in turn.
    """
    length = samples.stop - samples.start
    values: FloatArray = np.zeros(shape)
    values.reshape(-1)[:length] = y[samples]
    regressors: list[Array] = []
    for k in range(len(cycles)):
        cosine, sine = np.zeros(shape), np.zeros(shape)
        cosine_and_sine(cycles[k, samples], cosine.reshape(-1)[:length], sine.reshape(-1)[:length])
        if active is not None:
            for part in (cosine, sine):
                part.reshape(-1)[:length] *= active[k, samples]
        regressors.extend((cosine, -sine) if mirror else (cosine + 1j * sine,))
    return values, regressors


def _add_structure(matrix: Array, weights: FloatArray, differences: FloatArray, n: int, p: int) -> None:
    """Add r²·(∇^p φ_i)(∇^p φ_j), summed over the rows that lie entirely within the signal."""
    d = len(differences)
    pairs, products = _pairs(differences)
    whole = products.sum(axis=0)
    for k, r in enumerate(weights):
        for first, last, rows in _chunks(d, n, n - p):
            if len(r) == 1 and rows.stop == last * d:
                grams = np.tile(r[0] ** 2 * whole, (last - first, 1))
            else:
                squares = np.zeros((last - first) * d)
                squares[: rows.stop - rows.start] = (r if len(r) == 1 else r[rows]) ** 2
                grams = squares.reshape(-1, d) @ products
            _add_products(matrix, k, k, first, pairs, grams)


def _add_products(matrix: Array, k: int, m: int, first: int, pairs: NDArray[np.int64], grams: Array) -> None:
    """Add each cell's products of pieces s <= t, (n_cells, n_pairs), to the entries of their splines.

    They go to matrix[t - s, cell + s] at unknowns k, m and, conjugated, at m, k; the first cell is `first`.
    """
    for (s, t), products in zip(pairs, grams.T, strict=True):
        cells = slice(first + s, first + s + len(products))
        matrix[t - s, cells, k, m] += products
        if m != k:
            matrix[t - s, cells, m, k] += products.conj()


def _solve_spline_system(matrix: Array, right: Array) -> Array:
    """Solve the Hermitian banded system by Cholesky factorisation; unknowns are ordered by spline, then by order.

    With a real matrix, real and imaginary parts of the right-hand side are solved as two right-hand sides.
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
            "the orders cannot be distinguished in this recording", remedy="leave one of them out or record longer"
        ) from None
    return np.ascontiguousarray(x).view(right.dtype).reshape(n_splines, n_orders)


def _sampled(coefficients: ComplexArray, basis: FloatArray, n: int, n_splines: int) -> ComplexArray:
    """Return the splines at all samples, (n_orders, n)."""
    d = len(basis)
    a = np.zeros((coefficients.shape[1], n_splines), np.complex128)
    a[:, : len(coefficients)] = coefficients.T
    x = np.empty((len(a), n), np.complex128)
    for k in range(len(a)):
        windows = np.lib.stride_tricks.sliding_window_view(a[k], PIECES)
        for first, last, samples in _chunks(d, n, n):
            parts = (windows.real[first:last] @ basis.T, windows.imag[first:last] @ basis.T)
            length = samples.stop - samples.start
            x.real[k, samples], x.imag[k, samples] = parts[0].reshape(-1)[:length], parts[1].reshape(-1)[:length]
    return x


def solve_band(
    data: Array,
    observed: Array,
    weights: FloatArray,
    stencils: FloatArray,
    *,
    triangle_bytes: int = 256 * 2**20,
) -> Array:
    """Minimise Σ_n |b_n - Σ_k d_kn x_kn|² + Σ_k Σ_n w_kn² |Σ_i s_kni x_k(n+i)|².

    Parameters
    ----------
    data : array, (n_orders, n), real or complex
        d.
    observed : array, (n,)
        b; the solution has its type.
    weights : array, (n_orders, n - p)
        w.
    stencils : array, (n_orders, n - p, p + 1)
        s.
    triangle_bytes : int
        Memory for the triangle. Longer problems store it in parts and compute each part a second time, backwards.

    Returns
    -------
    array, (n_orders, n)

    Raises
    ------
    RefusalError
        If the orders cannot be distinguished.
    """
    n_orders, n = data.shape
    p = stencils.shape[2] - 1
    width = (p + 1) * n_orders
    per_part = max(p + 1, int(triangle_bytes / (n_orders * width * data.itemsize)))
    starts = np.arange(0, n, per_part)
    rows = (min(per_part, n) + p) * n_orders
    triangle, right = np.empty((rows, width), data.dtype), np.empty(rows, observed.dtype)
    heads = np.zeros((len(starts) + 1, p * n_orders, width), data.dtype)
    head_rights = np.zeros((len(starts) + 1, p * n_orders), observed.dtype)

    def forwards(i: int) -> Any:
        """Start part i with the rows left over from the previous part; return the number of rows of its own."""
        start, stop = starts[i], min(starts[i] + per_part, n)
        triangle[:], right[:] = 0, 0
        triangle[: p * n_orders], right[: p * n_orders] = heads[i], head_rights[i]
        rotate(triangle, right, start, stop, data, observed, weights, stencils)
        return (stop - start) * n_orders

    for i in range(len(starts)):
        used = forwards(i)
        heads[i + 1], head_rights[i + 1] = triangle[used : used + p * n_orders], right[used : used + p * n_orders]
    x = np.zeros((n + p, n_orders), observed.dtype)
    for i in range(len(starts) - 1, -1, -1):
        used = used if i == len(starts) - 1 else forwards(i)
        if not _substitute(triangle, right, x.reshape(-1)[starts[i] * n_orders :], used):
            raise RefusalError("the orders cannot be distinguished in this recording", remedy="leave one of them out")
    return np.ascontiguousarray(x[:n].T)


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator,unused-ignore]
def _substitute(triangle: Array, right: Array, x: Array, n: int) -> bool:
    """Solve the triangle backwards for x[:n], given x[n:]; False if a diagonal is zero."""
    width = triangle.shape[1]
    for j in range(n - 1, -1, -1):
        if triangle[j, 0].real == 0.0:
            return False
        remainder = right[j]
        for m in range(1, min(width, len(x) - j)):
            remainder -= triangle[j, m] * x[j + m]
        x[j] = remainder / triangle[j, 0].real
    return True


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator,unused-ignore]
def rotate(
    triangle: Array,
    right: Array,
    start: int,
    stop: int,
    data: Array,
    observed: Array,
    weights: FloatArray,
    stencils: FloatArray,
) -> None:
    """Rotate the data row and the structural rows of each sample from start to stop into the triangle.

    Rows are rotated one by one into a banded triangle (square-root information filter). The normal equations, whose
    condition number would be squared, are never formed: the error is about r times the rounding error, not r².

    J. A. George, M. T. Heath, "Solution of sparse linear least squares problems using Givens rotations", 1980.
    """
    n_orders, n = data.shape
    p = stencils.shape[2] - 1
    row = np.zeros(triangle.shape[1], dtype=triangle.dtype)
    nothing = observed[0] * 0
    for t in range(start, stop):
        first = (t - start) * n_orders
        row[:] = 0
        for k in range(n_orders):
            row[k] = data[k, t]
        _insert(triangle, right, first, row, observed[t])
        if t + p >= n:
            continue
        for k in range(n_orders):
            row[:] = 0
            for i in range(p + 1):
                row[i * n_orders + k] = weights[k, t] * stencils[k, t, i]
            _insert(triangle, right, first, row, nothing)


@njit(cache=True, nogil=True, inline="always")  # type: ignore[untyped-decorator,unused-ignore]
def _insert(triangle: Array, right: Array, first: int, row: Array, value: Any) -> None:
    """Rotate one row, with its right-hand side, into the triangle; the first empty row takes the remainder.

    With diagonal d (real) of triangle row R and leading entry v_c of the row: h² = d² + |v_c|²,
    R' = (d R + v_c* v)/h, v' = (d v - v_c R)/h.
    """
    width = len(row)
    for c in range(width):
        lead = row[c]
        size2 = lead.real * lead.real + lead.imag * lead.imag
        if size2 == 0.0:
            continue
        j = first + c
        diagonal = triangle[j, 0].real
        h = np.sqrt(diagonal * diagonal + size2)
        cosine = diagonal / h
        sine = lead / h
        turned = np.conj(sine)
        for m in range(c, width):
            old, new = triangle[j, m - c], row[m]
            triangle[j, m - c] = cosine * old + turned * new
            row[m] = cosine * new - sine * old
        old_right = right[j]
        right[j] = cosine * old_right + turned * value
        value = cosine * value - sine * old_right
        if diagonal == 0.0:
            return
