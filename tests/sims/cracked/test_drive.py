"""The drive of the cracked pair: speed, torque, run-ups; teeth that part and rattle."""

from dataclasses import replace

import numpy as np
import pytest

from sims.cracked import respond
from sims.machine import Drive, Lubrication, Operation, Profile, SpeedSwing
from tests.sims.cracked.machines import frictionless
from tests.sims.cracked.runs import run
from tests.sims.machines import spur_pair_machine

# --- drive ------------------------------------------------------------------------------------------------------------


def test_speed_holds_in_spite_of_friction() -> None:
    response = run(spur_pair_machine(), ("driver angle",), 0.6, 0.6)
    turned = np.diff(response["driver angle"][[0, -1]])[0] / (response.interval_s * (len(response["driver angle"]) - 1))
    assert turned * 30 / np.pi == pytest.approx(500.0, rel=1e-4)


@pytest.mark.parametrize(("first", "last"), [(300.0, 900.0), (900.0, 300.0)])
def test_run_up_and_coast_down_follow_the_course(first: float, last: float) -> None:
    machine = spur_pair_machine()
    operation = Operation(Profile.of([0.0, 1.0], [first, last]), Profile.constant(50.0))
    response = respond(
        machine,
        operation,
        duration_s=1.4,
        start_s=-0.4,
        rng=np.random.default_rng(1),
        signals=("input rotor angle velocity", "mesh_force_n"),
        stride=4,
    )
    t = response.time_s
    smooth = np.convolve(response["input rotor angle velocity"], np.ones(400) / 400, "same")
    inside = (t > 0.2) & (t < 0.95)
    wanted = operation.speed_rpm.at(t[inside]) * np.pi / 30
    np.testing.assert_allclose(smooth[inside], wanted, rtol=5e-3)
    # Half of the drive's own inertia's torque goes through the mesh: more force in a run-up, less in a coast-down.
    far = machine.wheels[1].inertia_kg_m2 + machine.shafts[1].rotor_inertia_kg_m2
    acceleration = (last - first) * np.pi / 30
    r1 = machine.mesh.pair.driver.base_radius_mm * 1e-3
    expected = (50.0 + far / machine.ratio**2 * acceleration) / r1
    assert response["mesh_force_n"][inside].mean() == pytest.approx(expected, rel=5e-3)


def test_torque_course_sets_the_mesh_force() -> None:
    operation = Operation(Profile.constant(600.0), Profile.of([0.0, 0.5], [20.0, 120.0]))
    response = respond(
        frictionless(spur_pair_machine()),
        operation,
        duration_s=0.8,
        start_s=-0.2,
        rng=np.random.default_rng(1),
        signals=("mesh_force_n",),
    )
    t, r1 = response.time_s, 51.683e-3
    for centre in (0.1, 0.3, 0.5):
        near = np.abs(t - centre) < 0.05
        wanted = float(np.mean(operation.torque_nm.at(t[near]))) / r1
        assert response["mesh_force_n"][near].mean() == pytest.approx(wanted, rel=0.02)


def test_speed_swing_is_followed() -> None:
    machine = replace(spur_pair_machine(), drive=Drive(swings=(SpeedSwing(0.03, 4.0),)))
    response = run(machine, ("input rotor angle velocity",), 1.0, 0.5)
    speed = response["input rotor angle velocity"]
    swing = 2 * np.abs(np.mean(speed * np.exp(-2j * np.pi * 4.0 * response.time_s)))
    assert swing / speed.mean() == pytest.approx(0.03, rel=0.02)


# --- contact loss and the flanks behind -------------------------------------------------------------------------------


def test_unloaded_gears_rattle_between_both_flanks() -> None:
    """A swinging speed without load: the driver strikes the flank ahead and the one behind, 2b apart."""
    base = replace(spur_pair_machine(), half_backlash_um=30.0, lubrication=Lubrication(friction=False))
    machine = replace(base, drive=Drive(swings=(SpeedSwing(0.05, 25.0),)))
    response = run(machine, ("mesh_force_n", "compression_m"), torque_nm=0.0)
    force, compression = response["mesh_force_n"], response["compression_m"]
    assert force.max() > 10.0
    assert force.min() < -10.0
    assert np.mean(force == 0.0) > 0.05
    assert np.ptp(compression) == pytest.approx(60e-6, rel=0.15)


def test_loaded_flanks_stay_in_touch() -> None:
    response = run(spur_pair_machine(), ("mesh_force_n",))
    assert response["mesh_force_n"].min() > 0.0
