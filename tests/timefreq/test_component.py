"""Waveforms from ridges, and signals from their coefficients."""

import numpy as np
import pytest

from gearsig.errors import InputError, RefusalError
from gearsig.timefreq import (
    Morse,
    Ridge,
    UniformSignal,
    component,
    cwt,
    cwt_map,
    inverse,
    lowest_possible,
    ridges,
    stft,
)

T = np.arange(20_001) / 2000.0
AMPLITUDE = 1 + 0.3 * np.cos(2 * np.pi * 2 * T)
CHIRP = AMPLITUDE * np.exp(2j * np.pi * (100 * T + 15 * T**2))
OTHER = np.exp(2j * np.pi * (500 * T + 10 * T**2))
HIGH = np.exp(2j * np.pi * (750 * T + 5 * T**2))
INSIDE = slice(500, -500)


def _ridge(signal, wavelet):
    return ridges(cwt_map(signal, wavelet=wavelet, lowest=50, highest=450, n_per_octave=32))[0]


@pytest.mark.parametrize(
    ("beta", "squeezed", "error"), [(20.0, True, 1e-2), (60.0, True, 1e-4), (20.0, False, 2e-2), (60.0, False, 2e-2)]
)
def test_modulated_chirp_comes_out_of_its_band(beta, squeezed, error):
    signal = UniformSignal((CHIRP + HIGH).real, 2000.0, unit="g", source="a")
    wavelet = Morse(beta)
    found = component(signal, _ridge(signal, wavelet), squeezed=squeezed, wavelet=wavelet)
    assert np.abs(found.analytic - CHIRP)[INSIDE].max() < error
    assert np.abs(found.amplitude - AMPLITUDE)[INSIDE].max() < error
    assert np.array_equal(found.values, found.analytic.real)
    assert (found.unit, found.source) == ("g", "a")


def test_noise_outside_the_band_is_left_out():
    noise = 0.5 * np.random.default_rng(0).normal(size=len(T))
    signal = UniformSignal(CHIRP.real + noise, 2000.0)
    wavelet = Morse(60.0)
    ridge = _ridge(signal, wavelet)
    for squeezed in (True, False):
        found = component(signal, ridge, squeezed=squeezed, wavelet=wavelet)
        error = np.sqrt(np.mean((found.values - CHIRP.real)[INSIDE] ** 2))
        assert error < 0.2


def test_whole_signal_from_the_cwt():
    """The error is that of Σ over lines instead of ∫ over scale, and of lines that are not there."""
    x = CHIRP.real
    found = inverse(cwt(UniformSignal(x, 2000.0), lowest=20, highest=990, n_per_octave=12))
    assert np.abs(found.real - x).max() < 0.02  # at the ends, where frequencies jump in the reflection
    assert np.abs(found - CHIRP)[INSIDE].max() < 1e-3


def test_inverse_between_limits_that_follow_a_component():
    x = (CHIRP + OTHER).real
    coefficients = stft(UniformSignal(x, 2000.0), window_length=0.1)
    low = 100 + 30 * T
    found = inverse(coefficients, lowest=low - 60, highest=low + 60)
    assert np.abs(found - CHIRP)[INSIDE].max() < 0.02
    with pytest.raises(InputError, match="lowest has shape"):
        inverse(coefficients, lowest=np.zeros(7))
    with pytest.raises(InputError, match="NaN"):
        inverse(coefficients, highest=np.nan)


def test_order_component(swept_angle_signal):
    at = np.array([0.0, 200.0])
    ridge = Ridge(at, np.full(2, 7.0), np.ones(2), np.zeros(2, bool), "order", "g")
    found = component(swept_angle_signal, ridge, "a")
    revolutions = np.arange(200 * 64) / 64
    assert np.abs(found.analytic - np.exp(14j * np.pi * revolutions))[INSIDE].max() < 1e-3
    with pytest.raises(InputError, match="over order"):
        component(UniformSignal(np.zeros(1000), 1.0), ridge)


def test_a_ridge_at_zero_has_no_waveform():
    ridge = Ridge(T[[0, -1]], np.array([0.0, 40.0]), np.ones(2), np.zeros(2, bool), "frequency", "")
    with pytest.raises(InputError, match="touches zero"):
        component(UniformSignal(CHIRP.real, 2000.0), ridge)


def test_half_width_has_limits():
    signal = UniformSignal(CHIRP.real, 2000.0)
    ridge = Ridge(T[[0, -1]], np.array([100.0, 400.0]), np.ones(2), np.zeros(2, bool), "frequency", "")
    with pytest.raises(InputError, match="half_width"):
        component(signal, ridge, half_width=0.6)


def test_a_ridge_at_the_lowest_line_has_a_component():
    """The band's lower half would need a longer signal; the upper half is there."""
    n = 1000
    signal = UniformSignal(np.cos(2 * np.pi * 8.0 * np.arange(n) / 2000.0), 2000.0)
    lowest = lowest_possible(signal, Morse())
    at = np.array([0.0, n / 2000.0])
    ridge = Ridge(at, np.full(2, max(lowest, 8.0)), np.ones(2), np.zeros(2, dtype=bool), "frequency", "")
    assert np.isfinite(component(signal, ridge).values).all()
    below = Ridge(at, np.full(2, 0.5 * lowest), np.ones(2), np.zeros(2, dtype=bool), "frequency", "")
    with pytest.raises(RefusalError, match="shorter than the wavelet"):
        component(signal, below)
