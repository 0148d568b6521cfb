"""Agreement, averages and bands by their own closed forms."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gearsig.comparison import (
    HalvedLines,
    band_powers,
    frac,
    order_band_limits,
    power_levels,
    third_octave_limits,
    third_octaves,
    tooth_powers,
    waveform,
)
from gearsig.spectra import power_density

COMPLEX = st.complex_numbers(min_magnitude=0.1, max_magnitude=10.0)


@given(st.lists(COMPLEX, min_size=2, max_size=8), COMPLEX)
def test_frac_is_one_up_to_a_complex_factor_and_never_more(values: list[complex], factor: complex) -> None:
    x = np.array(values)
    assert frac(x, factor * x) == pytest.approx(1.0, rel=1e-12)
    assert frac(x, np.roll(x, 1)) <= 1.0 + 1e-12


def test_frac_of_lines_without_anything_in_common_is_zero() -> None:
    assert frac(np.array([1.0, 0.0]), np.array([0.0, 1.0])) == 0.0
    assert frac(np.zeros(3), np.ones(3)) == 0.0


def test_third_octaves_are_those_of_the_standard() -> None:
    bands = third_octave_limits(20.0, 20000.0)
    assert [round(nominal, 6) for nominal, _, _ in bands[:4]] == [25.0, 31.5, 40.0, 50.0]
    assert [nominal for nominal, _, _ in bands[-3:]] == [10000.0, 12500.0, 16000.0]
    for (_, _, high), (_, low, _) in pairwise(bands):
        assert high == pytest.approx(low)
    _, low, high = next(band for band in bands if band[0] == 1000.0)
    assert (low, high) == (pytest.approx(891.25, abs=0.01), pytest.approx(1122.02, abs=0.01))  # IEC 61260-1, table


def test_a_tone_is_in_its_third_octave_with_its_rms() -> None:
    time = np.arange(40000) / 8000.0
    x = 3.0 * np.cos(2 * np.pi * 1010.0 * time)
    bands = third_octaves((x, x), 8000.0, (2 * x, 2 * x), 8000.0)
    tone = next(band for band in bands if band.label == "1 kHz")
    assert tone.level.simulated_db == pytest.approx(20 * np.log10(3 / np.sqrt(2)), abs=0.01)
    assert tone.level.difference_db == pytest.approx(-6.0206, abs=1e-3)


def test_bands_share_out_all_of_the_power() -> None:
    x = np.random.default_rng(0).standard_normal(20000)
    density = power_density(x, 1000.0)
    edges = np.linspace(0.0, 500.0, 14)
    powers = band_powers(density, list(pairwise(edges)))
    assert powers.sum() == pytest.approx(np.sum(density.values) * density.resolution, rel=1e-3)


def test_bands_lie_around_the_mesh_harmonics() -> None:
    bands = order_band_limits(23.0, "", 100.0)
    assert [(low, high) for _, low, high in bands] == [(0.5, 11.5), (11.5, 34.5), (34.5, 57.5), (57.5, 80.5)]
    assert len(order_band_limits(None, "", 100.0)) == len(order_band_limits(80.0, "", 100.0)) == 10


def test_a_waveform_has_the_power_of_its_lines() -> None:
    lines = np.array([5.0, 1.0, 2j, 0.5])
    values = waveform(lines, 64)
    assert np.mean(values**2) == pytest.approx(1 + 4 + 0.25)
    assert np.mean(values) == pytest.approx(0.0, abs=1e-12)


def test_teeth_share_out_the_mean_square() -> None:
    values = np.random.default_rng(1).standard_normal(1000)
    powers = tooth_powers(values, 23)
    assert powers.mean() == pytest.approx(np.mean(values**2))
    assert tooth_powers(np.repeat([1.0, 0.0], 50), 2) == pytest.approx([1.0, 0.0])


def test_turning_lines_turns_the_waveform() -> None:
    x = np.random.default_rng(2).standard_normal(64)
    lines = np.fft.rfft(x)[None, :] * np.sqrt(2) / 64
    lines = lines[:, :20]
    turned = HalvedLines(lines, lines, 10).turned(5 / 64)
    assert waveform(turned.whole[0], 64) == pytest.approx(np.roll(waveform(lines[0], 64), 5))


def test_repeatability_of_levels_is_the_standard_error() -> None:
    """Of 4000 bands with known scatter in each half: that of the mean level is 1/√2 of it, of a difference as much."""
    rng = np.random.default_rng(3)
    scatter_db = 0.5
    powers = [10 ** (scatter_db * rng.standard_normal((2, 4000)) / 10) for _ in range(2)]
    levels = power_levels(powers[0], powers[1], smooth=1)
    differences = np.array([level.difference_db for level in levels])
    claimed = np.array([level.repeatability_db for level in levels])
    assert np.sqrt(np.mean(claimed**2)) == pytest.approx(np.std(differences), rel=0.05)
    assert np.std(differences) == pytest.approx(scatter_db, rel=0.05)
