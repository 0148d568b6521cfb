"""Short-time Fourier transforms against closed forms and SciPy."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import ShortTimeFFT

from gearsig.errors import InputError, RefusalError
from gearsig.timefreq import UniformSignal, inverse, stft, stft_map


def test_same_as_scipy():
    x = np.random.default_rng(0).normal(size=3000)
    n = 256
    found = stft(UniformSignal(x, 1.0), window_length=n, step=32, edges="zero")
    window = 0.5 + 0.5 * np.cos(2 * np.pi * (np.arange(n) - n // 2) / n)
    reference = ShortTimeFFT(window, 32, 1.0, mfft=n, phase_shift=0)
    theirs = reference.stft(x, p0=0, p1=len(found.at)) * 2 / window.sum()
    inner = slice(1, -1)
    assert np.abs(found.values[inner]) == pytest.approx(np.abs(theirs[inner]), abs=1e-6)
    assert np.abs(found.values[[0, -1]]) == pytest.approx(np.abs(theirs[[0, -1]]) / 2, abs=1e-6)


@pytest.mark.parametrize("window", ["hann", "gaussian"])
@pytest.mark.parametrize("samples", [100, 101])
def test_unit_sine_reads_one_with_its_phase(sine, window, samples):
    signal, z = sine(200.0)
    found = stft(signal, window=window, window_length=samples / 2000.0, zero_padding=8)
    line = int(np.argmin(np.abs(found.positions - 200.0)))
    assert abs(found.positions[line] - 200.0) < 2.0
    middle = slice(200, -200)
    assert np.abs(found.values[line, middle]) == pytest.approx(np.abs(z[middle]), abs=0.01)
    assert np.abs(np.angle(found.values[line, middle] / z[middle])).max() < 0.05


@given(n=st.integers(100, 2000), samples=st.integers(16, 100), step=st.integers(1, 50))
@settings(max_examples=40, deadline=None)
def test_whole_signal_comes_back(n, samples, step):
    x = np.random.default_rng(n).normal(size=n)
    found = stft(UniformSignal(x, 50.0), window_length=samples / 50.0, step=step)
    assert inverse(found).real == pytest.approx(x[::step], abs=1e-5)


def test_energy_is_that_of_the_signal():
    """Σ |V|² over lines and instants is the window's energy times the signal's (Parseval frame by frame)."""
    x = np.random.default_rng(2).normal(size=4000)
    n = 200
    V = stft(UniformSignal(x, 1.0), window_length=n, edges="zero").values
    g = 0.5 + 0.5 * np.cos(2 * np.pi * (np.arange(n) - n // 2) / n)
    twins = np.where((np.arange(len(V)) == 0) | (np.arange(len(V)) == n // 2), 1.0, 0.5)
    found = (twins[:, None] * np.abs(V) ** 2).sum(axis=0) * g.sum() ** 2 / n
    assert found == pytest.approx(_frame_energy(x, g), rel=1e-5)


def _frame_energy(x, g):
    padded = np.pad(x, len(g))
    half = len(g) // 2
    return np.array([np.sum((padded[i + len(g) - half :][: len(g)] * g) ** 2) for i in range(len(x))])


def test_impulse_is_where_it_was():
    x = np.zeros(5001)
    x[2345] = 1.0
    assert set(np.argmax(np.abs(stft(UniformSignal(x, 1.0)).values), axis=1)) == {2345}
    levels = stft_map(UniformSignal(x, 1.0), n_columns=500, reduction="max")
    assert abs(levels.at[np.argmax(levels.values.sum(axis=1))] - 2345) <= 11


def test_order_lines_over_revolutions(swept_angle_signal):
    levels = stft_map(swept_angle_signal, "a", window_length=4.0)
    assert levels.axis == "order"
    assert levels.positions[-1] <= 25.0
    assert levels.values[50:-50, np.argmin(np.abs(levels.positions - 7))] == pytest.approx(1.0, abs=1e-4)


@pytest.mark.parametrize(
    ("options", "error", "text"),
    [
        ({"window_length": 1e-4}, InputError, "at least"),
        ({"window_length": 9.0}, RefusalError, "shorter than the window"),
        ({"lowest": 300.0, "highest": 300.5}, InputError, "fewer than two"),
        ({"highest": 501.0}, InputError, "highest <= 500 Hz"),
        ({"zero_padding": 0}, InputError, "at least 1"),
        ({"n_columns": 1}, InputError, "at least 2"),
        ({"reduction": "median"}, InputError, "mean, max"),
        ({"scaling": "decibel"}, InputError, "amplitude peak, power"),
    ],
)
def test_wrong_input_is_named(options, error, text):
    with pytest.raises(error, match=text):
        stft_map(UniformSignal(np.zeros(4000), 1000.0), **options)
