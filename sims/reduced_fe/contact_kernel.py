"""Compiled contact of several points on elastic bodies: which carry, and how much.

Points i at the approach D_i carry N_i ≥ 0 with D = R N + h(N) where they touch; R is the compliance of the bodies and
h(N) = B N^0.9 the local approach by Hertz. Below the force `small` the latter is straight, h = B small^-0.1 N, so that
a contact that begins has a finite stiffness.
"""

# mypy: allow-untyped-defs, allow-untyped-calls
from __future__ import annotations

from numba import njit

from sims.compiled import UNCOUNTED

FAST = {"reassoc", "contract", "nsz"}
"""Sums may be reordered for vector instructions; infinities and NaN keep their meaning."""
MOST_ITERATIONS = 60


@njit(cache=True, nogil=True, error_model="numpy", **UNCOUNTED)
def root(force, small, guess):
    """max(N, small)^-0.1, by Newton's method from a guess near it."""
    n = max(force, small)
    w2 = guess * guess
    w4 = w2 * w2
    off = n * w4 * w4 * w2
    if off < 0.7 or off > 1.4:
        return n**-0.1
    w = guess * (1.1 - 0.1 * off)
    w2 = w * w
    w4 = w2 * w2
    return w * (1.1 - 0.1 * n * w4 * w4 * w2)


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST, **UNCOUNTED)
def factorised(a, n):
    """Overwrite the lower triangle of a symmetric positive matrix by its Cholesky factor, with 1/diagonal on it."""
    for i in range(n):
        for j in range(i):
            total = a[i, j]
            for k in range(j):
                total -= a[i, k] * a[j, k]
            a[i, j] = total * a[j, j]
        total = a[i, i]
        for k in range(i):
            total -= a[i, k] * a[i, k]
        if not total > 0.0:
            return False
        a[i, i] = 1.0 / total**0.5
    return True


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST, **UNCOUNTED)
def back_substituted(a, n, x):
    """Solve with the factor of `factorised`, in place."""
    for i in range(n):
        total = x[i]
        for k in range(i):
            total -= a[i, k] * x[k]
        x[i] = total * a[i, i]
    for i in range(n - 1, -1, -1):
        total = x[i]
        for k in range(i + 1, n):
            total -= a[k, i] * x[k]
        x[i] = total * a[i, i]


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST, **UNCOUNTED)
def solve_contacts(r, n, approach, hertz, small, force, w, enough, order, a, x):
    """Fill `force` (start values on entry) with N ≥ 0; return the number of iterations, or −1 where it fails.

    r : (≥ n, ≥ n) compliance, symmetric.
    approach : (≥ n,) D.
    hertz : (n_s,) B of the slices; point i is of slice i mod n_s.
    w : (≥ n,) N^-0.1, carried along.
    enough : largest change of a force at which an iteration counts as the last. Newton's error falls with the square
        of the change, as h is almost straight: a change of 5 % leaves 1e-4.
    order, a, x : scratch; on return order[:m] are the points that touch and `a` the factor of R + h'(N) over them.
    """
    n_s = hertz.shape[0]
    for iteration in range(1, MOST_ITERATIONS + 1):
        m = 0
        for i in range(n):
            free = approach[i]
            for j in range(n):
                free -= r[i, j] * force[j]
            if force[i] > 0.0 or free > 0.0:
                w[i] = root(force[i], small, w[i])
                order[m] = i
                x[m] = free - hertz[i % n_s] * w[i] * force[i]
                m += 1
        for p in range(m):
            i = order[p]
            for s in range(p):
                a[p, s] = r[i, order[s]]
            a[p, p] = r[i, i] + (0.9 if force[i] > small else 1.0) * hertz[i % n_s] * w[i]
        if not factorised(a, m):
            return -1, m
        back_substituted(a, m, x)
        largest, let_go = 0.0, False
        for p in range(m):
            i = order[p]
            change = x[p]
            if force[i] + change < 0.0:
                change, let_go = -force[i], let_go or force[i] > 0.0
            force[i] += change
            largest = max(largest, abs(change))
        if largest <= enough and not let_go:
            return iteration, m
        if not largest < 1e30:
            return -1, m
    return -1, 0


@njit(cache=True, nogil=True, error_model="numpy", **UNCOUNTED)
def hertz_energy(force, hertz, small):
    """Energy of the local approach, ∫ N dh, in J."""
    if force <= small:
        return 0.5 * hertz * small**-0.1 * force * force
    upper = hertz * 0.9 / 1.9 * (force**1.9 - small**1.9)
    return 0.5 * hertz * small**1.9 + upper
