"""Iterations of variational mode decomposition in one real cosine spectrum.

The signal f is mirrored at both ends, period 2n. The mirrored signal's spectrum at line q is a cosine transform C[q]
times a phase that depends on q alone; since every update multiplies by real gains and subtracts, all modes and the
multiplier keep that phase. Only their real factors on the n non-negative lines are computed.

Memory traffic decides the speed. Lines lie in blocks, all modes of a block together, and are updated in place.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from gearsig.checks import FloatArray

# Reordering sums lets the compiler use vector instructions; divisions stay exact.
_REORDER = {"contract", "reassoc", "nsz"}
_BLOCK = 512
"""Lines per block: a block of a few modes stays in the processor's nearest cache."""
_NEARLY = 4.0
"""From this multiple of the tolerance on, the modes before an iteration are kept: it may be the last one."""


def working_space(n_modes: int, n_lines: int) -> FloatArray:
    """Return memory for `iterate`; numpy asks the system for large pages, which fresh memory is quicker in."""
    return np.empty((2, -(-n_lines // _BLOCK), n_modes, _BLOCK))


@njit(cache=True, nogil=True, error_model="numpy")  # type: ignore[untyped-decorator,unused-ignore]
def iterate(C, grid, space, omega, alpha, tau, fixed_zero, tolerance, max_iterations, history):  # type: ignore[no-untyped-def]
    """Iterate until the modes' energy changes by no more than `tolerance`.

    Returns the modes' real spectra before the last iteration (see `variational_modes`), the number of iterations and
    the last change of energy. Row m of `history` (max_iterations + 1, K) receives the centres after m iterations.
    The spectra lie in `space`, which comes from `working_space`.
    """
    n_limit = max_iterations
    modes, before = space[0], space[1]
    nearly = _NEARLY * tolerance
    while True:
        modes[:] = 0.0
        dual = np.zeros(len(C) if tau != 0.0 else 0)
        history[0] = omega
        n_done, change, kept = 0, np.inf, False
        while n_done < n_limit and (change > tolerance or n_done == 0):
            kept = change <= nearly or n_done + 1 == n_limit
            now, after = history[n_done], history[n_done + 1]
            change = _update(C, grid, modes, before, kept, dual, alpha, tau, fixed_zero, now, after)
            n_done += 1
        if kept:
            return _rows(before, len(C), modes), n_done, change
        n_limit = n_done  # it stopped all of a sudden: once more, with the last iteration known


@njit(cache=True, nogil=True, fastmath=_REORDER, error_model="numpy")  # type: ignore[untyped-decorator,unused-ignore]
def _update(C, grid, modes, before, keep, dual, alpha, tau, fixed_zero, omega, omega_next):  # type: ignore[no-untyped-def]
    """One iteration: û_k = (Ĉ - Σ_{i<k} û_i - Σ_{i>k} û_i(old) - λ/2) / (1 + α (ω - ω_k)²), ω_k = centroid of û_k².

    Returns Σ_k ‖û_k - û_k(old)‖² / 2n, which is the change of energy of the mirrored signal's positive lines.
    """
    n, K = len(C), modes.shape[1]
    energy, moment = np.zeros(K), np.zeros(K)
    rest = np.empty(_BLOCK)
    change = 0.0
    for b in range(modes.shape[0]):
        start = b * _BLOCK
        m = min(_BLOCK, n - start)
        frequency = grid[start : start + m]
        if keep:
            before[b] = modes[b]
        _remainder(C[start : start + m], modes[b], dual[start : start + m], rest)
        for k in range(K):
            mode, centre = modes[b, k], omega[k]
            block_change, block_energy, block_moment = 0.0, 0.0, 0.0
            for i in range(m):
                distance = frequency[i] - centre
                u = rest[i] / (1.0 + alpha * distance * distance)
                difference = u - mode[i]
                block_change += difference * difference
                block_energy += u * u
                block_moment += frequency[i] * (u * u)
                mode[i] = u
                rest[i] -= u
            if k + 1 < K:
                following = modes[b, k + 1]
                for i in range(m):
                    rest[i] += following[i]
            change += block_change
            energy[k] += block_energy
            moment[k] += block_moment
        for i in range(min(m, len(dual))):  # the rest is now C - λ/2 - Σ û
            dual[start + i] -= tau * (rest[i] + 0.5 * dual[start + i])
    for k in range(K):
        omega_next[k] = 0.0 if fixed_zero and k == 0 else moment[k] / energy[k]
    return change * (0.5 / n)


@njit(cache=True, nogil=True, fastmath=_REORDER, error_model="numpy")  # type: ignore[untyped-decorator,unused-ignore]
def _remainder(C, modes, dual, rest):  # type: ignore[no-untyped-def]
    """Ĉ - λ/2 - Σ_{i>0} û_i(old) of one block: what the first mode may take."""
    m = len(C)
    for i in range(m):
        rest[i] = C[i]
    for i in range(len(dual)):
        rest[i] -= 0.5 * dual[i]
    for k in range(1, modes.shape[0]):
        part = modes[k]
        for i in range(m):
            rest[i] -= part[i]


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator,unused-ignore]
def _rows(blocks, n, space):  # type: ignore[no-untyped-def]
    """Lay the lines of each mode in one row, (K, n), in the memory of `space`: fresh memory costs time."""
    rows = space.reshape(-1)[: blocks.shape[1] * n].reshape(blocks.shape[1], n)
    for b in range(blocks.shape[0]):
        start = b * _BLOCK
        m = min(_BLOCK, n - start)
        for k in range(blocks.shape[1]):
            rows[k, start : start + m] = blocks[b, k, :m]
    return rows
