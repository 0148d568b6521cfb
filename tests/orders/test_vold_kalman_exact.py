"""The solvers against exact solutions: closed form by poles for constant weighting, dense solves for the rest."""

from functools import cache
from math import comb

import numpy as np
import pytest
from scipy import sparse
from scipy.signal import lfilter
from scipy.sparse.linalg import spsolve

from gearsig.orders.vold_kalman import (
    eliminate,
    envelope_weight,
    expected_error,
    rotate,
    samples_per_cell,
    solve_band,
    solve_by_splines,
    solve_envelopes,
    solve_waveforms,
    waveform_weight,
)

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


def solve_by_rotations(*arguments, **options):
    return solve_band(*arguments, forward=rotate, **options)


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
@pytest.mark.parametrize("forward", [rotate, eliminate])
def test_sample_by_sample_against_a_dense_solve(p, forward):
    """Two orders, varying weights, parts left out."""
    y, cycles = crossing(120)
    active = np.ones((2, 120))
    active[0, 30:40] = active[1, 95:] = 0.0
    bandwidths = 0.05 * np.stack([np.linspace(1, 3, 120), np.full(120, 0.7)])
    weights = envelope_weight(bandwidths[:, : 120 - p], p)
    data = np.exp(2j * np.pi * cycles) * active
    arguments = (data, y + 0j, weights, differences(p, weights.shape))
    expected = by_dense_least_squares(*arguments)
    allowed = {rotate: 1e-9, eliminate: 1e-6}[forward]  # the orders are close, so the condition is poor
    assert abs(solve_band(*arguments, forward=forward) - expected).max() < allowed
    few_rows = 30 * data.itemsize * 2 * (p + 1)
    assert abs(solve_band(*arguments, forward=forward, triangle_bytes=few_rows) - expected).max() < allowed


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
    expected = solve_by_rotations(data, y + 0j, weights, differences(p, weights.shape))
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
    expected = solve_by_rotations(np.concatenate([data, data.conj()]), y + 0j, weights, differences(p, weights.shape))
    x = solve_envelopes(y, cycles, active, np.full((2, 1), 0.05), p)
    assert np.abs(x - 2 * expected[:2])[active].max() < 1e-8


@pytest.mark.parametrize(("p", "ratio"), [(2, 1.0), (2, 30.0), (3, 10.0)])
def test_expected_error(p, ratio):
    """Widths that differ by `ratio` along the signal: the splines' estimate holds, and is not above a hundredfold."""
    y, cycles, z = modulated_order(60_000)
    widths = np.linspace(1.0, ratio, len(y))[None] * 1e-4
    weights = envelope_weight(widths[:, p // 2 : len(y) - p + p // 2], p)
    expected = solve_by_rotations(np.ones((1, len(y))), z, weights, differences(p, weights.shape))
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
