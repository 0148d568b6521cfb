"""Splitting of bands into halves or thirds, with the moments of the parts, compiled."""

from __future__ import annotations

import numpy as np
from numba import njit

# Reordering sums lets the compiler use vector instructions.
_REORDER = {"contract", "reassoc", "nsz"}
_TILE = 256
"""Outputs at a time: all of a tile's sums stay in the nearest cache."""


@njit(cache=True, nogil=True, error_model="numpy")  # type: ignore[untyped-decorator,unused-ignore]
def split(x, cosine, sine, middle, n_parts, n_out, first_is_odd, parts, moments):  # type: ignore[no-untyped-def]
    """Filter each row of x into its parts and add up their moments.

    Row r of `x` (n_rows, 2, n: real and imaginary parts) gives rows n_parts·r … of `parts`, lowest band first, each
    again a signal on 0 to 1/2 of its own rate; `parts` of no rows keeps nothing. `moments` (n_rows·n_parts, 3)
    gathers Σ|z|², Σ|z|⁴ and the largest |z|². `first_is_odd` tells the parity of the first output's number.
    """
    n_side = len(cosine) - 1
    turned = np.empty((n_parts, 2, _TILE + (2 * n_side) // n_parts + 1))
    sums = np.empty((6, 2, _TILE))
    z = np.empty((3, 2, _TILE))
    for row in range(x.shape[0]):
        for start in range(0, n_out, _TILE):
            n = min(_TILE, n_out - start)
            _take_phases(x[row], start * n_parts, n * n_parts + 2 * n_side + 1, n_parts, turned)
            _filter(turned, cosine, sine, middle, n_parts, n, sums)
            _combine(sums, n_parts, n, z)
            for part in range(n_parts):
                _add_moments(z[part], n, moments[row * n_parts + part])
            if parts.shape[0] > 0:
                for part in range(n_parts):
                    sign = part % 2 == 1  # bands that start at odd multiples of half the new rate
                    _store(z[part], n, sign, (start % 2 == 1) != first_is_odd, parts[row * n_parts + part], start)


@njit(cache=True, nogil=True, error_model="numpy")  # type: ignore[untyped-decorator,unused-ignore]
def _take_phases(x, start, n, n_parts, turned):  # type: ignore[no-untyped-def]
    """Deal the samples from `start` on out to n_parts phases: neighbouring outputs then read neighbouring samples."""
    available = min(n, x.shape[1] - start)
    for component in range(2):
        for phase in range(n_parts):
            source = x[component, start + phase : start + available : n_parts]
            turned[phase, component, : len(source)] = source


@njit(cache=True, nogil=True, fastmath=_REORDER, error_model="numpy")  # type: ignore[untyped-decorator,unused-ignore]
def _filter(turned, cosine, sine, middle, n_parts, n, sums):  # type: ignore[no-untyped-def]
    """Sum the products with cosine and sine taps, even and odd ones apart (0 to 3), and the middle's (4, 5)."""
    n_side = len(cosine) - 1
    sums[:, :, :n] = 0.0
    for component in range(2):
        centre = turned[n_side % n_parts, component, n_side // n_parts :]
        for m in range(n):
            sums[0, component, m] = cosine[0] * centre[m]
            sums[4, component, m] = middle[0] * centre[m]
        for k in range(1, n_side + 1):
            a, b, c = cosine[k], sine[k], middle[k]
            if a == 0.0 and b == 0.0:
                continue
            before = turned[(n_side - k) % n_parts, component, (n_side - k) // n_parts :]
            after = turned[(n_side + k) % n_parts, component, (n_side + k) // n_parts :]
            odd = k % 2
            even_sum, odd_sum = sums[odd, component], sums[2 + odd, component]
            if n_parts == 2:
                _add_pair(before, after, a, b, n, even_sum, odd_sum)
            elif odd == 0:
                _add_three(before, after, a, b, c, 0.0, n, even_sum, odd_sum, sums[4, component])
            else:
                _add_three(before, after, a, b, 0.0, c, n, even_sum, odd_sum, sums[5, component])


@njit(cache=True, nogil=True, fastmath=_REORDER, error_model="numpy")  # type: ignore[untyped-decorator,unused-ignore]
def _add_pair(before, after, a, b, n, even_sum, odd_sum):  # type: ignore[no-untyped-def]
    for m in range(n):
        even_sum[m] += a * (after[m] + before[m])
        odd_sum[m] += b * (after[m] - before[m])


@njit(cache=True, nogil=True, fastmath=_REORDER, error_model="numpy")  # type: ignore[untyped-decorator,unused-ignore]
def _add_three(before, after, a, b, c, d, n, even_sum, odd_sum, middle_sum):  # type: ignore[no-untyped-def]
    for m in range(n):
        s, t = after[m] + before[m], after[m] - before[m]
        even_sum[m] += a * s
        odd_sum[m] += b * t
        middle_sum[m] += c * s + d * t


@njit(cache=True, nogil=True, fastmath=_REORDER, error_model="numpy")  # type: ignore[untyped-decorator,unused-ignore]
def _combine(sums, n_parts, n, z):  # type: ignore[no-untyped-def]
    """Form the parts: first = C - iS; last likewise with the odd taps of C and the even taps of S reversed."""
    last = n_parts - 1
    for m in range(n):
        for component in range(2):
            other = 1 - component
            sign = 1.0 if component == 0 else -1.0  # -i(p + iq) = q - ip
            even_c, odd_c = sums[0, component, m], sums[1, component, m]
            even_s, odd_s = sign * sums[2, other, m], sign * sums[3, other, m]
            z[0, component, m] = even_c + odd_c + even_s + odd_s
            z[last, component, m] = even_c - odd_c - even_s + odd_s
            if n_parts == 3:
                z[1, component, m] = sums[4, component, m] + sign * sums[5, other, m]


@njit(cache=True, nogil=True, fastmath=_REORDER, error_model="numpy")  # type: ignore[untyped-decorator,unused-ignore]
def _add_moments(z, n, moments):  # type: ignore[no-untyped-def]
    second, fourth, largest = 0.0, 0.0, moments[2]
    for m in range(n):
        power = z[0, m] * z[0, m] + z[1, m] * z[1, m]
        second += power
        fourth += power * power
        largest = max(largest, power)
    moments[0] += second
    moments[1] += fourth
    moments[2] = largest


@njit(cache=True, nogil=True, error_model="numpy")  # type: ignore[untyped-decorator,unused-ignore]
def _store(z, n, alternating, starts_odd, part, start):  # type: ignore[no-untyped-def]
    """Write z; where it alternates, times (-1)^m, which shifts the band by half the rate to 0."""
    for component in range(2):
        if not alternating:
            part[component, start : start + n] = z[component, :n]
            continue
        sign = -1.0 if starts_odd else 1.0
        for m in range(n):
            part[component, start + m] = sign * z[component, m]
            sign = -sign
