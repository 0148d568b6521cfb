"""Compiled equations of motion of the sixteen coordinates; see `sims.cracked.layout` for their order.

Driver (counter-clockwise; c, s of the angle of its centre of mass, ρ its distance from the axis)
    ẍ = F_x/m + ρ(θ̈ s + θ̇² c),  ÿ = F_y/m + ρ(−θ̈ c + θ̇² s),  J θ̈ = T + ρ(s F_x − c F_y),
where F holds every force but gravity: gravity acts at the centre of mass and has no moment about it. The driven gear
turns clockwise: the signs of its y terms are reversed.
Its pitch circle's centre lies ε off the axis: y1 + ε1 sin φ1 and y2 − ε2 sin φ2 take the places of y1 and y2 in the
compression, and the torque is −N ∂δ/∂θ. Forces on the teeth: `sims.cracked.contact_kernel`, and on the flanks behind
along their own line of action, 2α_w away from that of the driving flanks.
"""

# mypy: allow-untyped-defs, allow-untyped-calls
from __future__ import annotations

from math import cos, sin

from numba import njit

from sims.cracked.contact_kernel import back_flank_force, contact_forces, late_entry
from sims.gear_pair.bearing_kernel import carried_part, foot


@njit(cache=True, nogil=True, error_model="numpy")
def accelerations(  # noqa: PLR0912, PLR0915  one machine, one set of equations
    k, curves, rows, pitch, q, v, torque, set_angle, speed, speed_rate, rough, rough_rate, a, extra
):
    """Fill `a` (16) with the accelerations and `extra` (5) with the signals that follow.

    k, curves, rows, pitch : see `sims.cracked.constants`.
    q, v : (16,).
    torque, set_angle, speed, speed_rate : set values of the input at this time, in N m, rad, rad/s, rad/s².
    rough, rough_rate : Δb and its rate.
    """
    rb1, rb2 = k.base_radius[0], k.base_radius[1]
    # Places of the pitch circles' centres: ε (cos φ1, sin φ1) and ε (cos φ2, −sin φ2).
    cx1, cy1, cx2, cy2 = 0.0, 0.0, 0.0, 0.0
    if k.turns:
        cx1, cy1 = k.runout[0] * cos(q[1] + k.runout_angle[0]), k.runout[0] * sin(q[1] + k.runout_angle[0])
        cx2, cy2 = k.runout[1] * cos(q[2] + k.runout_angle[1]), -k.runout[1] * sin(q[2] + k.runout_angle[1])
    error = rb1 * q[1] - rb2 * q[2]
    arm1, arm2 = rb1 + cx1, rb2 - cx2  # ∂δ/∂θ1 and −∂δ/∂θ2
    delta_rate = arm1 * v[1] - arm2 * v[2] + v[5] - v[7]
    dx, dy = q[4] + cx1 - q[6] - cx2, q[5] + cy1 - q[7] - cy2
    delta, late = error + dy, late_entry(k, dx, dy)
    normal, along, friction, moment_1, moment_2 = contact_forces(
        k,
        curves,
        rows,
        pitch,
        delta,
        delta_rate,
        late,
        k.cycles_per_rad * q[1] - k.turn_x * dx,
        k.cycles_per_rad * v[1],
        v[1],
        v[2],
        v[4] - v[6],
        rough,
        rough_rate,
    )
    back = 0.0
    depth = -error - k.cos_back * dy + k.sin_back * dx - k.backlash - rough
    if depth > 0.0:  # also while the driving flanks touch: run-out may take up all play
        # Velocities of the pitch circles' centres: θ̇ times their places turned by a quarter.
        vx = v[4] - cy1 * v[1] - v[6] - cy2 * v[2]
        vy = v[5] + cx1 * v[1] - v[7] + cx2 * v[2]
        rate = -rb1 * v[1] + rb2 * v[2] - k.cos_back * vy + k.sin_back * vx - rough_rate
        back, _ = back_flank_force(k, depth, rate)
    fx1, fy1 = -friction - k.sin_back * back, -normal + k.cos_back * back
    fx2, fy2 = friction + k.sin_back * back, normal - k.cos_back * back
    t1 = -arm1 * normal + k.cycles_per_rad * along + moment_1
    t2 = arm2 * normal - moment_2
    if back > 0.0:
        t1 += back * (rb1 + k.cos_back * cx1 + k.sin_back * cy1)
        t2 += back * (-rb2 + k.cos_back * cx2 + k.sin_back * cy2)

    # Shafts: bending to the mean of the two bearings, torsion to the rotors.
    for side in range(2):
        g, b1, b2 = 4 + 2 * side, 8 + 4 * side, 10 + 4 * side
        ks, cs = k.bending_stiffness[side], k.bending_damping[side]
        bend_x = ks * (q[g] - 0.5 * (q[b1] + q[b2])) + cs * (v[g] - 0.5 * (v[b1] + v[b2]))
        bend_y = ks * (q[g + 1] - 0.5 * (q[b1 + 1] + q[b2 + 1])) + cs * (v[g + 1] - 0.5 * (v[b1 + 1] + v[b2 + 1]))
        theta = q[1] if side == 0 else q[2]
        rotor, rotor_rate = (q[0], v[0]) if side == 0 else (q[3], v[3])
        up = 1.0 if side == 0 else -1.0  # the driven shaft turns the other way
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
        for row, b, sign in ((2 * side, b1, 1.0), (2 * side + 1, b2, -1.0)):
            x, y = q[b], q[b + 1]
            part = 1.0
            if k.special[row] > 0:
                foot_x, foot_y = foot(k, row, theta, x, y)
                x, y = x - foot_x, y - foot_y
                part = carried_part(k, row, x, y)
            kb, cb, per_mass = part * k.bearing_stiffness[row], k.bearing_damping[row], k.per_bearing_mass[row]
            a[b] = (0.5 * bend_x - kb * x - cb * v[b] + sign * push_x) * per_mass + k.gravity_x
            a[b + 1] = (0.5 * bend_y - kb * y - cb * v[b + 1] + sign * push_y) * per_mass + k.gravity_y
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
            drive = torque * _ripple(k, q[0]) + k.total_inertia * speed_rate
            drive += k.governor * (speed - v[0]) + k.governor_spring * (set_angle - q[0])
            a[0] = (drive - slope * carried) * k.per_rotor[0]
        else:
            a[3] = (-torque * k.ratio - slope * carried) * k.per_rotor[1]
    extra[0], extra[1], extra[2], extra[3] = error, delta, normal - back, friction
    extra[4] = rough


@njit(cache=True, nogil=True, error_model="numpy")
def _ripple(k, theta):
    """Drive torque over its set value."""
    factor = 1.0
    for i in range(k.n_ripples):
        factor += k.ripples[i, 1] * cos(k.ripples[i, 0] * theta + k.ripples[i, 2])
    return factor
