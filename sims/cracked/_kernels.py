"""Compiled: the classical fourth-order Runge–Kutta method with a fixed step, for the sixteen coordinates."""

# mypy: allow-untyped-defs, allow-untyped-calls

from __future__ import annotations

from math import cos, sin

import numpy as np

from gearsig.compiled import copy, njit
from sims.gear_pair import carried_part, element_forces, foot, friction_of_pair
from sims.machine import profile_value, set_speed, torque_ripple
from sims.mesh import (
    MAX_CYCLES,
    advance,
    cubic,
    engagement_and_slope,
    height_now,
    out_of_place,
    pair_force,
)

# Compiled contact of the gear pair: forces of all tooth pairs in contact, on both flanks.
#
# Each pair k with progress ζ = c − k, c = z1 θ1/2π, has the energy U = w(ζ) u(d; C(ζ)), d = δ − E(ζ) − Δb(t), and the
# normal force N = w n(d; C) from d = C n + B(n). Its forces on the coordinates are −∂U/∂q; in addition to N along the
# line of action, this gives the driver a torque −∂U/∂c · ∂c/∂θ1, as stiffness and flank shape move past under load.
# Without it a pair would take energy from the drive that appears nowhere (Oh, Grosh, Barber 2005). ∂u/∂C at constant d
# is −n²/2 for any contact law.
#
# Gears that move apart by Δa lengthen the line between their base circles by Δa/sin α_w: a pair enters late by that, as
# the path of contact begins at the driven gear's tip. The line also rotates, by Δx/(a sin α_w) where Δx is the driven
# gear's displacement off the line of action, and all contacts shift by r_b1 times that angle. Run-out thus changes
# contact ratio and phase once per revolution. The forces −∂U/∂(Δx, Δy) are neglected: they would depend on the assumed
# width of the ramp, while the geometry of a corner contact gives a tenth of it, and they do work over the run-out only.
#
# The flanks are divided into slices along the face: slice s of a pair enters `slice_late` base pitches after the first
# end, with a gap of `slice_gap` (`sims.mesh.Lead`); a spur pair without crowning and misalignment has one slice.

MAX_LATE = 0.12
"""Limit in base pitches of the late or early entry that displaced gears cause."""


@njit(cache=True, nogil=True, error_model="numpy")
def late_entry(k, dx, dy):
    """Base pitches by which pairs enter late, from the position of the driver's centre less the driven gear's."""
    late = -(k.late_x * dx + k.late_y * dy)
    return min(max(late, -MAX_LATE), MAX_LATE)


@njit(cache=True, nogil=True, error_model="numpy")
def contact_forces(
    k, curves, rows, pitch, delta, delta_rate, late, cycles, cycle_rate, omega_1, omega_2, slip_x, rough, rough_rate
):
    """(ΣN, torque −∂U/∂c, Σf, Σfρ1, Σfρ2) of the driving flanks.

    `k` … `pitch`: see `sims.cracked`. `late`: base pitches by which a pair enters late.
    `slip_x`: ẋ1 − ẋ2. `rough`, `rough_rate`: Δb and its rate.
    """
    normal, along_cycles, friction, moment_1, moment_2 = 0.0, 0.0, 0.0, 0.0, 0.0
    if not abs(cycles) < MAX_CYCLES:  # a diverging solution, or NaN, must not be used as a tooth index
        return np.nan, np.nan, np.nan, np.nan, np.nan
    newest = np.floor(cycles + 0.5 * k.ramp + MAX_LATE)
    z1, z2 = float(k.teeth[0]), float(k.teeth[1])
    columns = curves.shape[1]
    for place_of_slice in range(k.n_slots * k.n_slices):
        slot, s = place_of_slice // k.n_slices, place_of_slice % k.n_slices
        pair = newest - slot
        progress = cycles - pair - k.slice_late[s]
        weight, weight_slope = engagement_and_slope(progress, late, k.contact_ratio, k.ramp)
        if weight <= 0.0:
            continue
        # In floats: the remainder of integers takes several times as long.
        tooth_1, tooth_2 = int(pair - z1 * np.floor(pair / z1)), int(pair - z2 * np.floor(pair / z2))
        # An early entry is before the table's first interval: held at its start.
        place = max((progress - k.table_start) / k.table_step, 1.0)
        i = min(max(int(place), 1), columns - 3)
        t = place - i
        # Lagrange's cubic through four columns, and its slope.
        wa, wb = -t * (t - 1.0) * (t - 2.0) / 6.0, (t * t - 1.0) * (t - 2.0) / 2.0
        wc, wd = -t * (t + 1.0) * (t - 2.0) / 2.0, t * (t * t - 1.0) / 6.0
        step = 1.0 / k.table_step
        sa, sb = -(3.0 * t * t - 6.0 * t + 2.0) / 6.0 * step, (3.0 * t * t - 4.0 * t - 1.0) / 2.0 * step
        sc, sd = -(3.0 * t * t - 2.0 * t - 2.0) / 2.0 * step, (3.0 * t * t - 1.0) / 6.0 * step
        row_1, row_2 = rows[0, tooth_1], rows[1, tooth_2]
        a, b = curves[row_1, i - 1] + curves[row_2, i - 1], curves[row_1, i] + curves[row_2, i]
        c, d = (
            curves[row_1, i + 1] + curves[row_2, i + 1],
            curves[row_1, i + 2] + curves[row_2, i + 2],
        )
        compliance = k.n_slices * (wa * a + wb * b + wc * c + wd * d)
        compliance_slope = k.n_slices * (sa * a + sb * b + sc * c + sd * d)
        row_1, row_2 = rows[2, tooth_1], rows[3, tooth_2]
        a, b = curves[row_1, i - 1] + curves[row_2, i - 1], curves[row_1, i] + curves[row_2, i]
        c, d = (
            curves[row_1, i + 1] + curves[row_2, i + 1],
            curves[row_1, i + 2] + curves[row_2, i + 2],
        )
        depth = delta - rough - (wa * a + wb * b + wc * c + wd * d) - pitch[0, tooth_1] - pitch[1, tooth_2]
        depth -= k.slice_gap[s]
        if depth <= 0.0:
            continue
        shape_slope = sa * a + sb * b + sc * c + sd * d
        force, stiffness = pair_force(depth, compliance, k.contact_coefficient, k.load_dependent, 1.0)
        depth_rate = delta_rate - rough_rate - shape_slope * cycle_rate
        total = weight * (force + k.damping_time * _damped_part(k, depth) * stiffness * depth_rate)
        total = max(total, 0.0)
        normal += total
        along_cycles += total * shape_slope + weight * 0.5 * force * force * compliance_slope
        if weight_slope != 0.0:
            along_cycles -= weight_slope * energy_of_pair(depth, compliance, force, k.load_dependent)
        if k.friction and total > 0.0:
            width = k.width / k.n_slices
            rubbing, on_1, on_2 = friction_of_pair(k, total, progress, omega_1, omega_2, slip_x, width)
            friction, moment_1, moment_2 = friction + rubbing, moment_1 + on_1, moment_2 + on_2
    return normal, along_cycles, friction, moment_1, moment_2


@njit(cache=True, nogil=True, error_model="numpy")
def _damped_part(k, depth):
    """Effective fraction of a contact's damping, which rises smoothly with depth."""
    u = min(depth / k.damping_ramp, 1.0)
    return u * u * (3.0 - 2.0 * u)


@njit(cache=True, nogil=True, error_model="numpy")
def energy_of_pair(depth, compliance, force, load_dependent):
    """Energy of a pair, U = n d − C n²/2 − ∫B, without the engagement weight."""
    if load_dependent:
        return force * (0.5 * compliance * force + (depth - compliance * force) * 0.9 / 1.9)
    return 0.5 * force * depth


@njit(cache=True, nogil=True, error_model="numpy")
def stored_energy(k, curves, rows, pitch, delta, late, cycles, rough):
    """ΣU of the driving flanks, in J; for checks."""
    total = 0.0
    newest = int(np.floor(cycles + 0.5 * k.ramp + MAX_LATE))
    for place_of_slice in range(k.n_slots * k.n_slices):
        pair, s = newest - place_of_slice // k.n_slices, place_of_slice % k.n_slices
        progress = cycles - pair - k.slice_late[s]
        weight = engagement_and_slope(progress, late, k.contact_ratio, k.ramp)[0]
        tooth_1, tooth_2 = pair % k.teeth[0], pair % k.teeth[1]
        compliance = cubic(curves[rows[0, tooth_1]], k.table_start, k.table_step, progress)
        compliance += cubic(curves[rows[1, tooth_2]], k.table_start, k.table_step, progress)
        compliance *= k.n_slices
        shape = (
            cubic(curves[rows[2, tooth_1]], k.table_start, k.table_step, progress) + pitch[0, tooth_1] + k.slice_gap[s]
        )
        shape += cubic(curves[rows[3, tooth_2]], k.table_start, k.table_step, progress) + pitch[1, tooth_2]
        depth = delta - rough - shape
        if weight > 0.0 and depth > 0.0:
            force, _ = pair_force(depth, compliance, k.contact_coefficient, k.load_dependent, 1.0)
            total += weight * energy_of_pair(depth, compliance, force, k.load_dependent)
    return total


@njit(cache=True, nogil=True, error_model="numpy")
def back_flank_force(k, depth, rate):
    """(N', U') of the back flanks, compressed by `depth`: constant stiffness, damping as on the driving side."""
    if depth <= 0.0:
        return 0.0, 0.0
    force = k.back_stiffness * (depth + k.damping_time * _damped_part(k, depth) * rate)
    return max(force, 0.0), 0.5 * k.back_stiffness * depth * depth


# Compiled equations of motion of the sixteen coordinates; see `sims.cracked` for their order.
#
# Driver (counter-clockwise; c, s of the angle of its centre of mass, ρ its distance from the axis)
#     ẍ = F_x/m + ρ(θ̈ s + θ̇² c),  ÿ = F_y/m + ρ(−θ̈ c + θ̇² s),  J θ̈ = T + ρ(s F_x − c F_y),
# where F includes every force except gravity, which acts at the centre of mass and has no moment about it. The driven
# gear turns clockwise: the signs of its y terms are reversed.
# The pitch circle's centre is ε off the axis: y1 + ε1 sin φ1 and y2 − ε2 sin φ2 replace y1 and y2 in the compression,
# and the torque is −N ∂δ/∂θ. Tooth forces: see above; those of the back flanks act along their own line of action, at
# 2α_w to that of the driving flanks.


@njit(cache=True, nogil=True, error_model="numpy")
def tilted(k, q):
    """Compression of helical flanks by tilting of the shafts, r_w φ tan β_b of both, from q (or its rate, from v)."""
    first = k.tilt_x[0] * (q[8] - q[10]) + k.tilt_y[0] * (q[9] - q[11])
    return -first - k.tilt_x[1] * (q[12] - q[14]) - k.tilt_y[1] * (q[13] - q[15])


@njit(cache=True, nogil=True, error_model="numpy")
def bearing_force(k, row, theta, x, y):
    """(F_x, F_y) of a bearing's spring or elements on the shaft at (x, y); `theta`: shaft angle."""
    part = 1.0
    if k.special[row] > 0:
        foot_x, foot_y = foot(k, row, theta, x, y)
        x, y = x - foot_x, y - foot_y
        if k.balls[row] > 0:
            return element_forces(k, row, theta, x, y)
        part = carried_part(k, row, x, y)
    stiffness = part * k.bearing_stiffness[row]
    return -stiffness * x, -stiffness * y


@njit(cache=True, nogil=True, error_model="numpy")
def accelerations(  # noqa: PLR0915  one machine, one set of equations
    k, curves, rows, pitch, q, v, torque, set_angle, speed, speed_rate, rough, rough_rate, a, extra
):
    """Fill `a` (16) with the accelerations and `extra` (5) with the signals from "transmission_error_m" on.

    k, curves, rows, pitch : see `sims.cracked`.
    q, v : (16,).
    torque, set_angle, speed, speed_rate : set values of the input at this time, in N m, rad, rad/s, rad/s².
    rough, rough_rate : Δb and its rate.
    """
    rb1, rb2 = k.base_radius[0], k.base_radius[1]
    # Positions of the pitch circles' centres: ε (cos φ1, sin φ1) and ε (cos φ2, −sin φ2).
    cx1, cy1, cx2, cy2 = 0.0, 0.0, 0.0, 0.0
    if k.turns:
        cx1, cy1 = k.runout[0] * cos(q[1] + k.runout_angle[0]), k.runout[0] * sin(q[1] + k.runout_angle[0])
        cx2, cy2 = k.runout[1] * cos(q[2] + k.runout_angle[1]), -k.runout[1] * sin(q[2] + k.runout_angle[1])
    error = rb1 * q[1] - rb2 * q[2]
    arm1, arm2 = rb1 + cx1, rb2 - cx2  # ∂δ/∂θ1 and −∂δ/∂θ2
    delta_rate = arm1 * v[1] - arm2 * v[2] + v[5] - v[7]
    dx, dy = q[4] + cx1 - q[6] - cx2, q[5] + cy1 - q[7] - cy2
    tilt, tilt_rate = tilted(k, q), tilted(k, v)
    delta, late = error + dy + tilt, late_entry(k, dx, dy)
    delta_rate += tilt_rate
    cycles = k.cycles_per_rad * q[1] - k.turn_x * dx
    normal, along, friction, moment_1, moment_2 = contact_forces(
        k,
        curves,
        rows,
        pitch,
        delta,
        delta_rate,
        late,
        cycles,
        k.cycles_per_rad * v[1],
        v[1],
        v[2],
        v[4] - v[6],
        rough,
        rough_rate,
    )
    back = 0.0
    off, off_slope = out_of_place(cycles, 0.5 * k.contact_ratio, k.teeth, pitch)
    depth = -error - k.cos_back * dy + k.sin_back * dx - k.backlash - rough - tilt + off
    if depth > 0.0:  # also while the driving flanks touch: run-out may take up all backlash
        # Velocities of the pitch circles' centres: θ̇ times their positions rotated by 90°.
        vx = v[4] - cy1 * v[1] - v[6] - cy2 * v[2]
        vy = v[5] + cx1 * v[1] - v[7] + cx2 * v[2]
        rate = -rb1 * v[1] + rb2 * v[2] - k.cos_back * vy + k.sin_back * vx - rough_rate - tilt_rate
        rate += off_slope * k.cycles_per_rad * v[1]
        back, _ = back_flank_force(k, depth, rate)
    fx1, fy1 = -friction - k.sin_back * back, -normal + k.cos_back * back
    fx2, fy2 = friction + k.sin_back * back, normal - k.cos_back * back
    t1 = -arm1 * normal + k.cycles_per_rad * along + moment_1
    t2 = arm2 * normal - moment_2
    if back > 0.0:
        t1 += back * (rb1 + k.cos_back * cx1 + k.sin_back * cy1 - off_slope * k.cycles_per_rad)
        t2 += back * (-rb2 + k.cos_back * cx2 + k.sin_back * cy2)

    # Shafts: bending to the mean of the two bearings, torsion to the rotors.
    for side in range(2):
        g, b1, b2 = 4 + 2 * side, 8 + 4 * side, 10 + 4 * side
        ks, cs = k.bending_stiffness[side], k.bending_damping[side]
        bend_x = ks * (q[g] - 0.5 * (q[b1] + q[b2])) + cs * (v[g] - 0.5 * (v[b1] + v[b2]))
        bend_y = ks * (q[g + 1] - 0.5 * (q[b1 + 1] + q[b2 + 1])) + cs * (v[g + 1] - 0.5 * (v[b1 + 1] + v[b2 + 1]))
        theta = q[1] if side == 0 else q[2]
        rotor, rotor_rate = (q[0], v[0]) if side == 0 else (q[3], v[3])
        up = 1.0 if side == 0 else -1.0  # the driven shaft turns in the opposite direction
        slope = 1.0
        push_x, push_y = 0.0, 0.0
        if k.hooke[side] > 0.0:
            c2, s2 = cos(2.0 * rotor), sin(2.0 * rotor)
            slope = 1.0 + 2.0 * k.hooke[side] * c2
            rotor += k.hooke[side] * s2
            rotor_rate *= slope
        twist = rotor - theta
        twist_rate = rotor_rate - (v[1] if side == 0 else v[2])
        carried = k.torsional_stiffness[side] * twist + k.torsional_damping[side] * twist_rate
        if k.hooke[side] > 0.0:
            bent = k.coupling_bending[side]
            push_x = k.hooke_force[side] * (carried * (1.0 + c2) - bent * s2)
            push_y = k.hooke_force[side] * up * (carried * s2 + bent * (1.0 + c2))
        # The axial force acts at the pitch circle: its moment gives opposite bearing forces along the line of centres.
        push_x += k.tilt_x[side] * (normal - back)
        push_y += k.tilt_y[side] * (normal - back)
        for row, b, sign in ((2 * side, b1, 1.0), (2 * side + 1, b2, -1.0)):
            held_x, held_y = bearing_force(k, row, theta, q[b], q[b + 1])
            cb, per_mass = k.bearing_damping[row], k.per_bearing_mass[row]
            a[b] = (0.5 * bend_x + held_x - cb * v[b] + sign * push_x) * per_mass + k.gravity_x
            a[b + 1] = (0.5 * bend_y + held_y - cb * v[b + 1] + sign * push_y) * per_mass + k.gravity_y
        if side == 0:
            fx, fy, t = fx1 - bend_x, fy1 - bend_y, t1 + carried
        else:
            fx, fy, t = fx2 - bend_x, fy2 - bend_y, t2 + carried
        offset = k.mass_offset[side]
        ax, ay = fx * k.per_mass[side], fy * k.per_mass[side]
        if offset > 0.0:
            omega = v[1] if side == 0 else v[2]
            c, s = cos(theta + k.mass_angle[side]), sin(theta + k.mass_angle[side])
            t += offset * (s * fx - up * c * fy)
            alpha = t * k.per_inertia[side]
            ax += offset * (alpha * s + omega * omega * c)
            ay += up * offset * (-alpha * c + omega * omega * s)
        a[1 + side] = t * k.per_inertia[side]
        a[g], a[g + 1] = ax + k.gravity_x, ay + k.gravity_y
        if side == 0:
            drive = torque * torque_ripple(k, q[0]) + k.total_inertia * speed_rate
            drive += k.governor * (speed - v[0]) + k.governor_spring * (set_angle - q[0])
            a[0] = (drive - slope * carried) * k.per_rotor[0]
        else:
            a[3] = (-torque * k.ratio - slope * carried) * k.per_rotor[1]
    extra[0], extra[1], extra[2], extra[3] = error, delta, normal - back, friction
    extra[4] = rough


# Compiled: energy of the machine, for checks. Valid for bearings without clearance or defect.


@njit(cache=True, nogil=True, error_model="numpy")
def potential_energy(k, curves, rows, pitch, q, late, turned, rough):
    """Potential energy of springs, tooth pairs and weight, in J; `late`, `turned`: see `place_of_entry`."""
    cx1, cy1 = k.runout[0] * cos(q[1] + k.runout_angle[0]), k.runout[0] * sin(q[1] + k.runout_angle[0])
    cx2, cy2 = k.runout[1] * cos(q[2] + k.runout_angle[1]), -k.runout[1] * sin(q[2] + k.runout_angle[1])
    error = k.base_radius[0] * q[1] - k.base_radius[1] * q[2]
    dx, dy = q[4] + cx1 - q[6] - cx2, q[5] + cy1 - q[7] - cy2
    tilt = tilted(k, q)
    cycles = k.cycles_per_rad * q[1] - turned
    total = stored_energy(k, curves, rows, pitch, error + dy + tilt, late, cycles, rough)
    off = out_of_place(cycles, 0.5 * k.contact_ratio, k.teeth, pitch)[0]
    total += back_flank_force(k, -error - k.cos_back * dy + k.sin_back * dx - k.backlash - rough - tilt + off, 0.0)[1]
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
    """Late entry of pairs, and shift of all contacts, in base pitches, at the coordinates q."""
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


@njit(cache=True, nogil=True, error_model="numpy")
def integrate(  # noqa: PLR0915  four stages written out
    k,
    curves,
    rows,
    pitch,
    q,
    v,
    set_angle,
    start,
    step,
    n_steps,
    stride,
    speed,
    torque,
    rough,
    select,
    output,
    energies,
):
    """Run `n_steps` steps from time `start`; fill `output` with the selected signals at every `stride`-th step.

    k, curves, rows, pitch : see `sims.cracked`.
    q, v, set_angle : (16,), (16,), (1,); left at the last step's state, where the next call continues.
    speed, torque : (2, n) times and values of the set profiles, in rad/s and N m.
    rough : phasors at `start` of a roughness locked to time, stepped by half of `step`, left at the end; see
        `TimeLockedRoughness`.
    select : indices of the requested signals in `sims.cracked.SIGNALS`.
    output : (n_out, n_selected).
    energies : (n_out,) or (0,): total energy in J, not computed if empty.
    Returns the number of rows filled, fewer if the state is no longer finite.
    """
    re, im, omega, half_cos, half_sin = rough
    a = np.empty(16)
    extra = np.empty(5)
    q1, v1 = np.empty(16), np.empty(16)
    sum_q, sum_v = np.empty(16), np.empty(16)
    signals = np.empty(61)
    n_rows = 0
    h0, r0 = height_now(re, im, omega)
    angle = set_angle[0]
    for step_number in range(n_steps):
        t = start + step_number * step
        w0, d0 = set_speed(k, speed, t)
        wh, dh = set_speed(k, speed, t + 0.5 * step)
        w1, d1 = set_speed(k, speed, t + step)
        # The set angle by Simpson's rule, and halfway by the parabola through the same three speeds.
        angle_h = angle + step / 24.0 * (5.0 * w0 + 8.0 * wh - w1)
        angle_1 = angle + step / 6.0 * (w0 + 4.0 * wh + w1)
        m0, mh, m1 = profile_value(torque, t), profile_value(torque, t + 0.5 * step), profile_value(torque, t + step)
        # Roughness locked to time, at the middle and the end of the step.
        advance(re, im, half_cos, half_sin)
        hh, rh = height_now(re, im, omega)
        advance(re, im, half_cos, half_sin)
        h1, r1 = height_now(re, im, omega)
        # First stage, at the beginning: its accelerations are also those of the kept point.
        accelerations(k, curves, rows, pitch, q, v, m0, angle, w0, d0, h0, r0, a, extra)
        if step_number % stride == 0:
            for i in range(16):
                signals[i], signals[16 + i], signals[32 + i] = q[i], v[i], a[i]
            for i in range(5):
                signals[48 + i] = extra[i]
            for row in range(4):
                held_x, held_y = bearing_force(k, row, q[1 + row // 2], q[8 + 2 * row], q[9 + 2 * row])
                signals[53 + 2 * row] = -held_x / k.bearing_stiffness[row]
                signals[54 + 2 * row] = -held_y / k.bearing_stiffness[row]
            for i in range(select.shape[0]):
                output[n_rows, i] = signals[select[i]]
            if energies.shape[0] > 0:
                late, turned = place_of_entry(k, q)
                energies[n_rows] = potential_energy(k, curves, rows, pitch, q, late, turned, h0)
                energies[n_rows] += kinetic_energy(k, v, q)
            if not np.isfinite(a[1] + a[5] + a[7] + a[2]):
                return n_rows
            n_rows += 1
        # Second and third stage, in the middle; the fourth, at the end.
        half = 0.5 * step
        for i in range(16):
            sum_q[i], sum_v[i] = v[i], a[i]
            q1[i], v1[i] = q[i] + half * v[i], v[i] + half * a[i]
        accelerations(k, curves, rows, pitch, q1, v1, mh, angle_h, wh, dh, hh, rh, a, extra)
        for i in range(16):
            sum_q[i] += 2.0 * v1[i]
            sum_v[i] += 2.0 * a[i]
            q1[i] = q[i] + half * v1[i]
            v1[i] = v[i] + half * a[i]
        accelerations(k, curves, rows, pitch, q1, v1, mh, angle_h, wh, dh, hh, rh, a, extra)
        for i in range(16):
            sum_q[i] += 2.0 * v1[i]
            sum_v[i] += 2.0 * a[i]
            q1[i] = q[i] + step * v1[i]
            v1[i] = v[i] + step * a[i]
        accelerations(k, curves, rows, pitch, q1, v1, m1, angle_1, w1, d1, h1, r1, a, extra)
        sixth = step / 6.0
        for i in range(16):
            q[i] += sixth * (sum_q[i] + v1[i])
            v[i] += sixth * (sum_v[i] + a[i])
        h0, r0, angle = h1, r1, angle_1
    set_angle[0] = angle
    return n_rows


@njit(cache=True, nogil=True, error_model="numpy")
def derivative(k, curves, rows, pitch, t, state, speed, torque, first_angle, rough, rate):
    """Fill `rate` (32) with the derivative of `state` (q, v) at any time t, for other integrators and checks.

    first_angle : set angle at time 0; the set speed must be constant.
    rough : (amplitudes, ω, phases) of a roughness locked to time.
    """
    amplitude, omega, phase = rough
    height, height_rate = 0.0, 0.0
    for n in range(amplitude.shape[0]):
        height += amplitude[n] * cos(omega[n] * t + phase[n])
        height_rate -= amplitude[n] * omega[n] * sin(omega[n] * t + phase[n])
    w, d = set_speed(k, speed, t)
    angle = first_angle + w * t
    extra = np.empty(5)
    accelerations(
        k,
        curves,
        rows,
        pitch,
        state[:16],
        state[16:],
        profile_value(torque, t),
        angle,
        w,
        d,
        height,
        height_rate,
        rate[16:],
        extra,
    )
    copy(state[16:], rate)
    return extra
