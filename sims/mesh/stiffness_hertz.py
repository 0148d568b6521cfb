"""Compliance of the contact itself."""

from __future__ import annotations

from math import pi

from sims.mesh.material import Material

CONTACT_LAWS = ("linear", "load-dependent")


def linear_contact_compliance(one: Material, two: Material, face_width_m: float) -> float:
    """1/k_h of two cylinders by the common linear form, 4 (1 − ν²)/(π E b), in m/N.

    It depends neither on load nor on curvature and is stiffer than a real contact at working load.

    Source: D. C. H. Yang, J. Y. Lin, Hertzian damping, tooth friction and bending elasticity in gear impact dynamics,
    Journal of Mechanisms, Transmissions, and Automation in Design 109 (1987).
    """
    flexibility = sum((1.0 - m.poisson_ratio**2) / m.youngs_modulus_pa for m in (one, two))
    return 2.0 * flexibility / (pi * face_width_m)


def load_dependent_contact_coefficient(one: Material, two: Material, face_width_m: float) -> float:
    """B of the approach δ = B F^0.9 of a line contact, B = 1.275/(E^0.9 b^0.8), in m/N^0.9.

    E is the harmonic mean of the two moduli.

    Source: A. Palmgren, *Ball and Roller Bearing Engineering* (1959), for the exponents; 1.275 as used for steel gears.
    """
    e = 2.0 / (1.0 / one.youngs_modulus_pa + 1.0 / two.youngs_modulus_pa)
    return float(1.275 / (e**0.9 * face_width_m**0.8))
