"""The kinematic model: levels, orders and angles against closed forms; speed profiles and tachometer."""

import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gearsig.errors import InputError
from gearsig.recording import Recording
from gearsig.rig import Bearing, GearPair, Rig, Shaft
from sims.measure import ColouredNoise, MainsHum, Tachometer
from tests.kinematic.model import (
    BearingFault,
    KinematicModel,
    MeshHarmonics,
    MeshModulation,
    PathResonance,
    SensorChannel,
    ShaftOrder,
    ToothDamage,
    ToothVariation,
    TransferPath,
    between_teeth,
    engagement_window,
    knock_angles,
)
from tests.kinematic.simulate import ring_down, simulate_kinematic
from tests.kinematic.speed import ConstantProfile, LinearRamp, Wander, time_at_revolutions

RATE, DURATION = 10_000.0, 2.0
RIG = Rig(
    shafts=(Shaft("input"), Shaft("output")),
    pairs=(GearPair("stage 1", "input", "output", 30, 60),),
    bearings=(Bearing("b", "input", 9, 7.94, 39.04),),
)
# 1500 rpm for 2 s: 50 whole revolutions of the input shaft, 25 of the output shaft; every order lies on a line.
SPEED = ConstantProfile(1500.0)


def run(seed=1, speed=SPEED, **parts) -> Recording:
    model = KinematicModel(speed, **parts)
    return simulate_kinematic(RIG, model, sampling_rate_hz=RATE, duration_s=DURATION, rng=np.random.default_rng(seed))


def line(recording, frequency_hz, channel="a1"):
    """Complex peak amplitude at a frequency that lies on a line."""
    x, t = recording.values(channel), recording.time_s()
    return 2 * np.mean(x * np.exp(-2j * np.pi * frequency_hz * t))


def test_mesh_harmonics_have_their_amplitude_phase_and_order():
    r = run(meshes=(MeshHarmonics("stage 1", (3.0, 0.5), (0.7, -1.0)),))
    assert line(r, 750.0) == pytest.approx(3.0 * np.exp(0.7j), abs=1e-9)
    assert line(r, 1500.0) == pytest.approx(0.5 * np.exp(-1.0j), abs=1e-9)
    assert np.mean(r.values("a1") ** 2) == pytest.approx((9 + 0.25) / 2, rel=1e-9)


@pytest.mark.parametrize(("shaft", "spacing_hz"), [("input", 25.0), ("output", 12.5)])
def test_modulation_makes_sidebands_of_its_own_shaft(shaft, spacing_hz):
    mesh = MeshHarmonics("stage 1", (4.0,))
    r = run(meshes=(mesh,), modulations=(MeshModulation("stage 1", shaft, 0.3),))
    assert abs(line(r, 750.0 - spacing_hz)) == pytest.approx(0.6, rel=1e-9)
    assert abs(line(r, 750.0 + spacing_hz)) == pytest.approx(0.6, rel=1e-9)
    assert abs(line(r, 750.0 + 2 * spacing_hz)) == pytest.approx(0.0, abs=1e-9)


def test_phase_modulation_grows_with_the_harmonic_as_bessel_functions_say():
    from scipy.special import jv

    r = run(
        meshes=(MeshHarmonics("stage 1", (1.0, 1.0)),),
        modulations=(MeshModulation("stage 1", "input", 0.0, phase_deviation_rad=0.4),),
    )
    for harmonic in (1, 2):
        assert abs(line(r, 750.0 * harmonic)) == pytest.approx(jv(0, 0.4 * harmonic), rel=1e-9)
        assert abs(line(r, 750.0 * harmonic + 25)) == pytest.approx(jv(1, 0.4 * harmonic), rel=1e-9)


def test_shaft_order_grows_with_speed_squared():
    r = run(shaft_orders=(ShaftOrder("output", 0.2, at_rpm=1500.0, phase_rad=0.3),))
    assert line(r, 12.5) == pytest.approx(0.05 * np.exp(0.3j), abs=1e-9)


def test_run_up_keeps_its_phase_to_the_angle():
    speed = LinearRamp(600.0, 3000.0, DURATION)
    r = run(speed=speed, meshes=(MeshHarmonics("stage 1", (2.0,)),))
    expected = 2.0 * np.cos(2 * np.pi * 30 * (10 * r.time_s() + 20 * r.time_s() ** 2 / 2))
    np.testing.assert_allclose(r.values("a1"), expected, atol=1e-8)


def test_paths_hum_and_channels():
    path = TransferPath(0.5, (PathResonance(800.0, 0.05, 3.0),))
    r = run(
        meshes=(MeshHarmonics("stage 1", (2.0,)),),
        channels=(SensorChannel("a1"), SensorChannel("a2", path, hum=MainsHum((0.1,)))),
    )
    gain = path.response(np.array([750.0]), RATE)[0]
    assert line(r, 750.0, "a2") == pytest.approx(2.0 * gain, abs=1e-6)
    assert abs(line(r, 50.0, "a2")) == pytest.approx(0.1, abs=1e-6)
    assert path.response(np.array([800.0]), RATE)[0] == pytest.approx(2.0)  # 0.5 (1 + 3)


def test_filters_are_settled_at_time_zero():
    path = TransferPath(1.0, (PathResonance(800.0, 0.02, 3.0),))
    r = run(meshes=(MeshHarmonics("stage 1", (2.0,)),), channels=(SensorChannel("a1", path),))
    steady = np.real(line(r, 750.0) * np.exp(2j * np.pi * 750.0 * r.time_s()))
    np.testing.assert_allclose(r.values("a1"), steady, atol=1e-6)


@pytest.mark.parametrize("slope", [0.0, 1.0, 2.0])
def test_noise_has_its_level_and_slope(slope):
    x = ColouredNoise(0.7, slope).draw(200_000, 10_000.0, np.random.default_rng(4))
    power = np.abs(np.fft.rfft(x)) ** 2
    f = np.fft.rfftfreq(x.size, 1e-4)
    low, high = (power[(f > a) & (f < b)].mean() for a, b in ((95, 105), (950, 1050)))
    assert 10 * np.log10(low / high) == pytest.approx(10 * slope, abs=1.5)
    if slope <= 1:
        assert x.std() == pytest.approx(0.7, rel=0.05)


def test_ring_down_is_exact_between_the_samples():
    t0, f, zeta, rate = 0.01237, 900.0, 0.05, 8000.0
    x = ring_down(400, 0.0, rate, np.array([t0]), np.array([2.0]), f, zeta)
    since = np.arange(400) / rate - t0
    w = 2 * np.pi * f
    expected = np.where(since >= 0, 2 * np.exp(-zeta * w * since) * np.sin(w * np.sqrt(1 - zeta**2) * since), 0.0)
    np.testing.assert_allclose(x, expected, atol=1e-6)


@pytest.mark.parametrize(("shaft", "period_s", "angle"), [("input", 0.04, 0.37), ("output", 0.08, 0.8)])
def test_damaged_tooth_knocks_at_its_angle_once_per_revolution(shaft, period_s, angle):
    damage = ToothDamage("stage 1", shaft, angle, 10.0, resonance_hz=2000.0, damping_ratio=0.2, impulse_spread=0.0)
    x = run(tooth_damages=(damage,)).values("a1")
    starts = np.flatnonzero((np.abs(x[1:]) > 0.5) & (np.abs(x[:-1]) < 0.05)) + 1
    first_of_each = starts[np.diff(starts, prepend=-1000) > 100]
    expected = (np.arange(round(DURATION / period_s)) + angle) * period_s
    np.testing.assert_allclose(first_of_each / RATE, expected, atol=2.1 / RATE)


def test_damaged_tooth_dips_the_mesh_where_it_is_engaged():
    mesh = MeshHarmonics("stage 1", (1.0,))
    damage = ToothDamage("stage 1", "input", 0.5, mesh_dip_fraction=0.4, width_teeth=2.0)
    healthy, hurt = run(meshes=(mesh,)).values("a1"), run(meshes=(mesh,), tooth_damages=(damage,)).values("a1")
    rev = 25 * np.arange(len(healthy)) / RATE % 1
    np.testing.assert_allclose(hurt, healthy * (1 - 0.4 * engagement_window(rev, 0.5, 2 / 30)), atol=1e-9)
    assert engagement_window(np.array([0.5, 0.5 + 1 / 60, 0.5 + 1 / 30]), 0.5, 2 / 30) == pytest.approx([1, 0.5, 0])
    assert engagement_window(np.array([0.99, 0.01]), 0.0, 0.04) == pytest.approx([0.5, 0.5])  # across angle zero


@given(st.integers(3, 60), st.integers(0, 999))
def test_interpolation_between_teeth_passes_through_every_tooth(n_teeth, seed):
    values = np.random.default_rng(seed).standard_normal(n_teeth)
    middle = (np.arange(n_teeth) + 0.5) / n_teeth
    np.testing.assert_allclose(between_teeth(values, middle), values, atol=1e-9)
    np.testing.assert_allclose(between_teeth(values, middle + 3), values, atol=1e-9)


def test_slip_makes_the_knocks_drift():
    rng = np.random.default_rng(1)
    even = knock_angles(3.5, 0.0, 0.0, 200.0, rng)
    np.testing.assert_allclose(np.diff(even), 1 / 3.5)
    uneven = np.diff(knock_angles(3.5, 0.01, 0.0, 2000.0, rng)) * 3.5
    assert uneven.mean() == pytest.approx(1.0, abs=4 * 0.01 / np.sqrt(uneven.size))
    assert uneven.std() == pytest.approx(0.01, rel=4 / np.sqrt(2 * uneven.size))


def test_first_knock_comes_anywhere_within_one_spacing():
    first = [knock_angles(3.5, 0.01, 2.0, 5.0, np.random.default_rng(seed))[0] for seed in range(300)]
    assert min(first) >= 2.0
    assert np.mean(first) == pytest.approx(2.0 + 0.5 / 3.5, abs=4 / 3.5 / np.sqrt(12 * 300))
    assert np.ptp(first) == pytest.approx(1 / 3.5, rel=0.05)


def test_bearing_on_another_shaft_turns_at_that_shafts_speed():
    rig = Rig(shafts=RIG.shafts, pairs=RIG.pairs, bearings=(Bearing("b", "output", bpfo_order=4.0),))
    fault = BearingFault("b", "outer", 5.0, resonance_hz=3000.0, damping_ratio=0.2, slip_fraction=0.0)
    model = KinematicModel(SPEED, bearing_faults=(fault,))
    x = simulate_kinematic(rig, model, sampling_rate_hz=RATE, duration_s=DURATION, rng=np.random.default_rng(1))
    loud = np.flatnonzero(np.abs(x.values("a1")) > 1.0)
    starts = loud[np.diff(loud, prepend=-1000) > 50]
    assert 98 <= len(starts) <= 101
    # 4 impacts per revolution at 12.5 revolutions per second.
    np.testing.assert_allclose(np.diff(starts), RATE / 50, atol=1.1)


@pytest.mark.parametrize("race", ["outer", "inner"])
def test_bearing_knocks_show_at_the_order_of_the_race(race):
    fault = BearingFault("b", race, 5.0, resonance_hz=3000.0, slip_fraction=0.0, impulse_spread=0.0)
    r = run(bearing_faults=(fault,))
    order = RIG.bearings[0].orders()[fault.order_name]
    assert r.truth["drawn"][f"b: {fault.order_name} order"] == order
    square, t = r.values("a1") ** 2, r.time_s()

    def level(at_hz):
        return abs(np.mean(square * np.hanning(t.size) * np.exp(-2j * np.pi * at_hz * t)))

    assert level(25 * order) > 20 * level(25 * order * 1.07)
    # Only the inner-race defect turns through the load zone: sidebands at shaft speed.
    sideband = level(25 * (order - 1)) / level(25 * order)
    assert sideband > 0.3 if race == "inner" else sideband < 0.02


EVERYTHING = {
    "meshes": (MeshHarmonics("stage 1", (3.0, 1.0)),),
    "modulations": (MeshModulation("stage 1", "output", 0.1),),
    "tooth_variations": (ToothVariation("stage 1", "input"), ToothVariation("stage 1", "output")),
    "tooth_damages": (ToothDamage("stage 1", "input", 0.25, 5.0, resonance_hz=2500.0),),
    "bearing_faults": (BearingFault("b", "outer", 2.0),),
    "shaft_orders": (ShaftOrder("input", 0.1),),
    "channels": (SensorChannel("a1", noise=ColouredNoise(0.1, 1.0)), SensorChannel("a2", noise=ColouredNoise(0.1))),
    "tachometer": Tachometer(jitter_s=1e-5, noise_v=0.01),
}


def test_same_seed_same_recording_other_seed_another():
    first, again, other = run(7, **EVERYTHING), run(7, **EVERYTHING), run(8, **EVERYTHING)
    np.testing.assert_array_equal(first.samples, again.samples)
    assert dict(first.truth) == dict(again.truth)
    assert all(np.any(a != b) for a, b in zip(first.samples, other.samples, strict=True))
    noise = [first.values(name) - run(7, **(EVERYTHING | {"channels": (SensorChannel(name),)})).values(name)
             for name in ("a1", "a2")]  # fmt: skip
    assert abs(np.corrcoef(noise)[0, 1]) < 0.05


@settings(max_examples=5, deadline=None)
@given(st.floats(0.01, 100))
def test_parts_add_up_and_scale(gain):
    def part(**parts):
        return run(channels=(SensorChannel("a1", TransferPath(gain)),), **parts).values("a1")

    mesh, order = EVERYTHING["meshes"], EVERYTHING["shaft_orders"]
    together = part(meshes=mesh, shaft_orders=order)
    np.testing.assert_allclose(together, part(meshes=mesh) + part(shaft_orders=order), atol=1e-10 * gain)
    np.testing.assert_allclose(together, gain * run(meshes=mesh, shaft_orders=order).values("a1"), atol=1e-9 * gain)


def test_truth_is_complete_and_plain():
    truth = json.loads(json.dumps(dict(run(**EVERYTHING).truth)))
    model = truth["model"]
    assert {key for key, value in EVERYTHING.items() if value} <= set(model)
    assert model["tooth_damages"][0]["impulse_mps2"] == 5.0
    assert model["speed"] == {"kind": "ConstantProfile", "rpm": 1500.0}
    assert truth["damaged_teeth"] == [{"pair": "stage 1", "shaft": "input", "angle_deg": 90.0, "tooth": 8}]
    assert truth["mesh_orders"] == {"stage 1": 30.0}
    assert truth["shafts"]["output"]["n_revolutions"] == pytest.approx(25.0)
    assert len(truth["drawn"]["stage 1/output: tooth amplitude fractions"]) == 60
    assert len(truth["drawn"]["tachometer: rising edges_s"]) == 50


def test_recording_describes_itself():
    r = run(**EVERYTHING)
    assert r.channel_names == ("a1", "a2", "tacho")
    assert [c.unit for c in r.channels] == ["m/s^2", "m/s^2", "V"]
    assert (r.speed.channel, r.speed.pulses_per_revolution, r.speed.shaft) == ("tacho", 1, "input")
    assert run(meshes=EVERYTHING["meshes"]).speed is None
    assert r.n_samples == 20_000


# Speed profiles and the tachometer of the kinematic model.

PAIR = Rig(shafts=(Shaft("input"), Shaft("output")), pairs=(GearPair("stage 1", "input", "output", 29, 47),))
PROFILES = [
    ConstantProfile(1500.0),
    LinearRamp(600.0, 3000.0, 2.0),
    LinearRamp(3000.0, 0.0, 2.0),
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
    assert Wander(1500, 0.1, 0.5).revolutions(np.array([2.0]))[0] == pytest.approx(50.0)


@settings(deadline=None)
@given(st.sampled_from(PROFILES), st.lists(st.floats(0.0, 1.9), min_size=1, max_size=8))
def test_time_of_an_angle_inverts_the_angle(profile, times):
    t = np.array(times)
    np.testing.assert_allclose(time_at_revolutions(profile, profile.revolutions(t), 0.0, 1.9), t, atol=1e-9)


@pytest.mark.parametrize("profile", PROFILES)
@pytest.mark.parametrize(("shaft", "ratio"), [("input", 1.0), ("output", 29 / 47)])
def test_model_angle_and_pulses_agree(profile, shaft, ratio):
    tacho = Tachometer(shaft, pulses_per_revolution=3, first_pulse_rev=0.25, edge_s=1e-3, duty=0.4)
    model = KinematicModel(profile, tachometer=tacho)
    rate = 20_000.0
    record = simulate_kinematic(PAIR, model, sampling_rate_hz=rate, duration_s=1.8, rng=np.random.default_rng(1))
    voltage, t = record.values("tacho"), record.time_s()
    rising = np.flatnonzero((voltage[:-1] < 2.5) & (voltage[1:] >= 2.5))
    crossing = t[rising] + (2.5 - voltage[rising]) / (voltage[rising + 1] - voltage[rising]) / rate
    angle = model.shaft_revolutions(PAIR, shaft, crossing)
    np.testing.assert_allclose(angle, ratio * profile.revolutions(crossing))
    # Edges are straight lines through half height, so that interpolation finds them to rounding.
    np.testing.assert_allclose((3 * (angle - 0.25) + 0.5) % 1 - 0.5, 0.0, atol=1e-6)
    np.testing.assert_allclose(np.diff(angle), 1 / 3, atol=1e-6)


def test_jitter_has_its_standard_deviation():
    tacho = Tachometer(pulses_per_revolution=8, jitter_s=1e-4)
    model = KinematicModel(ConstantProfile(3000.0), tachometer=tacho)
    record = simulate_kinematic(PAIR, model, sampling_rate_hz=10_000.0, duration_s=5.0, rng=np.random.default_rng(2))
    edges = np.array(record.truth["drawn"]["tachometer: rising edges_s"])
    error = edges - np.arange(len(edges)) / 400
    assert error.std() == pytest.approx(1e-4, rel=4 / np.sqrt(2 * len(edges)))


def test_pulses_faster_than_their_edges_are_refused():
    model = KinematicModel(ConstantProfile(3000.0), tachometer=Tachometer(pulses_per_revolution=60, edge_s=1e-3))
    with pytest.raises(InputError, match="faster than an edge"):
        simulate_kinematic(PAIR, model, sampling_rate_hz=10_000.0, duration_s=0.5, rng=np.random.default_rng(2))
