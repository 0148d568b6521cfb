"""Wavelet denoising: closed forms of the thresholds, noise alone, known signals, any length."""

from __future__ import annotations

import numpy as np
import pytest
import pywt
from hypothesis import given, settings
from hypothesis import strategies as st

from gearsig.decompose import (
    DenoiseSettings,
    apply,
    bayes,
    denoise,
    noise_level,
    sure,
    universal,
)
from gearsig.errors import InputError
from gearsig.recording import Channel, Recording
from gearsig.results import to_frame

N = 4096
RULES = ("soft", "hard", "garrote")
THRESHOLDS = ("universal", "sure", "bayes")


def _impacts(n: int = N) -> np.ndarray:
    """Return decaying bursts, as of a damaged tooth."""
    i = np.arange(n) % 512
    return 4.0 * np.exp(-i / 25.0) * np.sin(0.5 * i)


def _noise(n: int = N, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).normal(size=n)


def _gain_db(clean: np.ndarray, noisy: np.ndarray, denoised: np.ndarray) -> float:
    return 10 * np.log10(np.sum((noisy - clean) ** 2) / np.sum((denoised - clean) ** 2))


@pytest.mark.parametrize("rule", RULES)
@settings(max_examples=30)
@given(
    values=st.lists(st.integers(-1000, 1000).filter(bool), min_size=1, max_size=20),
    threshold=st.integers(0, 1000).map(lambda whole: whole + 0.5),
)
def test_rules_agree_with_pywt(rule, values, threshold):
    d = np.array(values, dtype=float)  # never equal to a threshold, where both may choose
    assert apply(d, threshold, rule) == pytest.approx(pywt.threshold(d, threshold, rule), rel=1e-12, abs=1e-9)


@pytest.mark.parametrize("rule", RULES)
def test_rules_at_their_ends(rule):
    d = np.array([-3.0, 0.0, 2.0])
    assert np.array_equal(apply(d, 0.0, rule), d)
    assert np.array_equal(apply(d, np.inf, rule), np.zeros(3))


def test_noise_level_of_known_quantiles():
    from scipy.stats import norm

    d = 2.5 * norm.ppf((np.arange(1001) + 0.5) / 1001)
    assert noise_level(d) == pytest.approx(2.5, rel=2e-3)


def test_sure_is_the_least_of_the_risk_on_all_thresholds():
    rng = np.random.default_rng(0)
    d = rng.normal(size=300) + np.where(np.arange(300) % 3 == 0, 6.0, 0.0)
    t = np.sort(np.abs(d))
    risk = [300 - 2 * np.sum(np.abs(d) <= v) + np.sum(np.minimum(np.abs(d), v) ** 2) for v in t]
    assert sure(2.0 * d, 2.0, 10**6) == pytest.approx(2.0 * t[int(np.argmin(risk))])


def test_sure_estimates_the_true_risk_without_bias():
    signal = np.where(np.arange(400) % 2 == 0, 3.0, 0.0)
    truth, estimate = [], []
    for seed in range(200):
        d = signal + np.random.default_rng(seed).normal(size=400)
        truth.append(np.sum((apply(d, 1.0, "soft") - signal) ** 2))
        estimate.append(400 - 2 * np.sum(np.abs(d) <= 1.0) + np.sum(np.minimum(np.abs(d), 1.0) ** 2))
    assert np.mean(estimate) == pytest.approx(np.mean(truth), rel=0.02)


def test_a_sparse_level_gets_the_universal_threshold():
    d = np.random.default_rng(0).normal(size=1000)
    d[5] = 8.0
    assert sure(d, 1.0, 4000) == universal(1.0, 4000)


def test_bayes_threshold_in_closed_form():
    d = np.array([5.0, -5.0, 5.0, 5.0])  # mean square 25 = 16 + 9
    assert bayes(d, 3.0) == pytest.approx(9.0 / 4.0)
    assert bayes(d, 6.0) == np.inf


@pytest.mark.parametrize("threshold", ["universal", "sure"])
@pytest.mark.parametrize("rule", RULES)
def test_of_noise_alone_next_to_nothing_is_left(threshold, rule):
    for seed in range(3):
        result = denoise(_noise(8192, seed), 1.0, DenoiseSettings(threshold, rule, n_levels=6))
        assert np.sqrt(np.mean(result.values**2)) < 0.2  # 1/64 of the energy lies below the coarsest level and stays
        assert max(level.kept_share for level in result.levels) < 0.01
        assert result.noise_rms == pytest.approx(1.0, abs=0.05)


@pytest.mark.parametrize("threshold", THRESHOLDS)
@pytest.mark.parametrize("rule", RULES)
def test_impacts_gain_in_signal_to_noise_ratio(threshold, rule):
    clean = _impacts()
    noisy = clean + 0.4 * _noise()
    one = denoise(noisy, 1.0, DenoiseSettings(threshold, rule, n_shifts=1))
    spun = denoise(noisy, 1.0, DenoiseSettings(threshold, rule, n_shifts=16))
    gain = _gain_db(clean, noisy, spun.values)
    assert gain > 1.5
    assert gain > _gain_db(clean, noisy, one.values)  # cycle spinning takes the artefacts out


def test_smooth_signals_gain_what_their_few_coefficients_promise():
    clean = np.sin(2 * np.pi * 3 * np.arange(N) / N)
    result = denoise(clean + 0.3 * _noise(), 1.0, DenoiseSettings(n_levels=6))
    # Only the approximation's N/64 coefficients carry noise: 18 dB, less the thresholds' and ends' small part.
    assert _gain_db(clean, clean + 0.3 * _noise(), result.values) == pytest.approx(10 * np.log10(64), abs=1.5)


def test_without_thresholds_the_signal_comes_back():
    x = _impacts(1001) + _noise(1001)
    tiny = denoise(x, 1.0, DenoiseSettings(noise_rms=1e-300, n_shifts=5))
    assert tiny.values == pytest.approx(x, abs=1e-10)  # the filter is tabulated to 1e-12


def test_one_transform_is_pywts_own():
    x = _impacts() + 0.3 * _noise()
    result = denoise(x, 1.0, DenoiseSettings(rule="hard", wavelet="db4", n_levels=4, n_shifts=1))
    coefficients = pywt.wavedec(x, "db4", mode="symmetric", level=4)
    sigma = np.median(np.abs(coefficients[-1])) / 0.6744897501960817
    limit = sigma * np.sqrt(2 * np.log(N))
    kept = [coefficients[0], *(pywt.threshold(d, limit, "hard") for d in coefficients[1:])]
    assert result.values == pytest.approx(pywt.waverec(kept, "db4", mode="symmetric"), abs=1e-12)
    assert [level.threshold for level in result.levels] == pytest.approx([limit] * 4)


def test_coloured_noise_is_met_level_by_level():
    coloured = np.convolve(_noise(N + 20), np.ones(8), mode="valid")[:N]
    white, each = (denoise(coloured, 1.0, DenoiseSettings(noise=scope)) for scope in ("finest level", "each level"))
    assert each.removed_share > white.removed_share + 0.3
    assert [level.noise for level in each.levels] == sorted(level.noise for level in each.levels)


@settings(max_examples=30)
@given(n=st.integers(100, 700), shifts=st.integers(1, 6), rule=st.sampled_from(RULES), kind=st.sampled_from(THRESHOLDS))
def test_any_length_splits_into_kept_and_removed(n, shifts, rule, kind):
    x = _impacts(n) + 0.2 * _noise(n)
    result = denoise(x, 1000.0, DenoiseSettings(kind, rule, n_shifts=shifts, wavelet="db3"))
    assert result.values.shape == (n,)
    assert result.values + result.removed == pytest.approx(x, abs=1e-12)
    assert result.levels[0].band_hz == (250.0, 500.0)


@pytest.mark.parametrize("factor", [1e-170, -3.0, 1e160])
def test_the_unit_does_not_matter(factor):
    x = _impacts(999) + 0.2 * _noise(999)
    for kind in THRESHOLDS:
        a, b = (denoise(v, 1.0, DenoiseSettings(kind, "garrote")) for v in (x, factor * x))
        assert b.values / factor == pytest.approx(a.values, abs=1e-12)
        assert b.noise_rms / abs(factor) == pytest.approx(a.noise_rms)


@pytest.mark.parametrize("n", [2000, 2001])
def test_a_sample_more_changes_only_the_end(n):
    x = _impacts() + 0.2 * _noise()
    known = DenoiseSettings(noise_rms=0.2, n_levels=5)
    a, b = denoise(x[:n], 1.0, known), denoise(x[: n + 1], 1.0, known)
    assert np.abs(a.values[:1500] - b.values[:1500]).max() < 1e-2


def test_single_precision_gives_the_same():
    x = (_impacts() + 0.2 * _noise()).astype(np.float32)
    assert np.array_equal(denoise(x, 1.0).values, denoise(x.astype(np.float64), 1.0).values)


def test_a_channel_carries_its_name_and_unit():
    recording = Recording(
        np.stack([_noise(), _impacts() + 0.2 * _noise()]), 100.0, (Channel("a"), Channel("b", unit="g"))
    )
    result = denoise(recording, "b")
    assert (result.source, result.unit, result.sampling_rate_hz) == ("b", "g", 100.0)
    assert list(to_frame(result.levels)["level"]) == [level.level for level in result.levels]


@pytest.mark.parametrize(
    ("values", "told", "message"),
    [
        (np.r_[np.nan, np.ones(99)], {}, "NaN"),
        (np.full(100, 2.0), {}, "constant"),
        (np.arange(12.0), {}, "shorter wavelet"),
        (np.arange(100.0), {"n_levels": 5}, "allowed: 1 to 2"),
        (np.arange(5.0), {"wavelet": "haar"}, "5 sample"),
    ],
)
def test_signals_that_do_not_do(values, told, message):
    with pytest.raises(InputError, match=message):
        denoise(values, 1.0, DenoiseSettings(**told))


@pytest.mark.parametrize(
    "wrong",
    [
        {"threshold": "minimax"},
        {"rule": "sft"},
        {"wavelet": "morl"},
        {"noise": "none"},
        {"n_levels": 0},
        {"n_shifts": 0},
        {"noise_rms": 0.0},
        {"noise_rms": 1.0, "noise": "each level"},
    ],
)
def test_settings_that_do_not_do(wrong):
    with pytest.raises(InputError):
        DenoiseSettings(**wrong)


def test_lines_that_fill_the_finest_level_are_no_noise() -> None:
    rng = np.random.default_rng(3)
    noise = 0.1 * rng.standard_normal(1 << 15)
    lines = 5.0 * np.cos(2.3 * np.arange(1 << 15)) + 3.0 * np.cos(2.6 * np.arange(1 << 15))
    kept = denoise(lines + noise, 1.0)
    taken = denoise(lines + noise, 1.0, DenoiseSettings(noise="finest level"))
    assert kept.noise_rms == pytest.approx(0.1, rel=0.15)
    assert kept.removed_share < 0.01
    assert taken.removed_share > 0.9
