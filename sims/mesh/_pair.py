"""Two gears in mesh: centre distance, line of action, which tooth pairs touch and where."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import acos, ceil, cos, pi, sin, sqrt, tan

import numpy as np

from gearsig.checks import FloatArray, positive
from gearsig.errors import InputError
from sims.mesh._geometry import GearGeometry, Material, inverse_involute, involute


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
        speed: FloatArray = (omega_2 * rho_2 - omega_1 * rho_1) * 1e-3
        return speed

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
    result: FloatArray = 1e-3 * (entry + leave)
    return result


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
    result: FloatArray = np.where(before > 0.0, rb_flank * (base_angle - roll), 0.0)
    return result
