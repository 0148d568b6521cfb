"""Compiled inner loops of the filter bank; they hold no state and release the interpreter."""

from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True, nogil=True, fastmath=True)  # type: ignore[untyped-decorator,unused-ignore]
def fill(X, H, low, high, twiddle, first, out):  # type: ignore[no-untyped-def]
    """out[j, k mod M, r] = X[k] H[j, k] twiddle[k, r]: the bins of line j, ready for M-point inverse FFTs over k.

    Bin k of the block has index k - `first` in X, H and twiddle. Bins of line j run from low[j] to high[j] (excluded).
    Where they are fewer than M, the others are zero; where they are more, they add up: samples are then farther apart
    than the band asks, and still exact.
    """
    M, n_r = out.shape[1], out.shape[2]
    for j in range(out.shape[0]):
        for k in range(high[j], low[j] + M):
            for r in range(n_r):
                out[j, k % M, r] = 0.0
        for k in range(low[j], high[j]):
            i, place = k - first, k % M
            value = X[i] * H[j, i]
            if k >= low[j] + M:
                for r in range(n_r):
                    out[j, place, r] += value * twiddle[i, r]
                continue
            for r in range(n_r):  # indices written out: only so is this loop turned into vector instructions
                out[j, place, r] = value * twiddle[i, r]


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator,unused-ignore]
def turns(first, n_bins, n_r, step, n_block):  # type: ignore[no-untyped-def]
    """e^{2πi k r D / B} for bins k from `first` on and r < n_r; D = step, B = n_block."""
    out = np.empty((n_bins, n_r), dtype=np.complex64)
    for i in range(n_bins):
        angle = 2.0 * np.pi * (((first + i) * step) % n_block) / n_block
        turn, value = complex(np.cos(angle), np.sin(angle)), complex(1.0, 0.0)
        for r in range(n_r):
            out[i, r] = value
            value *= turn
    return out
