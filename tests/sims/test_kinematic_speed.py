"""Speed profiles and the tachometer of the kinematic model."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gearsig.errors import InputError
from gearsig.rig import GearPair, Rig, Shaft
from sims.measure import Tachometer
from tests.kinematic.model import KinematicModel
from tests.kinematic.simulate import simulate_kinematic
from tests.kinematic.speed import CoastDown, ConstantProfile, LinearRamp, Wander, time_at_revolutions

RIG = Rig(shafts=(Shaft("input"), Shaft("output")), pairs=(GearPair("stage 1", "input", "output", 29, 47),))
PROFILES = [
    ConstantProfile(1500.0),
    LinearRamp(600.0, 3000.0, 2.0),
    LinearRamp(3000.0, 0.0, 2.0),
    CoastDown(3000.0, 0.8),
    Wander(1500.0, 0.3, 1.3),
]


@pytest.mark.parametrize("profile", PROFILES)
def test_speed_is_the_derivative_of_the_angle(profile):
    t = np.linspace(-0.5, 3.0, 701)
    h = 1e-5
    slope = (profile.revolutions(t + h) - profile.revolutions(t - h)) / (2 * h)
    # At a kink of the ramp the central difference sees both sides.
    smooth = np.min(np.abs(t[:, None] - np.array([0.0, 2.0])), axis=1) > 2 * h
    np.testing.assert_allclose(60 * slope[smooth], profile.speed_rpm(t)[smooth], atol=1e-4)
    assert profile.revolutions(np.zeros(1))[0] == 0.0


def test_closed_forms():
    assert LinearRamp(600, 3000, 8).revolutions(np.array([8.0]))[0] == pytest.approx(240.0)
    assert CoastDown(1200, 2).revolutions(np.array([1e9]))[0] == pytest.approx(40.0)
    assert Wander(1500, 0.1, 0.5).revolutions(np.array([2.0]))[0] == pytest.approx(50.0)


@settings(deadline=None)
@given(st.sampled_from(PROFILES), st.lists(st.floats(0.0, 1.9), min_size=1, max_size=8))
def test_time_of_an_angle_inverts_the_angle(profile, times):
    t = np.array(times)
    np.testing.assert_allclose(time_at_revolutions(profile, profile.revolutions(t), 0.0, 1.9), t, atol=1e-9)


def test_angle_outside_the_interval_is_refused():
    with pytest.raises(InputError, match="outside the interval"):
        time_at_revolutions(ConstantProfile(60.0), np.array([5.0]), 0.0, 1.0)


@pytest.mark.parametrize("profile", PROFILES)
@pytest.mark.parametrize(("shaft", "ratio"), [("input", 1.0), ("output", 29 / 47)])
def test_model_angle_and_pulses_agree(profile, shaft, ratio):
    tacho = Tachometer(shaft, pulses_per_revolution=3, first_pulse_rev=0.25, edge_s=1e-3, duty=0.4)
    model = KinematicModel(profile, tachometer=tacho)
    rate = 20_000.0
    record = simulate_kinematic(RIG, model, sampling_rate_hz=rate, duration_s=1.8, rng=np.random.default_rng(1))
    voltage, t = record.values("tacho"), record.time_s()
    rising = np.flatnonzero((voltage[:-1] < 2.5) & (voltage[1:] >= 2.5))
    crossing = t[rising] + (2.5 - voltage[rising]) / (voltage[rising + 1] - voltage[rising]) / rate
    angle = model.shaft_revolutions(RIG, shaft, crossing)
    np.testing.assert_allclose(angle, ratio * profile.revolutions(crossing))
    # Edges are straight lines through half height, so that interpolation finds them to rounding.
    np.testing.assert_allclose((3 * (angle - 0.25) + 0.5) % 1 - 0.5, 0.0, atol=1e-6)
    np.testing.assert_allclose(np.diff(angle), 1 / 3, atol=1e-6)


def test_jitter_has_its_standard_deviation():
    tacho = Tachometer(pulses_per_revolution=8, jitter_s=1e-4)
    model = KinematicModel(ConstantProfile(3000.0), tachometer=tacho)
    record = simulate_kinematic(RIG, model, sampling_rate_hz=10_000.0, duration_s=5.0, rng=np.random.default_rng(2))
    edges = np.array(record.truth["drawn"]["tachometer: rising edges_s"])
    error = edges - np.arange(len(edges)) / 400
    assert error.std() == pytest.approx(1e-4, rel=4 / np.sqrt(2 * len(edges)))


def test_pulses_faster_than_their_edges_are_refused():
    model = KinematicModel(ConstantProfile(3000.0), tachometer=Tachometer(pulses_per_revolution=60, edge_s=1e-3))
    with pytest.raises(InputError, match="faster than an edge"):
        simulate_kinematic(RIG, model, sampling_rate_hz=10_000.0, duration_s=0.5, rng=np.random.default_rng(2))


@pytest.mark.parametrize(
    "make",
    [
        lambda: ConstantProfile(0.0),
        lambda: LinearRamp(-1.0, 5.0, 1.0),
        lambda: CoastDown(100.0, 0.0),
        lambda: Wander(100.0, 1.5, 1.0),
        lambda: Tachometer(duty=0.0),
        lambda: Tachometer(pulses_per_revolution=0),
    ],
)
def test_bad_parameters(make):
    with pytest.raises(InputError):
        make()
