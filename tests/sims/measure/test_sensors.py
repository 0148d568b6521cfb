"""Accelerometers, their paths, tachometers and encoders."""

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from gearsig.angle import find_pulse_edges
from gearsig.errors import InputError
from sims.measure import (
    Accelerometer,
    Converter,
    Encoder,
    ModalPath,
    PathMode,
    Tachometer,
    disc_edges,
    pulse_voltage,
)

STEP = 4e-6


def read(sensor, signal, seed=0, step=STEP):
    return sensor.read(signal, np.arange(len(signal)) * step, np.random.default_rng(seed))


def amplitude(sensor, frequency_hz, settle_s=0.05, n_cycles=30):
    t = np.arange(round((settle_s + n_cycles / frequency_hz) / STEP)) * STEP
    out = read(sensor, np.sin(2 * np.pi * frequency_hz * t))
    last = t >= settle_s
    return abs(2 * np.mean(out[last] * np.exp(-2j * np.pi * frequency_hz * t[last])))


def test_bandwidth_of_a_mounted_resonance():
    """1/√((1 - r²)² + (2ζr)²), 4 % high at a fifth of the resonance."""
    sensor = Accelerometer(resonance_hz=25e3, damping_ratio=0.05)
    for f in (1000.0, 5000.0, 12000.0):
        r = f / 25e3
        expected = 1 / np.hypot(1 - r * r, 2 * 0.05 * r)
        assert amplitude(sensor, f) == pytest.approx(expected, rel=0.01)
    assert amplitude(sensor, 5000.0) == pytest.approx(1.04, abs=0.005)


def test_coupling_is_3_db_down_at_its_limit():
    sensor = Accelerometer(lower_limit_hz=20.0)
    assert amplitude(sensor, 20.0) == pytest.approx(np.sqrt(0.5), rel=1e-3)
    assert amplitude(sensor, 400.0) == pytest.approx(1 / np.hypot(1, 0.05), rel=2e-3)
    assert np.abs(read(sensor, np.full(1000, 9.81))).max() < 1e-6


@given(st.floats(0.1, 100.0), st.floats(0.01, 1000.0))
def test_range_holds_and_leaves_the_rest_alone(limit, peak):
    x = peak * np.sin(np.linspace(0, 20, 500))
    out = read(Accelerometer(range_mps2=limit), x)
    assert np.abs(out).max() <= limit
    inside = np.abs(x) < limit
    np.testing.assert_array_equal(out[inside], x[inside])
    np.testing.assert_array_equal(out[~inside], np.sign(x[~inside]) * limit)


def test_noise_has_its_density_whatever_the_step():
    from scipy.signal import welch

    for step in (4e-6, 1.6e-5):
        out = read(Accelerometer(noise_mps2_per_sqrt_hz=2e-3), np.zeros(2**18), step=step)
        _, density = welch(out, 1 / step, nperseg=1024)
        assert np.sqrt(np.mean(density[2:-2])) == pytest.approx(2e-3, rel=0.01)


def test_bias_and_drift():
    out = read(Accelerometer(bias_mps2=0.5, drift_mps2_per_s=-2.0), np.zeros(250_001))
    assert out[0] == 0.5
    assert out[-1] == pytest.approx(0.5 - 2.0 * 1.0, rel=1e-9)


@given(st.floats(-20.0, 20.0), st.integers(8, 24))
def test_converter_rounds_to_steps_and_holds_at_its_ends(value, bits):
    converter = Converter(10.0, bits)
    out = float(converter.convert(np.array([value]))[0])
    assert -10.0 <= out <= 10.0 - converter.step_mps2
    assert (out / converter.step_mps2) == round(out / converter.step_mps2)
    if abs(value) < 10.0 - converter.step_mps2:
        assert abs(out - value) <= 0.5 * converter.step_mps2


def test_nonsense_is_refused():
    with pytest.raises(InputError, match="range_mps2"):
        Accelerometer(range_mps2=0.0)
    with pytest.raises(InputError, match="n_bits"):
        Converter(10.0, 4)
    with pytest.raises(InputError, match="duty"):
        Tachometer(duty=0.0)
    with pytest.raises(InputError, match="pulses_per_revolution"):
        Tachometer(pulses_per_revolution=0)
    with pytest.raises(InputError, match="bias_mps2"):
        Accelerometer(bias_mps2=float("nan"))


# Modal path on the solver's grid: analytic response, exactness between steps, positions.

PATH = ModalPath({"y": 0.3}, (PathMode(900.0, 0.03, {"y": 1.0}), PathMode(3400.0, 0.02, {"y": -0.5})))


def hold_error(frequency_hz):
    """What straight lines between steps take from a sine's gain: 1 - sinc²(fΔ)."""
    return 1.0 - np.sinc(frequency_hz * STEP) ** 2


def measured_response(path, frequency_hz, step_s=STEP, settle_s=0.3, n_cycles=20):
    """Gain and phase of a sine once the start has died away."""
    n_settle, n = round(settle_s / step_s), round(n_cycles / frequency_hz / step_s)
    t = np.arange(n_settle + n) * step_s
    reference = np.exp(2j * np.pi * frequency_hz * t)
    out = path.apply(reference.real[:, None], ("y",), step_s)[n_settle:]
    basis = np.column_stack([reference.real[n_settle:], -reference.imag[n_settle:]])
    re, im = np.linalg.lstsq(basis, out)[0]
    return re + 1j * im


@pytest.mark.parametrize("frequency_hz", [50.0, 500.0, 900.0, 1700.0, 3400.0, 7000.0])
def test_response_is_the_analytic_one(frequency_hz):
    expected = PATH.response(np.array([frequency_hz]), "y")[0]
    found = measured_response(PATH, frequency_hz)
    assert abs(found - expected) < 1.5 * hold_error(frequency_hz) * abs(expected) + 1e-7


def test_hold_error_is_the_loss_of_gain():
    alone = ModalPath({}, (PathMode(900.0, 0.03, {"y": 1.0}),))
    for f in (500.0, 2000.0, 6000.0):
        ratio = measured_response(alone, f) / alone.response(np.array([f]), "y")[0]
        assert 1 - abs(ratio) == pytest.approx(hold_error(f), rel=0.01)
        assert np.angle(ratio) == pytest.approx(0.0, abs=1e-5)
    assert hold_error(2000.0) == pytest.approx(2.1e-4, rel=0.01)


def test_error_falls_with_the_square_of_the_step():
    exact = PATH.response(np.array([2500.0]), "y")[0]
    errors = [abs(measured_response(PATH, 2500.0, step) - exact) for step in (1.6e-5, 8e-6, 4e-6)]
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    np.testing.assert_allclose(orders, 2.0, atol=0.05)


@settings(max_examples=15, deadline=None)
@given(st.floats(100.0, 8000.0), st.floats(0.002, 0.7), st.integers(0, 1000))
def test_exact_for_accelerations_straight_between_steps(frequency_hz, damping, seed):
    """Against scipy's linear simulation, which integrates the same piecewise straight input by matrix exponentials."""
    from scipy.signal import lsim

    x = np.concatenate([[0.0], np.random.default_rng(seed).standard_normal(400)])
    x[1:] -= x[1:].mean()  # both begin at rest
    w = 2 * np.pi * frequency_hz
    _, expected, _ = lsim(([w * w], [1.0, 2 * damping * w, w * w]), x, np.arange(401) * STEP, interp=True)
    found = ModalPath({}, (PathMode(frequency_hz, damping, {"y": 1.0}),)).apply(x[:, None], ("y",), STEP)
    np.testing.assert_allclose(found, expected, atol=1e-8 * max(1.0, np.abs(expected).max()))


def test_standing_acceleration_passes_from_the_first_step():
    out = PATH.apply(np.full((100, 1), 2.0), ("y",), STEP)
    np.testing.assert_allclose(out, 2.0 * (0.3 + 1.0 - 0.5), rtol=1e-6)


def test_positions_add_with_their_own_gains():
    rng = np.random.default_rng(0)
    a = rng.standard_normal((500, 2))
    mode = PathMode(900.0, 0.03, {"p": 0.2, "q": -0.7})
    both = ModalPath({"q": 1.5}, (mode,)).apply(a, ("p", "q"), STEP)
    unit = ModalPath({}, (PathMode(900.0, 0.03, {"s": 1.0}),))
    parts = unit.apply(a[:, [0]], ("s",), STEP) * 0.2 + unit.apply(a[:, [1]], ("s",), STEP) * -0.7
    np.testing.assert_allclose(both, parts + 1.5 * a[:, 1], atol=1e-12)


def test_ring_down_is_over_after_the_settling_time():
    path = ModalPath({}, (PathMode(700.0, 0.01, {"y": 1.0}),))
    n = round(1.2 * path.settling_s / STEP)
    x = np.zeros((n, 1))
    x[1] = 1.0
    out = np.abs(path.apply(x, ("y",), STEP))
    assert out[round(path.settling_s / STEP) :].max() < 1.05e-4 * out.max()


def test_unknown_position_and_unresolved_mode_are_refused():
    with pytest.raises(InputError, match="did you mean bearing 1"):
        ModalPath({"bearing1": 1.0}).apply(np.zeros((4, 1)), ("bearing 1",), STEP)
    with pytest.raises(InputError, match="steps per cycle"):
        ModalPath({}, (PathMode(60e3, 0.03, {"y": 1.0}),)).apply(np.zeros((4, 1)), ("y",), STEP)
    with pytest.raises(InputError, match="no source"):
        ModalPath()


def test_a_slow_mode_does_not_ring_from_a_first_value_that_is_a_peak():
    """Of a vibration far above it, it passes on g (f0/f)²; from a standing acceleration it would fall by g at first."""
    slow = ModalPath({}, (PathMode(6.0, 0.3, {"y": 1000.0}),))
    t = np.arange(25000) * 4e-5
    found = slow.apply(np.cos(2 * np.pi * 600.0 * t)[:, None], ("y",), 4e-5)
    assert np.abs(found).max() < 1e-3 * 1000.0
    assert np.abs(found[-5000:]).max() == pytest.approx(1000.0 * (6.0 / 600.0) ** 2, rel=0.01)


# Tachometer, counter and encoder from a simulated shaft angle.

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


def test_encoder_noise_has_its_deviation_and_is_only_drawn_where_it_may_be():
    angle = np.linspace(0.0, 100.0, 20_001)
    encoder = Encoder(counts_per_revolution=2**30, wraps=False, noise_deg=0.01)
    error = encoder.read_deg(angle, np.random.default_rng(0)) - np.degrees(angle)
    assert error.std() == pytest.approx(0.01, rel=0.03)
    np.testing.assert_allclose(encoder.read_deg(angle), np.degrees(angle), atol=4e-7)
