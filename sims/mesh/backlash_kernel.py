"""Compiled contact of one tooth pair with backlash, for right-hand sides; see `sims.mesh.backlash`."""

from __future__ import annotations

from numba import njit


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator,unused-ignore]
def penetration_m(compression_m, half_backlash_m):  # type: ignore[no-untyped-def]
    """Dead zone: δ - b beyond b, δ + b beyond -b, 0 between."""
    if compression_m > half_backlash_m:
        return compression_m - half_backlash_m
    if compression_m < -half_backlash_m:
        return compression_m + half_backlash_m
    return 0.0


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator,unused-ignore]
def contact_force_n(  # type: ignore[no-untyped-def]
    compression_m,
    compression_rate_mps,
    half_backlash_m,
    half_backlash_rate_mps,
    drive_stiffness_n_per_m,
    back_stiffness_n_per_m,
    damping_n_s_per_m,
    damping_ramp_m,
):
    """Force along the line of action: above 0 on the drive flank, below 0 on the back flank, 0 in the gap."""
    if compression_m > half_backlash_m:
        side, rate, stiffness = 1.0, compression_rate_mps - half_backlash_rate_mps, drive_stiffness_n_per_m
    elif compression_m < -half_backlash_m:
        side, rate, stiffness = -1.0, compression_rate_mps + half_backlash_rate_mps, back_stiffness_n_per_m
    else:
        return 0.0
    depth = side * compression_m - half_backlash_m
    gate = 1.0
    if depth < damping_ramp_m:
        gate = depth / damping_ramp_m
    pressed = stiffness * depth + damping_n_s_per_m * gate * side * rate
    return side * pressed if pressed > 0.0 else 0.0
