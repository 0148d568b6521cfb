"""Spectral coherence: closed forms of modulated noise, brute force, cyclic periodograms, noise's own level."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gearsig.errors import InputError, RefusalError
from gearsig.recording import Channel, Recording, read_recording
from gearsig.spectra import enhanced_envelope, spectral_coherence

FS = 10_000.0
DATA = Path(__file__).parents[3] / "shared" / "data" / "bearing_races"


def modulated_noise(n: int, alpha_hz: float, depth: float, seed: int = 0) -> np.ndarray:
    t = np.arange(n) / FS
    return (1 + depth * np.cos(2 * np.pi * alpha_hz * t)) * np.random.default_rng(seed).normal(size=n)


def near(alpha: np.ndarray, *positions: float) -> np.ndarray:
    return np.any([np.abs(alpha - p) < 3.5 * (alpha[1] - alpha[0]) for p in positions], axis=0)


@pytest.mark.parametrize("n", [1 << 17, (1 << 17) + 1, 131_001])
@pytest.mark.parametrize("depth", [0.3, 0.8])
def test_modulated_noise_has_the_known_coherence_at_its_frequency(n, depth):
    """x = (1 + m cos)·noise: mean power 1 + m²/2, m at α, m²/4 at 2α."""
    alpha = round(37.0 * n / FS) * FS / n
    c = spectral_coherence(modulated_noise(n, alpha, depth), FS, highest_alpha_hz=120.0, n_bands=16)
    mean_power = 1 + depth**2 / 2
    at, twice = (int(np.argmin(np.abs(c.alpha - a))) for a in (alpha, 2 * alpha))
    assert c.alpha[at] == pytest.approx(alpha)
    assert c.coherence_squared[at].mean() == pytest.approx((depth / mean_power) ** 2, rel=0.03)
    assert c.coherence_squared[twice].mean() == pytest.approx((depth**2 / 4 / mean_power) ** 2, abs=3e-3)
    # The correlation's density: noise of variance 1 has 2/fs (one-sided).
    assert np.abs(c.correlation[at]).mean() == pytest.approx(depth * 2 / FS, rel=0.03)
    assert np.angle(c.correlation[at]).mean() == pytest.approx(0.0, abs=0.1)
    assert np.argmax(c.coherence_squared.mean(axis=1)) == at


@pytest.mark.parametrize(("n", "n_bands"), [(1 << 15, 16), ((1 << 15) + 1, 64), (100_003, 40)])
def test_stationary_noise_stays_below_the_level_in_95_of_100_cells_and_lines(n, n_bands):
    x = np.random.default_rng(n).normal(size=n)
    x[1:] += 0.8 * x[:-1]  # coloured
    c = spectral_coherence(x, FS, highest_alpha_hz=300.0, n_bands=n_bands)
    assert np.mean(c.coherence_squared <= c.level()) == pytest.approx(0.95, abs=0.01)
    assert np.mean(c.coherence_squared <= c.level(0.01)) == pytest.approx(0.99, abs=0.005)
    for band in (None, (2000.0, 4000.0)):
        e = enhanced_envelope(c, band)
        assert np.mean(e.spectrum.values <= e.level) == pytest.approx(0.95, abs=0.025)


@settings(max_examples=8)
@given(st.integers(600, 900), st.sampled_from([3, 5]))
def test_is_the_sum_it_is_defined_by(n, n_bands):
    x = np.random.default_rng(n).normal(size=n) + 3.0
    c = spectral_coherence(x, FS, highest_alpha_hz=20 * FS / n, n_bands=n_bands)
    w = 0.5 - 0.5 * np.cos(2 * np.pi * np.arange(n) / n)
    X = np.fft.fft((x - x.mean()) * w)
    half = round(c.frequency_hz[1] * n / FS - c.frequency_hz[0] * n / FS) if len(c.frequency_hz) > 1 else None
    half = half or ((n + 1) // 2 - 1) // n_bands
    G = 0.5 + 0.5 * np.cos(np.pi * np.arange(1 - half, half) / half)
    for j, f in enumerate(c.frequency_hz):
        nu = round(f * n / FS) + np.arange(1 - half, half)
        for i, alpha in enumerate(c.alpha):
            k = round(alpha * n / FS)
            S = np.sum(G * X[nu] * np.conj(X[nu - k]))
            below = np.sum(G * np.abs(X[nu]) ** 2) * np.sum(G * np.abs(X[nu - k]) ** 2)
            assert c.coherence_squared[i, j] == pytest.approx(abs(S) ** 2 / below, rel=1e-9, abs=1e-12)
            assert c.correlation[i, j] == pytest.approx(2 * S / G.sum() / (FS * np.dot(w, w)), abs=1e-14)
    assert c.coherence_squared.max() <= 1 + 1e-12


def test_agrees_with_the_averaged_cyclic_periodogram():
    """Averages over short blocks, of the spectra at f and at f - α, computed as sums: an independent estimator."""
    n, n_block = 20_001, 256
    alpha = round(50.0 * n / FS) * FS / n
    x = modulated_noise(n, alpha, 0.9, seed=3)
    c = spectral_coherence(x, FS, highest_alpha_hz=120.0, n_bands=40)
    w = np.hanning(n_block)
    starts = np.arange(0, n - n_block, n_block // 4)
    t = np.arange(n) / FS
    for a, expected_high in ((alpha, True), (70.0, False)):
        cross = np.empty(len(c.frequency_hz))
        for j, f in enumerate(c.frequency_hz):
            up, down = x * np.exp(-2j * np.pi * f * t), x * np.exp(-2j * np.pi * (f - a) * t)
            U, D = (np.array([np.dot(w, y[s : s + n_block]) for s in starts]) for y in (up, down))
            cross[j] = abs(np.sum(U * np.conj(D))) ** 2 / (np.sum(np.abs(U) ** 2) * np.sum(np.abs(D) ** 2))
        ours = c.coherence_squared[int(np.argmin(np.abs(c.alpha - a)))]
        assert ours.mean() == pytest.approx(cross.mean(), rel=0.1 if expected_high else 1.0)
        assert (ours.mean() > 5 * c.level(1e-3)) == expected_high


def test_band_with_the_modulation_stands_out_and_lifts_the_improved_spectrum():
    n, alpha = 60_000, 60.0
    rng = np.random.default_rng(4)
    f = np.fft.rfftfreq(n, 1 / FS)
    lines = np.fft.rfft(modulated_noise(n, alpha, 0.8, seed=5))
    lines[(f < 2000) | (f > 2600)] = 0
    x = np.fft.irfft(lines, n) + 0.5 * rng.normal(size=n)
    c = spectral_coherence(x, FS, highest_alpha_hz=150.0, n_bands=32)
    at = int(np.argmin(np.abs(c.alpha - alpha)))
    assert 1950 <= c.frequency_hz[np.argmax(c.coherence_squared[at])] <= 2650
    improved, whole = enhanced_envelope(c, (2000.0, 2600.0)), enhanced_envelope(c)
    assert improved.spectrum.largest_near(75.0, 70.0)[0] == pytest.approx(alpha, abs=0.2)
    assert improved.spectrum.values[at] / improved.level > 3 * whole.spectrum.values[at] / whole.level


def test_float32_gain_and_offset_change_nothing():
    x = modulated_noise(20_001, 40.0, 0.5).astype(np.float32)
    c = spectral_coherence(x, FS, highest_alpha_hz=100.0)
    for other in (x.astype(np.float64), 1e-6 * x.astype(np.float64), 1e5 * x.astype(np.float64) + 7):
        d = spectral_coherence(other, FS, highest_alpha_hz=100.0)
        assert d.coherence_squared == pytest.approx(c.coherence_squared, abs=1e-6)
    shorter = spectral_coherence(x[:-1], FS, highest_alpha_hz=100.0)
    a, b = (enhanced_envelope(r).spectrum.largest_near(40.0, 3.0) for r in (c, shorter))
    assert b == pytest.approx(a, rel=0.05)


def test_bad_input_names_the_remedy():
    x = np.random.default_rng(0).normal(size=4000)
    with pytest.raises(InputError, match="highest_alpha_hz is 6000"):
        spectral_coherence(x, FS, highest_alpha_hz=6000.0)
    with pytest.raises(InputError, match="record longer"):
        spectral_coherence(x, FS, highest_alpha_hz=5.0)
    with pytest.raises(RefusalError, match="take at most"):
        spectral_coherence(x, FS, highest_alpha_hz=100.0, n_bands=400)
    with pytest.raises(InputError, match="no carrier band is left"):
        spectral_coherence(x, FS, highest_alpha_hz=4990.0, n_bands=2)
    with pytest.raises(RefusalError, match="constant"):
        spectral_coherence(np.full(4000, 0.1), FS, highest_alpha_hz=100.0, n_bands=8)
    with pytest.raises(InputError, match="NaN"):
        spectral_coherence(np.append(x, np.nan), FS, highest_alpha_hz=100.0)
    c = spectral_coherence(x, FS, highest_alpha_hz=100.0, n_bands=8)
    with pytest.raises(RefusalError, match="no carrier lies"):
        enhanced_envelope(c, (1.0, 2.0))
    with pytest.raises(InputError, match="probability"):
        c.level(0.0)
    recording = Recording(x[None, :], FS, (Channel("a", "acceleration", "m/s^2"),))
    assert spectral_coherence(recording, "a", highest_alpha_hz=100.0, n_bands=8).unit == "(m/s^2)^2/Hz"


@pytest.mark.skipif(not DATA.is_dir(), reason="the measured recordings are not here")
@pytest.mark.parametrize(
    ("file", "race_hz", "other_hz"),
    [("InnerRaceFault_vload_3.mat", 118.875, 81.125), ("OuterRaceFault_vload_4.mat", 81.125, 118.875)],
)
def test_bearing_race_is_the_strongest_line_of_the_enhanced_envelope(file, race_hz, other_hz):
    e = enhanced_envelope(spectral_coherence(read_recording(DATA / file), "gs", highest_alpha_hz=600.0))
    assert e.spectrum.positions[np.argmax(e.spectrum.values)] == pytest.approx(race_hz, rel=0.02)
    race, other = (e.spectrum.largest_near(hz, 0.02 * hz)[1] for hz in (race_hz, other_hz))
    assert race > 20 * max(other, e.level)


def test_tones_are_coherent_with_each_other_until_removed():
    n = 60_000
    t = np.arange(n) / FS
    tones = sum(np.cos(2 * np.pi * f * t) for f in (1000.0, 1100.0))
    x = 0.5 * np.random.default_rng(6).normal(size=n) + tones
    recording = Recording(x[None, :], FS, (Channel("a", "acceleration", "m/s^2"),))
    raw = spectral_coherence(recording, "a", highest_alpha_hz=150.0, n_bands=32)
    cleaned = spectral_coherence(recording, "a", highest_alpha_hz=150.0, n_bands=32, preparation="tones removed")
    at = int(np.argmin(np.abs(raw.alpha - 100.0)))
    assert raw.coherence_squared[at].max() > 0.5
    assert cleaned.coherence_squared[at].max() < cleaned.level(1e-4)
    assert "tones removed" in cleaned.source
