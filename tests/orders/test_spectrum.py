"""Order spectra and maps: closed forms and agreement with the frequency spectrum."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gearsig.angle import AngleSignal, ShaftAngle
from gearsig.errors import InputError, RefusalError
from gearsig.orders import (
    frequency_map,
    order_map,
    order_spectrum,
    synchronous_average,
    track_orders,
    track_vold_kalman,
)
from gearsig.spectra import amplitude_spectrum


@pytest.mark.parametrize("window", ["hann", "rectangular"])
@pytest.mark.parametrize("start", [0.0, 0.25, 7.75])
def test_whole_orders_are_bin_centred(angle_signal, window, start):
    signal = angle_signal(lambda r: 3.0 * np.cos(2 * np.pi * 23 * r + 1.0), 20.6, start=start)
    spectrum = order_spectrum(signal, "a", window=window)
    assert spectrum.values[spectrum.index_of(23.0)] == pytest.approx(3.0, rel=1e-9)
    assert spectrum.positions[spectrum.index_of(23.0)] == 23.0
    assert (spectrum.axis, spectrum.unit, spectrum.shaft) == ("order", "g", "pinion")


@settings(max_examples=25, deadline=None)
@given(n_rev=st.integers(1, 12), per_rev=st.integers(8, 65), seed=st.integers(0, 2**32 - 1))
def test_parseval(n_rev, per_rev, seed):
    x = np.random.default_rng(seed).normal(size=(1, n_rev * per_rev))
    angle = ShaftAngle("s", np.array([0.0, 1.0]), np.array([0.0, n_rev]), np.array([n_rev, n_rev]), "constant")
    signal = AngleSignal(x, per_rev, angle, 0.0, ("a",), ("",), per_rev / 2)
    spectrum = order_spectrum(signal, "a", window="rectangular", scaling="power")
    assert spectrum.values.sum() == pytest.approx(np.mean(x**2), rel=1e-9)


def test_density_over_order_integrates_to_the_mean_square(angle_signal):
    rng = np.random.default_rng(0)
    signal = angle_signal(lambda r: rng.normal(size=len(r)), 400)
    density = order_spectrum(signal, "a", scaling="power density", revolutions_per_block=8)
    assert density.unit == "g^2/order"
    assert density.values.sum() * density.resolution == pytest.approx(np.mean(signal.samples**2), rel=0.01)


def test_orders_at_constant_speed_are_the_frequencies_over_it(angle_signal):
    rng = np.random.default_rng(1)
    signal = angle_signal(lambda r: rng.normal(size=len(r)), 40)
    orders = order_spectrum(signal, "a")
    frequencies = amplitude_spectrum(signal.values("a"), 2560.0)  # 256 samples at 10 revolutions per second
    assert orders.values == pytest.approx(frequencies.values)
    assert orders.positions * 10.0 == pytest.approx(frequencies.positions)


def test_lines_above_the_highest_valid_order_are_left_out():
    angle = ShaftAngle("s", np.array([0.0, 1.0]), np.array([0.0, 4.0]), np.array([4.0, 4.0]), "constant")
    spectrum = order_spectrum(AngleSignal(np.ones((1, 256)), 64, angle, 0.0, ("a",), ("",), 20.0), "a")
    assert spectrum.positions[-1] == 20.0


def test_map_of_a_growing_order(angle_signal):
    signal = angle_signal(lambda r: (1 + r / 100) * np.cos(2 * np.pi * 5 * r), 200)
    result = order_map(signal, "a", revolutions_per_block=4, highest_order=10.0)
    level = result.values[:, np.argmin(np.abs(result.positions - 5.0))]
    middle = result.time_s * 10.0
    assert level == pytest.approx(1 + middle / 100, rel=2e-3)
    assert result.speed_rpm == pytest.approx(600.0)
    assert result.positions[-1] == 10.0


def test_number_of_blocks_is_bounded(angle_signal):
    signal = angle_signal(np.cos, 300)
    result = order_map(signal, "a", revolutions_per_block=2, overlap=0.9, n_blocks_max=50)
    assert 40 <= len(result.time_s) <= 50
    assert result.time_s[-1] == pytest.approx(29.9, abs=0.7)


def test_frequency_map_of_a_run_up_shows_the_speed():
    knots = np.linspace(0.0, 10.0, 11)
    angle = ShaftAngle("s", knots, 10 * knots + knots**2, 10 + 2 * knots, "pulses")
    t = np.arange(10_000) / 1000.0
    x = np.cos(2 * np.pi * 6 * (10 * t + t**2))
    result = frequency_map(x, 1000.0, angle, n_per_block=500)
    strongest = result.positions[np.argmax(result.values, axis=1)]
    assert strongest == pytest.approx(6 * result.speed_rpm / 60, abs=2 * result.resolution)
    assert result.speed_rpm == pytest.approx(60 * (10 + 2 * result.time_s))


def test_less_than_a_revolution_is_refused(angle_signal):
    short = angle_signal(np.cos, 0.9)
    with pytest.raises(RefusalError, match="0 whole revolution"):
        order_spectrum(short, "a")
    with pytest.raises(RefusalError, match="shorter than one block"):
        order_map(angle_signal(np.cos, 5), "a")
    with pytest.raises(InputError, match="1 to 5"):
        order_spectrum(angle_signal(np.cos, 5), "a", revolutions_per_block=6)


@pytest.mark.parametrize("speed_rpm", [900.0, np.full(8192, 900.0)])
def test_an_array_with_its_speed_needs_no_recording(speed_rpm) -> None:
    """15 revolutions a second: 45 Hz is order 3, whichever function is asked."""
    rate_hz = 1024.0
    x = 2.0 * np.cos(2 * np.pi * 45.0 * np.arange(8192) / rate_hz)
    spectrum = order_spectrum(x, rate_hz, speed_rpm=speed_rpm)
    assert spectrum.largest_near(3.0, 1.0) == pytest.approx((3.0, 2.0), rel=1e-3)
    levels = order_map(x, rate_hz, speed_rpm=speed_rpm)
    assert levels.speed_rpm == pytest.approx(900.0, rel=1e-6)
    assert levels.positions[np.argmax(levels.values.mean(axis=0))] == pytest.approx(3.0)
    (tracked,) = track_orders(x, rate_hz, [3.0], speed_rpm=speed_rpm)
    assert tracked.amplitude == pytest.approx(2.0, rel=1e-3)
    average = synchronous_average(x, rate_hz, speed_rpm=speed_rpm)
    assert abs(average.lines()[3]) == pytest.approx(2.0, rel=1e-3)
    (separated,) = track_vold_kalman(x, rate_hz, [3.0], bandwidth_hz=2.0, speed_rpm=speed_rpm).orders
    assert separated.amplitude[separated.settled] == pytest.approx(2.0, rel=1e-3)


def test_the_speed_is_given_once() -> None:
    x, angle = np.ones(1024), ShaftAngle("s", np.array([0.0, 1.0]), np.array([0.0, 20.0]), np.full(2, 20.0), "constant")
    for speeds in ({}, {"speed_rpm": 900.0, "shaft_angle": angle}, {"speed_rpm": np.full(7, 900.0)}):
        with pytest.raises(InputError):
            order_spectrum(x, 1024.0, **speeds)
