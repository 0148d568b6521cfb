"""Tachometer, counter and encoder from a simulated shaft angle."""

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from gearsig.angle import find_pulse_edges
from gearsig.errors import InputError
from sims.measure import Encoder, PulseCounter, Tachometer, disc_edges, pulse_voltage

T = np.arange(250_001) * 4e-6


@settings(max_examples=25)
@given(st.integers(1, 30), st.floats(0.05, 0.95), st.floats(0.0, 1.0), st.floats(1.0, 40.0))
def test_edges_of_steady_rotation_lie_where_the_disc_says(n, duty, offset, rev_per_s):
    start = (-offset * n) % 1.0
    assume(min(abs(start - duty), start, 1.0 - start) > 1e-9)  # an edge at time 0 itself may count or not
    rising, falling, high = disc_edges(rev_per_s * T, T, n, duty, offset)
    k = np.round((rising * rev_per_s - offset) * n)
    np.testing.assert_allclose(rising, (k / n + offset) / rev_per_s, atol=1e-11)
    k = np.round((falling * rev_per_s - offset) * n - duty)
    np.testing.assert_allclose(falling, ((k + duty) / n + offset) / rev_per_s, atol=1e-11)
    assert abs(len(rising) - rev_per_s * n) <= 1
    first_is_fall = len(falling) > 0 and (len(rising) == 0 or falling[0] < rising[0])
    if len(falling):
        assert high == first_is_fall


def test_edges_of_a_run_up_follow_the_square_root():
    """θ = ½ α t²: pulse k at √(2k/(αn))."""
    rising, _, _ = disc_edges(0.5 * 60.0 * T**2, T, 6, 0.3, 0.0)
    k = np.arange(1, len(rising) + 1)
    np.testing.assert_allclose(rising, np.sqrt(2 * k / (60.0 * 6)), atol=1e-10)


def test_shaft_that_swings_passes_the_same_window_both_ways():
    """0.1 sin: the window 0 … 0.05 rev is open while the shaft is in it, whichever way it came."""
    rev = 0.1 * np.sin(2 * np.pi * (T + 0.0512345))
    rising, falling, high = disc_edges(rev, T, 1, 0.05, 0.0)
    level = np.full(len(T), float(high))
    for edges, sign in ((rising, 1.0), (falling, -1.0)):
        level += sign * np.searchsorted(edges, T, side="right")
    np.testing.assert_array_equal(level > 0.5, (rev % 1.0) < 0.05)


def test_too_many_pulses_for_the_step_are_refused():
    with pytest.raises(InputError, match="finer step"):
        disc_edges(500.0 * T, T, 512, 0.5, 0.0)


def test_voltage_crosses_half_way_at_the_edges():
    tacho = Tachometer(pulses_per_revolution=2, edge_s=1e-4)
    rising, falling, _ = disc_edges(20.0 * T, T, 2, tacho.duty, 0.25)
    time_s = np.arange(20480) / 20480.0
    found = find_pulse_edges(pulse_voltage(tacho, rising, falling, time_s), 20480.0).times_s
    np.testing.assert_allclose(found, rising[: len(found)], atol=1e-9)


def test_counter_rounds_down_to_its_clock():
    rising = np.linspace(0.01, 0.99, 200)
    stamps = PulseCounter(clock_hz=1e4).stamp(rising, np.random.default_rng(0))
    assert ((rising - stamps) >= 0).all()
    assert ((rising - stamps) < 1e-4 + 1e-12).all()
    np.testing.assert_allclose(stamps * 1e4, np.round(stamps * 1e4), atol=1e-9)
    np.testing.assert_array_equal(PulseCounter().stamp(rising, np.random.default_rng(0)), rising)


def test_counter_jitter_has_its_deviation():
    rising = np.linspace(0, 1000.0, 20001)
    stamps = PulseCounter(jitter_s=1e-4).stamp(rising, np.random.default_rng(0))
    assert (stamps - rising).std() == pytest.approx(1e-4, rel=0.03)


@given(st.floats(-1e4, 1e4), st.integers(4, 100_000))
def test_encoder_resolution(angle, counts):
    """The reading is the angle rounded down to a count; wrapping takes off whole revolutions."""
    wide = Encoder(counts_per_revolution=counts, wraps=False)
    reading = float(wide.read_deg(np.array([angle]))[0])
    behind = np.degrees(angle) - reading
    assert -1e-9 <= behind <= 360.0 / counts + 1e-9
    wrapped = float(Encoder(counts_per_revolution=counts).read_deg(np.array([angle]))[0])
    assert 0.0 <= wrapped < 360.0
    assert (reading - wrapped) / 360.0 == pytest.approx(round((reading - wrapped) / 360.0), abs=1e-9)


def test_encoder_runout_is_once_per_revolution():
    angle = np.linspace(0, 4 * np.pi, 4000, endpoint=False)
    encoder = Encoder(counts_per_revolution=10_000_000, wraps=False, runout_deg=0.5)
    error = encoder.read_deg(angle) - np.degrees(angle)
    np.testing.assert_allclose(error, 0.5 * np.sin(angle), atol=1e-4)


def test_encoder_noise_has_its_deviation_and_is_only_drawn_where_it_may_be():
    angle = np.linspace(0.0, 100.0, 20_001)
    encoder = Encoder(counts_per_revolution=2**30, wraps=False, noise_deg=0.01)
    error = encoder.read_deg(angle, np.random.default_rng(0)) - np.degrees(angle)
    assert error.std() == pytest.approx(0.01, rel=0.03)
    np.testing.assert_allclose(encoder.read_deg(angle), np.degrees(angle), atol=4e-7)
