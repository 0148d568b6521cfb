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
