"""Exact involute kinematics of a standard spur pair, and its stiffness after ISO 6336 and Cai–Hayashi."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import cos, pi, radians, sin, sqrt, tan

import numpy as np

from gearsig.checks import FloatArray, count, positive, within
from gearsig.errors import InputError

STEEL_DENSITY = 7850.0
REACH = 0.35
"""Base pitches beyond either end of the path of contact at which a loaded pair may already or still touch."""
N_PATH = 384
"""Points of the tables over the path of contact."""


@dataclass(frozen=True)
class SpurPair:
    """A standard spur pair (addendum one module, no profile shift); gear 1 drives.

    Places on the path of contact are counted in base pitches from its start A (tip of the driven gear):
    0 at A, the contact ratio at E.
    """

    z1: int
    z2: int
    module_mm: float
    face_mm: float
    pressure_angle_deg: float = 20.0

    def __post_init__(self) -> None:
        for name, teeth in (("z1", self.z1), ("z2", self.z2)):
            count(teeth, name, minimum=17, remedy="fewer teeth are undercut")
        positive(self.module_mm, "module_mm", "mm")
        positive(self.face_mm, "face_mm", "mm")
        within(self.pressure_angle_deg, "pressure_angle_deg", 14.5, 30, "deg")
        if self.rho_start_m <= 0:
            raise InputError(f"{self.z1}/{self.z2} teeth interfere at the root of gear 1", remedy="take more teeth")

    @cached_property
    def alpha(self) -> float:
        """Pressure angle, rad."""
        return radians(self.pressure_angle_deg)

    @cached_property
    def pitch_radii_m(self) -> tuple[float, float]:
        """Half of module times teeth."""
        return self.module_mm * self.z1 / 2000, self.module_mm * self.z2 / 2000

    @cached_property
    def base_radii_m(self) -> tuple[float, float]:
        """Pitch radius times cos(pressure angle)."""
        r1, r2 = self.pitch_radii_m
        return r1 * cos(self.alpha), r2 * cos(self.alpha)

    @cached_property
    def tip_radii_m(self) -> tuple[float, float]:
        """Pitch radius plus module."""
        r1, r2 = self.pitch_radii_m
        return r1 + self.module_mm / 1000, r2 + self.module_mm / 1000

    @property
    def base_pitch_m(self) -> float:
        """Distance of equal flanks along the line of action."""
        return pi * self.module_mm / 1000 * cos(self.alpha)

    @property
    def centre_distance_m(self) -> float:
        """Sum of the pitch radii."""
        return sum(self.pitch_radii_m)

    @property
    def rho_start_m(self) -> float:
        """Curvature radius of gear 1 at A."""
        rb2, ra2 = self.base_radii_m[1], self.tip_radii_m[1]
        return self.centre_distance_m * sin(self.alpha) - sqrt(ra2**2 - rb2**2)

    @cached_property
    def contact_ratio(self) -> float:
        """Length of the path of contact over the base pitch."""
        rb1, ra1 = self.base_radii_m[0], self.tip_radii_m[0]
        return (sqrt(ra1**2 - rb1**2) - self.rho_start_m) / self.base_pitch_m

    @property
    def pitch_point(self) -> float:
        """Place of the pitch point on the path."""
        return (self.base_radii_m[0] * tan(self.alpha) - self.rho_start_m) / self.base_pitch_m

    @cached_property
    def path(self) -> FloatArray:
        """Places of the tables, (N_PATH,)."""
        return np.linspace(-REACH, self.contact_ratio + REACH, N_PATH)

    def rho_m(self, place: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Curvature radii of both flanks at places on the path."""
        rho1 = self.rho_start_m + place * self.base_pitch_m
        return rho1, self.centre_distance_m * sin(self.alpha) - rho1

    def mean_stiffness_n_per_m(self) -> float:
        """Mesh stiffness of the whole width, c_γ b.

        c' = 0.8 C_B / q', q' = 0.04723 + 0.15551/z1 + 0.25791/z2, c_γ = c'(0.75 ε + 0.25), per mm and µm.

        Source: ISO 6336-1, *Calculation of load capacity of spur and helical gears*, method B, no profile shift.
        """
        q = 0.04723 + 0.15551 / self.z1 + 0.25791 / self.z2
        c_pair = 0.8 * 0.975 / q
        return c_pair * (0.75 * self.contact_ratio + 0.25) * self.face_mm * 1e6

    def pair_stiffness_n_per_m(self) -> FloatArray:
        """Stiffness of one tooth pair over the path, (N_PATH,); its sum over pairs has the mean of ISO 6336.

        A parabola from 0.55 at the ends to 1 in the middle; held at 0.55 beyond.

        Source: Y. Cai and T. Hayashi, The linear approximated equation of vibration of a pair of spur gears,
        *ASME J. Mech. Des.* 116 (1994).
        """
        s = np.clip(self.path / self.contact_ratio, 0.0, 1.0)
        shape = -1.8 * s**2 + 1.8 * s + 0.55
        return np.asarray(self.mean_stiffness_n_per_m() / (0.85 * self.contact_ratio) * shape)

    def end_gap_m(self) -> FloatArray:
        """Separation of an unloaded pair off the path's ends, (N_PATH,): tip corner against flank."""
        pb, place = self.base_pitch_m, self.path
        gap = np.zeros(N_PATH)
        early, late = place < 0, place > self.contact_ratio
        gap[early] = self.corner_gap_m(0, -place[early] * pb)
        gap[late] = self.corner_gap_m(1, (place[late] - self.contact_ratio) * pb)
        return gap

    def end_shift_per_m(self) -> tuple[float, float]:
        """Base pitches by which the path's ends A and E move per metre of growth in centre distance.

        ρ1 grows by 1/sin α at A and not at E; the line of action turns by cot α / a, which gear 1 has to follow.
        """
        turn = self.base_radii_m[0] / tan(self.alpha) / self.centre_distance_m
        return (1 / sin(self.alpha) - turn) / self.base_pitch_m, -turn / self.base_pitch_m

    def corner_gap_m(self, flank: int, distance_m: FloatArray, tip_loss_m: float = 0.0) -> FloatArray:
        """Gap along the base circle of gear `flank` to the other's tip corner, that far from the path's end.

        A tip that lost `tip_loss_m` of its height ends the path earlier.

        Own centre at 0, the other at (a, 0). The flank's involute starts at the polar angle β = α − ρ/r_b; the
        corner at polar angle ψ and radius r touches an involute with β = ψ − inv(r). The gap is r_b times the
        difference from where conjugate motion has put the flank.
        """
        other = 1 - flank
        rb, rb_other, ra_other = self.base_radii_m[flank], self.base_radii_m[other], self.tip_radii_m[other]
        ra_other -= tip_loss_m
        a, alpha = self.centre_distance_m, self.alpha
        rho_other = sqrt(ra_other**2 - rb_other**2)
        rho = a * sin(alpha) - rho_other
        contact = np.array([rb * cos(alpha) + rho * sin(alpha), rb * sin(alpha) - rho * cos(alpha)])
        chi = np.arctan2(contact[1], contact[0] - a) - distance_m / rb_other
        x, y = a + ra_other * np.cos(chi), ra_other * np.sin(chi)
        roll = np.sqrt(np.maximum((x**2 + y**2) / rb**2 - 1, 0.0))
        needed = np.arctan2(y, x) - (roll - np.arctan(roll))
        return np.asarray(np.maximum(rb * (alpha - (rho - distance_m) / rb - needed), 0.0))

    def gear_mass_kg(self, gear: int) -> float:
        """Mass of a solid disc of pitch radius."""
        return STEEL_DENSITY * pi * self.pitch_radii_m[gear] ** 2 * self.face_mm / 1000

    def gear_inertia_kgm2(self, gear: int) -> float:
        """Polar inertia of the same disc."""
        return 0.5 * self.gear_mass_kg(gear) * self.pitch_radii_m[gear] ** 2
