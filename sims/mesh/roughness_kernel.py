"""Compiled roughness for right-hand sides: phasors stepped in time, tables looked up on the flank."""

from __future__ import annotations

from numba import njit


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator,unused-ignore]
def height_now(real, imaginary, omega_rad_s):  # type: ignore[no-untyped-def]
    """(Σ Re p_n, -Σ ω_n Im p_n): height and its rate from the phasors p_n = a_n exp(i(ω_n t + κ_n))."""
    height, rate = 0.0, 0.0
    for n in range(real.shape[0]):
        height += real[n]
        rate -= omega_rad_s[n] * imaginary[n]
    return height, rate


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator,unused-ignore]
def advance(real, imaginary, step_cos, step_sin):  # type: ignore[no-untyped-def]
    """Turn the phasors by one step, in place; exact up to rounding, about 1e-16 per step."""
    for n in range(real.shape[0]):
        re = real[n] * step_cos[n] - imaginary[n] * step_sin[n]
        imaginary[n] = real[n] * step_sin[n] + imaginary[n] * step_cos[n]
        real[n] = re


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator,unused-ignore]
def height_on_flank(heights_m, slopes, step_m, tooth, position_m):  # type: ignore[no-untyped-def]
    """(z, dz/ds) of a tooth at a position on its flank, by cubic Hermite interpolation.

    `heights_m` and `slopes` are (n_teeth, n_points). The tooth number counts on through revolutions, also backwards.
    Past the table's ends the height stays that of the end.
    """
    row = tooth % heights_m.shape[0]
    last = heights_m.shape[1] - 1
    x = position_m / step_m
    if x <= 0.0:
        return heights_m[row, 0], 0.0
    if x >= last:
        return heights_m[row, last], 0.0
    i = int(x)
    u = x - i
    z0, z1 = heights_m[row, i], heights_m[row, i + 1]
    d0, d1 = slopes[row, i] * step_m, slopes[row, i + 1] * step_m
    c2 = 3.0 * (z1 - z0) - 2.0 * d0 - d1
    c3 = d0 + d1 - 2.0 * (z1 - z0)
    return z0 + u * (d0 + u * (c2 + u * c3)), (d0 + u * (2.0 * c2 + 3.0 * u * c3)) / step_m
