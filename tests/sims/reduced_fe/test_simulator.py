"""The flexible pair as a simulator: recordings, effects, parameters, refusals."""

import numpy as np
import pytest

import sims
from gearsig.errors import InputError
from sims.effects import EffectSetting, effect, effects
from sims.registry import simulator
from sims.simulator import SimulationSetup, complete_values

MODEL = "reduced-fe"
SHORT = {"duration_s": 0.15, "seed": 1}
TWO_TURNS = {"duration_s": 0.06, "seed": 1}


@pytest.fixture(scope="module")
def healthy():
    return sims.simulate(MODEL, **SHORT)


@pytest.fixture(scope="module")
def two_healthy_turns():
    return sims.simulate(MODEL, **TWO_TURNS)


def rms(recording, name="a1"):
    return float(np.std(recording.values(name)))


def test_recording_has_the_channels_units_rig_and_truth_of_the_other_simulator(healthy):
    other = sims.simulate("cracked", preset="symmetric_50_50", duration_s=0.05)
    assert healthy.channel_names == other.channel_names
    assert [c.unit for c in healthy.channels] == [c.unit for c in other.channels]
    assert healthy.rig is not None
    assert healthy.rig.pairs[0].driver_teeth == 50
    truth = healthy.truth
    assert truth["model"] == MODEL
    assert truth["parameters"]["hub_inertia_driver_kg_m2"] == 0.0043
    assert 2600.0 < truth["solver"]["torsional_hz"] < 2750.0
    assert truth["gears"][0]["degrees_of_freedom"] > 200_000
    assert truth["measurement"]["n_revolutions"]["input"] == pytest.approx(2000.0 / 60.0 * 0.15, rel=1e-3)


def test_mesh_harmonics_stand_out_of_the_spectrum(healthy):
    values = healthy.values("a1") * np.hanning(healthy.n_samples)
    lines = np.abs(np.fft.rfft(values))
    hz = np.fft.rfftfreq(healthy.n_samples, 1.0 / healthy.sampling_rate_hz)
    mesh = 2000.0 / 60.0 * 50.0
    for harmonic in range(1, 5):
        near = np.abs(hz - harmonic * mesh) < 12.0
        assert lines[near].max() > 20.0 * np.median(lines)


@pytest.mark.slow
def test_the_same_seed_gives_the_same_recording(two_healthy_turns):
    again = sims.simulate(MODEL, **TWO_TURNS)
    np.testing.assert_array_equal(two_healthy_turns.samples, again.samples)


# One that changes teeth, one of the support, and the one that changes nothing; all of them take minutes.
QUICK = {"backlash", "root_crack", "bearing_outer_race"}


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=() if name in QUICK else pytest.mark.slow) for name in effects()]
)
def test_every_effect_changes_the_recording_or_says_why_not(two_healthy_turns, name):
    changed = sims.simulate(MODEL, effects={name: effect(name).severity.typical}, **TWO_TURNS)
    assert changed.truth["effects"][0]["name"] == name
    change = float(np.std(changed.values("a1") - two_healthy_turns.values("a1")))
    if name == "backlash":  # at full load the play is never crossed
        assert change == 0.0
    else:
        assert change > 1e-5 * rms(two_healthy_turns)


def test_effects_of_severity_zero_change_nothing(two_healthy_turns):
    nothing = sims.simulate(MODEL, effects=dict.fromkeys(effects(), 0.0), **TWO_TURNS)
    np.testing.assert_array_equal(nothing.samples, two_healthy_turns.samples)


@pytest.mark.slow
def test_a_crack_shows_once_per_revolution_and_grows():
    def burst(depth):
        settings = {"effects": {"root_crack": depth}} if depth else {}
        found = sims.simulate(
            MODEL,
            speed_rpm=1920.0,
            duration_s=0.6,
            parameters={"noise_mps2": 0.0, "sensor_noise_mps2_per_sqrt_hz": 0.0},
            sampling_rate_hz=40960.0,
            **settings,
        )
        return found.values("a1")

    healthy, small, deep = burst(0.0), burst(2.0), burst(3.5)
    assert np.std(deep - healthy) > 1.6 * np.std(small - healthy)
    per_revolution = 1280  # 40960 Hz at 1920 rpm
    power = (deep - healthy)[: 18 * per_revolution].reshape(18, per_revolution) ** 2
    profile = power.mean(axis=0)
    window = np.convolve(np.tile(profile, 2), np.ones(per_revolution // 10), "valid")[:per_revolution]
    assert window.max() > 0.6 * profile.sum()  # within a tenth of the revolution


def test_bad_values_are_refused():
    rough = EffectSetting("surface_roughness", 0.8, {"locked_to": "time"})
    with pytest.raises(InputError, match="locked to time"):
        sims.simulate(MODEL, effects=(rough,), **SHORT)
    with pytest.raises(InputError, match="teeth yield by"):
        sims.simulate(MODEL, torque_nm=1500.0, **SHORT)
    with pytest.raises(InputError, match="did you mean hub_inertia_driver_kg_m2"):
        sims.simulate(MODEL, parameters={"hub_inertia_drver_kg_m2": 0.0}, **SHORT)
    with pytest.raises(InputError, match="web"):
        sims.simulate(MODEL, parameters={"web_thickness_driver_mm": 30.0}, **SHORT)


@pytest.mark.slow
def test_parameters_have_units_ranges_and_defaults():
    model = simulator(MODEL)
    names = [p.name for p in model.parameters]
    assert len(set(names)) == len(names)
    values = complete_values(model.parameters)
    assert values["mesh_damping_ratio"] == 0.08
    assert values["friction"] == "off"
    assert "contact_law" not in values
    for p in model.parameters:
        assert p.meaning
        assert p.choices or (p.low is not None and p.high is not None)
    assert "rms of transmission_error_m" in model.check_convergence(SimulationSetup(), np.random.default_rng(0)).text


def test_speed_courses_and_encoders_are_measured():
    found = sims.simulate(
        MODEL, speed_rpm=[(0.0, 1500.0), (0.4, 2500.0)], parameters={"encoder_counts": 3600}, duration_s=0.4
    )
    angle = np.unwrap(np.radians(found.values("input encoder")))
    rpm = np.gradient(angle, 1.0 / found.sampling_rate_hz) * 30.0 / np.pi
    assert rpm[200:600].mean() == pytest.approx(1500.0, rel=0.05)
    assert rpm[-600:-200].mean() == pytest.approx(2500.0, rel=0.05)
