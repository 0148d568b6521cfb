"""A pair of gears with all that decides how stiff its mesh is."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import floor, pi
from typing import NamedTuple

import numpy as np

from gearsig.checks import FloatArray, one_of, within
from gearsig.errors import InputError
from sims.mesh.chip import ToothChip, check_chip, chip_share
from sims.mesh.crack import RootCrack, check_crack
from sims.mesh.deviation import IDEAL_FLANK, FlankDeviation, check_deviation
from sims.mesh.flank import WORKING_PRESSURE_PA, contact_half_width_mm
from sims.mesh.foundation import foundation_compliance, foundation_notes
from sims.mesh.geometry import GearGeometry
from sims.mesh.material import STEEL, Material
from sims.mesh.pair import PairGeometry
from sims.mesh.roughness import FlankRoughness
from sims.mesh.spall import ToothSpall, check_spall, spall_share
from sims.mesh.stiffness_hertz import CONTACT_LAWS, linear_contact_compliance, load_dependent_contact_coefficient
from sims.mesh.stiffness_tooth import cracked_tooth_compliance, tooth_compliance


class MeshSide(NamedTuple):
    """One gear of a mesh, and what is its own."""

    gear: GearGeometry
    material: Material
    flank: FlankDeviation
    roughness: FlankRoughness | None
    cracks: tuple[RootCrack, ...]
    spalls: tuple[ToothSpall, ...]
    chips: tuple[ToothChip, ...]

    def faults_of(self, tooth: int) -> ToothFaults:
        """What is wrong with one tooth."""
        crack = next((fault for fault in self.cracks if fault.tooth == tooth), None)
        spall = next((fault for fault in self.spalls if fault.tooth == tooth), None)
        chip = next((fault for fault in self.chips if fault.tooth == tooth), None)
        return ToothFaults(crack, spall, chip)

    @property
    def faulty_teeth(self) -> tuple[int, ...]:
        """Teeth with a crack, a spall or a chip, in rising order."""
        return tuple(sorted(_teeth(self.cracks) | _teeth(self.spalls) | _teeth(self.chips)))


class ToothFaults(NamedTuple):
    """Faults of one tooth; none by default."""

    crack: RootCrack | None = None
    spall: ToothSpall | None = None
    chip: ToothChip | None = None


SOUND = ToothFaults()
"""A tooth without a fault."""


@dataclass(frozen=True)
class GearMesh:
    """Geometry, material, contact law, faults and flanks of a pair; 1 is the driver, 2 the driven gear.

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
    roughness_1, roughness_2 : FlankRoughness or None
        A profile of its own for each tooth, which returns with the tooth.
    spalls_1, spalls_2 : tuple of ToothSpall
        At most one per tooth.
    chips_1, chips_2 : tuple of ToothChip
        At most one per tooth.

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
    roughness_1: FlankRoughness | None = None
    roughness_2: FlankRoughness | None = None
    spalls_1: tuple[ToothSpall, ...] = ()
    spalls_2: tuple[ToothSpall, ...] = ()
    chips_1: tuple[ToothChip, ...] = ()
    chips_2: tuple[ToothChip, ...] = ()

    def __post_init__(self) -> None:
        one_of(self.contact_law, "contact_law", CONTACT_LAWS)
        within(self.ramp, "ramp", 0.0, 0.1, "base pitches")
        for number in (1, 2):
            side = self.side(number)
            check_deviation(side.gear, side.flank)
            self._check_faults(number)
            _check_roughness(side)
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

    @cached_property
    def contact_compliance(self) -> float:
        """Compliance of the contact in m/N at working pressure: the constant one, or the secant B N^-0.1 at 1 GPa."""
        if self.contact_law == "linear":
            return self.contact_coefficient
        half_width_m = contact_half_width_mm(self.pair, self.material_1, self.material_2) * 1e-3
        force = pi / 2.0 * half_width_m * WORKING_PRESSURE_PA * self.face_width_m
        return float(self.contact_coefficient * force**-0.1)

    def side(self, number: int) -> MeshSide:
        """Return gear 1, the driver, or gear 2, the driven one, with what is its own."""
        if number == 1:
            one = (self.pair.driver, self.material_1, self.flank_1, self.roughness_1)
            return MeshSide(*one, self.cracks_1, self.spalls_1, self.chips_1)
        two = (self.pair.driven, self.material_2, self.flank_2, self.roughness_2)
        return MeshSide(*two, self.cracks_2, self.spalls_2, self.chips_2)

    def roll_length_mm(self, side: int, progress: FloatArray) -> FloatArray:
        """ρ of gear 1 or 2 at ζ, not below 0: a ramp may begin below the base circle, where there is no flank."""
        rho: FloatArray = self.pair.contact_radii_mm(np.atleast_1d(np.asarray(progress, dtype=np.float64)))[side - 1]
        return np.maximum(rho, 0.0)

    def gear_compliance(self, side: int, progress: FloatArray, faults: ToothFaults = SOUND) -> FloatArray:
        """Tooth and foundation of one gear, and what a spall or chip adds to tooth and contact, in m/N.

        c = c_tooth/(1 − λ_chip) + c_foundation + c_h [λ_spall/(1 − λ_spall) + λ_chip/(1 − λ_chip)]

        with the part λ of the width that the fault takes away. The contact of sound flanks, c_h, is not in it.

        Parameters
        ----------
        side : int
            1 for the driver, 2 for the driven gear.
        progress : array
            ζ = c − k, base pitches since the pair's ideal entry, 0 to the contact ratio.
        faults : ToothFaults
            Of the tooth.
        """
        gear, material = self.side(side)[:2]
        width, rho = self.face_width_m, self.roll_length_mm(side, progress)
        roll = rho / gear.base_radius_mm
        if faults.crack is None:
            tooth = tooth_compliance(gear, material, roll).total / width
        else:
            tooth = cracked_tooth_compliance(gear, material, roll, faults.crack, width)
        foundation = foundation_compliance(gear, material, roll - gear.base_half_angle_rad) / width
        result: FloatArray = tooth + foundation + self._lost_width_compliance(side, rho, faults, tooth)
        return result

    def _lost_width_compliance(self, side: int, rho: FloatArray, faults: ToothFaults, tooth: FloatArray) -> FloatArray:
        extra = np.zeros_like(rho)
        if faults.spall is not None:
            lost = spall_share(self.pair, side, (self.material_1, self.material_2), faults.spall, rho)
            extra += self.contact_compliance * lost / (1.0 - lost)
        if faults.chip is not None:
            lost = chip_share(self.pair, side, faults.chip, rho)
            extra += (tooth + self.contact_compliance) * lost / (1.0 - lost)
        return extra

    def _check_faults(self, number: int) -> None:
        side = self.side(number)
        for crack in side.cracks:
            check_crack(side.gear, crack)
        for spall in side.spalls:
            check_spall(self.pair, number, spall)
        for chip in side.chips:
            check_chip(self.pair, number, chip)
        for name, faults in (("crack", side.cracks), ("spall", side.spalls), ("chip", side.chips)):
            if len(_teeth(faults)) < len(faults):
                raise InputError(f"two {name}s on one tooth", allowed=f"one {name} per tooth", remedy="give the larger")

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


def _teeth(faults: tuple[RootCrack, ...] | tuple[ToothSpall, ...] | tuple[ToothChip, ...]) -> set[int]:
    return {fault.tooth for fault in faults}


def _check_roughness(side: MeshSide) -> None:
    if side.roughness is not None and side.roughness.n_teeth != side.gear.teeth:
        raise InputError(
            f"the roughness has profiles of {side.roughness.n_teeth} teeth", allowed=f"one per tooth, {side.gear.teeth}"
        )
