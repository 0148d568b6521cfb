"""Cosine and sine of an angle in revolutions."""

from __future__ import annotations

from numba import njit

from gearsig.checks import FloatArray

S3, S5, S7, S9, S11, S13, S15 = -1 / 6, 1 / 120, -1 / 5040, 1 / 362880, -1 / 39916800, 1 / 6227020800, -1 / 1307674368e3
C2, C4, C6, C8 = -1 / 2, 1 / 24, -1 / 720, 1 / 40320
C10, C12, C14, C16 = -1 / 3628800, 1 / 479001600, -1 / 87178291200, 1 / 20922789888e3
QUARTER_TURN_RAD = 1.5707963267948966


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator,unused-ignore]
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
