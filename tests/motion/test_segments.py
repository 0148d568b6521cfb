"""Segments of a shaft's motion, signals over an angle that stops and turns back, loops of torque over twist."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gearsig.errors import InputError, RefusalError
from gearsig.motion import (
    angle_profile,
    examine_start_stop,
    is_start_stop,
    measure_motion,
    motion_segments,
    torque_twist,
)
from sims.simulator import SimulationSetup
from tests.motion.recordings import continuous, start_stop, without

RATE = 1000.0


def moved(*pieces: tuple[float, float]) -> tuple[np.ndarray, np.ndarray]:
    """Angle and speed of pieces (duration in s, speed in rad/s)."""
    speed = np.concatenate([np.full(round(d * RATE), w) for d, w in pieces])
    return np.cumsum(speed) / RATE, speed


def test_segments_of_a_known_motion() -> None:
    angle, speed = moved((0.5, 0.0), (1.0, 10.0), (0.4, 0.0), (1.0, -10.0), (0.5, 10.0))
    segments = motion_segments(angle, RATE, speed)
    assert [s.direction for s in segments.segments] == [0, 1, 0, -1, 1]
    assert segments.starts_s == pytest.approx((0.5, 1.9))
    assert segments.stops_s == pytest.approx((1.5,))
    assert segments.n_reversals == 2
    assert segments.standing_part == pytest.approx(0.9 / 3.4)
    assert segments.backwards_rad == pytest.approx(10.0, abs=0.03)
    assert is_start_stop(segments)


def test_a_run_up_from_rest_is_no_start_stop_motion() -> None:
    angle, speed = moved((0.5, 0.0), *((0.05, w) for w in np.linspace(0.5, 20.0, 40)))
    segments = motion_segments(angle, RATE, speed)
    assert len(segments.starts_s) == 1
    assert not is_start_stop(segments)


def test_a_knock_on_a_standing_machine_is_no_start() -> None:
    angle, speed = moved((1.0, 10.0), (0.5, 0.0), (0.05, 2.0), (0.5, 0.0))
    segments = motion_segments(angle, RATE, speed)
    assert [s.direction for s in segments.segments] == [1, 0]


@given(st.floats(0.0, 0.3), st.integers(0, 1000))
def test_noise_makes_no_starts(sigma: float, seed: int) -> None:
    angle, speed = moved((0.5, 0.0), (1.0, 10.0), (0.5, 0.0))
    noisy = speed + sigma * np.random.default_rng(seed).standard_normal(len(speed))
    segments = motion_segments(angle, RATE, noisy)
    assert [s.direction for s in segments.segments] == [0, 1, 0]


def test_starts_and_stops_of_the_simulated_drive() -> None:
    recording = start_stop()
    segments = motion_segments(recording.values("pinion angle"), RATE)
    assert [s.direction for s in segments.segments] == [1, 0, 1, 0]
    assert segments.starts_s == pytest.approx((0.0, 3.0), abs=0.03)
    assert segments.stops_s == pytest.approx((1.14, 4.14), abs=0.03)
    assert is_start_stop(segments)
    assert not is_start_stop(motion_segments(continuous().values("pinion angle"), RATE))


def test_lengths_that_do_not_fit() -> None:
    with pytest.raises(InputError, match="equal numbers"):
        motion_segments(np.zeros(10), RATE, np.zeros(9))


def test_level_per_tooth_forwards_and_backwards_through_zero_speed() -> None:
    """A level that is a function of the tooth is found whatever the speed does; each direction has its own."""
    angle, _ = moved((1.0, 7.0), (0.3, 0.0), (0.6, -7.0), (0.3, 0.0), (1.2, 3.0))
    n_teeth = 12
    tooth = np.floor(angle * n_teeth / (2.0 * np.pi)).astype(int) % n_teeth
    segments = motion_segments(angle, RATE)
    sense = np.zeros(len(angle))
    for s in segments.moving:
        sense[s.first : s.last] = s.direction
    values = (1.0 + tooth) * np.where(sense < 0.0, 10.0, 1.0)
    profile = angle_profile(values, angle, segments, n_teeth)
    passed = profile.passes_forwards > 0
    assert profile.rms_forwards[passed] == pytest.approx(1.0 + np.flatnonzero(passed), rel=1e-9)
    back = profile.passes_backwards > 0
    assert 5 < np.count_nonzero(back) < n_teeth
    assert profile.rms_backwards[back] == pytest.approx(10.0 * (1.0 + np.flatnonzero(back)), rel=1e-9)
    assert np.all(np.isnan(profile.rms_backwards[~back]))


def test_slow_and_fast_passages_weigh_by_angle() -> None:
    """√(mean over angle) of a level that rises along the tooth, at whatever speed it is passed."""
    t = np.arange(0.0, 1.0, 1e-4)
    angle = 2.0 * np.pi * (t + 0.1 * np.sin(2.0 * np.pi * t) / np.pi)
    values = np.sqrt(np.mod(angle * 4.0 / (2.0 * np.pi), 1.0))
    profile = angle_profile(values, angle, motion_segments(angle, 1e4, np.gradient(angle, 1e-4)), 4)
    assert profile.rms_forwards == pytest.approx(np.sqrt(0.5), abs=2e-3)


def test_work_and_loss_of_the_loop_are_those_of_the_model() -> None:
    """∮ τ dδ is what leaves through the teeth: contact damping and their friction, all else being a state."""
    recording = start_stop(quiet=True, rate_hz=20_000.0)
    motion = measure_motion(recording)
    segments = motion_segments(motion.driver_angle_rad, 20_000.0)
    loop = torque_twist(motion, segments, 0.0)
    assert loop.n_cycles == 2
    from sims.forging import ForgingManipulator, respond

    ready = ForgingManipulator().prepare(SimulationSetup())
    run = respond(ready.drive, ready.profiles(6.0), duration_s=6.0, interval_s=1e-4)
    work = np.trapezoid(run["torque"] * run["pinion speed"], dx=1e-4)
    assert loop.work_per_cycle_j == pytest.approx(work / 2.0, rel=1e-3)
    assert loop.loss_per_cycle_j == pytest.approx(run["lost in contact"][-1] / 2.0, rel=0.5)
    assert loop.loss_uncertainty_j < 0.01 * loop.loss_per_cycle_j
    noisy_motion = measure_motion(start_stop())
    noisy = torque_twist(
        noisy_motion, motion_segments(noisy_motion.driver_angle_rad, noisy_motion.sampling_rate_hz), 0.0
    )
    assert abs(noisy.loss_per_cycle_j - loop.loss_per_cycle_j) < 3.0 * noisy.loss_uncertainty_j
    with pytest.raises(RefusalError, match="torque"):
        torque_twist(measure_motion(without(recording, "torque")), segments, 0.0)


def test_everything_at_once_and_what_is_refused() -> None:
    examined = examine_start_stop(measure_motion(start_stop()))
    named = {i.name: i.value for i in examined.indicators}
    assert (named["starts"], named["stops"]) == (2.0, 2.0)
    assert named["standing part"] == pytest.approx(0.62, abs=0.02)
    assert named["backlash"] == pytest.approx(300.0, rel=0.02)
    assert named["back impacts per cycle"] > 3.0
    assert named["impact loss per cycle"] > 0.05
    assert named["lost motion"] == pytest.approx(np.degrees(300e-6 / 0.047), rel=0.5)
    assert examined.portrait is not None
    assert examined.portrait.units == ("m", "m/s")
    # at 1 kHz a bounce now and then parts faster than it met: that one is refused, and said
    assert not examined.refusals
    assert all(text.startswith("The restitution of 1 of ") for text in examined.notes)
    assert all(i.note or not i.restitution > 1.0 for i in examined.impacts)
    steady = examine_start_stop(measure_motion(continuous()))
    assert steady.backlash is None
    assert any("back flank" in text for text in steady.refusals)
    # no loop closes, so that there is no work per cycle
    assert np.isnan({i.name: i.value for i in steady.indicators}["loop loss per cycle"])
    alone = examine_start_stop(measure_motion(without(continuous(), "torque")))
    assert alone.portrait is None
    assert alone.loop is None
    assert len(alone.refusals) == 2
