"""Families of lines: found where they are, and claimed by chance no more often than the p-value says."""

import numpy as np
import pytest

from gearsig.prepared import (
    best_comb,
    comb_at,
    lines_over_floor,
    lines_over_noise_floor,
    score_needed,
    tail_probability,
)
from gearsig.spectra import amplitude_spectrum

RATE_HZ = 1000.0
N = 20_000


def excess_of(values):  # type: ignore[no-untyped-def]
    return lines_over_noise_floor(amplitude_spectrum(values, RATE_HZ))


def family(fundamental_hz: float, amplitude: float, rng: np.random.Generator) -> np.ndarray:
    t = np.arange(N) / RATE_HZ
    noise = rng.normal(size=N)
    return noise + sum(amplitude * np.cos(2 * np.pi * k * fundamental_hz * t + k) for k in range(1, 7))


def test_a_weak_family_is_found_where_it_is() -> None:
    rng = np.random.default_rng(1)
    # 0.06 against noise of 1: each line stands 3 to 4 times above the amplitude of the noise in one line.
    comb = best_comb(excess_of(family(23.37, 0.06, rng)), 10.0, 60.0)
    assert comb is not None
    assert comb.fundamental == pytest.approx(23.37, abs=0.02)
    assert comb.p_value < 1e-4
    assert comb.positions[0] == pytest.approx(23.37, abs=0.05)


def test_noise_has_p_values_that_are_not_too_small() -> None:
    rng = np.random.default_rng(2)
    p_values = np.array([best_comb(excess_of(rng.normal(size=N)), 10.0, 60.0).p_value for _ in range(100)])  # type: ignore[union-attr]
    # Of 100 draws at level 0.05, 5 are expected; 14 or more have a chance of 5 in 10 000.
    assert np.sum(p_values < 0.05) < 14
    assert np.sum(p_values < 0.001) < 3


def test_coloured_noise_is_no_family() -> None:
    rng = np.random.default_rng(3)
    p_values = []
    for _ in range(60):
        walk = np.convolve(rng.normal(size=N + 50), np.exp(-np.arange(50) / 8) * np.cos(np.arange(50)), "valid")[:N]
        comb = best_comb(excess_of(walk), 10.0, 60.0)
        assert comb is not None
        p_values.append(comb.p_value)
    assert sum(p < 0.01 for p in p_values) <= 4


def test_masked_multiples_do_not_count() -> None:
    rng = np.random.default_rng(4)
    excess = excess_of(family(25.0, 1.0, rng))
    seen = best_comb(excess, 20.0, 30.0)
    hidden = best_comb(excess.without_multiples(25.0), 20.0, 30.0)
    assert seen is not None
    assert hidden is not None
    assert seen.p_value < 1e-10
    assert hidden.p_value > 1e-3
    assert excess.without_multiples(0.01) is excess  # closer than the lines: nothing could be left


def test_sidebands_around_carriers() -> None:
    t = np.arange(N) / RATE_HZ
    rng = np.random.default_rng(5)
    carrier = (1 + 0.2 * np.cos(2 * np.pi * 3.3 * t) + 0.1 * np.cos(2 * np.pi * 6.6 * t)) * np.cos(2 * np.pi * 120 * t)
    excess = excess_of(carrier + 0.3 * rng.normal(size=N)).without_multiples(120.0)
    comb = best_comb(excess, 2.0, 8.0, offsets=np.array([-2, -1, 1, 2]), centres=np.array([120.0]))
    assert comb is not None
    assert comb.fundamental == pytest.approx(3.3, abs=0.02)
    assert comb.p_value < 1e-4


def test_one_huge_line_is_no_family() -> None:
    t = np.arange(N) / RATE_HZ
    rng = np.random.default_rng(6)
    comb = best_comb(excess_of(100 * np.cos(2 * np.pi * 40 * t) + rng.normal(size=N)), 10.0, 60.0)
    assert comb is not None
    assert comb.p_value > 1e-3


def test_nothing_to_resolve() -> None:
    spectrum = amplitude_spectrum(np.random.default_rng(7).normal(size=256), RATE_HZ)
    assert best_comb(lines_over_floor(spectrum, np.ones(len(spectrum.values))), 1.0, 2.0) is None


def test_ranges_beyond_the_axis_are_cut_to_it() -> None:
    rng = np.random.default_rng(8)
    excess = excess_of(family(23.37, 0.2, rng))
    wide, far = best_comb(excess, 10.0, 1e9), best_comb(excess, 1e6, 1e9)
    assert wide is not None
    assert wide.fundamental == pytest.approx(23.37, abs=0.02)
    assert far is None


def test_pieces_of_a_search_make_the_same_family_as_the_whole(monkeypatch: pytest.MonkeyPatch) -> None:
    excess = excess_of(family(23.37, 0.06, np.random.default_rng(9)))
    whole = best_comb(excess, 10.0, 60.0)
    monkeypatch.setattr("gearsig.prepared._lines.CHUNK", 1000)
    assert best_comb(excess, 10.0, 60.0) == whole


def test_a_family_at_a_given_place_is_described() -> None:
    comb = comb_at(excess_of(family(23.37, 0.3, np.random.default_rng(10))), 23.36, np.arange(1, 11), 0.5)
    assert comb.fundamental == pytest.approx(23.37, abs=0.01)
    assert len(comb.positions) == 6
    assert comb.p_value == 0.5


def test_the_score_needed_is_rarely_reached_by_noise() -> None:
    rng = np.random.default_rng(11)
    reached = 0
    for _ in range(100):
        excess = excess_of(rng.normal(size=N))
        needed = score_needed(excess, 6, 20.0, 24.0, 0.05)
        comb = best_comb(excess, 20.0, 24.0)
        assert comb is not None
        assert (comb.p_value <= 0.05) == (comb.score >= needed) or abs(comb.score - needed) < 0.2
        reached += comb.score >= needed
    # 5 of 100 are expected; 14 or more have a chance of 5 in 10 000.
    assert reached < 14
    assert tail_probability(excess, 6, needed) < 0.05
    assert score_needed(excess, 6, 20.0, 24.0, 1e-300) == np.inf
