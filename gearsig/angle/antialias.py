"""Interpolation with a lower cut-off, where angles are sampled more coarsely than the recording was."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numba import njit

from gearsig.angle.interpolation import HALF_BAND, delay, kaiser_sinc
from gearsig.checks import FloatArray

LOWEST_SCALE = 1.0 / 1024.0
"""Lowest cut-off over the recording's Nyquist frequency: a standing shaft would ask for an endless filter."""

# Steps of the kernel's table between zero crossings: linear interpolation is then good to 1e-7.
_N_STEPS = 2048
# The cut-off follows the speed in steps of 1 %; its filter leaves 0.4 to 0.6 of the sampling rate for the transition.
_STEP = 1.01


@lru_cache(maxsize=1)
def kernel_side() -> FloatArray:
    """Return one side of the kernel, `_N_STEPS` per zero crossing, with zeros behind its end."""
    return kaiser_sinc(np.arange(HALF_BAND * _N_STEPS + 2) / _N_STEPS, HALF_BAND)


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator,unused-ignore]
def interpolate_coarse(x, positions, scale, side, table, out):  # type: ignore[no-untyped-def]
    """out[i] = x at positions[i] (in samples, sorted) after a low-pass that cuts off at scale[i] · Nyquist, scale <= 1.

    The signal is low-passed on a grid of at least four points per cycle of the cut-off, then read by fractional delays.

    Source: R. E. Crochiere, L. R. Rabiner, *Interpolation and decimation of digital signals*, Proc. IEEE 69 (1981), on
    doing such a change of rate in stages.
    """
    n = positions.shape[0]
    i = 0
    while i < n:
        lowest = highest = scale[i]
        stop = i + 1
        while stop < n:
            lowest, highest = min(lowest, scale[stop]), max(highest, scale[stop])
            if highest > _STEP * lowest:
                break
            stop += 1
        s = min(1.0, 0.5 * (lowest + highest) if stop > i + 1 else scale[i])
        # Whole steps of the grid in samples; half a sample only near the full bandwidth.
        step = 0.5 if s > 0.5 else np.floor(0.5 / s)
        first = np.floor(positions[i]) - np.ceil(6 * step)
        n_grid = int((positions[stop - 1] - first) / step) + 8
        delay(
            _lowpassed(x, int(first), step, n_grid, s, side), first, 1.0 / step, positions[i:stop], table, out[i:stop]
        )
        i = stop


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator,unused-ignore]
def _lowpassed(x, first, step, n, s, side):  # type: ignore[no-untyped-def]
    """Low-passed x at first + m·step, m < n."""
    reach = int(np.ceil(HALF_BAND / s)) + 1
    y = np.empty(n)
    whole = _taps(reach, 0.0, s, side)
    if step > 0.5:
        for m in range(n):
            y[m] = _dot(x, first + int(m * step) - reach, whole)
        return y
    half = _taps(reach, 0.5, s, side)
    n_whole = (n + 1) // 2
    if first >= reach and first + n_whole + reach + 4 < x.shape[0]:
        y[0::2] = _along(x, first - reach, n_whole, whole)
        y[1::2] = _along(x, first - reach, n // 2, half)
    else:
        for m in range(n_whole):
            y[2 * m] = _dot(x, first + m - reach, whole)
        for m in range(n // 2):
            y[2 * m + 1] = _dot(x, first + m - reach, half)
    return y


@njit(cache=True, nogil=True, fastmath=True)  # type: ignore[untyped-decorator,unused-ignore]
def _along(x, start, n, taps):  # type: ignore[no-untyped-def]
    """Σⱼ x[start + i + j] taps[j] for each i < n: tap by tap, which suits vector instructions."""
    y = np.zeros(n)
    for block in range(0, n, 2048):
        out = y[block : min(n, block + 2048)]
        length = out.shape[0]
        for j in range(0, taps.shape[0], 4):
            a, b, c, d = taps[j], taps[j + 1], taps[j + 2], taps[j + 3]
            at = start + block + j
            x0, x1, x2, x3 = (
                x[at : at + length],
                x[at + 1 : at + 1 + length],
                x[at + 2 : at + 2 + length],
                x[at + 3 : at + 3 + length],
            )
            for i in range(length):
                out[i] += a * x0[i] + b * x1[i] + c * x2[i] + d * x3[i]
    return y


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator,unused-ignore]
def _taps(reach, shift, s, side):  # type: ignore[no-untyped-def]
    """Kernel at s·(j - shift), j = -reach …, summing to one; zeros at the end make their number a multiple of four."""
    taps = np.empty(4 * ((2 * reach + 4) // 4))
    for j in range(taps.shape[0]):
        place = min(abs(j - reach - shift) * s * _N_STEPS, side.shape[0] - 2.0)
        p = int(place)
        taps[j] = side[p] + (place - p) * (side[p + 1] - side[p])
    return taps / taps.sum()


@njit(cache=True, nogil=True, fastmath=True)  # type: ignore[untyped-decorator,unused-ignore]
def _dot(x, start, taps):  # type: ignore[no-untyped-def]
    """Σⱼ x[start + j] taps[j]; where the taps reach beyond x, the rest of them counts for all."""
    low, high = max(0, -start), min(taps.shape[0], x.shape[0] - start)
    segment = x[start + low : start + high]
    part = taps[low:high]
    total = 0.0
    for j in range(part.shape[0]):
        total += segment[j] * part[j]
    if part.shape[0] == taps.shape[0]:
        return total
    weight = part.sum()
    return total / weight if weight != 0.0 else 0.0
