"""Compiled: the classic Runge–Kutta method of fourth order at a fixed step, for the sixteen coordinates."""

# mypy: allow-untyped-defs, allow-untyped-calls
from __future__ import annotations

from math import cos, sin

import numpy as np
from numba import njit

from sims.cracked.energy_kernel import kinetic_energy, place_of_entry, potential_energy
from sims.cracked.right_hand_side import accelerations
from sims.machine.course_kernel import course_value, set_speed
from sims.mesh.roughness_kernel import advance, height_now


@njit(cache=True, nogil=True, error_model="numpy")
def integrate(  # noqa: PLR0915  four stages written out
    k, curves, rows, pitch, q, v, set_angle, start, step, n_steps, stride, speed, torque, rough, select, found, energies
):
    """Run `n_steps` steps from time `start`; fill `found` with the selected signals at every `stride`-th step.

    k, curves, rows, pitch : see `sims.cracked.constants`.
    q, v, set_angle : (16,), (16,), (1,); left at the last step's state, for the next call to go on from.
    speed, torque : (2, n) times and values of the set courses, in rad/s and N m.
    rough : phasors of a roughness locked to time at `start`, stepped by half of `step`, left at the end; see
        `TimeLockedRoughness`.
    select : places of the wanted signals in `sims.cracked.layout.SIGNALS`.
    found : (n_out, n_selected).
    energies : (n_out,) or (0,): total energy in J, not computed where empty.
    Returns the number of rows that were filled: fewer where the state is no longer finite.
    """
    re, im, omega, half_cos, half_sin = rough
    a = np.empty(16)
    extra = np.empty(5)
    q1, v1 = np.empty(16), np.empty(16)
    sum_q, sum_v = np.empty(16), np.empty(16)
    signals = np.empty(53)
    n_rows = 0
    h0, r0 = height_now(re, im, omega)
    angle = set_angle[0]
    for step_number in range(n_steps):
        t = start + step_number * step
        w0, d0 = set_speed(k, speed, t)
        wh, dh = set_speed(k, speed, t + 0.5 * step)
        w1, d1 = set_speed(k, speed, t + step)
        # The set angle by Simpson's rule, and by the parabola through the same three speeds half way.
        angle_h = angle + step / 24.0 * (5.0 * w0 + 8.0 * wh - w1)
        angle_1 = angle + step / 6.0 * (w0 + 4.0 * wh + w1)
        m0, mh, m1 = course_value(torque, t), course_value(torque, t + 0.5 * step), course_value(torque, t + step)
        advance(re, im, half_cos, half_sin)
        hh, rh = height_now(re, im, omega)
        advance(re, im, half_cos, half_sin)
        h1, r1 = height_now(re, im, omega)
        accelerations(k, curves, rows, pitch, q, v, m0, angle, w0, d0, h0, r0, a, extra)
        if step_number % stride == 0:
            for i in range(16):
                signals[i], signals[16 + i], signals[32 + i] = q[i], v[i], a[i]
            for i in range(5):
                signals[48 + i] = extra[i]
            for i in range(select.shape[0]):
                found[n_rows, i] = signals[select[i]]
            if energies.shape[0] > 0:
                late, turned = place_of_entry(k, q)
                energies[n_rows] = potential_energy(k, curves, rows, pitch, q, late, turned, h0)
                energies[n_rows] += kinetic_energy(k, v, q)
            if not np.isfinite(a[1] + a[5] + a[7] + a[2]):
                return n_rows
            n_rows += 1
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
    """Fill `rate` (32) with the derivative of `state` (q, v) at any time t: for other integrators and checks.

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
        course_value(torque, t),
        angle,
        w,
        d,
        height,
        height_rate,
        rate[16:],
        extra,
    )
    rate[:16] = state[16:]
    return extra
