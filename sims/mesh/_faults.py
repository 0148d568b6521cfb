"""Faults of single teeth: a crack at the root, a spall on the flank, a tip chipped off; what each leaves."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from math import cos, pi, radians, sin

import numpy as np

from gearsig.checks import FloatArray, count, not_negative, one_of, positive, within
from gearsig.errors import InputError
from sims.mesh._geometry import (
    GearGeometry,
    Material,
    PairGeometry,
    arc_length_mm,
    contact_ends_mm,
    contact_half_width_mm,
    corner_separation_m,
    curvature_radius_mm,
    fillet_outline,
    flank_length_mm,
    involute_outline,
    part_inside,
    pitch_point_mm,
    tip_point_mm,
)

MIN_SECTION = 0.1
"""Part of a section's thickness that a crack must leave; a tooth with less counts as broken."""


@dataclass(frozen=True)
class RootCrack:
    """A straight crack from the middle of the loaded flank's fillet into the tooth root.

    Parameters
    ----------
    depth_mm : float
        Length of the crack in the cross-section, above 0. How deep it may be: see `deepest_crack_mm`.
    angle_deg : float
        ϑ between the crack and the tooth's centre line, 15 to 90; 90 runs straight across the tooth.
    tooth : int
        Which tooth of the gear, from 0.
    width_mm : float or None
        How far it reaches over the face width from one end, everywhere as deep; None: all through.

    Notes
    -----
    It lies on the side that is in tension while the tooth drives. Loaded on the back flank it closes, and the tooth is
    as stiff as a whole one.
    """

    depth_mm: float
    angle_deg: float = 45.0
    tooth: int = 0
    width_mm: float | None = None

    def __post_init__(self) -> None:
        positive(self.depth_mm, "depth_mm of the crack", "mm", remedy="leave out the crack for a healthy tooth")
        _angle_rad(self.angle_deg)
        count(self.tooth, "tooth of the crack", minimum=0)
        if self.width_mm is not None:
            positive(self.width_mm, "width_mm of the crack", "mm")


def crack_mouth_mm(gear: GearGeometry) -> tuple[float, float]:
    """Middle of the fillet, x and y (half way in γ), where a crack starts."""
    point = fillet_outline(gear, np.array([(pi / 2.0 + gear.pressure_angle_rad) / 2.0]))
    return float(point.x_mm[0]), float(point.y_mm[0])


def crack_tip_mm(gear: GearGeometry, depth_mm: float, angle_deg: float) -> tuple[float, float]:
    """Tip of the crack, x and y: inwards along the centre line and across it."""
    x, y = crack_mouth_mm(gear)
    angle = _angle_rad(angle_deg)
    return x - depth_mm * cos(angle), y - depth_mm * sin(angle)


def crack_percent(gear: GearGeometry, depth_mm: float, angle_deg: float = 45.0) -> float:
    """Depth across the tooth as a percentage of the root's thickness at the crack's mouth, 100 q sin ϑ/(2 y)."""
    return 100.0 * depth_mm * sin(_angle_rad(angle_deg)) / (2.0 * crack_mouth_mm(gear)[1])


CRACK_LAWS = ("two lines", "limiting line", "parallel line")
"""What of a tooth carries no load behind a crack; see `effective_flank_mm`."""


def effective_flank_mm(
    gear: GearGeometry,
    depth_mm: float,
    angle_deg: float,
    x_mm: FloatArray,
    y_mm: FloatArray,
    law: str = "two lines",
) -> FloatArray:
    """Where the loaded side of each section ends, behind a crack: y less the part that carries no load.

    - two lines: they run to the tooth tip, one from the crack's mouth and one from its tip. What lies between them
      carries no load; between the crack's tip and its mouth, what lies outside the second line. Without depth nothing
      is lost, so that the stiffness falls steadily from the healthy tooth's.
    - limiting line: what lies outside the second line carries no load, as is common. It takes the bulge of the flank
      off a tooth whose crack has no depth yet.
    - parallel line: what lies further from the tooth's centre line than the crack's tip carries no load.

    Parameters
    ----------
    gear : GearGeometry
    depth_mm, angle_deg : float
    x_mm, y_mm : arrays
        Outline of the loaded side.
    law : str
        One of `CRACK_LAWS`.

    Source: Z. Chen, Y. Shao (2011), see `cracked_tooth_compliance`, for the limiting line; X. Tian (2004), see
    `tooth_compliance`, for the parallel one.
    """
    one_of(law, "law", CRACK_LAWS)
    x_mouth, y_mouth = crack_mouth_mm(gear)
    x_end, y_end = crack_tip_mm(gear, depth_mm, angle_deg)
    x_tip, y_tip = tip_point_mm(gear)
    behind = y_end + (y_tip - y_end) * (x_mm - x_end) / (x_tip - x_end)
    if law != "two lines":
        limit = behind if law == "limiting line" else np.full_like(x_mm, y_end)
        return np.where(x_mm >= x_end, np.minimum(y_mm, limit), y_mm)
    before = y_mouth + (y_tip - y_mouth) * (x_mm - x_mouth) / (x_tip - x_mouth)
    lost = np.where(x_mm >= x_mouth, np.maximum(before - behind, 0.0), np.maximum(y_mm - behind, 0.0))
    return np.where(x_mm >= x_end, y_mm - lost, y_mm)


@lru_cache(maxsize=256)
def deepest_crack_mm(gear: GearGeometry, angle_deg: float = 45.0) -> float:
    """Deepest crack that leaves a tenth of the root and of every section, and stays in the outer half of the rim."""
    from scipy.optimize import brentq

    def spare(depth: float) -> float:
        return _least_section(gear, depth, angle_deg) - MIN_SECTION

    sine, cosine = sin(_angle_rad(angle_deg)), cos(_angle_rad(angle_deg))
    across = (1.0 - MIN_SECTION) * 2.0 * crack_mouth_mm(gear)[1] / sine
    inwards = crack_mouth_mm(gear)[0] - (gear.bore_mm + gear.root_radius_mm) / 2.0
    limit = min(across, inwards / cosine) if cosine > 1e-9 else across
    return limit if spare(limit) >= 0.0 else float(brentq(spare, 1e-6 * gear.module_mm, limit, xtol=1e-9))


def check_crack(gear: GearGeometry, crack: RootCrack) -> None:
    """Refuse a crack that goes past the tooth, is wider than the gear, or sits on a tooth that is not there."""
    deepest = deepest_crack_mm(gear, crack.angle_deg)
    if crack.depth_mm > deepest:
        raise InputError(
            f"depth_mm of the crack is {crack.depth_mm:g} mm at {crack.angle_deg:g}°: it goes past the tooth",
            allowed=f"above 0 to {deepest:.3g} mm ({crack_percent(gear, deepest, crack.angle_deg):.0f} % of the root)",
            remedy="take a shallower crack, or a chipped tooth",
        )
    if crack.width_mm is not None:
        within(crack.width_mm, "width_mm of the crack", 0.0, gear.face_width_mm, "mm")
    within(crack.tooth, "tooth of the crack", 0, gear.teeth - 1)


def _least_section(gear: GearGeometry, depth_mm: float, angle_deg: float) -> float:
    """Smallest part of a section's thickness that is left, over the tooth."""
    fillet = fillet_outline(gear, np.linspace(pi / 2.0, gear.pressure_angle_rad, 60))
    flank = involute_outline(gear, np.linspace(gear.form_roll_rad, gear.tip_roll_rad, 60))
    x, y = np.concatenate((fillet.x_mm, flank.x_mm)), np.concatenate((fillet.y_mm, flank.y_mm))
    thickness = effective_flank_mm(gear, depth_mm, angle_deg, x, y)
    return float(np.min((thickness + y) / (2.0 * y)))


def _angle_rad(angle_deg: float) -> float:
    return radians(within(angle_deg, "angle_deg of the crack", 15.0, 90.0, "°"))


# A spall: metal broken out of one flank, below the zone of contact.

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
    return spall.width_mm / pair.face_width_mm * depth * inside


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


# A chipped tooth: a piece broken off its tip.

DEFLECTION_M = 10e-6
"""What a loaded pair yields by: an edge that lies back by so much has let go of most of its load."""


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
    Beyond the chip a pair touches by the edge that is left, which sinks away from the mate's flank as the corner of a
    whole tooth does (`corner_separation_m`). Over the whole face this is a separation. Over part of the face that part
    is lost by and by, and the compliance of tooth and contact grows by 1/(1 − w/b). The driving flank alone is
    described, and the mass of the piece is not taken off the gear.
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


def chip_share(pair: PairGeometry, side: int, chip: ToothChip, progress: FloatArray) -> FloatArray:
    """Part of the width that a chip over part of the face takes away, 0 to 0.9; 0 if it spans the whole face.

    λ = (w/b) [1 − exp(−s/s₀)], with the separation s of the edge that is left, and what a loaded pair yields by, s₀:
    both parts of the width share the load until the edge has sunk away from the mate's flank.

    Parameters
    ----------
    progress : array
        ζ, base pitches since the pair's ideal entry.
    """
    if _is_whole(pair, chip):
        return np.zeros(np.shape(progress))
    part = (chip.width_mm or 0.0) / pair.face_width_mm
    result: FloatArray = -part * np.expm1(-_edge_separation_m(pair, side, chip, progress) / DEFLECTION_M)
    return result


def chip_separation_m(pair: PairGeometry, side: int, chip: ToothChip, progress: FloatArray) -> FloatArray:
    """Separation by a chip over the whole face, of the edge that is left from the mate's flank; 0 for a narrower chip.

    Parameters
    ----------
    progress : array
        ζ, base pitches since the pair's ideal entry.
    """
    whole = _is_whole(pair, chip)
    return _edge_separation_m(pair, side, chip, progress) if whole else np.zeros(np.shape(progress))


def _is_whole(pair: PairGeometry, chip: ToothChip) -> bool:
    return chip.width_mm is None or spans_face(chip.width_mm, pair.face_width_mm)


def _edge_separation_m(pair: PairGeometry, side: int, chip: ToothChip, progress: FloatArray) -> FloatArray:
    """0 up to the chip's edge, and what is more than at the corner of a whole tooth beyond it."""
    lost = (chip.height_mm, 0.0) if side == 1 else (0.0, chip.height_mm)
    return corner_separation_m(pair, progress, lost) - corner_separation_m(pair, progress)
