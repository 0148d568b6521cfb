"""Vold–Kalman tracking of known orders: run-ups, crossings, beats, ends, and the bandwidth's closed forms."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gearsig.angle import ShaftAngle
from gearsig.orders import (
    FrequencyTrack,
    track_vold_kalman,
)
from gearsig.orders.vold_kalman import (
    cosine_and_sine,
    envelope_weight,
    waveform_weight,
)
from gearsig.recording import Channel, Recording
from gearsig.rig import ConstantSpeed, GearPair, Rig, Shaft

RATE_HZ = 5000.0


def run_up(duration_s=10.0, from_rev_per_s=20.0, to_rev_per_s=80.0):
    """A linear run-up: the cubic between two knots is exact."""
    t = np.array([0.0, duration_s])
    mean = (from_rev_per_s + to_rev_per_s) / 2
    return ShaftAngle("in", t, mean * t, np.array([from_rev_per_s, to_rev_per_s]), "encoder")


def recording_of(signal, rate=RATE_HZ, **more):
    return Recording(np.asarray(signal)[None], rate, (Channel("a", "acceleration", "m/s^2"),), **more)


def gain_of(offset, bandwidth, n_poles):
    """Return H(f) = 1/(1 + r² (2 sin πf)^2p) of the second generation; both in cycles per sample."""
    r = envelope_weight(np.array([bandwidth]), n_poles)[0]
    return 1.0 / (1.0 + (r * (2.0 * np.sin(np.pi * offset)) ** n_poles) ** 2)


def sampled(angle, rate=RATE_HZ):
    t = np.arange(round(angle.end_s * rate)) / rate
    return t, angle.revolutions_at(t)


@pytest.mark.parametrize(("n_poles", "constant"), [(1, 0.204862), (2, 0.0652097), (3, 0.0207569)])
def test_weight_of_narrow_bands(n_poles, constant):
    """The published approximations r = 0.2048624/b, 0.0652097/b², 0.0207568/b³ for b = B/f_s."""
    assert envelope_weight(np.array([1e-3]), n_poles)[0] == pytest.approx(constant / 1e-3**n_poles, rel=1e-5)


@given(st.floats(1e-6, 0.9), st.integers(1, 3))
def test_half_the_power_passes_at_half_the_bandwidth(bandwidth, n_poles):
    assert gain_of(bandwidth / 2, bandwidth, n_poles) == pytest.approx(0.5**0.5, rel=1e-9)


@given(st.floats(0.02, 0.48), st.floats(0.01, 0.99))
def test_first_generation_bandwidth(frequency, share):
    """The -3 dB points of its response lie one bandwidth apart."""
    bandwidth = np.arccos(np.sqrt(abs(np.cos(2 * np.pi * frequency)))) / np.pi * share  # up to zero or half the rate
    r = waveform_weight(np.array([bandwidth]), np.array([frequency]))[0]
    half = np.sqrt(np.sqrt(2) - 1) / (2 * r)
    edges = np.arccos(np.cos(2 * np.pi * frequency) + np.array([half, -half])) / (2 * np.pi)
    assert np.diff(edges) == pytest.approx(bandwidth, rel=1e-6)


@given(st.floats(-1e5, 1e5))
def test_phasor(turns):
    c, s = np.empty(1), np.empty(1)
    cosine_and_sine(np.array([turns]), c, s)
    exact = np.exp(2j * np.pi * (turns - np.round(turns)))
    assert abs(c[0] + 1j * s[0] - exact) < 3e-15


@pytest.mark.parametrize(
    ("n_poles", "amplitude"),
    [(1, np.ones_like), (2, lambda u: 1 + 2 * u), (3, lambda u: 1 + 2 * u - 1.5 * u**2)],
)
def test_polynomial_amplitudes_are_exact_up_to_the_ends(n_poles, amplitude):
    """∇^p of a polynomial below degree p is zero: nothing is smoothed away, anywhere."""
    angle = run_up()
    t, turns = sampled(angle)
    expected = amplitude(t / 10)
    x = expected * np.cos(2 * np.pi * 2 * turns + 0.7)
    order = track_vold_kalman(recording_of(x), "a", [2.0], bandwidth_hz=2.0, n_poles=n_poles, shaft_angle=angle).orders[
        0
    ]
    assert np.abs(order.amplitude - expected).max() < 1e-7
    assert np.abs(order.phase_rad - 0.7).max() < 1e-7


@pytest.mark.parametrize("n_poles", [1, 2, 3])
@pytest.mark.parametrize("of_bandwidth", [0.25, 0.5, 1.0])
def test_modulation_falls_by_the_closed_form(n_poles, of_bandwidth):
    """In a run-up, the level's modulation at f_m comes out multiplied by H(f_m): -3 dB at half the bandwidth."""
    angle = run_up(20.0)
    t, turns = sampled(angle)
    f_m = of_bandwidth * 2.0
    x = (1 + 0.5 * np.cos(2 * np.pi * f_m * t)) * np.cos(2 * np.pi * 3 * turns)
    order = track_vold_kalman(recording_of(x), "a", [3.0], bandwidth_hz=2.0, n_poles=n_poles, shaft_angle=angle).orders[
        0
    ]
    gain = gain_of(f_m / RATE_HZ, 2.0 / RATE_HZ, n_poles)
    middle = slice(25_000, -25_000)  # the ends' part has decayed
    expected = 1 + 0.5 * gain * np.cos(2 * np.pi * f_m * t)
    assert np.abs(order.amplitude - expected)[middle].max() < 5e-4


@pytest.mark.parametrize("generation", ["first", "second"])
def test_crossing_orders(generation):
    """An order crosses a fixed frequency; amplitudes and phases are known."""
    angle = run_up()
    t, turns = sampled(angle)
    resonance = FrequencyTrack("pump", np.full(len(t), 100.0))
    parts = (1 + t / 10) * np.cos(2 * np.pi * 2 * turns + 1.0), 0.5 * np.cos(2 * np.pi * 100.0 * t - 0.5)
    recording = recording_of(sum(parts))
    kwargs = {"bandwidth_hz": 2.0, "generation": generation, "shaft_angle": angle}
    together = track_vold_kalman(recording, "a", [2.0, resonance], **kwargs)
    alone = track_vold_kalman(recording, "a", [2.0, resonance], coupled=False, **kwargs)
    middle = slice(5000, -5000)
    allowed = {"first": 0.02, "second": 1e-6}[generation]  # the first has no frequency slope in its structural equation
    for order, part in zip(together.orders, parts, strict=True):
        assert np.abs(order.waveform - part)[middle].max() < allowed
    worst = max(np.abs(o.waveform - part)[middle].max() for o, part in zip(alone.orders, parts, strict=True))
    assert worst > 0.2
    if generation == "second":
        assert np.abs(together.orders[0].amplitude - (1 + t / 10)).max() < 1e-6
        assert np.abs(together.orders[1].phase_rad + 0.5).max() < 1e-6
    assert any("come as close as" in note for note in together.notes)
    assert any("leak into each other" in note for note in alone.notes)


def test_close_orders_of_two_shafts():
    """Two shafts at 25 and 24.5 Hz, half a bandwidth apart: they beat every two seconds."""
    rig = Rig(
        shafts=(Shaft("in"), Shaft("out")), pairs=(GearPair("p", "in", "out", 49, 50),), speed=ConstantSpeed(1500.0)
    )
    t = np.arange(40 * 2000) / 2000.0
    parts = 1.0 * np.cos(2 * np.pi * 25 * t), 0.7 * np.cos(2 * np.pi * 24.5 * t + 1.0)
    recording = recording_of(sum(parts), 2000.0, rig=rig)
    together = track_vold_kalman(recording, "a", [("in", 1.0), ("out", 1.0)], bandwidth_hz=1.0)
    alone = track_vold_kalman(recording, "a", [("in", 1.0), ("out", 1.0)], bandwidth_hz=1.0, coupled=False)
    assert [o.shaft for o in together.orders] == ["in", "out"]
    for order, part in zip(together.orders, parts, strict=True):
        assert np.abs(order.waveform - part).max() < 1e-6
    assert np.ptp(alone.orders[0].amplitude[8000:-8000]) > 0.5


def test_bandwidth_in_orders_grows_with_speed():
    """Modulation per revolution keeps its gain along the run-up if the bandwidth is given in orders."""
    angle = run_up(20.0)
    _, turns = sampled(angle)
    x = (1 + 0.5 * np.cos(2 * np.pi * 0.05 * turns)) * np.cos(2 * np.pi * 6 * turns)
    order = track_vold_kalman(recording_of(x), "a", [6.0], bandwidth_orders=0.1, shaft_angle=angle).orders[0]
    assert np.allclose(order.bandwidth_hz, 0.1 * order.frequency_hz / 6)
    middle = slice(25_000, -25_000)
    expected = 1 + 0.5 * 0.5**0.5 * np.cos(2 * np.pi * 0.05 * turns)
    assert np.abs(order.amplitude - expected)[middle].max() < 0.01


def test_parts_above_half_the_sampling_rate_are_left_out():
    angle = run_up()
    t, turns = sampled(angle, 500.0)
    low, high = np.cos(2 * np.pi * turns), np.cos(2 * np.pi * 5 * turns)
    inside = 5 * (20 + 6 * t) + 1.0 < 250.0
    x = low + np.where(inside, high, 0.0)
    both = track_vold_kalman(recording_of(x, 500.0), "a", [1.0, 5.0], bandwidth_hz=2.0, shaft_angle=angle)
    order = both.orders[1]
    assert np.array_equal(order.valid, inside)
    assert np.isnan(order.envelope[~inside]).all()
    assert np.all(order.waveform[~inside] == 0.0)
    assert np.abs(order.amplitude[inside] - 1).max() < 1e-6
    assert np.abs(both.orders[0].amplitude - 1).max() < 1e-6
    assert any("left out" in note for note in both.notes)


def test_a_start_from_standstill_is_left_out():
    angle = run_up(10.0, 0.0, 60.0)
    t, turns = sampled(angle)
    order = track_vold_kalman(
        recording_of(np.cos(2 * np.pi * turns)), "a", [1.0], bandwidth_hz=2.0, shaft_angle=angle
    ).orders[0]
    assert not order.valid[6 * t < 1.0].any()
    assert order.valid[6 * t > 1.03].all()
    assert np.abs(order.amplitude - 1)[t > 1.1].max() < 1e-6


def test_samples_outside_the_angle_are_left_out():
    angle = run_up().between(2.0, 7.0)
    t, turns = sampled(run_up())
    order = track_vold_kalman(
        recording_of(np.cos(2 * np.pi * 2 * turns)), "a", [2.0], bandwidth_hz=3.0, shaft_angle=angle
    ).orders[0]
    assert np.array_equal(order.valid, (t >= 2.0 - 1 / RATE_HZ) & (t <= 7.0 + 1 / RATE_HZ))


@pytest.mark.parametrize("generation", ["first", "second"])
@pytest.mark.parametrize("bandwidth_hz", [3.0, 300.0])
def test_float32_and_one_sample_less(generation, bandwidth_hz):
    rng = np.random.default_rng(3)
    angle = run_up(4.0, 300.0, 400.0)
    t, turns = sampled(angle)
    x = (np.cos(2 * np.pi * turns) + 0.1 * rng.normal(size=len(t))).astype(np.float32)
    kwargs = {"bandwidth_hz": bandwidth_hz, "generation": generation, "shaft_angle": angle}
    single = track_vold_kalman(recording_of(x), "a", [1.0], **kwargs)
    double = track_vold_kalman(recording_of(x.astype(float)), "a", [1.0], **kwargs)
    assert np.array_equal(single.orders[0].waveform, double.orders[0].waveform)
    shorter = track_vold_kalman(recording_of(x[:-1]), "a", [1.0], **kwargs)
    middle = slice(0, 10_000)
    assert np.abs(shorter.orders[0].waveform - single.orders[0].waveform[:-1])[middle].max() < 1e-6


@settings(max_examples=20, deadline=None)
@given(
    n=st.integers(400, 1200),
    n_poles=st.integers(1, 3),
    bandwidth_hz=st.floats(20.0, 300.0),
    scale=st.floats(1e-3, 1e3),
    seed=st.integers(0, 2**32 - 1),
    coupled=st.booleans(),
)
def test_linear_and_complete(n, n_poles, bandwidth_hz, scale, seed, coupled):
    """The solution scales with the signal; waveforms and residual add up to it; the waveform is the envelope's."""
    y = np.random.default_rng(seed).normal(size=n)
    tracks = [np.linspace(300, 600, n), np.full(n, 450.0)]

    def solve(signal):
        return track_vold_kalman(signal, RATE_HZ, tracks, bandwidth_hz=bandwidth_hz, n_poles=n_poles, coupled=coupled)

    first, scaled = solve(y), solve(scale * y)
    for a, b in zip(first.orders, scaled.orders, strict=True):
        assert np.allclose(scale * a.envelope, b.envelope, rtol=0, atol=1e-7 * abs(scale))
        assert np.abs(a.waveform).max() <= np.abs(a.envelope).max() * (1 + 1e-12)
    assert np.allclose(sum(o.waveform for o in first.orders) + first.residual, y, rtol=0, atol=1e-12)


def test_tracked_order_for_tables():
    angle = run_up()
    _, turns = sampled(angle)
    order = track_vold_kalman(
        recording_of(np.cos(2 * np.pi * 2 * turns)), "a", [2.0], bandwidth_orders=0.1, shaft_angle=angle
    ).orders[0]
    tracked = order.tracked(step=100)
    assert np.allclose(tracked.speed_rpm, angle.speed_rpm_at(tracked.time_s))
    assert np.array_equal(tracked.amplitude, order.amplitude[::100])
    assert tracked.bandwidth_orders == pytest.approx(0.1)
    assert replace(tracked, order=1.0).unit == "m/s^2"
