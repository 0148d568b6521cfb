"""A crack at the tooth root: where it runs, what it leaves of each section, how deep it may be."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from math import cos, pi, radians, sin

import numpy as np

from gearsig.checks import FloatArray, count, one_of, positive, within
from gearsig.errors import InputError
from sims.mesh.geometry import GearGeometry
from sims.mesh.profile import fillet_outline, involute_outline, tip_point_mm

LEAST_SECTION = 0.1
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
        How far it reaches over the face width from one end; None: all through.
    front : str
        "straight": the same depth over `width_mm`. "parabolic": depth_mm · √(1 − w/width_mm) at w from the end face.

    Notes
    -----
    It lies on the side that is in tension while the tooth drives. Loaded on the back flank it closes, and the tooth is
    as stiff as a whole one.
    """

    depth_mm: float
    angle_deg: float = 45.0
    tooth: int = 0
    width_mm: float | None = None
    front: str = "straight"

    def __post_init__(self) -> None:
        positive(self.depth_mm, "depth_mm of the crack", "mm", remedy="leave out the crack for a sound tooth")
        _angle_rad(self.angle_deg)
        count(self.tooth, "tooth of the crack", minimum=0)
        if self.width_mm is not None:
            positive(self.width_mm, "width_mm of the crack", "mm")
        one_of(self.front, "front of the crack", ("straight", "parabolic"))


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


def crack_depth_mm(gear: GearGeometry, percent: float, angle_deg: float = 45.0) -> float:
    """Depth that takes `percent` of the root's thickness: the inverse of `crack_percent`."""
    return percent / 100.0 * 2.0 * crack_mouth_mm(gear)[1] / sin(_angle_rad(angle_deg))


def effective_flank_mm(
    gear: GearGeometry, depth_mm: float, angle_deg: float, x_mm: FloatArray, y_mm: FloatArray
) -> FloatArray:
    """Where the loaded side of each section ends, behind a crack: y less the part that carries no load.

    Two lines run to the tooth tip, one from the crack's mouth and one from its tip. What lies between them carries no
    load; between the crack's tip and its mouth, what lies outside the second line. Without depth nothing is lost, so
    that the stiffness falls steadily from the sound tooth's. (Cutting along the second line alone, as is common, takes
    the bulge of the flank off a tooth whose crack has no depth yet.)

    Parameters
    ----------
    gear : GearGeometry
    depth_mm, angle_deg : float
    x_mm, y_mm : arrays
        Outline of the loaded side.
    """
    x_mouth, y_mouth = crack_mouth_mm(gear)
    x_end, y_end = crack_tip_mm(gear, depth_mm, angle_deg)
    x_tip, y_tip = tip_point_mm(gear)
    behind = y_end + (y_tip - y_end) * (x_mm - x_end) / (x_tip - x_end)
    before = y_mouth + (y_tip - y_mouth) * (x_mm - x_mouth) / (x_tip - x_mouth)
    lost = np.where(x_mm >= x_mouth, np.maximum(before - behind, 0.0), np.maximum(y_mm - behind, 0.0))
    result: FloatArray = np.where(x_mm >= x_end, y_mm - lost, y_mm)
    return result


@lru_cache(maxsize=256)
def deepest_crack_mm(gear: GearGeometry, angle_deg: float = 45.0) -> float:
    """Deepest crack that leaves a tenth of the root and of every section, and stays in the outer half of the rim."""
    from scipy.optimize import brentq

    def spare(depth: float) -> float:
        return _least_section(gear, depth, angle_deg) - LEAST_SECTION

    sine, cosine = sin(_angle_rad(angle_deg)), cos(_angle_rad(angle_deg))
    across = (1.0 - LEAST_SECTION) * 2.0 * crack_mouth_mm(gear)[1] / sine
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
    left = effective_flank_mm(gear, depth_mm, angle_deg, x, y)
    return float(np.min((left + y) / (2.0 * y)))


def _angle_rad(angle_deg: float) -> float:
    return radians(within(angle_deg, "angle_deg of the crack", 15.0, 90.0, "°"))
