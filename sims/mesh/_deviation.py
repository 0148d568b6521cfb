"""How a flank departs from the involute: relief, profile and pitch deviations, wear. Positive: metal is missing."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gearsig.checks import FloatArray, frozen_array, not_negative, positive
from gearsig.errors import InputError
from sims.mesh._geometry import GearGeometry
from sims.mesh._pair import PairGeometry, contact_ends_mm


@dataclass(frozen=True)
class FlankDeviation:
    """Deviation shared by all teeth of a gear, along the line of action, plus one value per tooth.

    Parameters
    ----------
    tip_relief_um : float
        Metal taken off at the tip, 0 for none.
    tip_relief_length_mm : float
        Length of the relief along the line of action, from the tip down.
    tip_relief_exponent : float
        1: straight; 2: parabolic.
    profile_um : tuple of float
        Measured profile deviation at equal steps of roll from the end of the fillet to the tip; straight between them.
        Empty: none.
    pitch_um : tuple of float
        Cumulative pitch deviation of each tooth, as many as the gear has teeth. Empty: none.
    wear_um : float
        Greatest depth of wear by sliding, 0 for none; see `sims.mesh` for its shape over the flank.
    """

    tip_relief_um: float = 0.0
    tip_relief_length_mm: float = 1.0
    tip_relief_exponent: float = 1.0
    profile_um: tuple[float, ...] = ()
    pitch_um: tuple[float, ...] = ()
    wear_um: float = 0.0

    def __post_init__(self) -> None:
        not_negative(self.tip_relief_um, "tip_relief_um", "µm")
        positive(self.tip_relief_length_mm, "tip_relief_length_mm", "mm")
        positive(self.tip_relief_exponent, "tip_relief_exponent")
        not_negative(self.wear_um, "wear_um", "µm")
        frozen_array(self.profile_um, "profile_um", ndim=1)
        frozen_array(self.pitch_um, "pitch_um", ndim=1)
        if len(self.profile_um) == 1:
            raise InputError("profile_um holds one value", allowed="none, or at least two from fillet to tip")


IDEAL_FLANK = FlankDeviation()
"""An involute without deviation."""


def check_deviation(gear: GearGeometry, deviation: FlankDeviation) -> None:
    """Refuse a relief longer than the flank and a number of pitch deviations that is not the number of teeth."""
    flank = (gear.tip_roll_rad - gear.form_roll_rad) * gear.base_radius_mm
    if deviation.tip_relief_um > 0.0 and deviation.tip_relief_length_mm > flank:
        raise InputError(
            f"tip_relief_length_mm is {deviation.tip_relief_length_mm:g} mm on a flank of {flank:.3g} mm",
            allowed=f"at most {flank:.3g} mm along the line of action",
        )
    if deviation.pitch_um and len(deviation.pitch_um) != gear.teeth:
        raise InputError(f"pitch_um holds {len(deviation.pitch_um)} values", allowed=f"one per tooth, {gear.teeth}")


def flank_separation_m(gear: GearGeometry, deviation: FlankDeviation, roll_length_mm: FloatArray) -> FloatArray:
    """Missing metal at the given places of the flank, in m; without wear, which depends on the mate.

    Parameters
    ----------
    roll_length_mm : array
        ρ of the gear, distance from its base tangent point. Beyond the tip the relief goes on growing.
    """
    rho = np.asarray(roll_length_mm, dtype=np.float64)
    tip = gear.tip_roll_rad * gear.base_radius_mm
    into = np.maximum(rho - (tip - deviation.tip_relief_length_mm), 0.0) / deviation.tip_relief_length_mm
    total = deviation.tip_relief_um * into**deviation.tip_relief_exponent
    if deviation.profile_um:
        places = np.linspace(gear.form_roll_rad * gear.base_radius_mm, tip, len(deviation.profile_um))
        total = total + np.interp(rho, places, np.asarray(deviation.profile_um))
    result: FloatArray = total * 1e-6
    return result


def pitch_separation_m(gear: GearGeometry, deviation: FlankDeviation) -> FloatArray:
    """One value per tooth, in m."""
    if not deviation.pitch_um:
        return np.zeros(gear.teeth)
    return np.asarray(deviation.pitch_um, dtype=np.float64) * 1e-6


# Wear of all flanks of a gear by sliding.

MIN_RADIUS = 0.1
"""In modules: below this radius of curvature specific sliding no longer grows, as the zone of contact is wider."""


def wear_profile(pair: PairGeometry, side: int, roll_length_mm: FloatArray) -> FloatArray:
    """Depth of wear over the flank, 1 where it is greatest, 0 at the pitch point.

    h ∝ p · s = |1 − u_mate/u_own|,  u = ω ρ

    By Archard's law a point wears in proportion to pressure times the distance slid past it. A zone of contact of width
    2a rolls over the point at its own surface's speed u_own, while the surfaces slide at |u_own − u_mate|: s = 2a |1 −
    u_mate/u_own|. Mean pressure times width is the load per width, F/b, taken here as the same all along the path of
    contact. What is left is the specific sliding: 0 in pure rolling at the pitch point, rising to both ends, the more
    so to the root, where a flank is slow. The law's constant is in the depth that is given.

    Parameters
    ----------
    pair : PairGeometry
    side : int
        1 for the driver's flanks, 2 for the driven gear's.
    roll_length_mm : array
        ρ of that gear. Beyond the path of contact the depth stays that of its end.

    Notes
    -----
    Load sharing and the change of pressure as the flank wears are left out: in truth double contact halves the wear at
    the ends.

    Source: J. F. Archard, Contact and rubbing of flat surfaces, Journal of Applied Physics 24 (1953), for the law.
    """
    ends = contact_ends_mm(pair, side)
    largest = float(np.max(_specific_sliding(pair, side, np.array(ends))))
    result: FloatArray = _specific_sliding(pair, side, np.clip(roll_length_mm, *ends)) / largest
    return result


def _specific_sliding(pair: PairGeometry, side: int, roll_length_mm: FloatArray) -> FloatArray:
    gear, mate = (pair.driver, pair.driven) if side == 1 else (pair.driven, pair.driver)
    rho = np.maximum(np.asarray(roll_length_mm, dtype=np.float64), MIN_RADIUS * gear.module_mm)
    result: FloatArray = np.abs(1.0 - gear.teeth / mate.teeth * (pair.action_length_mm - rho) / rho)
    return result
