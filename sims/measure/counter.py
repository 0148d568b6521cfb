"""Angle channels beside the voltage of a tachometer: pulses timed by a counter, and an encoder."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gearsig.checks import FloatArray, count, not_negative, positive, within


@dataclass(frozen=True)
class PulseCounter:
    """Pulses timed by a counter: times of rising edges, rounded down to the clock's ticks.

    Parameters
    ----------
    shaft : str
        Empty: the reference shaft.
    pulses_per_revolution : int
    clock_hz : float or None
        None: no rounding.
    jitter_s : float
        Standard deviation of an edge's time, ahead of the rounding.
    first_pulse_rev : float
        Shaft angle of an edge, 0 to 1.
    """

    shaft: str = ""
    pulses_per_revolution: int = 1
    clock_hz: float | None = None
    jitter_s: float = 0.0
    first_pulse_rev: float = 0.0

    def __post_init__(self) -> None:
        count(self.pulses_per_revolution, "pulses_per_revolution of the counter")
        if self.clock_hz is not None:
            positive(self.clock_hz, "clock_hz of the counter", "Hz")
        not_negative(self.jitter_s, "jitter_s of the counter", "s")
        within(self.first_pulse_rev, "first_pulse_rev of the counter", 0.0, 1.0, "rev")

    def stamp(self, rising_s: FloatArray, rng: np.random.Generator) -> FloatArray:
        """Time stamps of edges, ascending."""
        times = np.sort(rising_s + self.jitter_s * rng.standard_normal(len(rising_s)))
        if self.clock_hz is None:
            return times
        ticks: FloatArray = np.floor(times * self.clock_hz)
        return ticks / self.clock_hz


@dataclass(frozen=True)
class Encoder:
    """An angle channel in degrees: whole counts since the zero mark.

    Parameters
    ----------
    channel : str
    shaft : str
        Empty: the reference shaft.
    counts_per_revolution : int
        The reading stays up to one count behind the angle.
    wraps : bool
        Whether it starts again after each revolution.
    runout_deg : float
        Peak of a once-per-revolution error, from a disc that sits off centre.
    """

    channel: str = "encoder"
    shaft: str = ""
    counts_per_revolution: int = 4096
    wraps: bool = True
    runout_deg: float = 0.0

    def __post_init__(self) -> None:
        count(self.counts_per_revolution, "counts_per_revolution of the encoder", minimum=4)
        within(self.runout_deg, "runout_deg of the encoder", -10.0, 10.0, "deg")

    def read_deg(self, angle_rad: FloatArray) -> FloatArray:
        """Reading at the given shaft angles."""
        seen_rev = angle_rad / (2 * np.pi) + self.runout_deg / 360.0 * np.sin(angle_rad)
        counts = np.floor(seen_rev * self.counts_per_revolution)
        if self.wraps:
            counts = np.mod(counts, self.counts_per_revolution)
        reading: FloatArray = counts * (360.0 / self.counts_per_revolution)
        return reading
