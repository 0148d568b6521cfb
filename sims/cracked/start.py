"""Where a run starts: the static balance at the first torque and speed, so that no blow has to die out."""

from __future__ import annotations

from math import pi

import numpy as np

from gearsig.checks import FloatArray
from sims.cracked.layout import N_COORDINATES
from sims.gear_pair.bearing import bearing_loads_n
from sims.machine import Machine
from sims.machine.operation import Operation
from sims.mesh import share_torque


def start_state(machine: Machine, operation: Operation, start_s: float) -> tuple[FloatArray, FloatArray]:
    """Coordinates and velocities at `start_s`, (16,) each: driver tooth 0 at its entry, everything turning evenly.

    Friction, roughness, run-out and unbalance are left out of the balance; what they change settles in a few cycles.
    """
    pair = machine.mesh.pair
    torque = float(operation.torque_nm.at(start_s))
    omega = float(operation.speed_rpm.at(start_s)) * pi / 30.0
    r1, r2 = pair.driver.base_radius_mm * 1e-3, pair.driven.base_radius_mm * 1e-3
    force = torque / r1
    delta = 0.0
    if torque > 0.0:
        delta = float(share_torque(machine.mesh, torque, np.zeros(1)).transmission_error_m[0])
    q, v = np.zeros(N_COORDINATES), np.zeros(N_COORDINATES)
    loads = bearing_loads_n(machine, force)
    for row, support in enumerate(machine.bearings):
        size = float(np.hypot(*loads[row]))
        foot = loads[row] / support.stiffness_n_per_m
        if size > 0.0:
            foot = foot + 1e-6 * support.clearance_um * loads[row] / size
        q[8 + 2 * row : 10 + 2 * row] = foot
    beta = np.radians(machine.line_of_action_deg)
    down = -machine.gravity_mps2 * np.array([np.sin(beta), np.cos(beta)])
    for side in range(2):
        place = slice(4 + 2 * side, 6 + 2 * side)
        mesh = np.array([0.0, -force if side == 0 else force])
        load = mesh + machine.wheels[side].mass_kg * down
        bearings = 0.5 * (q[8 + 4 * side : 10 + 4 * side] + q[10 + 4 * side : 12 + 4 * side])
        q[place] = bearings + load / machine.shafts[side].bending_stiffness_n_per_m
    # δ = r1 θ1 − r2 θ2 + y1 − y2 with θ1 = 0.
    q[2] = (q[5] - q[7] - delta) / r2
    q[0] = torque / machine.shafts[0].torsional_stiffness_nm_per_rad
    q[3] = q[2] - torque * machine.ratio / machine.shafts[1].torsional_stiffness_nm_per_rad
    v[0] = v[1] = omega
    v[2] = v[3] = omega / machine.ratio
    return q, v
