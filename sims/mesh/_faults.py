"""Faults of single teeth: a root crack, a spall on the flank, a chipped tip, and the tooth that each leaves."""

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
"""Fraction of a section's thickness that a crack must leave; with less, the tooth counts as broken."""


@dataclass(frozen=True)
class RootCrack:
    """A straight crack from the middle of the loaded flank's fillet into the tooth root.

    Parameters
    ----------
    depth_mm : float
        Length of the crack in the cross-section, above 0. For its limit see `deepest_crack_mm`.
    angle_deg : float
        ϑ between the crack and the tooth's centre line, 15 to 90; 90 runs straight across the tooth.
    tooth : int
        Tooth of the gear, counted from 0.
    width_mm : float or None
        Extent over the face width from one end, at constant depth; None: over the whole face.

    Notes
    -----
    The crack is on the side in tension while the tooth drives. Under load on the back flank it closes, and the tooth is
    as stiff as a healthy one.
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
    """Middle of the fillet (halfway in γ), x and y, where a crack starts."""
    point = fillet_outline(gear, np.array([(pi / 2.0 + gear.pressure_angle_rad) / 2.0]))
    return float(point.x_mm[0]), float(point.y_mm[0])


def crack_tip_mm(gear: GearGeometry, depth_mm: float, angle_deg: float) -> tuple[float, float]:
    """Tip of the crack, x along the tooth's centre line and y across it."""
    x, y = crack_mouth_mm(gear)
    angle = _angle_rad(angle_deg)
    return x - depth_mm * cos(angle), y - depth_mm * sin(angle)


def crack_percent(gear: GearGeometry, depth_mm: float, angle_deg: float = 45.0) -> float:
    """Depth across the tooth as a percentage of the root's thickness at the crack's mouth, 100 q sin ϑ/(2 y)."""
    return 100.0 * depth_mm * sin(_angle_rad(angle_deg)) / (2.0 * crack_mouth_mm(gear)[1])


CRACK_LAWS = ("two lines", "limiting line", "parallel line")
"""Rules for the part of a tooth behind a crack that carries no load; see `effective_flank_mm`."""


def effective_flank_mm(
    gear: GearGeometry,
    depth_mm: float,
    angle_deg: float,
    x_mm: FloatArray,
    y_mm: FloatArray,
    law: str = "two lines",
) -> FloatArray:
    """Effective y of the loaded side of each section behind a crack: y less the part that carries no load.

    - two lines: both run to the tooth tip, one from the crack's mouth and one from its tip. The part between them
      carries no load; between the crack's tip and its mouth, the part outside the second line. At zero depth nothing
      is lost, so the stiffness decreases continuously from that of the healthy tooth.
    - limiting line: the part outside the second line carries no load, as is common. At zero depth this already removes
      the bulge of the flank.
    - parallel line: the part further from the tooth's centre line than the crack's tip carries no load.

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
    """Deepest crack that leaves a tenth of the root and of every section and stays in the outer half of the body."""
    from scipy.optimize import brentq

    def spare(depth: float) -> float:
        return _least_section(gear, depth, angle_deg) - MIN_SECTION

    sine, cosine = sin(_angle_rad(angle_deg)), cos(_angle_rad(angle_deg))
    across = (1.0 - MIN_SECTION) * 2.0 * crack_mouth_mm(gear)[1] / sine
    inwards = crack_mouth_mm(gear)[0] - (gear.bore_mm + gear.root_radius_mm) / 2.0
    limit = min(across, inwards / cosine) if cosine > 1e-9 else across
    return limit if spare(limit) >= 0.0 else float(brentq(spare, 1e-6 * gear.module_mm, limit, xtol=1e-9))


def check_crack(gear: GearGeometry, crack: RootCrack) -> None:
    """Reject a crack that extends beyond the tooth, is wider than the gear, or is on a tooth that does not exist."""
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
    """Minimum over the tooth of the fraction of section thickness that is left."""
    fillet = fillet_outline(gear, np.linspace(pi / 2.0, gear.pressure_angle_rad, 60))
    flank = involute_outline(gear, np.linspace(gear.form_roll_rad, gear.tip_roll_rad, 60))
    x, y = np.concatenate((fillet.x_mm, flank.x_mm)), np.concatenate((fillet.y_mm, flank.y_mm))
    thickness = effective_flank_mm(gear, depth_mm, angle_deg, x, y)
    return float(np.min((thickness + y) / (2.0 * y)))


def _angle_rad(angle_deg: float) -> float:
    return radians(within(angle_deg, "angle_deg of the crack", 15.0, 90.0, "°"))


# A spall: metal broken out of one flank, below the zone of contact.

LARGEST_PART = 0.9
"""Maximum fraction of the face width that partial damage may take: the rest must carry the load."""


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
        Tooth of the gear, counted from 0.
    centre : float or None
        Position of its middle on the path of contact, 0 at this flank's root end to 1 at its tip end. None: at the
        pitch point.

    Notes
    -----
    Over part of the face, the rest of the flank carries: see `spall_share`. Over the whole face, the mate sinks in as
    far as its curvature allows: see `spall_separation_m`. Edges neither grow nor press into the mate.
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
    """Reject a spall longer than its flank, wider than the face, or on a tooth that does not exist."""
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
    """Reject a width beyond the loaded face, or one that leaves too narrow a strip of it."""
    # A width computed from a percentage of the face has a rounding error.
    if width_mm > face_width_mm * (1.0 + 1e-12) or LARGEST_PART + 1e-12 < width_mm / face_width_mm < 1.0 - 1e-12:
        raise InputError(
            f"{name} is {width_mm:g} mm on a loaded face of {face_width_mm:g} mm",
            allowed=f"0 to {LARGEST_PART * face_width_mm:g} mm, or {face_width_mm:g} mm for all of it",
            remedy="the strip that is left could not carry: give the whole face width"
            if width_mm < face_width_mm
            else "",
        )


def spans_face(width_mm: float, face_width_mm: float) -> bool:
    """Whether the damage covers the whole loaded face."""
    return width_mm >= face_width_mm * (1.0 - 1e-12)


def spall_share(
    pair: PairGeometry,
    side: int,
    materials: tuple[Material, Material],
    spall: ToothSpall,
    roll_length_mm: FloatArray,
) -> FloatArray:
    """Fraction λ of the contact width lost to a spall over part of the face; 0 if it spans the whole face.

    λ = (w/b) min(1, 2 R h/a²) · (fraction of the contact zone, 2a wide, that lies in the spall)

    The contact compliance is multiplied by 1/(1 − λ). a is taken at 1 GPa, as the load is not known here. a²/(2R) is
    the Hertzian flattening: in a pit shallower than that, the mate still presses on the floor.

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
    """Depth to which the mate sinks into a spall over the whole face, E = min(h, d²/(2R)), in m; 0 if it is narrower.

    At a distance d inside the edge of a pit, a mate of relative curvature 1/R rests on that edge, d²/(2R) below its
    position on a healthy flank, until it reaches the floor at h. A short pit is bridged.

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
    # R is 0 at the base circle, where there is no contact; the floor limits the depth there.
    sunk = inside**2 / np.maximum(2.0 * curvature_radius_mm(pair, roll_length_mm), 1e-12)
    result: FloatArray = np.minimum(spall.depth_um * 1e-6, sunk * 1e-3)
    return result


def _ends_mm(pair: PairGeometry, side: int, spall: ToothSpall) -> tuple[float, float]:
    """Arc lengths of the spall's ends."""
    low, high = contact_ends_mm(pair, side)
    rho = pitch_point_mm(pair, side) if spall.centre is None else low + spall.centre * (high - low)
    middle = float(arc_length_mm(pair.driver if side == 1 else pair.driven, rho))
    return middle - spall.length_mm / 2.0, middle + spall.length_mm / 2.0


# A chipped tooth: a piece broken off its tip.

DEFLECTION_M = 10e-6
"""Typical deflection of a loaded pair: an edge set back by this much has lost most of its load."""


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
        Tooth of the gear, counted from 0.

    Notes
    -----
    Beyond the chip the pair is in contact at the remaining edge, which recedes from the mate's flank as the corner of a
    healthy tooth does (`corner_separation_m`). Over the whole face this is a separation. Over part of it, that part is
    lost gradually, and the compliance of tooth and contact is multiplied by up to 1/(1 − w/b). Only the driving flank
    is described, and the mass of the piece is not subtracted.
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
    """Reject a chip higher than the flank, wider than the face, or on a tooth that does not exist."""
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
    """Fraction of the width lost to a chip over part of the face, 0 to 0.9; 0 if it spans the whole face.

    λ = (w/b) [1 − exp(−s/s₀)], with the separation s of the remaining edge and the deflection s₀ of a loaded pair: both
    parts of the width share the load until the edge has receded from the mate's flank.

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
    """Separation of the remaining edge from the mate's flank, for a chip over the whole face, in m; 0 if narrower.

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
    """Separation of the chip's edge in excess of that at a healthy tooth's corner; 0 up to the edge."""
    lost = (chip.height_mm, 0.0) if side == 1 else (0.0, chip.height_mm)
    return corner_separation_m(pair, progress, lost) - corner_separation_m(pair, progress)
