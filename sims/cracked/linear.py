"""The linearised machine: mass and stiffness matrices, eigenfrequencies, and the step that follows from them."""

from __future__ import annotations

from math import pi

import numpy as np

from gearsig.checks import FloatArray
from sims.cracked.constants import mean_stiffness_n_per_m
from sims.cracked.layout import N_COORDINATES
from sims.machine import Machine
from sims.machine.operation import Operation

STEP_ANGLE_RAD = 0.28
"""Step times the greatest angular eigenfrequency. RK4 is stable up to 2.8 of it; at 0.28 it misses 3e-4 of the
accelerations and 1e-6 to 1e-5 of the transmission error's rms, 1e-4 where teeth rattle: `sims.cracked.convergence`."""
STABLE = 2.0
"""Step times the fastest rate of the damped machine; RK4 bursts from 2.8 on."""
STEPS_PER_RAMP = 6
"""Least number of steps in which a tooth pair takes up its load."""


def matrices(machine: Machine, force_n: float) -> tuple[FloatArray, FloatArray]:
    """M and K of small motions about the loaded state, with the mean mesh stiffness, (16, 16)."""
    pair = machine.mesh.pair
    m, k = np.zeros((N_COORDINATES,) * 2), np.zeros((N_COORDINATES,) * 2)
    rotors = [s.rotor_inertia_kg_m2 for s in machine.shafts]
    wheels = machine.wheels
    masses = [rotors[0], wheels[0].inertia_kg_m2, wheels[1].inertia_kg_m2, rotors[1]]
    masses += [w.mass_kg for w in wheels for _ in range(2)] + [b.mass_kg for b in machine.bearings for _ in range(2)]
    np.fill_diagonal(m, masses)
    mesh = np.zeros(N_COORDINATES)
    mesh[[1, 2, 5, 7]] = pair.driver.base_radius_mm * 1e-3, -pair.driven.base_radius_mm * 1e-3, 1.0, -1.0
    k += mean_stiffness_n_per_m(machine, force_n) * np.outer(mesh, mesh)
    for side, shaft in enumerate(machine.shafts):
        twist = np.zeros(N_COORDINATES)
        twist[[3 * side, 1 + side]] = 1.0, -1.0
        k += shaft.torsional_stiffness_nm_per_rad * np.outer(twist, twist)
        for axis in range(2):
            bend = np.zeros(N_COORDINATES)
            bend[[4 + 2 * side + axis, 8 + 4 * side + axis, 10 + 4 * side + axis]] = 1.0, -0.5, -0.5
            k += shaft.bending_stiffness_n_per_m * np.outer(bend, bend)
    for row, support in enumerate(machine.bearings):
        for axis in range(2):
            k[8 + 2 * row + axis, 8 + 2 * row + axis] += support.stiffness_n_per_m
    return m, k


def damping_matrix(machine: Machine, force_n: float) -> FloatArray:
    """C of the same small motions, the governor included, (16, 16)."""
    from sims.cracked.constants import governor_nm_s_per_rad, mesh_mass_kg

    pair, c = machine.mesh.pair, np.zeros((N_COORDINATES,) * 2)
    stiffness = mean_stiffness_n_per_m(machine, force_n)
    mesh = np.zeros(N_COORDINATES)
    mesh[[1, 2, 5, 7]] = pair.driver.base_radius_mm * 1e-3, -pair.driven.base_radius_mm * 1e-3, 1.0, -1.0
    c += 2.0 * machine.mesh_damping_ratio * np.sqrt(stiffness * mesh_mass_kg(machine)) * np.outer(mesh, mesh)
    for side, shaft in enumerate(machine.shafts):
        twist = np.zeros(N_COORDINATES)
        twist[[3 * side, 1 + side]] = 1.0, -1.0
        c += shaft.torsional_damping_nm_s_per_rad * np.outer(twist, twist)
        for axis in range(2):
            bend = np.zeros(N_COORDINATES)
            bend[[4 + 2 * side + axis, 8 + 4 * side + axis, 10 + 4 * side + axis]] = 1.0, -0.5, -0.5
            c += shaft.bending_damping_n_s_per_m * np.outer(bend, bend)
    for row, support in enumerate(machine.bearings):
        for axis in range(2):
            c[8 + 2 * row + axis, 8 + 2 * row + axis] += support.damping_n_s_per_m
    c[0, 0] += governor_nm_s_per_rad(machine)
    return c


def fastest_rate_per_s(machine: Machine, force_n: float) -> float:
    """Largest magnitude of an eigenvalue of the damped machine: heavy dampers are as stiff as springs to a solver."""
    m, k = matrices(machine, force_n)
    per_mass = 1.0 / np.diag(m)[:, None]
    n = N_COORDINATES
    state = np.zeros((2 * n, 2 * n))
    state[:n, n:] = np.eye(n)
    state[n:, :n], state[n:, n:] = -per_mass * k, -per_mass * damping_matrix(machine, force_n)
    return float(np.max(np.abs(np.linalg.eigvals(state))))


def eigenfrequencies_hz(machine: Machine, force_n: float = 0.0) -> FloatArray:
    """Undamped eigenfrequencies in rising order, (16,); the first is the rigid rotation, 0."""
    from scipy.linalg import eigh

    m, k = matrices(machine, force_n)
    squares = eigh(k, m, eigvals_only=True)
    result: FloatArray = np.sqrt(np.maximum(squares, 0.0)) / (2.0 * pi)
    return result


def default_step_s(machine: Machine, operation: Operation) -> float:
    """Step that both the stiffness and the tooth passage allow."""
    force = operation.torque_nm.largest / (machine.mesh.pair.driver.base_radius_mm * 1e-3)
    fastest = 2.0 * pi * float(eigenfrequencies_hz(machine, force)[-1])
    step = min(STEP_ANGLE_RAD / fastest, STABLE / fastest_rate_per_s(machine, force))
    mesh_hz = operation.speed_rpm.largest / 60.0 * machine.mesh.pair.driver.teeth
    if mesh_hz > 0.0 and machine.mesh.ramp > 0.0:
        step = min(step, machine.mesh.ramp / mesh_hz / STEPS_PER_RAMP)
    return step
