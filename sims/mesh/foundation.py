"""Compliance of the gear body below a tooth: fillet foundation."""

from __future__ import annotations

import numpy as np

from gearsig.checks import FloatArray
from sims.mesh.geometry import GearGeometry
from sims.mesh.material import Material
from sims.mesh.profile import root_half_angle_rad

_COEFFICIENTS = np.array(
    [
        [-5.574e-5, -1.9986e-3, -2.3015e-4, 4.7702e-3, 0.0271, 6.8045],
        [60.111e-5, 28.100e-3, -83.431e-4, -9.9256e-3, 0.1624, 0.9086],
        [-50.952e-5, 185.50e-3, 0.0538e-4, 53.300e-3, 0.2895, 0.9236],
        [-6.2042e-5, 9.0889e-3, -4.0964e-4, 7.8297e-3, -0.1472, 0.6904],
    ]
)
"""Rows L*, M*, P*, Q*; columns A to F."""

RADIUS_RATIO_RANGE = (1.4, 7.0)
ROOT_ANGLE_RANGE_RAD = (0.01, 0.12)


def foundation_factors(radius_ratio: float, root_angle_rad: float) -> FloatArray:
    """L*, M*, P*, Q* from X = A/θ² + B h² + C h/θ + D/θ + E h + F.

    Parameters
    ----------
    radius_ratio : float
        h, root radius over bore radius; the polynomial was fitted for 1.4 to 7.
    root_angle_rad : float
        θ, half the angle of the tooth on the root circle; fitted for 0.01 to 0.12 rad.

    Source: P. Sainsot, P. Velex, O. Duverger, Contribution of gear body to tooth deflections – a new bidimensional
    analytical formula, Journal of Mechanical Design 126 (2004).
    """
    h, theta = radius_ratio, root_angle_rad
    terms = np.array([1.0 / theta**2, h**2, h / theta, 1.0 / theta, h, 1.0])
    factors: FloatArray = _COEFFICIENTS @ terms
    return factors


def foundation_compliance(gear: GearGeometry, material: Material, load_angle_rad: FloatArray) -> FloatArray:
    """Deflection of a tooth along its force by the body's compliance, for 1 N on 1 m of face width.

    δ b E/F = cos²α_m [L* (u/S)² + M* u/S + P* (1 + Q* tan²α_m)]

    u is the distance from the root circle to the crossing of force and tooth centre line, S the root thickness.

    Parameters
    ----------
    gear : GearGeometry
    material : Material
    load_angle_rad : array
        α_m, between the force and the normal of the tooth's centre line.

    Returns
    -------
    array
        m²/N; divide by the face width in m.

    Notes
    -----
    Teeth of one gear share the body, so that neighbours in contact also move each other; that coupling is left out. It
    makes the mesh in double contact appear stiffer than it is. A crack does not change the body's compliance here.
    """
    l_star, m_star, p_star, q_star = foundation_factors(gear.root_radius_mm / gear.bore_mm, root_half_angle_rad(gear))
    cosine, tangent = np.cos(load_angle_rad), np.tan(load_angle_rad)
    root_thickness = 2.0 * gear.root_radius_mm * root_half_angle_rad(gear)
    ratio = (gear.base_radius_mm / cosine - gear.root_radius_mm) / root_thickness
    shape = l_star * ratio**2 + m_star * ratio + p_star * (1.0 + q_star * tangent**2)
    result: FloatArray = cosine**2 * shape / material.youngs_modulus_pa
    return result


def foundation_notes(gear: GearGeometry) -> tuple[str, ...]:
    """Say where a gear lies outside the range for which the foundation's polynomial was fitted."""
    ratio, angle = gear.root_radius_mm / gear.bore_mm, root_half_angle_rad(gear)
    name = f"gear of {gear.teeth} teeth: foundation compliance is extrapolated,"
    notes = []
    if not RADIUS_RATIO_RANGE[0] <= ratio <= RADIUS_RATIO_RANGE[1]:
        notes.append(f"{name} root over bore radius is {ratio:.3g} (fitted for 1.4 to 7)")
    if not ROOT_ANGLE_RANGE_RAD[0] <= angle <= ROOT_ANGLE_RANGE_RAD[1]:
        notes.append(f"{name} root half angle is {angle:.3g} rad (fitted for 0.01 to 0.12)")
    return tuple(notes)
