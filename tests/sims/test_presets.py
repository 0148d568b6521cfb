"""Presets and parameters of the cracked pair, shipped and as files: ranges, the machine they build, its rig file."""

from math import atan2, cos, degrees, pi, radians, sin, sqrt
from pathlib import Path

import numpy as np
import pytest

from gearsig.diagnosis import analyze
from gearsig.errors import InputError
from gearsig.rig import Rig, read_rig, write_rig
from sims import simulate
from sims.cracked import CrackedPair
from sims.effects import EffectSetting
from sims.gear_pair import PARAMETERS, ReadyPair, build_machine, build_rig
from sims.machine import Machine, Operation, Profile
from sims.measure import Tachometer
from sims.presets import preset, preset_text, presets
from sims.registry import simulator, simulators
from sims.simulator import ParameterValue, SimulationSetup, checked_value, complete_values

PRESETS = tuple(presets("cracked"))
SUFFIXES = {
    "mm": "_mm", "um": "_um", "us": "_us", "deg": "_deg", "kg": "_kg", "kg m^2": "_kg_m2", "GPa": "_gpa",
    "kg/m^3": "_kg_m3", "cP": "_cp", "%": "_percent", "g mm": "_g_mm", "N/m": "_n_per_m", "N s/m": "_n_s_per_m",
    "N m/rad": "_nm_per_rad", "N m s/rad": "_nm_s_per_rad", "m/s^2": "_mps2",
    "m/s^2/s": "_mps2_per_s", "arcsec": "_arcsec", "m/s^2/√Hz": "_mps2_per_sqrt_hz",
    "Hz": "_hz",
}  # fmt: skip


def prepared(name: str = "", operation: Operation | None = None, **values: ParameterValue) -> ReadyPair:
    return CrackedPair().prepare(SimulationSetup(name, values, (), operation), np.random.default_rng(0))


def machine(name: str = "", **values: ParameterValue) -> Machine:
    return prepared(name, **values).machine


def test_every_name_ends_in_its_unit() -> None:
    for p in PARAMETERS:
        assert p.name.endswith(SUFFIXES[p.unit] if p.unit else p.name), p.name
        assert p.meaning
    assert len({p.name for p in PARAMETERS}) == len(PARAMETERS)


def test_defaults_lie_in_their_ranges_and_numbers_have_one() -> None:
    for p in PARAMETERS:
        if p.choices:
            assert p.default in p.choices
        else:
            assert p.low is not None
            assert p.high is not None
            assert p.default is None or checked_value(p, p.default) == p.default


@pytest.mark.parametrize("name", PRESETS)
def test_a_preset_is_sourced_and_builds_a_sane_machine(name: str) -> None:
    chosen = preset("cracked", name)
    assert chosen.title
    assert chosen.sources
    assert chosen.assumed
    assert chosen.does_not_represent
    assert set(chosen.parameters) <= {p.name for p in PARAMETERS}
    built = machine(name)
    assert 1.2 < built.mesh.pair.contact_ratio < 2.0
    assert built.mesh.cracks_1 == built.mesh.cracks_2 == ()
    # Hertz pressure at the pitch point stays below what hardened gears carry.
    force = chosen.torque_nm / (built.mesh.pair.driver.base_radius_mm * 1e-3)
    rho_1, rho_2 = (float(r[0]) * 1e-3 for r in built.mesh.pair.contact_radii_mm(np.array([0.8])))
    radius = rho_1 * rho_2 / (rho_1 + rho_2)
    modulus = built.mesh.material_1.youngs_modulus_pa / (2 * (1 - 0.3**2))
    assert 0.1e9 < sqrt(force * modulus / (pi * radius * 0.02)) < 1.6e9


@pytest.mark.parametrize(
    ("name", "ratio", "centres_mm"),
    [("published_55_75", 1.7940, 130.0), ("symmetric_50_50", 1.755, 150.0), ("small_30_25", 1.6326, 55.0)],
)
def test_contact_ratio_and_centre_distance(name: str, ratio: float, centres_mm: float) -> None:
    """ε = (√(ra1² − rb1²) + √(ra2² − rb2²) − a sin α)/p_b; the 50/50 pair is published with 1.755 and 150 mm."""
    pair = machine(name).mesh.pair
    m, z1, z2, alpha = pair.driver.module_mm, pair.driver.teeth, pair.driven.teeth, radians(20.0)

    def reach(z: int) -> float:
        return sqrt((m * (z / 2 + 1)) ** 2 - (m * z / 2 * cos(alpha)) ** 2)

    expected = (reach(z1) + reach(z2) - m * (z1 + z2) / 2 * sin(alpha)) / (pi * m * cos(alpha))
    assert pair.contact_ratio == pytest.approx(expected, rel=1e-9)
    assert pair.contact_ratio == pytest.approx(ratio, abs=6e-4)
    assert pair.centre_distance == pytest.approx(centres_mm, rel=1e-12)


def test_the_published_pair() -> None:
    """458.33 Hz at 500 rpm is stated; masses and inertias of discs with a bore of 17.5 mm are textbook formulas."""
    ready = prepared("published_55_75")
    rig = rig_of(ready)
    assert rig.nominal_speed_rpm() == 500.0
    assert rig.operating_point.torque_nm == 110.0
    assert rig.mesh_order(rig.pairs[0]) * 500 / 60 == pytest.approx(458.33, abs=0.01)  # type: ignore[operator]  # known
    for wheel, r in zip(ready.machine.wheels, (0.055, 0.075), strict=True):
        mass = 7850 * pi * (r**2 - 0.0175**2) * 0.02
        assert wheel.mass_kg == pytest.approx(mass, rel=1e-12)
        assert wheel.inertia_kg_m2 == pytest.approx(mass * (r**2 + 0.0175**2) / 2, rel=1e-12)
    assert ready.machine.roughness.locked_to == "time"
    assert 2e-6 * ready.machine.half_backlash_um == pytest.approx(2 * 2e-5)


def test_the_hub_of_the_symmetric_pair_puts_its_torsion_at_2650_to_2700_hz() -> None:
    """ω² = k (rb1²/J1 + rb2²/J2) with the mean stiffness of 3.32e8 N/m of loaded gears of this size."""
    built = machine("symmetric_50_50")
    rb = built.mesh.pair.driver.base_radius_mm * 1e-3
    compliance = sum(rb**2 / w.inertia_kg_m2 for w in built.wheels)
    assert 2600 < sqrt(3.32e8 * compliance) / (2 * pi) < 2700


@pytest.mark.parametrize("angle_deg", [-40.0, 0.0, 25.0, 90.0])
def test_sensors_look_up_and_sideways(angle_deg: float) -> None:
    """Upwards is x sin β + y cos β, as gravity has it; a horizontal sensor does not see it."""
    built = machine(line_of_action_deg=angle_deg, channels="all", path_modes="off")
    up = {"x": sin(radians(angle_deg)), "y": cos(radians(angle_deg))}
    for channel in built.chain.channels:
        seen = sum(gain * up[place[-1]] for place, gain in channel.path.direct.items())
        assert seen == pytest.approx(1.0 if "vertical" in channel.position else 0.0, abs=1e-12)
        assert sum(g**2 for g in channel.path.direct.values()) == pytest.approx(1.0)


def test_gears_lie_side_by_side_unless_told_otherwise() -> None:
    """The driven gear's centre lies at (a cos α_w, a sin α_w) from the driver's: x = rb1 + rb2, y = ρ1 + ρ2."""
    built = machine("published_55_75", profile_shift_driver=0.3)
    pair, beta = built.mesh.pair, radians(built.line_of_action_deg)
    x, y = pair.driver.base_radius_mm + pair.driven.base_radius_mm, pair.action_length_mm
    height, along = x * sin(beta) + y * cos(beta), x * cos(beta) - y * sin(beta)
    assert degrees(atan2(height, along)) == pytest.approx(0.0, abs=1e-9)


def test_half_a_pitch_after_the_tachometers_edge_tooth_0_is_half_through_its_contact() -> None:
    built = machine("published_55_75")
    assert isinstance(built.chain.tachometer, Tachometer)
    pair = built.mesh.pair
    cycles = pair.driver.teeth * built.chain.tachometer.first_pulse_rev + 0.5
    middle = (pair.start_radius_mm + pair.end_radius_mm) / 2
    assert float(pair.contact_radii_mm(cycles, pair=0)[0]) == pytest.approx(middle, rel=1e-12)


@pytest.mark.parametrize("tooth", [18, pytest.param(55, marks=pytest.mark.slow)])
def test_the_diagnosis_names_the_cracked_tooth(tooth: int) -> None:
    """Tooth 1 is the one that engages after the mark, for the simulator and for the diagnosis."""
    cracked = [EffectSetting("root_crack", 3.0, {"tooth": float(tooth)})]
    recording = simulate("cracked", preset="published_55_75", effects=cracked, seed=1, duration_s=4.0)
    first = analyze(recording).findings[0]
    assert (first.code, first.where.gear, first.where.tooth) == ("tooth-local-damage", "stage 1/input", tooth)


def rig_of(ready: ReadyPair) -> Rig:
    return build_rig(ready.machine, ready.operation, name="x", sources=["simulated"])


@pytest.mark.parametrize("name", PRESETS)
def test_the_rig_file_reads_back_and_tells_no_damage(name: str, tmp_path: Path) -> None:
    healthy, hurt = rig_of(prepared(name)), rig_of(prepared(name, crack_depth_mm=1.0))
    write_rig(healthy, tmp_path / "rig.toml")
    assert read_rig(tmp_path / "rig.toml") == healthy == hurt
    assert healthy.speed is not None
    assert {s.channel for s in healthy.sensors} == {"a1", "a2", "tacho"}
    assert {b.shaft for b in healthy.bearings[:2]} == {"input"}


def test_a_varying_speed_is_left_out_of_the_rig() -> None:
    run_up = Operation(Profile.of([0, 1], [300, 1500]), Profile.constant(20.0))
    point = rig_of(prepared("workshop_29_47", run_up)).operating_point
    assert point.speed_rpm is None
    assert point.torque_nm == 20.0


def test_parameters_reach_the_machine() -> None:
    built = machine(
        "workshop_29_47", crack_depth_mm=1.5, crack_gear="driven", crack_tooth=5, crack_width_percent=50, friction="off"
    )
    (crack,) = built.mesh.cracks_2
    assert (crack.depth_mm, crack.tooth, crack.width_mm) == (1.5, 4, 10.0)
    assert built.mesh.cracks_1 == ()
    assert not built.lubrication.friction
    without = machine(tachometer_pulses=0, encoder_counts=1024).chain
    assert without.tachometer is None
    assert [(e.shaft, e.counts_per_revolution) for e in without.encoders] == [("input", 1024), ("output", 1024)]


def test_tolerances_are_those_of_one_specimen() -> None:
    first, again, other = (machine("workshop_29_47", tolerance_seed=seed).mesh.flank_1.pitch_um for seed in (1, 1, 2))
    assert first == again
    assert np.abs(np.subtract(first, other)).max() > 0.1
    assert np.sqrt(np.mean(np.square(first))) == pytest.approx(0.5, rel=1e-12)
    assert np.mean(first) == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize(
    ("values", "named"),
    [
        ({"crack_depth": 2.0}, "did you mean crack_depth_mm"),
        ({"crak_mm": 2.0}, "crack_depth_mm"),
        ({"module_mm": 0.0}, "0.3 to 30 mm"),
        ({"teeth_driver": 29.5}, "a whole number"),
        ({"teeth_driver": float("nan")}, "a finite number"),
        ({"friction": "sometimes"}, "on, off"),
        ({"contact_law": "load-dependant"}, "did you mean load-dependent"),
        ({"crack_depth_mm": 9.0}, "goes past the tooth"),
        ({"crack_depth_mm": 1.0, "crack_tooth": 60.0}, "1 to 55"),
        ({"teeth_driver": 8.0}, "undercuts"),
        ({"n_balls": 40.0}, "do not fit"),
        ({"bore_radius_driver_mm": 60.0}, "bore_radius_mm"),
    ],
)
def test_nonsense_is_refused(values: dict[str, ParameterValue], named: str) -> None:
    with pytest.raises(InputError) as caught:
        machine("published_55_75", **values)
    assert named in str(caught.value)


@pytest.mark.parametrize(
    ("speed", "torque", "named"),
    [(-1.0, 10.0, "speed_rpm"), (1e6, 10.0, "0 to 30000 rpm"), (500.0, 1e5, "0 to 4400 N m")],
)
def test_an_impossible_operation_is_refused(speed: float, torque: float, named: str) -> None:
    with pytest.raises(InputError) as caught:
        prepared("published_55_75", Operation.steady(speed, torque))
    assert named in str(caught.value)


def test_names_that_do_not_exist() -> None:
    with pytest.raises(InputError, match="did you mean cracked"):
        simulator("craked")
    with pytest.raises(InputError, match="did you mean published_55_75"):
        preset("cracked", "publishd_55_75")
    assert preset("cracked", "").name == PRESETS[0] == simulators()["cracked"].presets[0]


def test_effects_change_the_machine_and_stand_in_the_truth() -> None:
    rng, other = np.random.default_rng(3), np.random.default_rng(3)
    settings = [EffectSetting("root_crack", 1.0, {"tooth": 4.0})]
    ready = CrackedPair().prepare(SimulationSetup("published_55_75", effects=settings), rng)
    healthy = CrackedPair().prepare(SimulationSetup("published_55_75"), other)
    assert ready.machine.mesh.cracks_1[0].tooth == 3  # the model counts from 0
    assert healthy.machine.mesh.cracks_1 == ()
    assert rng.random() == other.random()  # healthy and faulty runs go on with the same random numbers
    (entry,) = ready.truth()["effects"]
    assert (entry["name"], entry["severity"], entry["unit"]) == ("root_crack", 1.0, "mm")
    assert entry["options"]["tooth"] == 4.0


@pytest.mark.parametrize("name", PRESETS)
def test_a_healthy_machine_does_not_overdrive_its_sensors(name: str) -> None:
    recording = simulate("cracked", preset=name, duration_s=0.2)
    range_mps2 = machine(name).chain.channels[0].accelerometer.range_mps2
    assert range_mps2 is not None
    peaks = [np.abs(recording.values(channel)).max() for channel in recording.vibration_names()]
    assert len(peaks) == 2
    assert all(0.002 * range_mps2 < peak < 0.9 * range_mps2 for peak in peaks)


def test_defaults_alone_make_a_machine() -> None:
    assert build_machine(complete_values(PARAMETERS)).mesh.pair.driver.teeth == 29


def test_a_drifting_sensor_drifts() -> None:
    """Offset and drift pass the anti-alias filter and the converter unchanged."""
    values = {"sensor_bias_mps2": 3.0, "sensor_drift_mps2_per_s": 2.0}
    drifting, steady = (
        simulate("cracked", preset="workshop_29_47", parameters=v, duration_s=0.5, seed=1) for v in (values, {})
    )
    difference = drifting.samples[0] - steady.samples[0]
    np.testing.assert_allclose(difference, 3.0 + 2.0 * drifting.time_s(), atol=2e-3)


def test_none_clears_what_a_preset_gives() -> None:
    assert machine("published_55_75").mesh.pair.driver.bore_mm == 17.5
    free = machine("published_55_75", bore_radius_driver_mm="none").mesh.pair.driver
    assert free.bore_mm == pytest.approx(0.35 * free.root_radius_mm)
    with pytest.raises(InputError, match="teeth_driver is 'none'"):
        machine("published_55_75", teeth_driver="none")


def test_effects_as_a_word_are_refused_with_what_is_allowed() -> None:
    with pytest.raises(InputError, match="name and severity"):
        simulate("cracked", effects="root_crack")  # type: ignore[arg-type]


# Presets that people give as files: read strictly, with errors that say what is wrong and where.

GOOD = """
[about]
model = "cracked"
title = "t"
sources = []
assumed = ["a"]
does_not_represent = []
[parameters]
teeth_driver = 25
[operation]
speed_rpm = 1000
torque_nm = 30
[[effects]]
name = "root_crack"
severity = 1.0
options = {gear = "driven", tooth = 3}
"""
INSTALLED = """
[installed]
shafts = ["in", "out"]
pickup = {channel = "z", side = 1}
sensors = [{channel = "x", bearing = 2}]
modes = [{frequency_hz = 900, damping_ratio = 0.02, gain = 0.05, shape = [1, 0.5, 0, 0]}]
bearings = [
  {name = "1", shaft = "in", n_rolling_elements = 8, rolling_element_diameter_mm = 6.0, pitch_diameter_mm = 30.0},
  {name = "2", shaft = "in", n_rolling_elements = 8, rolling_element_diameter_mm = 6.0, pitch_diameter_mm = 30.0},
  {name = "3", shaft = "out", n_rolling_elements = 8, rolling_element_diameter_mm = 6.0, pitch_diameter_mm = 30.0},
  {name = "4", shaft = "out", n_rolling_elements = 8, rolling_element_diameter_mm = 6.0, pitch_diameter_mm = 30.0},
]
"""


def written(folder: Path, text: str) -> str:
    path = folder / "mine.toml"
    path.write_text(text, encoding="utf-8")
    return str(path)


def prepare(name: str) -> object:
    return CrackedPair().prepare(SimulationSetup(name), np.random.default_rng(0))


def test_a_file_may_carry_effects_and_what_is_fitted(tmp_path: Path) -> None:
    name = written(tmp_path, GOOD + INSTALLED)
    chosen = preset("cracked", name)
    assert (chosen.name, chosen.speed_rpm, chosen.effects[0].options["tooth"]) == ("mine", 1000.0, 3)
    machine = CrackedPair().prepare(SimulationSetup(name), np.random.default_rng(0)).machine
    assert machine.mesh.cracks_2[0].tooth == 2
    assert machine.shaft_names == ("in", "out")
    assert [b.bearing.name for b in machine.bearings] == ["1", "2", "3", "4"]
    (channel,) = machine.chain.channels
    assert (channel.name, len(channel.path.modes)) == ("x", 1)
    assert set(channel.path.direct) == {"bearing 2 x", "bearing 2 y"}
    assert machine.chain.tachometer.shaft == "out"  # type: ignore[union-attr]  # it has one


def test_it_is_written_as_it_was_read(tmp_path: Path) -> None:
    chosen = preset("cracked", written(tmp_path, GOOD + INSTALLED))
    again = preset("cracked", written(tmp_path, preset_text(chosen, ["first\nsecond"])))
    assert again == chosen


@pytest.mark.parametrize(
    ("old", "new", "named"),
    [
        ("[operation]", "[operations]", "did you mean operation"),
        ("title =", "titel =", "did you mean title"),
        ('title = "t"', "title = 3", "text in quotes"),
        ('assumed = ["a"]', 'assumed = "a"', "a list of texts"),
        ("speed_rpm = 1000", "speed_rpm = true", "a number"),
        ("speed_rpm = 1000", "speed_rpm = -5", "speed_rpm"),
        ("teeth_driver = 25", "teeth_driver = [25]", "a number or a text"),
        ("teeth_driver = 25", "teeth_drive = 25", "did you mean teeth_driver"),
        ("severity = 1.0", "severity = 99.0", "0 to 10 mm"),
        ("severity = 1.0", "strength = 1.0", "severity"),
        ('"root_crack"', '"root_crak"', "did you mean root_crack"),
        ("tooth = 3", "teeth = 3", "did you mean tooth"),
        ('"cracked"', '"forging"', "is a preset of the model 'forging'"),
        ("[about]", "[about", "not valid TOML"),
        ('shafts = ["in", "out"]', 'shafts = ["in", "in"]', "two different names"),
        ('shafts = ["in", "out"]', 'shafts = ["in", "on"]', "is on shaft 'out'"),
        ("bearing = 2", "bearing = 7", "1 to 4"),
        ("bearing = 2", 'bearing = 2, file = "/etc/passwd"', "there is no key 'file'"),
        ("shape = [1, 0.5, 0, 0]", "shape = [1]", "4 bearings"),
        ("gain = 0.05", "gain = inf", "finite"),
        ('channel = "z"', 'channel = "x"', "each once"),
        ("modes = [", "mode = [", "has the keys"),
    ],
)
def test_nonsense_is_named(tmp_path: Path, old: str, new: str, named: str) -> None:
    assert old in GOOD + INSTALLED
    name = written(tmp_path, (GOOD + INSTALLED).replace(old, new))
    with pytest.raises(InputError) as caught:
        prepare(name)
    assert named in str(caught.value)


def test_files_that_are_no_presets(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="cannot be read"):
        preset("cracked", str(tmp_path / "none.toml"))
    (tmp_path / "folder.toml").mkdir()
    with pytest.raises(InputError, match="cannot be read"):
        preset("cracked", str(tmp_path / "folder.toml"))
    (tmp_path / "binary.toml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(InputError, match="UTF-8"):
        preset("cracked", str(tmp_path / "binary.toml"))
    (tmp_path / "large.toml").write_bytes(b"#" * 1_000_001)
    with pytest.raises(InputError, match="up to 1 MB"):
        preset("cracked", str(tmp_path / "large.toml"))


def test_a_name_without_its_ending_is_never_a_file(tmp_path: Path) -> None:
    written(tmp_path, GOOD)
    with pytest.raises(InputError, match="has no preset"):
        preset("cracked", str(tmp_path / "mine"))
