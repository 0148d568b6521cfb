"""Changed paths of the population: what a mode does to a tone at its frequency and away from it."""

from __future__ import annotations

import numpy as np
import pytest

from sims.effects import textbook

RATE_HZ = 10240.0
TIME_S = np.arange(10240) / RATE_HZ


def gain_at(change: textbook.PathChange, frequency_hz: float) -> float:
    tone = np.sin(2 * np.pi * frequency_hz * TIME_S)
    return float(change.of(tone, RATE_HZ).std() / tone.std())


def test_a_louder_mode_raises_its_own_frequency_and_no_other() -> None:
    change = textbook.PathChange(1.0, (textbook.ModeChange(1000.0, 0.03, 4.0, 1000.0),))
    assert gain_at(change, 1000.0) == pytest.approx(4.0, rel=1e-3)
    assert gain_at(change, 100.0) == pytest.approx(1.0, rel=1e-3)
    assert gain_at(change, 4000.0) == pytest.approx(1.0, rel=1e-2)


def test_a_mode_that_moved_leaves_what_is_far_below_and_peaks_at_its_new_place() -> None:
    change = textbook.PathChange(1.0, (textbook.ModeChange(1000.0, 0.03, 1.0, 1400.0),))
    assert gain_at(change, 50.0) == pytest.approx(1.0, rel=1e-2)
    assert gain_at(change, 1000.0) < 0.3
    assert gain_at(change, 1400.0) > 3.0


def test_the_channel_s_gain_multiplies_everything() -> None:
    assert gain_at(textbook.PathChange(1.7), 333.0) == pytest.approx(1.7, rel=1e-6)


def test_small_changes_are_small_and_some_are_of_one_channel_only() -> None:
    rng = np.random.default_rng(1)
    drawn = [textbook.draw_path_changes(2, 1e-3, RATE_HZ, rng) for _ in range(60)]
    assert all(gain_at(c, 500.0) == pytest.approx(1.0, abs=0.02) for pair in drawn for c in pair)
    alone = sum(textbook.PathChange() in pair for pair in drawn)
    assert 10 < alone < 40
