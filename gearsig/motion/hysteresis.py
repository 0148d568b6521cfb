"""Torque over twist: the loop that play and friction make, and the work it takes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gearsig.checks import FloatArray
from gearsig.errors import RefusalError
from gearsig.motion.course import Course
from gearsig.motion.types import PairMotion

LIGHT = (0.1, 0.5)
"""Parts of the ordinary torque between which flanks touch and hardly yield."""


@dataclass(frozen=True)
class TorqueTwist:
    """The loop of torque over twist of the pair.

    Parameters
    ----------
    twist_rad : array, (n,)
        Driver's angle less the driven gear's times the ratio, from the middle of the play.
    torque_nm : array, (n,)
        On the driver's shaft.
    lost_motion_rad : float
        Width of the loop at a light load, between both signs of the torque: the play as the driver's shaft feels it;
        nan where the torque has one sign.
    loss_per_cycle_j : float
        ∮ τ dδ per stretch of motion: what contact and friction of the teeth take; nan where the motion neither stops
        nor reverses, as no loop closes then.
    work_per_cycle_j : float
        ∫ τ dθ1 per stretch of motion: what goes through the shaft; nan likewise.
    n_cycles : int
    """

    twist_rad: FloatArray
    torque_nm: FloatArray
    lost_motion_rad: float
    loss_per_cycle_j: float
    work_per_cycle_j: float
    n_cycles: int


def torque_twist(motion: PairMotion, course: Course, datum_m: float) -> TorqueTwist:
    """Return the loop of a start–stop motion.

    Raises
    ------
    RefusalError
        If no torque was measured.
    """
    if motion.torque_nm is None:
        raise RefusalError("no torque was measured", remedy="record the torque of the driver's shaft")
    r1 = motion.path.base_radii_m[0]
    twist = (motion.compression_m - datum_m) / r1
    torque = motion.torque_nm
    n_cycles = len(course.moving) if course.stops_s or course.n_reversals else 0
    share = 1.0 / (n_cycles * motion.sampling_rate_hz) if n_cycles else float("nan")
    return TorqueTwist(
        twist,
        torque,
        _width(twist, torque),
        float(np.trapezoid(torque * motion.compression_rate_mps / r1, dx=share)),
        float(np.trapezoid(torque * motion.driver_speed_rad_s, dx=share)),
        n_cycles,
    )


def _width(twist_rad: FloatArray, torque_nm: FloatArray) -> float:
    """Distance between the median twists at a light torque of either sign."""
    ordinary = float(np.quantile(np.abs(torque_nm), 0.95))
    light = (np.abs(torque_nm) > LIGHT[0] * ordinary) & (np.abs(torque_nm) < LIGHT[1] * ordinary)
    sides = [twist_rad[light & (torque_nm > 0.0)], twist_rad[light & (torque_nm < 0.0)]]
    return float(np.median(sides[0]) - np.median(sides[1])) if all(len(side) for side in sides) else float("nan")
