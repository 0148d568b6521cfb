"""Cosine and sine of an angle in revolutions."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from gearsig.checks import FloatArray

S3, S5, S7, S9, S11, S13, S15 = -1 / 6, 1 / 120, -1 / 5040, 1 / 362880, -1 / 39916800, 1 / 6227020800, -1 / 1307674368e3
C2, C4, C6, C8 = -1 / 2, 1 / 24, -1 / 720, 1 / 40320
C10, C12, C14, C16 = -1 / 3628800, 1 / 479001600, -1 / 87178291200, 1 / 20922789888e3
BLOCK = 1000
QUARTER_TURN_RAD = 1.5707963267948966


@njit(cache=True, nogil=True, error_model="numpy")  # type: ignore[untyped-decorator,unused-ignore]
def cosine_and_sine(revolutions: FloatArray, cosine: FloatArray, sine: FloatArray) -> None:
    """Write cos 2πx and sin 2πx, to about 1e-15.

    Taylor series of a quarter of the angle (at most π/4, where the terms left out are below 1e-16), then doubled twice:
    without branches, so that the compiler runs several samples at once.
    """
    for i in range(len(revolutions)):
        x = revolutions[i]
        a = (x - round(x)) * QUARTER_TURN_RAD
        q = a * a
        s = a * (1 + q * (S3 + q * (S5 + q * (S7 + q * (S9 + q * (S11 + q * (S13 + q * S15)))))))
        c = 1 + q * (C2 + q * (C4 + q * (C6 + q * (C8 + q * (C10 + q * (C12 + q * (C14 + q * C16)))))))
        s2 = 2 * s * c
        c2 = 1 - 2 * s * s
        sine[i] = 2 * s2 * c2
        cosine[i] = 1 - 2 * s2 * s2


@njit(cache=True, nogil=True, error_model="numpy")  # type: ignore[untyped-decorator,unused-ignore]
def write_phasors(revolutions: FloatArray, out: NDArray[Any]) -> None:
    """Write e^{2πix}, by way of pieces that lie side by side in the cache: into every other place it is slow."""
    cosine, sine = np.empty(BLOCK), np.empty(BLOCK)
    for start in range(0, len(revolutions), BLOCK):
        n = min(BLOCK, len(revolutions) - start)
        cosine_and_sine(revolutions[start : start + n], cosine[:n], sine[:n])
        for i in range(n):
            out[start + i] = complex(cosine[i], sine[i])
