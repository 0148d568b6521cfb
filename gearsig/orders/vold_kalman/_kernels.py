"""Weights of the Vold–Kalman filter in closed form, and compiled phasors of an order's angle."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gearsig.checks import FloatArray
from gearsig.compiled import njit

HALF_POWER = np.sqrt(np.sqrt(2.0) - 1.0)
"""r·|D| at the -3 dB points, for there 1/(1 + r²|D|²) = 1/√2."""


def settling_time(bandwidth: FloatArray, skirt_poles: int) -> FloatArray:
    """Return the time after which the filter's response has decayed to 1 %, in the inverse unit of the bandwidth.

    The slowest pole of 1/(1 + (√2 - 1)(2f/B)^2p) decays as exp(-t/τ), τ = (√2 - 1)^(1/2p)/(πB sin(π/2p)); this is
    τ ln 100: 0.94/B, 1.66/B and 2.53/B for one, two and three poles. The first generation's skirts have one. Where the
    bandwidth is 0, as that of an order of a shaft at rest, it is infinite.
    """
    slowness = HALF_POWER ** (1.0 / skirt_poles) / (np.pi * np.sin(0.5 * np.pi / skirt_poles))
    with np.errstate(divide="ignore"):
        time: FloatArray = np.log(100.0) * slowness / bandwidth
    return time


def envelope_weight(bandwidth: FloatArray, p: int) -> FloatArray:
    """Return r = √(√2 - 1)/(2 sin(πb/2))^p of the second generation; bandwidth b in cycles per sample.

    The gain at a distance f is then 1/(1 + r² (2 sin πf)^2p). For narrow bands r is 0.2049/b, 0.0652/b² and 0.0208/b³.

    J. Tůma, "Setting the passband width in the Vold-Kalman order tracking filter", 2005.
    """
    r: FloatArray = HALF_POWER / (2.0 * np.sin(0.5 * np.pi * bandwidth)) ** p
    return r


def waveform_weight(bandwidth: FloatArray, frequency: FloatArray) -> FloatArray:
    """Return r of the first generation; bandwidth and frequency in cycles per sample.

    With h half the bandwidth and ω the frequency in rad, r = √(√2 - 1)/(2 tan h √(sin²ω - sin²h)): the -3 dB points of
    1/(1 + r²(2 cos ω' - 2 cos ω)²) lie 2h apart, not quite symmetric about ω.
    """
    h, omega = np.pi * bandwidth, 2.0 * np.pi * frequency
    # sin²ω - sin²h as a product: no digits are lost where the band nearly touches zero frequency.
    r: FloatArray = HALF_POWER / (2.0 * np.tan(h) * np.sqrt(np.sin(omega - h) * np.sin(omega + h)))
    return r


def lowest_frequency(bandwidth: FloatArray) -> FloatArray:
    """Return the frequency below which the first generation's band reaches zero; both in cycles per sample.

    cos ω = cos² h: about 0.71 bandwidths, for the band is not symmetric. The same holds below half the sampling rate.
    """
    f: FloatArray = np.arccos(np.cos(np.pi * bandwidth) ** 2) / (2.0 * np.pi)
    return f


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


@njit(cache=True, nogil=True, error_model="numpy")  # type: ignore[untyped-decorator,unused-ignore]
def write_modulated(envelope: NDArray[Any], revolutions: FloatArray, out: FloatArray) -> None:
    """Write Re(a e^{2πix})."""
    cosine, sine = np.empty(BLOCK), np.empty(BLOCK)
    for start in range(0, len(revolutions), BLOCK):
        n = min(BLOCK, len(revolutions) - start)
        cosine_and_sine(revolutions[start : start + n], cosine[:n], sine[:n])
        for i in range(n):
            a = envelope[start + i]
            out[start + i] = a.real * cosine[i] - a.imag * sine[i]


@njit(cache=True, nogil=True, error_model="numpy")  # type: ignore[untyped-decorator,unused-ignore]
def write_envelope(waveform: FloatArray, revolutions: FloatArray, out: NDArray[Any]) -> None:
    """Write the envelope a of x = Re(a e^{2πic}), taken as constant from a sample to its neighbours.

    They are x(n±1) = x cos α± ∓ q sin α±, α± the phase step; both give the quadrature q by least squares, and
    a = (x + iq) e^{-2πic}.
    """
    n = len(waveform)
    cosine, sine = np.empty(BLOCK), np.empty(BLOCK)
    step_cosine, step_sine = np.empty(BLOCK + 1), np.empty(BLOCK + 1)
    for start in range(0, n, BLOCK):
        stop = min(start + BLOCK, n)
        cosine_and_sine(revolutions[start:stop], cosine[: stop - start], sine[: stop - start])
        first, last = max(start - 1, 0), min(stop, n - 1)  # steps from first to last; none beyond the ends
        steps = revolutions[first + 1 : last + 1] - revolutions[first:last]
        cosine_and_sine(steps, step_cosine[: last - first], step_sine[: last - first])
        for i in range(start, stop):
            x, q, size = waveform[i], 0.0, 0.0
            if i > 0:
                c, s = step_cosine[i - 1 - first], step_sine[i - 1 - first]
                q += (waveform[i - 1] - x * c) * s
                size += s * s
            if i < n - 1:
                c, s = step_cosine[i - first], step_sine[i - first]
                q -= (waveform[i + 1] - x * c) * s
                size += s * s
            if size > 0.0:
                q /= size
            out[i] = complex(x, q) * complex(cosine[i - start], -sine[i - start])
