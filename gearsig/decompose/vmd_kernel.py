"""Iterations of variational mode decomposition in one real cosine spectrum.

The signal f is mirrored at both ends, period 2n. The mirrored signal's spectrum at line q is a cosine transform C[q]
times a phase that depends on q alone; since every update multiplies by real gains and subtracts, all modes and the
multiplier keep that phase. Only their real factors on the n non-negative lines are computed.
"""

from __future__ import annotations

import numpy as np
from numba import njit

# Reordering sums lets the compiler use vector instructions; divisions stay exact.
_REORDER = {"contract", "reassoc", "nsz"}
_BLOCK = 256
"""Lines per block: a block of a few modes stays in the processor's nearest cache."""


@njit(cache=True, nogil=True, error_model="numpy")  # type: ignore[untyped-decorator,unused-ignore]
def iterate(C, grid, omega, alpha, tau, fixed_zero, tolerance, max_iterations, history):  # type: ignore[no-untyped-def]
    """Iterate until the modes' energy changes by less than `tolerance`.

    Returns the modes' real spectra before the last iteration (see `variational_modes`), the number of iterations and
    the last change of energy. Row m of `history` (max_iterations + 1, K) receives the centres after m iterations.
    """
    K, n = len(omega), len(C)
    old, new = np.zeros((K, n)), np.zeros((K, n))
    dual = np.zeros(n if tau != 0.0 else 0)
    history[0] = omega
    n_done, change = 0, tolerance + 1.0
    while change > tolerance and n_done < max_iterations:
        if n_done:
            old, new = new, old
        change = _update(C, grid, old, new, dual, alpha, tau, fixed_zero, history[n_done], history[n_done + 1])
        n_done += 1
    return old, n_done, change


@njit(cache=True, nogil=True, fastmath=_REORDER, error_model="numpy")  # type: ignore[untyped-decorator,unused-ignore]
def _update(C, grid, old, new, dual, alpha, tau, fixed_zero, omega, omega_next):  # type: ignore[no-untyped-def]
    """One iteration: û_k = (Ĉ - Σ_{i<k} û_i - Σ_{i>k} û_i(old) - λ/2) / (1 + α (ω - ω_k)²), ω_k = centroid of û_k².

    Returns Σ_k ‖û_k - û_k(old)‖² / 2n, which is the change of energy of the mirrored signal's positive lines.
    """
    K, n = old.shape
    energy, moment = np.zeros(K), np.zeros(K)
    rest = np.empty(_BLOCK)
    change = 0.0
    for start in range(0, n, _BLOCK):
        m = min(_BLOCK, n - start)
        frequency = grid[start : start + m]
        _remainder(C[start : start + m], old, dual, start, rest)
        for k in range(K):
            before, after = old[k, start : start + m], new[k, start : start + m]
            block_change, block_energy, block_moment = 0.0, 0.0, 0.0
            for i in range(m):
                distance = frequency[i] - omega[k]
                u = rest[i] / (1.0 + alpha * distance * distance)
                difference = u - before[i]
                block_change += difference * difference
                block_energy += u * u
                block_moment += frequency[i] * (u * u)
                after[i] = u
                rest[i] -= u
            if k + 1 < K:
                following = old[k + 1, start : start + m]
                for i in range(m):
                    rest[i] += following[i]
            change += block_change
            energy[k] += block_energy
            moment[k] += block_moment
        if len(dual):
            for i in range(m):  # the rest is now C - λ/2 - Σ û
                dual[start + i] -= tau * (rest[i] + 0.5 * dual[start + i])
    for k in range(K):
        omega_next[k] = 0.0 if fixed_zero and k == 0 else moment[k] / energy[k]
    return change * (0.5 / n)


@njit(cache=True, nogil=True, fastmath=_REORDER, error_model="numpy")  # type: ignore[untyped-decorator,unused-ignore]
def _remainder(C, old, dual, start, rest):  # type: ignore[no-untyped-def]
    """Ĉ - λ/2 - Σ_{i>0} û_i(old): what the first mode may take."""
    m = len(C)
    for i in range(m):
        rest[i] = C[i]
    if len(dual):
        for i in range(m):
            rest[i] -= 0.5 * dual[start + i]
    for k in range(1, old.shape[0]):
        part = old[k, start : start + m]
        for i in range(m):
            rest[i] -= part[i]
