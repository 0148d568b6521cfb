"""The linearised machine: mass and stiffness matrices, eigenfrequencies, and the step that follows from them."""

from __future__ import annotations

from math import pi, sqrt

import numpy as np
from numpy.typing import NDArray

from gearsig.checks import FloatArray
from sims.cracked.constants import mean_stiffness_n_per_m, mesh_mass_kg
from sims.cracked.layout import N_COORDINATES
from sims.gear_pair.drive import governor_nm_s_per_rad, total_inertia_kg_m2
from sims.machine import Machine
from sims.machine.operation import Operation

STEP_ANGLE_RAD = 0.28
"""Step times the greatest angular eigenfrequency. RK4 is stable up to 2.8 of it; at 0.28 it misses 3e-4 of the
accelerations and 1e-6 to 1e-5 of the transmission error's rms, 1e-4 where teeth rattle: `sims.cracked.convergence`."""
STABLE = 2.0
"""Step times the fastest rate of the damped machine; RK4 bursts from 2.8 on."""
STEPS_PER_RAMP = 6
"""Least number of steps in which a tooth pair takes up its load."""


def matrices(machine: Machine, force_n: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """M, K and C of small motions about the loaded state, with the mean mesh stiffness, (16, 16) each."""
    wheels, shafts, bearings = machine.wheels, machine.shafts, machine.bearings
    masses = [shafts[0].rotor_inertia_kg_m2, *(w.inertia_kg_m2 for w in wheels), shafts[1].rotor_inertia_kg_m2]
    masses += [w.mass_kg for w in wheels for _ in range(2)] + [b.mass_kg for b in bearings for _ in range(2)]
    mesh = mean_stiffness_n_per_m(machine, force_n)
    stiffness = _assembled(
        machine,
        mesh,
        [s.torsional_stiffness_nm_per_rad for s in shafts],
        [s.bending_stiffness_n_per_m for s in shafts],
        [b.stiffness_n_per_m for b in bearings],
    )
    damping = _assembled(
        machine,
        2.0 * machine.mesh_damping_ratio * sqrt(mesh * mesh_mass_kg(machine)),
        [s.torsional_damping_nm_s_per_rad for s in shafts],
        [s.bending_damping_n_s_per_m for s in shafts],
        [b.damping_n_s_per_m for b in bearings],
    )
    damping[0, 0] += governor_nm_s_per_rad(machine)
    return np.diag(masses), stiffness, damping


def _assembled(
    machine: Machine, mesh: float, torsion: list[float], bending: list[float], bearings: list[float]
) -> FloatArray:
    """Sum of the springs, or of the dampers, each between the coordinates it joins."""
    pair, total = machine.mesh.pair, np.zeros((N_COORDINATES,) * 2)

    def join(places: list[int], signs: list[float], size: float) -> None:
        line = np.zeros(N_COORDINATES)
        line[places] = signs
        total[:] += size * np.outer(line, line)

    join([1, 2, 5, 7], [pair.driver.base_radius_mm * 1e-3, -pair.driven.base_radius_mm * 1e-3, 1.0, -1.0], mesh)
    for side in range(2):
        join([3 * side, 1 + side], [1.0, -1.0], torsion[side])
        for axis in range(2):
            places = [4 + 2 * side + axis, 8 + 4 * side + axis, 10 + 4 * side + axis]
            join(places, [1.0, -0.5, -0.5], bending[side])
    for row, size in enumerate(bearings):
        for axis in range(2):
            join([8 + 2 * row + axis], [1.0], size)
    return total


def eigenfrequencies_hz(machine: Machine, force_n: float = 0.0) -> FloatArray:
    """Undamped eigenfrequencies in rising order, (16,); the first is the rigid rotation, 0."""
    m, k, _ = matrices(machine, force_n)
    return _frequencies_hz(m, k)


def _frequencies_hz(m: FloatArray, k: FloatArray) -> FloatArray:
    from scipy.linalg import eigh

    squares = eigh(k, m, eigvals_only=True)
    result: FloatArray = np.sqrt(np.maximum(squares, 0.0)) / (2.0 * pi)
    return result


def _fastest_rate_per_s(m: FloatArray, k: FloatArray, c: FloatArray) -> float:
    """Largest magnitude of an eigenvalue of the damped machine: heavy dampers are as stiff as springs to a solver."""
    return float(np.max(np.abs(_eigenvalues_per_s(m, k, c))))


def _eigenvalues_per_s(m: FloatArray, k: FloatArray, c: FloatArray) -> NDArray[np.complex128]:
    n, per_mass = N_COORDINATES, 1.0 / np.diag(m)[:, None]
    state = np.zeros((2 * n, 2 * n))
    state[:n, n:] = np.eye(n)
    state[n:, :n], state[n:, n:] = -per_mass * k, -per_mass * c
    return np.linalg.eigvals(state).astype(np.complex128)


def slowest_decay_s(machine: Machine, operation: Operation) -> float:
    """Time in which the least damped motion falls to 1/e: of the vibrations, or of the speed that the drive holds."""
    force = operation.torque_nm.largest / (machine.mesh.pair.driver.base_radius_mm * 1e-3)
    found = _eigenvalues_per_s(*matrices(machine, force))
    ringing = found[np.abs(found.imag) > 1.0]
    recovery = 2.0 * total_inertia_kg_m2(machine) / governor_nm_s_per_rad(machine)
    return max(recovery, 1.0 / max(float(-ringing.real.max()), 1e-3) if len(ringing) else 0.0)


def default_step_s(machine: Machine, operation: Operation, step_angle_rad: float = STEP_ANGLE_RAD) -> float:
    """Step that stiffness, damping and tooth passage allow."""
    force = operation.torque_nm.largest / (machine.mesh.pair.driver.base_radius_mm * 1e-3)
    m, k, c = matrices(machine, force)
    fastest = 2.0 * pi * float(_frequencies_hz(m, k)[-1])
    step = min(step_angle_rad / fastest, STABLE / _fastest_rate_per_s(m, k, c))
    mesh_hz = operation.speed_rpm.largest / 60.0 * machine.mesh.pair.driver.teeth
    if mesh_hz > 0.0 and machine.mesh.ramp > 0.0:
        step = min(step, machine.mesh.ramp / mesh_hz / STEPS_PER_RAMP)
    return step
