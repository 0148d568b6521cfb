"""Compiled forces outside the mesh: drive and load, bearings, unbalance, lines and pulses."""

from __future__ import annotations

from math import cos, sin, sqrt

import numpy as np
from numba import njit

from sims.blind.march_numbers import (
    BALL_RIPPLE,
    CAGE_RATIO_1,
    GRID_S,
    HEIGHT,
    LINE_INERTIA,
    LOAD_NM,
    LOAD_SLOPE,
    MOTOR_GAIN,
    MOTOR_MEMORY,
    MOTOR_NM,
    N_BALLS_1,
    OMEGA_1,
    OMEGA_2,
    SEAT_1,
)

ACROSS = 1.22
"""Angle from the line of action to the line of centres, 70°."""
TORQUE = 2.0
"""Kind of a train that twists a shaft's far end; 0 and 1 push the bearing of that number."""


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
    """Growth of the centre distance by eccentricity: the run-outs of order 1, seen across the line of action."""
    total = 0.0
    for r in range(runout.shape[0]):
        if runout[r, 1] == 1.0:
            theta = theta_1 if runout[r, 0] == 0.0 else theta_2
            total += runout[r, 2] * cos(theta + runout[r, 3] + ACROSS)
    return total


@njit(cache=True)
def drive(
    push: np.ndarray, number: np.ndarray, u: np.ndarray, v: np.ndarray, time: float, behind: float,
    speed: np.ndarray, torque: np.ndarray,
) -> float:  # fmt: skip
    """Add the motor that follows its reference speed and the load that rises with speed; return the speed error."""
    at = time / number[GRID_S]
    cell = min(int(at), speed.shape[0] - 2)
    part = at - cell
    wanted = speed[cell, 0] + part * (speed[cell + 1, 0] - speed[cell, 0])
    gain = speed[cell, 1] + part * (speed[cell + 1, 1] - speed[cell, 1])
    error = wanted - v[7]
    push[0] += number[MOTOR_NM] + number[LINE_INERTIA] * gain
    push[0] += number[MOTOR_GAIN] * (error + behind * number[MOTOR_MEMORY])
    push[3] -= number[LOAD_NM] + number[LOAD_SLOPE] * (v[8] - number[OMEGA_2])
    for r in range(torque.shape[0]):
        place, angle = (0, u[7]) if torque[r, 0] == 0.0 else (3, u[8])
        push[place] += torque[r, 2] * cos(torque[r, 1] * angle + torque[r, 3])
    return float(error)


@njit(cache=True)
def push_rotor(push: np.ndarray, number: np.ndarray, body: int, x: float, y: float) -> None:
    """Add a force on a rotor and its reaction on the casing at the bearing's seat."""
    push[4 + 2 * body] += x
    push[5 + 2 * body] += y
    push[8] -= x
    push[9] -= y
    push[10] += x * number[HEIGHT] - y * number[SEAT_1 + body]


@njit(cache=True)
def bearings(
    push: np.ndarray, held: np.ndarray, number: np.ndarray, u: np.ndarray, theta_1: float, theta_2: float,
    bearing_k: np.ndarray, clearance: np.ndarray, unbalance: np.ndarray,
) -> None:  # fmt: skip
    """Add clearance and unbalance; `held` receives the forces on the casing.

    Clearance c that opens and shuts with the passing elements leaves k (√(r² + c²) − c) of the linear spring k r. That
    spring is in the modes, so what clearance takes from it is given back here.
    """
    for i in range(2):
        theta, omega, sense = (theta_1, number[OMEGA_1], 1.0) if i == 0 else (theta_2, number[OMEGA_2], -1.0)
        dx, dy = u[3 + 2 * i], u[4 + 2 * i]
        r = sqrt(dx * dx + dy * dy) + 1e-15
        passing = cos(number[N_BALLS_1 + i] * number[CAGE_RATIO_1 + i] * theta)
        loose = clearance[i] * (1.0 + number[BALL_RIPPLE] * passing)
        share = (sqrt(r * r + loose * loose) - loose) / r
        full_x, full_y = bearing_k[i, 0] * dx, bearing_k[i, 1] * dy
        held[2 * i], held[2 * i + 1] = full_x * share, full_y * share
        push_rotor(push, number, i, full_x * (1.0 - share), full_y * (1.0 - share))
        whirl = unbalance[i, 0] * omega * omega
        push[4 + 2 * i] += whirl * cos(theta + unbalance[i, 1])
        push[5 + 2 * i] += sense * whirl * sin(theta + unbalance[i, 1])


@njit(cache=True)
def sways(push: np.ndarray, rows: np.ndarray, theta_1: float, theta_2: float) -> None:
    """Add forces on rotors from outside: rows of shaft, order, amplitude, phase, direction."""
    for r in range(rows.shape[0]):
        force = waves(rows[r : r + 1], theta_1, theta_2)
        rotor = 4 + 2 * int(rows[r, 0])
        push[rotor] += force * cos(rows[r, 4])
        push[rotor + 1] += force * sin(rows[r, 4])


@njit(cache=True)
def pulse(
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
def trains(
    push: np.ndarray, held: np.ndarray, number: np.ndarray, theta_1: float, theta_2: float, pointers: np.ndarray,
    all_trains: tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray],
) -> None:  # fmt: skip
    """Add pulses at shaft angles: torques, or forces between a rotor and the casing."""
    starts, forces, turns, kinds, widths_s = all_trains
    for r in range(starts.shape[0]):
        on_first = kinds[r, 0] == 0.0
        theta, omega = (theta_1, number[OMEGA_1]) if on_first else (theta_2, number[OMEGA_2])
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
