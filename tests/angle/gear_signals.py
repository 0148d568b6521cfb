"""Closed-form gear vibration for the tests of this room: mesh harmonics with sidebands over a given course of angle."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gearsig.checks import FloatArray
from gearsig.recording import Channel, Recording
from gearsig.rig import GearPair, OperatingPoint, Rig, Shaft


@dataclass(frozen=True)
class Motion:
    """Speed in rev/s: start + ramp·t, times (1 + depth·sin(2π·rate·t))."""

    start: float
    ramp: float = 0.0
    depth: float = 0.0
    rate: float = 0.5

    def revolutions(self, t: FloatArray) -> FloatArray:
        w = 2 * np.pi * self.rate
        # ∫ (a + b t)(1 + d sin wt) dt in closed form.
        steady = self.start * t + 0.5 * self.ramp * t**2
        wander = -self.start * np.cos(w * t) / w + self.ramp * (np.sin(w * t) / w**2 - t * np.cos(w * t) / w)
        return steady + self.depth * (wander + self.start / w)

    def speed(self, t: FloatArray) -> FloatArray:
        return (self.start + self.ramp * t) * (1 + self.depth * np.sin(2 * np.pi * self.rate * t))


def rig_of(*teeth: tuple[int, int | None], nominal_rpm: float | None = None, tolerance: float = 5.0) -> Rig:
    """Return a rig of pairs in a row, shaft names s0, s1, …"""
    shafts = tuple(Shaft(f"s{i}") for i in range(len(teeth) + 1))
    pairs = tuple(GearPair(f"p{i}", f"s{i}", f"s{i + 1}", a, b) for i, (a, b) in enumerate(teeth))
    return Rig(shafts=shafts, pairs=pairs, operating_point=OperatingPoint("s0", nominal_rpm, tolerance))


def gear_recording(
    motion: Motion,
    teeth: tuple[tuple[int, int], ...],
    rng: np.random.Generator,
    *,
    duration_s: float = 8.0,
    rate_hz: float = 12_800.0,
    noise: float = 1.0,
    harmonics: tuple[float, ...] = (1.0, 0.6, 0.4, 0.2),
    modulation: float = 0.3,
    n_channels: int = 2,
) -> Recording:
    """Return mesh harmonics, each amplitude-modulated once per turn of both gears, shaft harmonics, and white noise.

    `noise` is its standard deviation where the strongest mesh harmonic has amplitude 1; phases and gains differ by
    channel.
    """
    t = np.arange(round(duration_s * rate_hz)) / rate_hz
    angle = 2 * np.pi * motion.revolutions(t)
    rows = [_channel(angle, motion.speed(t), teeth, rng, harmonics, modulation, rate_hz) for _ in range(n_channels)]
    samples = np.array(rows) + noise * rng.normal(size=(n_channels, len(t)))
    return Recording(samples, rate_hz, tuple(Channel(f"a{i}", "acceleration", "m/s^2") for i in range(n_channels)))


def _channel(
    angle: FloatArray,
    speed: FloatArray,
    teeth: tuple[tuple[int, int], ...],
    rng: np.random.Generator,
    harmonics: tuple[float, ...],
    modulation: float,
    rate_hz: float,
) -> FloatArray:
    x = np.zeros_like(angle)
    ratio = 1.0
    for z1, z2 in teeth:
        driver, driven = ratio, ratio * z1 / z2
        envelope = (1 + modulation * np.cos(driver * angle + rng.uniform(0, 6.28))) * (
            1 + 0.7 * modulation * np.cos(driven * angle + rng.uniform(0, 6.28))
        )
        for k, amplitude in enumerate(harmonics, 1):
            inside = k * z1 * driver * speed < 0.45 * rate_hz  # what the recorder's filter would let through
            x += (
                inside
                * amplitude
                * rng.uniform(0.5, 1.0)
                * envelope
                * np.cos(k * z1 * driver * angle + rng.uniform(0, 6.28))
            )
        x += 0.5 * modulation * np.cos(driver * angle + rng.uniform(0, 6.28))
        ratio = driven
    return x
