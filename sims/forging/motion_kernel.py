"""Compiled: the equations of motion of the drive."""

# mypy: allow-untyped-defs, allow-untyped-calls
from __future__ import annotations

from math import cos, exp, sin

from numba import njit

from sims.forging.contact_kernel import one_pair, position, soundness, stored_energy, weight, worn_off
from sims.forging.friction_kernel import bristle


@njit(cache=True, nogil=True, error_model="numpy")
def tooth_friction(k, n, p, z, w1, w2, flank):
    """Friction force of a pair with normal force n, its moment arms times it, loss, and its bristle's rate.

    v_s = −ω1 ρ1 + ω2 ρ2 on the drive flank, mirrored on the back flank; the bristle z runs to ±μ.
    """
    rho_1 = k.start + p * k.base_pitch
    rho_2 = k.length - rho_1
    v = flank * (w2 * rho_2 - w1 * rho_1)
    coefficient = k.tooth_friction * (1.0 + (k.tooth_static_ratio - 1.0) * exp(-((v / k.tooth_stribeck) ** 2)))
    rate = (v * k.tooth_friction - abs(v) * z * k.tooth_friction / coefficient) / k.tooth_presliding
    f = n * z
    return f, f * rho_1, f * rho_2, f * v, rate


@njit(cache=True, nogil=True, error_model="numpy")
def rates(k, y, flank, younger, damping, torque, brake, press, dy, out):
    """Fill `dy` with the rates of the states; `out` with the rest of what is wanted of a moment.

    J1 ω̇1 = T_m − T_1 − rb1 F + Σ f ρ1 − ∂V/∂θ1,  J2 ω̇2 = rb2 F − Σ f ρ2 − T_2 + T_press − T_weight.
    ∂V/∂θ1 is the work that the changing number of pairs does on the rotation (J.-J. Oh, K. Grosh, J. R. Barber, Energy
    conserving equations of motion for gear systems, 2005): without it the mesh would feed or brake the motor. Worn
    flanks give way to the rotation in the same way: δ_i = ±q − a − h(p_i), so that N_i h'(p_i) dp/dθ1 turns the pinion.
    """
    w1, q, q_rate = y[1], y[2], y[3]
    w2 = (k.rb1 * w1 - q_rate) / k.rb2
    force, turn_1, turn_2, loss, friction = 0.0, 0.0, 0.0, 0.0, 0.0
    pairs, damped = 0.0, 0.0
    dy[4], dy[5] = 0.0, 0.0
    if flank != 0 and flank * q > k.half_backlash:
        p, slope = position(k, y[0], flank, younger)
        for i in range(2):
            worn, over = worn_off(k, p + i, flank)
            depth = flank * q - k.half_backlash - worn
            w, dw = weight(k, p + i)
            if depth <= 0.0 or w <= 0.0:
                continue
            sound = soundness(k, younger - i, flank)
            w, dw = w * sound, dw * sound
            closing = flank * q_rate - over * slope * w1
            elastic, pressed = one_pair(k, depth, closing, damping)
            pairs += w
            force += flank * w * pressed
            turn_1 += slope * (over * w * pressed - dw * elastic * depth / (k.exponent + 1.0))
            damped += w * (pressed - elastic) * closing
            if k.tooth_friction > 0.0:
                f, on_1, on_2, lost, rate = tooth_friction(k, w * pressed, p + i, y[4 + i], w1, w2, flank)
                turn_1 += flank * on_1
                turn_2 -= flank * on_2
                loss += lost
                friction += f
                dy[4 + i] = rate
    share_1, dy[6] = bristle(w1, y[6], k.motor_static_ratio, k.motor_stribeck, k.motor_presliding, k.motor_bristle_time)
    share_2, dy[7] = bristle(w2, y[7], k.load_static_ratio, k.load_stribeck, k.load_presliding, k.load_bristle_time)
    drag = (k.drag + brake) * share_1 + k.drag_viscous * w1
    held = k.load_friction * share_2 + k.load_viscous * w2
    motor = torque * (1.0 + k.ripple_fraction * cos(k.ripple_order * y[0]))
    if k.speed_limit > 0.0:
        motor *= min(1.0, max(-1.0, (k.speed_limit - w1) / (k.speed_band * k.speed_limit)))
    angle_2 = (k.rb1 * y[0] - q) / k.rb2
    outside = press - k.unbalance_torque * sin(angle_2 + k.unbalance_angle)
    a1 = (motor - drag - k.rb1 * force + turn_1) / (k.motor_inertia + k.pinion_inertia)
    a2 = (k.rb2 * force + turn_2 - held + outside) / k.wheel_inertia
    dy[0], dy[1], dy[2], dy[3] = w1, a1, q_rate, k.rb1 * a1 - k.rb2 * a2
    dy[8] = motor * w1 + outside * w2
    dy[9] = damped
    dy[10] = loss + drag * w1 + held * w2
    out[0], out[1], out[2] = y[0], w1, a1
    out[3], out[4], out[5] = angle_2, w2, a2
    out[6], out[7] = motor - drag - k.motor_inertia * a1, force
    out[8], out[9], out[10], out[11], out[12] = q, q_rate, pairs, friction, motor


@njit(cache=True, nogil=True, error_model="numpy")
def energy(k, y, flank, younger):
    """Kinetic energy and what is stored in the teeth."""
    w2 = (k.rb1 * y[1] - y[3]) / k.rb2
    kinetic = 0.5 * (k.motor_inertia + k.pinion_inertia) * y[1] ** 2 + 0.5 * k.wheel_inertia * w2**2
    return kinetic + stored_energy(k, y[0], y[2], flank, younger)
