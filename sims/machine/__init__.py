"""What a geared drive is made of, for the simulators and the effects; see `sims.machine.machine`."""

from sims.machine.machine import Machine, bearing_index
from sims.machine.parts import (
    BearingSupport,
    Drive,
    Lubrication,
    RaceDefect,
    Roughness,
    ShaftLine,
    SpeedSwing,
    TorqueRipple,
    Wheel,
)

__all__ = [
    "BearingSupport",
    "Drive",
    "Lubrication",
    "Machine",
    "RaceDefect",
    "Roughness",
    "ShaftLine",
    "SpeedSwing",
    "TorqueRipple",
    "Wheel",
    "bearing_index",
]
