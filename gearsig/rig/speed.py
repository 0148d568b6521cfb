"""Where shaft speed and angle come from."""

from __future__ import annotations

from dataclasses import dataclass

from gearsig.checks import FloatArray, count, frozen_array, not_negative, positive


@dataclass(frozen=True)
class ConstantSpeed:
    """The speed is stated and constant."""

    speed_rpm: float
    shaft: str = ""

    def __post_init__(self) -> None:
        not_negative(self.speed_rpm, "speed_rpm", "rpm")


@dataclass(frozen=True)
class PulseTimes:
    """Times of tachometer pulses, on the recording's own time axis.

    Parameters
    ----------
    times_s : array, (n_pulses,)
        Checked where they are turned into speed, so that a bad train is reported with its pulses.
    pulses_per_revolution : int
    """

    times_s: FloatArray
    pulses_per_revolution: int = 1
    shaft: str = ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "times_s", frozen_array(self.times_s, "tachometer pulse times", ndim=1))
        count(self.pulses_per_revolution, "pulses_per_revolution")


@dataclass(frozen=True)
class TachometerChannel:
    """A channel with tachometer pulses.

    Parameters
    ----------
    channel : str
    pulses_per_revolution : int
    threshold : float or None
        In the channel's unit; None: half way between the low and the high level.
    hysteresis : float or None
        Full width in the channel's unit; None: a quarter of the step from low to high.
    edge : str
        "rising" or "falling".
    """

    channel: str
    pulses_per_revolution: int = 1
    threshold: float | None = None
    hysteresis: float | None = None
    edge: str = "rising"
    shaft: str = ""

    def __post_init__(self) -> None:
        count(self.pulses_per_revolution, "pulses_per_revolution")


@dataclass(frozen=True)
class EncoderChannel:
    """A channel with the shaft angle, wrapping or running on.

    Parameters
    ----------
    channel : str
    units_per_revolution : float
        360 for degrees, 2π for radians, 1 for revolutions, the line count for counts.
    wraps : bool
        Whether the angle starts again after each revolution.
    """

    channel: str
    units_per_revolution: float = 360.0
    wraps: bool = True
    shaft: str = ""

    def __post_init__(self) -> None:
        positive(self.units_per_revolution, "units_per_revolution")


@dataclass(frozen=True)
class SpeedChannel:
    """A channel with the speed, in rpm after multiplying by `rpm_per_unit`."""

    channel: str
    rpm_per_unit: float = 1.0
    shaft: str = ""

    def __post_init__(self) -> None:
        positive(self.rpm_per_unit, "rpm_per_unit")


SpeedSource = ConstantSpeed | PulseTimes | TachometerChannel | EncoderChannel | SpeedChannel
"""Any of the ways to know the speed; None stands for none."""
