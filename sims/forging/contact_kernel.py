"""Compiled: which tooth pairs carry, where worn ones touch, and the force of the flanks that do."""

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
def worn_off(k, p, flank):
    """What wear has taken off a pair p base pitches behind its entry, drive flanks alone, and its slope over p.

    Cubic between the points of the table, with their slopes; beyond the path of contact as at its end.
    """
    if flank < 0 or k.is_worn == 0.0:
        return 0.0, 0.0
    x = p / k.contact_ratio * (k.wear.shape[0] - 1)
    if x <= 0.0:
        return k.wear[0], 0.0
    if x >= k.wear.shape[0] - 1:
        return k.wear[-1], 0.0
    i = int(x)
    u = x - i
    a, b, c, d = k.wear[i], k.wear[i + 1], k.wear_slope[i], k.wear_slope[i + 1]
    depth = a + u * (c + u * (3.0 * (b - a) - 2.0 * c - d + u * (2.0 * (a - b) + c + d)))
    slope = c + u * (2.0 * (3.0 * (b - a) - 2.0 * c - d) + u * 3.0 * (2.0 * (a - b) + c + d))
    return depth, slope * (k.wear.shape[0] - 1) / k.contact_ratio


@njit(cache=True, nogil=True, error_model="numpy")
def reach(k, angle, flank):
    """Compression at which the first pair touches a flank, in the flank's direction; and its slope over the angle."""
    if flank < 0 or k.is_worn == 0.0:
        return k.half_backlash, 0.0
    p, slope = position(k, angle, flank, younger_pair(k, angle, flank))
    least, change = 1e9, 0.0
    for i in range(2):
        if -0.5 * k.ramp < p + i < k.contact_ratio + 0.5 * k.ramp:
            depth, over = worn_off(k, p + i, flank)
            if depth < least:
                least, change = depth, over * slope
    return k.half_backlash + least, change


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def one_pair(k, depth, closing, damping):
    """Force of one tooth pair at full stiffness: elastic, and with damping; never tension."""
    if depth <= 0.0:
        return 0.0, 0.0
    elastic = k.stiffness * (depth * depth**0.5 if k.exponent == 1.5 else depth**k.exponent)
    return elastic, max(elastic * (1.0 + damping * closing), 0.0)


@njit(cache=True, nogil=True, error_model="numpy")
def stored_energy(k, angle, q, flank, younger):
    """Energy in the teeth that touch: Σ n_i(θ1) k g_i^(λ+1)/(λ+1)."""
    if flank == 0 or flank * q <= k.half_backlash:
        return 0.0
    p, _ = position(k, angle, flank, younger)
    total = 0.0
    for i in range(2):
        depth = flank * q - k.half_backlash - worn_off(k, p + i, flank)[0]
        if depth > 0.0:
            n = weight(k, p + i)[0] * soundness(k, younger - i, flank)
            total += n * k.stiffness * depth ** (k.exponent + 1.0) / (k.exponent + 1.0)
    return total
