"""A spall: metal broken out of one flank, below the zone of contact."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gearsig.checks import FloatArray, count, not_negative, within
from gearsig.errors import InputError
from sims.mesh.flank import (
    arc_length_mm,
    contact_ends_mm,
    contact_half_width_mm,
    curvature_radius_mm,
    flank_length_mm,
    part_inside,
    pitch_point_mm,
)
from sims.mesh.material import Material
from sims.mesh.pair import PairGeometry

LARGEST_PART = 0.9
"""Greatest part of the face width that damage may take if it does not take all: what is left must carry the load."""


@dataclass(frozen=True)
class ToothSpall:
    """A pit with a flat floor on the driving flank of one tooth.

    Parameters
    ----------
    length_mm : float
        Arc length along the profile, 0 to the length of the flank. 0: no spall.
    width_mm : float
        Across the face, 0 to 0.9 of the face width, or all of it. 0: no spall.
    depth_um : float
        0 or above. 0: no spall.
    tooth : int
        Which tooth of the gear, from 0.
    centre : float or None
        Where its middle lies on the path of contact, 0 at this flank's root end to 1 at its tip end. None: at the pitch
        point.

    Notes
    -----
    Over part of the face, the flank beside it carries: see `spall_share`. Over the whole face, the mate sinks in as far
    as its curvature lets it: see `spall_separation_m`. Edges do not grow, and neither do they press into the mate.
    """

    length_mm: float
    width_mm: float
    depth_um: float = 100.0
    tooth: int = 0
    centre: float | None = None

    def __post_init__(self) -> None:
        not_negative(self.length_mm, "length_mm of the spall", "mm")
        not_negative(self.width_mm, "width_mm of the spall", "mm")
        not_negative(self.depth_um, "depth_um of the spall", "µm")
        count(self.tooth, "tooth of the spall", minimum=0)
        if self.centre is not None:
            within(self.centre, "centre of the spall", 0.0, 1.0, remedy="0 is the root end of the contact, 1 the tip")


def check_spall(pair: PairGeometry, side: int, spall: ToothSpall) -> None:
    """Refuse a spall longer than its flank, wider than the face, or on a tooth that is not there."""
    gear = pair.driver if side == 1 else pair.driven
    longest = flank_length_mm(gear)
    if spall.length_mm > longest:
        raise InputError(
            f"length_mm of the spall is {spall.length_mm:g} mm: it is longer than the flank",
            allowed=f"0 to {longest:.3g} mm along the profile",
        )
    check_part_of_face(spall.width_mm, "width_mm of the spall", pair.face_width_mm)
    within(spall.tooth, "tooth of the spall", 0, gear.teeth - 1)


def check_part_of_face(width_mm: float, name: str, face_width_mm: float) -> None:
    """Refuse a width beyond the loaded face, and one that leaves hardly a strip of it."""
    # A part given in percent of the face comes back from its width with a rounding error.
    if width_mm > face_width_mm * (1.0 + 1e-12) or LARGEST_PART + 1e-12 < width_mm / face_width_mm < 1.0 - 1e-12:
        raise InputError(
            f"{name} is {width_mm:g} mm on a loaded face of {face_width_mm:g} mm",
            allowed=f"0 to {LARGEST_PART * face_width_mm:g} mm, or {face_width_mm:g} mm for all of it",
            remedy="the strip that is left could not carry: give the whole face width"
            if width_mm < face_width_mm
            else "",
        )


def spans_face(width_mm: float, face_width_mm: float) -> bool:
    """Whether damage takes the whole loaded face."""
    return width_mm >= face_width_mm * (1.0 - 1e-12)


def spall_share(
    pair: PairGeometry,
    side: int,
    materials: tuple[Material, Material],
    spall: ToothSpall,
    roll_length_mm: FloatArray,
) -> FloatArray:
    """Part of the contact's width that a spall over part of the face takes away, λ; 0 if it spans the whole face.

    λ = (w/b) min(1, 2 R h/a²) · (part of the zone of contact, 2a wide, that lies in the spall)

    The compliance of the contact grows by 1/(1 − λ). a is taken at 1 GPa, as the load is not known here. a²/(2R) is the
    Hertzian flattening: a mate that meets a pit less deep than it still presses on the floor.

    Parameters
    ----------
    roll_length_mm : array
        ρ of the gear that has the spall.

    Returns
    -------
    array
        0 to 0.9.
    """
    if spans_face(spall.width_mm, pair.face_width_mm):
        return np.zeros(np.shape(roll_length_mm))
    gear = pair.driver if side == 1 else pair.driven
    half_width = contact_half_width_mm(pair, *materials)
    flattening = half_width**2 / (2.0 * float(curvature_radius_mm(pair, pair.pitch_point_radius_mm)))
    depth = min(1.0, spall.depth_um * 1e-3 / flattening)
    low, high = _ends_mm(pair, side, spall)
    inside = part_inside(arc_length_mm(gear, roll_length_mm), low, high, half_width)
    result: FloatArray = spall.width_mm / pair.face_width_mm * depth * inside
    return result


def spall_separation_m(pair: PairGeometry, side: int, spall: ToothSpall, roll_length_mm: FloatArray) -> FloatArray:
    """How far the mate sinks into a spall over the whole face, E = min(h, d²/(2R)); 0 if it is less wide.

    At a distance d inside the edge of a pit, a mate of relative curvature 1/R rests on that edge, d²/(2R) below its
    place on a whole flank, until it reaches the floor at h. A short pit is bridged.

    Parameters
    ----------
    roll_length_mm : array
        ρ of the gear that has the spall.
    """
    if not spans_face(spall.width_mm, pair.face_width_mm):
        return np.zeros(np.shape(roll_length_mm))
    gear = pair.driver if side == 1 else pair.driven
    place = arc_length_mm(gear, roll_length_mm)
    low, high = _ends_mm(pair, side, spall)
    inside = np.maximum(np.minimum(place - low, high - place), 0.0)
    # R is 0 at the base circle, where no contact can be; the floor bounds the sinking there.
    sunk = inside**2 / np.maximum(2.0 * curvature_radius_mm(pair, roll_length_mm), 1e-12)
    result: FloatArray = np.minimum(spall.depth_um * 1e-6, sunk * 1e-3)
    return result


def _ends_mm(pair: PairGeometry, side: int, spall: ToothSpall) -> tuple[float, float]:
    """Arc lengths of its ends."""
    low, high = contact_ends_mm(pair, side)
    rho = pitch_point_mm(pair, side) if spall.centre is None else low + spall.centre * (high - low)
    middle = float(arc_length_mm(pair.driver if side == 1 else pair.driven, rho))
    return middle - spall.length_mm / 2.0, middle + spall.length_mm / 2.0
