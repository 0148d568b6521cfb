"""The structure without its mesh: drive line, two rotors on orthotropic bearings, a casing on its foundation."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh, expm

Matrix = NDArray[np.float64]
MOTOR, GEAR_1, GEAR_2, LOAD, X1, Y1, X2, Y2, XC, YC, ROCK = range(11)
N_DOF = 11
N_SEEN = 9
"""Rows of `Modes.seen`: line-of-action compression, θ1, θ2, bearing 1 x y, bearing 2 x y, motor and load angle."""


@dataclass(frozen=True)
class Parts:
    """Masses, springs and places of one rig, SI units.

    `seat_x_m` are the bearings' horizontal places from the casing's centre, `height_m` theirs above its rocking axis,
    `line_angle` the direction of the line of action against the horizontal.
    """

    inertia_kgm2: tuple[float, float, float, float]
    rotor_mass_kg: tuple[float, float]
    casing_mass_kg: float
    casing_inertia_kgm2: float
    shaft_nm_per_rad: tuple[float, float]
    bearing_n_per_m: tuple[tuple[float, float], tuple[float, float]]
    foundation_n_per_m: tuple[float, float]
    rocking_nm_per_rad: float
    base_radii_m: tuple[float, float]
    line_angle: float
    seat_x_m: tuple[float, float]
    height_m: float
    damping_ratios: tuple[float, ...]


@dataclass(frozen=True)
class Modes:
    """Modal form: u = shapes @ q, q'' + 2 ζ ω q' + ω² q = shapesᵀ F."""

    omega: Matrix
    zeta: Matrix
    shapes: Matrix
    seen: Matrix
    mass: Matrix
    stiffness: Matrix


def mass_matrix(parts: Parts) -> Matrix:
    """Diagonal mass matrix, (N_DOF, N_DOF)."""
    m1, m2 = parts.rotor_mass_kg
    casing = (parts.casing_mass_kg, parts.casing_mass_kg, parts.casing_inertia_kgm2)
    return np.diag([*parts.inertia_kgm2, m1, m1, m2, m2, *casing])


def seen_rows(parts: Parts) -> Matrix:
    """Rows that turn displacements into what the forces depend on, (N_SEEN, N_DOF)."""
    rows = np.zeros((N_SEEN, N_DOF))
    n_x, n_y = np.cos(parts.line_angle), np.sin(parts.line_angle)
    rows[0, [GEAR_1, GEAR_2]] = parts.base_radii_m[0], -parts.base_radii_m[1]
    rows[0, [X1, Y1, X2, Y2]] = n_x, n_y, -n_x, -n_y
    rows[1, GEAR_1] = rows[2, GEAR_2] = rows[7, MOTOR] = rows[8, LOAD] = 1.0
    for i, (x, y) in enumerate(((X1, Y1), (X2, Y2))):
        rows[3 + 2 * i, [x, XC, ROCK]] = 1.0, -1.0, parts.height_m
        rows[4 + 2 * i, [y, YC, ROCK]] = 1.0, -1.0, -parts.seat_x_m[i]
    return rows


def stiffness_matrix(parts: Parts) -> Matrix:
    """Springs of shafts, bearings and foundation, (N_DOF, N_DOF); no mesh."""
    seen = seen_rows(parts)
    k = np.zeros((N_DOF, N_DOF))
    for (a, b), value in zip(((MOTOR, GEAR_1), (GEAR_2, LOAD)), parts.shaft_nm_per_rad, strict=True):
        twist = np.zeros(N_DOF)
        twist[[a, b]] = 1.0, -1.0
        k += value * np.outer(twist, twist)
    for i in range(2):
        for j in range(2):
            row = seen[3 + 2 * i + j]
            k += parts.bearing_n_per_m[i][j] * np.outer(row, row)
    k[XC, XC] += parts.foundation_n_per_m[0]
    k[YC, YC] += parts.foundation_n_per_m[1]
    k[ROCK, ROCK] += parts.rocking_nm_per_rad
    return k


def modes_of(parts: Parts) -> Modes:
    """Modes without the mesh; the two lowest are the free rotations of either drive line, undamped."""
    m, k = mass_matrix(parts), stiffness_matrix(parts)
    squares, shapes = eigh(k, m)
    omega = np.sqrt(np.maximum(squares, 0.0))
    zeta = np.array(parts.damping_ratios, dtype=float)
    omega[:2] = zeta[:2] = 0.0
    return Modes(omega, zeta, np.ascontiguousarray(shapes), seen_rows(parts) @ shapes, m, k)


def step_coefficients(modes: Modes, step_s: float) -> Matrix:
    """Exact step of each mode under a force that is linear in time, (8, N_DOF).

    q⁺ = c0 q + c1 p + c4 f + c5 f⁺ and p⁺ = c2 q + c3 p + c6 f + c7 f⁺, from the exponential of the mode's matrix
    with force and force rate as states.

    Source: M. Hochbruck and A. Ostermann, Exponential integrators, *Acta Numerica* 19 (2010).
    """
    found = np.empty((8, N_DOF))
    for i, (w, z) in enumerate(zip(modes.omega, modes.zeta, strict=True)):
        a = np.zeros((4, 4))
        a[0, 1] = a[2, 3] = a[1, 2] = 1.0
        a[1, 0], a[1, 1] = -(w**2), -2 * z * w
        e: Any = expm(a * step_s)
        rate = e[:2, 3] / step_s
        found[:, i] = *e[0, :2], *e[1, :2], e[0, 2] - rate[0], rate[0], e[1, 2] - rate[1], rate[1]
    return found


def static_shape(modes: Modes, mesh_n_per_m: float, forces: Matrix) -> Matrix:
    """Displacements under constant forces that balance over the mesh, (N_DOF,); gear 1 is kept from turning."""
    mesh = np.linalg.lstsq(modes.shapes.T, modes.seen[0], rcond=None)[0]
    k = modes.stiffness + mesh_n_per_m * np.outer(mesh, mesh)
    k[GEAR_1, GEAR_1] += 1e-3 * mesh_n_per_m * mesh[GEAR_1] ** 2
    return np.asarray(np.linalg.solve(k, forces))
