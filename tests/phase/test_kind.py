"""The kind of motion, from a model's states and from one measured channel."""

from functools import cache

import numpy as np
import pytest
from scipy.signal import lfilter

from gearsig.errors import RefusalError
from gearsig.phase import PhasePortrait, constant_period_lock, embedding_dimension, kind_of_motion, phase_plane
from tests.marks import further
from tests.phase.systems import DUFFING_PERIOD_S, duffing, quasi_periodic

RATE = 64 / DUFFING_PERIOD_S


@cache
def _duffing(force, n_periods=1500, noise=0.0):
    states = duffing(force, n_periods)
    states += noise * states.std(axis=0) * np.random.default_rng(0).normal(size=states.shape)
    path = PhasePortrait(states, RATE, ("x", "v"), ("m", "m/s"), "states", "duffing")
    return path, constant_period_lock(DUFFING_PERIOD_S, path.end_s, "forcing period")


@pytest.mark.parametrize(
    ("force", "noise", "kind", "period"),
    [
        (0.20, 0.0, "periodic", 1),
        (0.20, 0.02, "periodic", 1),
        (0.28, 0.0, "subharmonic", 2),
        (0.28, 0.02, "subharmonic", 2),
        (0.29, 0.0, "subharmonic", 4),
        (0.50, 0.0, "chaotic", 0),
    ],
)
def test_forced_oscillator(force, noise, kind, period):
    found = kind_of_motion(*_duffing(force, noise=noise))
    assert (found.kind, found.period) == (kind, period)
    assert found.evidence


def test_from_measured_acceleration_alone():
    path, lock = _duffing(0.5)
    x, v = path.points.T
    t = np.arange(len(x)) / RATE
    acceleration = 0.5 * np.cos(1.2 * t) - 0.3 * v + x - x**3
    plane = phase_plane(acceleration, RATE, quantity="acceleration", low_cut_hz=0.02, unit="m/s^2")
    assert kind_of_motion(plane, lock).kind == "chaotic"


def test_two_frequencies_are_quasi_periodic():
    x = quasi_periodic(30_000)
    plane = phase_plane(x, 1000.0, quantity="displacement")
    found = kind_of_motion(plane, constant_period_lock(50.3 / 1000.0, 30.0))
    assert found.kind == "quasi-periodic"
    assert found.chaos_test.k < 0.1
    assert abs(found.exponent.exponent_per_s) < 0.05  # per second, of a motion with 20 cycles per second


def test_noise_is_called_stochastic():
    noise = np.random.default_rng(0).normal(size=(8_000, 2))
    path = PhasePortrait(noise, 1000.0, ("x", "v"), ("m", "m/s"), "states", "noise")
    found = kind_of_motion(path, constant_period_lock(0.02, 8.0))
    assert found.kind == "stochastic"
    assert any("no dimension" in sentence for sentence in found.evidence)


@pytest.mark.slow
@pytest.mark.parametrize(("per_period", "n_periods"), [(32, 600), further(128, 300)])
def test_clean_chaos_whose_usual_delay_is_too_long_is_not_called_stochastic(per_period, n_periods):
    rate = per_period / DUFFING_PERIOD_S
    path = PhasePortrait(duffing(0.5, n_periods, per_period), rate, ("x", "v"), ("m", "m/s"), "states", "duffing")
    usual = embedding_dimension(np.ascontiguousarray(path.points[:, 0]), rate)
    assert usual.dimension == 0
    found = kind_of_motion(path, constant_period_lock(DUFFING_PERIOD_S, path.end_s, "forcing period"))
    assert found.kind == "chaotic"


@pytest.mark.slow
@pytest.mark.parametrize("smooth", [0.5, 0.95])
@pytest.mark.parametrize("seed", [0, further(2)])
def test_filtered_noise_stays_stochastic(smooth, seed):
    x = lfilter([1.0], [1.0, -smooth], np.random.default_rng(seed).normal(size=8_000))
    path = PhasePortrait(np.stack([x, np.gradient(x)], 1), 1000.0, ("x", "v"), ("m", "m/s"), "states", "noise")
    assert kind_of_motion(path, constant_period_lock(0.0297, 8.0)).kind == "stochastic"


def test_what_cannot_be_answered_is_said():
    noise = np.random.default_rng(0).normal(size=(1500, 2))
    path = PhasePortrait(noise, 1000.0, ("x", "v"), ("m", "m/s"), "states", "noise")
    found = kind_of_motion(path, constant_period_lock(0.02, 1.5))
    assert any(sentence.startswith("0–1 test: values has") for sentence in found.evidence)
    with pytest.raises(RefusalError, match="no whole cycle"):
        kind_of_motion(path, constant_period_lock(5.0, 10.0))


@pytest.mark.slow
def test_a_model_without_noise_needs_no_exponent_to_be_regular(monkeypatch):
    """Where neighbours cannot be followed, the 0–1 test calls a deterministic motion regular, but never chaotic."""

    def refuse(_path, **_options):
        raise RefusalError("too short", remedy="longer")

    monkeypatch.setattr("gearsig.phase._kind.largest_lyapunov_exponent", refuse)
    chaos = _duffing(0.5)
    assert kind_of_motion(*chaos).kind == "undecided"
    assert kind_of_motion(*chaos, noise_free=True).kind == "undecided"
    plane = phase_plane(quasi_periodic(30_000), 1000.0, quantity="displacement")
    assert kind_of_motion(plane, constant_period_lock(50.3 / 1000.0, 30.0), noise_free=True).kind == "quasi-periodic"
