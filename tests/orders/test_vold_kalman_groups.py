"""Which orders are solved for together, the same answer either way, settled parts, orders over angle."""

from dataclasses import replace

import numpy as np
import pytest

from gearsig.angle import AngleSignal, resample_to_angle
from gearsig.errors import InputError
from gearsig.orders import (
    FrequencyTrack,
    track_vold_kalman,
)
from gearsig.orders.vold_kalman import (
    settling_time,
)
from tests.orders.test_vold_kalman import gain_of, recording_of, run_up

RATE_HZ = 2000.0


def three_orders(n=10_000):
    """Two that cross, one far away."""
    t = np.arange(n) / RATE_HZ
    tracks = [np.linspace(90, 130, n), np.full(n, 110.0), np.full(n, 600.0)]
    phases = [2 * np.pi * np.concatenate([[0], np.cumsum((f[1:] + f[:-1]) / 2)]) / RATE_HZ for f in tracks]
    parts = [np.cos(phases[0] + 0.3), 0.5 * np.cos(phases[1]), (1 + 0.1 * t) * np.cos(phases[2])]
    return sum(parts) + 0.2 * np.random.default_rng(2).normal(size=n), tracks, parts


@pytest.mark.parametrize(("generation", "n_poles"), [("second", 2), ("second", 3), ("first", 2)])
def test_far_orders_apart_are_the_same_as_all_together(generation, n_poles):
    """Groups by sweeps lead to the joint solution; the notes say who is with whom, and why."""
    y, tracks, _ = three_orders()
    bandwidth_hz = {("second", 2): 2.0, ("second", 3): 6.0, ("first", 2): 1.0}[generation, n_poles]
    kwargs = {"bandwidth_hz": bandwidth_hz, "generation": generation, "n_poles": n_poles}
    automatic = track_vold_kalman(y, RATE_HZ, tracks, **kwargs)
    together = track_vold_kalman(y, RATE_HZ, tracks, coupled=True, **kwargs)
    apart = track_vold_kalman(y, RATE_HZ, tracks, coupled=[[0, 1]], **kwargs)
    assert together.groups == ((0, 1, 2),)
    assert apart.groups == ((0, 1), (2,))
    assert automatic.groups == ((0, 1), (2,))
    assert any("solved for by themselves" in note and "'component 3'" in note for note in automatic.notes)
    assert any("come as close as 0 Hz" in note and "solved for together" in note for note in automatic.notes)
    for a, b, c in zip(automatic.orders, together.orders, apart.orders, strict=True):
        assert np.abs(a.envelope - b.envelope).max() < 1e-6
        assert np.abs(c.envelope - b.envelope).max() > 1e-4  # without sweeps, far ones leak in at the ends
    assert automatic.expected_error < 1e-6


def test_one_pole_and_a_wide_band_share_by_skirts():
    """One pole lets through 1e-4 at 78 bandwidths still: more orders end up together than with three."""
    y, tracks, _ = three_orders()
    assert track_vold_kalman(y, RATE_HZ, tracks, bandwidth_hz=10.0, n_poles=1).groups == ((0, 1, 2),)
    assert track_vold_kalman(y, RATE_HZ, tracks, bandwidth_hz=10.0, n_poles=3).groups == ((0, 1), (2,))


def test_narrow_bands_are_solved_for_together():
    """At 0.5 Hz the coarse grid does all orders in less time than two groups in turn; far ones are told so."""
    y, tracks, _ = three_orders()
    found = track_vold_kalman(y, RATE_HZ, tracks, bandwidth_hz=0.5)
    assert found.groups == ((0, 1, 2),)
    far = track_vold_kalman(y, RATE_HZ, tracks[1:], bandwidth_hz=0.5)
    assert far.groups == ((0, 1),)
    assert any("though they lie far apart" in note for note in far.notes)


def test_groups_by_the_user():
    y, tracks, _ = three_orders()
    found = track_vold_kalman(y, RATE_HZ, tracks, bandwidth_hz=2.0, coupled=[[2, 0]])
    assert found.groups == ((0, 2), (1,))
    assert found.coupled
    assert any("leak into each other" in note for note in found.notes)
    assert track_vold_kalman(y, RATE_HZ, tracks, bandwidth_hz=2.0, coupled=False).groups == ((0,), (1,), (2,))
    for wrong in ([[0, 0]], [[0, 3]], [[0], [0, 1]], [0, 1], "close"):
        with pytest.raises(InputError, match="coupled"):
            track_vold_kalman(y, RATE_HZ, tracks, bandwidth_hz=2.0, coupled=wrong)


def test_orders_left_out_at_different_times_never_meet():
    """One order lies above half the sampling rate while the other is there, and below 0 Hz margin after that."""
    n = 8000
    tracks = [np.concatenate([np.full(4000, 300.0), np.full(4000, 1100.0)]), np.full(n, 305.0)]
    tracks[1][:4200] = 1200.0
    found = track_vold_kalman(np.ones(n), RATE_HZ, tracks, bandwidth_hz=4.0)
    assert found.groups == ((0,), (1,))


@pytest.mark.parametrize("n_poles", [1, 2, 3])
def test_settling_time_is_that_of_the_impulse_response(n_poles):
    """Beyond it, the envelope of the response stays below 1 % of the peak (a few times, where poles add up)."""
    f = np.linspace(-50, 50, 2**18, endpoint=False)
    response = np.abs(np.fft.fftshift(np.fft.fft(np.fft.ifftshift(gain_of(f / 1e4, 1e-4, n_poles)))))
    lag = np.arange(-(2**17), 2**17) / 100.0
    response /= response.max()
    settled = settling_time(np.array([1.0]), n_poles)[0]
    beyond = response[np.abs(lag) > settled].max()
    assert 0.004 < beyond < 0.025


def test_settled_parts():
    """A step of the noise at the very ends moves the envelope there, and not where it is said to be settled."""
    n = 20_000
    t = np.arange(n) / RATE_HZ
    y = np.cos(2 * np.pi * 200 * t)
    found = track_vold_kalman(y, RATE_HZ, [np.full(n, 200.0)], bandwidth_hz=2.0).orders[0]
    expected = settling_time(np.array([2.0]), 2)[0]
    inside = t[found.settled]
    assert inside[0] == pytest.approx(expected, abs=2 / RATE_HZ)
    assert inside[-1] == pytest.approx(t[-1] - expected, abs=2 / RATE_HZ)
    disturbed = y.copy()
    disturbed[:20] += 10.0
    other = track_vold_kalman(disturbed, RATE_HZ, [np.full(n, 200.0)], bandwidth_hz=2.0).orders[0]
    change = np.abs(other.envelope - found.envelope)
    assert change[found.settled].max() < 0.03 * change.max()


def test_settled_parts_follow_the_bandwidth_and_the_gaps():
    angle = run_up(20.0, 10.0, 60.0)
    t = np.arange(round(20 * RATE_HZ)) / RATE_HZ
    y = np.cos(2 * np.pi * 18 * angle.revolutions_at(t))
    found = track_vold_kalman(recording_of(y, RATE_HZ), "a", [18.0], bandwidth_orders=0.1, shaft_angle=angle)
    order = found.orders[0]
    assert not order.valid.all()  # the last part lies above 1 kHz
    assert np.all(order.settled <= order.valid)
    first = t[order.settled][0]
    last_valid, last = t[order.valid][-1], t[order.settled][-1]
    assert first > 1.3 * (last_valid - last)  # the band is narrower at the slow end
    assert any("not reliable over" in note for note in found.notes)


def test_a_recording_too_short_to_settle_is_noted():
    n = 2000
    found = track_vold_kalman(np.ones(n), RATE_HZ, [np.full(n, 200.0)], bandwidth_hz=1.5, n_poles=3)
    assert not found.orders[0].settled.any()
    assert any("too short for some orders to settle; widen the band: 'component 1'" in note for note in found.notes)


def test_bandwidth_in_orders_of_a_frequency_track():
    """With an order of its own: of its shaft. Without: of the recording's shaft."""
    angle = run_up(10.0, 20.0, 60.0)
    t = np.arange(round(10 * RATE_HZ)) / RATE_HZ
    revolutions = angle.revolutions_at(t)
    speed = angle.speed_rpm_at(t) / 60
    recording = recording_of(np.cos(2 * np.pi * 3 * revolutions), RATE_HZ)
    own = FrequencyTrack("belt", 3 * speed, order=6.0, shaft="pulley")
    found = track_vold_kalman(recording, "a", [own], bandwidth_orders=0.2).orders[0]
    assert np.allclose(found.bandwidth_hz, 0.2 * speed / 2)
    assert found.shaft == "pulley"
    assert np.allclose(found.tracked(step=50).speed_rpm, 30 * speed[::50])
    other = track_vold_kalman(
        recording, "a", [replace(own, order=np.nan)], bandwidth_orders=0.2, shaft_angle=angle
    ).orders[0]
    assert np.allclose(other.bandwidth_hz, 0.2 * speed)
    same = track_vold_kalman(recording, "a", [3.0], bandwidth_orders=0.1, shaft_angle=angle).orders[0]
    narrow = track_vold_kalman(recording, "a", [replace(own, order=3.0)], bandwidth_orders=0.1).orders[0]
    assert np.abs(same.amplitude - narrow.amplitude).max() < 1e-6


@pytest.fixture(scope="module")
def over_angle():
    """Order 3 with a level that depends on the angle, and order 7.5, in a run-up."""
    n_per_rev, n_rev = 64, 400
    turns = 5.0 + np.arange(n_per_rev * n_rev) / n_per_rev
    level = 1 + 0.3 * np.cos(2 * np.pi * 0.01 * turns)
    samples = level * np.cos(2 * np.pi * 3 * turns + 0.5) + 0.4 * np.cos(2 * np.pi * 7.5 * turns - 1.0)
    angle = run_up(11.0, 20.0, 60.0)
    return AngleSignal(samples[None], n_per_rev, angle, 5.0, ("a",), ("m/s^2",), 25.0), turns, level


def test_orders_over_angle(over_angle):
    signal, turns, level = over_angle
    found = track_vold_kalman(signal, "a", [3.0, ("in", 7.5)], bandwidth_orders=0.2, n_poles=3)
    first, second = found.orders
    assert found.axis == "angle"
    assert found.sampling_rate == 64
    assert np.abs(first.amplitude - level).max() < 1e-3
    assert np.abs(first.phase_rad - 0.5).max() < 1e-3
    assert np.abs(second.amplitude - 0.4).max() < 1e-3
    angle = signal.shaft_angle
    assert np.abs(angle.revolutions_at(first.time_s) - turns).max() < 1e-9
    assert np.allclose(first.frequency_hz, 3 * angle.speed_rpm_at(first.time_s) / 60)
    assert np.allclose(first.bandwidth_hz, 0.2 * angle.speed_rpm_at(first.time_s) / 60)
    tracked = first.tracked(step=640)
    assert np.allclose(tracked.speed_rpm, angle.speed_rpm_at(tracked.time_s))
    assert tracked.bandwidth_orders == pytest.approx(0.2)
    assert np.abs(found.residual).max() < 2e-3
    assert any("revolutions" in note for note in found.notes)


def test_over_angle_and_over_time_agree():
    """The same run-up, resampled and not; bandwidth in orders."""
    angle = run_up(10.0, 30.0, 40.0)
    t = np.arange(round(10 * RATE_HZ)) / RATE_HZ
    turns = angle.revolutions_at(t)
    recording = recording_of((1 + 0.3 * np.cos(2 * np.pi * 0.02 * turns)) * np.cos(2 * np.pi * 2 * turns), RATE_HZ)
    over_time = track_vold_kalman(recording, "a", [2.0], bandwidth_orders=0.2, shaft_angle=angle).orders[0]
    signal = resample_to_angle(recording, angle, samples_per_revolution=64)
    over_angle = track_vold_kalman(signal, "a", [2.0], bandwidth_orders=0.2).orders[0]
    at = np.interp(over_angle.time_s, t, over_time.amplitude)
    assert np.abs(at - over_angle.amplitude)[over_angle.settled].max() < 2e-3


def test_bandwidth_in_hz_over_angle(over_angle):
    signal, _, _ = over_angle
    order = track_vold_kalman(signal, "a", [3.0], bandwidth_hz=4.0).orders[0]
    assert np.allclose(order.bandwidth_hz, 4.0)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"orders": [FrequencyTrack("f", np.ones(5))]}, "over angle"),
        ({"orders": [26.0]}, "above the signal's highest order"),
        ({"orders": [("out", 1.0)]}, "ratio of shaft 'out'"),
        ({"orders": []}, "no orders"),
        ({"channel": "b"}, "no channel 'b'"),
        ({"shaft_angle": run_up(10.0, 20.0, 60.0)}, "over the angle of shaft"),
        ({"bandwidth_orders": 7.0}, "order zero"),
        ({"bandwidth_orders": 0.001}, "only 400 revolutions"),
    ],
)
def test_wrong_input_over_angle(over_angle, changes, message):
    arguments = {"channel": "a", "orders": [3.0], "bandwidth_orders": 0.2} | changes
    with pytest.raises(InputError, match=message):
        track_vold_kalman(over_angle[0], **arguments)
