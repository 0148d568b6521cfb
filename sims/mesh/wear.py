"""Wear of all flanks of a gear by sliding."""

from __future__ import annotations

import numpy as np

from gearsig.checks import FloatArray
from sims.mesh.flank import contact_ends_mm
from sims.mesh.pair import PairGeometry

LEAST_RADIUS = 0.1
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
    most = float(np.max(_specific_sliding(pair, side, np.array(ends))))
    result: FloatArray = _specific_sliding(pair, side, np.clip(roll_length_mm, *ends)) / most
    return result


def _specific_sliding(pair: PairGeometry, side: int, roll_length_mm: FloatArray) -> FloatArray:
    own, mate = (pair.driver, pair.driven) if side == 1 else (pair.driven, pair.driver)
    rho = np.maximum(np.asarray(roll_length_mm, dtype=np.float64), LEAST_RADIUS * own.module_mm)
    result: FloatArray = np.abs(1.0 - own.teeth / mate.teeth * (pair.action_length_mm - rho) / rho)
    return result
