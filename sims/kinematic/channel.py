"""What a sensor adds: its path, coloured noise and mains hum."""

from __future__ import annotations

from dataclasses import dataclass, field

from sims.kinematic.path import TransferPath
from sims.measure.hum import MainsHum
from sims.measure.noise import ColouredNoise


@dataclass(frozen=True)
class SensorChannel:
    """One accelerometer: value = path applied to the machine's vibration + hum + noise.

    Parameters
    ----------
    name : str
    path : TransferPath
    noise : ColouredNoise
    hum : MainsHum
    position : str
    """

    name: str = "a1"
    path: TransferPath = field(default_factory=TransferPath)
    noise: ColouredNoise = field(default_factory=ColouredNoise)
    hum: MainsHum = field(default_factory=MainsHum)
    position: str = ""
