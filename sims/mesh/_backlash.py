"""Contact along the line of action with backlash: drive flank, gap 2b, back flank; no tension."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import ArrayLike

from gearsig.checks import FloatArray, not_negative, positive
from gearsig.errors import InputError


@dataclass(frozen=True)
class FlankContact:
    """Spring and damper that act only where flanks touch.

    With compression δ, half backlash b(t) and depth d = |δ| - b > 0:
    drive flank (δ > b): N = max(k d + c g (δ̇ - ḃ), 0);
    back flank (δ < -b): N = -max(k' d - c g (δ̇ + ḃ), 0); otherwise 0.
    g = min(d/d₀, 1) brings the damping in over the first d₀ of the depth, so that the force does not jump when a flank
    touches at speed; d₀ = 0 leaves the ramp out.

    Parameters
    ----------
    drive_stiffness_n_per_m, back_stiffness_n_per_m : float
        k and k', above zero.
    damping_n_s_per_m : float
        c, not below zero.
    damping_ramp_m : float
        d₀, not below zero..

    Examples
    --------
    >>> contact = FlankContact(1e8, 1e8)
    >>> contact.force_n([3e-5, 0.0, -3e-5], 0.0, half_backlash_m=2e-5)
    array([ 1000.,     0., -1000.])
    """

    drive_stiffness_n_per_m: float
    back_stiffness_n_per_m: float
    damping_n_s_per_m: float = 0.0
    damping_ramp_m: float = 0.0

    def __post_init__(self) -> None:
        positive(self.drive_stiffness_n_per_m, "drive_stiffness_n_per_m", "N/m")
        positive(self.back_stiffness_n_per_m, "back_stiffness_n_per_m", "N/m")
        not_negative(self.damping_n_s_per_m, "damping_n_s_per_m", "N s/m")
        not_negative(self.damping_ramp_m, "damping_ramp_m", "m")

    def force_n(
        self,
        compression_m: ArrayLike,
        compression_rate_mps: ArrayLike,
        *,
        half_backlash_m: ArrayLike,
        half_backlash_rate_mps: ArrayLike = 0.0,
    ) -> FloatArray:
        """Force along the line of action: above 0 on the drive flank, below 0 on the back flank.

        Parameters
        ----------
        compression_m, compression_rate_mps : array
            δ = 0 in the middle of the gap, and δ̇. Subtract a pair's own separation from δ first.
        half_backlash_m, half_backlash_rate_mps : array
            b, not below zero, and ḃ. Of a rough flank, b(t) = b₀ + Δb(t).

        Returns
        -------
        array
            In N, in the common shape of what was given.
        """
        delta, rate, b, b_rate = np.broadcast_arrays(
            *(np.asarray(x, dtype=np.float64) for x in (compression_m, compression_rate_mps)),
            _half_backlash(half_backlash_m),
            np.asarray(half_backlash_rate_mps, dtype=np.float64),
        )
        side = np.where(delta > b, 1.0, np.where(delta < -b, -1.0, 0.0))
        depth = np.maximum(np.abs(delta) - b, 0.0)
        ramp = self.damping_ramp_m
        gate = np.minimum(depth / ramp, 1.0) if ramp > 0 else np.ones_like(depth)
        k = np.where(side > 0, self.drive_stiffness_n_per_m, self.back_stiffness_n_per_m)
        pressed = k * depth + self.damping_n_s_per_m * gate * (side * rate - b_rate)
        force: FloatArray = side * np.maximum(pressed, 0.0)
        return force

    def energy_j(self, compression_m: ArrayLike, *, half_backlash_m: ArrayLike) -> FloatArray:
        """Energy in the spring, ½k d² on the drive flank and ½k'd² on the back flank; its slope over δ is the force."""
        delta = np.asarray(compression_m, dtype=np.float64)
        depth = dead_zone_m(delta, half_backlash_m)
        k = np.where(delta > 0, self.drive_stiffness_n_per_m, self.back_stiffness_n_per_m)
        energy: FloatArray = 0.5 * k * depth**2
        return energy


def dead_zone_m(compression_m: ArrayLike, half_backlash_m: ArrayLike) -> FloatArray:
    """Depth with sign: δ - b beyond b, δ + b beyond -b, 0 between."""
    delta = np.asarray(compression_m, dtype=np.float64)
    b = _half_backlash(half_backlash_m)
    depth: FloatArray = np.maximum(delta - b, 0.0) + np.minimum(delta + b, 0.0)
    return depth


def _half_backlash(value: ArrayLike) -> FloatArray:
    b: FloatArray = np.asarray(value, dtype=np.float64)
    if not (np.isfinite(b).all() and (b >= 0.0).all()):
        raise InputError(
            f"half_backlash_m falls to {float(np.nanmin(b)):g} m",
            allowed="finite, >= 0 m",
            remedy="the roughness is greater than the backlash: raise the backlash or lower the roughness",
        )
    return b


# --------------------
# Compiled contact of one tooth pair with backlash, for right-hand sides; see `sims.mesh`.
# --------------------


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
