"""Displacement and velocity from one measured channel."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gearsig.errors import InputError, RefusalError
from gearsig.phase import phase_plane
from gearsig.recording import Channel, Recording

RATE = 2000.0


def _motion(time, *lines):
    """Displacement, velocity and acceleration of lines (amplitude, Hz, phase)."""
    rows = []
    for k, sign in ((0, 1.0), (1, 1.0), (2, -1.0)):
        part = [
            a * (2 * np.pi * f) ** k * (np.sin if k == 1 else np.cos)(2 * np.pi * f * time + p) for a, f, p in lines
        ]
        rows.append(sign * (-1 if k == 1 else 1) * np.sum(part, axis=0))
    return rows


@given(
    st.integers(4000, 4003),
    st.floats(10.0, 400.0),
    st.floats(10.0, 400.0),
    st.floats(0.0, 6.28),
    st.floats(-3.0, 3.0),
)
@settings(max_examples=40)
def test_acceleration_becomes_displacement_and_velocity(n, f1, f2, phase, offset):
    lines = ((1e-3, f1, phase), (5e-4, f2, 1.0))
    acceleration = _motion(np.arange(n) / RATE, *lines)[2]
    scale = np.abs(acceleration).max()
    plane = phase_plane(acceleration + offset * scale, RATE, quantity="acceleration", unit="m/s^2", low_cut_hz=10.0)
    time = plane.start_s + np.arange(plane.n_points) / RATE
    displacement, velocity, _ = _motion(time, *lines)
    assert plane.units == ("m", "m/s")
    slowest = min(f1, f2)
    # An offset is the hardest part: its fading reaches into the band.
    tolerance = 1e-3 * scale / (2 * np.pi * slowest) ** 2 + 1e-3 * 1.5e-3
    np.testing.assert_allclose(plane.points[:, 0], displacement, atol=tolerance)
    np.testing.assert_allclose(plane.points[:, 1], velocity, atol=tolerance * 2 * np.pi * max(f1, f2))


@pytest.mark.parametrize("n", [3000, 3001])
def test_displacement_is_differentiated_and_keeps_mean_and_trend(n):
    time = np.arange(n) / RATE
    w = 2 * np.pi * 31.0
    plane = phase_plane(3.0 + 0.2 * time + np.sin(w * time), RATE, quantity="displacement", unit="in")
    inside = plane.start_s + np.arange(plane.n_points) / RATE
    np.testing.assert_allclose(plane.points[:, 0], 3.0 + 0.2 * inside + np.sin(w * inside), atol=1e-9)
    np.testing.assert_allclose(plane.points[:, 1], 0.2 + w * np.cos(w * inside), atol=1e-9 * w)
    assert plane.units == ("in", "in/s")


def test_velocity_in_mm_per_s_and_acceleration_in_g_agree():
    time = np.arange(8000) / RATE
    displacement, velocity, acceleration = _motion(time, (1e-4, 60.0, 0.3))
    one = phase_plane(1e3 * velocity, RATE, quantity="velocity", unit="mm/s", low_cut_hz=20.0)
    two = phase_plane(acceleration / 9.80665, RATE, quantity="acceleration", unit="g", low_cut_hz=20.0)
    np.testing.assert_allclose(one.points / [1.0, 377.0], two.points / [1.0, 377.0], atol=1e-8)
    np.testing.assert_allclose(one.points[:, 0], displacement[500:-500], atol=1e-8)


def test_what_is_slower_than_the_low_cut_is_gone():
    time = np.arange(20000) / RATE
    slow = phase_plane(np.cos(2 * np.pi * 2.0 * time), RATE, quantity="acceleration", low_cut_hz=10.0)
    assert np.abs(slow.points[:, 0]).max() < 1e-3 / (2 * np.pi * 2.0) ** 2


def test_float32_gives_the_same_to_its_rounding():
    x = np.random.default_rng(0).normal(size=5001)
    one = phase_plane(x.astype(np.float32), RATE, quantity="acceleration", low_cut_hz=20.0)
    two = phase_plane(x, RATE, quantity="acceleration", low_cut_hz=20.0)
    np.testing.assert_allclose(one.points, two.points, atol=1e-5 * np.abs(two.points).max())


def test_a_recording_knows_what_its_channel_measures():
    x = np.random.default_rng(0).normal(size=(2, 4000))
    recording = Recording(x, RATE, (Channel("a", "acceleration", "m/s^2"), Channel("p", "sound_pressure", "Pa")))
    plane = phase_plane(recording, "a", low_cut_hz=50.0)
    assert plane.band_hz == (50.0, 800.0)
    assert plane.start_s == pytest.approx(0.1)
    with pytest.raises(InputError, match=r"sound_pressure.*quantity='acceleration'"):
        phase_plane(recording, "p", low_cut_hz=50.0)
    assert phase_plane(recording, "p", low_cut_hz=50.0, quantity="acceleration").units == ("Pa s^2", "Pa s^2/s")


@pytest.mark.parametrize(
    ("changes", "error", "words"),
    [
        ({"low_cut_hz": None}, InputError, "low_cut_hz is not given"),
        ({"low_cut_hz": -1.0}, InputError, "low_cut_hz"),
        ({"low_cut_hz": 900.0}, InputError, "the band goes from 900 to 800"),
        ({"high_cut_hz": 1001.0}, InputError, "high_cut_hz"),
        ({"low_cut_hz": 4.0}, RefusalError, "too short for a low cut of 4 Hz.*raise low_cut_hz above 7"),
        ({"values": np.ones(4000)}, RefusalError, "constant at 1"),
        ({"values": np.full(4000, np.nan)}, InputError, "NaN"),
        ({"values": np.zeros(3)}, InputError, "3 sample"),
    ],
)
def test_bad_input_says_what_to_do(changes, error, words):
    settings_ = {"values": np.random.default_rng(0).normal(size=4000), "low_cut_hz": 50.0} | changes
    with pytest.raises(error, match=words):
        phase_plane(settings_.pop("values"), RATE, quantity="acceleration", **settings_)
