"""Synchrosqueezed transforms against closed forms and ssqueezepy."""

import os
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from gearsig.errors import InputError, RefusalError
from gearsig.timefreq import (
    Morlet,
    Morse,
    UniformSignal,
    cwt_map,
    inverse,
    squeeze_lines,
    squeezed_cwt,
    squeezed_cwt_map,
    squeezed_stft,
    squeezed_stft_map,
    stft_map,
)

INSIDE = slice(1500, -1500)


@pytest.mark.parametrize("wavelet", [Morse(), Morse(60.0), Morlet(12.0)], ids=lambda w: w.name)
def test_a_sine_is_one_line_of_its_amplitude(sine, wavelet):
    signal, z = sine(153.0, 0.8)
    found = squeezed_cwt(signal, wavelet=wavelet, lowest=20, highest=600)
    line = int(np.argmin(np.abs(np.log(found.positions / 153.0))))
    assert found.values[line, INSIDE] == pytest.approx(z[INSIDE], abs=2e-4)
    others = np.delete(np.abs(found.values[:, INSIDE]), line, axis=0)
    assert others.max() < 2e-4


def test_a_sine_is_one_line_of_the_short_time_spectrum(sine):
    signal, z = sine(152.6, 0.8)
    found = squeezed_stft(signal, window_length=0.25)
    line = int(np.argmin(np.abs(found.positions - 152.6)))
    assert found.values[line, INSIDE] == pytest.approx(z[INSIDE], abs=1e-3)


@pytest.mark.parametrize("frequency_hz", [20.3, 600.0 / 2 ** (100.4 / 32)])
def test_lines_are_borders_half_way(frequency_hz):
    lines = np.geomspace(20, 640, 161)
    table = squeeze_lines(lines, 2000.0, "logarithmic")
    omega = 2 * np.pi * frequency_hz / 2000.0
    line = int(np.searchsorted(table.borders, omega)) - 1
    assert line == np.argmin(np.abs(np.log(lines / frequency_hz)))
    cells = np.linspace(table.borders[0], table.borders[-1], len(table.lookup) + 1)[:-1]
    assert np.all(table.borders[table.lookup] <= cells * (1 + 1e-12))


def test_energy_gathers_around_a_chirp(crossing):
    signal, (rising, _) = crossing(second=0.0)
    found = squeezed_stft_map(signal, window_length=0.2)
    plain = stft_map(signal, window_length=0.2)

    def share_near(levels, half_width_hz):
        near = np.abs(levels.positions[None, :] - rising(levels.at)[:, None]) < half_width_hz
        power = levels.values**2
        return power[near].sum() / power.sum()

    assert share_near(found, 3.0) > 0.97
    assert share_near(plain, 3.0) < 0.7


def test_whole_signal_comes_back_from_the_sum():
    t = np.arange(16_001) / 2000.0
    x = np.cos(2 * np.pi * (80 * t + 10 * t**2)) + (1 + 0.3 * np.cos(2 * np.pi * t)) * np.cos(2 * np.pi * 420 * t)
    signal = UniformSignal(x, 2000.0)
    for found in (squeezed_cwt(signal, lowest=20, highest=900), squeezed_stft(signal, window_length=0.1, step=3)):
        step = round(float(found.at[1]) * 2000)
        assert inverse(found).real == pytest.approx(x[::step], abs=1e-2)
        assert np.sqrt(np.mean((inverse(found).real - x[::step]) ** 2)) < 2e-4


def test_same_energy_per_line_as_ssqueezepy():
    os.environ["SSQ_PARALLEL"] = "0"  # its parallel kernels may abort the process under threads
    ssqueezepy = pytest.importorskip("ssqueezepy")
    t = np.arange(8192)
    x = np.cos(2 * np.pi * (0.02 * t + 4e-6 * t**2)) + 0.5 * np.cos(2 * np.pi * 0.21 * t + 30 * np.cos(t / 900))
    n_per_octave = 16
    ours = squeezed_cwt(UniformSignal(x, 1.0), wavelet=Morse(60.0), lowest=0.01, highest=0.4, n_per_octave=n_per_octave)
    lines = ours.positions
    wavelet = ssqueezepy.Wavelet(("gmw", {"beta": 60, "gamma": 3}))
    scales = (20 ** (1 / 3) / (2 * np.pi * lines))[::-1].copy()
    theirs = np.asarray(ssqueezepy.ssq_cwt(x, wavelet, scales=scales, ssq_freqs=lines.copy())[0])
    theirs = theirs[::-1] if np.abs(theirs[0]).sum() > np.abs(theirs[-1]).sum() else theirs
    power, reference = (np.sum(np.abs(v[:, 500:-500]) ** 2, axis=1) for v in (ours.values, theirs))
    power, reference = power / power.sum(), reference / reference.sum()
    best = min(np.abs(power - r).sum() for r in (reference, reference[::-1]))
    assert best < 0.05


def test_map_is_the_mean_of_the_matrix(crossing):
    signal, _ = crossing(noise=0.1)
    whole = np.abs(squeezed_cwt(signal, lowest=40, highest=800).values) ** 2
    levels = squeezed_cwt_map(signal, lowest=40, highest=800, n_columns=200)
    starts = np.arange(0, signal.n_samples, 101)
    expected = np.add.reduceat(whole, starts, axis=1) / np.diff(starts, append=signal.n_samples)
    power = levels.values.T**2
    assert power.shape == expected.shape
    assert power.sum() == pytest.approx(expected.sum(), rel=0.02)
    assert np.corrcoef(np.sqrt(power).ravel(), np.sqrt(expected).ravel())[0, 1] > 0.99


def test_odd_lengths_and_one_sample_more_give_the_same(crossing):
    signal, _ = crossing()
    reference = squeezed_cwt(signal, lowest=40, highest=800)
    for n in (19_999, 20_000):
        found = squeezed_cwt(UniformSignal(signal.values[:n], 2000.0), lowest=40, highest=800)
        middle = slice(1000, 19_000)
        changed = np.abs(found.values[:, middle] - reference.values[:, middle]) > 1e-4
        assert changed.mean() < 1e-3  # a frequency on a border may fall to either side


def test_single_precision_gives_the_same(crossing):
    signal, _ = crossing()
    single = UniformSignal(signal.values.astype(np.float32), 2000.0)
    a, b = (squeezed_cwt_map(s, lowest=40, highest=800).values for s in (signal, single))
    assert np.mean(np.abs(a - b) > 1e-3) < 1e-3


def test_eight_threads_at_once_get_what_one_gets(crossing):
    signal, _ = crossing(noise=0.2)

    def both(kind):
        return kind(signal, highest=800.0).values

    for kind in (squeezed_cwt_map, squeezed_stft_map, cwt_map):
        alone = both(kind)
        with ThreadPoolExecutor(8) as pool:
            for found in pool.map(both, [kind] * 8):
                assert np.array_equal(found, alone)


def test_orders_stay_put_where_frequencies_sweep(swept_angle_signal):
    found = squeezed_cwt_map(swept_angle_signal, "a", lowest=1, highest=20)
    middle = slice(50, -50)
    top = found.positions[np.argmax(found.values[middle], axis=1)]
    assert np.all(np.abs(np.log2(top / 7.0)) <= 0.5 / 32)
    assert found.values[middle].max(axis=1) == pytest.approx(np.ones(len(top)), abs=1e-3)
    spectra = squeezed_stft_map(swept_angle_signal, "a", window_length=4.0)
    assert np.abs(spectra.positions[np.argmax(spectra.values[middle], axis=1)] - 7.0).max() < 0.1


def test_silence_stays_silent():
    for kind in (squeezed_cwt_map, squeezed_stft_map):
        assert not kind(UniformSignal(np.zeros(4000), 100.0)).values.any()


def test_too_short_signals_are_refused():
    signal = UniformSignal(np.ones(2000), 1000.0)
    with pytest.raises(RefusalError, match="shorter than the wavelet"):
        squeezed_cwt(signal, lowest=0.5)
    with pytest.raises(RefusalError, match="shorten window_length"):
        squeezed_stft(signal, window_length=3.0)
    with pytest.raises(InputError, match="hann, gaussian"):
        squeezed_stft(signal, window="box")
