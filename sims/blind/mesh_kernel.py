"""The compiled mesh: pairs in reach, their gaps, and the force by Newton's method."""

from __future__ import annotations

from math import sqrt

import numpy as np
from numba import njit

from sims.blind.geometry import REACH
from sims.blind.march_numbers import (
    BACK_STIFFNESS,
    BACKLASH_M,
    BASE_PITCH,
    CONTACT_RATIO,
    END_A,
    END_E,
    MESH_DAMPING,
    RB_1,
    RHO_START,
)

GAP, STIFFNESS, SLIP, RHO, CARRIED = range(5)
"""Columns of the pairs in reach."""
MOST_PAIRS = 6
Tables = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]


@njit(cache=True)
def soft(x: float, h: float) -> tuple[float, float]:
    """Compression law √(x² + h²) − h for x > 0 and its slope: soft at first touch, then straight."""
    if x <= 0.0:
        return 0.0, 0.0
    root = sqrt(x * x + h * h)
    return root - h, x / root


@njit(cache=True)
def _at(table: np.ndarray, spot: float) -> float:
    """Interpolate between the points of a table, its ends held."""
    spot = min(max(spot, 0.0), table.shape[0] - 1.001)
    i = int(spot)
    return float(table[i] + (spot - i) * (table[i + 1] - table[i]))


@njit(cache=True)
def pairs_in_reach(
    pairs: np.ndarray,
    number: np.ndarray,
    theta_1: float,
    shift: float,
    opening: float,
    offsets: np.ndarray,
    tables: Tables,
) -> int:
    """Fill gap, stiffness, friction and curvature radius of all pairs that may touch; return how many there are.

    `shift` is a separation of all teeth by run-out: gear 2 lags by it, and with gear 2's tips the path's start A; its
    end E belongs to gear 1. `opening` is a growth of the centre distance, which moves both ends.

    Pair j stands at r_b1 θ1 / p_b − j on the path; a pair whose compliance is 1 + w times the sound one has 1/(1 + w)
    of its stiffness.
    """
    gap_0, pair_k, slip, gap_1, gap_2, weak_1, weak_2 = tables
    z1, z2, n_path = gap_1.shape[0], gap_2.shape[0], gap_0.shape[0]
    pb, ratio = number[BASE_PITCH], number[CONTACT_RATIO]
    per_place = (n_path - 1) / (ratio + 2.0 * REACH)
    cycle = number[RB_1] * theta_1 / pb
    n = 0
    for j in range(int(np.ceil(cycle - ratio - REACH)), int(np.floor(cycle + REACH)) + 1):
        spot = (cycle - j + REACH) * per_place
        i = int(spot)
        if i < 0 or i >= n_path - 1:
            continue
        b = spot - i
        a = 1.0 - b
        t1, t2 = (j + offsets[0]) % z1, (j + offsets[1]) % z2
        moved = opening * number[END_A] + shift / pb if cycle - j < 0.5 * ratio else opening * number[END_E]
        base = _at(gap_0, spot - moved * per_place)
        weak = a * (weak_1[t1, i] + weak_2[t2, i]) + b * (weak_1[t1, i + 1] + weak_2[t2, i + 1])
        pairs[n, GAP] = base + a * (gap_1[t1, i] + gap_2[t2, i]) + b * (gap_1[t1, i + 1] + gap_2[t2, i + 1])
        pairs[n, STIFFNESS] = (a * pair_k[i] + b * pair_k[i + 1]) / (1.0 + weak)
        pairs[n, SLIP] = a * slip[i] + b * slip[i + 1]
        pairs[n, RHO] = number[RHO_START] + (cycle - j) * pb
        n += 1
    return n


@njit(cache=True)
def mesh_force(
    force: float, gamma: float, gamma_v: float, x: float, v: float, h: float, n_pairs: int, pairs: np.ndarray,
    number: np.ndarray,
) -> float:  # fmt: skip
    """Solve F = Σ F_i(x − γF, v − γ_v F) by Newton's method from `force`; the pairs receive what they carry.

    F_i = k_i (s(x − E_i) + c s' v), never a pull; the back flanks carry as one, at mean stiffness. x has the run-out
    taken off, which moves both flanks of a tooth.
    """
    damping, back = number[MESH_DAMPING], number[BACK_STIFFNESS]
    for _ in range(8):
        now, speed = x - gamma * force, v - gamma_v * force
        total, slope = 0.0, 0.0
        for i in range(n_pairs):
            squeeze, rate = soft(now - pairs[i, GAP], h)
            carried = pairs[i, STIFFNESS] * (squeeze + damping * rate * speed)
            pairs[i, CARRIED] = max(carried, 0.0)
            if carried > 0.0:
                total += carried
                slope += pairs[i, STIFFNESS] * rate * (gamma + damping * gamma_v)
        squeeze, rate = soft(-now - number[BACKLASH_M], h)
        carried = back * (squeeze - damping * rate * speed)
        if carried > 0.0:
            total -= carried
            slope += back * rate * (gamma + damping * gamma_v)
        miss = force - total
        force -= miss / (1.0 + slope)
        if abs(miss) <= 1e-9 * (abs(force) + 1.0):
            break
    return force
