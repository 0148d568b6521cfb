"""Tooth-local energy: found where it is, not seen in spectra without it, not taken from one shock."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gearsig.diagnosis.localisation import localise

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


@given(at=st.floats(0, 0.999), gain=st.floats(1e-6, 1e6))
@settings(max_examples=20, deadline=None)
def test_a_burst_is_found_at_its_angle_at_any_gain(at: float, gain: float) -> None:
    rng = np.random.default_rng(1)
    signal = gain * (0.2 * healthy(rng) + 10 * burst(at))[None, :]
    place = localise(signal, np.full((1, N), gain * 0.01), 1 / 30, 199, rng)
    distance = (place.angle_rev - at + 0.5) % 1 - 0.5
    assert abs(distance) < 1 / 30
    assert place.p_value == pytest.approx(1 / 200)
    assert place.ratio_db > 9
    assert place.repeatability > 100


def test_p_values_of_healthy_signals_are_uniform() -> None:
    rng = np.random.default_rng(2)
    p = np.array([localise(healthy(rng)[None, :], np.full((1, N), 0.1), 1 / 30, 199, rng).p_value for _ in range(150)])
    # Kolmogorov-Smirnov distance of 150 draws from the uniform distribution: above 0.16 with a chance of 1 in 1000.
    distance = np.max(np.abs(np.sort(p) - (np.arange(150) + 0.5) / 150))
    assert distance < 0.16


def test_channels_that_agree_make_it_surer() -> None:
    rng = np.random.default_rng(3)
    one = healthy(rng) + 15 * burst(0.3)
    other = healthy(rng) + 15 * burst(0.3)
    errors = np.full((2, N), 0.01)
    alone = localise(one[None, :], errors[:1], 1 / 30, 999, np.random.default_rng(0))
    both = localise(np.stack([one, other]), errors, 1 / 30, 999, np.random.default_rng(0))
    assert both.p_value <= alone.p_value
    assert abs(both.angle_rev - 0.3) < 1 / 30


def test_a_single_shock_is_not_repeatable() -> None:
    rng = np.random.default_rng(4)
    revolutions = np.stack([healthy(np.random.default_rng(9)) * 0.1 + 0.1 * rng.normal(size=N) for _ in range(50)])
    revolutions[17] += 100 * burst(0.6)
    errors = revolutions.std(axis=0, ddof=1) / np.sqrt(50)
    place = localise(revolutions.mean(axis=0)[None, :], errors[None, :], 1 / 30, 199, rng)
    assert abs(place.angle_rev - 0.6) < 1 / 30
    assert place.repeatability < 2


def test_a_dead_channel_does_not_disturb() -> None:
    rng = np.random.default_rng(5)
    signals = np.stack([0.1 * healthy(rng) + burst(0.5), np.zeros(N)])
    place = localise(signals, np.full((2, N), 0.01), 1 / 30, 99, rng)
    assert place.channel_shares[1] == 0
    assert abs(place.angle_rev - 0.5) < 1 / 30
