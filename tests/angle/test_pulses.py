"""Edges in tachometer channels."""

from __future__ import annotations

import numpy as np
import pytest

from gearsig.angle import find_pulse_edges
from gearsig.errors import InputError, RefusalError

RATE = 10_000.0


def motion() -> tuple[np.ndarray, np.ndarray]:
    t = np.arange(50_000) / RATE
    return t, 20 * t + 0.3 * np.sin(2 * np.pi * t)


def true_edges(phase: float) -> np.ndarray:
    t = np.linspace(0, 5, 5_000_001)
    theta = 20 * t + 0.3 * np.sin(2 * np.pi * t)
    return np.interp(np.arange(np.ceil(theta[0] - phase), theta[-1] - phase) + phase, theta, t)


@pytest.mark.parametrize(("edge", "phase"), [("rising", 0.0), ("falling", 0.5)])
def test_edges_of_a_sine_lie_between_the_samples(edge: str, phase: float) -> None:
    _, theta = motion()
    found = find_pulse_edges(np.sin(2 * np.pi * theta), RATE, edge=edge, threshold=0.0)
    truth = true_edges(phase)
    assert found.tick_s == 0.0
    times = found.times_s
    truth = truth[truth > 0.01] if edge == "rising" else truth
    assert len(times) == len(truth)
    assert np.abs(times - truth).max() < 2e-7  # a straight line instead of a sine, and 1e-4 s between samples


def test_jumps_within_a_sample_are_known_to_the_sampling_interval() -> None:
    _, theta = motion()
    rng = np.random.default_rng(0)
    pulses = np.where(theta % 1 < 0.05, 5.0, 0.0) + 0.1 * rng.normal(size=len(theta))
    found = find_pulse_edges(pulses, RATE)
    assert found.tick_s == 1 / RATE
    truth = true_edges(0.0)[-len(found.times_s) :]
    assert np.abs(found.times_s - truth).max() <= 0.51 / RATE


def test_hysteresis_keeps_noise_from_doubling_the_edges() -> None:
    _, theta = motion()
    noisy = np.sin(2 * np.pi * theta) + 0.08 * np.random.default_rng(1).normal(size=len(theta))
    assert len(find_pulse_edges(noisy, RATE).times_s) in (99, 100)
    assert len(find_pulse_edges(noisy, RATE, hysteresis=0.0).times_s) > 150


def test_no_levels_are_refused() -> None:
    with pytest.raises(RefusalError, match="stays at"):
        find_pulse_edges(np.zeros(1000), RATE)
    with pytest.raises(RefusalError, match="no two levels"):
        find_pulse_edges(np.random.default_rng(0).normal(size=10_000), RATE)


def test_a_wrong_edge_is_named() -> None:
    with pytest.raises(InputError, match="rising, falling"):
        find_pulse_edges(np.zeros(10), RATE, edge="up")


def test_a_single_short_pulse_is_found_by_its_own_levels() -> None:
    channel = np.zeros(100_000)
    channel[5000:5010] = 5.0
    edges = find_pulse_edges(channel + 1e-3 * np.random.default_rng(0).normal(size=len(channel)), 1000.0)
    assert edges.times_s == pytest.approx([5.0], abs=1e-3)
    assert edges.high == pytest.approx(5.0, abs=0.01)
