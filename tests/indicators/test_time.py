"""Time indicators: closed forms, invariances, undefined values, and another implementation."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy import stats

from gearsig.errors import InputError
from gearsig.indicators import (
    clearance_factor,
    crest_factor,
    impulse_factor,
    kurtosis,
    peak,
    peak_to_peak,
    rms,
    shape_factor,
    skewness,
    time_indicators,
)
from gearsig.recording import Channel, Recording

SINE = 2.5 * np.sin(2 * np.pi * (np.arange(4096) + 0.5) / 4096)
DIMENSIONLESS = (crest_factor, skewness, kurtosis, shape_factor, impulse_factor, clearance_factor)
WITH_UNIT = (rms, peak, peak_to_peak)
signals = arrays(np.float64, st.integers(8, 60), elements=st.integers(-1000, 1000).map(float))


def test_sine_has_its_closed_forms():
    assert rms(SINE) == pytest.approx(2.5 / math.sqrt(2), rel=1e-12)
    assert peak(SINE) == pytest.approx(2.5, rel=1e-6)
    assert peak_to_peak(SINE) == pytest.approx(5.0, rel=1e-6)
    assert crest_factor(SINE) == pytest.approx(math.sqrt(2), rel=1e-6)
    assert kurtosis(SINE) == pytest.approx(1.5, rel=1e-12)
    assert skewness(SINE) == pytest.approx(0.0, abs=1e-12)
    assert shape_factor(SINE) == pytest.approx(math.pi / (2 * math.sqrt(2)), rel=1e-6)
    assert impulse_factor(SINE) == pytest.approx(math.pi / 2, rel=1e-6)
    # mean √|sin| over a period is Γ(3/4)/(√π Γ(5/4)).
    mean_root = math.gamma(0.75) / (math.sqrt(math.pi) * math.gamma(1.25))
    assert clearance_factor(SINE) == pytest.approx(1 / mean_root**2, rel=1e-4)


def test_normal_noise_has_kurtosis_three():
    x = np.random.default_rng(1).standard_normal(400_000)
    # Standard deviation of a normal sample's kurtosis is √(24/N).
    assert kurtosis(x) == pytest.approx(3.0, abs=4 * math.sqrt(24 / x.size))


@pytest.mark.slow
@given(signals)
def test_agrees_with_scipy(x):
    if np.ptp(x) == 0:
        assert math.isnan(kurtosis(x))
        return
    assert kurtosis(x) == pytest.approx(stats.kurtosis(x, fisher=False), rel=1e-9)
    assert skewness(x) == pytest.approx(stats.skew(x), rel=1e-9, abs=1e-9)
    assert rms(x) == pytest.approx(stats.pmean(np.abs(x), 2), rel=1e-9)


@given(signals.filter(lambda x: np.ptp(x) > 0), st.floats(1e-6, 1e6), st.integers(-30, 30))
def test_gain_and_circular_shift(x, gain, shift):
    changed = np.roll(gain * x, shift)
    for f in DIMENSIONLESS:
        assert f(changed) == pytest.approx(f(x), rel=1e-9, abs=1e-9)
    for f in WITH_UNIT:
        assert f(changed) == pytest.approx(gain * f(x), rel=1e-9)


@given(signals.filter(lambda x: np.ptp(x) > 0))
def test_order_of_the_factors(x):
    tolerance = 1 + 1e-12
    assert crest_factor(x) * tolerance >= 1
    assert crest_factor(x) <= impulse_factor(x) * tolerance <= clearance_factor(x) * tolerance**2
    assert kurtosis(x) >= 1 + skewness(x) ** 2 - 1e-9


@pytest.mark.parametrize("scale", [1e-150, 1e150])
def test_extreme_sizes_neither_overflow_nor_vanish(scale):
    assert kurtosis(scale * SINE) == pytest.approx(1.5)
    assert rms(scale * SINE) == pytest.approx(scale * rms(SINE))


def test_constant_is_undefined_with_a_note():
    found = {i.name: i for i in time_indicators(np.full(50, 0.1), "a1", "g")}
    assert math.isnan(found["kurtosis"].value)
    assert "constant" in found["kurtosis"].note
    assert found["rms"].value == pytest.approx(0.1)
    zeros = {i.name: i for i in time_indicators(np.zeros(50))}
    assert all(math.isnan(zeros[n].value) for n in ("crest factor", "shape factor", "impulse factor"))
    assert zeros["rms"].value == 0.0


def test_zeros_have_no_negative_zeros():
    assert not any(math.copysign(1.0, i.value) < 0 for i in time_indicators(np.zeros(50)))


def test_a_number_beside_an_array_is_its_sampling_rate_as_elsewhere():
    assert time_indicators(SINE, 10_000.0) == time_indicators(SINE)
    assert [i.channel for i in time_indicators(SINE, 10_000.0)] == [""] * 9
    with pytest.raises(InputError, match="sampling rate"):
        time_indicators(SINE, -1.0)
    recording = Recording(SINE[None], 1000.0, (Channel("a1"),))
    with pytest.raises(InputError, match=r"10000\.0 \(allowed: a1\)"):
        time_indicators(recording, 10_000.0)


def test_indicators_carry_channel_unit_and_offset():
    found = {i.name: i for i in time_indicators(SINE + 10, "a1", "m/s^2", shaft="input", computed_on="x")}
    assert (found["rms"].unit, found["kurtosis"].unit) == ("m/s^2", "")
    assert (found["rms"].channel, found["rms"].shaft, found["rms"].computed_on) == ("a1", "input", "x")
    assert "mean of 10 m/s^2" in found["crest factor"].note
    assert found["kurtosis"].note == ""
    assert time_indicators(SINE)[0].note == ""


def test_float32_is_computed_in_double_precision():
    x = SINE.astype(np.float32)
    assert kurtosis(x) == kurtosis(x.astype(np.float64))


def test_bad_input():
    with pytest.raises(InputError, match="empty"):
        rms(np.array([]))
    with pytest.raises(InputError, match="NaN"):
        kurtosis(np.array([1.0, np.nan]))
