"""The compiled march: exact steps of the modes, the mesh force by Newton's method at each new point."""

from __future__ import annotations

import numpy as np
from numba import njit

from sims.blind.forces_kernel import bearings, centre_opening, drive, sways, trains, waves
from sims.blind.march_numbers import LINE_X, LINE_Y, PHASE_2, RHO_SUM, SOFT_M, WEDGE_M
from sims.blind.mesh_kernel import CARRIED, MOST_PAIRS, RHO, SLIP, Tables, mesh_force, pairs_in_reach

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
    """Step each mode with its force held."""
    for m in range(q.shape[0]):
        q_new[m] = steps[0, m] * q[m] + steps[1, m] * p[m] + (steps[4, m] + steps[5, m]) * f[m]
        p_new[m] = steps[2, m] * q[m] + steps[3, m] * p[m] + (steps[6, m] + steps[7, m]) * f[m]


@njit(cache=True)
def look(seen: np.ndarray, q: np.ndarray, p: np.ndarray, u: np.ndarray, v: np.ndarray) -> None:
    """Displacements and velocities that the forces depend on."""
    for r in range(seen.shape[0]):
        a, b = 0.0, 0.0
        for m in range(q.shape[0]):
            a += seen[r, m] * q[m]
            b += seen[r, m] * p[m]
        u[r], v[r] = a, b


@njit(cache=True)
def add_mesh(
    f: np.ndarray,
    force: float,
    n_pairs: int,
    pairs: np.ndarray,
    number: np.ndarray,
    shapes: np.ndarray,
    seen: np.ndarray,
) -> None:
    """Add mesh force and friction to the modal forces: friction pushes off the line of action, with its levers."""
    side, torque_1, torque_2 = 0.0, 0.0, 0.0
    for i in range(n_pairs):
        rub = pairs[i, SLIP] * pairs[i, CARRIED]
        side += rub
        torque_1 += rub * pairs[i, RHO]
        torque_2 -= rub * (number[RHO_SUM] - pairs[i, RHO])
    off_x, off_y = side * number[LINE_Y], -side * number[LINE_X]
    for m in range(f.shape[0]):
        f[m] += shapes[1, m] * torque_1 + shapes[2, m] * torque_2 - seen[0, m] * force
        f[m] += off_x * (shapes[6, m] - shapes[4, m]) + off_y * (shapes[7, m] - shapes[5, m])


@njit(cache=True)
def keep(
    row: np.ndarray, held: np.ndarray, force: float, modal: Modal, q: np.ndarray, p: np.ndarray, f: np.ndarray
) -> None:
    """Fill one row of the output."""
    _, shapes, seen, omega, zeta = modal
    row[:4] = held
    row[4:10] = 0.0
    row[10] = force
    for m in range(q.shape[0]):
        rate = f[m] - 2.0 * zeta[m] * omega[m] * p[m] - omega[m] ** 2 * q[m]
        for i in range(3):
            row[4 + i] += shapes[8 + i, m] * rate
        row[7] += seen[1, m] * q[m]
        row[8] += seen[2, m] * q[m]
        row[9] += seen[0, m] * q[m]


@njit(cache=True)
def march(
    n_out: int, n_before: int, stride: int, step_s: float, number: np.ndarray, modal: Modal, q: np.ndarray,
    p: np.ndarray, supports: Supports, tables: Tables, offsets: np.ndarray, lines: Lines, speed: np.ndarray,
    all_trains: Trains,
) -> np.ndarray:  # fmt: skip
    """March from modal state `q`, `p`; every `stride` steps a row of `N_OUT` values, after `n_before` rows unkept.

    `modal`: step coefficients, shapes, seen, ω, ζ. `supports`: steady forces, bearing stiffness, clearance, unbalance.
    `lines`: run-out, wobble, torque, sway, rows of shaft, order, amplitude, phase (and direction). `speed`: reference
    speed of the motor and its rate of change.
    """
    steps, shapes, seen, _, _ = modal
    steady, bearing_k, clearance, unbalance = supports
    runout, wobble, torque, sway = lines
    n, n_seen = shapes.shape[0], seen.shape[0]
    out = np.empty((n_out, N_OUT))
    f, f_new, q_new, p_new, push = np.zeros(n), np.zeros(n), q.copy(), p.copy(), np.zeros(n)
    u, v, held, pairs = np.zeros(n_seen), np.zeros(n_seen), np.zeros(4), np.zeros((MOST_PAIRS, 5))
    pointers = np.zeros(all_trains[0].shape[0], dtype=np.int64)
    gamma, gamma_v = (seen[0] ** 2 * steps[5]).sum(), (seen[0] ** 2 * steps[7]).sum()
    force, behind = 0.0, 0.0
    for step in range((n_before + n_out) * stride + 1):
        if step > 0:
            predict(steps, q, p, f, q_new, p_new)
        look(seen, q_new, p_new, u, v)
        # Turned to the tooth it meets with, the driven shaft is turned as a whole, from the gear to the brake.
        u[2] += number[PHASE_2]
        u[8] += number[PHASE_2]
        theta_1, theta_2 = u[1], u[2]
        push[:] = steady
        behind += step_s * drive(push, number, u, v, step * step_s, behind, speed, torque)
        bearings(push, held, number, u, theta_1, theta_2, bearing_k, clearance, unbalance)
        sways(push, sway, theta_1, theta_2)
        trains(push, held, number, theta_1, theta_2, pointers, all_trains)
        shift, opening = waves(runout, theta_1, theta_2), centre_opening(runout, theta_1, theta_2)
        h = number[SOFT_M] + 0.5 * abs(number[WEDGE_M] + waves(wobble, theta_1, theta_2))
        n_pairs = pairs_in_reach(pairs, number, theta_1, shift, opening, offsets, tables)
        # Everything but the mesh is known now; its force follows from the compression it leaves.
        x_free, v_free = u[0], v[0]
        for m in range(n):
            a = 0.0
            for d in range(n):
                a += shapes[d, m] * push[d]
            f_new[m] = a
            if step > 0:
                x_free += seen[0, m] * steps[5, m] * (a - f[m])
                v_free += seen[0, m] * steps[7, m] * (a - f[m])
        first = 1.0 if step > 0 else 0.0
        force = mesh_force(force, first * gamma, first * gamma_v, x_free - shift, v_free, h, n_pairs, pairs, number)
        add_mesh(f_new, force, n_pairs, pairs, number, shapes, seen)
        for m in range(n):
            if step > 0:
                q_new[m] += steps[5, m] * (f_new[m] - f[m])
                p_new[m] += steps[7, m] * (f_new[m] - f[m])
            q[m], p[m], f[m] = q_new[m], p_new[m], f_new[m]
        if step % stride == 0 and step // stride > n_before:
            row = out[step // stride - n_before - 1]
            keep(row, held, force, modal, q, p, f)
            row[8] += number[PHASE_2]
    return out
