"""Spur gears cut by a rack, and two of them in mesh: radii, tooth thickness, line of action, which teeth touch."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import acos, ceil, cos, hypot, pi, radians, sin, sqrt, tan
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
    return np.tan(angle) - angle


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
        return 2.0 * radius * (self.base_half_angle_rad - involute(alpha))

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


# --------------------
# Two gears in mesh: centre distance, line of action, which tooth pairs touch and where.
# --------------------


@dataclass(frozen=True)
class PairGeometry:
    """A spur pair; gear 1 drives.

    Mesh cycles c count tooth passages: c = z1 θ1/2π. Pair k touches from c = k to c = k + ε (ε the contact ratio); it
    is made of tooth k mod z1 of the driver and tooth k mod z2 of the driven gear. Its contact lies at ρ1 on the line of
    action, measured from the driver's base tangent point, with ρ1 = ρ1A + (c − k) p_b and ρ1 + ρ2 = a sin α_w.

    Parameters
    ----------
    driver, driven : GearGeometry
        With the same module and pressure angle.
    centre_distance_mm : float or None
        a; None: without backlash, from the profile shifts.

    Raises
    ------
    InputError
        If the teeth do not fit each other, jam, reach into the mate's fillet (interference) or root, or if a pair would
        leave before the next one enters (contact ratio below 1).
    """

    driver: GearGeometry
    driven: GearGeometry
    centre_distance_mm: float | None = None

    def __post_init__(self) -> None:
        self._check_match()
        if self.centre_distance_mm is not None:
            self._check_distance(positive(self.centre_distance_mm, "centre_distance_mm", "mm"))
        self._check_interference()
        self._check_clearance()
        if self.contact_ratio < 1.0:
            raise InputError(
                f"the contact ratio is {self.contact_ratio:.3f}: a pair leaves before the next one enters",
                allowed="at least 1",
                remedy="raise the addendum or bring the gears closer",
            )

    @cached_property
    def working_pressure_angle_rad(self) -> float:
        """α_w, from inv α_w = inv α + 2 (x1 + x2) tan α/(z1 + z2), or from the centre distance."""
        if self.centre_distance_mm is not None:
            return acos((self.driver.base_radius_mm + self.driven.base_radius_mm) / self.centre_distance_mm)
        return self._tight_angle_rad

    @property
    def base_radii_m(self) -> tuple[float, float]:
        """r_b of driver and driven gear."""
        return self.driver.base_radius_mm * 1e-3, self.driven.base_radius_mm * 1e-3

    @property
    def centre_distance(self) -> float:
        """A in mm."""
        return (self.driver.base_radius_mm + self.driven.base_radius_mm) / cos(self.working_pressure_angle_rad)

    @property
    def base_pitch_mm(self) -> float:
        """p_b."""
        return self.driver.base_pitch_mm

    @property
    def action_length_mm(self) -> float:
        """A sin α_w = ρ1 + ρ2, between the two base tangent points."""
        return self.centre_distance * sin(self.working_pressure_angle_rad)

    @property
    def start_radius_mm(self) -> float:
        """ρ1 where a pair enters: the driven gear's tip crosses the line of action."""
        return self.action_length_mm - _roll_length_mm(self.driven, self.driven.tip_radius_mm)

    @property
    def end_radius_mm(self) -> float:
        """ρ1 where a pair leaves: the driver's tip crosses the line of action."""
        return _roll_length_mm(self.driver, self.driver.tip_radius_mm)

    @property
    def pitch_point_radius_mm(self) -> float:
        """ρ1 at the pitch point, where sliding changes sign."""
        return self.driver.base_radius_mm * tan(self.working_pressure_angle_rad)

    @property
    def contact_ratio(self) -> float:
        """ε, length of the path of contact over the base pitch."""
        return (self.end_radius_mm - self.start_radius_mm) / self.base_pitch_mm

    @property
    def n_slots(self) -> int:
        """Most pairs that can touch at once."""
        return ceil(self.contact_ratio)

    @property
    def face_width_mm(self) -> float:
        """Width on which the teeth touch: the narrower gear's."""
        return min(self.driver.face_width_mm, self.driven.face_width_mm)

    def contact_radii_mm(self, mesh_cycles: FloatArray | float, pair: int = 0) -> tuple[FloatArray, FloatArray]:
        """ρ1 and ρ2 of pair `pair` at c: distances from the base tangent points, radii of curvature of the flanks."""
        travel = np.asarray(mesh_cycles, dtype=np.float64) - pair
        rho_1: FloatArray = self.start_radius_mm + travel * self.base_pitch_mm
        rho_2: FloatArray = self.action_length_mm - rho_1
        return rho_1, rho_2

    def sliding_speed_m_s(self, mesh_cycles: FloatArray | float, driver_speed_rpm: float, pair: int = 0) -> FloatArray:
        """v_s = −ω1 ρ1 + ω2 ρ2: positive in approach, zero at the pitch point, negative in recess."""
        omega_1 = driver_speed_rpm * pi / 30.0
        omega_2 = omega_1 * self.driver.teeth / self.driven.teeth
        rho_1, rho_2 = self.contact_radii_mm(mesh_cycles, pair)
        return (omega_2 * rho_2 - omega_1 * rho_1) * 1e-3

    @cached_property
    def _tight_angle_rad(self) -> float:
        gear_1, gear_2 = self.driver, self.driven
        alpha = gear_1.pressure_angle_rad
        shift = 2.0 * (gear_1.profile_shift + gear_2.profile_shift) * tan(alpha) / (gear_1.teeth + gear_2.teeth)
        value = float(involute(alpha)) + shift
        if value < 0.0:
            raise InputError("the sum of the profile shifts is too negative for these teeth", allowed="inv α_w above 0")
        return inverse_involute(value)

    def _check_match(self) -> None:
        for name in ("module_mm", "pressure_angle_deg"):
            first, second = getattr(self.driver, name), getattr(self.driven, name)
            if abs(first - second) > 1e-9 * first:
                raise InputError(f"{name} is {first:g} and {second:g}", allowed="the same of both gears")

    def _check_distance(self, distance_mm: float) -> None:
        tight = (self.driver.base_radius_mm + self.driven.base_radius_mm) / cos(self._tight_angle_rad)
        if distance_mm < tight * (1.0 - 1e-12):
            raise InputError(
                f"centre_distance_mm is {distance_mm:g} mm: the teeth jam",
                allowed=f"at least {tight:.6g} mm",
                remedy="widen the distance or lower the profile shifts",
            )

    def _check_interference(self) -> None:
        low_1, low_2 = self.start_radius_mm, self.action_length_mm - self.end_radius_mm
        for gear, low, whose in ((self.driver, low_1, "driven gear"), (self.driven, low_2, "driver")):
            form = gear.form_roll_rad * gear.base_radius_mm
            if low < form - 1e-9 * gear.module_mm:
                raise InputError(
                    f"interference: the {whose}'s tip reaches {form - low:.3g} mm below the end of its mate's involute",
                    allowed="contact on the involute only",
                    remedy="lower that gear's addendum, shift the mate's profile outwards or cut its fillet deeper",
                )

    def _check_clearance(self) -> None:
        for gear, mate in ((self.driver, self.driven), (self.driven, self.driver)):
            clearance = self.centre_distance - gear.tip_radius_mm - mate.root_radius_mm
            if clearance <= 0.0:
                raise InputError(
                    f"the tip of the gear of {gear.teeth} teeth cuts {-clearance:.3g} mm into its mate's root",
                    allowed="a tip clearance above 0",
                    remedy="lower the addendum or raise the mate's dedendum",
                )


def _roll_length_mm(gear: GearGeometry, radius_mm: float) -> float:
    return sqrt(radius_mm**2 - gear.base_radius_mm**2)


# Places on a flank: roll length, arc length, and how far a zone of contact reaches.

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
    return rho**2 / (2.0 * gear.base_radius_mm)


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
    return rho * (pair.action_length_mm - rho) / pair.action_length_mm


def contact_half_width_mm(pair: PairGeometry, material_1: Material, material_2: Material) -> float:
    """Half the width of the zone of contact along the flank, a = 2 R p/E*, at the pitch point and 1 GPa.

    Source: K. L. Johnson, *Contact Mechanics*, 1985, ch. 4.
    """
    radius = float(curvature_radius_mm(pair, pair.pitch_point_radius_mm))
    return 2.0 * radius * WORKING_PRESSURE_PA * flexibility_per_pa(material_1, material_2)


def flexibility_per_pa(material_1: Material, material_2: Material) -> float:
    """1/E* = (1 − ν1²)/E1 + (1 − ν2²)/E2 of two bodies in contact."""
    return sum((1.0 - m.poisson_ratio**2) / m.youngs_modulus_pa for m in (material_1, material_2))


def part_inside(place_mm: FloatArray, low_mm: float, high_mm: float, half_width_mm: float) -> FloatArray:
    """Part of a zone of contact around each place that lies between two others, 0 to 1, with smooth edges.

    A part shorter than the zone never takes all of it, so that the part goes to 0 with it.
    """
    width = 2.0 * half_width_mm
    begun = smooth_step((place_mm - low_mm) / width + 0.5)
    return begun - smooth_step((place_mm - high_mm) / width + 0.5)


def smooth_step(t: FloatArray) -> FloatArray:
    """Return 6t⁵ − 15t⁴ + 10t³, from 0 at t ≤ 0 to 1 at t ≥ 1 with two continuous derivatives."""
    u = np.clip(t, 0.0, 1.0)
    return u**3 * (u * (6.0 * u - 15.0) + 10.0)


def corner_separation_m(
    pair: PairGeometry, progress: FloatArray, tips_lost_mm: tuple[float, float] = (0.0, 0.0)
) -> FloatArray:
    """Distance between the unloaded flanks of a pair along the line of action; 0 on the path of contact, else above 0.

    Before ζ = 0 the tip corner of the driven gear has not yet reached the line of action. The involute of the driver
    that runs through the corner starts ahead of the driver's own flank, and r_b1 times that angle is what the driver
    would have to yield by for the two to touch. Beyond ζ = ε the gears change places.

    Parameters
    ----------
    pair : PairGeometry
    progress : array, (n,)
        ζ, base pitches since the ideal entry.
    tips_lost_mm : (float, float)
        Height that a chip took off the driver's and the driven gear's tooth. What is left ends in a corner, too, which
        comes to the line of action later, or leaves it earlier.

    Returns
    -------
    array, (n,)
        m.
    """
    rb1, rb2 = pair.driver.base_radius_mm, pair.driven.base_radius_mm
    length = pair.action_length_mm
    end, mate_end = (
        sqrt(max((gear.tip_radius_mm - lost) ** 2 - gear.base_radius_mm**2, 0.0))
        for gear, lost in zip((pair.driver, pair.driven), tips_lost_mm, strict=True)
    )
    start, at = length - mate_end, pair.contact_radii_mm(progress)[0]
    entry = _corner_mm(rb1, rb2, length, start, np.maximum(start - at, 0.0))
    leave = _corner_mm(rb2, rb1, length, length - end, np.maximum(at - end, 0.0))
    return 1e-3 * (entry + leave)


def _corner_mm(rb_flank: float, rb_tip: float, length: float, start: float, before: FloatArray) -> FloatArray:
    """Separation of a tip corner that still has `before` to go along the line of action, mm.

    Origin at the flank's base tangent point, y along the line of action; centres at (−rb_flank, 0), (rb_tip, length).
    """
    turn = before / rb_tip
    x, y = -rb_tip, start - length
    corner_x = rb_tip + x * np.cos(turn) - y * np.sin(turn)
    corner_y = length + x * np.sin(turn) + y * np.cos(turn)
    across, up = corner_x + rb_flank, corner_y
    radius = np.hypot(across, up)
    tangent = np.sqrt(np.maximum((radius / rb_flank) ** 2 - 1.0, 0.0))
    base_angle = np.arctan2(up, across) + tangent - np.arctan(tangent)
    roll = (start - before) / rb_flank
    return np.where(before > 0.0, rb_flank * (base_angle - roll), 0.0)
