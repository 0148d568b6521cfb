"""One order by itself: the recursions against dense least squares, closed forms and rotations."""

import numpy as np
import pytest

from gearsig.errors import RefusalError
from gearsig.orders.vold_kalman import (
    envelope_alone,
    envelope_weight,
    single_order_error,
    waveform_alone,
    waveform_weight,
)
from gearsig.orders.vold_kalman import oscillator as write_oscillator
from tests.orders.test_vold_kalman_exact import (
    by_dense_least_squares,
    differences,
    exact_envelope,
    modulated_order,
    solve_by_rotations,
)


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
    expected = solve_by_rotations(np.ones((1, n)), y, weights, stencils)[0]
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
