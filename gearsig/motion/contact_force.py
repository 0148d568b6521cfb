"""Force of a contact from depth and closing speed, sample by sample."""

from __future__ import annotations

import numpy as np

from gearsig.checks import FloatArray
from gearsig.motion.types import PairMotion
from gearsig.rig.contact import ToothContact

SLIDING_SIGN_MPS = 2e-3
"""Sliding speed below which the sign of friction is brought over smoothly: bristles that bend are not followed."""


def depth(compression_m: FloatArray, half_backlash_m: float) -> FloatArray:
    """g: beyond the backlash, with the flank's sign; 0 in the gap."""
    g: FloatArray = np.sign(compression_m) * np.maximum(np.abs(compression_m) - half_backlash_m, 0.0)
    return g


def latched_damping(g: FloatArray, rate_mps: FloatArray, contact: ToothContact) -> FloatArray:
    """β in s/m at each sample, from the speed at the last sample before the flanks touched; 0 in the gap.

    The speed is latched for the whole contact, with the floor: b = f/v of the speed at each instant would grow without
    bound where the flanks come to rest.
    """
    side = np.sign(g)
    begins = np.flatnonzero((side != 0.0) & (np.concatenate([[0.0], side[:-1]]) != side))
    if not len(begins):
        return np.zeros_like(g)
    speed = np.maximum(np.abs(rate_mps[np.maximum(begins - 1, 0)]), contact.impact_speed_floor_mps)
    latest = np.searchsorted(begins, np.arange(len(g)), side="right") - 1
    beta = contact.damping_ratio_at(1.0) * max(1.0, contact.impact_speed_floor_mps) / speed
    return np.where(side != 0.0, beta[np.maximum(latest, 0)], 0.0)


def pair_force(g: FloatArray, rate_mps: FloatArray, damping_s_per_m: FloatArray, contact: ToothContact) -> FloatArray:
    """Force of one tooth pair, k sgn(g)|g|^λ (1 + β ġ), never tension: above 0 on the drive flank."""
    side = np.sign(g)
    growth = np.maximum(1.0 + damping_s_per_m * side * rate_mps, 0.0)
    force: FloatArray = side * contact.stiffness_n_per_m_lambda * np.abs(g) ** contact.exponent * growth
    return force


def friction_share(motion: PairMotion, g: FloatArray, gear: int = 0) -> FloatArray:
    """Mean of 1 − μ sgn(v_s) tan α_k over the pairs that touch: what a gear's torque feels of the normal force.

    tan α_k = ρ/r_b at the point of contact, of the driver (gear 0) or the driven gear (1); the sign changes at the
    pitch point, so that the share is 1 ∓ 0.018 there for μ = 0.05 and 20°.
    """
    path = motion.path
    flank = np.where(g < 0.0, -1.0, 1.0)
    first = path.position(motion.driver_angle_rad, flank)
    n = path.n_pairs(motion.driver_angle_rad, flank)
    total = np.zeros_like(g)
    for younger in (0.0, 1.0):
        rho_1 = path.driver_lever_m(first + younger)
        sliding = flank * (motion.driven_speed_rad_s * (path.length_m - rho_1) - motion.driver_speed_rad_s * rho_1)
        sign = np.clip(sliding / SLIDING_SIGN_MPS, -1.0, 1.0)
        lever = (rho_1, path.length_m - rho_1)[gear]
        share = 1.0 - motion.contact.friction_coefficient * sign * lever / path.base_radii_m[gear]
        total += np.where((younger == 0.0) | (n > 1.5), share, 0.0)
    result: FloatArray = total / n
    return result
