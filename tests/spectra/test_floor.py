"""Noise floor and line search: bias, robustness, false-alarm rate, interpolation."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import signal as scipy_signal

from gearsig.errors import InputError, RefusalError
from gearsig.spectra import amplitude_spectrum, cepstrum, find_lines, noise_floor, power_density


def _noise(rng, n, pole):
    return scipy_signal.lfilter([1.0], [1.0, -pole], rng.normal(size=n + 500))[500:]


def _true_power(spectrum, pole):
    """Return the mean power per line of `_noise` at a sampling rate of 1."""
    density = 2.0 / np.abs(1 - pole * np.exp(-2j * np.pi * spectrum.positions)) ** 2
    return density * spectrum.noise_bandwidth


@pytest.mark.parametrize("pole", [0.0, 0.9])
@pytest.mark.parametrize("n_per_block", [8192, 1024])
@pytest.mark.parametrize("quantile", [0.5, 0.25])
def test_floor_is_the_mean_noise_power(pole, n_per_block, quantile):
    rng = np.random.default_rng(7)
    ratios = []
    for _ in range(60):
        spectrum = amplitude_spectrum(_noise(rng, 8192, pole), 1.0, n_per_block=n_per_block, scaling="power")
        floor = noise_floor(spectrum, quantile=quantile)
        ratios.append((floor.values / _true_power(spectrum, pole))[3:-3].mean())
    assert 10 * np.log10(np.mean(ratios)) == pytest.approx(0.0, abs=0.15)  # dB


def test_floor_of_amplitudes_and_of_power_are_the_same_floor():
    x = np.random.default_rng(8).normal(size=4096)
    peak = noise_floor(amplitude_spectrum(x, 1.0)).values[1:-1]
    power = noise_floor(amplitude_spectrum(x, 1.0, scaling="power")).values[1:-1]
    assert peak**2 / 2 == pytest.approx(power, rel=1e-9)


def test_tones_hardly_lift_the_floor():
    n = 16384
    rng = np.random.default_rng(9)
    x = rng.normal(size=n)
    harmonics = sum(5.0 * np.sin(2 * np.pi * 0.01 * k * np.arange(n) + k) for k in range(1, 40))
    clean, full = (noise_floor(power_density(v, 1.0, n_per_block=n)).values for v in (x, x + harmonics))
    assert np.median(10 * np.log10(full / clean)) < 0.4


@pytest.mark.parametrize(("n_per_block", "pole"), [(4096, 0.9), (256, 0.5)])
def test_false_alarm_rate_over_the_whole_spectrum(pole, n_per_block):
    rng = np.random.default_rng(10)
    n_trials, rate = 300, 0.1
    alarms = sum(
        bool(find_lines(amplitude_spectrum(_noise(rng, 4096, pole), 1.0, n_per_block=n_per_block), false_alarm=rate))
        for _ in range(n_trials)
    )
    # 0.1 ± 4 standard deviations, and up to 1.3 times for the floor's own scatter.
    assert 0.04 < alarms / n_trials < 0.2


@settings(max_examples=40, deadline=None)
@given(
    frequency=st.floats(20.0, 230.0),
    phase=st.floats(0, 6.28),
    window=st.sampled_from(["hann", "blackman-harris", "kaiser 9"]),
    scaling=st.sampled_from(["amplitude peak", "amplitude rms", "power"]),
)
def test_one_tone_is_found_once_and_read_between_lines(frequency, phase, window, scaling):
    t = np.arange(5000) / 500.0
    x = 1.7 * np.sin(2 * np.pi * frequency * t + phase) + 1e-4 * np.random.default_rng(0).normal(size=len(t))
    (line,) = find_lines(amplitude_spectrum(x, 500.0, window=window, scaling=scaling), false_alarm=1e-6)
    expected = {"amplitude peak": 1.7, "amplitude rms": 1.7 / 2**0.5, "power": 1.7**2 / 2}[scaling]
    assert line.position == pytest.approx(frequency, abs=1e-4)
    assert line.value == pytest.approx(expected, rel=1e-3)


def test_threshold_in_decibels_overrides_the_rate():
    t = np.arange(4096) / 1000.0
    x = np.random.default_rng(1).normal(size=len(t)) + np.sin(2 * np.pi * 123.4 * t)
    lines = find_lines(amplitude_spectrum(x, 1000.0), threshold_db=20.0)
    assert [round(line.position) for line in lines] == [123]
    assert lines[0].ratio_db > 20.0
    assert lines[0].ratio_db == pytest.approx(20 * np.log10(lines[0].value / lines[0].floor), abs=1.5)  # scalloping


def test_weak_tone_beside_a_strong_one_is_found_and_no_leakage_is():
    t = np.arange(25600) / 2560.0
    x = np.sin(2 * np.pi * 300.037 * t) + 1e-3 * np.sin(2 * np.pi * 303.0 * t)
    x += 1e-5 * np.random.default_rng(2).normal(size=len(t))
    found = [line.position for line in find_lines(amplitude_spectrum(x, 2560.0))]
    assert found == pytest.approx([300.037, 303.0], abs=2e-3)


def test_what_has_no_floor_is_refused():
    with pytest.raises(InputError, match="cepstrum"):
        noise_floor(cepstrum(np.random.default_rng(0).normal(size=100), 1.0))
    with pytest.raises(RefusalError, match="few"):
        noise_floor(amplitude_spectrum(np.ones(20), 1.0))
    spectrum = amplitude_spectrum(np.random.default_rng(0).normal(size=1000), 1000.0)
    with pytest.raises(InputError, match="width"):
        noise_floor(spectrum, width=5.0)
    with pytest.raises(InputError, match="belong"):
        find_lines(spectrum, noise_floor(amplitude_spectrum(np.ones(500), 1.0)))


def test_silence_has_no_lines():
    assert find_lines(amplitude_spectrum(np.zeros(1000), 1.0)) == ()
