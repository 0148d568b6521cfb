"""Compiled: loaded contact at given mesh angles, for a given force or a given approach."""

# mypy: allow-untyped-defs, allow-untyped-calls
from __future__ import annotations

import numpy as np
from numba import njit

from sims.reduced_fe.contact_kernel import back_substituted, solve_contacts
from sims.reduced_fe.contact_pairs_kernel import fill_compliance, near_pairs

ENOUGH = 1e-10
"""Of the load: change of a force at which the solution counts as found."""


@njit(cache=True, nogil=True, error_model="numpy")
def loaded_contact(  # noqa: PLR0912  one search, its cases beside each other
    cycles, loads, by_force, start, step, teeth, small, n_slots, arrays, delta, force, tangent
):
    """Solve at each c and load; returns whether all were found.

    loads : (n_loads,) total force in N, or approach δ in m where `by_force` is false; ascending.
    delta : (n_c, n_loads) δ in m, or the total force.
    force, tangent : (n_c, n_loads, n_slots, n_slices) N, and dN/dδ; slot j is pair ⌊c − start⌋ − j.
    """
    own, cross, corner, extra, separation, rows, pitch, lead, hertz = arrays
    n_s = own.shape[1]
    most = n_slots * n_s
    pairs, parts = np.empty(n_slots), np.empty(n_slots)
    apart, slope = np.empty(n_slots), np.empty(n_slots)
    columns = np.empty(n_slots, dtype=np.int64)
    r, a = np.empty((most, most)), np.empty((most, most))
    approach, n_at, w, x, unit = np.empty(most), np.empty(most), np.empty(most), np.empty(most), np.empty(most)
    order = np.empty(most, dtype=np.int64)
    for row in range(cycles.shape[0]):
        n = near_pairs(
            cycles[row], start, step, corner, separation, rows, pitch, teeth, 1e9, pairs, columns, parts, apart, slope
        )
        if n <= 0:
            return False
        fill_compliance(n, pairs, columns, parts, teeth, own, cross, extra, rows, r)
        nearest = 1e9
        for p in range(n):
            nearest = min(nearest, apart[p])
        n_at[:] = 0.0
        w[:] = small**-0.1
        at = nearest
        newest = np.floor(cycles[row] - start)
        for load in range(loads.shape[0]):
            enough = ENOUGH * max(loads[load] if by_force else loads[load] * 1e8, small)
            at = at if by_force else loads[load]
            found = False
            for _ in range(100):
                for p in range(n):
                    for s in range(n_s):
                        approach[p * n_s + s] = at - apart[p] - lead[s]
                done, m = solve_contacts(r, n * n_s, approach, hertz, small, n_at, w, enough, order, a, x)
                if done < 0:
                    return False
                total, stiffness = 0.0, 0.0
                for p in range(m):
                    unit[p] = 1.0
                    total += n_at[order[p]]
                back_substituted(a, m, unit)
                for p in range(m):
                    stiffness += unit[p]
                if not by_force:
                    found = True
                    break
                missing = loads[load] - total
                if abs(missing) <= 1e-9 * loads[load]:
                    found = True
                    break
                at += missing / stiffness if m > 0 and stiffness > 0.0 else max(r[0, 0] * missing, 1e-9)
            if not found:
                return False
            delta[row, load] = at if by_force else total
            for p in range(n):
                slot = int(newest - pairs[p])
                for s in range(n_s):
                    force[row, load, slot, s] = n_at[p * n_s + s]
            for p in range(m):
                i = order[p]
                if n_at[i] > 0.0:
                    tangent[row, load, int(newest - pairs[i // n_s]), i % n_s] = unit[p]
    return True
