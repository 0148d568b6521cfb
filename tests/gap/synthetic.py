"""A gear pair as a sum of sines, impulses and noise, of which every feature is known beforehand."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from gearsig.checks import FloatArray
from gearsig.recording import Channel, Recording
from gearsig.rig import Bearing, GearPair, PulseTimes, Rig, Shaft

RATE_HZ, DURATION_S, SPEED_HZ = 12800.0, 6.0, 23.7
TEETH = (23, 37)

RIG = Rig(
    name="sines",
    shafts=(Shaft("in"), Shaft("out")),
    pairs=(GearPair("stage", "in", "out", *TEETH, 2.0, 20.0, 20.0),),
    bearings=(Bearing("b1", "in", 9, 7.94, 39.04), Bearing("b2", "out", 8, 9.5, 46.0)),
)

MESH_AMPLITUDES = (4.0, 2.0, 1.0)


def healthy(revolutions: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Return three mesh harmonics with sidebands of one percent of either shaft, and noise."""
    ratio = TEETH[0] / TEETH[1]
    modulation = 1.0 + 0.02 * np.cos(2 * np.pi * revolutions) + 0.02 * np.cos(2 * np.pi * ratio * revolutions + 1.0)
    mesh = sum(a * np.cos(2 * np.pi * (k + 1) * TEETH[0] * revolutions + k) for k, a in enumerate(MESH_AMPLITUDES))
    return np.asarray(modulation * mesh + 0.1 * rng.standard_normal(len(revolutions)))


def record(
    added: Callable[[FloatArray, FloatArray], FloatArray] | None = None,
    *,
    seed: int = 0,
    swing: float = 0.0,
    swing_hz: float = 1.0,
) -> Recording:
    """Return a recording of two channels; `added` gets time, driver's revolutions."""
    rng = np.random.default_rng(seed)
    time = np.arange(round(RATE_HZ * DURATION_S)) / RATE_HZ

    def turned(t: FloatArray) -> FloatArray:
        wave = 2 * np.pi * swing_hz
        return np.asarray(SPEED_HZ * (t + swing / wave * (1.0 - np.cos(wave * t))))

    revolutions = turned(time)
    rows = [healthy(revolutions, rng) for _ in range(2)]
    if added is not None:
        rows = [row + added(time, revolutions) for row in rows]
    fine = np.linspace(0.0, DURATION_S, 200_001)
    pulses = np.interp(np.arange(0, np.floor(turned(fine)[-1]) + 1), turned(fine), fine)
    channels = tuple(Channel(name, "acceleration", "m/s^2") for name in ("a1", "a2"))
    return Recording(np.stack(rows), RATE_HZ, channels, speed=PulseTimes(pulses, 1, shaft="in"), rig=RIG)


def ringing(phase: FloatArray, frequency_hz: float = 3000.0, damping_ratio: float = 0.05) -> FloatArray:
    """Return the ring of a resonance struck whenever `phase` passes a whole number."""
    struck = np.flatnonzero(np.diff(np.floor(phase)) > 0)
    impulses = np.zeros(len(phase))
    impulses[struck] = 1.0
    t = np.arange(round(0.02 * RATE_HZ)) / RATE_HZ
    wave = np.exp(-2 * np.pi * frequency_hz * damping_ratio * t) * np.sin(2 * np.pi * frequency_hz * t)
    return np.asarray(np.convolve(impulses, wave)[: len(phase)])
