"""Where a tooth pair touches over its progress, and how far apart it is before and after: corner contact."""

from __future__ import annotations

import numpy as np

from gearsig.checks import FloatArray
from sims.mesh.pair import PairGeometry


def rolls_rad(pair: PairGeometry, progress: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Roll angles τ of driver and driven gear at ζ, held at the ends of the path of contact.

    Before its ideal entry a pair touches at the driven gear's tip, after its ideal end at the driver's; where exactly
    the corner then stands on the mate's flank is left out.
    """
    inside = np.clip(progress, 0.0, pair.contact_ratio)
    rho_1, rho_2 = pair.contact_radii_mm(inside)
    return rho_1 / pair.driver.base_radius_mm, rho_2 / pair.driven.base_radius_mm


def corner_separation_m(pair: PairGeometry, progress: FloatArray) -> FloatArray:
    """Distance between the unloaded flanks of a pair along the line of action; 0 on the path of contact, else above 0.

    Before ζ = 0 the tip corner of the driven gear has not yet reached the line of action. The involute of the driver
    that runs through the corner starts ahead of the driver's own flank, and r_b1 times that angle is what the driver
    would have to yield by for the two to touch. Beyond ζ = ε the gears change places.

    Parameters
    ----------
    pair : PairGeometry
    progress : array, (n,)
        ζ, base pitches since the ideal entry.

    Returns
    -------
    array, (n,)
        m.
    """
    rb1, rb2 = pair.driver.base_radius_mm, pair.driven.base_radius_mm
    length, pitch = pair.action_length_mm, pair.base_pitch_mm
    early = np.maximum(-progress, 0.0) * pitch
    late = np.maximum(progress - pair.contact_ratio, 0.0) * pitch
    entry = _corner_mm(rb1, rb2, length, pair.start_radius_mm, early)
    leave = _corner_mm(rb2, rb1, length, length - pair.end_radius_mm, late)
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
    own = (start - before) / rb_flank
    result: FloatArray = np.where(before > 0.0, rb_flank * (base_angle - own), 0.0)
    return result


def over_height(roll: FloatArray, values: FloatArray, wanted: FloatArray) -> FloatArray:
    """Values at the heights of a grid (first axis) between them, by a cubic spline; held beyond the grid's ends."""
    from scipy.interpolate import CubicSpline

    spline = CubicSpline(roll, values, axis=0)
    result: FloatArray = spline(np.clip(wanted, roll[0], roll[-1]))
    return result
