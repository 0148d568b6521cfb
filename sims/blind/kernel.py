"""The compiled march: exact steps of the modes, the mesh force by Newton's method at each new point."""

from __future__ import annotations

from math import cos, sin, sqrt

import numpy as np
from numba import njit

N_OUT = 11
"""Bearing forces x1 y1 x2 y2, casing accelerations x y rocking, θ1, θ2, line-of-action compression, mesh force."""
# Places in `number`, the vector of single values.
(
    RB_1, RB_2, LINE_X, LINE_Y, BASE_PITCH, CONTACT_RATIO, RHO_START, RHO_SUM, SOFT_M, BACKLASH_M, MESH_DAMPING,
    BACK_STIFFNESS, LOAD_NM, LOAD_SLOPE, MOTOR_NM, MOTOR_GAIN, LINE_INERTIA, WEDGE_M, GRID_S, OMEGA_1, OMEGA_2,
    CAGE_RATIO_1, CAGE_RATIO_2, N_BALLS_1, N_BALLS_2, BALL_RIPPLE, PHASE_2, SEAT_1, SEAT_2, HEIGHT,
    MOTOR_MEMORY,
) = range(31)  # fmt: skip
N_NUMBERS = 31


@njit(cache=True)
def soft(x: float, h: float) -> tuple[float, float]:
    """Compression law √(x² + h²) − h for x > 0 and its slope: soft at first touch, then straight."""
    if x <= 0.0:
        return 0.0, 0.0
    root = sqrt(x * x + h * h)
    return root - h, x / root


@njit(cache=True)
def mesh_force(
    force: float, gamma: float, gamma_v: float, x: float, v: float, n_pairs: int, gaps: np.ndarray,
    stiffness: np.ndarray, h: float, damping: float, backlash: float, back: float, loads: np.ndarray,
) -> float:  # fmt: skip
    """Solve F = Σ F_i(x − γF, v − γ_v F) by Newton's method from `force`; `loads` receives the pairs' forces.

    F_i = k_i s(x − E_i) + c k_i s' v, never a pull; the back flanks carry as one pair.
    """
    for _ in range(8):
        now, speed = x - gamma * force, v - gamma_v * force
        total, slope = 0.0, 0.0
        for i in range(n_pairs):
            squeeze, rate = soft(now - gaps[i], h)
            carried = stiffness[i] * (squeeze + damping * rate * speed)
            if carried > 0.0:
                loads[i] = carried
                total += carried
                slope += stiffness[i] * rate * (gamma + damping * gamma_v)
            else:
                loads[i] = 0.0
        squeeze, rate = soft(-now - backlash, h)
        carried = back * (squeeze - damping * rate * speed)
        if carried > 0.0:
            total -= carried
            slope += back * rate * (gamma + damping * gamma_v)
        miss = force - total
        force -= miss / (1.0 + slope)
        if abs(miss) <= 1e-9 * (abs(force) + 1.0):
            break
    return force


@njit(cache=True)
def train_forces(
    angle: float, omega: float, width_s: float, starts: np.ndarray, forces: np.ndarray, pointer: int
) -> tuple[float, int]:
    """Half-sine pulses that begin at given shaft angles; returns the force now and the pulse in hand."""
    while pointer + 1 < starts.shape[0] and starts[pointer + 1] <= angle:
        pointer += 1
    since = (angle - starts[pointer]) / omega
    if 0.0 <= since < width_s:
        return forces[pointer] * sin(np.pi * since / width_s), pointer
    return 0.0, pointer


@njit(cache=True)
def march(
    n_out: int, n_before: int, stride: int, step_s: float, number: np.ndarray, steps: np.ndarray, shapes: np.ndarray,
    seen: np.ndarray, omega: np.ndarray, zeta: np.ndarray, q: np.ndarray, p: np.ndarray, steady: np.ndarray,
    bearing_k: np.ndarray, clearance: np.ndarray, gap_0: np.ndarray, pair_k: np.ndarray, slip: np.ndarray,
    gap_1: np.ndarray, gap_2: np.ndarray, soft_1: np.ndarray, soft_2: np.ndarray, reach: float, offsets: np.ndarray,
    runout: np.ndarray, wobble: np.ndarray, torque: np.ndarray, sway: np.ndarray, unbalance: np.ndarray,
    speed: np.ndarray, train_start: np.ndarray, train_force: np.ndarray, train_turn: np.ndarray, train_kind: np.ndarray,
    train_width: np.ndarray,
) -> np.ndarray:  # fmt: skip
    """March from modal state `q`, `p`; every `stride` steps a row of `N_OUT` values, after `n_before` rows unkept.

    Rows of `runout`, `wobble`, `torque`, `sway`: shaft (0, 1), order, amplitude, phase; `sway` has bearing and direction
    besides. `speed`: reference speed and its rate of change of the motor every GRID_S.
    """
    n = omega.shape[0]
    out = np.empty((n_out, N_OUT))
    f, f_new = np.zeros(n), np.zeros(n)
    q_new, p_new = np.zeros(n), np.zeros(n)
    u, v, physical = np.zeros(seen.shape[0]), np.zeros(seen.shape[0]), np.zeros(n)
    gaps, stiff, loads, slips, rhos = np.zeros(6), np.zeros(6), np.zeros(6), np.zeros(6), np.zeros(6)
    held = np.zeros(4)
    pointers = np.zeros(train_start.shape[0], dtype=np.int64)
    gamma, gamma_v = 0.0, 0.0
    for m in range(n):
        gamma += steps[5, m] * seen[0, m] ** 2
        gamma_v += steps[7, m] * seen[0, m] ** 2
    z1, z2, n_path = gap_1.shape[0], gap_2.shape[0], gap_0.shape[0]
    pb, ratio = number[BASE_PITCH], number[CONTACT_RATIO]
    per_place = (n_path - 1) / (ratio + 2.0 * reach)
    force, behind, n_steps = 0.0, 0.0, (n_before + n_out) * stride
    for step in range(n_steps + 1):
        # What the forces depend on, at the new point with the forces held.
        for m in range(n):
            if step == 0:
                q_new[m], p_new[m] = q[m], p[m]
            else:
                q_new[m] = steps[0, m] * q[m] + steps[1, m] * p[m] + (steps[4, m] + steps[5, m]) * f[m]
                p_new[m] = steps[2, m] * q[m] + steps[3, m] * p[m] + (steps[6, m] + steps[7, m]) * f[m]
        for r in range(seen.shape[0]):
            a, b = 0.0, 0.0
            for m in range(n):
                a += seen[r, m] * q_new[m]
                b += seen[r, m] * p_new[m]
            u[r], v[r] = a, b
        time = step * step_s
        theta_1, theta_2 = u[1], u[2] + number[PHASE_2]
        # Drive: a motor that follows its reference speed; a load that rises with speed.
        at = time / number[GRID_S]
        cell = min(int(at), speed.shape[0] - 2)
        part = at - cell
        wanted = speed[cell, 0] + part * (speed[cell + 1, 0] - speed[cell, 0])
        gain = speed[cell, 1] + part * (speed[cell + 1, 1] - speed[cell, 1])
        for m in range(n):
            physical[m] = steady[m]
        behind += (wanted - v[7]) * step_s
        physical[0] += number[MOTOR_NM] + number[LINE_INERTIA] * gain
        physical[0] += number[MOTOR_GAIN] * (wanted - v[7] + behind * number[MOTOR_MEMORY])
        physical[3] -= number[LOAD_NM] + number[LOAD_SLOPE] * (v[8] - number[OMEGA_2])
        for r in range(torque.shape[0]):
            if torque[r, 0] == 0.0:
                physical[0] += torque[r, 2] * cos(torque[r, 1] * u[7] + torque[r, 3])
            else:
                physical[3] += torque[r, 2] * cos(torque[r, 1] * u[8] + torque[r, 3])
        # Bearings: the linear spring is in the modes; what clearance takes from it is given back here.
        for i in range(2):
            dx, dy = u[3 + 2 * i], u[4 + 2 * i]
            r = sqrt(dx * dx + dy * dy) + 1e-15
            turn = theta_1 * number[CAGE_RATIO_1] if i == 0 else theta_2 * number[CAGE_RATIO_2]
            balls = number[N_BALLS_1] if i == 0 else number[N_BALLS_2]
            loose = clearance[i] * (1.0 + number[BALL_RIPPLE] * cos(balls * turn))
            share = (sqrt(r * r + loose * loose) - loose) / r
            held[2 * i], held[2 * i + 1] = bearing_k[i, 0] * dx * share, bearing_k[i, 1] * dy * share
            push_x, push_y = bearing_k[i, 0] * dx - held[2 * i], bearing_k[i, 1] * dy - held[2 * i + 1]
            theta, whirl, sense = (theta_1, number[OMEGA_1], 1.0) if i == 0 else (theta_2, number[OMEGA_2], -1.0)
            out_of_balance = unbalance[i, 0] * whirl * whirl
            physical[4 + 2 * i] += push_x + out_of_balance * cos(theta + unbalance[i, 1])
            physical[5 + 2 * i] += push_y + sense * out_of_balance * sin(theta + unbalance[i, 1])
            physical[8] -= push_x
            physical[9] -= push_y
            physical[10] += push_x * number[HEIGHT] - push_y * number[SEAT_1 + i]
        for r in range(sway.shape[0]):
            theta = theta_1 if sway[r, 0] == 0.0 else theta_2
            push = sway[r, 2] * cos(sway[r, 1] * theta + sway[r, 3])
            rotor = 4 + 2 * int(sway[r, 0])
            physical[rotor] += push * cos(sway[r, 4])
            physical[rotor + 1] += push * sin(sway[r, 4])
        for r in range(train_start.shape[0]):
            on_first = train_kind[r, 0] == 0.0
            push, pointers[r] = train_forces(
                theta_1 if on_first else theta_2, number[OMEGA_1] if on_first else number[OMEGA_2], train_width[r],
                train_start[r], train_force[r], pointers[r],
            )  # fmt: skip
            if push == 0.0:
                continue
            if train_kind[r, 1] == 2.0:  # torque: on the motor, or on the load
                physical[0 if on_first else 3] += push
                continue
            body = int(train_kind[r, 1])
            way = train_turn[r, pointers[r]]
            push_x, push_y = push * cos(way), push * sin(way)
            held[2 * body] += push_x
            held[2 * body + 1] += push_y
            physical[4 + 2 * body] -= push_x
            physical[5 + 2 * body] -= push_y
            physical[8] += push_x
            physical[9] += push_y
            physical[10] += push_y * number[SEAT_1 + body] - push_x * number[HEIGHT]
        # Teeth in reach and their gaps.
        shift = 0.0
        for r in range(runout.shape[0]):
            theta = theta_1 if runout[r, 0] == 0.0 else theta_2
            shift += runout[r, 2] * cos(runout[r, 1] * theta + runout[r, 3])
        wedge = number[WEDGE_M]
        for r in range(wobble.shape[0]):
            theta = theta_1 if wobble[r, 0] == 0.0 else theta_2
            wedge += wobble[r, 2] * cos(wobble[r, 1] * theta + wobble[r, 3])
        h = number[SOFT_M] + 0.5 * abs(wedge)
        cycle = number[RB_1] * theta_1 / pb
        first, last = int(np.ceil(cycle - ratio - reach)), int(np.floor(cycle + reach))
        n_pairs = 0
        for j in range(first, last + 1):
            spot = (cycle - j + reach) * per_place
            i = int(spot)
            if i < 0 or i >= n_path - 1:
                continue
            w = spot - i
            t1, t2 = (j + offsets[0]) % z1, (j + offsets[1]) % z2
            gaps[n_pairs] = (
                (1.0 - w) * (gap_0[i] + gap_1[t1, i] + gap_2[t2, i])
                + w * (gap_0[i + 1] + gap_1[t1, i + 1] + gap_2[t2, i + 1]) + shift
            )  # fmt: skip
            weak = (1.0 - w) * (soft_1[t1, i] + soft_2[t2, i]) + w * (soft_1[t1, i + 1] + soft_2[t2, i + 1])
            stiff[n_pairs] = ((1.0 - w) * pair_k[i] + w * pair_k[i + 1]) / (1.0 + weak)
            slips[n_pairs] = (1.0 - w) * slip[i] + w * slip[i + 1]
            rhos[n_pairs] = number[RHO_START] + (cycle - j) * pb
            n_pairs += 1
        # Everything but the mesh is known now; its force follows from the compression it leaves.
        x_free, v_free = u[0], v[0]
        for m in range(n):
            a = 0.0
            for d in range(n):
                a += shapes[d, m] * physical[d]
            f_new[m] = a
            x_free += seen[0, m] * steps[5, m] * (a - f[m])
            v_free += seen[0, m] * steps[7, m] * (a - f[m])
        if step == 0:
            force = mesh_force(
                0.0, 0.0, 0.0, u[0], v[0], n_pairs, gaps, stiff, h, number[MESH_DAMPING], number[BACKLASH_M],
                number[BACK_STIFFNESS], loads,
            )  # fmt: skip
        else:
            force = mesh_force(
                force, gamma, gamma_v, x_free, v_free, n_pairs, gaps, stiff, h, number[MESH_DAMPING],
                number[BACKLASH_M], number[BACK_STIFFNESS], loads,
            )  # fmt: skip
        side, torque_1, torque_2 = 0.0, 0.0, 0.0
        for i in range(n_pairs):
            rub = slips[i] * loads[i]
            side += rub
            torque_1 += rub * rhos[i]
            torque_2 -= rub * (number[RHO_SUM] - rhos[i])
        for m in range(n):
            f_new[m] += (
                -seen[0, m] * force + shapes[1, m] * torque_1 + shapes[2, m] * torque_2
                + side * (number[LINE_Y] * (shapes[6, m] - shapes[4, m]) - number[LINE_X] * (shapes[7, m] - shapes[5, m]))
            )  # fmt: skip
            if step > 0:
                q_new[m] += steps[5, m] * (f_new[m] - f[m])
                p_new[m] += steps[7, m] * (f_new[m] - f[m])
        for m in range(n):
            q[m], p[m], f[m] = q_new[m], p_new[m], f_new[m]
        if step > 0 and step % stride == 0 and step // stride > n_before:
            row = step // stride - n_before - 1
            x_c, y_c, rock, t1_now, t2_now, squeeze_now = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
            for m in range(n):
                rate = f[m] - 2.0 * zeta[m] * omega[m] * p[m] - omega[m] ** 2 * q[m]
                x_c += shapes[8, m] * rate
                y_c += shapes[9, m] * rate
                rock += shapes[10, m] * rate
                t1_now += seen[1, m] * q[m]
                t2_now += seen[2, m] * q[m]
                squeeze_now += seen[0, m] * q[m]
            for i in range(4):
                out[row, i] = held[i]
            out[row, 4], out[row, 5], out[row, 6] = x_c, y_c, rock
            out[row, 7], out[row, 8], out[row, 9], out[row, 10] = t1_now, t2_now, squeeze_now, force
    return out
