"""Pulses of tachometers: found in a signal, and turned into a shaft's angle."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gearsig.angle import clock_tick, count_pulses, find_pulse_edges, pulse_train_angle
from gearsig.errors import InputError, RefusalError
from tests.measured import DATA, needs_data

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


# Pulse trains: closed-form motions, faults, quantised clocks, refusals.


def accelerated(n: int, start: float, acceleration: float, per_rev: int = 1) -> np.ndarray:
    """Times of n pulses at θ = start·t + acceleration·t²/2, θ from zero."""
    k = np.arange(n) / per_rev
    return 2 * k / (start + np.sqrt(start**2 + 2 * acceleration * k))


@pytest.mark.parametrize("per_rev", [1, 4, 60])
def test_speed_is_exact_at_constant_acceleration(per_rev: int) -> None:
    t = accelerated(200 * per_rev, 5.0, 4.0, per_rev)
    angle = pulse_train_angle(t, per_rev)
    np.testing.assert_allclose(angle.speed_rev_per_s, 5.0 + 4.0 * t, rtol=1e-9)
    assert angle.notes == ()


def test_speed_is_exact_from_a_standing_start() -> None:
    t = np.sqrt(np.arange(100) / 5.0)
    angle = pulse_train_angle(t)
    np.testing.assert_allclose(angle.speed_rev_per_s, 10.0 * t, rtol=1e-9, atol=1e-9)


def test_wandering_speed_between_the_pulses() -> None:
    grid = np.linspace(0, 10, 2_000_001)
    theta = 30 * grid + 0.9 / (2 * np.pi) * np.sin(2 * np.pi * grid)
    t = np.interp(np.arange(295 * 4) / 4, theta, grid)
    angle = pulse_train_angle(t, 4, tick_s=0.0)
    check = np.linspace(0.2, 9.5, 5001)
    truth = 30 + 0.9 * np.cos(2 * np.pi * check)
    np.testing.assert_allclose(angle.speed_rpm_at(check) / 60, truth, rtol=1e-5)


def test_quantised_clock_is_found_and_smoothed() -> None:
    t = accelerated(4000, 5.0, 2.0, 20)
    quantised = np.round(t * 25_600) / 25_600
    assert clock_tick(quantised) == pytest.approx(1 / 25_600, rel=1e-9)
    assert clock_tick(t) == 0.0
    angle = pulse_train_angle(quantised, 20)
    truth = 5.0 + 2.0 * t
    # One tick over one interval is what the unsmoothed speed is off by.
    one_tick = truth * 20 / 25_600
    error = np.abs(angle.speed_rev_per_s / truth - 1)
    assert np.all(error < one_tick)
    assert np.median(error) < 0.05 * np.median(one_tick)
    late = (angle.revolutions - np.arange(4000) / 20) / angle.speed_rev_per_s * 25_600
    assert np.abs(late).max() < 0.52  # within half a tick


@settings(deadline=None, max_examples=30)
@given(st.integers(0, 10_000))
def test_missed_and_spurious_pulses_are_counted(seed: int) -> None:
    rng = np.random.default_rng(seed)
    t = accelerated(399, 1.0, 3.0)
    where = rng.choice(np.arange(10, 380, 8), 12, replace=False)
    missed, before = where[:6], where[6:]
    spurious = t[before] + rng.uniform(0.03, 0.97, 6) * (t[before + 1] - t[before])
    faulty = np.sort(np.concatenate([np.delete(t, missed), spurious]))
    angle = pulse_train_angle(faulty, tick_s=0.0)
    assert angle.n_revolutions == pytest.approx(398.0)
    assert "6 of 399 pulses were spurious" in angle.notes[0]
    assert "6 missed" in angle.notes[1]
    ends = angle.revolutions_at(t[np.setdiff1d(np.arange(399), missed)]) - np.setdiff1d(np.arange(399), missed)
    assert np.abs(ends).max() < 0.51  # a spurious pulse close to its neighbour may be taken for it


def test_jitter_averages_out_of_the_mean_speed() -> None:
    rng = np.random.default_rng(3)
    t = np.arange(600) / 25.0 + rng.normal(0, 2e-3, 600)
    angle = pulse_train_angle(t, tick_s=0.0)
    error = angle.mean_speed_rpm / 1500.0 - 1
    assert abs(error) < 4 * angle.relative_speed_uncertainty
    assert 8e-5 < angle.relative_speed_uncertainty < 2e-4  # √2 · 2e-3 s / 24 s = 1.2e-4


def test_the_speed_is_no_surer_than_the_recorders_clock() -> None:
    angle = pulse_train_angle(np.arange(600) / 25.0, tick_s=0.0)
    assert angle.relative_speed_uncertainty == 5e-5


def test_a_stop_between_two_pulses_does_not_turn_the_shaft() -> None:
    up = np.sqrt(np.arange(60) / 5.0)
    down = up[-1] + np.cumsum(np.diff(up)[::-1])
    once = np.concatenate([up, down])
    t = np.concatenate([once, once[-1] + 7.3 + once])
    angle = pulse_train_angle(t, tick_s=0.0)
    assert angle.n_revolutions == len(t) - 1
    assert any("nearly stops" in note for note in angle.notes)
    fine = angle.revolutions_at(np.linspace(t[0], t[-1], 20_001))
    assert np.all(np.diff(fine) >= -1e-12)


@pytest.mark.parametrize("pulses_per_revolution", [1, 60])
def test_a_shaft_that_turns_back_stands_still_in_between(pulses_per_revolution: int) -> None:
    """Its pulses do not say that it turns back; those of a ring come late for their neighbours beside the turn."""
    t = np.arange(60_000) / RATE
    turned = np.cumsum(np.abs(22.0 * np.sin(2 * np.pi * t / 6.0 + 0.3))) / RATE
    at = np.searchsorted(turned, np.arange(1, turned[-1] * pulses_per_revolution) / pulses_per_revolution)
    angle = pulse_train_angle(t[at], pulses_per_revolution, tick_s=1 / RATE)
    low, high = angle.speed_range_rpm
    assert angle.standstills_s or low < 0.1 * high
    found = angle.revolutions_at(t[at])
    assert found - found[0] == pytest.approx(turned[at] - turned[at[0]], abs=0.15)


@settings(deadline=None, max_examples=25)
@given(st.floats(0.01, 100.0), st.floats(1.0, 50.0), st.floats(-0.5, 2.0))
def test_scaling_time_scales_speed(factor: float, start: float, acceleration: float) -> None:
    t = accelerated(50, start, acceleration * start**2 / 200)
    one = pulse_train_angle(t, tick_s=0.0)
    other = pulse_train_angle(t * factor, tick_s=0.0)
    np.testing.assert_allclose(other.speed_rev_per_s * factor, one.speed_rev_per_s, rtol=1e-9)
    np.testing.assert_allclose(other.revolutions, one.revolutions)


@settings(deadline=None, max_examples=20)
@given(st.integers(2, 64))
def test_more_pulses_per_revolution_tell_the_same_speed(per_rev: int) -> None:
    one = pulse_train_angle(accelerated(40, 10.0, 3.0), tick_s=0.0)
    many = pulse_train_angle(accelerated(39 * per_rev + 1, 10.0, 3.0, per_rev), per_rev, tick_s=0.0)
    assert many.n_revolutions == pytest.approx(one.n_revolutions)
    np.testing.assert_allclose(many.speed_rpm_at(one.time_s), one.speed_rpm_at(one.time_s), rtol=1e-9)


@pytest.mark.parametrize(
    ("times", "words"),
    [
        ([], "no pulses"),
        ([0.5], "only one pulse"),
        ([0.0, 0.1, 0.2, 0.15, 0.3], "pulse 3"),
        ([0.0, 0.1, 0.1], "pulse 2"),
    ],
)
def test_malformed_trains_are_named(times: list[float], words: str) -> None:
    with pytest.raises(InputError, match=words):
        pulse_train_angle(np.array(times))


def test_too_many_faults_are_refused() -> None:
    rng = np.random.default_rng(0)
    with pytest.raises(RefusalError):
        pulse_train_angle(np.cumsum(rng.exponential(1.0, 300)))


def test_a_long_gap_at_full_speed_is_refused() -> None:
    t = np.delete(np.arange(200) / 25.0, np.arange(80, 110))
    with pytest.raises(RefusalError, match="cannot be determined"):
        pulse_train_angle(t)


@needs_data
def test_measured_run_up_and_run_down() -> None:
    t = np.loadtxt(DATA / "tach_pulses" / "REC3642_tach_pulse_times.csv")
    angle = pulse_train_angle(t)
    assert angle.n_revolutions == pytest.approx(len(t) - 1, abs=1e-3)
    intervals = np.diff(t)
    # Mean speed of each revolution: within the clock's quantisation, one tick per interval, for all but the few late
    # pulses.
    speed = angle.speed_rpm_at(0.5 * (t[1:] + t[:-1]))
    off = np.abs(speed / (60 / intervals) - 1)[3:-3] * intervals[3:-3] * 25_600
    assert np.quantile(off, 0.9) < 1.0
    assert angle.speed_range_rpm[1] == pytest.approx(2983, rel=1 / 515)
    assert angle.speed_rev_per_s.argmax() not in (0, len(t) - 1)
    assert angle.speed_rev_per_s[0] < 6
    assert angle.speed_rev_per_s[-1] < 4


@pytest.mark.parametrize("n", [58, 59])
def test_a_speed_that_swings_from_one_revolution_to_the_next_is_no_fault_of_the_pulses(n: int) -> None:
    """Lightly loaded drives do: intervals of 97 and 75 ms in turn, at the ends as within."""
    t = np.concatenate([[0.0], np.cumsum(np.tile([0.0974, 0.0753], n)[:n])])
    counted = count_pulses(t)
    assert counted.n_missed == len(counted.spurious_s) == len(counted.open_gaps_s) == 0
