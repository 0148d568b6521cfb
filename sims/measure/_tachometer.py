"""A tachometer: pulses at equal steps of a shaft's angle, as a voltage."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gearsig.checks import FloatArray, count, not_negative, positive, within
from gearsig.errors import InputError


@dataclass(frozen=True)
class Tachometer:
    """A pulse channel; the middle of each rising edge lies at shaft angle (k + offset)/n.

    Parameters
    ----------
    shaft : str
        Empty: the reference shaft.
    pulses_per_revolution : int
    channel : str
    low_v, high_v : float
    duty : float
        Pulse width over pulse period, in angle; 0.01 to 0.99.
    edge_s : float
        Duration of an edge; linear.
    jitter_s : float
        Standard deviation of each rising edge's time.
    first_pulse_rev : float
        Shaft angle of a rising edge, 0 to 1.
    noise_v : float
        Standard deviation of the voltage noise.
    """

    shaft: str = ""
    pulses_per_revolution: int = 1
    channel: str = "tacho"
    low_v: float = 0.0
    high_v: float = 5.0
    duty: float = 0.1
    edge_s: float = 2e-4
    jitter_s: float = 0.0
    first_pulse_rev: float = 0.0
    noise_v: float = 0.0

    def __post_init__(self) -> None:
        count(self.pulses_per_revolution, "pulses_per_revolution of the tachometer")
        within(self.duty, "duty of the tachometer", 0.01, 0.99)
        positive(self.edge_s, "edge_s of the tachometer", "s")
        not_negative(self.jitter_s, "jitter_s of the tachometer", "s")
        not_negative(self.noise_v, "noise_v of the tachometer", "V")
        within(self.first_pulse_rev, "first_pulse_rev of the tachometer", 0.0, 1.0, "rev")


def pulse_voltage(tacho: Tachometer, rising_s: FloatArray, falling_s: FloatArray, time_s: FloatArray) -> FloatArray:
    """Voltage at `time_s`: a trapezoid per pulse, half way up at its edge times."""
    up = np.zeros(np.shape(time_s))
    for edges, sign in ((rising_s, 1.0), (falling_s, -1.0)):
        if len(edges):
            if len(edges) > 1 and np.diff(np.sort(edges)).min() <= tacho.edge_s:
                raise InputError(
                    f"pulses follow each other faster than an edge takes, {tacho.edge_s:g} s",
                    where="tachometer",
                    remedy="lower edge_s or jitter_s",
                )
            knots = (np.sort(edges)[:, None] + np.array([-0.5, 0.5]) * tacho.edge_s).ravel()
            steps = (np.arange(len(edges))[:, None] + np.array([0.0, 1.0])).ravel()
            up += sign * np.interp(time_s, knots, steps)
    return tacho.low_v + (tacho.high_v - tacho.low_v) * up


# Angle channels beside the voltage of a tachometer: pulses timed by a counter, and an encoder.


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
    noise_deg : float
        Standard deviation of each reading's error ahead of the counting.
    """

    channel: str = "encoder"
    shaft: str = ""
    counts_per_revolution: int = 4096
    wraps: bool = True
    runout_deg: float = 0.0
    noise_deg: float = 0.0

    def __post_init__(self) -> None:
        count(self.counts_per_revolution, "counts_per_revolution of the encoder", minimum=4)
        within(self.runout_deg, "runout_deg of the encoder", -10.0, 10.0, "deg")
        not_negative(self.noise_deg, "noise_deg of the encoder", "deg")

    def read_deg(self, angle_rad: FloatArray, rng: np.random.Generator | None = None) -> FloatArray:
        """Reading at the given shaft angles; without `rng` free of noise."""
        read_rev = angle_rad / (2 * np.pi) + self.runout_deg / 360.0 * np.sin(angle_rad)
        if rng is not None and self.noise_deg:
            read_rev = read_rev + self.noise_deg / 360.0 * rng.standard_normal(np.shape(angle_rad))
        counts = np.floor(read_rev * self.counts_per_revolution)
        if self.wraps:
            counts = np.mod(counts, self.counts_per_revolution)
        reading: FloatArray = counts * (360.0 / self.counts_per_revolution)
        return reading


# Where a simulated shaft passes the edges of a pulse disc.


def disc_edges(
    revolutions: FloatArray, time_s: FloatArray, pulses_per_revolution: int, duty: float, first_pulse_rev: float
) -> tuple[FloatArray, FloatArray, bool]:
    """Times at which the pulse rises and falls, and whether it is high at the start.

    A window opens at angles (k + offset) and closes `duty` of a pulse period later; turning back, its end opens it.
    Times are interpolated between steps: wrong by at most (acceleration/speed)·Δ²/8.

    Parameters
    ----------
    revolutions, time_s : arrays, (n_steps,)
    pulses_per_revolution : int
    duty : float
    first_pulse_rev : float

    Raises
    ------
    InputError
        If the shaft turns by half a pulse period or more within a step.
    """
    periods = (revolutions - first_pulse_rev) * pulses_per_revolution
    if len(periods) > 1 and np.abs(np.diff(periods)).max() >= 0.5 * min(duty, 1 - duty):
        raise InputError(
            f"the shaft turns by {np.abs(np.diff(periods)).max():.2g} pulse periods within a step",
            where="tachometer",
            allowed=f"below {0.5 * min(duty, 1 - duty):g}: half the shorter part of a pulse",
            remedy="fewer pulses per revolution or a finer step",
        )
    opens, opens_back = _crossings(periods, time_s)
    closes, closes_back = _crossings(periods - duty, time_s)
    high = bool(periods[0] % 1.0 < duty)
    return np.sort(np.concatenate([opens, closes_back])), np.sort(np.concatenate([closes, opens_back])), high


def _crossings(periods: FloatArray, time_s: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Times of passing whole numbers, forwards and backwards."""
    whole = np.floor(periods)
    step = np.diff(whole)
    crossings = []
    for direction in (1.0, -1.0):
        i = np.flatnonzero(step == direction)
        target = whole[i + 1] if direction > 0 else whole[i]
        part = (target - periods[i]) / (periods[i + 1] - periods[i])
        crossings.append(time_s[i] + part * (time_s[i + 1] - time_s[i]))
    return crossings[0], crossings[1]
