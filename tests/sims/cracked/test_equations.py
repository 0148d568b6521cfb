"""The equations of motion: forces follow from the energy, inner forces cancel, nothing is created."""

from dataclasses import replace

import numpy as np
import pytest

from sims.cracked import SIGNALS, PairConstants, derivative, integrate, place_of_entry, potential_energy, prepare
from sims.gear_pair import bearing_loads_n
from sims.machine import Machine, Operation, Roughness
from sims.mesh import STRAIGHT, Lead
from tests.sims.cracked.machines import (
    FIXED_CENTRES,
    conservative,
    cracked,
    moving_state,
    one_lasting_pair,
    with_record,
)
from tests.sims.machines import spur_pair_machine

STEADY = Operation.steady(500.0, 110.0)
FREE = Operation.steady(500.0, 0.0)
SMOOTH = (np.zeros(1), np.ones(1), np.zeros(1))


def accelerations(machine: Machine, q: np.ndarray, v: np.ndarray, operation: Operation = FREE) -> np.ndarray:
    ready = prepare(machine, operation, np.random.default_rng(0))
    rate = np.empty(32)
    state = np.concatenate((q, v))
    derivative(*ready.constants.arguments, 0.0, state, ready.speed, ready.torque, q[0], SMOOTH, rate)
    return rate[16:]


def mass_matrix(machine: Machine, q: np.ndarray) -> np.ndarray:
    """Of the coordinates, with the unbalanced wheels' coupling of x, y and θ (from the kinetic energy)."""
    m = np.zeros((16, 16))
    m[0, 0], m[3, 3] = (s.rotor_inertia_kg_m2 for s in machine.shafts)
    for side, wheel in enumerate(machine.wheels):
        up, g, rho = (1.0, -1.0)[side], 4 + 2 * side, wheel.mass_offset_m
        phi = q[1 + side] + np.radians(wheel.unbalance_angle_deg)
        m[g, g] = m[g + 1, g + 1] = wheel.mass_kg
        m[1 + side, 1 + side] = wheel.inertia_kg_m2 + wheel.mass_kg * rho**2
        m[g, 1 + side] = m[1 + side, g] = -wheel.mass_kg * rho * np.sin(phi)
        m[g + 1, 1 + side] = m[1 + side, g + 1] = up * wheel.mass_kg * rho * np.cos(phi)
    for row, support in enumerate(machine.bearings):
        m[8 + 2 * row, 8 + 2 * row] = m[9 + 2 * row, 9 + 2 * row] = support.mass_kg
    return m


@pytest.mark.parametrize("contact_law", ["linear", "load-dependent"])
@pytest.mark.parametrize("delta_m", [2e-5, -6e-5])
@pytest.mark.parametrize("lead", [STRAIGHT, Lead(20.0, 5.0, 3.0, 4)])
@pytest.mark.parametrize("pitch_um", [0.0, 6.0])
def test_forces_are_the_slope_of_the_energy(contact_law: str, delta_m: float, lead: Lead, pitch_um: float) -> None:
    """M a = −∂U/∂q at rest, on both flanks, with cracks, run-out, unbalance and uneven pitch, spur and helical."""
    base = with_pitch(cracked(spur_pair_machine(), 2.0), pitch_um * np.random.default_rng(9).standard_normal(55))
    base = replace(base, mesh=replace(base.mesh, contact_law=contact_law, lead=lead))
    machine = conservative(base, runout_um=25.0, runout_angle_deg=30.0, unbalance_g_mm=3000.0, unbalance_angle_deg=70.0)
    machine = replace(machine, line_of_action_deg=35.0)
    ready = prepare(machine, FREE, np.random.default_rng(0))
    arguments = ready.constants.arguments
    rng = np.random.default_rng(5)
    scale = np.where(np.arange(16) < 4, 1e-7, 1e-9)
    for _ in range(12):
        q = moving_state(rng, delta_m=delta_m, base_radii_m=ready.constants.record["base_radius"])
        inertial = mass_matrix(machine, q) @ accelerations(machine, q, np.zeros(16))
        fixed = place_of_entry(arguments[0], q)  # the forces that belong to it are left out of the model
        slope = np.empty(16)
        for i, h in enumerate(scale):
            up, down = q.copy(), q.copy()
            up[i] += h
            down[i] -= h
            slope[i] = (
                potential_energy(*arguments, up, *fixed, 0.0) - potential_energy(*arguments, down, *fixed, 0.0)
            ) / (2 * h)
        # The governor's share at rest: g ω on the input rotor, 1e-12 of it.
        np.testing.assert_allclose(inertial, -slope, atol=2e-4 * np.abs(slope).max(), rtol=2e-4)


def with_pitch(machine: Machine, pitch_um: np.ndarray) -> Machine:
    """All teeth of the driver out of their places."""
    flank = replace(machine.mesh.flank_1, pitch_um=tuple(pitch_um.tolist()))
    return replace(machine, mesh=replace(machine.mesh, flank_1=flank))


def test_teeth_that_all_stand_behind_are_a_gear_that_is_turned_with_its_play() -> None:
    """Both flanks of a tooth are out of place: a gear turned ahead by as much carries the same on either side."""
    machine, behind_m = spur_pair_machine(), 30e-6
    behind = with_pitch(machine, np.full(55, 1e6 * behind_m))
    rb1 = float(prepare(machine, FREE, np.random.default_rng(0)).constants.record["base_radius"][0])
    for delta_m in (2e-5, -6e-5):  # driving flanks, flanks behind
        q = moving_state(np.random.default_rng(5), delta_m=delta_m, base_radii_m=(rb1, rb1 * machine.ratio))
        ahead = q.copy()
        ahead[1] += behind_m / rb1
        ahead[0] += behind_m / rb1  # the rotor goes along
        forces = [mass_matrix(m, x) @ accelerations(m, x, np.zeros(16)) for m, x in ((machine, q), (behind, ahead))]
        size = np.abs(forces[0][4:8]).max()
        assert size > 100.0
        np.testing.assert_allclose(forces[1][4:8], forces[0][4:8], atol=0.01 * size)


def test_inner_forces_cancel() -> None:
    """What the machine as a whole gains in momentum comes from bearings' grounds and weight alone, to 1e-12."""
    machine = cracked(replace(spur_pair_machine(), roughness=Roughness(0.84, "none")), 3.0)
    ready = prepare(machine, STEADY, np.random.default_rng(0))
    rng = np.random.default_rng(6)
    for _ in range(20):
        q = moving_state(rng, base_radii_m=ready.constants.record["base_radius"])
        v = rng.normal(0.0, 1e-2, 16)
        v[:4] += 50.0
        a = accelerations(machine, q, v, STEADY)
        down = -machine.gravity_mps2 * np.array(
            [np.sin(np.radians(machine.line_of_action_deg)), np.cos(np.radians(machine.line_of_action_deg))]
        )
        momentum, outer, size = np.zeros(2), np.zeros(2), 0.0
        for side, wheel in enumerate(machine.wheels):
            momentum += wheel.mass_kg * a[4 + 2 * side : 6 + 2 * side]
            outer += wheel.mass_kg * down
            size += float(np.abs(wheel.mass_kg * a[4 + 2 * side : 6 + 2 * side]).sum())
        for row, b in enumerate(machine.bearings):
            place = slice(8 + 2 * row, 10 + 2 * row)
            momentum += b.mass_kg * a[place]
            outer += b.mass_kg * down - b.stiffness_n_per_m * q[place] - b.damping_n_s_per_m * v[place]
        assert np.abs(momentum - outer).max() < 1e-12 * size


def test_static_force_of_the_bearings_is_what_they_carry() -> None:
    """Bearing loads of the static balance: both shafts' sums are mesh force and weight."""
    machine = spur_pair_machine()
    loads = bearing_loads_n(machine, 2000.0)
    weight = sum(w.mass_kg for w in machine.wheels) + sum(b.mass_kg for b in machine.bearings)
    assert np.hypot(*loads.sum(axis=0)) == pytest.approx(weight * machine.gravity_mps2)
    assert loads[:2, 1].sum() < -1900.0
    assert loads[2:, 1].sum() > 1900.0


def energy_drift(machine: Machine, k: PairConstants, step_s: float, duration_s: float, kick_mps: float = 0.0) -> float:
    """Greatest change of energy less the work done."""
    ready = prepare(machine, STEADY, np.random.default_rng(0))
    q, v = ready.q.copy(), ready.v.copy()
    v[5] += kick_mps
    n = round(duration_s / step_s)
    select = np.array([SIGNALS.index(s) for s in ("input rotor angle", "output rotor angle", "mesh_force_n")])
    found, energies = np.empty((n, 3)), np.empty(n)
    phasors = ready.roughness.phasors(step_s / 2)
    integrate(
        *k.arguments, q, v, q[:1].copy(), 0.0, step_s, n, 1, ready.speed, ready.torque, phasors, select, found, energies
    )
    assert found[:, 2].min() > 0.0  # the flanks stay in touch
    turned = found[:, :2] - found[0, :2]
    work = 110.0 * (turned[:, 0] - turned[:, 1] * machine.ratio)
    return float(np.abs(energies - energies[0] - work).max())


def test_energy_drift_falls_at_fifth_order() -> None:
    """RK4 on an undamped linear oscillation loses energy as h⁵ (its amplification is 1 − (ωh)⁶/144 per step)."""
    machine = replace(conservative(spur_pair_machine()), half_backlash_um=1000.0)
    k = one_lasting_pair(prepare(machine, STEADY, np.random.default_rng(0)).constants)
    drift = [energy_drift(machine, k, h, 0.02, kick_mps=0.02) for h in (16e-6, 8e-6, 4e-6)]
    orders = np.log2(np.array(drift[:-1]) / np.array(drift[1:]))
    assert orders == pytest.approx(5.0, abs=0.35)
    assert drift[-1] < 1e-6


def test_energy_is_kept_with_varying_stiffness() -> None:
    """Tooth pairs that come and go, a crack, run-out and unbalance: nothing is created, and less with the step."""
    machine = conservative(cracked(spur_pair_machine(), 2.0), runout_um=5.0, unbalance_g_mm=500.0)
    k = with_record(prepare(machine, STEADY, np.random.default_rng(0)).constants, **FIXED_CENTRES)
    drift = [energy_drift(machine, k, h, 0.01) for h in (4e-6, 1e-6)]
    assert drift[0] < 1e-4
    assert drift[1] < drift[0] / 20
    # Energy in the teeth alone swings by far more.
    assert drift[0] < 1e-2 * 0.5 * 2128.0 * 1e-5
