"""One spur gear cut by a rack: radii, tooth thickness, limits of its shape."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import acos, cos, hypot, pi, radians, sin, tan
from typing import NamedTuple

import numpy as np

from gearsig.checks import FloatArray, count, not_negative, positive, within
from gearsig.errors import InputError

# The involute function and its inverse.


def involute(pressure_angle_rad: FloatArray | float) -> FloatArray:
    """Involute function inv α = tan α − α.

    Parameters
    ----------
    pressure_angle_rad : float or array
        α, −π/2 to π/2.

    Returns
    -------
    array
        The polar angle of the involute's point whose pressure angle is α, in rad, from the involute's start.

    Source: ISO 21771, *Gears – Cylindrical involute gears and gear pairs* (2007).
    """
    angle: FloatArray = np.asarray(pressure_angle_rad, dtype=np.float64)
    result: FloatArray = np.tan(angle) - angle
    return result


def inverse_involute(value_rad: float) -> float:
    """Pressure angle α ≥ 0 with tan α − α = `value_rad`, by Newton's method.

    Parameters
    ----------
    value_rad : float
        0 to 10 rad; angles of gears stay below 1.

    Examples
    --------
    >>> from math import radians, degrees, tan
    >>> round(degrees(inverse_involute(tan(radians(20)) - radians(20))), 9)
    20.0
    """
    value = within(value_rad, "value_rad", 0.0, 10.0, "rad")
    if value == 0.0:
        return 0.0
    # inv α is about α³/3 for small α and convex: starting beyond the root, Newton's method only comes down.
    angle = min((3.0 * value) ** (1.0 / 3.0), acos(1.0 / (1.0 + (value + pi / 2) ** 2) ** 0.5))
    for _ in range(60):
        step = (tan(angle) - angle - value) / tan(angle) ** 2
        angle -= step
        if abs(step) < 1e-15 * angle:
            break
    return float(angle)


MIN_TIP_THICKNESS = 0.05
"""In modules; below it a tooth counts as pointed."""


@dataclass(frozen=True)
class GearGeometry:
    """An external spur gear, as a rack-type tool with a rounded tip generates it.

    Parameters
    ----------
    teeth : int
        z, at least 5.
    module_mm : float
        m, above 0.
    pressure_angle_deg : float
        α of the rack, 10 to 30.
    profile_shift : float
        x, in modules; positive shifts the rack outwards and thickens the tooth root.
    face_width_mm : float
        b.
    addendum, dedendum : float
        In modules, without profile shift; 1 and 1.25 for the standard rack.
    tool_tip_radius : float
        ρ of the rack's tip, in modules; it makes the fillet. 0.38 for the standard rack (ISO 53, profile A).
    bore_radius_mm : float or None
        None: 0.35 of the root radius.

    Raises
    ------
    InputError
        If the tool would undercut the tooth, the tooth is pointed, or the tool's tip radius does not fit on the rack.

    Notes
    -----
    Not for internal gears, helical gears, or teeth finished with a protuberance.

    Examples
    --------
    >>> gear = GearGeometry(teeth=50, module_mm=3.0)
    >>> gear.tip_radius_mm, gear.root_radius_mm, round(gear.base_radius_mm, 3)
    (78.0, 71.25, 70.477)
    """

    teeth: int
    module_mm: float
    pressure_angle_deg: float = 20.0
    profile_shift: float = 0.0
    face_width_mm: float = 20.0
    addendum: float = 1.0
    dedendum: float = 1.25
    tool_tip_radius: float = 0.38
    bore_radius_mm: float | None = None

    def __post_init__(self) -> None:
        count(self.teeth, "teeth", minimum=5)
        positive(self.module_mm, "module_mm", "mm")
        within(self.pressure_angle_deg, "pressure_angle_deg", 10.0, 30.0, "°")
        within(self.profile_shift, "profile_shift", -1.0, 1.0)
        positive(self.face_width_mm, "face_width_mm", "mm")
        within(self.addendum, "addendum", 0.2, 2.0)
        within(self.dedendum, "dedendum", 0.2, 2.5)
        not_negative(self.tool_tip_radius, "tool_tip_radius", "modules")
        self._check_tool()
        self._check_tooth()
        if self.bore_radius_mm is not None:
            within(self.bore_radius_mm, "bore_radius_mm", 0.02 * self.root_radius_mm, 0.95 * self.root_radius_mm, "mm")

    @property
    def pressure_angle_rad(self) -> float:
        """α of the rack."""
        return radians(self.pressure_angle_deg)

    @property
    def pitch_radius_mm(self) -> float:
        """R = m z / 2."""
        return self.module_mm * self.teeth / 2.0

    @property
    def base_radius_mm(self) -> float:
        """r_b = r cos α."""
        return self.pitch_radius_mm * cos(self.pressure_angle_rad)

    @property
    def tip_radius_mm(self) -> float:
        """r_a."""
        return self.pitch_radius_mm + self.module_mm * (self.addendum + self.profile_shift)

    @property
    def root_radius_mm(self) -> float:
        """r_f."""
        return self.pitch_radius_mm - self.module_mm * (self.dedendum - self.profile_shift)

    @property
    def bore_mm(self) -> float:
        """Bore radius, given or 0.35 of the root radius."""
        return 0.35 * self.root_radius_mm if self.bore_radius_mm is None else self.bore_radius_mm

    @property
    def base_pitch_mm(self) -> float:
        """p_b = π m cos α."""
        return pi * self.module_mm * cos(self.pressure_angle_rad)

    @property
    def base_half_angle_rad(self) -> float:
        """ψ_b, half the angle a tooth takes on the base circle: π/(2z) + 2x tan α/z + inv α."""
        alpha = self.pressure_angle_rad
        half_at_pitch = (pi / 2.0 + 2.0 * self.profile_shift * tan(alpha)) / self.teeth
        return half_at_pitch + float(involute(alpha))

    @cached_property
    def form_roll_rad(self) -> float:
        """Roll angle tan α_F where fillet and involute meet; it is negative if the tool undercuts the tooth."""
        alpha = self.pressure_angle_rad
        straight_depth = self.dedendum - self.tool_tip_radius * (1.0 - sin(alpha)) - self.profile_shift
        length = self.pitch_radius_mm * sin(alpha) - self.module_mm * straight_depth / sin(alpha)
        return length / self.base_radius_mm

    @property
    def form_radius_mm(self) -> float:
        """Radius where fillet and involute meet."""
        return self.base_radius_mm * hypot(1.0, self.form_roll_rad)

    @property
    def tip_roll_rad(self) -> float:
        """Roll angle tan α_a at the tip."""
        return tan(acos(self.base_radius_mm / self.tip_radius_mm))

    @property
    def tip_thickness_mm(self) -> float:
        """Tooth thickness on the tip circle."""
        return float(self.tooth_thickness_mm(self.tip_radius_mm))

    def tooth_thickness_mm(self, radius_mm: FloatArray | float) -> FloatArray:
        """Arc thickness of the involute tooth, s = 2 R (ψ_b − inv α_R) with cos α_R = r_b/R.

        Parameters
        ----------
        radius_mm : float or array
            R, from the base circle outwards. Below the form radius the tooth is thicker, since the fillet is there.
        """
        radius: FloatArray = np.asarray(radius_mm, dtype=np.float64)
        if np.any(radius < self.base_radius_mm):
            raise InputError(
                f"radius_mm is {radius.min():g} mm", allowed=f"at least the base radius, {self.base_radius_mm:g} mm"
            )
        alpha = np.arccos(self.base_radius_mm / radius)
        thickness: FloatArray = 2.0 * radius * (self.base_half_angle_rad - involute(alpha))
        return thickness

    def _check_tool(self) -> None:
        alpha = self.pressure_angle_rad
        largest = (pi / 4.0 - self.dedendum * tan(alpha)) * cos(alpha) / (1.0 - sin(alpha))
        if largest < 0.0:
            raise InputError(
                f"dedendum is {self.dedendum:g} modules: the rack's tooth ends in a point before that depth",
                allowed=f"at most {pi / 4.0 / tan(alpha):.3g}",
            )
        within(
            self.tool_tip_radius, "tool_tip_radius", 0.0, largest, "modules", remedy="take a sharper or shorter tool"
        )
        # The round's centre must lie inside the pitch line, or the fillet is no longer the trochoid used here.
        if self.dedendum - self.tool_tip_radius - self.profile_shift <= 0.0:
            raise InputError(
                f"profile_shift is {self.profile_shift:g}: the tool's tip does not reach below the pitch circle",
                allowed=f"below {self.dedendum - self.tool_tip_radius:g}",
            )

    def _check_tooth(self) -> None:
        if self.form_roll_rad < 0.0:
            alpha = self.pressure_angle_rad
            straight = self.dedendum - self.tool_tip_radius * (1.0 - sin(alpha))
            least = straight - self.teeth * sin(alpha) ** 2 / 2.0
            raise InputError(
                f"the tool undercuts a gear of {self.teeth} teeth at profile shift {self.profile_shift:g}",
                allowed=f"a profile shift of at least {least:.3g}",
                remedy="shift the profile outwards or take more teeth",
            )
        if self.tip_radius_mm <= self.form_radius_mm or self.tip_thickness_mm < MIN_TIP_THICKNESS * self.module_mm:
            raise InputError(
                f"the tooth is pointed: {self.tip_thickness_mm:.3g} mm thick at its tip"
                if self.tip_radius_mm > self.form_radius_mm
                else "the tooth has no involute: its tip lies below the fillet's end",
                allowed=f"a tip at least {MIN_TIP_THICKNESS:g} modules thick",
                remedy="lower the addendum or the profile shift",
            )


def disc_mass_kg(gear: GearGeometry, density_kg_m3: float = 7850.0) -> float:
    """Mass of the gear as a disc with bore, out to the pitch circle: tips and spaces cancel."""
    area_mm2 = pi * (gear.pitch_radius_mm**2 - gear.bore_mm**2)
    return area_mm2 * gear.face_width_mm * 1e-9 * positive(density_kg_m3, "density_kg_m3", "kg/m^3")


def disc_inertia_kg_m2(gear: GearGeometry, density_kg_m3: float = 7850.0) -> float:
    """Polar moment of inertia of the same disc, m (r² + r_bore²)/2."""
    square_m2 = (gear.pitch_radius_mm**2 + gear.bore_mm**2) * 1e-6
    return disc_mass_kg(gear, density_kg_m3) * square_m2 / 2.0


# The true outline of half a tooth: trochoid fillet from the root circle, then involute to the tip.
#
# Axes of a tooth: x along its centre line, outwards from the gear's centre; y across, positive to the loaded flank.


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


def _round_offset_mm(gear: GearGeometry) -> float:
    """b₁, from the tooth's centre to the centre of the tool's tip round, along the pitch line."""
    alpha, m = gear.pressure_angle_rad, gear.module_mm
    depth = gear.dedendum - gear.tool_tip_radius
    return m * (pi / 4.0 + depth * tan(alpha) + gear.tool_tip_radius / cos(alpha))


# What the gears are made of.


@dataclass(frozen=True)
class Material:
    """Isotropic, linearly elastic.

    Parameters
    ----------
    youngs_modulus_gpa : float
        E, 0.001 to 1500 GPa: from soft plastics to diamond.
    poisson_ratio : float
        ν, 0 to 0.49.
    density_kg_m3 : float
    """

    youngs_modulus_gpa: float = 206.0
    poisson_ratio: float = 0.3
    density_kg_m3: float = 7850.0

    def __post_init__(self) -> None:
        if self.youngs_modulus_gpa > 1e6:
            remedy = f"it is in GPa: for {self.youngs_modulus_gpa:g} Pa give {self.youngs_modulus_gpa * 1e-9:g}"
        else:
            remedy = "it is in GPa, 206 of steel"
        within(self.youngs_modulus_gpa, "youngs_modulus_gpa", 1e-3, 1500.0, "GPa", remedy=remedy)
        within(self.poisson_ratio, "poisson_ratio", 0.0, 0.49)
        within(self.density_kg_m3, "density_kg_m3", 10.0, 30e3, "kg/m^3", remedy="7850 of steel")

    @property
    def youngs_modulus_pa(self) -> float:
        """E in Pa."""
        return self.youngs_modulus_gpa * 1e9


STEEL = Material()
"""Gear steel, E = 206 GPa."""
