"""Modal path on the solver's grid: analytic response, exactness between steps, positions."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gearsig.errors import InputError
from sims.measure import ModalPath, PathMode

STEP = 4e-6
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
    with pytest.raises(InputError, match="steps a cycle"):
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
