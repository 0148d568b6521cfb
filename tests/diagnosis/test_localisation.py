"""Tooth-local energy: found where it is, not seen in spectra without it, not taken from one shock."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gearsig.diagnosis import localise

N = 1024
ANGLE = np.arange(N) / N


def healthy(rng: np.random.Generator) -> np.ndarray:
    """A residual as good gears have it: many lines of random amplitude and phase."""
    orders = np.arange(3, 200)
    phases = rng.uniform(0, 2 * np.pi, len(orders))
    sizes = rng.rayleigh(1.0, len(orders)) / np.sqrt(orders)
    return sum(a * np.cos(2 * np.pi * o * ANGLE + p) for o, a, p in zip(orders, sizes, phases, strict=True))  # type: ignore[return-value]


def burst(at_rev: float) -> np.ndarray:
    distance = (ANGLE - at_rev) % 1.0
    return np.exp(-distance / 0.01) * np.cos(2 * np.pi * 120 * distance)


def halves_of(signals: np.ndarray, noise: float, rng: np.random.Generator) -> np.ndarray:
    """Odd and even revolutions of a machine that repeats itself, with noise of their own."""
    return signals[:, None, :] + noise * rng.normal(size=(len(signals), 2, N))


@given(at=st.floats(0, 0.999), gain=st.floats(1e-6, 1e6))
@settings(max_examples=20, deadline=None)
def test_a_burst_is_found_at_its_angle_at_any_gain(at: float, gain: float) -> None:
    rng = np.random.default_rng(1)
    signal = gain * (0.2 * healthy(rng) + 10 * burst(at))[None, :]
    place = localise(signal, halves_of(signal, gain * 0.01, rng), 1 / 30, 199, rng)
    distance = (place.angle_rev - at + 0.5) % 1 - 0.5
    assert abs(distance) < 1 / 30
    assert place.p_value < 0.005
    assert place.ratio_db > 9
    assert place.repeatability > 0.99


@pytest.mark.slow
def test_healthy_signals_seldom_have_small_p_values() -> None:
    rng = np.random.default_rng(2)
    p = []
    for _ in range(75):
        x = healthy(rng)[None, :]
        p.append(localise(x, halves_of(x, 0.1, rng), 1 / 30, 199, rng).p_value)
    # 3.75 of 75 would be at or below 0.05 if the p-value were exact; it may be too large, not too small.
    assert sum(value <= 0.05 for value in p) <= 9
    assert sum(value <= 0.01 for value in p) <= 3


def test_teeth_that_merely_differ_are_no_damage() -> None:
    """Each tooth engages a little stronger or weaker, in all harmonics: surrogates would take it for damage."""
    rng = np.random.default_rng(12)
    p = []
    for _ in range(60):
        strength = np.repeat(rng.normal(size=32), N // 32)
        waveform = strength * (np.cos(2 * np.pi * 32 * ANGLE) + 0.6 * np.cos(2 * np.pi * 64 * ANGLE + 1.0))
        x = (waveform + 0.01 * rng.normal(size=N))[None, :]
        p.append(localise(x, halves_of(x, 0.01, rng), 1 / 32, 199, rng).p_value)
    assert sum(value <= 0.05 for value in p) <= 7


def test_a_tooth_that_would_pass_among_unequal_ones_stands_out_of_its_own_neighbours() -> None:
    """12 dB over the median tooth is usual where energies scatter as the square of one number, not where by 1 dB."""
    rng = np.random.default_rng(4)
    strength = np.sqrt(rng.uniform(0.8, 1.25, 32))
    p = []
    for damaged in (1.0, 4.0):
        amplitude = np.repeat(strength * np.where(np.arange(32) == 9, damaged, 1.0), N // 32)
        x = (amplitude * rng.normal(size=N))[None, :]
        p.append(localise(x, halves_of(x, 0.01, rng), 1 / 32, 999, rng).p_value)
    assert p[0] > 0.05
    assert p[1] < 1e-3


def test_channels_that_agree_stand_out_more_than_one_alone() -> None:
    rng = np.random.default_rng(3)
    quiet = healthy(rng)
    damaged = healthy(rng) + 60 * burst(0.3)
    also_damaged = quiet + 60 * burst(0.3)
    one = np.stack([damaged, quiet])
    both = np.stack([damaged, also_damaged])
    in_one = localise(one, halves_of(one, 0.01, rng), 1 / 30, 999, np.random.default_rng(0))
    in_both = localise(both, halves_of(both, 0.01, rng), 1 / 30, 999, np.random.default_rng(0))
    assert in_both.ratio_db > in_one.ratio_db
    assert in_both.p_value < in_one.p_value
    assert in_one.channel_shares[0] > 4 * in_one.channel_shares[1]


def test_a_single_shock_is_not_repeatable() -> None:
    rng = np.random.default_rng(4)
    revolutions = np.stack([healthy(np.random.default_rng(9)) * 0.1 + 0.1 * rng.normal(size=N) for _ in range(50)])
    revolutions[17] += 100 * burst(0.6)
    halves = np.stack([revolutions[::2].mean(axis=0), revolutions[1::2].mean(axis=0)])
    place = localise(revolutions.mean(axis=0)[None, :], halves[None], 1 / 30, 199, rng)
    assert abs(place.angle_rev - 0.6) < 1 / 30
    assert place.repeatability < 0.5


def test_a_dead_channel_does_not_disturb() -> None:
    rng = np.random.default_rng(5)
    signals = np.stack([0.1 * healthy(rng) + 10 * burst(0.5), np.zeros(N)])
    place = localise(signals, halves_of(signals, 0.001, rng), 1 / 30, 99, rng)
    assert place.channel_shares[1] == 0
    assert abs(place.angle_rev - 0.5) < 1 / 30
