"""Compiled: which tooth pairs carry, and the force of the flanks that touch."""

# mypy: allow-untyped-defs, allow-untyped-calls
from __future__ import annotations

from math import floor

from numba import njit


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _step(x):
    """Rise from 0 to 1 with two continuous derivatives, and its slope."""
    if x <= 0.0:
        return 0.0, 0.0
    if x >= 1.0:
        return 1.0, 0.0
    return x * x * x * (10.0 + x * (6.0 * x - 15.0)), 30.0 * x * x * (1.0 - x) * (1.0 - x)


@njit(cache=True, nogil=True, error_model="numpy")
def weight(k, p):
    """Part of its full stiffness that a pair has p base pitches behind its entry, and the slope over p."""
    rise, up = _step(p / k.ramp + 0.5)
    stay, down = _step((k.contact_ratio - p) / k.ramp + 0.5)
    return rise * stay, (up * stay - rise * down) / k.ramp


@njit(cache=True, nogil=True, error_model="numpy")
def younger_pair(k, angle, flank):
    """Number of the younger of the two pairs that may touch.

    Pairs change hands half-way through single contact, where the pair that goes has left and the one that comes has not
    arrived: no jump whatever the direction.
    """
    x = angle * k.cycles_per_rad - k.phase
    if flank < 0:
        x = k.mirror - x
    return floor(x - 0.5 * k.contact_ratio) + 1.0


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def position(k, angle, flank, younger):
    """Base pitches of the younger pair behind its entry, and its slope over the pinion's angle."""
    x = angle * k.cycles_per_rad - k.phase
    if flank < 0:
        return k.mirror - x - younger, -k.cycles_per_rad
    return x - younger, k.cycles_per_rad


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def soundness(k, number, flank):
    """Part of its stiffness that a pair has: less than 1 for a weak tooth on its drive flank."""
    if flank > 0 and k.weak_loss > 0.0 and number - floor(number / k.weak_teeth) * k.weak_teeth == k.weak_tooth:
        return 1.0 - k.weak_loss
    return 1.0


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def one_pair(k, depth, closing, damping):
    """Force of one tooth pair at full stiffness: elastic, and with damping; never tension."""
    if depth <= 0.0:
        return 0.0, 0.0
    elastic = k.stiffness * (depth * depth**0.5 if k.exponent == 1.5 else depth**k.exponent)
    return elastic, max(elastic * (1.0 + damping * closing), 0.0)


@njit(cache=True, nogil=True, error_model="numpy")
def stored_energy(k, angle, q, flank, younger):
    """Energy in the teeth that touch: n(θ1) k g^(λ+1)/(λ+1)."""
    depth = flank * q - k.half_backlash
    if flank == 0 or depth <= 0.0:
        return 0.0
    p, _ = position(k, angle, flank, younger)
    n = weight(k, p)[0] * soundness(k, younger, flank) + weight(k, p + 1.0)[0] * soundness(k, younger - 1.0, flank)
    return n * k.stiffness * depth ** (k.exponent + 1.0) / (k.exponent + 1.0)
