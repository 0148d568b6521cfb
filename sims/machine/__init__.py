"""What a geared drive is made of, for the simulators and the effects; see `sims.machine`."""

from sims.machine._machine import (
    MOST_DRY_FRICTION,
    RECOVERY_S,
    BearingSupport,
    Drive,
    Lubrication,
    Machine,
    RaceDefect,
    Roughness,
    ShaftLine,
    SpeedSwing,
    TorqueRipple,
    Wheel,
    bearing_index,
)
from sims.machine._operation import Operation, Profile, course_value, set_speed

__all__ = [
    "MOST_DRY_FRICTION",
    "RECOVERY_S",
    "BearingSupport",
    "Drive",
    "Lubrication",
    "Machine",
    "Operation",
    "Profile",
    "RaceDefect",
    "Roughness",
    "ShaftLine",
    "SpeedSwing",
    "TorqueRipple",
    "Wheel",
    "bearing_index",
    "course_value",
    "set_speed",
]
