"""Compiled: which tooth pairs are near contact, how far apart their flanks are, how compliant their points."""

# mypy: allow-untyped-defs, allow-untyped-calls
from __future__ import annotations

import numpy as np
from numba import njit

from sims.compiled import UNCOUNTED

MOST_CYCLES = 1e12
"""Mesh cycles beyond which a run has burst; until then, single cycles are resolved to 1e-4."""


@njit(cache=True, nogil=True, error_model="numpy", **UNCOUNTED)
def near_pairs(cycles, start, step, corner, separation, rows, pitch, teeth, reach, pairs, columns, parts, apart, slope):
    """Find the pairs whose flanks are less than `reach` apart; return their number.

    corner, separation, rows, pitch : see `ContactTable.arrays`.
    teeth : (z1, z2), as floats: their remainder takes a fraction of that of whole numbers.
    pairs : (n_slots,) filled with the pairs' numbers k, the newest first.
    start, step : see `ContactTable`.
    columns, parts : column i of the table and part t of a step beyond it.
    apart, slope : separation in m, and its change per base pitch.
    """
    if not abs(cycles) < MOST_CYCLES:
        return -1
    n, last = 0, corner.shape[0] - 3
    newest = np.floor(cycles - start)
    for slot in range(pairs.shape[0]):
        pair = newest - slot
        place = (cycles - pair - start) / step
        i = int(place) + 1  # one column lies ahead of the start
        if i > last:
            break
        t = place - int(place)
        one, two = int(pair - teeth[0] * np.floor(pair / teeth[0])), int(pair - teeth[1] * np.floor(pair / teeth[1]))
        a, b = rows[2, one], rows[3, two]
        e0 = corner[i - 1] + separation[a, i - 1] + separation[b, i - 1]
        e1 = corner[i] + separation[a, i] + separation[b, i]
        e2 = corner[i + 1] + separation[a, i + 1] + separation[b, i + 1]
        e3 = corner[i + 2] + separation[a, i + 2] + separation[b, i + 2]
        # The cubic with the slopes (e2 − e0)/2 and (e3 − e1)/2: continuous slopes, as the contact's damping needs.
        c1, c2, c3 = 0.5 * (e2 - e0), e0 - 2.5 * e1 + 2.0 * e2 - 0.5 * e3, 1.5 * (e1 - e2) + 0.5 * (e3 - e0)
        here = e1 + t * (c1 + t * (c2 + t * c3)) + pitch[0, one] + pitch[1, two]
        if here < reach:
            pairs[n], columns[n], parts[n] = pair, i, t
            apart[n], slope[n] = here, (c1 + t * (2.0 * c2 + t * 3.0 * c3)) / step
            n += 1
    return n


@njit(cache=True, nogil=True, error_model="numpy", **UNCOUNTED)
def fill_compliance(n, pairs, columns, parts, teeth, own, cross, extra, rows, r):
    """Fill r[p·n_s + s, q·n_s + t] with the compliance between slices of the near pairs; both triangles."""
    n_s = own.shape[1]
    for p in range(n):
        i, t = columns[p], parts[p]
        pair = pairs[p]
        one, two = int(pair - teeth[0] * np.floor(pair / teeth[0])), int(pair - teeth[1] * np.floor(pair / teeth[1]))
        a, b = rows[0, one], rows[1, two]
        at = p * n_s
        for s in range(n_s):
            for u in range(n_s):
                r[at + s, at + u] = own[i, s, u] + t * (own[i + 1, s, u] - own[i, s, u])
        for row in (a, b):
            if row > 0:  # a faulty tooth
                for s in range(n_s):
                    for u in range(n_s):
                        low, high = extra[row, i, s, u], extra[row, i + 1, s, u]
                        r[at + s, at + u] += low + t * (high - low)
        for q in range(p + 1, n):  # the older pairs
            o = int(pair - pairs[q]) - 1
            for s in range(n_s):
                for u in range(n_s):
                    value = 0.0
                    if o < cross.shape[0]:
                        value = cross[o, i, s, u] + t * (cross[o, i + 1, s, u] - cross[o, i, s, u])
                    r[at + s, q * n_s + u] = value
                    r[q * n_s + u, at + s] = value


@njit(cache=True, nogil=True, error_model="numpy", **UNCOUNTED)
def compliance_slope_energy(n, pairs, columns, teeth, own, cross, extra, rows, step, force):
    """½ Nᵀ (∂R/∂ζ) N of the near pairs, in J per base pitch."""
    n_s, total = own.shape[1], 0.0
    for p in range(n):
        i, pair, at = columns[p], pairs[p], p * own.shape[1]
        one, two = int(pair - teeth[0] * np.floor(pair / teeth[0])), int(pair - teeth[1] * np.floor(pair / teeth[1]))
        a, b = rows[0, one], rows[1, two]
        for s in range(n_s):
            line = 0.0
            for u in range(n_s):
                line += (own[i + 1, s, u] - own[i, s, u]) * force[at + u]
            for row in (a, b):
                if row > 0:
                    for u in range(n_s):
                        line += (extra[row, i + 1, s, u] - extra[row, i, s, u]) * force[at + u]
            for q in range(p + 1, n):
                o = int(pair - pairs[q]) - 1
                if o < cross.shape[0]:
                    for u in range(n_s):
                        line += 2.0 * (cross[o, i + 1, s, u] - cross[o, i, s, u]) * force[q * n_s + u]
            total += 0.5 * line * force[at + s]
    return total / step
