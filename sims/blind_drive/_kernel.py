"""Compiled: four masses on two shafts, teeth with play between the middle two; fixed steps."""

# mypy: allow-untyped-defs, allow-untyped-calls

from __future__ import annotations

from math import ceil, cos, exp, floor, pi, sin, tanh

import numpy as np
from numba import njit

N_STATES = 10
"""Angle and speed of motor, pinion, wheel, load; opening of the valve; grip of the brake."""
N_OUT = 8
"""Pinion's and wheel's angle, speed, acceleration; torque of the sensor; force of the teeth."""


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _relief(r, p):
    """Tip relief at both ends of the path: the pair comes and goes without a step."""
    if p < r.relief_length:
        x = (r.relief_length - p) / r.relief_length
        return r.relief * x * x
    if p > r.ratio - r.relief_length:
        x = (p - r.ratio + r.relief_length) / r.relief_length
        return r.relief * x * x
    return 0.0


@njit(cache=True, nogil=True, error_model="numpy")
def _worn(r, p):
    """Depth of wear over the path: pressure times sliding, half of the load where two pairs share it."""
    if r.wear == 0.0:
        return 0.0
    share = 1.0 if r.ratio - 1.0 < p < 1.0 else 0.5
    return r.wear * share * abs(p - r.pitch_point) / r.wear_span


@njit(cache=True, nogil=True, error_model="numpy")
def _friction(speed, level, rise, stribeck, near, viscous):
    return level * (1.0 + rise * exp(-abs(speed) / stribeck)) * tanh(speed / near) + viscous * speed


@njit(cache=True, nogil=True, error_model="numpy")
def _teeth(r, flank, y, errors_1, errors_2):
    """Force of one flank's pairs and their torques on pinion and wheel, friction included.

    N = max(k(p) δ + c δ̇ δ/(δ + δ₀), 0),  k(p) = k₀ (1 − κ (2p/ε − 1)²)
    """
    x = y[2] * r.z1 / (2.0 * pi) - r.phase
    run_out = r.run_out * sin(y[2] + r.run_out_phase + (0.0 if flank > 0.0 else -2.0 * r.pressure_angle))
    q = flank * (r.rb1 * y[2] - r.rb2 * y[4] - run_out) - r.half_play
    rate = flank * (r.rb1 * y[3] - r.rb2 * y[5])
    along = x if flank > 0.0 else 2.0 * r.pitch_point + 0.5 - x
    young = floor(along)
    force, on_1, on_2 = 0.0, 0.0, 0.0
    for i in range(2):
        p = along - young + i
        if p > r.ratio:
            continue
        number = young - i
        j1 = int(number - floor(number / r.z1) * r.z1)
        j2 = int(number - floor(number / r.z2) * r.z2)
        row = 0 if flank > 0.0 else 1
        gap = errors_1[row, j1] + errors_2[row, j2] + _relief(r, p)
        if flank > 0.0:
            gap += _worn(r, p)
        depth = q - gap
        if depth <= 0.0:
            continue
        middle = 2.0 * p / r.ratio - 1.0
        k = r.k0 * (1.0 - r.k_curve * middle * middle)
        if flank > 0.0 and j1 == r.cracked:
            k /= 1.0 + r.crack * (0.3 + 0.7 * p / r.ratio) * 1.5
        n = max(k * depth + r.c0 * rate * depth / (depth + r.soft), 0.0)
        rho_1 = r.start + p * r.base_pitch
        rho_2 = r.length - rho_1
        v = rho_2 * y[5] - rho_1 * y[3]
        f = n * r.mu * (1.0 + r.mu_rise * exp(-abs(v) / r.mu_stribeck)) * tanh(v / r.mu_near)
        force += n
        on_1 += -flank * n * r.rb1 + f * rho_1
        on_2 += flank * n * r.rb2 - f * rho_2
    return force, on_1, on_2


@njit(cache=True, nogil=True, error_model="numpy")
def _rates(r, t, y, errors_1, errors_2, dy, out):
    within = t - floor(t / r.period) * r.period
    opened = 1.0 if within < r.on else 0.0
    gripped = 1.0 if within > r.on + r.brake_delay and within < r.period - 0.1 else 0.0
    dy[8] = (opened - y[8]) / r.valve_lag
    dy[9] = (gripped - y[9]) / r.brake_lag
    share = y[1] / r.speed_limit
    motor = r.torque * y[8] * min(max(1.0 - share**5, -1.0), 1.0)
    motor *= 1.0 + r.ripple * (cos(r.ripple_order * y[0] + r.ripple_phase) + 0.3 * cos(2.0 * r.ripple_order * y[0]))
    motor -= _friction(y[1], r.motor_level + r.brake * y[9], 0.2, 0.2, 0.05, r.motor_viscous)
    shaft_1 = r.kt * (y[0] - y[2]) + r.ct * (y[1] - y[3])
    shaft_2 = r.kw * (y[4] - y[6]) + r.cw * (y[5] - y[7])
    drive, d1, d2 = _teeth(r, 1.0, y, errors_1, errors_2)
    back, b1, b2 = _teeth(r, -1.0, y, errors_1, errors_2)
    load = _friction(y[7], r.load_level, 0.25, 0.03, 0.002, r.load_viscous)
    load += r.off_centre * sin(y[6] + r.off_centre_phase)
    blow = within - r.on - r.blow_delay
    if r.blow > 0.0 and 0.0 < blow < r.blow_lasts:
        load -= r.blow * sin(pi * blow / r.blow_lasts)
    dy[0], dy[2], dy[4], dy[6] = y[1], y[3], y[5], y[7]
    dy[1] = (motor - shaft_1) / r.j_motor
    dy[3] = (shaft_1 + d1 + b1) / r.j_pinion
    dy[5] = (d2 + b2 - shaft_2) / r.j_wheel
    dy[7] = (shaft_2 - load) / r.j_load
    out[0], out[1], out[2] = y[2], y[3], dy[3]
    out[3], out[4], out[5] = y[4], y[5], dy[5]
    out[6], out[7] = shaft_1, drive - back


@njit(cache=True, nogil=True, error_model="numpy")
def march(r, y, errors_1, errors_2, n_samples, interval, longest_step):
    """Run with the classical Runge–Kutta method from state y; return (n_samples, N_OUT)."""
    n_steps = ceil(interval / longest_step)
    h = interval / n_steps
    rows = np.empty((n_samples, N_OUT))
    slopes, at, out = np.empty((4, N_STATES)), np.empty(N_STATES), np.empty(N_OUT)
    for sample in range(n_samples):
        t = sample * interval
        _rates(r, t, y, errors_1, errors_2, slopes[0], rows[sample])
        for i in range(n_steps):
            s = t + i * h
            _rates(r, s, y, errors_1, errors_2, slopes[0], out)
            for stage in range(1, 4):
                ahead = h if stage == 3 else 0.5 * h
                for m in range(N_STATES):
                    at[m] = y[m] + ahead * slopes[stage - 1, m]
                _rates(r, s + ahead, at, errors_1, errors_2, slopes[stage], out)
            for m in range(N_STATES):
                y[m] += h / 6.0 * (slopes[0, m] + 2.0 * slopes[1, m] + 2.0 * slopes[2, m] + slopes[3, m])
    return rows
