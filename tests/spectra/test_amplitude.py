"""Amplitude and power spectra: closed forms, Parseval, agreement with scipy."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import signal as scipy_signal

from gearsig.errors import InputError
from gearsig.recording import Channel, Recording
from gearsig.spectra import (
    WINDOW_NAMES,
    amplitude_spectrum,
    make_window,
    scaled_unit,
    window_response,
)

WINDOWS = ["rectangular", "hann", "hamming", "blackman-harris", "flat top", "kaiser 9"]


@pytest.mark.parametrize("window", WINDOWS)
@pytest.mark.parametrize(("scaling", "reads"), [("amplitude peak", 1.0), ("amplitude rms", 0.5**0.5), ("power", 0.5)])
@pytest.mark.parametrize("n", [1000, 1001])
def test_bin_centred_unit_sine_reads_one(window, scaling, reads, n):
    x = np.sin(2 * np.pi * 100 * np.arange(n) / n + 0.3)
    spectrum = amplitude_spectrum(x, float(n), window=window, scaling=scaling)
    assert spectrum.values[100] == pytest.approx(reads, rel=1e-5)  # Kaiser's and Hamming's side lobes reach 0 Hz
    assert spectrum.positions[100] == pytest.approx(100.0)


@pytest.mark.parametrize("scaling", ["amplitude peak", "amplitude rms", "power"])
def test_dc_and_nyquist_are_not_doubled(scaling):
    x = 3.0 + 2.0 * (-1.0) ** np.arange(64)
    spectrum = amplitude_spectrum(x, 64.0, window="rectangular", scaling=scaling)
    power = 2 if scaling == "power" else 1
    assert spectrum.values[[0, -1]] == pytest.approx([3.0**power, 2.0**power])


@settings(max_examples=60, deadline=None)
@given(n=st.integers(4, 400), seed=st.integers(0, 2**32 - 1), window=st.sampled_from(WINDOWS), single=st.booleans())
def test_parseval_for_even_and_odd_lengths(n, seed, window, single):
    x = np.random.default_rng(seed).normal(size=n).astype(np.float32 if single else np.float64)
    spectrum = amplitude_spectrum(x, 10.0, window=window, scaling="power")
    w = make_window(window, n)
    expected = np.mean((x.astype(np.float64) * w.values) ** 2) / np.mean(w.values**2)
    total = spectrum.values.sum() / w.noise_bandwidth_bins
    # A window's energy is spread over both halves, so DC's and Nyquist's share counts as a line of its own.
    assert total == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("window", ["rectangular", "hann", "hamming", "blackman-harris", "flat top"])
@pytest.mark.parametrize("n", [4000, 4001])
def test_a_window_over_lines_is_the_window_over_samples(window, n):
    x = 1e3 + np.random.default_rng(6).normal(size=n)
    w = make_window(window, n).values
    expected = 2 * np.abs(np.fft.rfft(x * w)) / w.sum()
    expected[0] /= 2
    if n % 2 == 0:
        expected[-1] /= 2
    for transform in (None, np.fft.rfft(x)):
        spectrum = amplitude_spectrum(x, 1.0, window=window, transform=transform)
        assert spectrum.values == pytest.approx(expected, rel=1e-9, abs=1e-11)


def test_single_precision_gives_the_same_answer():
    x = np.random.default_rng(3).normal(size=5000).astype(np.float32)
    single, double = amplitude_spectrum(x, 100.0), amplitude_spectrum(x.astype(np.float64), 100.0)
    assert np.array_equal(single.values, double.values)


def test_block_average_is_the_root_of_the_mean_power():
    x = np.random.default_rng(4).normal(size=4000)
    spectrum = amplitude_spectrum(x, 1.0, n_per_block=1000, overlap=0.0, scaling="amplitude rms")
    parts = [amplitude_spectrum(b, 1.0, scaling="power").values for b in x.reshape(4, 1000)]
    assert spectrum.values**2 == pytest.approx(np.mean(parts, axis=0))
    assert spectrum.n_averages == 4


@pytest.mark.parametrize("overlap", [0.0, 0.5, 0.75])
def test_independent_averages_tell_the_scatter_of_white_noise(overlap):
    rng = np.random.default_rng(5)
    spectra = [amplitude_spectrum(rng.normal(size=16000), 1.0, n_per_block=500, overlap=overlap, scaling="power")] * 1
    spectra += [
        amplitude_spectrum(rng.normal(size=16000), 1.0, n_per_block=500, overlap=overlap, scaling="power")
        for _ in range(39)
    ]
    lines = np.stack([s.values[5:-5] for s in spectra])
    scatter = lines.var(axis=0, ddof=1).mean() / lines.mean() ** 2
    assert 1 / scatter == pytest.approx(spectra[0].n_averages, rel=0.06)


@pytest.mark.parametrize(
    ("name", "theirs"),
    [
        ("hann", "hann"),
        ("hamming", "hamming"),
        ("blackman-harris", "blackmanharris"),
        ("flat top", "flattop"),
        ("kaiser 9", ("kaiser", 9.0)),
    ],
)
@pytest.mark.parametrize("n", [16, 101])
def test_windows_agree_with_scipy(name, theirs, n):
    assert make_window(name, n).values == pytest.approx(scipy_signal.get_window(theirs, n), abs=2e-9)


@pytest.mark.parametrize(
    ("name", "bandwidth"), [("rectangular", 1.0), ("hann", 1.5), ("hamming", 1.3628), ("flat top", 3.7702)]
)
def test_noise_bandwidths_are_the_published_ones(name, bandwidth):
    assert make_window(name, 4096).noise_bandwidth_bins == pytest.approx(bandwidth, abs=1e-4)


def test_response_of_hann_between_lines_is_the_closed_form():
    d = np.array([0.1, 0.5, 1.5, 2.5])
    assert window_response("hann", d) == pytest.approx(np.abs(np.sinc(d) / (1 - d**2)), rel=1e-4)


def test_channel_spectrum_carries_unit_and_name():
    recording = Recording(np.ones((1, 16)), 8.0, (Channel("a1", "acceleration", "m/s^2"),))
    spectrum = amplitude_spectrum(recording, "a1", scaling="power")
    assert (spectrum.unit, spectrum.source) == ("(m/s^2)^2", "a1")


@pytest.mark.parametrize(
    ("unit", "scaling", "written"),
    [("m/s^2", "power density", "(m/s^2)^2/Hz"), ("g", "power density", "g^2/Hz"), ("", "power density", "1/Hz")],
)
def test_units_are_written_out(unit, scaling, written):
    assert scaled_unit(unit, scaling) == written


@pytest.mark.parametrize(
    ("wrong", "named"),
    [
        ({"window": "han"}, "hann"),
        ({"window": "kaiser"}, "beta"),
        ({"scaling": "peak"}, "amplitude peak"),
        ({"n_per_block": 101}, "2 to 100"),
        ({"overlap": 1.0}, "0.95"),
    ],
)
def test_wrong_arguments_name_what_is_allowed(wrong, named):
    with pytest.raises(InputError, match=named):
        amplitude_spectrum(np.ones(100), 10.0, **wrong)


@pytest.mark.parametrize("rate", [0.0, -1.0, np.nan])
def test_wrong_rates_are_refused(rate):
    with pytest.raises(InputError, match="channel_or_rate_hz, an array's sampling rate, is"):
        amplitude_spectrum(np.ones(100), rate)


def test_window_names_cover_the_known_windows():
    assert set(WINDOWS[:-1]) == set(WINDOW_NAMES[:-1])
