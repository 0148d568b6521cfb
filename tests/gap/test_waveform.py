"""Faults of one tooth told apart by the course of what they change."""

from __future__ import annotations

import numpy as np
import pytest

from gearsig.gap import SIDEBAND_OFFSETS as OFFSETS
from gearsig.gap import best_match, told_apart, waveform_log_likelihood

N_CHANNELS, N_HARMONICS = 2, 8
WEIGHTS = np.ones((N_CHANNELS, N_HARMONICS))


def course(centre: float, width: float, amplitude: float = 1.0) -> np.ndarray:
    """Sidebands of a bump over the angle, of which every harmonic shows another part."""
    harmonics = np.arange(1, N_HARMONICS + 1)[:, None]
    one = (
        amplitude
        * np.exp(-((width * OFFSETS) ** 2))
        * np.exp(-1j * OFFSETS * centre)
        * np.exp(1j * harmonics * width * 40.0)
    )
    return np.stack([one] * N_CHANNELS)


@pytest.mark.parametrize("turn", [0.0, 1.3, -2.7])
def test_the_same_course_at_any_turn_and_scale_correlates_by_one(turn: float) -> None:
    match = best_match(0.5 * course(turn, 0.05), WEIGHTS, [course(0.0, 0.05)])
    assert match is not None
    assert match.correlation == pytest.approx(1.0, abs=1e-3)
    assert match.scale == pytest.approx(0.5, rel=1e-3)


def test_another_course_correlates_less_and_noise_hardly() -> None:
    rng = np.random.default_rng(4)
    noise = rng.normal(size=course(0, 0.05).shape) + 1j * rng.normal(size=course(0, 0.05).shape)
    seen = course(0.4, 0.05)
    other, by_chance = (best_match(seen, WEIGHTS, [trial]) for trial in (course(0.0, 0.11), noise))
    assert other is not None
    assert by_chance is not None
    assert other.correlation < 0.95
    assert by_chance.correlation < 0.4
    assert by_chance.log_likelihood < 0.9


def test_the_severity_of_the_right_strength_is_likelier() -> None:
    trials = [course(0.0, 0.05, amplitude) for amplitude in (0.2, 1.0, 5.0)]
    match = best_match(course(1.0, 0.05, 1.1), WEIGHTS, trials)
    assert match is not None
    assert match.scale == pytest.approx(1.1, rel=1e-3)


def test_where_nothing_was_seen_or_simulated_there_is_no_match() -> None:
    assert best_match(course(0.0, 0.05), 0.0 * WEIGHTS, [course(0.0, 0.05)]) is None
    assert best_match(course(0.0, 0.05), WEIGHTS, []) is None


def test_waveforms_part_what_faults_of_a_tooth_have_together() -> None:
    before = {"tooth_spall": 0.5, "root_crack": 0.3, "none": 0.2}
    after = told_apart(before, {"tooth_spall": 0.0, "root_crack": 2.0})
    assert after["none"] == 0.2
    assert sum(after.values()) == pytest.approx(1.0)
    assert after["root_crack"] / after["tooth_spall"] == pytest.approx(0.6 * np.exp(2.0))
    assert next(iter(after)) == "root_crack"
    assert told_apart(before, {"root_crack": 5.0}) == before


def test_a_twin_that_resembles_nothing_says_nothing() -> None:
    assert waveform_log_likelihood(0.0, 0.0) == 0.0
    assert waveform_log_likelihood(0.15, 1.0) < 0.15
    assert waveform_log_likelihood(0.9, 1.0) > waveform_log_likelihood(0.9, 0.3) > 5.0


def test_a_fault_that_may_move_is_found_where_it_is_and_pays_for_its_freedom() -> None:
    harmonics = np.arange(1, N_HARMONICS + 1)[:, None]
    seen = course(0.3, 0.05) * np.exp(-2j * np.pi * harmonics * 0.13)
    fixed, free = (best_match(seen, WEIGHTS, [course(0.0, 0.05)], moves_pitches=moves) for moves in (0.0, 0.2))
    assert fixed is not None
    assert free is not None
    assert fixed.correlation < 0.6
    assert free.correlation == pytest.approx(1.0, abs=1e-3)
    known = best_match(course(0.3, 0.05), WEIGHTS, [course(0.0, 0.05)])
    assert known is not None
    assert fixed.log_likelihood < free.log_likelihood < known.log_likelihood - 1.0
