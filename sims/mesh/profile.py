"""The true outline of half a tooth: trochoid fillet from the root circle, then involute to the tip.

Axes of a tooth: x along its centre line, outwards from the gear's centre; y across, positive to the loaded flank.
"""

from __future__ import annotations

from math import cos, pi, tan
from typing import NamedTuple

import numpy as np

from gearsig.checks import FloatArray, count
from sims.mesh.geometry import GearGeometry


class Outline(NamedTuple):
    """Points of a half tooth and the slope of x by the curve's parameter; mm."""

    x_mm: FloatArray
    y_mm: FloatArray
    dx_mm: FloatArray


def involute_outline(gear: GearGeometry, roll_rad: FloatArray) -> Outline:
    """Involute flank, x = r_b (cos α_m + τ sin α_m), y = r_b (τ cos α_m − sin α_m), α_m = τ − ψ_b.

    Parameters
    ----------
    gear : GearGeometry
    roll_rad : array
        τ, the roll angle: the tangent of the pressure angle at the point. α_m is the angle between the force at that
        point and the normal of the tooth's centre line.

    Returns
    -------
    Outline
        With dx/dτ = r_b τ cos α_m.
    """
    tau = np.asarray(roll_rad, dtype=np.float64)
    rb, load_angle = gear.base_radius_mm, tau - gear.base_half_angle_rad
    sine, cosine = np.sin(load_angle), np.cos(load_angle)
    return Outline(rb * (cosine + tau * sine), rb * (tau * cosine - sine), rb * tau * cosine)


def fillet_outline(gear: GearGeometry, gamma_rad: FloatArray) -> Outline:
    """Trochoid fillet, the envelope of the tool's tip round.

    The round's centre lies h below the pitch line and b₁ beside the tooth's centre. Its contact normal passes through
    the pitch point at the angle γ to the pitch line: γ = π/2 at the root circle, γ = α where the involute begins.

    φ = (h/tan γ + b₁)/r,  L = h/sin γ + ρ,  x = r cos φ − L sin(γ − φ),  y = r sin φ − L cos(γ − φ)

    Parameters
    ----------
    gear : GearGeometry
    gamma_rad : array
        γ, from the rack's pressure angle to π/2.

    Returns
    -------
    Outline
        With dx/dγ.

    Source: F. L. Litvin, A. Fuentes, *Gear Geometry and Applied Theory*, 2nd ed. (2004), for generation by a rack; the
    form above is derived.
    """
    gamma = np.asarray(gamma_rad, dtype=np.float64)
    r, rho = gear.pitch_radius_mm, gear.tool_tip_radius * gear.module_mm
    depth = gear.module_mm * (gear.dedendum - gear.tool_tip_radius - gear.profile_shift)
    sine, cosine = np.sin(gamma), np.cos(gamma)
    phi = (depth * cosine / sine + _round_offset_mm(gear)) / r
    reach = depth / sine + rho
    dphi, dreach = -depth / (r * sine**2), -depth * cosine / sine**2
    x = r * np.cos(phi) - reach * np.sin(gamma - phi)
    y = r * np.sin(phi) - reach * np.cos(gamma - phi)
    dx = -r * np.sin(phi) * dphi - dreach * np.sin(gamma - phi) - reach * np.cos(gamma - phi) * (1.0 - dphi)
    return Outline(x, y, dx)


def root_half_angle_rad(gear: GearGeometry) -> float:
    """θ_f, half the angle a tooth takes on the root circle, between the ends of its two fillets."""
    return _round_offset_mm(gear) / gear.pitch_radius_mm


def root_point_mm(gear: GearGeometry) -> tuple[float, float]:
    """X and y where the fillet leaves the root circle."""
    point = fillet_outline(gear, np.array([pi / 2.0]))
    return float(point.x_mm[0]), float(point.y_mm[0])


def tip_point_mm(gear: GearGeometry) -> tuple[float, float]:
    """X and y of the corner between flank and tip circle."""
    point = involute_outline(gear, np.array([gear.tip_roll_rad]))
    return float(point.x_mm[0]), float(point.y_mm[0])


def tooth_outline_mm(gear: GearGeometry, n_points: int = 200) -> tuple[FloatArray, FloatArray]:
    """Half tooth from root circle to tip, for drawing.

    Returns
    -------
    x_mm, y_mm : arrays, (about n_points,)
        Mirror y for the other flank.
    """
    half = count(n_points, "n_points", minimum=4) // 2
    fillet = fillet_outline(gear, np.linspace(pi / 2.0, gear.pressure_angle_rad, half))
    flank = involute_outline(gear, np.linspace(gear.form_roll_rad, gear.tip_roll_rad, half + 1)[1:])
    return np.concatenate((fillet.x_mm, flank.x_mm)), np.concatenate((fillet.y_mm, flank.y_mm))


def _round_offset_mm(gear: GearGeometry) -> float:
    """b₁, from the tooth's centre to the centre of the tool's tip round, along the pitch line."""
    alpha, m = gear.pressure_angle_rad, gear.module_mm
    depth = gear.dedendum - gear.tool_tip_radius
    return m * (pi / 4.0 + depth * tan(alpha) + gear.tool_tip_radius / cos(alpha))
