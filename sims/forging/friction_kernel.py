"""Compiled: LuGre friction of a shaft, and of tooth flanks whose normal force varies."""

# mypy: allow-untyped-defs, allow-untyped-calls
from __future__ import annotations

from math import exp

from numba import njit


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def bristle(v, z, static_ratio, stribeck, presliding, bristle_time):
    """Force over its sliding level, and dz/dt; see `sims.forging.drive.Bristle`."""
    near_rest = exp(-((v / stribeck) ** 2))
    rate = (v - abs(v) * z / (1.0 + (static_ratio - 1.0) * near_rest)) / presliding
    return z + bristle_time * near_rest * rate, rate
