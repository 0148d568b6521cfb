"""Compiled: modal coordinates seen from a tooth, and the works of forces on them.

Inlined where they are used, as are the phases of a step: calls with many arrays took a fifth of the time.
"""

# mypy: allow-untyped-defs, allow-untyped-calls
from __future__ import annotations

from numba import njit

from sims.reduced_fe.contact_kernel import FAST

# Arrays are passed whole, with the places in them: a slice is a new object, whose references are counted at every use.


@njit(inline="always", error_model="numpy", fastmath=FAST)
def to_tooth(w, side, turn, tooth, n_single, n_pairs, out):
    """Modal coordinates as the tooth in contact sees them: pairs turned by nψ."""
    for j in range(n_single):
        out[j] = w[side, j]
    for p in range(n_pairs):
        c, s = w[side, n_single + p], w[side, n_single + n_pairs + p]
        cosine, sine = turn[side, tooth, 0, p], turn[side, tooth, 1, p]
        out[n_single + p] = cosine * c + sine * s
        out[n_single + n_pairs + p] = cosine * s - sine * c


@njit(inline="always", error_model="numpy", fastmath=FAST)
def add_from_tooth(g, side, turn, tooth, n_single, n_pairs, out):
    """Add forces on a tooth's coordinates to those of the gear: the transpose of `to_tooth`."""
    for j in range(n_single):
        out[side, j] += g[j]
    for p in range(n_pairs):
        c, s = g[n_single + p], g[n_single + n_pairs + p]
        cosine, sine = turn[side, tooth, 0, p], turn[side, tooth, 1, p]
        out[side, n_single + p] += cosine * c - sine * s
        out[side, n_single + n_pairs + p] += sine * c + cosine * s


@njit(inline="always", error_model="numpy", fastmath=FAST)
def dots(rows, side, i, s, t, q, v):
    """∂D/∂η · q in columns i and i + 1, and ∂D/∂η · v at the part t between them."""
    a, b, c, d = 0.0, 0.0, 0.0, 0.0
    for j in range(rows.shape[3]):
        low, high = rows[side, i, s, j], rows[side, i + 1, s, j]
        a += low * q[j]
        b += high * q[j]
        c += low * v[j]
        d += high * v[j]
    return a, b, c + t * (d - c)


@njit(inline="always", error_model="numpy", fastmath=FAST)
def on_input(inputs, side, number, w):
    """Displacement (of modal coordinates w) that an input works on."""
    total = 0.0
    for j in range(w.shape[1]):
        total += inputs[side, number, j] * w[side, j]
    return total


@njit(inline="always", error_model="numpy", fastmath=FAST)
def seen_in(factors, line, w):
    """Signal `line` of modal coordinates w of both sides."""
    total = 0.0
    for side in range(2):
        for j in range(w.shape[1]):
            total += factors[line, side, j] * w[side, j]
    return total


@njit(inline="always", error_model="numpy", fastmath=FAST)
def product(a, b):
    """Sum of products of all modes of both sides."""
    total = 0.0
    for side in range(2):
        for j in range(a.shape[1]):
            total += a[side, j] * b[side, j]
    return total


@njit(inline="always", error_model="numpy", fastmath=FAST)
def spread(rows, side, i, s, t, force, g):
    """Take force · ∂D/∂η between two columns from g."""
    low, high = force * (1.0 - t), force * t
    for j in range(rows.shape[3]):
        g[j] -= low * rows[side, i, s, j] + high * rows[side, i + 1, s, j]
