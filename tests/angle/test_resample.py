"""Angular resampling against closed forms."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy.optimize import brentq

from gearsig.angle import AngleSignal, ShaftAngle, constant_speed_angle, resample_to_angle, times_of_revolutions
from gearsig.errors import InputError, RefusalError
from gearsig.recording import Channel, Recording

RATE, N = 20_000.0, 100_000
T = np.arange(N) / RATE


def recording_of(*rows: np.ndarray) -> Recording:
    return Recording(np.array(rows), RATE, tuple(Channel(f"a{i}", "acceleration", "g") for i in range(len(rows))))


def chirp(start: float, end: float, n_knots: int = 200) -> tuple[np.ndarray, ShaftAngle]:
    """Angle at the samples, and as a ShaftAngle, from start to end rev/s over the recording."""
    ramp = (end - start) / T[-1]
    t = np.linspace(0, T[-1], n_knots)
    return start * T + 0.5 * ramp * T**2, ShaftAngle("s", t, start * t + 0.5 * ramp * t**2, start + ramp * t, "pulses")


def angles(signal: AngleSignal) -> np.ndarray:
    return signal.start_revolution + np.arange(signal.samples.shape[1]) / signal.samples_per_revolution


@pytest.mark.parametrize(("start", "end"), [(20.0, 40.0), (50.0, 10.0), (0.0, 30.0)])
def test_chirp_within_five_millionths_of_full_scale(start: float, end: float) -> None:
    theta, angle = chirp(start, end)
    order = 0.2 * RATE / max(start, end)  # reaches 0.2 of the sampling rate
    signal = resample_to_angle(recording_of(np.sin(2 * np.pi * order * theta)), angle)
    error = signal.samples[0] - np.sin(2 * np.pi * order * angles(signal))
    assert np.abs(error).max() < 5e-6


def test_error_up_to_the_edge_of_the_passband() -> None:
    theta, angle = chirp(30.0, 31.0)
    signal = resample_to_angle(recording_of(np.cos(2 * np.pi * 258.0 * theta)), angle)  # 0.4 of 20 kHz at 31 rev/s
    assert np.abs(signal.samples[0] - np.cos(2 * np.pi * 258.0 * angles(signal))).max() < 5e-6


def test_orders_below_a_coarse_grid_stay_and_those_above_vanish() -> None:
    theta, angle = chirp(10.0, 40.0)
    below, above = np.sin(2 * np.pi * 20 * theta), np.sin(2 * np.pi * 45 * theta)
    signal = resample_to_angle(recording_of(below, above), angle, samples_per_revolution=64)
    assert np.abs(signal.samples[0] - np.sin(2 * np.pi * 20 * angles(signal))).max() < 5e-6
    assert np.abs(signal.samples[1]).max() < 5e-6
    assert any("coarser" in note for note in signal.shaft_angle.notes)


@settings(deadline=None, max_examples=15)
@given(st.floats(-1e3, 1e3), st.integers(16, 1200), st.floats(0.0, 40.0))
def test_a_constant_stays_that_constant(value: float, n_per_rev: int, start: float) -> None:
    _, angle = chirp(start, 35.0)
    signal = resample_to_angle(recording_of(np.full(N, value)), angle, samples_per_revolution=n_per_rev)
    np.testing.assert_allclose(signal.samples, value, rtol=1e-12, atol=1e-12)


@pytest.mark.slow
def test_float32_recordings_are_as_good_as_their_digits() -> None:
    theta, angle = chirp(20.0, 40.0)
    x = np.sin(2 * np.pi * 50 * theta)
    single = Recording(x[None].astype(np.float32), RATE, (Channel("a"),))
    difference = resample_to_angle(single, angle).samples - resample_to_angle(recording_of(x), angle).samples
    assert np.abs(difference).max() < 2e-7


def test_a_delayed_recording_is_a_shifted_angle() -> None:
    theta, angle = chirp(20.0, 40.0)
    x = np.sin(2 * np.pi * 40 * theta)
    whole = resample_to_angle(recording_of(x), angle, samples_per_revolution=1000)
    later = ShaftAngle("s", angle.time_s - 1.0, angle.revolutions, angle.speed_rev_per_s, "pulses")
    cut = Recording(x[None, int(RATE) :], RATE, (Channel("a"),))
    part = resample_to_angle(cut, later, samples_per_revolution=1000)
    skip = round((part.start_revolution - whole.start_revolution) * 1000)
    n = part.samples.shape[1]
    np.testing.assert_allclose(part.samples[0], whole.samples[0, skip : skip + n], atol=2e-6)


@settings(deadline=None, max_examples=40)
@given(st.lists(st.floats(0.0, 30.0), min_size=3, max_size=12), st.integers(0, 1000))
@example([2.225073858507e-311, 0.0, 0.0, 0.0], 0)  # a speed that only just is none
def test_times_of_angles_solve_the_cubic(speeds: list[float], seed: int) -> None:
    rng = np.random.default_rng(seed)
    t = np.cumsum(rng.uniform(0.1, 1.0, len(speeds)))
    v = np.array(speeds)
    theta = np.concatenate([[0.0], np.cumsum(0.5 * (v[1:] + v[:-1]) * np.diff(t) + 0.02)])
    slopes = np.minimum(
        v, 3 * np.minimum(np.append(np.diff(theta) / np.diff(t), 1e9), np.insert(np.diff(theta) / np.diff(t), 0, 1e9))
    )
    angle = ShaftAngle("s", t, theta, slopes, "pulses")
    n = 500
    step = (theta[-1] - theta[0]) / (n + 1)
    out = times_of_revolutions(angle, step, step, n)
    wanted = step * np.arange(1, n + 1)
    np.testing.assert_allclose(angle.revolutions_at(out), wanted, rtol=1e-12, atol=1e-12 * theta[-1])
    i = n // 3
    by_brent = brentq(lambda s: float(angle.revolutions_at(np.array([s]))[0]) - wanted[i], t[0], t[-1], xtol=1e-14)
    assert angle.revolutions_at(np.array([by_brent]))[0] == pytest.approx(wanted[i], abs=1e-9)
    assert np.all(np.diff(out) >= 0)


def test_times_of_revolutions_invert_the_angle():
    knots = np.linspace(0.0, 10.0, 11)
    angle = ShaftAngle("s", knots, 10 * knots + knots**2, 10 + 2 * knots, "pulses")
    times = times_of_revolutions(angle, 3.0, 7.0, 20)
    assert angle.revolutions_at(times) == pytest.approx(3.0 + 7.0 * np.arange(20), abs=1e-9)


def test_default_grid_is_bounded_near_standstill() -> None:
    t = np.array([0.0, T[-1]])
    crawl = ShaftAngle(
        "s", np.array([0.0, 4.9, T[-1]]), np.array([0.0, 0.5, 3.5]), np.array([0.05, 0.1, 30.0]), "pulses"
    )
    signal = resample_to_angle(recording_of(np.ones(N)), crawl)
    assert signal.samples.size < 8 * N
    assert t[-1] > 4.9


def test_same_result_from_several_threads() -> None:
    theta, angle = chirp(20.0, 40.0)
    recording = recording_of(np.sin(2 * np.pi * 40 * theta))
    one = resample_to_angle(recording, angle).samples
    with ThreadPoolExecutor(4) as pool:
        for other in pool.map(lambda _: resample_to_angle(recording, angle).samples, range(8)):
            np.testing.assert_array_equal(other, one)


def test_axes_and_refusals() -> None:
    recording = recording_of(np.ones(N), np.zeros(N))
    angle = constant_speed_angle(1500.0, recording.duration_s)
    signal = resample_to_angle(recording, angle, channels=["a1"], highest_order=100.0)
    assert signal.samples_per_revolution >= 250
    assert signal.channel_names == ("a1",)
    assert signal.units == ("g",)
    assert signal.highest_order == pytest.approx(0.4 * signal.samples_per_revolution)
    assert signal.start_revolution * signal.samples_per_revolution == pytest.approx(
        round(signal.start_revolution * signal.samples_per_revolution), abs=1e-9
    )
    with pytest.raises(InputError, match="too few for order"):
        resample_to_angle(recording, angle, samples_per_revolution=100, highest_order=80)
    with pytest.raises(InputError, match="samples_per_revolution"):
        resample_to_angle(recording, angle, samples_per_revolution=100_000_000)
    with pytest.raises(RefusalError, match="nothing to resample"):
        resample_to_angle(
            recording, ShaftAngle("s", angle.time_s + 100, angle.revolutions, angle.speed_rev_per_s, "pulses")
        )
    with pytest.raises(RefusalError, match="too short: 5 samples"):
        resample_to_angle(recording_of(np.ones(5)), constant_speed_angle(1500.0, 5 / recording.sampling_rate_hz))
    with pytest.raises(RefusalError, match="revolutions within"):
        resample_to_angle(recording, constant_speed_angle(5.0, recording.duration_s))
    with pytest.raises(RefusalError, match="at rest"):
        constant_speed_angle(0.0, 1.0)
