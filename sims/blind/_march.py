"""Compiled time integration: exact steps of the modes, with the mesh force by Newton's method at each point."""

from __future__ import annotations

from math import cos, sin, sqrt
from typing import Any

import numpy as np
from numba import njit

from sims.blind._rig import REACH

# --------------------
# Single values for the compiled integration; those of both gears, or of both shafts' bearings, in pairs.
# --------------------

NUMBERS = np.dtype(
    [
        (name, np.float64)
        for name in (
            *("base_pitch", "contact_ratio", "rho_start", "rho_sum", "end_a", "end_e", "phase_2", "line_x", "line_y"),
            *("soft_m", "backlash_m", "wedge_m", "mesh_damping", "back_stiffness", "ball_ripple", "height"),
            *("load_nm", "load_slope", "motor_nm", "motor_gain", "motor_memory", "line_inertia", "grid_s"),
        )
    ]
    + [(name, np.float64, (2,)) for name in ("rb", "omega", "cage_ratio", "n_balls", "seat")]
)

# --------------------
# The compiled mesh: pairs in reach, their gaps, and the force by Newton's method.
# --------------------


GAP, STIFFNESS, SLIP, RHO, CARRIED = range(5)
"""Columns of the pairs in reach."""
MAX_PAIRS = 6
Tables = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]


@njit(cache=True)
def soft(x: float, h: float) -> tuple[float, float]:
    """Compression law √(x² + h²) − h for x > 0 and its slope: soft at first touch, then linear."""
    if x <= 0.0:
        return 0.0, 0.0
    root = sqrt(x * x + h * h)
    return root - h, x / root


@njit(cache=True)
def _at(table: np.ndarray, spot: float) -> float:
    """Interpolate linearly in a table, constant beyond its ends."""
    spot = min(max(spot, 0.0), table.shape[0] - 1.001)
    i = int(spot)
    return float(table[i] + (spot - i) * (table[i + 1] - table[i]))


@njit(cache=True)
def pairs_in_reach(
    pairs: np.ndarray,
    number: Any,
    theta_1: float,
    shift: float,
    opening: float,
    offsets: np.ndarray,
    tables: Tables,
) -> int:
    """Fill gap, stiffness, friction and radius of curvature of all pairs that may be in contact; return their number.

    `shift` is a separation of all teeth by run-out: gear 2 lags by it, and so does the path's start A, which its tips
    determine; the end E belongs to gear 1. `opening` is an increase of the centre distance, which moves both ends.

    Pair j is at r_b1 θ1 / p_b − j on the path; a pair with 1 + w times the healthy compliance has 1/(1 + w) of the
    stiffness.
    """
    gap_0, pair_k, slip, gap_1, gap_2, weak_1, weak_2 = tables
    z1, z2, n_path = gap_1.shape[0], gap_2.shape[0], gap_0.shape[0]
    pb, ratio = number.base_pitch, number.contact_ratio
    per_place = (n_path - 1) / (ratio + 2.0 * REACH)
    cycle = number.rb[0] * theta_1 / pb
    n = 0
    for j in range(int(np.ceil(cycle - ratio - REACH)), int(np.floor(cycle + REACH)) + 1):
        spot = (cycle - j + REACH) * per_place
        i = int(spot)
        if i < 0 or i >= n_path - 1:
            continue
        b = spot - i
        a = 1.0 - b
        t1, t2 = (j + offsets[0]) % z1, (j + offsets[1]) % z2
        moved = opening * number.end_a + shift / pb if cycle - j < 0.5 * ratio else opening * number.end_e
        base = _at(gap_0, spot - moved * per_place)
        weak = a * (weak_1[t1, i] + weak_2[t2, i]) + b * (weak_1[t1, i + 1] + weak_2[t2, i + 1])
        pairs[n, GAP] = base + a * (gap_1[t1, i] + gap_2[t2, i]) + b * (gap_1[t1, i + 1] + gap_2[t2, i + 1])
        pairs[n, STIFFNESS] = (a * pair_k[i] + b * pair_k[i + 1]) / (1.0 + weak)
        pairs[n, SLIP] = a * slip[i] + b * slip[i + 1]
        pairs[n, RHO] = number.rho_start + (cycle - j) * pb
        n += 1
    return n


@njit(cache=True)
def mesh_force(
    force: float, gamma: float, gamma_v: float, x: float, v: float, h: float, n_pairs: int, pairs: np.ndarray,
    number: Any,
) -> float:  # fmt: skip
    """Solve F = Σ F_i(x − γF, v − γ_v F) by Newton's method from `force`; the loads are stored in the pairs.

    F_i = k_i (s(x − E_i) + c s' v), never tensile; the back flanks act as one, at mean stiffness. The run-out, which
    moves both flanks of a tooth, is subtracted from x.
    """
    damping, back = number.mesh_damping, number.back_stiffness
    for _ in range(8):
        now, speed = x - gamma * force, v - gamma_v * force
        total, slope = 0.0, 0.0
        for i in range(n_pairs):
            squeeze, rate = soft(now - pairs[i, GAP], h)
            carried = pairs[i, STIFFNESS] * (squeeze + damping * rate * speed)
            pairs[i, CARRIED] = max(carried, 0.0)
            if carried > 0.0:
                total += carried
                slope += pairs[i, STIFFNESS] * rate * (gamma + damping * gamma_v)
        squeeze, rate = soft(-now - number.backlash_m, h)
        carried = back * (squeeze - damping * rate * speed)
        if carried > 0.0:
            total -= carried
            slope += back * rate * (gamma + damping * gamma_v)
        miss = force - total
        force -= miss / (1.0 + slope)
        if abs(miss) <= 1e-9 * (abs(force) + 1.0):
            break
    return force


# --------------------
# Compiled forces outside the mesh: drive and load, bearings, unbalance, lines and pulses.
# --------------------


ACROSS = 1.22
"""Angle from the line of action to the line of centres, 70°."""
TORQUE = 2.0
"""Kind of a train with torques on a shaft's far end; kinds 0 and 1 are forces on the bearing of that number."""


@njit(cache=True)
def waves(rows: np.ndarray, theta_1: float, theta_2: float) -> float:
    """Sum of amplitude × cos(order θ + phase) over rows of shaft, order, amplitude, phase."""
    total = 0.0
    for r in range(rows.shape[0]):
        theta = theta_1 if rows[r, 0] == 0.0 else theta_2
        total += rows[r, 2] * cos(rows[r, 1] * theta + rows[r, 3])
    return total


@njit(cache=True)
def centre_opening(runout: np.ndarray, theta_1: float, theta_2: float) -> float:
    """Increase of the centre distance by eccentricity: the run-outs of order 1 along the line of centres."""
    total = 0.0
    for r in range(runout.shape[0]):
        if runout[r, 1] == 1.0:
            theta = theta_1 if runout[r, 0] == 0.0 else theta_2
            total += runout[r, 2] * cos(theta + runout[r, 3] + ACROSS)
    return total


@njit(cache=True)
def drive(
    push: np.ndarray, number: Any, u: np.ndarray, v: np.ndarray, time: float, behind: float,
    speed: np.ndarray, torque: np.ndarray,
) -> float:  # fmt: skip
    """Add the torques of the speed-controlled motor and of the load, which rises with speed; return the speed error."""
    at = time / number.grid_s
    cell = min(int(at), speed.shape[0] - 2)
    part = at - cell
    set_speed = speed[cell, 0] + part * (speed[cell + 1, 0] - speed[cell, 0])
    gain = speed[cell, 1] + part * (speed[cell + 1, 1] - speed[cell, 1])
    error = set_speed - v[7]
    push[0] += number.motor_nm + number.line_inertia * gain
    push[0] += number.motor_gain * (error + behind * number.motor_memory)
    push[3] -= number.load_nm + number.load_slope * (v[8] - number.omega[1])
    for r in range(torque.shape[0]):
        place, angle = (0, u[7]) if torque[r, 0] == 0.0 else (3, u[8])
        push[place] += torque[r, 2] * cos(torque[r, 1] * angle + torque[r, 3])
    return float(error)


@njit(cache=True)
def push_rotor(push: np.ndarray, number: Any, body: int, x: float, y: float) -> None:
    """Add a force on a rotor and its reaction on the casing at the bearing's seat."""
    push[4 + 2 * body] += x
    push[5 + 2 * body] += y
    push[8] -= x
    push[9] -= y
    push[10] += x * number.height - y * number.seat[body]


@njit(cache=True)
def bearings(
    push: np.ndarray, held: np.ndarray, number: Any, u: np.ndarray, theta_1: float, theta_2: float,
    bearing_k: np.ndarray, clearance: np.ndarray, unbalance: np.ndarray,
) -> None:  # fmt: skip
    """Add clearance and unbalance; `held` receives the forces on the casing.

    Clearance c, which varies with the passing elements, reduces the linear spring force k r to k (√(r² + c²) − c). The
    linear spring is part of the modes, so the difference is added here.
    """
    for i in range(2):
        theta, omega, sense = (theta_1, number.omega[0], 1.0) if i == 0 else (theta_2, number.omega[1], -1.0)
        dx, dy = u[3 + 2 * i], u[4 + 2 * i]
        r = sqrt(dx * dx + dy * dy) + 1e-15
        passing = cos(number.n_balls[i] * number.cage_ratio[i] * theta)
        loose = clearance[i] * (1.0 + number.ball_ripple * passing)
        share = (sqrt(r * r + loose * loose) - loose) / r
        full_x, full_y = bearing_k[i, 0] * dx, bearing_k[i, 1] * dy
        held[2 * i], held[2 * i + 1] = full_x * share, full_y * share
        push_rotor(push, number, i, full_x * (1.0 - share), full_y * (1.0 - share))
        whirl = unbalance[i, 0] * omega * omega
        push[4 + 2 * i] += whirl * cos(theta + unbalance[i, 1])
        push[5 + 2 * i] += sense * whirl * sin(theta + unbalance[i, 1])


@njit(cache=True)
def sways(push: np.ndarray, rows: np.ndarray, theta_1: float, theta_2: float) -> None:
    """Add external forces on rotors, from rows of shaft, order, amplitude, phase, direction."""
    for r in range(rows.shape[0]):
        force = waves(rows[r : r + 1], theta_1, theta_2)
        rotor = 4 + 2 * int(rows[r, 0])
        push[rotor] += force * cos(rows[r, 4])
        push[rotor + 1] += force * sin(rows[r, 4])


@njit(cache=True)
def pulse(
    angle: float, omega: float, width_s: float, starts: np.ndarray, forces: np.ndarray, pointer: int
) -> tuple[float, int]:
    """Half-sine pulses that start at given shaft angles; return the present force and the index of the pulse."""
    while pointer + 1 < starts.shape[0] and starts[pointer + 1] <= angle:
        pointer += 1
    since = (angle - starts[pointer]) / omega
    if 0.0 <= since < width_s:
        return forces[pointer] * sin(np.pi * since / width_s), pointer
    return 0.0, pointer


@njit(cache=True)
def trains(
    push: np.ndarray, held: np.ndarray, number: Any, theta_1: float, theta_2: float, pointers: np.ndarray,
    all_trains: tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray],
) -> None:  # fmt: skip
    """Add pulses at shaft angles: torques, or forces between a rotor and the casing."""
    starts, forces, turns, kinds, widths_s = all_trains
    for r in range(starts.shape[0]):
        on_first = kinds[r, 0] == 0.0
        theta, omega = (theta_1, number.omega[0]) if on_first else (theta_2, number.omega[1])
        force, pointers[r] = pulse(theta, omega, widths_s[r], starts[r], forces[r], pointers[r])
        if force == 0.0:
            continue
        if kinds[r, 1] == TORQUE:
            push[0 if on_first else 3] += force
            continue
        body, way = int(kinds[r, 1]), turns[r, pointers[r]]
        x, y = force * cos(way), force * sin(way)
        held[2 * body] += x
        held[2 * body + 1] += y
        push_rotor(push, number, body, -x, -y)


N_OUT = 11
"""Bearing forces x1 y1 x2 y2, casing accelerations x y rocking, θ1, θ2, line-of-action compression, mesh force."""
Modal = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]
Lines = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]
Supports = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]
Trains = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]


@njit(cache=True)
def predict(
    steps: np.ndarray, q: np.ndarray, p: np.ndarray, f: np.ndarray, q_new: np.ndarray, p_new: np.ndarray
) -> None:
    """Step each mode with constant force."""
    for m in range(q.shape[0]):
        q_new[m] = steps[0, m] * q[m] + steps[1, m] * p[m] + (steps[4, m] + steps[5, m]) * f[m]
        p_new[m] = steps[2, m] * q[m] + steps[3, m] * p[m] + (steps[6, m] + steps[7, m]) * f[m]


@njit(cache=True)
def look(outputs: np.ndarray, q: np.ndarray, p: np.ndarray, u: np.ndarray, v: np.ndarray) -> None:
    """Fill the displacements and velocities on which the forces depend."""
    for r in range(outputs.shape[0]):
        a, b = 0.0, 0.0
        for m in range(q.shape[0]):
            a += outputs[r, m] * q[m]
            b += outputs[r, m] * p[m]
        u[r], v[r] = a, b


@njit(cache=True)
def add_mesh(
    f: np.ndarray,
    force: float,
    n_pairs: int,
    pairs: np.ndarray,
    number: Any,
    shapes: np.ndarray,
    outputs: np.ndarray,
) -> None:
    """Add mesh force and friction to the modal forces; friction acts across the line of action, with its levers."""
    side, torque_1, torque_2 = 0.0, 0.0, 0.0
    for i in range(n_pairs):
        rub = pairs[i, SLIP] * pairs[i, CARRIED]
        side += rub
        torque_1 += rub * pairs[i, RHO]
        torque_2 -= rub * (number.rho_sum - pairs[i, RHO])
    off_x, off_y = side * number.line_y, -side * number.line_x
    for m in range(f.shape[0]):
        f[m] += shapes[1, m] * torque_1 + shapes[2, m] * torque_2 - outputs[0, m] * force
        f[m] += off_x * (shapes[6, m] - shapes[4, m]) + off_y * (shapes[7, m] - shapes[5, m])


@njit(cache=True)
def keep(
    row: np.ndarray, held: np.ndarray, force: float, modal: Modal, q: np.ndarray, p: np.ndarray, f: np.ndarray
) -> None:
    """Fill one row of the output."""
    _, shapes, outputs, omega, zeta = modal
    row[0], row[1], row[2], row[3] = held[0], held[1], held[2], held[3]
    row[4:10] = 0.0
    row[10] = force
    for m in range(q.shape[0]):
        rate = f[m] - 2.0 * zeta[m] * omega[m] * p[m] - omega[m] ** 2 * q[m]
        for i in range(3):
            row[4 + i] += shapes[8 + i, m] * rate
        row[7] += outputs[1, m] * q[m]
        row[8] += outputs[2, m] * q[m]
        row[9] += outputs[0, m] * q[m]


@njit(cache=True)
def march(
    n_out: int, n_before: int, stride: int, step_s: float, number: Any, modal: Modal, q: np.ndarray,
    p: np.ndarray, supports: Supports, tables: Tables, offsets: np.ndarray, lines: Lines, speed: np.ndarray,
    all_trains: Trains,
) -> np.ndarray:  # fmt: skip
    """Integrate from modal state `q`, `p`; return a row of `N_OUT` values every `stride` steps, after `n_before` rows.

    `modal`: step coefficients, shapes, outputs, ω, ζ. `supports`: steady forces, bearings, clearance, unbalance.
    `lines`: run-out, wobble, torque, sway, rows of shaft, order, amplitude, phase (and direction). `speed`: reference
    speed of the motor and its rate of change.
    """
    steps, shapes, outputs, _, _ = modal
    steady, bearing_k, clearance, unbalance = supports
    runout, wobble, torque, sway = lines
    n, n_outputs = shapes.shape[0], outputs.shape[0]
    out = np.empty((n_out, N_OUT))
    f, f_new, q_new, p_new, push = np.zeros(n), np.zeros(n), q.copy(), p.copy(), np.zeros(n)
    u, v, held, pairs = np.zeros(n_outputs), np.zeros(n_outputs), np.zeros(4), np.zeros((MAX_PAIRS, 5))
    pointers = np.zeros(all_trains[0].shape[0], dtype=np.int64)
    gamma, gamma_v = (outputs[0] ** 2 * steps[5]).sum(), (outputs[0] ** 2 * steps[7]).sum()
    force, behind = 0.0, 0.0
    for step in range((n_before + n_out) * stride + 1):
        if step > 0:
            predict(steps, q, p, f, q_new, p_new)
        look(outputs, q_new, p_new, u, v)
        # The offset of the first tooth rotates the driven shaft as a whole, from the gear to the brake.
        u[2] += number.phase_2
        u[8] += number.phase_2
        theta_1, theta_2 = u[1], u[2]
        for m in range(n):
            push[m] = steady[m]
        behind += step_s * drive(push, number, u, v, step * step_s, behind, speed, torque)
        bearings(push, held, number, u, theta_1, theta_2, bearing_k, clearance, unbalance)
        sways(push, sway, theta_1, theta_2)
        trains(push, held, number, theta_1, theta_2, pointers, all_trains)
        shift, opening = waves(runout, theta_1, theta_2), centre_opening(runout, theta_1, theta_2)
        h = number.soft_m + 0.5 * abs(number.wedge_m + waves(wobble, theta_1, theta_2))
        n_pairs = pairs_in_reach(pairs, number, theta_1, shift, opening, offsets, tables)
        # All other forces are known now; the mesh force follows from the resulting compression.
        x_free, v_free = u[0], v[0]
        for m in range(n):
            a = 0.0
            for d in range(n):
                a += shapes[d, m] * push[d]
            f_new[m] = a
            if step > 0:
                x_free += outputs[0, m] * steps[5, m] * (a - f[m])
                v_free += outputs[0, m] * steps[7, m] * (a - f[m])
        first = 1.0 if step > 0 else 0.0
        force = mesh_force(force, first * gamma, first * gamma_v, x_free - shift, v_free, h, n_pairs, pairs, number)
        add_mesh(f_new, force, n_pairs, pairs, number, shapes, outputs)
        for m in range(n):
            if step > 0:
                q_new[m] += steps[5, m] * (f_new[m] - f[m])
                p_new[m] += steps[7, m] * (f_new[m] - f[m])
            q[m], p[m], f[m] = q_new[m], p_new[m], f_new[m]
        if step % stride == 0 and step // stride > n_before:
            row = out[step // stride - n_before - 1]
            keep(row, held, force, modal, q, p, f)
            row[8] += number.phase_2
    return out
