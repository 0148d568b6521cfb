"""A pair of gears with all that decides how stiff its mesh is."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import floor

import numpy as np

from gearsig.checks import FloatArray, one_of, within
from gearsig.errors import InputError
from sims.mesh.crack import RootCrack, check_crack
from sims.mesh.deviation import IDEAL_FLANK, FlankDeviation, check_deviation
from sims.mesh.foundation import foundation_compliance, foundation_notes
from sims.mesh.geometry import GearGeometry
from sims.mesh.material import STEEL, Material
from sims.mesh.pair import PairGeometry
from sims.mesh.stiffness_hertz import CONTACT_LAWS, linear_contact_compliance, load_dependent_contact_coefficient
from sims.mesh.stiffness_tooth import cracked_tooth_compliance, tooth_compliance


@dataclass(frozen=True)
class GearMesh:
    """Geometry, material, contact law, cracks and flank deviations of a pair; 1 is the driver, 2 the driven gear.

    Parameters
    ----------
    pair : PairGeometry
    material_1, material_2 : Material
    contact_law : str
        "linear": a constant contact stiffness. "load-dependent": approach by the 0.9th power of the force.
    cracks_1, cracks_2 : tuple of RootCrack
        At most one per tooth.
    flank_1, flank_2 : FlankDeviation
    ramp : float
        In base pitches, 0 to 0.1: over this length, half before and half after the ideal point, a pair takes up and
        gives up its stiffness. 0 switches at once, which costs an integrator its order.

    Notes
    -----
    Every pair has its own compliance and separation; pairs act in parallel. Neglected: coupling of neighbouring teeth
    through the body, misalignment along the face, heating. Only the driving flanks are described.
    """

    pair: PairGeometry
    material_1: Material = STEEL
    material_2: Material = STEEL
    contact_law: str = "linear"
    cracks_1: tuple[RootCrack, ...] = ()
    cracks_2: tuple[RootCrack, ...] = ()
    flank_1: FlankDeviation = IDEAL_FLANK
    flank_2: FlankDeviation = IDEAL_FLANK
    ramp: float = 0.05

    def __post_init__(self) -> None:
        one_of(self.contact_law, "contact_law", CONTACT_LAWS)
        within(self.ramp, "ramp", 0.0, 0.1, "base pitches")
        sides = ((self.pair.driver, self.cracks_1, self.flank_1), (self.pair.driven, self.cracks_2, self.flank_2))
        for gear, cracks, flank in sides:
            check_deviation(gear, flank)
            for crack in cracks:
                check_crack(gear, crack)
            if len({crack.tooth for crack in cracks}) < len(cracks):
                raise InputError("two cracks on one tooth", allowed="one crack per tooth", remedy="give the deeper one")
        self._check_corner_contact()

    @property
    def face_width_m(self) -> float:
        """Loaded width."""
        return self.pair.face_width_mm * 1e-3

    @property
    def n_slots(self) -> int:
        """Most pairs that carry load at once, ramps included."""
        return floor(self.pair.contact_ratio + self.ramp) + 1

    @cached_property
    def contact_coefficient(self) -> float:
        """Compliance of the contact in m/N (linear), or B in m/N^0.9 (load-dependent)."""
        law = linear_contact_compliance if self.contact_law == "linear" else load_dependent_contact_coefficient
        return law(self.material_1, self.material_2, self.face_width_m)

    @cached_property
    def notes(self) -> tuple[str, ...]:
        """Where the mesh lies outside the range of its formulas; empty if nowhere."""
        return foundation_notes(self.pair.driver) + foundation_notes(self.pair.driven)

    def gear_compliance(self, side: int, progress: FloatArray, crack: RootCrack | None = None) -> FloatArray:
        """Tooth and foundation of one gear, in m/N.

        Parameters
        ----------
        side : int
            1 for the driver, 2 for the driven gear.
        progress : array
            ζ = c − k, base pitches since the pair's ideal entry, 0 to the contact ratio.
        crack : RootCrack or None
        """
        gear, roll = self._roll(side, progress)
        material, width = (self.material_1 if side == 1 else self.material_2), self.face_width_m
        if crack is None:
            tooth = tooth_compliance(gear, material, roll).total / width
        else:
            tooth = cracked_tooth_compliance(gear, material, roll, crack, width)
        result: FloatArray = tooth + foundation_compliance(gear, material, roll - gear.base_half_angle_rad) / width
        return result

    def _roll(self, side: int, progress: FloatArray) -> tuple[GearGeometry, FloatArray]:
        rho_1, rho_2 = self.pair.contact_radii_mm(np.atleast_1d(np.asarray(progress, dtype=np.float64)))
        gear, rho = (self.pair.driver, rho_1) if side == 1 else (self.pair.driven, rho_2)
        # A ramp may begin just below the base circle, where there is no flank: the contact stays at its foot.
        return gear, np.maximum(rho / gear.base_radius_mm, 0.0)

    def _check_corner_contact(self) -> None:
        """During the ramps the flank is carried on a little beyond the tip; it must not end in a point there."""
        for gear in (self.pair.driver, self.pair.driven):
            roll = gear.tip_roll_rad + 0.5 * self.ramp * self.pair.base_pitch_mm / gear.base_radius_mm
            half_angle = gear.base_half_angle_rad - (roll - np.arctan(roll))
            if half_angle <= 0.0:
                raise InputError(
                    f"ramp is {self.ramp:g} base pitches: the tooth of the gear of {gear.teeth} teeth ends before",
                    allowed="a shorter ramp, or 0",
                    remedy="shorten the ramp or lower the addendum",
                )
