"""Vold–Kalman beside scipy's sparse solve of the same textbook problem, on 10⁶ samples at 20 kHz.

Run: python tests/benchmarks/bench_vold_kalman.py. One core; ratios of processor time, the best of interleaved rounds.
Errors against the exact solution: in closed form for one order, by orthogonal rotations sample by sample for two and
for the first generation. For information, LAPACK's banded solver (`scipy.linalg.solveh_banded`), given the finished
band, and `track_vold_kalman` as a whole: checks, phases, envelope, waveform, residual.
"""

import os
import sys
from pathlib import Path
from typing import Any

import numpy as np
from interleaved import best_of, peak_mb
from scipy import sparse
from scipy.linalg import LinAlgError, solveh_banded
from scipy.sparse.linalg import spsolve

sys.path.insert(0, str(Path(__file__).parents[2]))

from gearsig.orders import (
    track_vold_kalman,
)
from gearsig.orders.vold_kalman import (
    solve_band,
    solve_envelopes,
    solve_waveforms,
    waveform_weight,
)
from tests.orders.test_vold_kalman_exact import (
    RATE_HZ,
    differences,
    exact_envelope,
    modulated_order,
    textbook_matrix,
    weight_of,
)

N = 10**6
ROUNDS = 3


def _coupled_matrix(phasors: Any, r: float, p: int) -> Any:
    """Return the textbook matrix of several orders: R on the diagonal, C_k* C_m beside it."""
    n = phasors.shape[1]
    own = textbook_matrix(n, r, p)
    blocks = [
        [own if k == m else sparse.diags(phasors[k].conj() * phasors[m]) for m in range(len(phasors))]
        for k in range(len(phasors))
    ]
    matrix = sparse.block_array(blocks, format="csc")
    order = np.arange(n * len(phasors)).reshape(len(phasors), n).T.ravel()  # by sample: a narrow band
    return matrix[order][:, order]


def _band(matrix: Any, p: int) -> Any:
    """Return the lower band of a symmetric matrix, as LAPACK takes it."""
    n = matrix.shape[0]
    return np.stack([np.append(matrix.diagonal(-i), np.zeros(n - len(matrix.diagonal(-i)))) for i in range(p + 1)])


def _banded(band: Any, parts: Any) -> Any:
    """Solve by LAPACK; None where it finds the matrix not positive definite, which rounding makes of narrow bands."""
    try:
        return solveh_banded(band, parts, lower=True, check_finite=False)
    except LinAlgError:
        return None


def _one_order(y: Any, cycles: Any, z: Any, bandwidth_hz: float, p: int) -> None:
    r = weight_of(bandwidth_hz, p)
    widths = np.array([[bandwidth_hz / RATE_HZ]])
    band = _band(textbook_matrix(len(y), r, p), p)
    parts = np.stack([z.real, z.imag], axis=1)
    (ours_s, ours), (mirror_s, _), (scipy_s, theirs), (banded_s, banded) = best_of(
        ROUNDS,
        lambda: solve_envelopes(y, cycles[None], None, widths, p, mirror=False)[0],
        lambda: solve_envelopes(y, cycles[None], None, widths, p)[0],
        lambda: spsolve(textbook_matrix(len(y), r, p), z),
        lambda: _banded(band, parts),
    )
    beside_banded = (
        f"{banded_s / ours_s:4.1f} times than solveh_banded" if banded is not None else "solveh_banded fails"
    )
    exact = exact_envelope(z, r, p)
    error, scipy_error = np.abs(ours / 2 - exact).max(), np.abs(theirs - exact).max()
    print(
        f"one order, {p} pole(s), {bandwidth_hz:5.1f} Hz: {scipy_s / ours_s:6.0f} times faster than spsolve "
        f"({scipy_s / mirror_s:4.0f} with the mirror image), {beside_banded}; "
        f"error {error:.1e}, spsolve {scipy_error:.1e}; {1e3 * ours_s:.1f} ms ({1e3 * mirror_s:.1f} ms)"
    )


def _two_orders(n: int, bandwidth_hz: float, p: int, *, exact: bool) -> None:
    y, cycles, _ = modulated_order(n)
    both = np.stack([cycles, 80 * np.arange(n) / RATE_HZ])  # crosses the rising order
    y = y + np.cos(2 * np.pi * both[1] + 1)
    r, widths = weight_of(bandwidth_hz, p), np.full((2, 1), bandwidth_hz / RATE_HZ)
    phasors = np.exp(2j * np.pi * both)
    right = (phasors.conj() * y).T.ravel()
    (ours_s, ours), (mirror_s, _), (scipy_s, theirs) = best_of(
        ROUNDS,
        lambda: solve_envelopes(y, both, None, widths, p, mirror=False),
        lambda: solve_envelopes(y, both, None, widths, p),
        lambda: spsolve(_coupled_matrix(phasors, r, p), right).reshape(-1, 2).T,
    )
    print(
        f"two crossing orders, {n} samples, {p} pole(s), {bandwidth_hz:5.1f} Hz: {scipy_s / ours_s:6.0f} times faster "
        f"({scipy_s / mirror_s:4.0f} with mirror images); spsolve differs by {np.abs(theirs - ours / 2).max():.1e}"
    )
    if exact:
        weights = np.full((2, n - p), r)
        x = solve_band(phasors, y + 0j, weights, differences(p, weights.shape))
        print(f"    error against rotations sample by sample: {np.abs(ours / 2 - x).max():.1e}")


def _first_generation(y: Any, cycles: Any, bandwidth_hz: float) -> None:
    n = len(y)
    frequency = (cycles[2:] - cycles[:-2]) / 2
    r = waveform_weight(np.array([bandwidth_hz / RATE_HZ]), frequency)

    def textbook() -> Any:
        a = sparse.diags(
            [np.ones(n - 2), -2 * np.cos(2 * np.pi * frequency), np.ones(n - 2)], [0, 1, 2], shape=(n - 2, n)
        )
        ra = sparse.diags(r) @ a
        return spsolve((sparse.eye(n) + ra.T @ ra).tocsc(), y)

    widths = np.array([[bandwidth_hz / RATE_HZ]])
    (ours_s, ours), (scipy_s, theirs) = best_of(
        ROUNDS, lambda: solve_waveforms(y, cycles[None], None, widths)[0], textbook
    )
    stencils = np.ones((1, n - 2, 3))
    stencils[0, :, 1] = -2 * np.cos(2 * np.pi * frequency)
    exact = solve_band(np.ones((1, n)), y, r[None], stencils)[0]
    print(
        f"first generation, one order, {bandwidth_hz:5.1f} Hz: {scipy_s / ours_s:6.0f} times faster than spsolve; "
        f"error {np.abs(ours - exact).max():.1e}, spsolve {np.abs(theirs - exact).max():.1e}; {1e3 * ours_s:.1f} ms"
    )


def _whole_call(y: Any, cycles: Any) -> None:
    """Print the whole call's time beside spsolve alone."""
    tracks = [np.gradient(cycles) * RATE_HZ]
    z = y * np.exp(-2j * np.pi * cycles)
    r = weight_of(2.0, 2)
    (second_s, _), (first_s, _), (scipy_s, _) = best_of(
        ROUNDS,
        lambda: track_vold_kalman(y, RATE_HZ, tracks, bandwidth_hz=2.0),
        lambda: track_vold_kalman(y, RATE_HZ, tracks, bandwidth_hz=2.0, generation="first"),
        lambda: spsolve(textbook_matrix(len(y), r, 2), z),
    )
    print(
        f"track_vold_kalman as a whole, mirror image included: {scipy_s / second_s:4.0f} times faster than spsolve "
        f"alone, first generation {scipy_s / first_s:4.0f} times; {1e3 * second_s:.0f} and {1e3 * first_s:.0f} ms"
    )


def main() -> None:
    """Print one line per case."""
    print(f"load of the machine: {os.getloadavg()[0]:.1f}")
    y, cycles, z = modulated_order(N)
    for bandwidth_hz in (2.0, 0.5):
        for p in (2, 3, 1):
            _one_order(y, cycles, z, bandwidth_hz, p)
    for p in (2, 3, 1):
        _one_order(y, cycles, z, 200.0, p)
    for bandwidth_hz in (2.0, 0.5):
        _first_generation(y, cycles, bandwidth_hz)
    _whole_call(y, cycles)
    _two_orders(10**5, 2.0, 2, exact=True)
    _two_orders(10**5, 0.5, 2, exact=True)
    if "--long" in sys.argv:
        _two_orders(N, 2.0, 2, exact=False)
    print(f"peak memory of this process: {peak_mb() / 1e3:.2f} GB")


if __name__ == "__main__":
    main()
