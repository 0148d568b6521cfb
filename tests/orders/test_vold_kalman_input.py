"""What the Vold–Kalman filter refuses, and what it says."""

import numpy as np
import pytest

from gearsig.angle import ShaftAngle
from gearsig.errors import InputError, RefusalError
from gearsig.orders import (
    FrequencyTrack,
    track_vold_kalman,
)
from gearsig.recording import Channel, Recording
from gearsig.rig import ConstantSpeed

N, RATE_HZ = 4000, 1000.0
T = np.arange(N) / RATE_HZ
RECORDING = Recording(np.cos(2 * np.pi * 50 * T)[None], RATE_HZ, (Channel("a"),), speed=ConstantSpeed(1500.0))


def test_the_speed_source_of_the_recording_is_used():
    found = track_vold_kalman(RECORDING, "a", [2.0], bandwidth_hz=2.0)
    assert np.abs(found.orders[0].amplitude - 1).max() < 1e-7
    assert found.orders[0].frequency_hz == pytest.approx(50.0)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"orders": []}, "no orders are given"),
        ({"orders": [-1.0]}, "order -1"),
        ({"orders": [2.0, 2.0]}, "drift apart by only 0 cycles"),
        ({"orders": [("middle", 2.0)]}, "ratio of shaft 'middle'"),
        ({"orders": [FrequencyTrack("f", np.ones(10))]}, "has 10 samples"),
        ({"channel": "b"}, "no channel 'b'"),
        ({"bandwidth_hz": 0.2}, "at least 0.25 Hz"),
        ({"bandwidth_hz": 0.0}, "bandwidth_hz is 0"),
        ({"bandwidth_hz": np.nan}, "bandwidth_hz is nan"),
        ({"bandwidth_hz": [1.0, 2.0]}, "one number, or one for each"),
        ({"bandwidth_hz": "4Hz"}, "bandwidth_hz is '4Hz' .allowed: a number"),
        ({"bandwidth_hz": ["a"]}, "bandwidth_hz is 'a'"),
        ({"bandwidth_hz": None}, "either bandwidth_hz or bandwidth_orders"),
        ({"bandwidth_orders": 1.0}, "either bandwidth_hz or bandwidth_orders"),
        ({"bandwidth_hz": None, "bandwidth_orders": 4.0}, "reaches down to order zero"),
        ({"n_poles": 4}, "n_poles is 4 .allowed: a whole number from 1 to 3"),
        ({"n_poles": 0}, "n_poles is 0"),
        ({"generation": "third"}, "generation is 'third'"),
    ],
)
def test_wrong_input(changes, message):
    arguments = {"channel": "a", "orders": [2.0], "bandwidth_hz": 2.0} | changes
    with pytest.raises(InputError, match=message):
        track_vold_kalman(RECORDING, **arguments)


def test_nan_and_short_signals():
    with pytest.raises(InputError, match="NaN"):
        track_vold_kalman(np.full(N, np.nan), RATE_HZ, [np.full(N, 50.0)], bandwidth_hz=2.0)
    with pytest.raises(InputError, match="empty"):
        track_vold_kalman(np.array([]), RATE_HZ, [np.array([])], bandwidth_hz=2.0)
    with pytest.raises(InputError, match="at least 16"):
        track_vold_kalman(np.ones(15), RATE_HZ, [np.full(15, 50.0)], bandwidth_hz=90.0)
    with pytest.raises(InputError, match="NaN"):
        FrequencyTrack("f", np.array([1.0, np.nan]))
    with pytest.raises(InputError, match="negative"):
        FrequencyTrack("f", np.array([1.0, -1.0]))
    with pytest.raises(InputError, match="order of track 'f'"):
        FrequencyTrack("f", np.ones(9), order=-2.0)


@pytest.mark.parametrize(
    ("frequency_hz", "message"), [(0.0, "stands still"), (600.0, "half the sampling rate"), (0.5, "down to zero")]
)
def test_no_part_to_track(frequency_hz, message):
    with pytest.raises(RefusalError, match=message):
        track_vold_kalman(np.ones(N), RATE_HZ, [np.full(N, frequency_hz)], bandwidth_hz=2.0)


def test_a_machine_at_rest_is_refused():
    angle = ShaftAngle("s", np.array([0.0, 4.0]), np.zeros(2), np.zeros(2), "encoder")
    with pytest.raises(RefusalError, match="stands still"):
        track_vold_kalman(RECORDING, "a", [2.0], bandwidth_hz=2.0, shaft_angle=angle)


def test_a_frequency_track_has_no_speed():
    found = track_vold_kalman(RECORDING.values("a"), RATE_HZ, [np.full(N, 50.0)], bandwidth_hz=2.0)
    with pytest.raises(RefusalError, match="without a speed"):
        found.orders[0].tracked()
    assert found.time_s()[-1] == pytest.approx((N - 1) / RATE_HZ)


def test_bandwidths_too_different_for_one_solution_are_noted():
    found = track_vold_kalman(
        RECORDING.values("a"), RATE_HZ, [np.full(N, 50.0), np.full(N, 200.0)], bandwidth_hz=[0.3, 150.0], n_poles=3
    )
    assert any("rounding" in note for note in found.notes) == (found.expected_error > 1e-5)


@pytest.mark.parametrize(("frequency_hz", "width_hz", "room"), [(50.0, 600.0, "100 Hz"), (450.0, 120.0, "100 Hz")])
def test_a_bandwidth_wider_than_the_room_is_named(frequency_hz, width_hz, room):
    with pytest.raises(RefusalError, match=f"narrow the bandwidth below {room}"):
        track_vold_kalman(np.ones(N), RATE_HZ, [np.full(N, frequency_hz)], bandwidth_hz=width_hz)
