"""Bandlimited interpolation at arbitrary times, and with a lower cut-off where the result is sampled more coarsely."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numba import njit

from gearsig.checks import FloatArray

PASSBAND = 0.4
"""Upper edge over the lower of both sampling rates; up to it the error stays below 5e-6 of full scale."""

HALF_BAND = 20  # taps on each side of the doubling filter
_NEAR = 6  # taps on each side of the fractional delay, at the doubled rate

REACH = HALF_BAND + _NEAR // 2 + 1
"""Samples on each side of a point that take part in its value."""

_N_PHASES = 512
_BLOCK = 512
# -116 dB; with 2 × 20 taps the error is 3e-6 at 0.4 of the sampling rate and below 1e-6 up to 0.2.
_KAISER_BETA = 0.1102 * (116.0 - 8.7)


@lru_cache(maxsize=1)
def doubling_filter() -> FloatArray:
    """Return one side of the half-band filter that finds the value half way between samples, (HALF_BAND,).

    h(j) = sinc(j + 1/2) · I₀(β√(1 - ((j + 1/2)/H)²)) / I₀(β), scaled to sum one half.

    Source: A. V. Oppenheim, R. W. Schafer, *Discrete-Time Signal Processing*, ch. 7 (Kaiser window).
    """
    side = kaiser_sinc(np.arange(HALF_BAND) + 0.5, HALF_BAND)
    half: FloatArray = side / (2.0 * side.sum())
    return half


@lru_cache(maxsize=1)
def delay_table() -> FloatArray:
    """Return fractional-delay taps for each sub-sample position at the doubled rate, (n_phases, 4·_NEAR).

    A row holds the taps of a position, then their differences to those of the next position.

    Least squares over the band |f| < a/2 with a = 0.42 (in cycles per doubled sample, i.e. 0.42 of the original rate):
    Σₘ sinc(a(k - m)) hₘ = sinc(a(k - d)) for delay d. Rows sum to one, so that a constant stays that constant.

    Source: T. I. Laakso, V. Välimäki, M. Karjalainen, U. K. Laine, *Splitting the unit delay*, IEEE Signal
    Processing Magazine 13 (1996), general least-squares design.
    """
    a = 0.42
    delays = np.arange(_N_PHASES + 1) / _N_PHASES
    taps = np.arange(1 - _NEAR, _NEAR + 1)
    within = np.sinc(a * (taps[:, None] - taps[None, :]))
    across = np.sinc(a * (taps[:, None] - delays[None, :]))
    rows = np.linalg.lstsq(within, across, rcond=1e-15)[0].T
    rows /= rows.sum(axis=1, keepdims=True)
    return np.ascontiguousarray(np.hstack([rows[:-1], np.diff(rows, axis=0)]))


def kaiser_sinc(x: FloatArray, half_width: float) -> FloatArray:
    """Return sinc(x) under a Kaiser window that ends at `half_width`; for x >= 0."""
    inside = np.clip(1.0 - np.square(x / half_width), 0.0, None)
    h = np.sinc(x) * np.i0(_KAISER_BETA * np.sqrt(inside)) / np.i0(_KAISER_BETA)
    return np.where(x < half_width, h, 0.0)


@njit(cache=True, nogil=True, fastmath=True)  # type: ignore[untyped-decorator,unused-ignore]
def interpolate(x, positions, side, table, out):  # type: ignore[no-untyped-def]
    """out[i] = value of x at positions[i] (in samples): the stretch needed is doubled, then delayed by a fraction.

    Positions are sorted and lie REACH samples or more inside x. Doubling first costs little, as it runs along the
    samples, and lets twelve taps do what would take forty.
    """
    first = int(positions[0]) - 3
    doubled = _doubled(x, first, int(positions[-1]) - first + 5, side)
    delay(doubled, first, 2.0, positions, table, out)


@njit(cache=True, nogil=True, fastmath=True)  # type: ignore[untyped-decorator,unused-ignore]
def _doubled(x, first, n, side):  # type: ignore[no-untyped-def]
    """Samples first to first + n of x, each followed by the value half way to the next.

    In blocks that stay in the processor's nearest cache while the taps run over them.
    """
    doubled = np.empty(2 * n)
    middle = np.empty(_BLOCK)
    for start in range(0, n, _BLOCK):
        m = min(_BLOCK, n - start)
        at = first + start
        middle[:m] = 0.0
        for j in range(side.shape[0]):
            weight = side[j]
            left = x[at - j : at - j + m]
            right = x[at + j + 1 : at + j + 1 + m]
            for i in range(m):
                middle[i] += weight * (left[i] + right[i])
        for i in range(m):
            doubled[2 * (start + i)] = x[at + i]
            doubled[2 * (start + i) + 1] = middle[i]
    return doubled


@njit(cache=True, nogil=True, fastmath=True)  # type: ignore[untyped-decorator,unused-ignore]
def delay(y, first, per_sample, positions, table, out):  # type: ignore[no-untyped-def]
    """Read y, whose value m lies at first + m / per_sample samples, at any positions by fractional delays."""
    # The number of taps is read from the table: with a constant here, the compiler unrolls the loop into single
    # multiplications and uses no vector instructions.
    n_phases, n_taps = table.shape[0], table.shape[1] // 2
    for i in range(positions.shape[0]):
        place = per_sample * (positions[i] - first)
        k = int(place)
        phase = (place - k) * n_phases
        p = int(phase)
        between = phase - p
        # Slices, as an index that might be negative keeps the compiler from using vector instructions.
        segment = y[k - 5 : k - 5 + n_taps]
        taps, rise = table[p, :n_taps], table[p, n_taps:]
        total = 0.0
        for j in range(n_taps):
            total += (taps[j] + between * rise[j]) * segment[j]
        out[i] = total
