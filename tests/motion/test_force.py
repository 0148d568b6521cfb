"""Force between the teeth from motion: piecewise against Hunt–Crossley and Kelvin–Voigt, datum, noise."""

from dataclasses import replace

import numpy as np
import pytest

from gearsig.errors import InputError, RefusalError
from gearsig.motion import (
    AS_PRINTED,
    FROM_TORQUE,
    HUNT_CROSSLEY,
    KELVIN_VOIGT,
    PIECEWISE,
    TEETH,
    TOOTH_FORCE,
    ForceEstimate,
    NoiseStudy,
    PairMotion,
    acceleration_limit_rad_s2,
    depth,
    estimate_forces,
    latched_damping,
    measure_motion,
    noise_study,
    pair_force,
)
from gearsig.recording import Recording
from gearsig.rig import ToothContact, standard_path
from tests.motion.recordings import changed, continuous, start_stop, without
from tests.sims.forging.drives import free_bodies, impact

CONTACT = ToothContact(1.8e10, half_backlash_um=100.0, restitution=0.8, impact_speed_floor_mps=0.01)


def estimate(recording: Recording, datum: str | float = "auto", **options: object) -> ForceEstimate:
    return estimate_forces(measure_motion(recording, **options), datum=datum)  # type: ignore[arg-type]  # as named


def relative(found: ForceEstimate, model: str, reference: str) -> float:
    return found.error(model, reference).relative_rms


def test_depth_has_the_flanks_sign_and_is_nothing_in_the_play() -> None:
    q = np.array([-3e-4, -1e-4, 0.0, 1e-4, 2.5e-4])
    assert depth(q, 1e-4) == pytest.approx([-2e-4, 0.0, 0.0, 0.0, 1.5e-4])


def test_force_is_the_law_on_both_flanks_and_never_tension() -> None:
    g, rate, beta = np.array([2e-5, -2e-5, 2e-5]), np.array([0.1, -0.1, -1e3]), np.full(3, 2.0)
    k, lam = 1.8e10, 1.5
    expected = k * 2e-5**lam * (1.0 + 0.2)
    assert pair_force(g, rate, beta, CONTACT) == pytest.approx([expected, -expected, 0.0])


def test_damping_is_latched_at_the_speed_with_which_flanks_meet() -> None:
    """A driver that turns from rest at constant acceleration meets the other flank at √(2 a d), between two samples."""
    path = standard_path((20, 100), 5e-3, np.radians(20.0))
    t = np.arange(6) * 1e-3
    turn, still = 12.0 / path.base_radii_m[0], np.zeros(6)  # 12 m/s² along the line of action: 100 µm after 4.08 ms
    motion = PairMotion(1000.0, 0.5 * turn * t**2, still, turn * t, still, still, still, path, CONTACT)
    beta = latched_damping(motion, motion.compression_m)
    expected = 8.0 * 0.2 / (5.0 * 0.8 * np.sqrt(2.0 * 12.0 * 1e-4))
    assert beta == pytest.approx([0.0] * 5 + [expected], rel=1e-9)


def test_a_slow_meeting_is_damped_by_the_floor() -> None:
    path = standard_path((20, 100), 5e-3, np.radians(20.0))
    q = np.array([0.0, 9e-5, 9.9e-5, 1.1e-4, 1.2e-4, 9e-5])
    still = np.zeros(6)
    speed = np.full(6, 1e-4 / path.base_radii_m[0])
    motion = PairMotion(1000.0, q / path.base_radii_m[0], still, speed, still, still, still, path, CONTACT)
    floor = 8.0 * 0.2 / (5.0 * 0.8 * 0.01)
    assert latched_damping(motion, q) == pytest.approx([0.0, 0.0, 0.0, floor, floor, 0.0])


def test_the_inverse_formula_recovers_minus_the_force_of_a_free_impact() -> None:
    made = free_bodies({"restitution": 0.8})
    run = impact(made, 0.2)
    r1, r2 = made.path.base_radii_m
    m1, m2 = made.pinion_side_inertia_kg_m2 / r1**2, (made.contact.driven_inertia_kg_m2 or 0.0) / r2**2
    acceleration = r1 * run["pinion acceleration"] - r2 * run["wheel acceleration"]
    force = run["interaction force"]
    recovered = m2 * acceleration + m2 / m1 * force  # the source's formula
    assert recovered == pytest.approx(-force, abs=1e-6 * m2 / m1 * force.max())


@pytest.mark.parametrize("preset", ["manipulator_formula", "manipulator_table"])
@pytest.mark.parametrize("record", [start_stop, continuous])
def test_noiseless_motion_gives_the_simulated_force(preset: str, record: object) -> None:
    """The force that made the motion; what is left are blows between two samples, and bristles of the flanks."""
    found = estimate(record(preset, quiet=True))  # type: ignore[operator]  # a function of the preset
    assert relative(found, TEETH, TOOTH_FORCE) < (0.01 if record is start_stop else 0.0005)
    assert relative(found, PIECEWISE, FROM_TORQUE) < 0.015
    assert relative(found, AS_PRINTED, FROM_TORQUE) > 3.0  # the load's inertia, which the torque does not carry


def test_pairs_that_come_and_go_at_once_miss_the_force_of_a_ramp() -> None:
    recording = continuous(quiet=True)
    rig = recording.rig
    assert rig is not None
    assert rig.contact is not None
    sudden = replace(rig, contact=replace(rig.contact, mesh_ramp=0.0))
    hard = estimate_forces(measure_motion(recording, sudden))
    assert relative(hard, TEETH, TOOTH_FORCE) > 50.0 * relative(estimate(recording), TEETH, TOOTH_FORCE)


@pytest.mark.parametrize("preset", ["manipulator_formula", "manipulator_table"])
def test_piecewise_is_nearer_than_hunt_crossley_on_the_same_motion(preset: str) -> None:
    for recording in (start_stop(preset), continuous(preset)):
        found = estimate(recording)
        for model in (HUNT_CROSSLEY, KELVIN_VOIGT):
            assert relative(found, PIECEWISE, FROM_TORQUE) < 0.3 * relative(found, model, FROM_TORQUE)
            assert relative(found, TEETH, TOOTH_FORCE) < 0.3 * relative(found, model, TOOTH_FORCE)
        assert relative(found, PIECEWISE, FROM_TORQUE) < 0.12
        # the printed mass is the load's, which the pinion's torque does not carry
        assert relative(found, AS_PRINTED, FROM_TORQUE) > 1.0


def test_only_the_piecewise_model_sees_the_back_flank() -> None:
    found = estimate(start_stop())
    struck = found.references_n[TOOTH_FORCE] < -500.0
    assert np.count_nonzero(struck) > 50
    assert np.all(found.forces_n[HUNT_CROSSLEY][struck] == 0.0)
    back = found.forces_n[TEETH][struck] / found.references_n[TOOTH_FORCE][struck]
    assert np.median(back) == pytest.approx(1.0, abs=0.05)


def test_the_datum_is_found_whatever_the_encoders_zero() -> None:
    recording = start_stop()
    moved = changed(recording, "pinion angle", recording.values("pinion angle") + 0.01)
    shift = estimate(moved).datum.compression_m - estimate(recording).datum.compression_m
    # The pairs count from the driver's angle: its zero is known, that of the wheel is not.
    wheel = changed(recording, "wheel angle", recording.values("wheel angle") + 0.003)
    by_wheel = estimate(wheel)
    assert by_wheel.datum.compression_m - estimate(recording).datum.compression_m == pytest.approx(
        -0.003 * 0.25 * np.cos(np.radians(20.0)), abs=1e-9
    )
    assert relative(by_wheel, PIECEWISE, FROM_TORQUE) == pytest.approx(
        relative(estimate(recording), PIECEWISE, FROM_TORQUE), rel=1e-6
    )
    assert shift == pytest.approx(0.01 * 0.05 * np.cos(np.radians(20.0)), abs=1e-6)


def test_without_torque_the_datum_lies_between_the_flanks() -> None:
    found = estimate(without(start_stop(), "torque"))
    assert abs(found.datum.compression_m) < 12e-6
    assert FROM_TORQUE not in found.references_n
    assert relative(found, TEETH, TOOTH_FORCE) < 1.0
    with pytest.raises(RefusalError, match="it is unclear which flank touches"):
        estimate(without(continuous(), "torque"))
    with pytest.raises(InputError, match="datum"):
        estimate(start_stop(), "somewhere")


def test_a_machine_that_stands_all_the_time_is_refused() -> None:
    recording = start_stop()
    still = replace(recording, samples=np.zeros_like(recording.samples))
    with pytest.raises(RefusalError, match="0 samples carry a load"):
        estimate(still)


@pytest.mark.parametrize(
    ("preset", "low_um", "high_um"), [("manipulator_formula", 3.0, 12.0), ("manipulator_table", 15.0, 40.0)]
)
def test_noise_at_which_piecewise_is_no_longer_nearer(preset: str, low_um: float, high_um: float) -> None:
    """Stiffer teeth ask for better encoders: their whole deflection is some 20 µm, against some 100 µm."""
    study = noise_study(
        start_stop(preset), rng=np.random.default_rng(3), levels_um=(0.0, 1.0, 3.0, 10.0, 30.0, 60.0), n_draws=2
    )
    piecewise, other = study.rms_n[PIECEWISE], study.rms_n[HUNT_CROSSLEY]
    assert piecewise[0] < 0.2 * other[0]
    assert piecewise[-1] > other[-1]
    assert study.crossover_um is not None
    assert low_um < study.crossover_um < high_um
    assert np.all(np.diff(piecewise) > 0.0)
    assert f"{study.crossover_um:.3g} µm" in study.text


def test_a_study_needs_something_to_compare_with() -> None:
    rng = np.random.default_rng(0)
    with pytest.raises(RefusalError, match="neither torque nor tooth force"):
        noise_study(without(start_stop(), "torque", "interaction force"), rng=rng, levels_um=(0.0, 1.0))
    with pytest.raises(InputError, match="ascending"):
        noise_study(start_stop(), rng=rng, levels_um=(1.0, 2.0))


def noisy(recording: Recording, quantity: str, deviation: float, seed: int = 1) -> Recording:
    """Add white noise to both gears' channels of a quantity."""
    rng = np.random.default_rng(seed)
    samples = np.array(recording.samples)
    for i, channel in enumerate(recording.channels):
        if channel.quantity == quantity:
            samples[i] += deviation * rng.standard_normal(recording.n_samples)
    return replace(recording, samples=samples)


@pytest.mark.parametrize("preset", ["manipulator_formula", "manipulator_table"])
def test_noise_on_the_acceleration_costs_the_drivers_inertia_times_it(preset: str) -> None:
    """rms² grows by (J1 σ/r_b1)²: up to some 2600 rad/s² the piecewise model stays the nearer one."""
    recording = start_stop(preset)
    still = estimate(recording).error(PIECEWISE, FROM_TORQUE).rms_n
    other = estimate(recording).error(HUNT_CROSSLEY, FROM_TORQUE).rms_n
    r1, inertia = 0.05 * np.cos(np.radians(20.0)), 0.01
    for deviation in (300.0, 1000.0, 3000.0):
        found = estimate(noisy(recording, "angular_acceleration", deviation))
        expected = np.hypot(still, inertia * deviation / r1)
        assert found.error(PIECEWISE, FROM_TORQUE).rms_n == pytest.approx(expected, rel=0.1)
    study = NoiseStudy(
        np.array([0.0]), FROM_TORQUE, {PIECEWISE: np.array([still]), HUNT_CROSSLEY: np.array([other])}, None
    )
    crossover = acceleration_limit_rad_s2(study, measure_motion(recording))
    assert crossover is not None
    assert 2300.0 < crossover < 2900.0
    for share, is_nearer in ((0.8, True), (1.2, False)):
        found = estimate(noisy(recording, "angular_acceleration", share * crossover))
        error = {m: found.error(m, FROM_TORQUE).rms_n for m in (PIECEWISE, HUNT_CROSSLEY)}
        assert (error[PIECEWISE] < error[HUNT_CROSSLEY]) == is_nearer


def test_noise_on_the_speed_spoils_the_damping_of_single_contacts() -> None:
    """Nearer up to 1 rad/s in every draw; at 3 rad/s a contact whose first speed was read wrong decides."""

    def is_nearer(deviation: float, seed: int) -> bool:
        found = estimate(noisy(start_stop(), "rotational_speed", deviation, seed))
        return found.error(PIECEWISE, FROM_TORQUE).rms_n < found.error(HUNT_CROSSLEY, FROM_TORQUE).rms_n

    assert all(is_nearer(deviation, seed) for deviation in (0.3, 1.0) for seed in range(4))
    assert {is_nearer(3.0, seed) for seed in range(4)} == {True, False}


def test_two_pairs_count_one_mass() -> None:
    """As printed, but for (30), which adds the inertia once per pair: it is there once, whatever touches."""
    found = estimate(start_stop(quiet=True), "zero")
    motion = found.motion
    j2, r2 = motion.contact.driven_inertia_kg_m2, motion.path.base_radii_m[1]
    assert j2 is not None
    own = motion.contact.driver_inertia_kg_m2 * motion.driver_acceleration_rad_s2 / motion.path.base_radii_m[0]
    added = found.forces_n[AS_PRINTED] - (found.forces_n[PIECEWISE] - own)
    expected = j2 / r2**2 * motion.compression_acceleration_mps2
    assert np.all((found.n_pairs == 0.0) | ((found.n_pairs >= 1.0) & (found.n_pairs <= 2.0)))
    assert added == pytest.approx(expected, abs=1e-6 * np.max(np.abs(expected)))
