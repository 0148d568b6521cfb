"""A chipped tooth: a piece broken off its tip."""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt

import numpy as np

from gearsig.checks import FloatArray, count, not_negative, within
from gearsig.errors import InputError
from sims.mesh.flank import smooth_step
from sims.mesh.geometry import GearGeometry
from sims.mesh.pair import PairGeometry
from sims.mesh.spall import check_part_of_face, spans_face

GAP_M = 0.3e-3
"""Separation beyond the edge of a chip over the whole face: many times the deflection of a loaded pair."""
EDGE_BASE_PITCHES = 0.05
"""Over this length beyond a chip's edge contact is lost, as it is at the tip of a whole tooth."""


@dataclass(frozen=True)
class ToothChip:
    """A piece broken off the tip of one tooth.

    Parameters
    ----------
    height_mm : float
        Radially from the tip down, 0 to the height of the flank. 0: no chip.
    width_mm : float or None
        Across the face from one end, 0 to 0.9 of the face width, or all of it. None: all of it.
    tooth : int
        Which tooth of the gear, from 0.

    Notes
    -----
    Where contact lies beyond the chip's edge, the compliance of tooth and contact grows by 1/(1 − w/b) for a chip over
    part of the face; over the whole face there is nothing to touch. The driving flank alone is described, and the mass
    of the piece is not taken off the gear.
    """

    height_mm: float
    width_mm: float | None = None
    tooth: int = 0

    def __post_init__(self) -> None:
        not_negative(self.height_mm, "height_mm of the chip", "mm")
        if self.width_mm is not None:
            not_negative(self.width_mm, "width_mm of the chip", "mm")
        count(self.tooth, "tooth of the chip", minimum=0)


def highest_chip_mm(gear: GearGeometry) -> float:
    """Radial height of the involute flank, from the end of the fillet to the tip."""
    return gear.tip_radius_mm - gear.form_radius_mm


def check_chip(pair: PairGeometry, side: int, chip: ToothChip) -> None:
    """Refuse a chip higher than the flank, wider than the face, or on a tooth that is not there."""
    gear = pair.driver if side == 1 else pair.driven
    highest = highest_chip_mm(gear)
    if chip.height_mm > highest:
        raise InputError(
            f"height_mm of the chip is {chip.height_mm:g} mm: it is higher than the flank",
            allowed=f"0 to {highest:.3g} mm from the tip down",
        )
    if chip.width_mm is not None:
        check_part_of_face(chip.width_mm, "width_mm of the chip", pair.face_width_mm)
    within(chip.tooth, "tooth of the chip", 0, gear.teeth - 1)


def chip_share(pair: PairGeometry, side: int, chip: ToothChip, roll_length_mm: FloatArray) -> FloatArray:
    """Part of the width that a chip over part of the face takes away, 0 to 0.9; 0 if it spans the whole face.

    Parameters
    ----------
    roll_length_mm : array
        ρ of the gear that has the chip.
    """
    if _is_whole(pair, chip):
        return np.zeros(np.shape(roll_length_mm))
    part = (chip.width_mm or 0.0) / pair.face_width_mm
    result: FloatArray = part * _beyond_edge(pair, side, chip, roll_length_mm)
    return result


def chip_separation_m(pair: PairGeometry, side: int, chip: ToothChip, roll_length_mm: FloatArray) -> FloatArray:
    """Separation by a chip over the whole face, up to 0.3 mm within 0.05 base pitches of its edge; 0 if less wide."""
    if not _is_whole(pair, chip):
        return np.zeros(np.shape(roll_length_mm))
    result: FloatArray = GAP_M * _beyond_edge(pair, side, chip, roll_length_mm)
    return result


def _is_whole(pair: PairGeometry, chip: ToothChip) -> bool:
    return chip.width_mm is None or spans_face(chip.width_mm, pair.face_width_mm)


def _beyond_edge(pair: PairGeometry, side: int, chip: ToothChip, roll_length_mm: FloatArray) -> FloatArray:
    """0 below the chip's edge, 1 beyond it; less than 1 for a chip smaller than the edge's own length."""
    gear = pair.driver if side == 1 else pair.driven
    tip = gear.tip_roll_rad * gear.base_radius_mm
    edge = sqrt((gear.tip_radius_mm - chip.height_mm) ** 2 - gear.base_radius_mm**2)
    length = EDGE_BASE_PITCHES * pair.base_pitch_mm
    # Contact on a whole tooth also goes on a little beyond the tip; without this it would jump with the first chip.
    lost = min(1.0, (tip - edge) / length)
    result: FloatArray = lost * smooth_step((np.asarray(roll_length_mm, dtype=np.float64) - edge) / length)
    return result
