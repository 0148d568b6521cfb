"""What is fitted to a pair beyond its parameters: names of shafts, bearings, sensors, housing, tachometer."""

from __future__ import annotations

from dataclasses import dataclass
from math import isfinite

from gearsig.checks import count, one_of, positive, within
from gearsig.errors import InputError
from gearsig.rig.types import Bearing

N_BEARINGS = 4
DIRECTIONS = ("vertical", "horizontal")
MOST_SENSORS, MOST_MODES = 8, 32


@dataclass(frozen=True)
class SensorSeat:
    """An accelerometer over one of the four bearings.

    Parameters
    ----------
    channel : str
    bearing : int
        1 to 4: two of the driver's shaft, then two of the driven one's.
    direction : str
        "vertical" or "horizontal".
    position : str
        For the reader of the recording.
    """

    channel: str
    bearing: int
    direction: str = "vertical"
    position: str = ""

    def __post_init__(self) -> None:
        within(count(self.bearing, "bearing of a sensor"), "bearing of a sensor", 1, N_BEARINGS)
        one_of(self.direction, "direction of a sensor", DIRECTIONS)


@dataclass(frozen=True)
class HousingMode:
    """A mode of the housing between the bearings and the sensors.

    Parameters
    ----------
    frequency_hz, damping_ratio : float
        Of the vertical mode; the horizontal one lies lower.
    gain : float
        Static gain where the shape is 1.
    shape : tuple of four floats
        At bearings 1 to 4.
    """

    frequency_hz: float
    damping_ratio: float
    gain: float
    shape: tuple[float, float, float, float]

    def __post_init__(self) -> None:
        within(self.frequency_hz, "frequency_hz of a housing mode", 1.0, 1e5, "Hz")
        within(self.damping_ratio, "damping_ratio of a housing mode", 1e-3, 1.0)
        if len(self.shape) != N_BEARINGS or not all(isfinite(v) for v in (self.gain, *self.shape)):
            raise InputError(
                f"gain {self.gain}, shape {self.shape}", where="housing mode", allowed="finite, 4 bearings"
            )


@dataclass(frozen=True)
class Pickup:
    """The tachometer: its channel, and the side whose shaft carries its disc, 0 the driver."""

    channel: str = "tacho"
    side: int = 0
    pulses_per_revolution: int = 1

    def __post_init__(self) -> None:
        within(self.side, "side of the tachometer", 0, 1)
        within(count(self.pulses_per_revolution, "pulses_per_revolution"), "pulses_per_revolution", 1, 1024)


@dataclass(frozen=True)
class Installed:
    """What is fitted to one machine.

    Parameters
    ----------
    shafts : (str, str)
        Names of the driver's and the driven shaft.
    bearings : tuple of four Bearing
        With geometry: the first two on the driver's shaft.
    sensors : tuple of SensorSeat
    modes : tuple of HousingMode
    pickup : Pickup
    """

    shafts: tuple[str, str]
    bearings: tuple[Bearing, Bearing, Bearing, Bearing]
    sensors: tuple[SensorSeat, ...]
    modes: tuple[HousingMode, ...] = ()
    pickup: Pickup = Pickup()

    def __post_init__(self) -> None:
        if len(set(self.shafts)) != 2 or not all(self.shafts):
            raise InputError(f"shafts {self.shafts}", allowed="two different names")
        if len(self.bearings) != N_BEARINGS or len({b.name for b in self.bearings}) != N_BEARINGS:
            raise InputError(f"bearings {', '.join(b.name for b in self.bearings)}", allowed="four different names")
        if len(self.modes) > MOST_MODES or not 1 <= len(self.sensors) <= MOST_SENSORS:
            raise InputError(
                f"{len(self.sensors)} sensors and {len(self.modes)} housing modes",
                allowed=f"1 to {MOST_SENSORS} sensors, at most {MOST_MODES} modes",
            )
        channels = [*(s.channel for s in self.sensors), self.pickup.channel]
        if len(set(channels)) != len(channels) or not all(channels):
            raise InputError(f"channels {', '.join(channels)}", allowed="names, each once")
        for number, bearing in enumerate(self.bearings):
            if bearing.shaft != self.shafts[number // 2]:
                raise InputError(
                    f"bearing {bearing.name!r} is on shaft {bearing.shaft!r}", allowed=f"{self.shafts[number // 2]!r}"
                )
            positive(bearing.n_rolling_elements or 0, f"n_rolling_elements of bearing {bearing.name!r}")
