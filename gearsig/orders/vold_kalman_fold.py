"""What the recursions of one order take, block by block: both halves of the signal, each from its end."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from gearsig.checks import FloatArray
from gearsig.orders.vold_kalman_phasor import cosine_and_sine
from gearsig.orders.vold_kalman_weight import HALF_POWER

Array = NDArray[Any]


@njit(cache=True, nogil=True, error_model="numpy")  # type: ignore[untyped-decorator,unused-ignore]
def fold(values: Array, first: int, last: int, out: FloatArray) -> None:
    """Write values[first], values[first + 1]… and values[last], values[last - 1]… as the two rows of `out`.

    Beyond its ends, `values` continues with its first and last one.
    """
    highest, n = len(values) - 1, out.shape[1]
    if first >= 0 and first + n <= highest + 1 and last <= highest and last + 1 >= n:  # plain copies: several at once
        for i in range(n):
            out[0, i] = values[first + i]
        for i in range(n):
            out[1, i] = values[last - i]
        return
    for i in range(n):
        out[0, i] = values[min(max(first + i, 0), highest)]
        out[1, i] = values[min(max(last - i, 0), highest)]


@njit(cache=True, nogil=True, error_model="numpy")  # type: ignore[untyped-decorator,unused-ignore]
def demodulate(signal: FloatArray, cosine: FloatArray, sine: FloatArray, out: Array) -> None:
    """Write y e^{-iΘ}."""
    for i in range(len(out)):
        out[i] = complex(signal[i] * cosine[i], -signal[i] * sine[i])


@njit(cache=True, nogil=True, error_model="numpy")  # type: ignore[untyped-decorator,unused-ignore]
def oscillator(cycles: FloatArray, bandwidth: FloatArray, kappa: FloatArray, q: FloatArray) -> None:
    """Write κ = 2 - 2 cos ω and q = 1/r² of each row of the first generation's structural equation.

    q = 4 tan² h sin(ω - h) sin(ω + h)/(√2 - 1), h half the bandwidth in rad. Where the band comes close to zero or half
    the sampling rate (the order is no part of the data there), q stays at what 3/4 of a bandwidth from there gives.

    Parameters
    ----------
    cycles : array, (n + 2,)
        Phase of the order, in either direction of time.
    bandwidth : array, (n,) or (1,)
        -3 dB, in cycles per sample.
    kappa, q : arrays, (n,)
    """
    n = len(kappa)
    cos_half, sin_half = np.empty(n), np.empty(n)
    cosine_and_sine((cycles[2:] - cycles[:-2]) / 4.0, cos_half, sin_half)
    cos_h, sin_h = np.empty(len(bandwidth)), np.empty(len(bandwidth))
    cosine_and_sine(bandwidth / 2.0, cos_h, sin_h)
    step = 0 if len(bandwidth) == 1 else 1
    for i in range(n):
        c, s = cos_h[step * i], sin_h[step * i]
        cos_omega, sin_omega = 1.0 - 2.0 * sin_half[i] * sin_half[i], 2.0 * sin_half[i] * cos_half[i]
        product = (sin_omega * c - cos_omega * s) * (sin_omega * c + cos_omega * s)
        # sin(h/2) sin(5h/2) = (cos 2h - cos 3h)/2
        least = 0.5 * (2.0 * c * c - 1.0 - c * (4.0 * c * c - 3.0))
        kappa[i] = 4.0 * sin_half[i] * sin_half[i]
        q[i] = 4.0 * s * s * max(product, least) / (c * c * HALF_POWER * HALF_POWER)
