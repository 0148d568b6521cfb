"""Rolling elements that carry one by one: Hertzian contacts with clearance, whose number changes as they pass.

An element at the angle ψ from the load is pressed by δ = x cos ψ + y sin ψ − c, c the radial clearance, and carries
Q = K δ^1.5 along the radius. The force on the shaft, −Σ Q (cos ψ, sin ψ), depends on where the cage stands: at the
elements' passing the stiffness changes, and the shaft rises and falls with it (variable compliance).

Sources: A. Palmgren, *Ball and Roller Bearing Engineering* (1959); T. A. Harris, M. N. Kotzalas, *Rolling Bearing
Analysis*, 5th ed. (2006), ch. 7; C. S. Sunnersjö, Varying compliance vibrations of rolling bearings, Journal of Sound
and Vibration 58 (1978).
"""

# mypy: allow-untyped-defs, allow-untyped-calls

from __future__ import annotations

from math import cos, pi, radians, sin, sqrt

import numpy as np

from gearsig.checks import FloatArray
from gearsig.compiled import njit
from gearsig.errors import RefusalError
from gearsig.rig import Bearing
from sims.machine import BearingSupport

LEFT_OVER = 1e-7
"""Part of the load that may be out of balance, at a clearance of the size of what the load presses in; the rounding of
the energy leaves up to 3e-8, and more as the place lies further out."""
PALMGREN_MM = 4.36e-4
"""δ = 4.36e-4 (Q²/d)^⅓, mm, N: approach of both races to a steel ball in grooves of usual curvature."""


def contact_n_per_m15(bearing: Bearing) -> float:
    """K of one ball between its races along the bearing's radius, Q_r = K δ_r^1.5, by Palmgren's formula.

    δ_r = 4.36e-4 Q^⅔/(d^⅓ cos α), Q = Q_r/cos α, in mm and N; here in N/m^1.5.

    Parameters
    ----------
    bearing : Bearing
        With its geometry; steel balls.
    """
    alpha = radians(bearing.contact_angle_deg or 0.0)
    ball_mm = bearing.rolling_element_diameter_mm or 1.0
    per_mm15 = (cos(alpha) / PALMGREN_MM) ** 1.5 * sqrt(ball_mm) * cos(alpha)
    return float(per_mm15 * 1e3**1.5)


def element_angles_rad(n: int, cage_rad: float) -> FloatArray:
    """ψ of the elements, counter-clockwise from +x, (n,)."""
    angles: FloatArray = cage_rad + 2.0 * pi * np.arange(n) / n
    return angles


def shaft_place_m(support: BearingSupport, load_n: FloatArray, cage_rad: float = 0.0) -> FloatArray:
    """Where a load holds the shaft in the bearing, x and y, (2,); elements carry one by one.

    Raises
    ------
    RefusalError
        If no balance is found.
    """
    n, size, clearance = support.bearing.n_rolling_elements or 1, float(np.hypot(*load_n)), support.clearance_um * 1e-6
    if size == 0.0:
        return np.zeros(2)
    angles, contact = element_angles_rad(n, cage_rad), contact_n_per_m15(support.bearing)
    guess = load_n / size * (clearance + (5.0 * size / (n * contact)) ** (2.0 / 3.0))
    return balanced(np.column_stack((np.cos(angles), np.sin(angles))), contact, clearance, load_n, guess)


def element_loads_n(support: BearingSupport, load_n: FloatArray, cage_rad: float = 0.0) -> FloatArray:
    """Load of each element along the bearing's radius, (n,).

    Without clearance the greatest tends to 4.37 F/n as n grows (Stribeck); with usual clearance it is near 5 F/n.
    """
    angles = element_angles_rad(support.bearing.n_rolling_elements or 1, cage_rad)
    place = shaft_place_m(support, load_n, cage_rad)
    depth = place[0] * np.cos(angles) + place[1] * np.sin(angles) - support.clearance_um * 1e-6
    result: FloatArray = contact_n_per_m15(support.bearing) * np.maximum(depth, 0.0) ** 1.5
    return result


def stiffness_under_load_n_per_m(support: BearingSupport, load_n: FloatArray) -> float:
    """Stiffness along its load, mean over 16 places of the cage, ΣK 1.5 √δ cos²; of a spring, its own."""
    if support.law == "linear" or float(np.hypot(*load_n)) == 0.0:
        return support.stiffness_n_per_m
    n, toward = support.bearing.n_rolling_elements or 1, float(np.arctan2(load_n[1], load_n[0]))
    contact, stiffnesses = contact_n_per_m15(support.bearing), []
    for cage in 2.0 * pi / n * np.arange(16) / 16:
        loads = element_loads_n(support, load_n, float(cage))
        root_depth = (loads / contact) ** (1.0 / 3.0)
        along = np.cos(element_angles_rad(n, float(cage)) - toward) ** 2
        stiffnesses.append(float(np.sum(1.5 * contact * root_depth * along)))
    return float(np.mean(stiffnesses))


def balanced(
    radial: FloatArray, contact: float, clearance_m: float, load_n: FloatArray, guess: FloatArray
) -> FloatArray:
    """Least of the energy Σ K δ^2.5/2.5 − W·p, which is convex: Newton's method, its steps halved until it falls.

    radial : (n, 2) directions of the elements. Lengths are scaled so that the curvature is about 1.
    """
    load = float(np.hypot(*load_n))
    unit = (load / contact) ** (2.0 / 3.0)
    toward, gap, p = load_n / load, clearance_m / unit, guess / unit

    def energy(place: FloatArray) -> float:
        return float(np.sum(np.maximum(radial @ place - gap, 0.0) ** 2.5) / 2.5 - toward @ place)

    for _ in range(200):
        depth = np.maximum(radial @ p - gap, 0.0)
        slope = (depth**1.5) @ radial - toward
        if np.hypot(*slope) < LEFT_OVER * (1.0 + gap):
            place: FloatArray = p * unit
            return place
        curvature = (radial.T * (1.5 * np.sqrt(depth))) @ radial + 1e-9 * np.eye(2)
        step = np.linalg.solve(curvature, slope)
        step *= min(1.0, (1.0 + gap) / float(np.hypot(*step)))
        part, now = 1.0, energy(p)
        while energy(p - part * step) > now - 1e-4 * part * float(slope @ step) and part > 1e-12:
            part /= 2.0
        p = p - part * step
    raise RefusalError(
        f"the static balance of a bearing's rolling elements was not found (out of balance by {np.hypot(*slope):.1g})",
        remedy="take another clearance or load",
    )


@njit(cache=True, nogil=True, error_model="numpy")
def element_forces(k, row, theta, x, y):
    """(F_x, F_y) by which the elements of a bearing push back the shaft at (x, y); `theta`: the shaft's angle."""
    n = k.balls[row]
    # The driven shaft turns clockwise, and its cage with it.
    cage = k.pass_order[row] * theta / n * (1.0 if row < 2 else -1.0)
    step = 2.0 * pi / n
    c, s, turn_c, turn_s = cos(cage), sin(cage), cos(step), sin(step)
    fx, fy = 0.0, 0.0
    for _ in range(n):
        depth = x * c + y * s - k.clearance[row]
        if depth > 0.0:
            force = k.ball_contact[row] * depth * sqrt(depth)
            fx -= force * c
            fy -= force * s
        c, s = c * turn_c - s * turn_s, c * turn_s + s * turn_c
    return fx, fy
