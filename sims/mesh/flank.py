"""Places on a flank: roll length, arc length, and how far a zone of contact reaches."""

from __future__ import annotations

import numpy as np

from gearsig.checks import FloatArray
from sims.mesh.geometry import GearGeometry
from sims.mesh.material import Material
from sims.mesh.pair import PairGeometry

WORKING_PRESSURE_PA = 1e9
"""Hertz pressure for which the width of the contact is taken where a table cannot know the load: that of gears well
loaded. The width grows with the root of the load."""


def arc_length_mm(gear: GearGeometry, roll_length_mm: FloatArray | float) -> FloatArray:
    """Length of the flank from the base circle out, s = ρ²/(2 r_b).

    A contact that moves by dρ along the line of action moves by ds = (ρ/r_b) dρ along the flank, a quarter to a half
    of it: lengths of damage and wavelengths of roughness are arc lengths.

    Parameters
    ----------
    gear : GearGeometry
    roll_length_mm : float or array
        ρ, distance from the base tangent point; below 0 counts as 0.
    """
    rho = np.maximum(np.asarray(roll_length_mm, dtype=np.float64), 0.0)
    result: FloatArray = rho**2 / (2.0 * gear.base_radius_mm)
    return result


def flank_length_mm(gear: GearGeometry) -> float:
    """Arc length of the involute, from the end of the fillet to the tip."""
    return gear.base_radius_mm * (gear.tip_roll_rad**2 - gear.form_roll_rad**2) / 2.0


def contact_ends_mm(pair: PairGeometry, side: int) -> tuple[float, float]:
    """Roll lengths ρ of gear 1 or 2 between which its flank is touched, the root end first."""
    if side == 1:
        return pair.start_radius_mm, pair.end_radius_mm
    return pair.action_length_mm - pair.end_radius_mm, pair.action_length_mm - pair.start_radius_mm


def pitch_point_mm(pair: PairGeometry, side: int) -> float:
    """Roll length of gear 1 or 2 at the pitch point."""
    return pair.pitch_point_radius_mm if side == 1 else pair.action_length_mm - pair.pitch_point_radius_mm


def curvature_radius_mm(pair: PairGeometry, roll_length_mm: FloatArray | float) -> FloatArray:
    """Radius of relative curvature, R = ρ1 ρ2/(ρ1 + ρ2); the same whichever gear ρ belongs to, and not below 0."""
    rho = np.clip(np.asarray(roll_length_mm, dtype=np.float64), 0.0, pair.action_length_mm)
    result: FloatArray = rho * (pair.action_length_mm - rho) / pair.action_length_mm
    return result


def contact_half_width_mm(pair: PairGeometry, one: Material, two: Material) -> float:
    """Half the width of the zone of contact along the flank, a = 2 R p/E*, at the pitch point and 1 GPa.

    Source: K. L. Johnson, *Contact Mechanics*, 1985, ch. 4.
    """
    radius = float(curvature_radius_mm(pair, pair.pitch_point_radius_mm))
    flexibility = sum((1.0 - m.poisson_ratio**2) / m.youngs_modulus_pa for m in (one, two))
    return 2.0 * radius * WORKING_PRESSURE_PA * flexibility


def part_inside(place_mm: FloatArray, low_mm: float, high_mm: float, half_width_mm: float) -> FloatArray:
    """Part of a zone of contact around each place that lies between two others, 0 to 1, with smooth edges.

    A stretch shorter than the zone never takes all of it, so that the part goes to 0 with the stretch.
    """
    width = 2.0 * half_width_mm
    begun = smooth_step((place_mm - low_mm) / width + 0.5)
    result: FloatArray = begun - smooth_step((place_mm - high_mm) / width + 0.5)
    return result


def smooth_step(t: FloatArray) -> FloatArray:
    """Return 6t⁵ − 15t⁴ + 10t³, from 0 at t ≤ 0 to 1 at t ≥ 1 with two continuous derivatives."""
    u = np.clip(t, 0.0, 1.0)
    result: FloatArray = u**3 * (u * (6.0 * u - 15.0) + 10.0)
    return result
