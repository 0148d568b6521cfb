"""Compiled: energy of the machine, for checks. Valid for bearings without clearance or defect."""

# mypy: allow-untyped-defs, allow-untyped-calls
from __future__ import annotations

from math import cos, sin

from numba import njit

from sims.cracked.contact_kernel import back_flank_force, late_entry, stored_energy


@njit(cache=True, nogil=True, error_model="numpy")
def potential_energy(k, curves, rows, pitch, q, late, turned, rough):
    """Springs, tooth pairs and weight, in J; `late`, `turned`: see `place_of_entry`."""
    cx1, cy1 = k.runout[0] * cos(q[1] + k.runout_angle[0]), k.runout[0] * sin(q[1] + k.runout_angle[0])
    cx2, cy2 = k.runout[1] * cos(q[2] + k.runout_angle[1]), -k.runout[1] * sin(q[2] + k.runout_angle[1])
    error = k.base_radius[0] * q[1] - k.base_radius[1] * q[2]
    dx, dy = q[4] + cx1 - q[6] - cx2, q[5] + cy1 - q[7] - cy2
    total = stored_energy(k, curves, rows, pitch, error + dy, late, k.cycles_per_rad * q[1] - turned, rough)
    total += back_flank_force(k, -error - k.cos_back * dy + k.sin_back * dx - k.backlash - rough, 0.0)[1]
    for side in range(2):
        g, b1, b2 = 4 + 2 * side, 8 + 4 * side, 10 + 4 * side
        theta, rotor = q[1 + side], q[3 * side]
        twist = rotor + k.hooke[side] * sin(2.0 * rotor) - theta
        total += 0.5 * k.torsional_stiffness[side] * twist * twist
        angle, up = theta + k.mass_angle[side], 1.0 - 2.0 * side
        for axis in range(2):
            bend = q[g + axis] - 0.5 * (q[b1 + axis] + q[b2 + axis])
            total += 0.5 * k.bending_stiffness[side] * bend * bend
            pull = k.gravity_x if axis == 0 else k.gravity_y
            centre = q[g + axis] + k.mass_offset[side] * (cos(angle) if axis == 0 else up * sin(angle))
            total -= k.mass[side] * pull * centre
            for b, row in ((b1, 2 * side), (b2, 2 * side + 1)):
                place = q[b + axis]
                total += 0.5 * k.bearing_stiffness[row] * place * place - k.bearing_mass[row] * pull * place
    return total


@njit(cache=True, nogil=True, error_model="numpy")
def place_of_entry(k, q):
    """Late entry of pairs, and shift of all contacts, in base pitches, at the places q."""
    dx = q[4] + k.runout[0] * cos(q[1] + k.runout_angle[0]) - q[6] - k.runout[1] * cos(q[2] + k.runout_angle[1])
    dy = q[5] + k.runout[0] * sin(q[1] + k.runout_angle[0]) - q[7] + k.runout[1] * sin(q[2] + k.runout_angle[1])
    return late_entry(k, dx, dy), k.turn_x * dx


@njit(cache=True, nogil=True, error_model="numpy")
def kinetic_energy(k, v, q):
    """½ Σ m v² of all bodies, in J; for checks."""
    total = 0.5 * (k.rotor_inertia[0] * v[0] ** 2 + k.rotor_inertia[1] * v[3] ** 2)
    for side in range(2):
        up, g = (1.0 if side == 0 else -1.0), 4 + 2 * side
        phi = q[1 + side] + k.mass_angle[side]
        vx = v[g] - k.mass_offset[side] * sin(phi) * v[1 + side]
        vy = v[g + 1] + up * k.mass_offset[side] * cos(phi) * v[1 + side]
        total += 0.5 * k.inertia[side] * v[1 + side] ** 2 + 0.5 * k.mass[side] * (vx * vx + vy * vy)
    for row in range(4):
        total += 0.5 * k.bearing_mass[row] * (v[8 + 2 * row] ** 2 + v[9 + 2 * row] ** 2)
    return total
