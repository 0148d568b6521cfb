"""Accelerometer and converter: bandwidth, range, noise density, bias."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gearsig.errors import InputError
from sims.measure import Accelerometer, Converter

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


def test_wander_grows_with_the_root_of_time():
    sensor = Accelerometer(wander_mps2_per_sqrt_s=0.1)
    t = np.arange(-200, 1001) * 1e-3
    ends = np.array([sensor.read(np.zeros(1201), t, np.random.default_rng(i))[[200, 450, 1200]] for i in range(800)])
    np.testing.assert_array_equal(ends[:, 0], 0.0)
    assert ends[:, 2].std() == pytest.approx(0.1, rel=0.08)
    assert ends[:, 1].std() == pytest.approx(0.05, rel=0.08)


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
    with pytest.raises(InputError, match="bias_mps2"):
        Accelerometer(bias_mps2=float("nan"))
