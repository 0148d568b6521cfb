"""How thick the root of a standard spur gear's tooth is, and which part of it a crack takes away."""

from __future__ import annotations

from math import cos, pi, radians, sin, tan

DEDENDUM, TOOL_TIP_RADIUS = 1.25, 0.38
"""Of the standard rack, in modules (ISO 53, profile A)."""

CRACK_ANGLE_DEG = 45.0
"""Between the crack and the tooth's centre line, as in the calibration."""


def root_thickness_mm(teeth: int, module_mm: float, pressure_angle_deg: float = 20.0) -> float:
    """Return the thickness of the tooth at the middle of its fillet, where cracks start.

    The tip round of the rack makes the fillet. Its contact normal has the angle γ to the pitch line, half way between
    α and π/2 here. With the round's centre h below the pitch line and b₁ beside the tooth's centre:

    φ = (h/tan γ + b₁)/r,  L = h/sin γ + ρ,  thickness = 2 (r sin φ − L cos(γ − φ))

    Parameters
    ----------
    teeth : int
    module_mm : float
    pressure_angle_deg : float

    Returns
    -------
    float
        In mm. Without profile shift.

    References
    ----------
    F. L. Litvin, A. Fuentes, *Gear Geometry and Applied Theory*, 2nd ed., 2004 (generation by a rack).

    Examples
    --------
    >>> round(root_thickness_mm(55, 2.0), 2)
    4.79
    """
    alpha = radians(pressure_angle_deg)
    gamma = 0.5 * (pi / 2.0 + alpha)
    h = DEDENDUM - TOOL_TIP_RADIUS
    b1 = pi / 4.0 + h * tan(alpha) + TOOL_TIP_RADIUS / cos(alpha)
    r = 0.5 * teeth
    phi = (h / tan(gamma) + b1) / r
    reach = h / sin(gamma) + TOOL_TIP_RADIUS
    return 2.0 * module_mm * (r * sin(phi) - reach * cos(gamma - phi))


def percent_per_mm(teeth: int, module_mm: float, pressure_angle_deg: float = 20.0) -> float:
    """Return the percentage of the root's thickness that 1 mm of a crack at 45° takes away."""
    return 100.0 * sin(radians(CRACK_ANGLE_DEG)) / root_thickness_mm(teeth, module_mm, pressure_angle_deg)
