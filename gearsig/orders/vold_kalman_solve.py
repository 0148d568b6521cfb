"""Envelopes and waveforms of orders by the Vold–Kalman filter, from plain arrays; which solver suits which problem."""

from __future__ import annotations

from math import comb
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from gearsig.checks import FloatArray
from gearsig.orders.vold_kalman_closeness import closeness
from gearsig.orders.vold_kalman_splines import (
    BoolArray,
    ComplexArray,
    expected_error,
    samples_per_cell,
    solve_by_splines,
)
from gearsig.orders.vold_kalman_weight import HALF_POWER, envelope_weight, waveform_weight

Way = Literal["splines", "elimination", "rotations"]

STRONGEST_ELIMINATED = 1.5e5
"""r·|D| up to which the normal equations are solved: their rounding error is below 5e-7 there."""
SMALLEST_CELL = 3
"""Samples. Below, the band is so wide that the coarse grid saves nothing, and elimination loses no digits."""

CHEAP_CELL, MOST_TOGETHER = 16, 8
"""Samples per cell from which, and orders up to which, the coarse grid is faster than several solutions (trials)."""
ACCURATE = 1e-7
ENOUGH = 5e-7
"""Expected error up to which the fastest way is taken."""


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
        from gearsig.orders.vold_kalman_alone import envelope_alone

        return envelope_alone(y, cycles[0], None if active is None else active[0], weights[0], p, mirror=mirror)[None]
    way, _ = chosen_way(bandwidths, p, closeness(cycles, active, bandwidths, p))
    if way == "splines":
        return solve_by_splines(y, cycles, active, weights, p, cell_of(bandwidths, p), mirror=mirror)
    weights = np.broadcast_to(weights, (len(cycles), n - p))
    solve = _solved_with_mirror_images if mirror else _solved_as_in_textbooks
    return solve(y, cycles, active, weights, p, way)


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
        from gearsig.orders.vold_kalman_alone import waveform_alone

        return waveform_alone(y, cycles[0], None if active is None else active[0], width[0])[None]
    frequency = (cycles[:, 2:] - cycles[:, :-2]) / 2.0
    # Outside the active part the order may stand still: any finite weight does there.
    inside = np.clip(frequency, 0.75 * width, 0.5 - 0.75 * width)
    stencils = np.ones((*frequency.shape, 3))
    stencils[:, :, 1] = -2.0 * np.cos(2.0 * np.pi * frequency)
    data = np.ones(cycles.shape) if active is None else active.astype(np.float64)
    weights = waveform_weight(width, inside)
    # |D|, the largest gain of the stencil, is 2^p for differences and for the first generation at most that.
    way = _sample_by_sample(4.0 * float(weights.max()), closeness(cycles, active, bandwidths, 2))[0]
    return solve_sample_by_sample(data, y.astype(np.float64), weights, stencils, way)


def solve_sample_by_sample(
    data: NDArray[Any], observed: NDArray[Any], weights: FloatArray, stencils: FloatArray, way: Way
) -> NDArray[Any]:
    """Solve a banded least-squares problem by elimination or rotations."""
    from gearsig.orders.vold_kalman_band import solve_band
    from gearsig.orders.vold_kalman_elimination import eliminate
    from gearsig.orders.vold_kalman_rotations import rotate

    return solve_band(data, observed, weights, stencils, forward=eliminate if way == "elimination" else rotate)


def cell_of(bandwidths: FloatArray, p: int) -> int:
    """Return the samples per cell of the coarse grid; 0 where the problem is solved sample by sample."""
    d = samples_per_cell(float(bandwidths.min()), float(bandwidths.max()), p)
    return d if d >= SMALLEST_CELL else 0


def chosen_way(bandwidths: FloatArray, p: int, close: float) -> tuple[Way, float]:
    """Return how several orders of the second generation are solved for, and the expected error.

    Relative to the largest component of the signal; `close` is the factor of `closeness`.
    """
    d = cell_of(bandwidths, p)
    ways = [_sample_by_sample(2.0**p * float(envelope_weight(bandwidths.min()[None], p)[0]), close)]
    if d:
        ways.insert(0, ("splines", close * expected_error(float(bandwidths.min()), float(bandwidths.max()), d, p)))
    return next((way for way in ways if way[1] <= ENOUGH), min(ways, key=lambda way: way[1]))


def _sample_by_sample(strength: float, close: float) -> tuple[Way, float]:
    """Return elimination or rotations and their error for r·|D|, the former's growing with its square (trials)."""
    elimination, rotations = 2e-17 * strength**2 * close, 1e-15 * strength * close**0.5
    if strength <= STRONGEST_ELIMINATED and elimination <= max(ENOUGH, rotations):
        return "elimination", elimination
    return "rotations", rotations


def accuracy_of(cycles: FloatArray, active: BoolArray | None, bandwidths: FloatArray, p: int) -> float:
    """Return the expected error of `solve_envelopes`, relative to the largest component of the signal."""
    if len(bandwidths) == 1:
        return error_alone(bandwidths)
    return chosen_way(bandwidths, p, closeness(cycles, active, bandwidths, p))[1]


def cheap_together(cycles: FloatArray, active: BoolArray | None, bandwidths: FloatArray, p: int) -> bool:
    """Return whether one solution of the second generation for all orders takes less time than several for groups."""
    few = 1 < len(bandwidths) <= MOST_TOGETHER
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
    from gearsig.orders.vold_kalman_phasor import write_envelope

    a = np.empty(x.shape, np.complex128)
    for waveform, angle, envelope in zip(x, cycles, a, strict=True):
        write_envelope(np.ascontiguousarray(waveform), np.ascontiguousarray(angle), envelope)
    return a


def phasors_of(cycles: FloatArray) -> ComplexArray:
    """Return e^{2πi c}, (n_orders, n)."""
    from gearsig.orders.vold_kalman_phasor import write_phasors

    phasors = np.empty(cycles.shape, np.complex128)
    for row, angle in zip(phasors, cycles, strict=True):
        write_phasors(np.ascontiguousarray(angle), row)
    return phasors


def _solved_with_mirror_images(
    y: FloatArray, cycles: FloatArray, active: BoolArray | None, weights: FloatArray, p: int, way: Way
) -> ComplexArray:
    """Sample by sample, for the real coefficients u, v of cos and -sin: u + iv = 2x, with weight r/√2 each."""
    data = np.empty((2 * len(cycles), len(y)))
    for k in range(len(cycles)):
        phasor = phasors_of(cycles[k : k + 1])[0]
        data[2 * k], data[2 * k + 1] = phasor.real, -phasor.imag
    if active is not None:
        data *= np.repeat(active, 2, axis=0)
    weights = np.repeat(weights, 2, axis=0) / 2**0.5
    x = solve_sample_by_sample(data, y.astype(np.float64), weights, _differences(weights, p), way)
    return np.asarray(x[::2] + 1j * x[1::2], dtype=np.complex128)


def _solved_as_in_textbooks(
    y: FloatArray, cycles: FloatArray, active: BoolArray | None, weights: FloatArray, p: int, way: Way
) -> ComplexArray:
    """Sample by sample, for the complex x."""
    data: NDArray[Any] = phasors_of(cycles)
    if active is not None:
        data *= active
    x = solve_sample_by_sample(data, y.astype(np.complex128), weights, _differences(weights, p), way)
    return np.asarray(2.0 * x, dtype=np.complex128)


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
