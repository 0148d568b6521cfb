"""Compliance of one tooth as a cantilever: bending, shear and axial compression along its true outline."""

from __future__ import annotations

from functools import lru_cache
from itertools import pairwise
from math import pi
from typing import NamedTuple

import numpy as np

from gearsig.checks import FloatArray
from sims.mesh.crack import RootCrack, check_crack, crack_tip_mm, effective_flank_mm
from sims.mesh.geometry import GearGeometry
from sims.mesh.material import Material
from sims.mesh.profile import fillet_outline, involute_outline, root_point_mm

SHEAR_FACTOR = 1.2
"""Of a rectangular section."""

N_NODES = 24
"""Gauss points on each part of the outline; 96 change the compliance by less than 1e-13."""


class ToothCompliance(NamedTuple):
    """Deflection along the force for 1 N on 1 m of face width, by cause; m²/N."""

    bending: FloatArray
    shear: FloatArray
    axial: FloatArray

    @property
    def total(self) -> FloatArray:
        """Sum of the three."""
        return self.bending + self.shear + self.axial


class _Sections(NamedTuple):
    """Sections between root and contact, one row per contact; metres, dx times the Gauss weight."""

    x: FloatArray
    front: FloatArray
    back: FloatArray
    dx: FloatArray


def tooth_compliance(
    gear: GearGeometry, material: Material, roll_rad: FloatArray, crack: tuple[float, float] | None = None
) -> ToothCompliance:
    """Deflection of a tooth loaded on its flank, relative to its root, from the strain energy of a beam.

    1/k_b = ∫ M²/(E I) dx,  1/k_s = ∫ 1.2 cos²α_m/(G A) dx,  1/k_a = ∫ sin²α_m/(E A) dx

    over the sections from the root circle to the contact, for unit force. About the tooth's centre line the moment is
    exactly M = r_b − x cos α_m; behind a crack the section's centroid lies off it by y₀, which adds y₀ sin α_m.

    Parameters
    ----------
    gear : GearGeometry
    material : Material
    roll_rad : array, (n,)
        τ = tan α at the contact, from the form roll to the tip roll.
    crack : (depth_mm, angle_deg) or None
        The same over the whole width considered.

    Returns
    -------
    ToothCompliance
        Arrays (n,), m²/N; divide by the face width in m.

    Source: X. Tian, *Dynamic simulation for system response of gearbox including localized gear faults*, University of
    Alberta (2004), for the energies; the outline with its trochoid fillet and the moment about r_b are derived.
    """
    tau = np.atleast_1d(np.asarray(roll_rad, dtype=np.float64))
    sections = _sections(gear, tau, crack)
    load_angle = (tau - gear.base_half_angle_rad)[:, None]
    sine, cosine = np.sin(load_angle), np.cos(load_angle)
    height = sections.front + sections.back
    moment = gear.base_radius_mm * 1e-3 - sections.x * cosine + sine * (sections.front - sections.back) / 2.0
    bending = np.sum(12.0 * moment**2 / height**3 * sections.dx, axis=1)
    length_over_height = np.sum(sections.dx / height, axis=1)
    shear = 2.0 * SHEAR_FACTOR * (1.0 + material.poisson_ratio) * cosine[:, 0] ** 2 * length_over_height
    axial = sine[:, 0] ** 2 * length_over_height
    e = material.youngs_modulus_pa
    return ToothCompliance(bending / e, shear / e, axial / e)


def cracked_tooth_compliance(
    gear: GearGeometry,
    material: Material,
    roll_rad: FloatArray,
    crack: RootCrack,
    face_width_m: float,
    n_slices: int = 12,
) -> FloatArray:
    """Compliance of a tooth with a crack over all or part of its width, slices side by side: 1/k = 1/Σ k(w) dw.

    Parameters
    ----------
    gear, material, roll_rad
        As for `tooth_compliance`.
    crack : RootCrack
    face_width_m : float
        Loaded width; a crack wider than it counts as all through.
    n_slices : int
        Gauss points over the cracked width of a parabolic front.

    Returns
    -------
    array
        m/N (not per width).

    Source: Z. Chen, Y. Shao, Dynamic simulation of spur gear with tooth root crack propagating along tooth width and
    crack depth, Engineering Failure Analysis 18 (2011), for the slices, which do not hold each other.
    """
    check_crack(gear, crack)
    width = face_width_m if crack.width_mm is None else min(crack.width_mm * 1e-3, face_width_m)
    part, weight = np.array([0.0]), np.array([1.0])
    if crack.front == "parabolic":
        part, weight = _gauss(n_slices)
    stiffness = np.zeros(np.shape(np.atleast_1d(roll_rad)))
    if width < face_width_m:
        stiffness += (face_width_m - width) / tooth_compliance(gear, material, roll_rad).total
    for p, w in zip(part, weight, strict=True):
        depth = crack.depth_mm * float(np.sqrt(1.0 - p))
        stiffness += width * w / tooth_compliance(gear, material, roll_rad, (depth, crack.angle_deg)).total
    result: FloatArray = 1.0 / stiffness
    return result


def _sections(gear: GearGeometry, tau: FloatArray, crack: tuple[float, float] | None) -> _Sections:
    node, weight = _gauss(N_NODES)
    pieces = []
    cuts = _fillet_cuts(gear, crack)
    for low, high in pairwise(cuts):
        fillet = fillet_outline(gear, np.broadcast_to(low + (high - low) * node, (len(tau), N_NODES)))
        pieces.append((fillet.x_mm, fillet.y_mm, fillet.dx_mm * weight * (high - low)))
    span = (tau - gear.form_roll_rad)[:, None]
    flank = involute_outline(gear, gear.form_roll_rad + span * node)
    pieces.append((flank.x_mm, flank.y_mm, flank.dx_mm * weight * span))
    x, y, dx = (np.concatenate(part, axis=1) for part in zip(*pieces, strict=True))
    front = y if crack is None else effective_flank_mm(gear, *crack, x, y)
    return _Sections(x * 1e-3, front * 1e-3, y * 1e-3, dx * 1e-3)


def _fillet_cuts(gear: GearGeometry, crack: tuple[float, float] | None) -> tuple[float, ...]:
    """γ from the root circle to the involute, split where the sections change abruptly: at a crack's tip and mouth."""
    root, form = pi / 2.0, gear.pressure_angle_rad
    if crack is None:
        return root, form
    x_end, _ = crack_tip_mm(gear, *crack)
    middle = (root + form) / 2.0
    if x_end <= root_point_mm(gear)[0]:
        return root, middle, form
    from scipy.optimize import brentq

    def off(gamma: float) -> float:
        return float(fillet_outline(gear, np.array([gamma])).x_mm[0]) - x_end

    at_end = middle if off(middle) <= 0.0 else float(brentq(off, middle, root, xtol=1e-14))
    return (root, at_end, form) if at_end == middle else (root, at_end, middle, form)


@lru_cache(maxsize=8)
def _gauss(n: int) -> tuple[FloatArray, FloatArray]:
    """Gauss–Legendre nodes and weights on 0 to 1."""
    x, w = np.polynomial.legendre.leggauss(n)
    return (x + 1.0) / 2.0, w / 2.0
