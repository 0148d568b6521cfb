"""Faults of teeth told apart, and measured, by the course of what they change."""

from __future__ import annotations

import numpy as np
import pytest

from gearsig.gap import SIDEBAND_OFFSETS as OFFSETS
from gearsig.gap import (
    UNKNOWN,
    AddedEffect,
    GapEffect,
    SimulatedWaveform,
    compare_waveform,
    waveform_match,
    with_likelihoods,
    with_profiles_between,
)
from gearsig.severity import OTHER

N_CHANNELS, N_HARMONICS = 2, 8
HARMONICS = np.arange(1, N_HARMONICS + 1)[:, None]
NOISE = np.full((N_CHANNELS, N_HARMONICS, len(OFFSETS)), 1e-6)


def course(centre: float, width: float, amplitude: float = 1.0, later_pitches: float = 0.0) -> np.ndarray:
    """Sidebands of a bump over the angle, of which every harmonic shows another part."""
    one = (
        amplitude
        * np.exp(-((width * OFFSETS) ** 2))
        * np.exp(-1j * OFFSETS * centre)
        * np.exp(1j * HARMONICS * width * 40.0)
        * np.exp(-2j * np.pi * HARMONICS * later_pitches)
    )
    return np.stack([one] * N_CHANNELS)


def noise_alone(seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    shape = course(0.0, 0.05).shape
    return rng.normal(size=shape) + 1j * rng.normal(size=shape)


def compared(observed: np.ndarray, simulated: np.ndarray, severity: float = 1.0, **how: float) -> SimulatedWaveform:
    found = compare_waveform(AddedEffect("root_crack", severity, {"gear": "driver"}), simulated, observed, NOISE, **how)  # type: ignore[arg-type]
    assert found is not None
    return found


def likely(observed: np.ndarray, simulated: np.ndarray, **how: float) -> float:
    match = waveform_match([compared(observed, simulated, **how)], 0.3, 3.0)
    assert match is not None
    return match.log_likelihood


@pytest.mark.parametrize("turn", [0.0, 1.3, -2.7])
def test_the_same_course_at_any_turn_and_scale_correlates_by_one(turn: float) -> None:
    found = compared(0.5 * course(turn, 0.05), course(0.0, 0.05))
    assert found.correlation == pytest.approx(1.0, abs=0.03)  # turns are looked at in steps
    assert found.log_size == pytest.approx(np.log(2.0), abs=1e-6)


def test_another_course_is_less_likely_and_noise_tells_nothing() -> None:
    seen = course(0.4, 0.05)
    same, other, by_chance = (likely(seen, trial) for trial in (course(0.0, 0.05), course(0.0, 0.11), noise_alone(4)))
    assert same > other + 5.0
    assert abs(by_chance) < 2.5
    assert compared(seen, noise_alone(5)).correlation < 0.4


def test_harmonics_that_the_healthy_twin_misses_tell_less() -> None:
    rng = np.random.default_rng(7)
    seen = course(0.4, 0.05) * np.exp(2j * np.pi * rng.uniform(size=(N_HARMONICS, 1)))
    strict, lenient = (likely(seen, course(0.0, 0.05), gain_scatter=alpha) for alpha in (0.3, 1.5))
    assert lenient > strict + 5.0  # what is not alike is no evidence against the fault
    same, other = (likely(course(0.4, 0.05), course(0.0, width), gain_scatter=1.5) for width in (0.05, 0.055))
    sure, unlikely = (likely(course(0.4, 0.05), course(0.0, width), gain_scatter=0.3) for width in (0.05, 0.055))
    assert sure - unlikely > same - other > 0.0  # nor is what is alike as much evidence for it


def test_the_severity_is_that_of_the_right_size_and_its_interval_holds_it() -> None:
    severities = (0.5, 1.0, 2.0, 4.0)  # sidebands grow as the square
    trials = [compared(course(1.0, 0.05, 1.7**2), course(0.0, 0.05, s**2), s) for s in severities]
    match = waveform_match(trials, 0.5, 4.0)
    assert match is not None
    assert match.severity.value == pytest.approx(1.7, rel=0.1)
    # ln g scatters by 0.7 about its severity's, ln s by half of that: 90 % from 0.96 to 3.0
    assert 0.8 < match.severity.low < 1.2
    assert 2.5 < match.severity.high < 3.5
    assert match.added.options == {"gear": "driver"}


def test_one_severity_grows_as_the_fullest_set_does() -> None:
    def with_length(length: float, severity: float) -> SimulatedWaveform:
        found = compare_waveform(
            AddedEffect("tooth_spall", severity, {"length_mm": length}),
            course(0.0, 0.03 * length, severity**2),
            course(1.0, 0.06, 0.25),
            NOISE,
        )
        assert found is not None
        return found

    trials = [*(with_length(1.0, s) for s in (0.25, 0.5, 1.0)), with_length(2.0, 1.0)]
    match = waveform_match(trials, 0.25, 1.0)
    assert match is not None
    assert match.added.options == {"length_mm": 2.0}
    assert match.severity.value == pytest.approx(0.5, rel=0.15)


def test_where_any_severity_fits_nothing_bounds_it() -> None:
    match = waveform_match([compared(noise_alone(1), course(0.0, 0.05), s) for s in (1.0, 2.0)], 1.0, 2.0)
    assert match is not None
    assert match.severity.is_unbounded
    assert not match.is_good


def test_where_nothing_was_seen_or_simulated_there_is_no_match() -> None:
    added = AddedEffect("root_crack", 1.0, {"gear": "driver"})
    nothing = 0.0 * course(0.0, 0.05)
    assert compare_waveform(added, course(0.0, 0.05), nothing, NOISE) is None
    assert compare_waveform(added, nothing, course(0.0, 0.05), NOISE) is None
    assert waveform_match([], 1.0, 2.0) is None


def test_a_fault_that_may_move_is_found_where_it_is_and_pays_for_its_freedom() -> None:
    seen = course(0.3, 0.05, later_pitches=0.13)
    fixed, free = (likely(seen, course(0.0, 0.05), moves_pitches=moves) for moves in (0.0, 0.24))
    known = likely(course(0.3, 0.05), course(0.0, 0.05))
    assert fixed < free - 5.0
    assert free < known - 0.5


def test_uneven_pitch_is_the_course_of_one_tooth_with_any_pattern() -> None:
    rng = np.random.default_rng(3)
    n_teeth = 40
    half = len(OFFSETS) // 2
    spread = np.sqrt(n_teeth / 8.0) / np.sin(np.pi * OFFSETS[half:] / n_teeth)
    pattern = spread * (rng.normal(size=half) + 1j * rng.normal(size=half)) / np.sqrt(2.0)
    both_sides = np.concatenate([np.conj(pattern[::-1]), pattern])
    seen = 3.0 * both_sides * course(0.0, 0.05)
    added = AddedEffect("pitch_error", 1.0, {"gear": "driver", "tooth": 1.0})
    every = compare_waveform(added, course(0.0, 0.05), seen, NOISE, n_teeth=n_teeth)
    assert every is not None
    assert every.correlation == pytest.approx(1.0, abs=0.01)
    match = waveform_match([every], 0.5, 20.0)
    assert match is not None
    assert match.severity.low < 3.0 / np.sqrt(2.0) < match.severity.high
    assert match.log_likelihood > likely(seen, course(0.0, 0.05)) + 5.0
    # A fault of one tooth has one size at all orders, and gains of harmonics are allowed it: a pattern is less likely.
    local = course(0.3, 0.05) * (1.0 + 0.3 * noise_alone(8)[:1, :, :1])
    as_pattern = compare_waveform(added, course(0.0, 0.05), local, NOISE, n_teeth=n_teeth)
    assert as_pattern is not None
    assert likely(local, course(0.0, 0.05)) > float(as_pattern.levels.max()) + 5.0


def test_a_pitch_error_of_one_tooth_tells_behind_from_ahead_and_one_tooth_from_all() -> None:
    seen = -2.0 * course(0.7, 0.05)  # a tooth that stands ahead, elsewhere on the gear
    hypotheses = {"behind": (course(0.0, 0.05), 0), "ahead": (-course(0.0, 0.05), 0), "all": (course(0.0, 0.05), 29)}
    levels = {}
    for name, (simulated, n_teeth) in hypotheses.items():
        compared = compare_waveform(AddedEffect("pitch_error", 1.0, {}), simulated, seen, NOISE, n_teeth=n_teeth)
        assert compared is not None
        levels[name] = float(compared.levels.max())
    assert levels["ahead"] > max(levels["behind"], levels["all"]) + 3.0


def two_steps(length_pitches: float, n_teeth: int = 20) -> np.ndarray:
    """What a spall's ends do, each the other's opposite, half a length before and behind the pitch point."""
    orders = HARMONICS + OFFSETS / n_teeth
    return np.stack([2j * np.sin(np.pi * orders * length_pitches)] * N_CHANNELS)


def alike(first: np.ndarray, second: np.ndarray) -> float:
    return float(np.real(np.vdot(first, second)) / np.linalg.norm(first) / np.linalg.norm(second))


def effect(**how: object) -> GapEffect:
    return GapEffect("spall", "tooth-local", "a spall", "width", "%", **how)  # type: ignore[arg-type]


def test_between_two_lengths_of_a_spall_lie_its_profiles_and_none_between_widths() -> None:
    def spall(length: float, width: float) -> tuple[AddedEffect, np.ndarray]:
        return AddedEffect("spall", width, {"gear": "driver", "length": length}), width * two_steps(length)

    trials = [spall(0.26, 10.0), spall(0.2, 10.0), spall(0.2, 20.0)]
    found = list(with_profiles_between(trials, effect(profile_varies_with="length"), 20))
    assert [(a.severity, a.options["length"]) for a, _ in found[3:]] == [(10.0, 0.215), (10.0, 0.23), (10.0, 0.245)]
    for added, sidebands in found:
        assert alike(sidebands, two_steps(float(added.options["length"]))) > 0.98
    assert alike(two_steps(0.2), two_steps(0.23)) < 0.95
    assert len(list(with_profiles_between(trials, effect(), 20))) == len(trials)


def test_a_profile_that_moves_with_the_severity_is_between_where_it_has_moved_half_way() -> None:
    chips = [
        (AddedEffect("chip", height, {"gear": "driver"}), height * course(0.0, 0.05, later_pitches=-0.2 * height))
        for height in (1.0, 2.0)
    ]
    for moves, low, high in ((0.1, 0.99, 1.0), (0.0, -1.0, 0.9)):
        moving = effect(profile_varies_with="width", moves_pitches=moves)
        middle = list(with_profiles_between(chips, moving, 10**6))[3]
        assert middle[0].severity == 1.5
        assert low < alike(middle[1], course(0.0, 0.05, later_pitches=-0.3)) <= high + 1e-12


def test_a_severity_that_a_profile_tells_is_as_uncertain_as_its_place() -> None:
    trials = [
        compared(course(0.4, 0.05), course(0.0, width), s) for s, width in ((1.0, 0.09), (1.5, 0.05), (2.2, 0.02))
    ]
    sharp, blurred = (waveform_match(trials, 1.0, 2.2, severity_scatter=scatter) for scatter in (0.0, 0.1))
    assert sharp is not None
    assert blurred is not None
    assert blurred.severity.high / blurred.severity.low > sharp.severity.high / sharp.severity.low
    assert blurred.log_likelihood == sharp.log_likelihood


def test_waveforms_part_what_faults_of_a_tooth_have_together() -> None:
    before = {"tooth_spall": 0.5, "root_crack": 0.3, "none": 0.2}
    after = with_likelihoods(before, {"tooth_spall": 0.0, "root_crack": 2.0})
    assert after["none"] == 0.2
    assert sum(after.values()) == pytest.approx(1.0)
    assert after["root_crack"] / after["tooth_spall"] == pytest.approx(0.6 * np.exp(2.0))
    assert next(iter(after)) == "root_crack"
    assert with_likelihoods(before, {"root_crack": 5.0}) == before


def test_the_transmission_error_changes_how_probable_a_damaged_tooth_is() -> None:
    """Odds of a damaged tooth are multiplied by its likelihood over that of other changes; shares of others stay."""
    before = {"root_crack": 0.3, "tooth_spall": 0.1, "unbalance": 0.4, "none": 0.2}
    after = with_likelihoods(before, {"root_crack": 0.0, "tooth_spall": 0.0, OTHER: -np.log(50.0)})
    damaged = after["root_crack"] + after["tooth_spall"]
    assert damaged / (1.0 - damaged) == pytest.approx(50.0 * 0.4 / 0.6)
    assert after["root_crack"] / after["tooth_spall"] == pytest.approx(3.0)
    assert after["unbalance"] / after["none"] == pytest.approx(2.0)
    assert sum(after.values()) == pytest.approx(1.0)
    assert with_likelihoods(before, {OTHER: -3.0}) == pytest.approx(before)


def test_an_unknown_cause_may_be_on_a_tooth_as_well() -> None:
    """A user's own fault of a tooth has no likelihood of its own."""
    before = {"root_crack": 0.1, "tooth_spall": 0.1, "none": 0.1, UNKNOWN: 0.7}
    after = with_likelihoods(before, {"root_crack": 0.0, "tooth_spall": 0.0, OTHER: -np.log(100.0)})
    assert after[UNKNOWN] / after["root_crack"] == pytest.approx(7.0 * 0.505)
    assert after["none"] < 0.01
