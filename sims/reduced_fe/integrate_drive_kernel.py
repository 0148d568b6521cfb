"""Compiled: what acts on the two sides besides the driving flanks, as modal forces."""

# mypy: allow-untyped-defs, allow-untyped-calls
from __future__ import annotations

from math import cos, sin

from numba import njit

from sims.compiled import UNCOUNTED
from sims.gear_pair.bearing_kernel import foot
from sims.mesh.friction_kernel import contact_friction_n
from sims.reduced_fe.integrate_modes_kernel import on_input


@njit(inline="always", error_model="numpy")
def outer_forces(k, inputs, q, v, angle, omega, rate, load, out):
    """Fill `out` with drive and load, the turning set speed, unbalance and weight, rolling elements."""
    for side in range(2):
        if side == 0:
            drive = load * _ripple(k, angle + on_input(inputs, 0, 0, q)) + k.total_inertia * rate
            drive -= k.governor * on_input(inputs, 0, 0, v) + k.governor_spring * on_input(inputs, 0, 0, q)
        else:
            drive = -load * k.ratio
        for j in range(out.shape[1]):
            out[side, j] = drive * inputs[side, 0, j] + rate * inputs[side, 8, j]
        if k.pushes:
            _push(k, side, inputs, angle, omega, drive, out)
        if k.rolls:
            _roll(k, side, inputs, angle, load, out)


@njit(cache=True, nogil=True, error_model="numpy", **UNCOUNTED)
def friction_of_pair(k, force, progress, omega, slip_x):
    """(f, fρ1, fρ2) of a pair at ζ; the film knows the set speed `omega`, its sign feels the vibration `slip_x`."""
    rho_1 = k.start_radius + min(max(progress, 0.0), k.contact_ratio) * k.base_pitch
    rho_2 = k.action_length - rho_1
    rubbing = contact_friction_n(
        force,
        omega * rho_1,
        omega / k.ratio * rho_2,
        slip_x,
        rho_1 * rho_2 / k.action_length,
        k.width,
        k.reduced_modulus,
        k.log10_oil,
        k.oil_constant,
        k.sign_threshold,
        k.friction_factor,
        k.dry_friction,
    )
    return rubbing, rubbing * rho_1, rubbing * rho_2


@njit(cache=True, nogil=True, error_model="numpy", **UNCOUNTED)
def _ripple(k, theta):
    """Drive torque over its set value."""
    factor = 1.0
    for i in range(k.n_ripples):
        factor += k.ripples[i, 1] * cos(k.ripples[i, 0] * theta + k.ripples[i, 2])
    return factor


@njit(cache=True, nogil=True, error_model="numpy", **UNCOUNTED)
def _push(k, side, inputs, angle, omega, drive, out):
    """Add unbalance, weight and a bent coupling, at the set speed."""
    theta = angle if side == 0 else angle / k.ratio
    rate = omega if side == 0 else omega / k.ratio
    up = 1.0 if side == 0 else -1.0
    phi = theta + k.mass_angle[side]
    fx = k.unbalance[side] * rate * rate * cos(phi) + k.mass[side] * k.gravity_x
    fy = up * k.unbalance[side] * rate * rate * sin(phi) + k.mass[side] * k.gravity_y
    c2, s2 = cos(2.0 * theta), sin(2.0 * theta)
    kink = (
        k.torsional_stiffness[side] * k.hooke[side] * s2 + 2.0 * k.torsional_damping[side] * k.hooke[side] * rate * c2
    )
    on_rotor = -kink - 2.0 * k.hooke[side] * c2 * drive
    bent = k.coupling_bending[side]
    couple_x = k.hooke_force[side] * (drive * (1.0 + c2) - bent * s2)
    couple_y = k.hooke_force[side] * up * (drive * s2 + bent * (1.0 + c2))
    for j in range(out.shape[1]):
        out[side, j] += fx * inputs[side, 2, j] + fy * inputs[side, 3, j]
        out[side, j] += on_rotor * inputs[side, 0, j] + kink * inputs[side, 1, j]
        out[side, j] += couple_x * (inputs[side, 4, j] - inputs[side, 6, j])
        out[side, j] += couple_y * (inputs[side, 5, j] - inputs[side, 7, j])


@njit(cache=True, nogil=True, error_model="numpy", **UNCOUNTED)
def _roll(k, side, inputs, angle, load, out):
    """Add the forces of bearing springs whose feet move as rolling elements pass, under the load of this moment."""
    theta = angle if side == 0 else angle / k.ratio
    part = load / k.nominal_torque
    for bearing in range(2):
        row = 2 * side + bearing
        if k.special[row] > 0:
            x = part * k.bearing_yield[row, 0] + k.bearing_play[row, 0]
            y = part * k.bearing_yield[row, 1] + k.bearing_play[row, 1]
            dx, dy = foot(k, row, theta, x, y)
            fx = k.bearing_spring[row, 0, 0] * dx + k.bearing_spring[row, 0, 1] * dy
            fy = k.bearing_spring[row, 1, 0] * dx + k.bearing_spring[row, 1, 1] * dy
            for j in range(out.shape[1]):
                out[side, j] += fx * inputs[side, 4 + 2 * bearing, j] + fy * inputs[side, 5 + 2 * bearing, j]
