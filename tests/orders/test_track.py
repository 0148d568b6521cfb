"""Tracked orders: levels and phases of closed-form run-ups."""

import numpy as np
import pytest

from gearsig.angle import ShaftAngle, resample_to_angle
from gearsig.errors import InputError, RefusalError
from gearsig.orders import amplitude_at_speeds, track_order_bands, track_orders
from gearsig.recording import Channel, Recording

AMPLITUDES = {1: 0.5, 2.5: 0.2, 4: 2.0}
PHASES = {1: 0.3, 2.5: -1.0, 4: 2.0}


def _harmonics(r):
    return sum(a * np.cos(2 * np.pi * o * r + PHASES[o]) for o, a in AMPLITUDES.items())


@pytest.fixture(scope="module")
def run_up():
    """A run-up from 600 to 3600 rpm in 20 s, resampled from time."""
    t = np.arange(100_000) / 5000.0
    knots = np.linspace(0.0, 20.0, 201)
    angle = ShaftAngle("s", knots, 10 * knots + 1.25 * knots**2, 10 + 2.5 * knots, "pulses")
    recording = Recording(_harmonics(10 * t + 1.25 * t**2)[None, :], 5000.0, (Channel("a", "acceleration", "g"),))
    return resample_to_angle(recording, angle, highest_order=10.0)


@pytest.mark.parametrize("track", [track_orders, track_order_bands])
@pytest.mark.parametrize("order", AMPLITUDES)
def test_levels_of_a_run_up_within_a_tenth_of_a_decibel(run_up, track, order):
    (tracked,) = track(run_up, "a", [order])
    assert np.abs(20 * np.log10(tracked.amplitude / AMPLITUDES[order])).max() < 0.1
    assert tracked.speed_rpm[0] < 800
    assert tracked.speed_rpm[-1] > 3500
    assert tracked.speed_rpm == pytest.approx(
        60 * (10 + 2.5 * tracked.time_s), rel=0.02
    )  # mean in a block: middle in angle
    assert tracked.unit == "g"


@pytest.mark.parametrize("order", AMPLITUDES)
def test_phases_are_those_against_the_shaft_angle(run_up, order):
    (tracked,) = track_orders(run_up, "a", [order])
    assert np.abs(np.angle(np.exp(1j * (tracked.phase_rad - PHASES[order])))).max() < 0.01


@pytest.mark.parametrize("start", [0.0, 3.37])
def test_phase_counts_from_the_shafts_zero(angle_signal, start):
    signal = angle_signal(lambda r: np.cos(2 * np.pi * 3 * r + 0.7), 30, start=start)
    (tracked,) = track_orders(signal, "a", [3])
    assert tracked.phase_rad == pytest.approx(0.7, abs=1e-9)
    assert tracked.amplitude == pytest.approx(1.0, abs=1e-9)


def test_band_level_of_noise_is_density_times_bandwidth(angle_signal):
    rng = np.random.default_rng(0)
    signal = angle_signal(lambda r: rng.normal(size=len(r)), 4000, per_rev=64)
    (tracked,) = track_order_bands(signal, "a", [10.0], bandwidth_orders=0.25, revolutions_per_block=60)
    # 15 lines of 1/60 order are taken: density 2σ²/64 per order
    assert np.mean(tracked.amplitude**2) / 2 == pytest.approx(2 / 64 * 15 / 60, rel=0.1)


def test_band_keeps_the_sidebands_that_the_block_filter_takes_out(angle_signal):
    signal = angle_signal(
        lambda r: (1 + 0.8 * np.cos(2 * np.pi * r / 10)) * np.cos(2 * np.pi * 20 * r), 500, per_rev=64
    )
    (narrow,) = track_orders(signal, "a", [20.0], revolutions_per_block=40)
    (band,) = track_order_bands(signal, "a", [20.0], bandwidth_orders=0.3, revolutions_per_block=40)
    assert narrow.amplitude == pytest.approx(1.0, abs=1e-6)
    assert band.amplitude == pytest.approx(np.sqrt(1 + 0.8**2 / 2), abs=1e-6)


def test_levels_at_given_speeds(run_up):
    (tracked,) = track_orders(run_up, "a", [4])
    at = amplitude_at_speeds(tracked, np.array([100.0, 1000.0, 2000.0, 3000.0, 9000.0]))
    assert np.isnan(at[[0, -1]]).all()
    assert at[1:-1] == pytest.approx(2.0, rel=0.01)


def test_speeds_that_come_twice_have_no_level(angle_signal):
    (tracked,) = track_orders(angle_signal(np.cos, 100), "a", [1])
    with pytest.raises(RefusalError, match="rise or fall"):
        amplitude_at_speeds(tracked, np.array([600.0]))


def test_what_cannot_be_tracked_is_refused(angle_signal):
    signal = angle_signal(np.cos, 30)
    with pytest.raises(RefusalError, match="highest valid order"):
        track_orders(signal, "a", [200.0])
    with pytest.raises(RefusalError, match="does not fit"):
        track_orders(signal, "a", [1.0], revolutions_per_block=31)
    with pytest.raises(InputError, match="order"):
        track_orders(signal, "a", [])
    with pytest.raises(InputError, match=r"at least 0\.2"):
        track_order_bands(signal, "a", [1.0], revolutions_per_block=20, bandwidth_orders=0.1)
    with pytest.raises(InputError, match="above order zero"):
        track_order_bands(signal, "a", [0.1])
