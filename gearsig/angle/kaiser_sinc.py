"""Bandlimited interpolation at arbitrary times: a Kaiser-windowed sinc from a finely stepped table."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numba import njit

from gearsig.checks import FloatArray

HALF_WIDTH = 16
"""Samples on each side of the point that take part."""

PASSBAND = 0.4
"""Upper edge, as a fraction of the lower of both sampling rates, up to which the interpolation error stays below 5e-6."""

_N_PHASES = 1024
# -110 dB stopband. With 32 taps the transition then spans 0.4 to 0.6 of the sampling rate (Kaiser's formula).
_KAISER_BETA = 0.1102 * (110.0 - 8.7)


@lru_cache(maxsize=1)
def interpolation_table() -> FloatArray:
    """Return the kernel for each sub-sample position, (n_phases + 1, 2·HALF_WIDTH), rows summing to one.

    h(x) = sinc(x) · I₀(β√(1 - (x/H)²)) / I₀(β), x in samples, |x| < H.

    Source: A. V. Oppenheim, R. W. Schafer, *Discrete-Time Signal Processing*, ch. 7 (Kaiser window); J. O. Smith, P. Gossett, *A
    flexible sampling-rate conversion method*, ICASSP 1984 (the table).
    """
    fractions = np.arange(_N_PHASES + 1) / _N_PHASES
    taps = np.arange(1 - HALF_WIDTH, HALF_WIDTH + 1)
    x = taps[None, :] - fractions[:, None]
    table = _kernel(x)
    table /= table.sum(axis=1, keepdims=True)  # a constant stays that constant
    return np.ascontiguousarray(table)


@lru_cache(maxsize=1)
def stretched_table() -> FloatArray:
    """Return one side of the kernel, (HALF_WIDTH · n_phases + 2,), for the anti-aliasing that stretches it."""
    return _kernel(np.arange(HALF_WIDTH * _N_PHASES + 2) / _N_PHASES)


def _kernel(x: FloatArray) -> FloatArray:
    inside = np.clip(1.0 - np.square(x / HALF_WIDTH), 0.0, None)
    h: FloatArray = np.sinc(x) * np.i0(_KAISER_BETA * np.sqrt(inside)) / np.i0(_KAISER_BETA)
    return np.where(np.abs(x) <= HALF_WIDTH, h, 0.0)


@njit(cache=True, nogil=True, fastmath=True)  # type: ignore[untyped-decorator,unused-ignore]
def interpolate(x, positions, table, out):  # type: ignore[no-untyped-def]
    """out[i] = Σⱼ x[k + j] h(positions[i] - k - j), k the sample at or before the position; all taps must lie inside x."""
    n_phases = table.shape[0] - 1
    n_taps = table.shape[1]
    before = n_taps // 2 - 1
    for i in range(positions.shape[0]):
        k = int(positions[i])
        phase = (positions[i] - k) * n_phases
        p = int(phase)
        if p >= n_phases:
            p = n_phases - 1
        between = phase - p
        first = k - before
        low = 0.0
        high = 0.0
        for j in range(n_taps):
            low += table[p, j] * x[first + j]
            high += table[p + 1, j] * x[first + j]
        out[i] = low + between * (high - low)


@njit(cache=True, nogil=True, fastmath=True)  # type: ignore[untyped-decorator,unused-ignore]
def interpolate_stretched(x, positions, scale, side, half_width, out):  # type: ignore[no-untyped-def]
    """As `interpolate`, with the kernel stretched by 1/scale[i] (scale <= 1) so that it cuts off at scale · Nyquist.

    The sum is divided by the sum of the taps, so that a constant stays; taps outside x are left out of both.
    """
    n = x.shape[0]
    per_unit = (side.shape[0] - 2) / half_width
    for i in range(positions.shape[0]):
        s = scale[i]
        centre = positions[i]
        reach = half_width / s
        first = max(0, int(np.ceil(centre - reach)))
        last = min(n - 1, int(np.floor(centre + reach)))
        total = 0.0
        weights = 0.0
        for k in range(first, last + 1):
            place = abs(k - centre) * s * per_unit
            p = int(place)
            if p >= side.shape[0] - 1:
                continue
            h = side[p] + (place - p) * (side[p + 1] - side[p])
            total += h * x[k]
            weights += h
        out[i] = total / weights
