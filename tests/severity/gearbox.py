"""Simulated recordings shared by the tests of crack severity: one gearbox, without noise, as its crack grows."""

from collections.abc import Callable
from functools import cache

from gearsig.recording import Recording
from sims import simulate

Record = Callable[..., Recording]
SPEED_RPM = 1500.0


@cache
def _record(depth_mm: float, gear: str, speed_rpm: float, duration_s: float, tooth: int) -> Recording:
    return simulate(
        "cracked",
        preset="workshop_29_47",
        parameters={
            "crack_depth_mm": depth_mm,
            "crack_gear": gear,
            "crack_tooth": tooth + 1,
            "noise_mps2": 0.0,
            "sensor_noise_mps2_per_sqrt_hz": 0.0,
        },
        speed_rpm=speed_rpm,
        duration_s=duration_s,
    )


def record_gearbox(
    depth_mm: float, *, gear: str = "driver", speed_rpm: float = SPEED_RPM, duration_s: float = 1.0, tooth: int = 11
) -> Recording:
    """Simulate the workshop gearbox; the same arguments give the same recording."""
    return _record(depth_mm, gear, speed_rpm, duration_s, tooth)
