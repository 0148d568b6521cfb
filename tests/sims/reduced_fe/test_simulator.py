"""The flexible pair as a simulator, and set to a rig for the gap diagnosis."""

import pickle
from collections.abc import Iterator
from functools import cache

import numpy as np
import pytest

import sims
from gearsig.errors import InputError, RefusalError
from gearsig.gap import AddedEffect, OperatingCondition
from gearsig.rig import Bearing, GearPair, OperatingPoint, Rig, Sensor, Shaft
from sims import simulate
from sims.effects import EffectSetting, effect, effects
from sims.reduced_fe import TRANSMISSION_ERROR, TWIN_STEP_S, ReducedPair, ReducedTwin, constants, respond
from sims.registry import gap_simulator, simulator
from sims.simulator import SimulationSetup, complete_values
from tests.sims.reduced_fe.synthetic import synthetic_gear

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
    with pytest.raises(InputError, match="teeth deflect by"):
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


# The flexible pair set to a rig, for the gap diagnosis.

POINT = OperatingCondition(1800.0, 40.0)
RIG = Rig(
    "bench",
    (Shaft("pinion"), Shaft("wheel")),
    (GearPair("pair", "pinion", "wheel", 21, 50, 2.0, 20.0, 18.0),),
    (Bearing("P1", "pinion", 9, 7.94, 39.04),),
    (Sensor("acc", "acceleration", "m/s^2", "over P1, vertical"),),
    OperatingPoint("wheel", 756.0, torque_nm=100.0),
)
CRACK = AddedEffect("root_crack", 2.0, {"gear": "driver", "tooth": 4.0})


@pytest.fixture(scope="module")
def twin() -> Iterator[ReducedTwin]:
    """Of synthetic gears: how gears are reduced is tested elsewhere."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(
            "sims.reduced_fe._simulator.reduced_gear", cache(lambda blank, _n_dof: synthetic_gear(blank.geometry))
        )
        made = gap_simulator("reduced-fe").twin_of(RIG)
        assert isinstance(made, ReducedTwin)
        yield made


def run(twin, added=(), *, seed=0, noise=0):
    return twin.run(POINT, added, seed=seed, noise=noise, duration_s=0.1, sampling_rate_hz=20480.0)


@pytest.fixture(scope="module")
def of_twin(twin):
    return run(twin)


def test_the_twin_is_the_rig_with_this_model(twin, of_twin):
    found = of_twin
    assert found.rig is not None
    assert found.rig.pairs == RIG.pairs
    assert found.truth["model"] == "reduced-fe"
    assert found.truth["parameters"]["teeth_driven"] == 50
    assert found.channel_names[0] == "acc"
    assert twin.key.startswith("reduced-fe ")


@pytest.mark.slow
def test_an_effect_alone_makes_the_difference(twin, of_twin):
    cracked, other = run(twin, (CRACK,)), run(twin, seed=1)
    np.testing.assert_array_equal(of_twin.samples, run(twin).samples)
    change = np.std(cracked.samples[0] - of_twin.samples[0])
    assert 1e-3 * np.std(of_twin.samples[0]) < change < np.std(other.samples[0] - of_twin.samples[0])
    assert not np.array_equal(run(twin, noise=1).samples[0], of_twin.samples[0])


@pytest.mark.slow
def test_a_small_spall_in_a_bearing_knocks_as_in_the_other_model(twin, of_twin):
    """The impact's force is that of the rolling element's load, and bearing and sensor are the same in both."""
    other = gap_simulator("cracked").twin_of(RIG)
    baselines = of_twin.samples[0], run(other).samples[0]
    for race in ("outer", "inner"):
        spall = AddedEffect(f"bearing_{race}_race", 0.08, {"bearing": "P1"})
        impacts = (run(t, (spall,)).samples[0] for t in (twin, other))
        change = [np.std(impact - baseline) for impact, baseline in zip(impacts, baselines, strict=True)]
        assert change[0] == pytest.approx(change[1], rel=0.1)


def test_effects_of_the_model_have_candidates(twin):
    known = gap_simulator("reduced-fe").gap_effects()
    assert set(known) == set(effects())
    for name in ("root_crack", "tooth_wear", "eccentricity", "transfer_path"):
        candidates = twin.candidates(name)
        assert len(candidates) >= 2
        assert twin.draw(name, np.random.default_rng(1)).name == name


@pytest.mark.slow
def test_the_preset_of_a_diagnosis_runs_again(twin, tmp_path):
    path = tmp_path / "twin.toml"
    path.write_text(twin.preset_toml(POINT, (CRACK,), (), seed=0), encoding="utf-8")
    again = simulate("reduced-fe", preset=str(path), duration_s=0.2, seed=0)
    assert again.truth["effects"][0]["name"] == "root_crack"
    assert again.truth["parameters"]["mesh_dof"] == 45000.0


def test_twins_travel_between_processes(twin):
    assert pickle.loads(pickle.dumps(twin)).key == twin.key  # noqa: S301 - our own bytes


def test_a_rig_without_a_module_is_refused():
    rig = Rig("x", (Shaft("a"), Shaft("b")), (GearPair("p", "a", "b", 21, 50),))
    with pytest.raises(RefusalError, match="module_mm"):
        gap_simulator("reduced-fe").twin_of(rig)


def test_the_step_is_short_enough_for_what_is_compared(twin):
    """Lines of acceleration up to 10 kHz, within 60 dB of the greatest, against a step of a fourth."""
    ready = ReducedPair().prepare(SimulationSetup(twin.preset(POINT)), np.random.default_rng(0))
    own, found = constants(ready.pair, ready.operation), []
    for part in (1, 4):
        signals = ("driver y acceleration", "bearing 1 y acceleration", TRANSMISSION_ERROR)
        run = respond(
            ready.pair, ready.operation, duration_s=0.4, signals=signals, step_s=TWIN_STEP_S / part, ready=own
        )
        x = np.array([run[name][len(run[name]) // 2 :: part] for name in signals])
        found.append(np.abs(np.fft.rfft(x * np.hanning(x.shape[1])))[:, : round(1e4 * x.shape[1] * TWIN_STEP_S)])
    for line, (coarse, fine) in enumerate(zip(*found, strict=True)):
        great = fine > 1e-3 * fine.max()
        off = np.abs(20.0 * np.log10(coarse[great] / fine[great]))
        assert np.median(off) < (0.3, 0.3, 0.02)[line]
        assert np.quantile(off, 0.95) < (1.5, 1.5, 0.4)[line]
