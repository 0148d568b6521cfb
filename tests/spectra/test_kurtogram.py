"""Kurtogram: closed forms, an independent filter bank, noise's own level, bands that hold the impulses."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gearsig.errors import InputError, RefusalError
from gearsig.recording import Channel, Recording, read_recording
from gearsig.spectra import (
    kurtogram,
    kurtogram_envelope,
    noise_floor,
    prepared_signal,
    splitting_filters,
)

FS = 20_000.0
DATA = Path(__file__).parents[3] / "shared" / "data" / "bearing_races"


def impacts(n: int, rng: np.random.Generator, *, resonance_hz=6000.0, rate_hz=97.0, noise=0.3) -> np.ndarray:
    """Return damped impulses with one per cent of slip, in noise."""
    x = noise * rng.normal(size=n)
    at = np.cumsum(FS / rate_hz * (1 + 0.01 * rng.normal(size=int(n * rate_hz / FS) - 1)))
    k = np.arange(200)
    ring = np.exp(-k / 20) * np.sin(2 * np.pi * resonance_hz / FS * k)
    for start in at[at < n - 200].astype(int):
        x[start : start + 200] += ring
    return x


def recording_of(x: np.ndarray) -> Recording:
    return Recording(x[None, :], FS, (Channel("a", "acceleration", "m/s^2"),))


def responses(split, frequencies: np.ndarray) -> np.ndarray:
    """Return the magnitude of each part's filter, (n_parts, n), at frequencies in cycles per sample."""
    k = np.arange(1 - len(split.cosine), len(split.cosine))
    low_pass = np.hypot(split.cosine, split.sine)[abs(k)] * np.where((abs(k) // (2 * split.n_parts)) % 2 == 0, 1, -1)
    middles = (2 * np.arange(split.n_parts) + 1) / (4.0 * split.n_parts)
    turned = low_pass * np.exp(2j * np.pi * middles[:, None] * k)
    return np.abs(turned @ np.exp(-2j * np.pi * np.outer(k, frequencies)))


@pytest.mark.parametrize("n_parts", [2, 3])
def test_filters_split_the_band_at_half_the_amplitude(n_parts):
    s = splitting_filters(n_parts)
    borders = np.arange(n_parts + 1) / (2 * n_parts)
    middles = (borders[1:] + borders[:-1]) / 2
    assert responses(s, middles).diagonal() == pytest.approx(1.0, abs=1e-3)
    for i, response in enumerate(responses(s, borders)):
        assert response[i : i + 2] == pytest.approx(0.5, abs=3e-3)
    outside = np.linspace(borders[1] + 0.35 / (2 * n_parts), 1.0 - 0.35 / (2 * n_parts), 500)
    assert responses(s, outside)[0].max() < 3e-3


def plain_tree(x: np.ndarray, n_levels: int) -> dict[int, list[float]]:
    """Return the kurtoses by number of bands, by numpy's convolution, one node after the other."""

    def parts(z: np.ndarray, n_parts: int) -> list[np.ndarray]:
        n_side = 6 * n_parts - 1
        k = np.arange(-n_side, n_side + 1)
        h = np.sinc(k / (2 * n_parts)) * (0.54 + 0.46 * np.cos(np.pi * k / (n_side + 1)))
        out = []
        for i in range(n_parts):
            turned = h * np.exp(2j * np.pi * (2 * i + 1) / (4 * n_parts) * k)
            y = np.convolve(z, turned, "valid")[::n_parts]
            out.append(y * (-1.0) ** (i * np.arange(len(y))))
        return out

    def kurtosis(z: np.ndarray) -> float:
        return float(np.mean(np.abs(z) ** 4) / np.mean(np.abs(z) ** 2) ** 2 - 2)

    nodes, found = [x - x.mean()], {}
    for level in range(n_levels):
        found[3 * 2**level] = [kurtosis(p) for z in nodes for p in parts(z, 3)]
        nodes = [p for z in nodes for p in parts(z, 2)]
        found[2 ** (level + 1)] = [kurtosis(z) for z in nodes]
    return found


@pytest.mark.parametrize("n", [(1 << 16) + 4097, (1 << 16) - 1, 40_000, 1 << 17])
def test_piecewise_tree_is_the_plain_one(n):
    x = np.random.default_rng(n).laplace(size=n)
    ours = kurtogram(x, FS, n_levels=3)
    for n_bands, expected in plain_tree(x, 3).items():
        assert ours.kurtosis[np.isclose(ours.level, np.log2(n_bands))] == pytest.approx(expected, abs=1e-11)
    assert ours.kurtosis[0] == pytest.approx(np.mean((x - x.mean()) ** 4) / x.var() ** 2 - 3, abs=1e-11)


def test_closed_forms_of_a_band():
    """A sine: ⟨|z|⁴⟩/⟨|z|²⟩² = 1. Modulated fully by a cosine: |z|² ~ (1 + cos)², moments 3/2 and 35/8."""
    t = np.arange(1 << 15) / FS
    sine = np.cos(2 * np.pi * 3700 * t)
    k = kurtogram(sine, FS)
    inside = (k.low_hz < 3600) & (k.high_hz > 3800) & (k.level > 0)
    assert k.kurtosis[inside] == pytest.approx(-1.0, abs=1e-4)
    k = kurtogram(sine * (1 + np.cos(2 * np.pi * 20 * t)), FS, n_levels=3)
    assert k.kurtosis[(k.low_hz < 3400) & (k.high_hz > 4000) & (k.level > 0)] == pytest.approx(
        35 / 8 / 1.5**2 - 2, abs=0.02
    )


def test_standard_error_is_that_of_noise():
    rng = np.random.default_rng(5)
    runs = [kurtogram(rng.normal(size=1 << 14), FS) for _ in range(60)]
    z = np.array([(r.kurtosis - 0.0) / r.standard_error for r in runs])
    for level in runs[0].levels[1:]:
        assert z[:, runs[0].level == level].std() == pytest.approx(1.0, abs=0.2)
    exceed = np.mean([(r.kurtosis > r.noise_limit).any() for r in runs])
    assert exceed <= 0.15
    assert any("noise alone reaches" in remark for remark in runs[0].warnings(runs[0].best_band()))


@pytest.mark.parametrize("resonance_hz", [2300.0, 6000.0, 8800.0])
def test_best_band_holds_the_resonance(resonance_hz):
    x = impacts(60_001, np.random.default_rng(1), resonance_hz=resonance_hz)
    band = kurtogram(recording_of(x), "a").best_band(narrowest_hz=300)
    assert band.low_hz <= resonance_hz <= band.high_hz
    assert kurtogram(x, FS).warnings(band) == ()


def test_envelope_spectrum_in_its_own_band_shows_the_rate():
    chosen = kurtogram_envelope(
        recording_of(impacts(60_001, np.random.default_rng(2))), "a", highest_modulation_hz=400.0
    )
    assert chosen.band.high_hz - chosen.band.low_hz >= 1200
    assert chosen.envelope.band_hz == chosen.band.band_hz
    position, value = chosen.spectrum.largest_near(97.0, 90.0)
    assert position == pytest.approx(97.0, abs=1.5)
    assert value > 5 * noise_floor(chosen.spectrum).values[chosen.spectrum.index_of(position)]
    assert chosen.warnings == ()


def test_one_shock_is_remarked_upon():
    x = np.random.default_rng(3).normal(size=40_000)
    x[20_000:20_004] += 60.0
    k = kurtogram(x, FS)
    assert any("single event" in remark for remark in k.warnings(k.best_band()))


def test_tones_removed_uncovers_impulses_beside_a_mesh_line():
    rng = np.random.default_rng(4)
    x = impacts(60_000, rng, noise=0.2)
    t = np.arange(len(x)) / FS
    # The mesh line lies a line's third off the grid, at a steady speed, in the impulses' own band.
    buried = x + 3.0 * np.cos(2 * np.pi * 6000.1 * t)
    inside = kurtogram(buried, FS, n_levels=3)
    at = int(np.argmin(np.abs(inside.low_hz + inside.high_hz - 2 * 5833)))
    assert inside.kurtosis[at] < 0.0
    cleaned = kurtogram(buried, FS, n_levels=3, preparation="tones removed")
    assert cleaned.kurtosis[at] > 0.5 * kurtogram(x, FS, n_levels=3).kurtosis[at] > 0.5


def test_whitening_makes_all_lines_equal():
    x = np.random.default_rng(0).normal(size=4001).cumsum()
    white = prepared_signal(x, FS, "whitened")
    lines = np.abs(np.fft.rfft(white))[1:]
    assert lines == pytest.approx(lines.mean())
    assert white.var() == pytest.approx(1.0, rel=1e-3)


@settings(max_examples=15)
@given(st.integers(1024, 6000), st.floats(1e-6, 1e6), st.floats(-10, 10))
def test_kurtosis_ignores_gain_and_mean(n, gain, mean):
    x = np.random.default_rng(n).laplace(size=n)
    a, b = kurtogram(x, FS), kurtogram(gain * (x + mean), FS)
    assert b.kurtosis == pytest.approx(a.kurtosis, abs=1e-7)
    assert np.all(a.kurtosis >= -1.0 - 1e-9)


def test_float32_and_one_sample_more_or_less():
    x = impacts(50_001, np.random.default_rng(8)).astype(np.float32)
    k = kurtogram(x, FS, n_levels=4)
    assert kurtogram(x.astype(np.float64), FS, n_levels=4).kurtosis == pytest.approx(k.kurtosis, abs=5e-6)
    for shorter in (x[:-1], x[:-2]):
        other = kurtogram(shorter, FS, n_levels=4)
        assert other.kurtosis == pytest.approx(k.kurtosis, rel=0.01, abs=0.01)
        assert other.best_band().band_hz == k.best_band().band_hz


def test_bad_input_names_the_remedy():
    x = np.random.default_rng(0).normal(size=4000)
    with pytest.raises(InputError, match="1 to 2"):
        kurtogram(x, FS, n_levels=3)
    with pytest.raises(RefusalError, match="record at least 1024"):
        kurtogram(x[:1000], FS)
    with pytest.raises(RefusalError, match="constant"):
        kurtogram(np.full(4000, 3.3), FS)
    with pytest.raises(InputError, match="NaN"):
        kurtogram(np.where(np.arange(4000) == 7, np.nan, x), FS)
    with pytest.raises(InputError, match="preparation"):
        kurtogram(x, FS, preparation="white")  # type: ignore[arg-type]
    with pytest.raises(RefusalError, match="no band"):
        kurtogram(x, FS).best_band(narrowest_hz=FS)
    with pytest.raises(InputError, match="no channel"):
        kurtogram(recording_of(x), "b")


@pytest.mark.skipif(not DATA.is_dir(), reason="the measured recordings are not here")
@pytest.mark.parametrize("preparation", ["none", "tones removed", "whitened"])
@pytest.mark.parametrize(
    ("file", "race_hz", "other_hz"),
    [("InnerRaceFault_vload_3.mat", 118.875, 81.125), ("OuterRaceFault_vload_4.mat", 81.125, 118.875)],
)
def test_bearing_race_is_named_through_the_kurtograms_own_band(file, race_hz, other_hz, preparation):
    recording = read_recording(DATA / file)
    chosen = kurtogram_envelope(recording, "gs", preparation=preparation, highest_modulation_hz=600.0)
    assert chosen.warnings == ()
    floor = noise_floor(chosen.spectrum).values

    def over_floor(hertz: float) -> float:
        position, value = chosen.spectrum.largest_near(hertz, 0.02 * hertz)
        return value / floor[chosen.spectrum.index_of(position)]

    largest = chosen.spectrum.positions[10 + np.argmax(chosen.spectrum.values[10:])]
    assert over_floor(race_hz) > max(8.0, 2.5 * over_floor(other_hz))
    assert min(abs(largest / race_hz - h) / h for h in (1, 2, 3, 4)) < 0.02


def test_a_band_may_be_given_and_has_the_kurtosis_of_the_tree_there():
    x = impacts(200_000, np.random.default_rng(1))
    chosen = kurtogram_envelope(recording_of(x), "a")
    given_one = kurtogram_envelope(recording_of(x), "a", band_hz=chosen.band.band_hz)
    assert given_one.band.band_hz == chosen.band.band_hz
    assert given_one.band.level == pytest.approx(chosen.band.level)
    assert given_one.band.kurtosis == pytest.approx(chosen.band.kurtosis, rel=0.25)  # the filters' skirts differ
    assert given_one.band.standard_error == pytest.approx(chosen.band.standard_error, rel=0.02)
    np.testing.assert_array_equal(given_one.spectrum.values, chosen.spectrum.values)


@pytest.mark.parametrize("band_hz", [(3000.0, 11_000.0), (4000.0, 3000.0), (0.0, 0.01), (float("nan"), 3000.0)])
def test_a_band_outside_of_the_spectrum_is_refused(band_hz):
    x = np.random.default_rng(2).normal(size=20_000)
    with pytest.raises(InputError, match="band"):
        kurtogram_envelope(recording_of(x), "a", band_hz=band_hz)


@pytest.mark.parametrize("highest_hz", [1e-9, 4000.0, 0.0, float("nan")])
def test_a_modulation_that_no_envelope_shows_is_refused(highest_hz):
    x = np.random.default_rng(2).normal(size=20_000)
    with pytest.raises(InputError, match="highest_modulation_hz is"):
        kurtogram_envelope(recording_of(x), "a", highest_modulation_hz=highest_hz)


def test_the_reason_names_narrower_bands_of_more_kurtosis():
    x = impacts(2**17, np.random.default_rng(5))
    narrow = kurtogram_envelope(recording_of(x), "a")
    assert narrow.reason == "It has the largest kurtosis."
    x += 30.0 * (np.arange(len(x)) % 40_000 < 4000) * np.cos(2 * np.pi * 2000.0 / FS * np.arange(len(x)))
    wide = kurtogram_envelope(recording_of(x), "a", highest_modulation_hz=FS / 12)
    best = wide.kurtogram.best_band()
    assert best.kurtosis > wide.band.kurtosis
    assert f"Narrower ones reach {best.kurtosis:.3g}" in wide.reason
    assert f"at least {FS / 4:.4g} Hz wide, three times the highest modulation" in wide.reason
    assert kurtogram_envelope(recording_of(x), "a", band_hz=(1000.0, 3000.0)).reason == ""


def test_a_slow_change_of_level_hardly_stands_out():
    rng = np.random.default_rng(6)
    n = 2**18
    x = rng.normal(size=n) * (1.0 + 0.2 * np.cos(2 * np.pi * 3.0 * np.arange(n) / FS))
    k = kurtogram(x, FS, n_levels=3)
    assert any("hardly stands out" in remark for remark in k.warnings(k.best_band()))


def test_the_whole_spectrum_is_no_band_where_a_part_of_it_is_wide_enough():
    x = np.zeros(40_000)
    x[::400] = 1.0  # impacts that ring nowhere: the whole spectrum is as impulsive as can be
    x += 0.01 * np.random.default_rng(0).normal(size=len(x))
    assert kurtogram(x, FS).best_band(narrowest_hz=FS / 8).level == 0
    chosen = kurtogram_envelope(recording_of(x), "a", narrowest_hz=FS / 8)
    assert chosen.band.level > 0
    assert "The whole spectrum reaches" in chosen.reason
    whole = kurtogram_envelope(recording_of(x), "a", narrowest_hz=FS / 2)
    assert whole.band.level == 0
    assert "no part of it is wide enough" in whole.reason
