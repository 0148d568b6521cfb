"""Wavelet coefficients against closed forms and two other implementations."""

import os

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gearsig.errors import InputError, RefusalError
from gearsig.timefreq import (
    Morlet,
    Morse,
    UniformSignal,
    admissibility,
    band,
    cwt,
    cwt_map,
    footprint_periods,
    half_support,
    pieces,
    plan_groups,
)

WAVELETS = (Morse(), Morse(60.0), Morse(4.0, 2.0), Morlet(), Morlet(20.0))


def _whole(x, response):
    """W of one line by a single long transform in double precision: the textbook's way."""
    X = np.fft.fft(x)
    v = np.fft.fftfreq(len(x))
    return np.fft.ifft(X * response(v))


@pytest.mark.parametrize("wavelet", WAVELETS, ids=lambda w: w.name)
def test_unit_sine_reads_one_on_its_line_with_its_phase(sine, wavelet):
    signal, z = sine(150.0)
    found = cwt(signal, positions=np.array([75.0, 150.0, 300.0]), wavelet=wavelet)
    middle = slice(2000, -2000)
    assert np.abs(found.values[1, middle] - z[middle]).max() < 1e-5


@pytest.mark.parametrize("wavelet", WAVELETS, ids=lambda w: w.name)
@pytest.mark.parametrize("n", [50_000, 50_001, 49_999])
def test_blocks_give_what_one_long_transform_gives(wavelet, n):
    x = np.random.default_rng(n).normal(size=n)
    lines = np.array([0.001, 0.0063, 0.04, 0.2])
    found = cwt(UniformSignal(x, 1.0), positions=lines, wavelet=wavelet, edges="zero").values
    around = 1 << 15
    padded = np.pad(x, around)
    for line, row in zip(lines, found, strict=True):
        expected = _whole(padded, lambda v, f=line: wavelet.response(v / f))[around:-around]
        assert np.abs(row - expected).max() < 5e-5 * np.abs(expected).max()


@given(step=st.integers(1, 700), n=st.integers(6000, 40_000))
@settings(max_examples=25, deadline=None)
def test_every_so_many_samples_are_those_samples(step, n):
    x = np.random.default_rng(3).normal(size=n)
    signal = UniformSignal(x, 1.0)
    lines = np.array([0.004, 0.02, 0.3])
    every, some = cwt(signal, positions=lines), cwt(signal, positions=lines, step=step)
    assert some.values.shape == (3, -(-n // step))
    assert np.abs(some.values - every.values[:, ::step]).max() < 2e-6
    assert some.at == pytest.approx(every.at[::step])


def test_reflected_ends_are_reflected():
    n = 3000
    x = np.random.default_rng(0).normal(size=n)
    lines = np.array([0.003, 0.05])
    found = cwt(UniformSignal(x, 1.0), positions=lines).values
    padded = np.pad(x, n - 1, mode="reflect")
    for line, row in zip(lines, found, strict=True):
        expected = _whole(padded, lambda v, f=line: Morse().response(v / f))[n - 1 : 2 * n - 1]
        assert np.abs(row - expected).max() < 5e-5 * np.abs(expected).max()


def test_same_as_ssqueezepy_within_the_wavelets_definition():
    os.environ["SSQ_PARALLEL"] = "0"  # its parallel kernels may abort the process under threads
    ssqueezepy = pytest.importorskip("ssqueezepy")
    x = np.random.default_rng(1).normal(size=8192)
    lines = np.geomspace(0.01, 0.3, 40)
    theirs, _ = ssqueezepy.cwt(
        x, ssqueezepy.Wavelet(("gmw", {"beta": 60, "gamma": 3})), scales=(20 ** (1 / 3) / (2 * np.pi * lines))[::-1]
    )
    ours = cwt(UniformSignal(x, 1.0), positions=lines, wavelet=Morse(60.0)).values
    assert np.abs(ours - np.asarray(theirs)[::-1]).max() < 1e-4 * np.abs(ours).max()


def test_same_as_pywavelets_within_its_sampling_of_the_wavelet():
    pywt = pytest.importorskip("pywt")
    x = np.random.default_rng(1).normal(size=8192)
    lines = np.geomspace(0.01, 0.1, 12)
    theirs, _ = pywt.cwt(x, 1 / lines, "cmor1.5-1.0", method="fft", precision=16)
    theirs = theirs * 2 * np.sqrt(lines)[:, None]  # from unit energy to unit amplitude
    ours = cwt(UniformSignal(x, 1.0), positions=lines, wavelet=Morlet(2 * np.pi * np.sqrt(0.75)), edges="zero").values
    middle = slice(1000, -1000)  # theirs is correlated with the wavelet and lies up to a sample aside
    error = np.abs(np.abs(ours) - np.abs(theirs))[:, middle].max(axis=1) / np.abs(ours).max(axis=1)
    assert error[0] < 0.01
    assert error.max() < 0.05  # grows as the scale shrinks, as an offset by a fraction of a sample does


@pytest.mark.parametrize("wavelet", WAVELETS, ids=lambda w: w.name)
def test_support_band_and_admissibility_by_quadrature(wavelet):
    v = np.linspace(1e-6, 12, 2_000_001)
    response = wavelet.response(v)
    low, high = band(wavelet)
    assert response.max() == pytest.approx(2.0, rel=1e-6)
    assert wavelet.response(np.array([low, high])) == pytest.approx([2e-6, 2e-6], rel=0.05)
    assert admissibility(wavelet) == pytest.approx(np.trapezoid(response / v, v), rel=1e-5)
    t = half_support(wavelet)
    outside = [abs(np.trapezoid(response * np.exp(2j * np.pi * v * s), v)) for s in (1.02 * t, 1.5 * t, 3 * t)]
    assert max(outside) < 1.2e-6 * np.trapezoid(response, v)


def test_energy_is_that_of_the_band():
    """∫∫ |W|² dt d(ln f) = ∫ |X|² ∫Ψ²(v) dv/v: white noise reads the same on all lines per relative bandwidth."""
    x = np.random.default_rng(0).normal(size=1 << 16)
    lines = np.geomspace(0.02, 0.2, 40)
    found = cwt(UniformSignal(x, 1.0), positions=lines).values
    v = np.linspace(1e-6, 3, 100_001)
    expected = lines * np.trapezoid(Morse().response(v) ** 2, v)  # two-sided density 1 over f > 0
    assert np.mean(np.abs(found) ** 2, axis=1) == pytest.approx(expected, rel=0.12)
    assert np.mean(np.mean(np.abs(found) ** 2, axis=1) / expected) == pytest.approx(1.0, abs=0.015)


def test_impulse_is_where_it_was():
    x = np.zeros(20_001)
    x[12_345] = 1.0
    found = cwt(UniformSignal(x, 1.0), lowest=0.01)
    assert set(np.argmax(np.abs(found.values), axis=1)) == {12_345}


@pytest.mark.slow
def test_map_is_the_mean_or_largest_of_the_matrix():
    x = np.random.default_rng(5).normal(size=30_011)
    signal = UniformSignal(x, 100.0)
    whole = np.abs(cwt(signal, lowest=0.5).values) ** 2
    starts = np.arange(0, len(x), 101)
    largest = cwt_map(signal, lowest=0.5, n_columns=300, reduction="max")
    mean = cwt_map(signal, lowest=0.5, n_columns=300)
    highest = np.maximum.reduceat(whole, starts, axis=1)
    assert np.all(highest * 1.001 + 1e-9 >= largest.values.T**2)  # a low line is read at some samples only
    assert np.mean(0.9 * highest < largest.values.T**2) > 0.95
    expected = np.add.reduceat(whole, starts, axis=1) / np.diff(starts, append=len(x))[None, :]
    assert mean.values.T[:, :-1] ** 2 == pytest.approx(expected[:, :-1], rel=0.03, abs=0.01)
    assert mean.at[0] == pytest.approx(0.5)
    power = cwt_map(signal, lowest=0.5, n_columns=300, scaling="power")
    assert power.values == pytest.approx(mean.values**2 / 2)


def test_map_of_a_sine_reads_one(sine):
    signal, _ = sine(150.0)
    found = cwt_map(signal, positions=np.array([150.0]), n_columns=100)
    assert found.values[20:-20] == pytest.approx(np.ones((len(found.at) - 40, 1)), abs=1e-5)
    assert (found.unit, found.axis, found.at_label) == ("m/s^2", "frequency", "time (s)")


def test_single_precision_signals_give_the_same(sine):
    double, _ = sine(150.0)
    single, _ = sine(150.0, dtype=np.float32)
    assert np.abs(cwt(single).values - cwt(double).values).max() < 2e-6


def test_a_weak_component_beside_a_strong_one_is_seen():
    t = np.arange(40_000)
    x = 1e3 * np.cos(2 * np.pi * 0.2 * t) + 1e-4 * np.cos(2 * np.pi * 0.01 * t) + 1e5
    found = cwt(UniformSignal(x, 1.0), positions=np.array([0.01, 0.2]), edges="reflect")
    assert np.abs(np.abs(found.values[0, 15_000:25_000]) - 1e-4).max() < 1.5e-5  # 156 dB below the strong one


def test_orders_over_revolutions(swept_angle_signal):
    found = cwt_map(swept_angle_signal, "a", positions=np.array([3.5, 7.0, 14.0]), n_columns=50)
    assert found.values[10:-10, 1] == pytest.approx(np.ones(len(found.at) - 20), abs=1e-5)
    assert (found.axis, found.shaft, found.at_label) == ("order", "pinion", "angle (revolutions of pinion)")
    assert found.at[-1] == pytest.approx(200, abs=4)


def test_memory_does_not_grow_with_the_signal():
    """A block's coefficients fit the cache; the longest block depends on the wavelet, not on the signal."""
    cycles = np.array([0.01, 0.1])
    sizes = []
    for n in (1 << 16, 1 << 20):
        groups = plan_groups(cycles, Morse(), n)
        sizes.append(max(group.n_block for group in groups))
    assert sizes[0] == sizes[1]
    piece = next(pieces(np.zeros(1 << 16), plan_groups(cycles, Morse(), 1 << 16)[0], "reflect"))
    assert piece.values.size <= 1 << 16


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_values_that_are_not_finite_are_named(bad):
    x = np.zeros(1000)
    x[321] = bad
    with pytest.raises(InputError, match="321"):
        UniformSignal(x, 1.0)


@pytest.mark.parametrize("size", [1e-300, 1e300])
def test_values_beyond_single_precision_are_named(size):
    with pytest.raises(InputError, match="another unit"):
        UniformSignal(np.full(100, size), 1.0)


def test_signal_shorter_than_the_wavelet_is_refused_with_the_remedy():
    signal = UniformSignal(np.random.default_rng(0).normal(size=1000), 1000.0)
    lowest = footprint_periods(Morse()) / 1.0
    assert cwt(signal, lowest=1.001 * lowest).positions[0] >= lowest
    with pytest.raises(RefusalError, match=r"set lowest to 3\.487 Hz"):
        cwt(signal, lowest=2.0)
    with pytest.raises(RefusalError, match="fewer than 16"):
        cwt(UniformSignal(np.zeros(15), 1.0))


@pytest.mark.parametrize(
    ("options", "text"),
    [
        ({"highest": 600.0}, "at most 500 Hz"),
        ({"lowest": 300.0, "highest": 200.0}, "lowest < highest"),
        ({"positions": np.array([10.0, 9.0])}, "increasing"),
        ({"positions": np.array([10.0]), "lowest": 5.0}, "both"),
        ({"n_per_octave": 0}, "at least 1"),
        ({"step": 0}, "at least 1"),
        ({"edges": "wrap"}, "reflect"),
        ({"n_per_octave": 10**6}, "GB"),
    ],
)
def test_wrong_input_is_named(options, text):
    with pytest.raises(InputError, match=text):
        cwt(UniformSignal(np.zeros(4000), 1000.0), **options)


def test_a_channel_must_be_named_where_there_are_several(swept_angle_signal):
    with pytest.raises(InputError, match="no channel 'b'"):
        cwt(swept_angle_signal, "b")
    with pytest.raises(InputError, match="UniformSignal"):
        cwt(np.zeros(100))
