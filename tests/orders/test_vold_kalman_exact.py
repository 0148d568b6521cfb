"""The solvers against exact solutions: closed form by poles for constant weighting, dense solves for the rest."""

from functools import cache
from math import comb
from typing import Any

import numpy as np
import pytest
import scipy.sparse as sp
from scipy import sparse
from scipy.signal import lfilter
from scipy.sparse.linalg import splu, spsolve

from gearsig.checks import FloatArray
from gearsig.errors import RefusalError
from gearsig.orders.vold_kalman import (
    accuracy_of,
    envelope_alone,
    envelope_weight,
    expected_error,
    rounding_growth,
    samples_per_cell,
    single_order_error,
    solve_band,
    solve_by_splines,
    solve_envelopes,
    solve_waveforms,
    waveform_alone,
    waveform_weight,
)
from gearsig.orders.vold_kalman import oscillator as write_oscillator

RATE_HZ = 20_000.0


def weight_of(bandwidth_hz, p):
    return float(envelope_weight(np.array([bandwidth_hz / RATE_HZ]), p)[0])


def exact_envelope(z, r, p):
    """Solve (1 + r² AᵀA) x = z for constant r, A the p-th difference without any rows beyond the ends.

    1/(1 + r² s^p) = 1/p Σ_k 1/(1 - s/s_k), s = 2 - ζ - 1/ζ: each term is a two-sided exponential ζ_k^|n|. The ends add
    exponentials that decay inwards; their sizes follow from A x = 0 at the p places before the first row, and its first
    p - 1 differences, in closed form. Poles are kept as 1 - ζ, so that no digits are lost.
    """
    s = r ** (-2 / p) * np.exp(1j * np.pi * (2 * np.arange(p) + 1) / p)
    root = np.sqrt(s * s - 4 * s)
    delta = np.where(abs(1 - (s + root) / 2) < 1, (s + root) / 2, (s - root) / 2)
    zeta, log_zeta = 1 - delta, np.log1p(-delta)
    gain = -s * zeta / (1 - zeta**2) / p
    z = np.asarray(z, dtype=complex)
    x, at_left, at_right = np.zeros_like(z), [], []
    for g, pole in zip(gain, zeta, strict=True):
        forwards = lfilter([g], [1, -pole], z)
        backwards = lfilter([g], [1, -pole], z[::-1])[::-1]
        x += forwards + backwards - g * z
        at_left.append(backwards[0])
        at_right.append(forwards[-1])
    far = np.exp(log_zeta * (len(z) - 1))
    j = np.arange(p)[:, None]
    scale = abs(delta[0]) ** -(p + j)
    inwards = (delta / zeta) ** p * (-delta) ** j * zeta * scale  # of ζ^m, m counted outwards from the end
    outwards = (-delta) ** p * (delta / zeta) ** j / zeta * scale  # of ζ^-m
    matrix = np.block([[outwards, inwards * far], [inwards * far, outwards]])
    amplitudes = np.linalg.solve(matrix, -np.concatenate([inwards @ at_left, inwards @ at_right]))
    n = np.arange(len(z))
    for k in range(p):
        x += amplitudes[k] * np.exp(log_zeta[k] * n) + amplitudes[p + k] * np.exp(log_zeta[k] * n[::-1])
    return x


def textbook_matrix(n, r, p):
    stencil = [(-1.0) ** (p - i) * comb(p, i) for i in range(p + 1)]
    a = sparse.diags(stencil, range(p + 1), shape=(n - p, n))
    return (sparse.eye(n) + r * r * (a.T @ a)).tocsc()


def by_dense_least_squares(data, observed, weights, stencils):
    """The stacked rows by LAPACK's orthogonal factorisation: their condition is r, not r²."""
    n_orders, n = data.shape
    p = stencils.shape[2] - 1
    rows = np.zeros((n + n_orders * (n - p), n, n_orders), complex)
    for t in range(n):
        rows[t, t] = data[:, t]
    for k in range(n_orders):
        for t in range(n - p):
            rows[n + k * (n - p) + t, t : t + p + 1, k] = weights[k, t] * stencils[k, t]
    right = np.concatenate([observed, np.zeros(n_orders * (n - p))])
    x = np.linalg.lstsq(rows.reshape(len(rows), -1), right, rcond=1e-15)[0]
    return x.reshape(n, n_orders).T


@cache
def modulated_order(n):
    """Two orders in a run-up, and noise; demodulated with the first."""
    t = np.arange(n) / RATE_HZ
    cycles = 50 * t + 10 * t**2 * RATE_HZ / n
    y = (1 + 0.3 * np.cos(2 * np.pi * 0.3 * t)) * np.cos(2 * np.pi * cycles) + 0.5 * np.cos(3 * np.pi * cycles)
    y += 0.3 * np.random.default_rng(0).normal(size=n)
    return y, cycles, y * np.exp(-2j * np.pi * cycles)


def differences(p, shape):
    return np.broadcast_to([(-1.0) ** (p - i) * comb(p, i) for i in range(p + 1)], (*shape, p + 1))


@pytest.mark.parametrize("p", [1, 2, 3])
def test_the_closed_form_solves_the_textbook_matrix(p):
    """At a wide band, where the sparse solve is good."""
    z = modulated_order(3001)[2]
    r = weight_of(800.0, p)
    x = exact_envelope(z, r, p)
    assert abs(x - spsolve(textbook_matrix(len(z), r, p), z)).max() < 1e-9


@pytest.mark.parametrize("p", [1, 2, 3])
@pytest.mark.parametrize("bandwidth_hz", [0.5, 2.0, 20.0, 200.0])
@pytest.mark.parametrize("n", [50_000, pytest.param(100_001, marks=pytest.mark.slow)])
def test_constant_bandwidth(p, bandwidth_hz, n):
    y, cycles, z = modulated_order(n)
    r = weight_of(bandwidth_hz, p)
    x = solve_envelopes(y, cycles[None], None, np.array([[bandwidth_hz / RATE_HZ]]), p, mirror=False)[0]
    assert abs(x - 2 * exact_envelope(z, r, p)).max() < 1e-10


@pytest.mark.parametrize("bandwidth_hz", [0.5, 2.0])
def test_the_textbook_solve_is_what_loses_digits(bandwidth_hz):
    """The reason for all this: the sparse solve is off by 1e-4 and more where the closed form and ours agree."""
    z = modulated_order(20_000)[2]
    r = weight_of(bandwidth_hz, 2)
    assert abs(spsolve(textbook_matrix(len(z), r, 2), z) - exact_envelope(z, r, 2)).max() > 1e-4


@pytest.mark.parametrize("p", [2, 3])
@pytest.mark.parametrize("n", range(3000, 3024))
def test_any_length(p, n):
    """The last cell of the coarse grid may hold one sample or all."""
    y, cycles, z = modulated_order(n)
    bandwidth_hz = {2: 7.4, 3: 32.0}[p]
    d = samples_per_cell(bandwidth_hz / RATE_HZ, bandwidth_hz / RATE_HZ, p)
    assert d in {19, 20}
    r = weight_of(bandwidth_hz, p)
    x = solve_by_splines(y, cycles[None], None, np.array([[r]]), p, d, mirror=False)[0]
    assert abs(x - 2 * exact_envelope(z, r, p)).max() < 3e-7


def crossing(n):
    """Return a signal, and phases of two orders that cross in the middle."""
    t = np.linspace(0, 1, n)
    cycles = np.stack([0.01 * n * t + 0.005 * n * t**2, 0.02 * n * t - 0.005 * n * t**2])
    y = np.cos(2 * np.pi * cycles[0]) + 0.5 * np.sin(2 * np.pi * cycles[1])
    return y + 0.1 * np.random.default_rng(1).normal(size=n), cycles


@pytest.mark.parametrize("p", [1, 2, 3])
def test_sample_by_sample_against_a_dense_solve(p):
    """Two orders, varying weights, parts left out."""
    y, cycles = crossing(120)
    active = np.ones((2, 120))
    active[0, 30:40] = active[1, 95:] = 0.0
    bandwidths = 0.05 * np.stack([np.linspace(1, 3, 120), np.full(120, 0.7)])
    weights = envelope_weight(bandwidths[:, : 120 - p], p)
    data = np.exp(2j * np.pi * cycles) * active
    arguments = (data, y + 0j, weights, differences(p, weights.shape))
    expected = by_dense_least_squares(*arguments)
    assert abs(solve_band(*arguments) - expected).max() < 1e-9
    few_rows = 30 * data.itemsize * 2 * (p + 1)
    assert abs(solve_band(*arguments, triangle_bytes=few_rows) - expected).max() < 1e-9


@pytest.mark.parametrize("p", [2, 3])
@pytest.mark.parametrize("n", [4000, 4001])
@pytest.mark.parametrize("mirror", [False, True])
def test_splines_against_rotations(p, n, mirror):
    """Two independent solvers: crossing orders, varying bandwidth, parts left out; mirror images as further orders."""
    y, cycles = crossing(n)
    active = np.ones((2, n), dtype=bool)
    active[0, :300] = active[1, 3100:3300] = False
    bandwidths = np.stack([np.linspace(1, 3, n), np.full(n, 1.5)]) * 1e-3
    weights = envelope_weight(bandwidths[:, p // 2 : n - p + p // 2], p)
    data = np.exp(2j * np.pi * cycles) * active
    if mirror:
        data, weights = np.concatenate([data, data.conj()]), np.concatenate([weights, weights])
    expected = solve_band(data, y + 0j, weights, differences(p, weights.shape))
    d = samples_per_cell(1e-3, 3e-3, p)
    assert d >= 4
    x = solve_by_splines(y, cycles, active, weights[:2], p, d, mirror=mirror)
    assert np.abs(x - 2 * expected[:2])[active].max() < 1e-6
    # They stay close for long: the splines' error grows, and rotations may be taken instead.
    chosen = solve_envelopes(y, cycles, active, bandwidths, p, mirror=mirror)
    assert np.abs(chosen - 2 * expected[:2])[active].max() < 1e-7


@pytest.mark.parametrize("p", [1, 2, 3])
def test_mirror_images_sample_by_sample(p):
    """A wide band, where no coarse grid is used."""
    y, cycles = crossing(500)
    cycles = 10 * cycles
    active = np.ones((2, 500), dtype=bool)
    active[0, :30] = False
    data = np.exp(2j * np.pi * cycles) * active
    weights = np.full((4, 500 - p), envelope_weight(np.array([0.05]), p)[0])
    expected = solve_band(np.concatenate([data, data.conj()]), y + 0j, weights, differences(p, weights.shape))
    x = solve_envelopes(y, cycles, active, np.full((2, 1), 0.05), p)
    assert np.abs(x - 2 * expected[:2])[active].max() < 1e-8


@pytest.mark.parametrize(("p", "ratio"), [(2, 1.0), (2, 30.0), (3, 10.0)])
def test_expected_error(p, ratio):
    """Widths that differ by `ratio` along the signal: the splines' estimate holds, and is not above a hundredfold."""
    y, cycles, z = modulated_order(60_000)
    widths = np.linspace(1.0, ratio, len(y))[None] * 1e-4
    weights = envelope_weight(widths[:, p // 2 : len(y) - p + p // 2], p)
    expected = solve_band(np.ones((1, len(y))), z, weights, differences(p, weights.shape))
    d = samples_per_cell(widths.min(), widths.max(), p)
    x = solve_by_splines(y, cycles[None], None, weights, p, d, mirror=False)
    # Rotations have an error of their own, some rounding steps times r·2^p.
    error = np.abs(x - 2 * expected).max() - 5e-17 * weights.max() * 2**p
    allowed = expected_error(widths.min(), widths.max(), d, p)
    assert error < 2 * allowed
    assert allowed < {1.0: 1e-7, 10.0: 1e-5, 30.0: 2e-5}[ratio]


def test_first_generation_against_a_dense_solve():
    y, cycles = crossing(150)
    cycles = cycles * 5
    y = y + np.cos(2 * np.pi * cycles[0])
    x = solve_waveforms(y, cycles, None, np.array([[0.01], [0.02]]))
    frequency = (cycles[:, 2:] - cycles[:, :-2]) / 2
    stencils = np.ones((2, 148, 3))
    stencils[:, :, 1] = -2 * np.cos(2 * np.pi * frequency)
    weights = waveform_weight(np.array([[0.01], [0.02]]), frequency)
    expected = by_dense_least_squares(np.ones((2, 150)), y, weights, stencils)
    assert abs(x - expected).max() < 1e-10


@pytest.mark.parametrize(("frequency_hz", "bandwidth_hz"), [(100.0, 2.0), (100.0, 0.5), (20.0, 2.0), (3000.0, 0.5)])
def test_first_generation_at_constant_frequency(frequency_hz, bandwidth_hz):
    """A sine off the order's frequency, away from the ends: gain 1/(1 + r²(2 cos ω' - 2 cos ω)²)."""
    n = round(10 * RATE_HZ / bandwidth_hz)
    r = waveform_weight(np.array([bandwidth_hz / RATE_HZ]), np.array([frequency_hz / RATE_HZ]))[0]
    for offset in (0.0, 0.3, 2.0):
        omega = 2 * np.pi * (frequency_hz + offset * bandwidth_hz) / RATE_HZ
        gain = 1 / (1 + (r * (2 * np.cos(omega) - 2 * np.cos(2 * np.pi * frequency_hz / RATE_HZ))) ** 2)
        y = np.cos(omega * np.arange(n))
        x = solve_waveforms(y, frequency_hz / RATE_HZ * np.arange(n)[None], None, np.array([[bandwidth_hz / RATE_HZ]]))
        # What the free ends add decays as exp(-4.88 B t): after four of ten times 1/B, 3e-9 are left.
        middle = slice(2 * n // 5, 3 * n // 5)
        assert abs(x[0] - gain * y)[middle].max() < 1e-6


# One order by itself: the recursions against dense least squares, closed forms and rotations.


def oscillator(cycles, bandwidth):
    kappa, q = np.empty(len(cycles) - 2), np.empty(len(cycles) - 2)
    write_oscillator(cycles, bandwidth, kappa, q)
    return kappa, q


def noisy_order(n, cycles_per_sample=0.11):
    cycles = cycles_per_sample * np.arange(n) + 1e-4 * np.arange(n) ** 2
    return np.cos(2 * np.pi * cycles) + 0.3 * np.random.default_rng(4).normal(size=n), cycles


@pytest.mark.parametrize("p", [1, 2, 3])
@pytest.mark.parametrize("n", [16, 17, 49, 50])
@pytest.mark.parametrize("mirror", [False, True])
@pytest.mark.parametrize("gaps", [False, True])
def test_envelope_against_a_dense_solve(p, n, mirror, gaps):
    """Varying weights, parts left out (also at both ends), even and odd lengths."""
    y, cycles = noisy_order(n)
    active = np.ones(n, dtype=bool)
    if gaps:
        active[:4] = active[n // 3 : n // 3 + 3] = active[-3:] = False
    weights = envelope_weight(np.linspace(0.05, 0.2, n - p), p)
    phasor = np.exp(2j * np.pi * cycles) * active
    data = np.stack([phasor, phasor.conj()]) if mirror else phasor[None]
    all_weights = np.stack([weights] * len(data))
    expected = 2 * by_dense_least_squares(data, y + 0j, all_weights, differences(p, all_weights.shape))[0]
    x = envelope_alone(y, cycles, active if gaps else None, weights, p, mirror=mirror)
    assert x.shape == (n,)
    assert np.abs(x - expected).max() < 1e-9 * np.abs(expected).max()


@pytest.mark.parametrize("n", [16, 17, 49, 50])
@pytest.mark.parametrize("cycles_per_sample", [0.02, 0.25, 0.45])
@pytest.mark.parametrize("gaps", [False, True])
def test_waveform_against_a_dense_solve(n, cycles_per_sample, gaps):
    y, cycles = noisy_order(n, cycles_per_sample)
    active = np.ones(n, dtype=bool)
    if gaps:
        active[:4] = active[n // 3 : n // 3 + 3] = False
    bandwidth = np.linspace(0.004, 0.008, n - 2)
    frequency = (cycles[2:] - cycles[:-2]) / 2
    stencils = np.ones((1, n - 2, 3))
    stencils[0, :, 1] = -2 * np.cos(2 * np.pi * frequency)
    weights = waveform_weight(bandwidth, frequency)[None]
    expected = by_dense_least_squares(active[None].astype(float), y * active, weights, stencils)[0]
    x = waveform_alone(y, cycles, active if gaps else None, bandwidth)
    assert np.abs(x - expected).max() < 1e-9


@pytest.mark.parametrize("cycles_per_sample", [1e-4, 0.003, 0.2, 0.4997])
def test_waveform_of_a_narrow_band_against_rotations(cycles_per_sample):
    """Close to zero and to half the sampling rate; rotations are exact to about 1e-15 r."""
    n, bandwidth = 60_001, np.array([3e-5])
    cycles = cycles_per_sample * np.arange(n)
    y = np.cos(2 * np.pi * cycles) + 0.3 * np.random.default_rng(4).normal(size=n)
    kappa, q = oscillator(cycles, bandwidth)
    stencils = np.ones((1, n - 2, 3))
    stencils[0, :, 1] = kappa - 2
    weights = 1 / np.sqrt(q)[None]
    expected = solve_band(np.ones((1, n)), y, weights, stencils)[0]
    assert np.abs(waveform_alone(y, cycles, None, bandwidth) - expected).max() < 1e-14 * weights.max()


def test_oscillator():
    """κ and q are those of the closed forms."""
    cycles = np.concatenate([np.linspace(0, 30, 400), 30 + 0.43 * np.arange(1, 200)])
    frequency = (cycles[2:] - cycles[:-2]) / 2
    for bandwidth in (np.array([0.01]), np.linspace(0.01, 0.03, len(frequency))):
        kappa, q = oscillator(cycles, bandwidth)
        assert np.abs(kappa - (2 - 2 * np.cos(2 * np.pi * frequency))).max() < 1e-14
        assert np.allclose(q, waveform_weight(bandwidth, frequency) ** -2.0, rtol=1e-10, atol=0)
    standing = oscillator(np.zeros(10), np.array([0.01]))[1]
    assert np.allclose(standing, waveform_weight(np.array([0.01]), np.array([0.0075])) ** -2.0, rtol=1e-12, atol=0)


@pytest.mark.parametrize("p", [1, 2, 3])
@pytest.mark.parametrize("bandwidth", [1e-6, 1e-4, 0.1])
def test_no_digits_are_lost_in_narrow_bands(p, bandwidth):
    """The normal equations have the condition r² there, up to 1e36; the expected error holds."""
    y, cycles, z = modulated_order(200_001)
    r = envelope_weight(np.array([bandwidth]), p)
    error = np.abs(envelope_alone(y, cycles, None, r, p, mirror=False) - 2 * exact_envelope(z, r[0], p)).max()
    assert error < {1e-6: 1e-9, 1e-4: 1e-11, 0.1: 1e-11}[bandwidth]
    assert error < 2 * single_order_error(np.array([bandwidth]))


@pytest.mark.parametrize("p", [1, 2, 3])
@pytest.mark.parametrize("mirror", [False, True])
@pytest.mark.parametrize("n", [4_001, pytest.param(30_000, marks=pytest.mark.slow)])
def test_blocks_and_parts_make_no_difference(p, mirror, n):
    y, cycles = noisy_order(n)
    weights = envelope_weight(np.linspace(0.001, 0.01, n - p), p)
    expected = envelope_alone(y, cycles, None, weights, p, mirror=mirror)
    assert np.array_equal(envelope_alone(y, cycles, None, weights, p, mirror=mirror, gain_bytes=1), expected)
    shorter = envelope_alone(y, cycles, None, weights, p, mirror=mirror, gain_bytes=1, block_samples=501)
    assert np.array_equal(shorter, expected)


def test_no_data_at_all_is_refused():
    y, cycles = noisy_order(50)
    with pytest.raises(RefusalError, match="do not determine"):
        envelope_alone(y, cycles, np.zeros(50, dtype=bool), np.array([10.0]), 2, mirror=False)


# Orders closer than the filter is wide: the joint problem is worse conditioned, and still solved.

N = 3000
TIME_S = np.arange(N) / RATE_HZ


def refined_waveforms(y: FloatArray, cycles: FloatArray, bandwidth: float, p: int) -> FloatArray:
    """Solve [1 A; Aᵀ 0] [ρ x] = [b 0] with residuals in extended precision: no normal equations, no lost digits."""
    n_unknowns = 2 * len(cycles)
    difference = sp.eye(N, format="csr")
    for _ in range(p):
        difference = difference[1:] - difference[:-1]
    r = float(envelope_weight(np.full((1, 1), bandwidth), p)[0, 0]) / np.sqrt(2.0)
    turns = np.exp(2j * np.pi * cycles)
    data = [sp.diags(part) for turn in turns for part in (turn.real, -turn.imag)]
    smooth: list[Any] = [[r * difference if i == j else None for j in range(n_unknowns)] for i in range(n_unknowns)]
    rows: list[Any] = [data, *smooth]
    a: Any = sp.bmat(rows)
    m = sp.bmat([[sp.eye(a.shape[0]), a], [a.T, None]]).tocoo()
    solver = splu(m.tocsc())
    right = np.zeros(m.shape[0], np.longdouble)
    right[:N] = y
    x = np.zeros_like(right)
    for _ in range(6):
        residual = right.copy()
        np.subtract.at(residual, m.row, m.data.astype(np.longdouble) * x[m.col])
        x += solver.solve(residual.astype(np.float64))
    parts = x[a.shape[0] :].astype(np.float64).reshape(len(cycles), 2, N)
    return np.asarray(parts[:, 0] * turns.real - parts[:, 1] * turns.imag)


@pytest.mark.parametrize("p", [2, 3])
@pytest.mark.parametrize(("bandwidth_hz", "gap_hz"), [(100.0, 15.0), (200.0, 25.0), (400.0, 40.0)])
def test_close_orders_are_solved_as_exactly_as_stated(p: int, bandwidth_hz: float, gap_hz: float) -> None:
    cycles = np.stack([300.0 * TIME_S, (300.0 + gap_hz) * TIME_S])
    noise = 0.01 * np.random.default_rng(1).standard_normal(N)
    y = np.cos(2 * np.pi * cycles[0]) + 0.5 * np.cos(2 * np.pi * cycles[1] + 1.0) + noise
    widths = np.full((2, 1), bandwidth_hz / RATE_HZ)
    found = solve_envelopes(y, cycles, None, widths, p)
    error = np.abs((found * np.exp(2j * np.pi * cycles)).real - refined_waveforms(y, cycles, widths[0, 0], p)).max()
    assert error < 1e-7
    assert error < 3.0 * accuracy_of(cycles, None, widths, p) < 1e-5


def test_orders_that_cross_swiftly_or_lie_apart_are_not_close() -> None:
    widths = np.full((2, 1), 10.0 / RATE_HZ)
    apart = np.stack([300.0 * TIME_S, 315.0 * TIME_S])
    crossing = np.stack([300.0 * TIME_S, 100.0 * TIME_S + 0.5 * 2700.0 * TIME_S**2])
    assert rounding_growth(apart, None, widths, 2) == 1.0
    assert rounding_growth(crossing, None, widths, 2) == 1.0
    long_s = np.arange(20 * N) / RATE_HZ
    assert rounding_growth(np.stack([300.0 * long_s, 302.0 * long_s]), None, widths, 2) == pytest.approx(
        5.0**4, rel=1e-3
    )


@pytest.mark.parametrize(("bandwidth_hz", "slope_hz_per_s"), [(60.0, 40.0), (200.0, 200.0)])
def test_slow_crossings_are_solved_as_exactly_as_stated(bandwidth_hz: float, slope_hz_per_s: float) -> None:
    second = 300.0 * TIME_S + 0.5 * slope_hz_per_s * (TIME_S - TIME_S[N // 2]) ** 2
    cycles = np.stack([300.0 * TIME_S, second])
    y = np.cos(2 * np.pi * cycles[0]) + 0.5 * np.cos(2 * np.pi * cycles[1] + 1.0)
    widths = np.full((2, 1), bandwidth_hz / RATE_HZ)
    found = solve_envelopes(y, cycles, None, widths, 3)
    error = np.abs((found * np.exp(2j * np.pi * cycles)).real - refined_waveforms(y, cycles, widths[0, 0], 3)).max()
    assert error < 3.0 * accuracy_of(cycles, None, widths, 3) < 1e-5
