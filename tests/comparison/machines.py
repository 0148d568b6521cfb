"""Records of one gear pair, made of known lines."""

from __future__ import annotations

import numpy as np

from gearsig.recording import Channel, Recording
from gearsig.rig import ConstantSpeed, GearPair, PulseTimes, Rig, Shaft, SpeedSource

TEETH = (23, 31)
RIG = Rig(name="pair", shafts=(Shaft("in"), Shaft("out")), pairs=(GearPair("p", "in", "out", *TEETH),))
LINES = {1: 0.3, 2: 0.1, 22: 0.4, 23: 2.0, 24: 0.5, 46: 1.0, 47: 0.2, 69: 0.6}
"""Peak amplitudes over orders of the input shaft."""
PHASES = {n: 0.7 * n**2 % 6.28 for n in LINES}


def gear_record(
    *,
    gain: float = 1.0,
    shift_rev: float = 0.0,
    noise: float = 0.05,
    seed: int = 0,
    duration_s: float = 6.0,
    rate_hz: float = 8000.0,
    speed_rpm: float = 1500.0,
    with_pulses: bool = True,
    lines: dict[int, float] | None = None,
    other_lines: dict[float, float] | None = None,
    out_lines: dict[int, float] | None = None,
    rig: Rig | None = RIG,
    channel: Channel = Channel("a1", "acceleration", "m/s^2"),  # noqa: B008 - frozen
) -> Recording:
    """Return a pair's vibration: x(θ) = gain Σ A cos(2π n (θ − shift) + φ_n) + noise."""
    time = np.arange(round(duration_s * rate_hz)) / rate_hz
    theta = speed_rpm / 60.0 * time
    x = np.zeros(len(time))
    for n, amplitude in (LINES if lines is None else lines).items():
        x += amplitude * np.cos(2 * np.pi * n * (theta - shift_rev) + PHASES.get(n, 0.3 * n))
    for order, amplitude in (other_lines or {}).items():
        x += amplitude * np.cos(2 * np.pi * order * theta)
    for n, amplitude in (out_lines or {}).items():
        x += amplitude * np.cos(2 * np.pi * n * theta * TEETH[0] / TEETH[1] + 0.4)
    x = gain * x + noise * np.random.default_rng(seed).standard_normal(len(time))
    speed: SpeedSource = ConstantSpeed(speed_rpm, "in" if rig else "")
    if with_pulses:
        n = int(theta[-1])
        speed = PulseTimes(np.arange(n + 1) * 60.0 / speed_rpm, 1, "in" if rig else "")
    return Recording(x[None, :], rate_hz, (channel,), speed=speed, rig=rig)
