"""The equation of the loaded flanks, for a fit: compression from torque."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gearsig.checks import FloatArray
from gearsig.errors import RefusalError
from gearsig.motion.backlash import LEAST_SAMPLES, estimate_backlash
from gearsig.motion.contact_force import friction_share
from gearsig.motion.datum import find_datum
from gearsig.motion.impacts import meeting_speeds
from gearsig.motion.robust_fit import RobustFit, robust_fit
from gearsig.motion.types import PairMotion
from gearsig.rig.contact import damping_ratio_s_per_m

EDGE = 0.09
"""Base pitches around the entry and exit of a pair that are left out: there it carries a part of its load."""
PITCH_POINT, SLOW = 0.1, 0.15
"""Base pitches around the pitch point, and part of the ordinary speed, within which the friction of the flanks is not
known: bristles bend."""
LOADED = 0.1
"""Part of the ordinary load from which on a sample is taken."""
LEAST_SCATTER_M = 2e-8
"""What the equation leaves out: bristles that bend, a damping that is latched a little early."""
LONG_CONTACT, MOST_LONG = 40, 8
"""Samples from which on a contact whose speed of meeting is not known gets a damping of its own, and how many do."""
NAMES = ("datum", "half_backlash", "log stiffness", "damping", "driver inertia", "friction")


@dataclass(frozen=True)
class ContactEquation:
    """q = q₀ + s a + s (N/(n k (1 + β ġ)))^{1/λ} with N = |τ − J1 α1|/(r_b1 (1 ∓ μ tan α_k)).

    Parameters
    ----------
    motion : PairMotion
    torque_nm, side, n_pairs, per_friction : array, (n,)
        s, the pairs in contact, and the slope of the friction's share over μ.
    meeting_speed_mps : array, (n,)
    group : array of int, (n,)
        Number of the damping that belongs to a sample: 0 for c/v of contacts whose speed v of meeting is known.
    wanted : array of bool, (n,)
    start : array
        Values of `NAMES`, then one β for each further group.
    free : tuple of int
        Which of them are fitted.
    """

    motion: PairMotion
    torque_nm: FloatArray
    side: FloatArray
    n_pairs: FloatArray
    per_friction: FloatArray
    meeting_speed_mps: FloatArray
    group: NDArray[np.int64]
    wanted: NDArray[np.bool_]
    start: FloatArray
    free: tuple[int, ...]

    @property
    def has_both_flanks(self) -> bool:
        """Whether the play is fitted."""
        return NAMES.index("half_backlash") in self.free

    def residuals(self, values: FloatArray) -> FloatArray:
        """Compression that is not explained, in m."""
        p = self.start.copy()
        p[list(self.free)] = values
        zero, a, log_k, damping, inertia, friction = p[: len(NAMES)]
        m = self.motion
        share = np.maximum(1.0 + friction * self.per_friction, 0.2)
        normal = (self.torque_nm - inertia * m.driver_acceleration_rad_s2) / (m.path.base_radii_m[0] * share)
        betas = np.concatenate([[0.0], p[len(NAMES) :]])[self.group]
        beta = np.where(self.group == 0, damping / self.meeting_speed_mps, betas)
        growth = np.maximum(1.0 + beta * self.side * m.compression_rate_mps, 0.05)
        yielding = (np.abs(normal) / (self.n_pairs * np.exp(log_k) * growth)) ** (1.0 / m.contact.exponent)
        left: FloatArray = m.compression_m - zero - self.side * (a + yielding)
        return left

    def solve(self) -> RobustFit:
        """Fit the free parameters."""
        names = (*NAMES, *(f"damping {i}" for i in range(1, len(self.start) - len(NAMES) + 1)))
        rows = list(self.free)
        inertia = max(self.motion.contact.driver_inertia_kg_m2, 1e-3)
        scale = np.array([1e-6, 1e-6, 1.0, 0.01, inertia, 0.05, *[1.0] * (len(self.start) - len(NAMES))])
        return robust_fit(
            self.residuals,
            self.start[rows],
            scale[rows],
            self.wanted,
            tuple(names[i] for i in rows),
            least_scatter=LEAST_SCATTER_M,
        )


def contact_equation(motion: PairMotion) -> ContactEquation:
    """Return the equation with the samples that it holds for.

    Raises
    ------
    RefusalError
        If too few samples carry a load.
    """
    force, torque = motion.tooth_force_from_torque_n, motion.torque_nm
    assert force is not None  # noqa: S101  the caller has looked
    assert torque is not None  # noqa: S101
    side = np.sign(force)
    wanted = (np.abs(force) > LOADED * float(np.quantile(np.abs(force), 0.95))) & _clear(motion, side)
    if np.sum(wanted) < 10 * LEAST_SAMPLES:
        raise RefusalError(f"{np.sum(wanted)} samples carry a load", remedy="record while the machine drives")
    both = min(np.sum(wanted & (side > 0)), np.sum(wanted & (side < 0))) >= LEAST_SAMPLES
    start = _start(motion, both_flanks=bool(both))
    speed = meeting_speeds(motion, float(start[0]), float(start[1]))
    group, n_groups = _groups(speed, wanted, side)
    betas = np.full(n_groups, start[NAMES.index("damping")] / 0.1)
    unit = replace(motion, contact=replace(motion.contact, friction_coefficient=1.0))
    return ContactEquation(
        motion,
        torque,
        side,
        motion.path.n_pairs(motion.driver_angle_rad, side),
        friction_share(unit, side) - 1.0,
        np.where(np.isnan(speed), 1.0, speed),
        group,
        wanted & (group >= 0),
        np.concatenate([start, betas]),
        tuple(i for i in range(len(NAMES) + n_groups) if both or i != NAMES.index("half_backlash")),
    )


def _start(motion: PairMotion, *, both_flanks: bool) -> FloatArray:
    """Begin at what reversals tell, else at the rig's values."""
    c = motion.contact
    damping = max(damping_ratio_s_per_m(c.damping_law, c.restitution, 1.0), 1e-3)
    zero, a, k = 0.0, c.half_backlash_um * 1e-6, c.stiffness_n_per_m_lambda
    if both_flanks:
        play = estimate_backlash(motion)
        zero, a = play.datum_m, 0.5e-6 * play.backlash_um
        k = play.stiffness_n_per_m_lambda if np.isfinite(play.stiffness_n_per_m_lambda) else k
    else:
        zero = find_datum(motion).compression_m
    return np.array([zero, a, np.log(k), damping, c.driver_inertia_kg_m2, c.friction_coefficient])


def _groups(speed: FloatArray, wanted: NDArray[np.bool_], side: FloatArray) -> tuple[NDArray[np.int64], int]:
    """Number the long contacts whose speed of meeting is not known from 1; −1 for short ones, which are left out."""
    group = np.where(np.isnan(speed), -1, 0).astype(np.int64)
    unknown = np.flatnonzero(np.isnan(speed))
    if not len(unknown):
        return group, 0
    parts = np.split(unknown, np.flatnonzero((np.diff(unknown) > 1) | (np.diff(side[unknown]) != 0)) + 1)
    long = sorted((p for p in parts if np.sum(wanted[p]) >= LONG_CONTACT), key=lambda p: -int(np.sum(wanted[p])))
    for number, part in enumerate(long[:MOST_LONG], 1):
        group[part] = number
    return group, min(len(long), MOST_LONG)


def _clear(motion: PairMotion, side: FloatArray) -> NDArray[np.bool_]:
    """Samples whose pairs and friction are known: no pair comes, goes or turns its friction round."""
    path = motion.path
    u = path.position(motion.driver_angle_rad, side)
    clear: NDArray[np.bool_] = (u > EDGE) & (u < 1.0 - EDGE) & (np.abs(u - (path.contact_ratio - 1.0)) > EDGE)
    n = path.n_pairs(motion.driver_angle_rad, side)
    for younger in (0.0, 1.0):
        turns = np.abs(u + younger - path.pitch_point) < PITCH_POINT
        clear &= ~(turns & ((younger == 0.0) | (n > 1.5)))
    speed = np.abs(motion.driver_speed_rad_s)
    clear &= speed > SLOW * float(np.quantile(speed, 0.95))
    return clear
