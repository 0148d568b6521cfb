"""What effects make of flanks, shafts, bearings and the measurement chain."""

from cmath import rect
from dataclasses import replace
from math import pi, radians

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from gearsig.errors import InputError
from gearsig.rig import Bearing
from sims.effects import EffectSetting, cumulative_pitch, effect, vector_sum, with_bearing, with_effects
from sims.machine import Lubrication, Machine, Roughness, Wheel
from sims.measure import Accelerometer, MainsHum, MeasuredChannel, ModalPath, Motion, PathMode
from sims.mesh import deepest_crack_mm, highest_chip_mm
from tests.sims.machines import spur_pair_machine


def apply(machine: Machine, name: str, severity: float, seed: int = 0, **options: float | str) -> Machine:
    return effect(name).apply(machine, severity, options, np.random.default_rng(seed))


def test_a_crack_goes_where_it_is_told() -> None:
    mesh = apply(
        spur_pair_machine(), "root_crack", 1.5, gear="driven", tooth=7, angle_deg=60.0, width_percent=50.0
    ).mesh
    (crack,) = mesh.cracks_2
    assert mesh.cracks_1 == ()
    assert (crack.depth_mm, crack.angle_deg, crack.tooth, crack.width_mm) == (1.5, 60.0, 6, 10.0)


def test_a_crack_past_the_tooth_is_refused_with_what_is_allowed() -> None:
    deepest = deepest_crack_mm(spur_pair_machine().mesh.pair.driver)
    with pytest.raises(InputError, match=rf"goes past the tooth \(allowed: above 0 to {deepest:.3g} mm"):
        apply(spur_pair_machine(), "root_crack", 1.01 * deepest)
    assert apply(spur_pair_machine(), "root_crack", 0.99 * deepest).mesh.cracks_1


TOOTH_FAULTS = [("root_crack", "crack"), ("tooth_spall", "spall"), ("chipped_tooth", "chip")]


@pytest.mark.parametrize(("name", "word"), TOOTH_FAULTS)
def test_one_of_a_kind_per_tooth(name: str, word: str) -> None:
    machine = apply(spur_pair_machine(), name, 1.0, tooth=3)
    with pytest.raises(InputError, match=f"tooth 3 of the driver gear already has a {word}"):
        apply(machine, name, 2.0, tooth=3)
    assert [f.tooth for f in getattr(apply(machine, name, 2.0, tooth=4).mesh, f"{word}s_1")] == [2, 3]
    assert [f.tooth for f in getattr(apply(machine, name, 2.0, gear="driven", tooth=3).mesh, f"{word}s_2")] == [2]


@pytest.mark.parametrize(("name", "word"), TOOTH_FAULTS)
def test_a_tooth_that_is_not_there(name: str, word: str) -> None:
    with pytest.raises(InputError, match=r"tooth of the driver gear is 56 \(allowed: 1 to 55\)"):
        apply(spur_pair_machine(), name, 0.5, tooth=56)
    assert getattr(apply(spur_pair_machine(), name, 0.5, gear="driven", tooth=75).mesh, f"{word}s_2")


def test_three_kinds_of_damage_on_one_tooth() -> None:
    machine = spur_pair_machine()
    for name, _ in TOOTH_FAULTS:
        machine = apply(machine, name, 1.0, tooth=5)
    assert machine.mesh.cracks_1[0].tooth == machine.mesh.spalls_1[0].tooth == machine.mesh.chips_1[0].tooth == 4


def test_a_spall_longer_than_the_flank_is_refused_with_what_is_allowed() -> None:
    with pytest.raises(InputError, match=r"longer than the flank \(allowed: 0 to [34]\.\d+ mm along the profile"):
        apply(spur_pair_machine(), "tooth_spall", 50.0, length_mm=6.0)
    (spall,) = apply(spur_pair_machine(), "tooth_spall", 80.0, length_mm=2.0, depth_um=50.0).mesh.spalls_1
    assert (spall.length_mm, spall.width_mm, spall.depth_um) == (2.0, 16.0, 50.0)


def test_a_chip_higher_than_the_flank_is_refused_with_what_is_allowed() -> None:
    highest = highest_chip_mm(spur_pair_machine().mesh.pair.driver)
    with pytest.raises(InputError, match=rf"higher than the flank \(allowed: 0 to {highest:.3g} mm"):
        apply(spur_pair_machine(), "chipped_tooth", 1.01 * highest)


def test_a_strip_too_narrow_to_carry_is_refused() -> None:
    with pytest.raises(InputError, match=r"19 mm on a loaded face of 20 mm \(allowed: 0 to 18 mm, or 20 mm"):
        apply(spur_pair_machine(), "chipped_tooth", 1.0, width_percent=95.0)
    with pytest.raises(InputError, match=r"allowed: 0 to 90 %"):
        apply(spur_pair_machine(), "tooth_spall", 95.0)


def test_wear_adds_on_one_gear() -> None:
    once = apply(spur_pair_machine(), "tooth_wear", 12.0, gear="driven")
    mesh = apply(once, "tooth_wear", 8.0, gear="driven").mesh
    assert (mesh.flank_1.wear_um, mesh.flank_2.wear_um) == (0.0, 20.0)


@given(st.integers(5, 200), st.integers(0, 2**31))
def test_pitch_closes_over_the_revolution(teeth: int, seed: int) -> None:
    cumulative = cumulative_pitch(teeth, np.random.default_rng(seed))
    single = np.diff(cumulative, prepend=cumulative[-1])  # the first tooth's pitch is measured from the last tooth
    assert abs(single.sum()) < 1e-9
    assert abs(cumulative.mean()) < 1e-12
    assert np.abs(single).max() < 6.0  # no jump where the revolution closes: drawn from a normal distribution


def test_single_pitch_deviations_have_the_severity_as_standard_deviation() -> None:
    singles = []
    for seed in range(300):
        pitch = np.array(apply(spur_pair_machine(), "pitch_error", 8.0, seed).mesh.flank_1.pitch_um)
        singles.append(np.diff(pitch, prepend=pitch[-1]))
    values = np.array(singles)  # (300, 55)
    assert values.std() == pytest.approx(8.0, rel=0.03)
    assert values[:, 0].std() == pytest.approx(8.0, rel=0.15)  # nothing special about the first tooth


def test_one_tooth_alone_may_be_out() -> None:
    pitch = np.array(apply(spur_pair_machine(), "pitch_error", 8.0, gear="driven", tooth=7).mesh.flank_2.pitch_um)
    assert np.flatnonzero(pitch).tolist() == [6]
    assert pitch[6] == 8.0
    ahead = apply(spur_pair_machine(), "pitch_error", 8.0, gear="driven", tooth=7, stands="ahead").mesh.flank_2.pitch_um
    assert ahead[6] == -8.0


def test_pitch_errors_add_and_grow_in_proportion() -> None:
    once = np.array(apply(spur_pair_machine(), "pitch_error", 5.0).mesh.flank_1.pitch_um)
    machine = apply(spur_pair_machine(), "pitch_error", 5.0)
    more = np.array(apply(machine, "pitch_error", 10.0).mesh.flank_1.pitch_um)
    np.testing.assert_allclose(more, 3.0 * once, rtol=1e-12)
    assert apply(spur_pair_machine(), "pitch_error", 5.0, gear="driven").mesh.flank_1.pitch_um == ()


def test_roughness_adds_in_squares() -> None:
    machine = replace(spur_pair_machine(), roughness=Roughness(0.3, "time"))
    rougher = apply(machine, "surface_roughness", 0.4).roughness
    assert rougher.rms_um == pytest.approx(0.5)
    assert rougher.locked_to == "time"


def test_roughness_there_is_keeps_what_it_returns_with() -> None:
    assert apply(spur_pair_machine(), "surface_roughness", 0.4, locked_to="time").roughness.locked_to == "time"
    machine = replace(spur_pair_machine(), roughness=Roughness(0.3, "time"))
    with pytest.raises(InputError, match=r"already have 0.3 µm, locked to 'time', and 'flank'"):
        apply(machine, "surface_roughness", 0.4, locked_to="flank")


def test_friction_comes_on_top_of_the_films() -> None:
    machine = replace(spur_pair_machine(), lubrication=Lubrication(factor=2.0, dry_coefficient=0.05))
    oil = apply(machine, "sliding_friction", 0.1).lubrication
    assert (oil.factor, oil.dry_coefficient) == (2.0, pytest.approx(0.15))


def test_no_flanks_rub_more_than_clean_steel() -> None:
    machine = replace(spur_pair_machine(), lubrication=Lubrication(dry_coefficient=0.3))
    with pytest.raises(InputError, match=r"beside the 0.3 there are, is 0.4 \(allowed: 0 to 0.3\)"):
        apply(machine, "sliding_friction", 0.4)


def test_friction_starts_at_nothing_where_there_was_none() -> None:
    """Continuous: hardly any severity switches hardly any friction on."""
    machine = replace(spur_pair_machine(), lubrication=Lubrication(friction=False, factor=1.0))
    oil = apply(machine, "sliding_friction", 0.001).lubrication
    assert oil.friction
    assert (oil.factor, oil.dry_coefficient) == (0.0, 0.001)


# Effects on shafts and drive: vectors add, angles and ripples go where they belong.

lengths = st.floats(0.0, 200.0)
angles = st.floats(-360.0, 360.0)


def runout(wheel: Wheel) -> complex:
    return rect(wheel.runout_um, radians(wheel.runout_angle_deg))


def unbalance(wheel: Wheel) -> complex:
    return rect(wheel.unbalance_g_mm, radians(wheel.unbalance_angle_deg))


@given(lengths, angles, lengths, angles)
@example(2.0, 0.0, 5e-324, 31.0)  # an angle below what numbers hold
def test_vectors_add(a: float, alpha: float, b: float, beta: float) -> None:
    length, angle = vector_sum(a, alpha, b, beta)
    expected = rect(a, radians(alpha)) + rect(b, radians(beta))
    assert rect(length, radians(angle)) == pytest.approx(expected, abs=1e-9)


def test_two_run_outs_on_opposite_sides_cancel() -> None:
    once = apply(spur_pair_machine(), "eccentricity", 20.0, angle_deg=30.0)
    twice = apply(once, "eccentricity", 20.0, angle_deg=210.0)
    assert once.wheels[0].runout_um == pytest.approx(20.0)
    assert abs(runout(twice.wheels[0])) < 1e-12
    assert abs(unbalance(twice.wheels[0])) < 1e-12


def test_an_eccentric_gear_is_out_of_balance_by_its_mass_times_the_run_out() -> None:
    machine = apply(spur_pair_machine(), "eccentricity", 20.0, gear="driven", angle_deg=45.0)
    wheel = machine.wheels[1]
    assert wheel.mass_offset_m == pytest.approx(20e-6)  # the centre of mass lies where the pitch circle's centre does
    assert wheel.unbalance_angle_deg == pytest.approx(wheel.runout_angle_deg) == pytest.approx(45.0)
    assert machine.wheels[0] == spur_pair_machine().wheels[0]


def test_balancing_an_eccentric_gear_leaves_the_run_out() -> None:
    eccentric = apply(spur_pair_machine(), "eccentricity", 20.0, angle_deg=0.0)
    grams = eccentric.wheels[0].unbalance_g_mm
    balanced = apply(eccentric, "unbalance", grams, angle_deg=180.0).wheels[0]
    assert balanced.unbalance_g_mm == pytest.approx(0.0, abs=1e-9)
    assert balanced.runout_um == pytest.approx(20.0)


@pytest.mark.parametrize("name", ["eccentricity", "unbalance"])
def test_an_angle_that_is_not_given_is_drawn_from_the_whole_circle(name: str) -> None:
    drawn = [apply(spur_pair_machine(), name, 10.0, seed).wheels[0].unbalance_angle_deg for seed in range(200)]
    quarters = np.histogram(drawn, [0, 90, 180, 270, 360])[0]
    assert quarters.sum() == 200
    assert quarters.min() > 25  # 50 expected, standard deviation 6
    assert apply(spur_pair_machine(), name, 10.0, 1, angle_deg=12.0).wheels[0].unbalance_angle_deg == pytest.approx(12)


def test_misalignment_adds_up_to_what_a_coupling_allows() -> None:
    machine = apply(spur_pair_machine(), "misalignment", 3.0, shaft="driven")
    assert [s.coupling_angle_deg for s in machine.shafts] == [0.0, 3.0]
    with pytest.raises(InputError, match=r"beside the 3° there are.*allowed: 0 to 2 deg"):
        apply(machine, "misalignment", 2.5, shaft="driven")


def test_a_ripple_has_its_order_and_part_of_the_torque() -> None:
    (ripple,) = apply(spur_pair_machine(), "torque_ripple", 5.0, order=2.0).drive.ripples
    assert (ripple.order, ripple.fraction) == (2.0, 0.05)
    with pytest.raises(InputError, match="order of torque_ripple"):
        apply(spur_pair_machine(), "torque_ripple", 5.0, order=0.0)


def test_a_swing_has_its_frequency_and_part_of_the_speed() -> None:
    (swing,) = apply(spur_pair_machine(), "speed_fluctuation", 3.0, frequency_hz=0.5).drive.swings
    assert (swing.frequency_hz, swing.fraction) == (0.5, 0.03)


def test_phases_are_drawn() -> None:
    phases = [apply(spur_pair_machine(), "torque_ripple", 5.0, seed).drive.ripples[0].phase_rad for seed in range(50)]
    assert 0.0 <= min(phases) < 1.0
    assert 5.28 < max(phases) <= 2 * np.pi


def test_backlash_is_the_whole_play() -> None:
    machine = replace(spur_pair_machine(), half_backlash_um=15.0)
    assert apply(machine, "backlash", 100.0).half_backlash_um == 65.0


def test_unbalance_joins_eccentricity_whatever_their_order() -> None:
    settings = [
        EffectSetting("eccentricity", 20.0, {"angle_deg": 10.0}),
        EffectSetting("unbalance", 40.0, {"angle_deg": 100.0}),
    ]
    mass = spur_pair_machine().wheels[0].mass_kg
    expected = rect(20.0 * mass, radians(10.0)) + rect(40.0, radians(100.0))
    for order in (settings, settings[::-1]):
        machine = with_effects(spur_pair_machine(), order, np.random.default_rng(0))
        assert unbalance(machine.wheels[0]) == pytest.approx(expected)


# Effects on bearings: which bearing, how long a defect may be, one defect per bearing.


@pytest.mark.parametrize("race", ["outer", "inner"])
def test_a_defect_lies_on_its_race_of_the_chosen_bearing(race: str) -> None:
    name = f"bearing_{race}_race"
    machine = apply(spur_pair_machine(), name, 1.5, bearing="bearing 3", angle_deg=20.0, slip_percent=2.0)
    defects = [b.defect for b in machine.bearings]
    assert [d is not None for d in defects] == [False, False, True, False]
    defect = defects[2]
    assert defect is not None
    assert (defect.race, defect.length_mm, defect.angle_deg, defect.slip) == (race, 1.5, 20.0, 0.02)
    assert apply(spur_pair_machine(), name, 1.5).bearings[0].defect is not None  # the first where none is named


def test_one_defect_per_bearing() -> None:
    machine = apply(spur_pair_machine(), "bearing_outer_race", 1.0, bearing="bearing 2")
    with pytest.raises(InputError, match="'bearing 2' already has a defect on its outer race"):
        apply(machine, "bearing_inner_race", 1.0, bearing="bearing 2")
    assert apply(machine, "bearing_inner_race", 1.0, bearing="bearing 1").bearings[0].defect is not None


def test_a_bearing_that_is_not_there() -> None:
    with pytest.raises(InputError, match=r"no bearing 'baring 1'.*did you mean bearing 1"):
        apply(spur_pair_machine(), "bearing_clearance", 10.0, bearing="baring 1")


def test_spacing_of_the_elements_on_either_race() -> None:
    support = spur_pair_machine().bearings[0]
    assert support.element_spacing_mm("outer") == pytest.approx(pi * 46.98 / 9)
    assert support.element_spacing_mm("inner") == pytest.approx(pi * 31.10 / 9)


def test_a_defect_is_no_longer_than_the_spacing() -> None:
    small = Bearing("bearing 1", "input", 16, 2.5, 18.0)
    machine = with_bearing(spur_pair_machine(), 0, bearing=small)
    with pytest.raises(InputError, match=r"inner race of 'bearing 1' is 3.5 mm \(allowed: 0 to 3.04342 mm\)"):
        apply(machine, "bearing_inner_race", 3.5)
    assert apply(machine, "bearing_outer_race", 3.5).bearings[0].defect is not None


@pytest.mark.parametrize("name", ["bearing_outer_race", "bearing_inner_race", "bearing_clearance"])
def test_a_bearing_without_geometry_is_refused(name: str) -> None:
    machine = with_bearing(spur_pair_machine(), 0, bearing=Bearing("bearing 1", "input"))
    with pytest.raises(InputError, match="give the bearing's geometry"):
        apply(machine, name, 1.0)


def test_clearance_adds() -> None:
    machine = spur_pair_machine()
    loose = replace(machine, bearings=tuple(replace(b, clearance_um=5.0) for b in machine.bearings))
    changed = apply(loose, "bearing_clearance", 30.0, bearing="bearing 4")
    assert [b.clearance_um for b in changed.bearings] == [5.0, 5.0, 5.0, 35.0]


# Effects on the measurement chain: a mode of the promised height, hum, clipping of the promised share.


def with_channel(**fields: object) -> Machine:
    machine = spur_pair_machine()
    channel = replace(machine.chain.channels[0], **fields)  # type: ignore[arg-type]
    return replace(machine, chain=replace(machine.chain, channels=(channel,)))


def only_channel(machine: Machine) -> MeasuredChannel:
    (channel,) = machine.chain.channels
    return channel


@given(st.floats(0.5, 50.0), st.floats(0.005, 0.2))
def test_a_mode_adds_the_severity_at_its_frequency(severity: float, damping: float) -> None:
    before = only_channel(spur_pair_machine()).path
    after = only_channel(
        apply(spur_pair_machine(), "transfer_path", severity, frequency_hz=2500.0, damping_ratio=damping)
    ).path
    for position, gain in before.direct.items():
        added = after.response(np.array([2500.0]), position) - before.response(np.array([2500.0]), position)
        assert abs(added[0]) == pytest.approx(severity * gain)
        far_above = after.response(np.array([250e3]), position)
        assert abs(far_above[0]) == pytest.approx(gain, rel=1e-2)


def test_a_path_of_modes_alone_is_scaled_by_its_gain_far_below() -> None:
    machine = with_channel(path=ModalPath(modes=(PathMode(800.0, 0.05, {"bearing 1 y": 0.5}),)))
    added = only_channel(apply(machine, "transfer_path", 10.0, damping_ratio=0.05)).path.modes[1]
    assert added.gains == pytest.approx({"bearing 1 y": 0.5})


def test_hum_adds_to_the_hum_there_is() -> None:
    machine = with_channel(hum=MainsHum((0.5,), 50.0, 1.0))
    hum = only_channel(apply(machine, "mains_hum", 2.0, harmonics_percent=10.0)).hum
    assert hum.amplitudes_mps2 == pytest.approx((2.5, 0.2, 0.2))
    assert (hum.frequency_hz, hum.phase_rad) == (50.0, 1.0)


def test_two_mains_frequencies_are_refused() -> None:
    with pytest.raises(InputError, match=r"already has hum of 50 Hz.*give frequency_hz=50"):
        apply(with_channel(hum=MainsHum((0.5,), 50.0)), "mains_hum", 2.0, frequency_hz=60.0)
    sixty = only_channel(apply(spur_pair_machine(), "mains_hum", 2.0, frequency_hz=60.0)).hum
    assert sixty.frequency_hz == 60.0


@given(st.floats(0.1, 50.0), st.integers(0, 100))
def test_the_promised_share_of_the_time_is_clipped(percent: float, seed: int) -> None:
    x = np.random.default_rng(seed).standard_normal(20_000)
    sensor = only_channel(apply(spur_pair_machine(), "clipping", percent)).accelerometer
    out = sensor.read(x, np.arange(len(x)) * 1e-4, np.random.default_rng(0))
    held = np.abs(out) >= np.abs(out).max() * (1 - 1e-12)
    assert 100 * held.mean() == pytest.approx(percent, abs=0.02)
    np.testing.assert_array_equal(out[~held], x[~held])


def test_the_share_is_that_of_the_recording_not_of_its_lead_in() -> None:
    time_s = np.arange(-10_000, 10_000) * 1e-4
    x = np.where(time_s < 0, 100.0, 1.0) * np.sin(2 * np.pi * 7.3 * time_s)
    out = Accelerometer(clip_percent=10.0).read(x, time_s, np.random.default_rng(0))
    assert np.abs(out).max() == pytest.approx(np.sin(0.9 * np.pi / 2), rel=1e-3)  # |sin| is below that for 90 %


def test_a_range_of_its_own_stays_a_limit() -> None:
    machine = with_channel(accelerometer=Accelerometer(range_mps2=0.2))
    x = np.linspace(-1.0, 1.0, 1001)
    sensor = only_channel(apply(machine, "clipping", 10.0)).accelerometer
    assert np.abs(sensor.read(x, np.arange(1001.0), np.random.default_rng(0))).max() == 0.2
    wide = replace(sensor, range_mps2=5.0)
    assert np.abs(wide.read(x, np.arange(1001.0), np.random.default_rng(0))).max() == pytest.approx(0.9, abs=2e-3)


def test_clipping_clipped_signals_keeps_the_lower_limit() -> None:
    machine = apply(apply(spur_pair_machine(), "clipping", 10.0), "clipping", 4.0)
    assert only_channel(machine).accelerometer.clip_percent == 10.0


def test_a_share_beyond_the_range_is_refused() -> None:
    with pytest.raises(InputError, match="clip_percent"):
        Accelerometer(clip_percent=51.0)


def test_the_chain_records_with_all_of_them() -> None:
    """Hum stands in the recording at its amplitude, and clipping cuts the machine's part, not the hum's."""
    machine = spur_pair_machine(sampling_rate_hz=10240.0)
    for name, severity in (("mains_hum", 2.0), ("clipping", 20.0)):
        machine = apply(machine, name, severity)
    step_s = 1 / 102400.0
    t = np.arange(round(1.2 / step_s)) * step_s
    vibration = np.sin(2 * np.pi * 320.0 * t)
    motion = Motion(
        step_s,
        ("bearing 1 x", "bearing 1 y"),
        np.column_stack((np.zeros_like(t), vibration / np.cos(np.radians(20.0)))),
        {"input": 2 * np.pi * 10.0 * t},
    )
    recording = machine.chain.record(motion, rng=np.random.default_rng(0), duration_s=1.0)
    lines = 2 * np.abs(np.fft.rfft(recording.samples[0])) / recording.n_samples
    assert lines[[50, 100, 150]] == pytest.approx([2.0, 0.5, 0.5], rel=1e-3)
    # A sine cut at sin(α): first harmonic (2/π)(α + sin α cos α), third below it but clearly there.
    alpha = 0.8 * np.pi / 2
    assert lines[320] == pytest.approx(2 / np.pi * (alpha + np.sin(alpha) * np.cos(alpha)), rel=1e-3)
    assert lines[960] > 0.01
