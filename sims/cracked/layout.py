"""Numbers of the sixteen coordinates and of the signals that a run can give."""

from __future__ import annotations

from sims.gear_pair.measurement import COORDINATES

__all__ = ["COORDINATES", "N_COORDINATES", "SIGNALS"]

N_COORDINATES = len(COORDINATES)

SIGNALS = (
    *COORDINATES,
    *(f"{name} velocity" for name in COORDINATES),
    *(f"{name} acceleration" for name in COORDINATES),
    "transmission_error_m",
    "compression_m",
    "mesh_force_n",
    "friction_n",
    "backlash_change_m",
)
"""What a run can give, by the place in the kernel's row.

transmission_error_m: r_b1 θ1 − r_b2 θ2. compression_m: that plus what the gears' centres add. mesh_force_n: sum of the
tooth pairs' normal forces, below 0 on the back flank. friction_n: sum of the friction forces. backlash_change_m: Δb
of a roughness locked to time.
"""
