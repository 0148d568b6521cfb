"""The gear body below the teeth: neighbouring teeth move each other through it."""

from __future__ import annotations

from functools import lru_cache
from math import cos, log, pi, sin

import numpy as np

from gearsig.checks import FloatArray, frozen_array
from sims.mesh._geometry import GearGeometry, Material, root_half_angle_rad

BODIES = ("separate", "coupled")
"""Whether teeth of one gear that carry at once move each other."""
_RESOLVED = 40.0  # harmonics times the root's half angle: what follows adds less than 1e-3 of a tooth's own compliance


def body_compliance(
    gear: GearGeometry, material: Material, load_angle_rad: FloatArray, deflected_rad: FloatArray, offset: int
) -> FloatArray:
    """Deflection of a tooth along its force by the body, for 1 N on 1 m of face width on a tooth `offset` further on.

    δ_i = a_iᵀ C(2π k/z) a_j,  a = (−sin α_m, cos α_m, u cos α_m)

    C holds the motions of a root arc (mean radial and tangential displacement, rotation) for unit loads of the same
    kinds on another root arc of an annulus, plane stress, held at the bore: a Fourier series whose terms are solved in
    closed form. u is the distance from the root circle to the crossing of force and tooth centre line. a turns the
    force of a contact into loads on the root.

    Parameters
    ----------
    gear : GearGeometry
    material : Material
    load_angle_rad, deflected_rad : array, (n,)
        α_m of the tooth that moves, and of the tooth that is loaded.
    offset : int
        k, teeth from the loaded one towards where its force pushes. 0: the tooth itself, which
        `foundation_compliance` gives by a published polynomial.

    Returns
    -------
    array, (n,)
        m²/N; divide by the face width in m.

    Notes
    -----
    For gears of 50, 55 and 75 teeth the tooth itself lies within 6 % of `foundation_compliance` (10 % at the tip); what
    neighbours do, on the mean of both sides, within 6 % of three-dimensional finite elements (14 % near the tips).

    Source: P. Sainsot, P. Velex, O. Duverger, Contribution of gear body to tooth deflections – a new bidimensional
    analytical formula, Journal of Mechanical Design 126 (2004), for the annulus under root loads; the loads' kinds and
    the neighbours are this package's own.
    """
    theta = root_half_angle_rad(gear)
    ratio = gear.root_radius_mm / gear.bore_mm
    arc = arc_compliance(ratio, theta, 2.0 * pi * offset / gear.teeth, material.poisson_ratio)
    moved, loaded = _root_loads(gear, load_angle_rad), _root_loads(gear, deflected_rad)
    result: FloatArray = np.einsum("in,ij,jn->n", moved, arc, loaded) / material.youngs_modulus_pa
    return result


def _root_loads(gear: GearGeometry, load_angle_rad: FloatArray) -> FloatArray:
    """Radial and tangential force and moment on the root of 1 N on the flank, (3, n), radii of the root circle."""
    alpha = np.atleast_1d(np.asarray(load_angle_rad, dtype=np.float64))
    arm = gear.base_radius_mm / np.cos(alpha) / gear.root_radius_mm - 1.0
    return np.array([-np.sin(alpha), np.cos(alpha), arm * np.cos(alpha)])


@lru_cache(maxsize=64)
def arc_compliance(radius_ratio: float, half_angle_rad: float, apart_rad: float, poisson_ratio: float) -> FloatArray:
    """Motions of one arc of an annulus's rim for loads on another, (3, 3), for E = 1, width 1, rim radius 1.

    Parameters
    ----------
    radius_ratio : float
        h, rim over bore; the bore is held.
    half_angle_rad : float
        θ of either arc.
    apart_rad : float
        From the middle of the loaded arc to that of the other, counter-clockwise.
    poisson_ratio : float

    Returns
    -------
    array, (3, 3)
        Rows: mean radial displacement, mean tangential one, rotation. Columns: unit radial force (evenly over the arc),
        tangential force (evenly), moment (linear radial stress).
    """
    theta = half_angle_rad
    total = np.zeros((3, 3))
    for n in range(int(_RESOLVED / theta)):
        rim = _rim_of_harmonic(n, radius_ratio, poisson_ratio)
        mean = sin(n * theta) / (n * theta) if n else 1.0
        tilt = -3.0 / theta**3 * (sin(n * theta) / n**2 - theta * cos(n * theta) / n) if n else 0.0
        share = 1.0 / pi if n else 0.5 / pi
        c, s = cos(n * apart_rad), sin(n * apart_rad)
        # Radial loads as σ cos nθ move u = U cos nθ, v = V sin nθ; tangential ones as τ cos nθ, and moments as
        # σ sin nθ, the same turned by a quarter of a wave: u = U sin nθ, v = −V cos nθ.
        u, v = share * mean * rim[:, 0]
        total[:, 0] += u * c * mean, v * s * mean, -tilt * s * u
        if n == 0:
            total[1, 1] += share * rim[1, 1]
            continue
        for column, (u, v) in ((1, -share * mean * rim[:, 1]), (2, tilt / pi * rim[:, 0])):
            total[:, column] += u * s * mean, -v * c * mean, tilt * c * u
    return frozen_array(total, "arc compliance", ndim=2)


@lru_cache(maxsize=8192)
def _rim_of_harmonic(n: int, radius_ratio: float, poisson_ratio: float) -> FloatArray:
    """(U, V) at the rim, rows, for σ_r = cos nθ and τ = sin nθ there, columns; E = 1, rim radius 1, bore held.

    Solutions of the plane elastic equations are r^p with p = ±(n + 1), ±(n − 1); at n = 1 two of them are a translation
    and one with ln r.
    """
    nu, bore = poisson_ratio, 1.0 / radius_ratio
    lam, mu = nu / (1.0 - nu**2), 0.5 / (1.0 + nu)  # of plane stress
    k = lam + 2.0 * mu
    if n == 0:
        radial = np.linalg.solve([[bore, 1.0 / bore], [k + lam, lam - k]], [0.0, 1.0]).sum()
        torsional = np.linalg.solve([[bore, 1.0 / bore], [0.0, -2.0 * mu]], [0.0, 1.0]).sum()
        return np.diag([radial, torsional])

    def powers(p: float) -> tuple[tuple[float, float], ...]:
        v = -(k * (p * p - 1.0) - mu * n * n) / (n * ((lam + mu) * p - (lam + 3.0 * mu)))
        at_rim, at_bore = (radius_ratio**p, 1.0) if p < 0.0 else (1.0, bore**p)
        return (at_bore, at_bore * v), (at_rim, at_rim * v), (at_rim * p, at_rim * p * v)

    solutions = [powers(float(p)) for p in ((2, -2) if n == 1 else (n + 1, n - 1, 1 - n, -n - 1))]
    if n == 1:
        extra = -(lam + mu) / (lam + 3.0 * mu)
        solutions.append(((1.0, -1.0), (1.0, -1.0), (0.0, 0.0)))
        solutions.append(((log(bore), -log(bore) + extra), (0.0, extra), (1.0, -1.0)))
    equations = np.array(
        [(ub, vb, k * du + lam * (u + n * v), mu * (dv - v - n * u)) for (ub, vb), (u, v), (du, dv) in solutions]
    ).T
    parts = np.linalg.solve(equations, [[0.0, 0.0], [0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    result: FloatArray = np.array([rim for _, rim, _ in solutions]).T @ parts
    return result
