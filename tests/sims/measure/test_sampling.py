"""Anti-alias filter and sampling: pass band, rejection, no delay, ratios of rates."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gearsig.errors import InputError
from sims.measure import AntiAlias, ratio_of_rates

RATE = 20480.0


def sampled(frequency_hz, step_s, filter_=None, n_samples=400, first=100, phase=0.4, rate=RATE):
    t = np.arange(round((first + n_samples + 100) / rate / step_s)) * step_s
    x = np.cos(2 * np.pi * frequency_hz * t + phase)
    out = (filter_ or AntiAlias()).sample(x[None], step_s, rate, first, n_samples)[0]
    return out, np.cos(2 * np.pi * frequency_hz * (first + np.arange(n_samples)) / rate + phase)


@settings(max_examples=25, deadline=None)
@given(st.floats(0.0, 0.4), st.sampled_from([4e-6, 1 / (12 * RATE), 1 / RATE / 5.5]), st.integers(60, 300))
def test_pass_band_keeps_amplitude_phase_and_time(fraction, step_s, first):
    out, expected = sampled(fraction * RATE, step_s, first=first, n_samples=100)
    np.testing.assert_allclose(out, expected, atol=4 * AntiAlias().passband_error)


@settings(max_examples=25, deadline=None)
@given(st.floats(0.5, 5.0), st.sampled_from([4e-6, 1 / (12 * RATE)]))
def test_what_would_alias_is_rejected(fraction, step_s):
    out, _ = sampled(fraction * RATE, step_s)
    assert 20 * np.log10(np.abs(out).max()) < -88.0


def test_rejection_follows_the_filter_asked_for():
    for attenuation in (50.0, 70.0, 110.0):
        worst = max(
            np.abs(sampled(f * RATE, 4e-6, AntiAlias(attenuation))[0]).max() for f in (0.5, 0.52, 0.55, 0.6, 0.9, 1.3)
        )
        assert -attenuation - 25 < 20 * np.log10(worst) < -attenuation + 2


def test_without_the_filter_the_tone_would_alias():
    """The rejected tone lies well inside the band after plain picking of samples: the filter is what removes it."""
    step = 1 / (12 * RATE)
    t = np.arange(12 * 600) * step
    picked = np.cos(2 * np.pi * 0.9 * RATE * t)[::12]
    assert np.abs(picked).max() > 0.99


def test_same_rate_passes_through():
    x = np.random.default_rng(0).standard_normal((2, 1000))
    t = np.arange(1000)
    x = np.cos(2 * np.pi * np.array([[0.1], [0.3]]) * t)
    out = AntiAlias().sample(x, 1 / RATE, RATE, 100, 700)
    np.testing.assert_allclose(out, x[:, 100:800], atol=4 * AntiAlias().passband_error)


def test_ratios_of_rates():
    assert ratio_of_rates(4e-6, 20480.0) == (256, 3125)
    assert ratio_of_rates(1 / (12 * RATE), RATE) == (1, 12)
    with pytest.raises(InputError, match="does not go into"):
        ratio_of_rates(np.pi * 1e-6, RATE)
    with pytest.raises(InputError, match="at most the solver's rate"):
        ratio_of_rates(1e-4, RATE)


def test_samples_past_the_ends_are_refused():
    filter_ = AntiAlias()
    n = round(0.02 / 4e-6)
    with pytest.raises(InputError, match="simulate longer"):
        filter_.sample(np.zeros((1, n)), 4e-6, RATE, 0, 10)
    with pytest.raises(InputError, match="simulate longer"):
        filter_.sample(np.zeros((1, n)), 4e-6, RATE, 100, 400)
