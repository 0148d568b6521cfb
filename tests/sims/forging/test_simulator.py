"""The forging manipulator as a simulator: presets, recordings, effects, worn flanks, convergence."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.signal import get_window

from gearsig.diagnosis import analyze
from gearsig.errors import InputError, RefusalError
from gearsig.motion import estimate_backlash, measure_motion
from gearsig.recording import Recording, read_recording
from gearsig.rig import read_rig
from sims import simulate
from sims.effects import EffectSetting
from sims.forging import (
    PARAMETERS,
    Cycle,
    FirstState,
    ForgingDrive,
    ForgingManipulator,
    PreparedDrive,
    check_convergence,
    drive_numbers,
    reach,
    respond,
    schedule,
)
from sims.machine import Profile
from sims.presets import preset, presets
from sims.registry import simulators
from sims.simulator import ParameterValue, SimulationSetup
from tests.app.test_cli import run
from tests.sims.forging.drives import AT_REST, drive, driven_by, free_bodies, largest

UNITS = {
    "s": "_s", "N m": "_nm", "mm": "_mm", "deg": "_deg", "N/m^λ": "_n_per_m_lambda", "m/s": "_mps", "um": "_um",
    "kg m^2": "_kg_m2", "kg": "_kg", "N m s/rad": "_nm_s_per_rad", "rad/s": "_rad_per_s", "rad": "_rad",
    "urad": "_urad", "mrad/s": "_mrad_per_s", "rad/s^2": "_rad_per_s2", "m/s^2": "_mps2", "Hz": "_hz",
}  # fmt: skip


def short(**parameters: ParameterValue) -> object:
    return simulate("forging", parameters=parameters, duration_s=2.5, sampling_rate_hz=1000.0)


def test_every_name_ends_in_its_unit_and_defaults_fit() -> None:
    for p in PARAMETERS:
        assert p.name.endswith(UNITS[p.unit] if p.unit else p.name), p.name
        assert p.meaning
        if not p.choices and p.default is not None:
            assert p.low is not None
            assert p.high is not None
            assert p.low <= float(p.default) <= p.high
    assert len({p.name for p in PARAMETERS}) == len(PARAMETERS)
    assert "forging" in simulators()


def test_the_two_stiffnesses_of_the_source_are_presets() -> None:
    """(13) with the stated geometry gives 1.8366e10 N/m^1.5; table 1 prints 1.72e9. Both say so."""
    assert set(presets("forging")) == {"manipulator_formula", "manipulator_table"}
    prepared = {name: ForgingManipulator().prepare(SimulationSetup(name)) for name in presets("forging")}
    formula, table = prepared["manipulator_formula"].drive, prepared["manipulator_table"].drive
    assert formula.contact.stiffness_n_per_m_lambda == pytest.approx(1.8366e10, rel=5e-5)
    assert table.contact.stiffness_n_per_m_lambda == 1.72e9
    assert table.contact.contact_ratio == 1.749
    assert formula.path.contact_ratio == pytest.approx(1.705, abs=5e-4)
    for name in presets("forging"):
        said = " ".join((*preset("forging", name).assumed, *preset("forging", name).does_not_represent,
                         *preset("forging", name).sources))  # fmt: skip
        assert "1.72e9" in said
        assert "1.8366e10" in said
    # the table's damping, 1.12e9, is that of an impact at 0.112 m/s
    ratio = table.contact.damping_ratio_at(0.112)
    assert ratio * 1.72e9 == pytest.approx(1.12e9, rel=5e-3)


@pytest.mark.parametrize("name", ["manipulator_formula", "manipulator_table"])
def test_the_presets_hold_what_the_source_states(name: str) -> None:
    prepared = ForgingManipulator().prepare(SimulationSetup(name))
    v, cycle = prepared.values, prepared.cycle
    assert (v["teeth_driver"], v["teeth_driven"], v["module_mm"], v["pressure_angle_deg"]) == (20, 100, 5.0, 20.0)
    assert (v["exponent"], v["friction_coefficient"], v["restitution"], v["piece_mass_kg"]) == (1.5, 0.05, 0.95, 290.0)
    assert (cycle.mode, cycle.on_s, cycle.off_s) == ("start-stop", 1.0, 2.0)
    assert prepared.operation.torque_nm.largest == 95.0
    assert prepared.operation.speed_rpm.largest / 5.0 == 20.0
    assert prepared.drive.path.base_radii_m == pytest.approx(np.cos(np.radians(20.0)) * np.array([0.05, 0.25]))
    assert ForgingManipulator().usual_sampling_rate_hz == 1000.0


def test_a_recording_holds_motion_rig_and_truth() -> None:
    recording = short()
    assert recording.n_samples == 2500
    assert recording.vibration_names() == ("torque", "interaction force")
    assert recording.rig is not None
    assert recording.rig.contact is not None
    assert recording.rig.contact.half_backlash_um == 150.0
    assert recording.truth["backlash_um"] == 300.0
    assert len(recording.truth["contacts"]["rows"]) > 5
    # speeds are the slopes of the angles, the torque what the teeth take
    slope = np.gradient(recording.values("wheel angle"), 1e-3)
    assert recording.values("wheel speed")[300:900] == pytest.approx(slope[300:900], abs=0.02)
    carried = recording.values("interaction force")[400:900].mean() * 0.05 * np.cos(np.radians(20.0))
    assert recording.values("torque")[400:900].mean() == pytest.approx(carried, rel=0.02)


def test_vibration_is_recorded_where_the_rate_allows() -> None:
    fast = simulate("forging", duration_s=2.5, sampling_rate_hz=10_000.0)
    assert fast.channel_names[-1] == "vibration"
    a = fast.values("vibration")
    start = int(fast.truth["contacts"]["rows"][0][0] * 10_000.0)
    assert np.max(np.abs(a[start : start + 100])) > 20.0 * np.std(a[: start - 10])
    # the same motion at either rate
    slow = simulate("forging", duration_s=2.5, sampling_rate_hz=1000.0, parameters={"encoder_counts": 0})
    same = simulate("forging", duration_s=2.5, sampling_rate_hz=10_000.0, parameters={"encoder_counts": 0})
    assert slow.values("interaction force") == pytest.approx(same.values("interaction force")[::10], abs=1e-6)


def test_the_same_seed_gives_the_same_recording_and_noise_does_not_touch_the_motion() -> None:
    first, again, other = short(), short(), simulate("forging", duration_s=2.5, sampling_rate_hz=1000.0, seed=3)
    assert np.array_equal(first.samples, again.samples)
    assert not np.array_equal(first.values("torque"), other.values("torque"))
    assert np.array_equal(first.values("interaction force"), other.values("interaction force"))


def test_wear_is_in_the_truth_and_not_in_the_rig() -> None:
    worn = short(wear_um=80.0)
    assert worn.truth["backlash_um"] == 380.0
    assert worn.rig.contact.half_backlash_um == 150.0


def test_the_command(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    file = tmp_path / "forge.h5"
    code, out, _ = run(
        capsys, "simulate", "forging", "--mode", "continuous", "--preset", "manipulator_table", "--duration", "1s",
        "--set", "half_backlash_um=0.2mm", "-o", file,
    )  # fmt: skip
    assert code == 0
    assert "1 s at 1000 Hz" in out
    recording = read_recording(file, rig=read_rig(tmp_path / "forge.toml"))
    assert recording.truth["parameters"]["mode"] == "continuous"
    assert recording.rig.contact.stiffness_n_per_m_lambda == 1.72e9
    assert recording.rig.contact.damping_law == "lankarani"
    assert recording.values("torque")[500:].mean() > 50.0
    code, out, _ = run(capsys, "simulate", "forging", "--list")
    assert code == 0
    assert "manipulator_table" in out


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        (("--duration", "1.5s"), "longer than the record"),
        (("--set", "restitution=1.2"), "restitution"),
        (("--set", "wheel_inertia_kg_m2=-3"), "wheel_inertia_kg_m2"),
        (("--set", "contact_ratio=2.5"), "contact_ratio"),
        (("--set", "exponent=1.2"), "stiffness_n_per_m_lambda"),
        (("--mode", "now and then"), "start-stop, continuous"),
        (("--effect", "unbalance=100"), "no meaning"),
        (("--set", "module_mm=2", "--effect", "root_crack=9mm"), "past the tooth"),
        (("--speed", "10..50rpm"), "speed_rpm"),
        (("--fs", "10Hz"), "sampling_rate_hz"),
    ],
)
def test_nonsense_is_one_line(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, arguments: tuple[str, ...], named: str
) -> None:
    code, out, err = run(capsys, "simulate", "forging", *arguments, "-o", tmp_path / "a.h5")
    assert (code, out) == (2, "")
    assert named in err
    assert len(err.strip().splitlines()) == 1
    assert list(tmp_path.iterdir()) == []


def test_other_models_have_no_mode(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    code, _, err = run(capsys, "simulate", "cracked", "--mode", "continuous", "-o", tmp_path / "a.h5")
    assert code == 2
    assert "mode" in err


def amplitude_near(recording: Recording, name: str, hertz: float, from_s: float = 3.0) -> float:
    """Amplitude of a line within 0.3 Hz, by a flat-topped window."""
    x = recording.values(name)[round(from_s * recording.sampling_rate_hz) :]
    w = get_window("flattop", len(x))
    spectrum = 2.0 * np.abs(np.fft.rfft((x - x.mean()) * w)) / np.sum(w)
    f = np.fft.rfftfreq(len(x), 1.0 / recording.sampling_rate_hz)
    return float(spectrum[np.abs(f - hertz) < 0.3].max())


def test_filtered_channels_hold_no_folded_lines_and_lose_none_below() -> None:
    """The mesh's 26th harmonic, at 665 Hz, folds to 335 Hz in instants; a logger's filter keeps it out."""
    common = {"mode": "continuous", "speed_noise_mrad_per_s": 0, "torque_noise_nm": 0, "encoder_counts": 0}
    instants, filtered = (
        simulate("forging", parameters=common | {"slow_channels": how}, duration_s=12.0, sampling_rate_hz=1000.0)
        for how in ("instants", "filtered")
    )
    mesh_hz = 20.0 * instants.values("pinion speed")[3000:].mean() / (2.0 * np.pi)
    for name in ("torque", "interaction force"):
        folded = [amplitude_near(r, name, 1000.0 - 26.0 * mesh_hz) for r in (instants, filtered)]
        below = [amplitude_near(r, name, 4.0 * mesh_hz) for r in (instants, filtered)]
        assert folded[0] > 300.0 * folded[1]
        assert below[1] == pytest.approx(below[0], rel=1e-3)
    # counters store instants whatever the others do; nothing is late
    assert np.array_equal(instants.values("pinion angle"), filtered.values("pinion angle"))
    assert filtered.values("wheel speed")[1500:] == pytest.approx(instants.values("wheel speed")[1500:], abs=0.01)


def test_recordings_of_instants_say_that_lines_fold() -> None:
    def of(mode: str, how: str, rate_hz: float = 1000.0) -> Recording:
        values = {"mode": mode, "slow_channels": how}
        return simulate("forging", parameters=values, duration_s=3.0, sampling_rate_hz=rate_hz)

    instants = of("continuous", "instants")
    assert "above 500 Hz is aliased" in instants.warnings[0]
    assert "instantaneous" in instants.provenance.history[0]
    assert any("is aliased" in finding.title for finding in analyze(instants).findings)
    for other in (of("continuous", "filtered"), of("start-stop", "instants"), of("continuous", "instants", 10_000.0)):
        assert other.warnings == ()
    assert "filtered below 500 Hz" in of("start-stop", "filtered").provenance.history[0]


# Effects of the catalogue on the forging drive: what they change, and that nothing else changes.

CRACK = EffectSetting("root_crack", 4.0, {"tooth": 7})


def made(*settings: EffectSetting) -> PreparedDrive:
    return ForgingManipulator().prepare(SimulationSetup("", {"mode": "continuous"}, settings))


def recorded(**effects: float) -> Recording:
    return simulate("forging", effects=effects, duration_s=6.0, sampling_rate_hz=1000.0)


def test_effects_change_their_parameter_and_not_the_rig_file() -> None:
    faulty = recorded(backlash=80.0, sliding_friction=0.05, torque_ripple=10.0)
    assert faulty.truth is not None
    assert faulty.rig is not None
    assert faulty.rig.contact is not None
    assert faulty.truth["backlash_um"] == pytest.approx(380.0)
    assert faulty.rig.contact.half_backlash_um == 150.0
    assert faulty.rig.contact.friction_coefficient == 0.05
    assert [e["name"] for e in faulty.truth["effects"]] == ["backlash", "sliding_friction", "torque_ripple"]
    assert faulty.truth["parameters"]["half_backlash_um"] == 150.0
    assert estimate_backlash(measure_motion(faulty)).backlash_um == pytest.approx(380.0, rel=0.02)


def test_wear_is_of_the_gear_that_is_named() -> None:
    values = made(EffectSetting("tooth_wear", 100.0, {"gear": "driven"})).changed
    assert (values["sliding_wear_driver_um"], values["sliding_wear_driven_um"]) == (0.0, 100.0)


def test_ripple_shows_at_its_order() -> None:
    torque = respond(made(EffectSetting("torque_ripple", 10.0, {"order": 9.0})).drive, driven_by(95.0), duration_s=2.0)[
        "motor torque"
    ]
    assert np.ptp(torque[1500:]) / np.mean(torque[1500:]) > 0.1


def test_a_cracked_tooth_yields_more_while_it_carries_and_only_then() -> None:
    """Compression under the steady load, pitch by pitch: tooth 7 of the pinion, once a revolution."""
    weak = made(CRACK).drive.weak_tooth
    assert weak is not None
    assert (weak.gear, weak.tooth) == (0, 6)
    assert 0.02 < weak.loss < 0.5
    healthy, cracked = (respond(m.drive, driven_by(95.0), duration_s=3.0) for m in (made(), made(CRACK)))
    mean = {}
    for name, motion in (("healthy", healthy), ("cracked", cracked)):
        x = motion["pinion angle"] * 20.0 / (2.0 * np.pi)
        steady = (motion.time_s > 1.2) & (x % 1.0 > 0.75) & (x % 1.0 < 0.95)  # tooth ⌊x⌋ alone
        tooth = np.floor(x[steady]).astype(int) % 20
        depth = motion["compression"][steady] - 150e-6
        stiffness = motion["interaction force"][steady] / np.maximum(depth, 1e-9) ** 1.5
        mean[name] = np.array([np.median(stiffness[tooth == j]) for j in range(20)])
    ratio = mean["cracked"] / mean["healthy"]
    assert ratio[6] == pytest.approx(1.0 - weak.loss, abs=2e-3)
    assert np.delete(ratio, 6) == pytest.approx(np.ones(19), abs=2e-3)


def test_energy_stays_balanced_with_a_weak_tooth() -> None:
    run = respond(made(CRACK).drive, driven_by(95.0), duration_s=2.0, tolerance=1e-8)
    balance = run["energy"] - run["work put in"] + run["lost in contact"] + run["lost in friction"]
    assert largest(balance) < 1e-5


def test_loss_grows_with_the_crack() -> None:
    losses = [made(EffectSetting("root_crack", d)).drive.weak_tooth.loss for d in (1.0, 2.0, 4.0)]  # type: ignore[union-attr]  # cracked
    assert 0.0 < losses[0] < losses[1] < losses[2]
    assert made(EffectSetting("root_crack", 0.0)).drive.weak_tooth is None


@pytest.mark.parametrize(
    ("setting", "named"),
    [
        (EffectSetting("unbalance", 10.0), "no meaning"),
        (EffectSetting("backlash", -5.0), "added_um"),
        (EffectSetting("root_crack", 2.0, {"tooth": 25}), "tooth of the driver"),
        (EffectSetting("backlash", 5.0, {"gear": "driver"}), "no option"),
    ],
)
def test_effects_that_do_not_fit(setting: EffectSetting, named: str) -> None:
    with pytest.raises(InputError, match=named):
        made(setting)
    with pytest.raises(InputError, match="2 times"):
        made(EffectSetting("backlash", 5.0), EffectSetting("backlash", 5.0))


# Flanks that sliding has worn: where they touch, what they store, that no energy appears.

DEPTH_UM = 80.0


def worn(**values: float) -> ForgingDrive:
    return drive(sliding_wear_driver_um=DEPTH_UM, **values)


def test_most_is_gone_at_the_ends_and_nothing_at_the_pitch_point() -> None:
    depths, path = np.array(worn().wear_um), worn().path
    positions = np.linspace(0.0, path.contact_ratio, len(depths))
    assert depths[0] == pytest.approx(DEPTH_UM)
    assert depths[-1] > 0.1 * DEPTH_UM
    assert positions[np.argmin(depths)] == pytest.approx(path.pitch_point, abs=0.03)
    assert depths.min() < 0.03 * DEPTH_UM
    assert np.all(np.diff(depths[positions < path.pitch_point]) < 0.0)
    both = np.array(drive(sliding_wear_driver_um=30.0, sliding_wear_driven_um=20.0).wear_um)
    other = np.array(drive(sliding_wear_driven_um=20.0).wear_um)
    assert both == pytest.approx(30.0 / DEPTH_UM * depths + other)


@pytest.mark.parametrize("cycles", [0.1, 0.35, 0.6, 0.8, 0.95])
def test_the_least_worn_pair_touches_first(cycles: float) -> None:
    """The gears meet at a place of the mesh cycle: at a + min h(p_i) of the pairs there."""
    made = free_bodies(sliding_wear_driver_um=DEPTH_UM)
    made = replace(made, path=replace(made.path, phase=0.0))
    angle = 2.0 * np.pi * (3.0 + cycles) / made.path.teeth[0]
    first = FirstState(angle, 0.0, 0.0, 0.05)
    found = respond(made, AT_REST, duration_s=6e-3, interval_s=1e-6, first=first)
    touched = found.contact("start_s")[0]
    touching = np.array([cycles + i for i in range(2) if cycles + i < made.path.contact_ratio])
    grid = np.linspace(0.0, made.path.contact_ratio, len(made.wear_um))
    expected = made.contact.half_backlash_um + np.interp(touching, grid, made.wear_um).min()
    assert 1e6 * np.interp(touched, found.time_s, found["compression"]) == pytest.approx(expected, abs=0.05)
    before = found.time_s < touched
    assert largest(found["interaction force"][before]) == 0.0
    assert found["interaction force"][~before][1:30].min() > 0.0


def test_back_flanks_are_as_they_were() -> None:
    k = drive_numbers(worn())
    assert [reach(k, angle, -1.0)[0] for angle in (0.1, 0.7, 2.0)] == [k.half_backlash] * 3


def test_energy_is_conserved_over_worn_flanks_without_losses() -> None:
    """Gears that turn and rattle, pairs coming and going; nothing is damped and nothing rubs."""
    made = free_bodies({"restitution": 1.0}, sliding_wear_driver_um=DEPTH_UM, sliding_wear_driven_um=30.0)
    first = FirstState(0.0, 5.0, 0.0, 0.02)
    found = respond(made, AT_REST, duration_s=0.4, interval_s=1e-4, first=first, tolerance=1e-9)
    assert len(found.contacts) > 2
    assert largest(found["energy"] - found["energy"][0]) < 1e-7 * found["energy"][0]


def test_energy_stays_balanced_at_work() -> None:
    made = worn()
    profiles = schedule(Cycle(brake_nm=60.0, press_nm=1500.0), Profile.constant(95.0), 3.0)
    found = respond(made, profiles, duration_s=3.0)
    balance = found["energy"] - found["work put in"] + found["lost in contact"] + found["lost in friction"]
    assert largest(balance) < 2e-4
    assert np.all(np.diff(found["lost in contact"]) >= -1e-9)


# `simulate forging --check`: the tolerance in use is tight enough, and one that is not is told.


@pytest.mark.parametrize("mode", ["start-stop", "continuous"])
@pytest.mark.parametrize("stiffness", ["formula", "table"])
def test_the_tolerance_in_use_is_enough(mode: str, stiffness: str) -> None:
    made = drive(contact_stiffness=stiffness)
    found = check_convergence(made, Cycle(mode, brake_nm=60.0), Profile.constant(95.0))
    assert found.converged
    assert abs(found.time_s - found.exact_time_s) < 2e-6
    assert found.energy_error < 1e-3
    assert found.n_exact_steps > 2 * found.n_steps


def test_a_coarse_tolerance_is_told() -> None:
    found = check_convergence(drive(), Cycle(brake_nm=60.0), Profile.constant(95.0), tolerance=1e-3)
    assert not found.converged
    assert "NOT converged" in found.text


def test_without_torque_there_is_nothing_to_compare() -> None:
    with pytest.raises(RefusalError, match="never meet"):
        check_convergence(drive(), Cycle(), Profile.constant(0.0))


def test_the_command_tells_how_far_it_converged(capsys: pytest.CaptureFixture[str]) -> None:
    code, out, _ = run(capsys, "simulate", "forging", "--check")
    assert code == 0
    assert "back-impact after the torque has gone" in out
    assert "converged" in out
    assert "NOT" not in out
