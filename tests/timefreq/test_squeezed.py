"""Synchrosqueezed transforms against closed forms and ssqueezepy."""

import sys
from concurrent.futures import ThreadPoolExecutor
from functools import partial

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


def _tone_and_chirp() -> tuple[UniformSignal, np.ndarray]:
    t = np.arange(8000) / 2000.0
    x = 0.8 * np.cos(2 * np.pi * (100 * t + 20 * t**2) + 0.3) + 1.5 * np.cos(2 * np.pi * 500 * t)
    return UniformSignal(x, 2000.0), 100 + 40 * t


@pytest.mark.slow
@pytest.mark.parametrize(
    "transform",
    [
        partial(squeezed_cwt, wavelet=Morse(60.0), lowest=40, highest=900),
        partial(squeezed_cwt, wavelet=Morlet(12.0), lowest=40, highest=900, step=3),
        partial(squeezed_stft, window_length=0.1),
        partial(squeezed_stft, window="hann", window_length=0.1, lowest=50, highest=800, step=3),
    ],
    ids=["cwt morse", "cwt morlet", "stft gaussian", "stft hann"],
)
def test_both_engines_give_the_same_amplitude_phase_and_ridge(transform):
    signal, chirp_hz = _tone_and_chirp()
    ours, theirs = (transform(signal, engine=engine) for engine in ("gearsig", "ssqueezepy"))
    assert np.array_equal(theirs.positions, ours.positions)
    assert np.array_equal(theirs.at, ours.at)
    assert "ssqueezepy" in theirs.method
    middle = slice(len(ours.at) // 8, -len(ours.at) // 8)
    # A frequency that lies on a border may fall to either side, so lines are compared by how few differ.
    assert np.mean(np.abs(theirs.values - ours.values)[:, middle] > 0.01) < 3e-4
    assert inverse(theirs)[middle] == pytest.approx(inverse(ours)[middle], abs=2e-4)
    step = round(ours.at[1] * 2000)
    assert inverse(theirs).real[middle] == pytest.approx(signal.values[::step][middle], abs=2e-4)
    low = ours.positions < 350
    ridge_hz = theirs.positions[low][np.argmax(np.abs(theirs.values[low]), axis=0)]
    spacing_hz = np.gradient(ours.positions)[low].max()
    assert np.abs(ridge_hz - chirp_hz[::step])[middle].max() < 1.01 * spacing_hz


@pytest.mark.parametrize(
    "transform",
    [partial(squeezed_cwt_map, lowest=40, highest=900), partial(squeezed_stft_map, window_length=0.1)],
    ids=["cwt", "stft"],
)
def test_both_engines_give_the_same_map(transform):
    signal, _ = _tone_and_chirp()
    ours, theirs = (transform(signal, engine=engine, n_columns=200).values for engine in ("gearsig", "ssqueezepy"))
    assert np.square(theirs).sum() == pytest.approx(np.square(ours).sum(), rel=2e-3)
    assert np.corrcoef(theirs.ravel(), ours.ravel())[0, 1] > 0.9995


def test_an_engine_that_is_missing_unknown_or_too_large_is_refused(monkeypatch):
    signal, _ = _tone_and_chirp()
    with pytest.raises(InputError, match="ssqueezepy"):
        squeezed_cwt(signal, engine="ssqueeze")
    with pytest.raises(InputError, match=r"GB.*gearsig"):
        squeezed_cwt_map(UniformSignal(np.tile(signal.values, 250), 2000.0), engine="ssqueezepy")
    monkeypatch.setitem(sys.modules, "ssqueezepy", None)
    with pytest.raises(InputError, match="pip install ssqueezepy"):
        squeezed_stft(signal, engine="ssqueezepy")


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


@pytest.mark.slow
def test_threads_at_once_get_what_one_gets(crossing):
    signal, _ = crossing(noise=0.2)

    def both(kind):
        return kind(signal, highest=800.0).values

    for kind in (squeezed_cwt_map, squeezed_stft_map, cwt_map):
        alone = both(kind)
        with ThreadPoolExecutor(4) as pool:
            for found in pool.map(both, [kind] * 4):
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
