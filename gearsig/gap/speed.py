"""What the speed does besides standing still: figures of the shaft angle."""

from __future__ import annotations

import numpy as np

from gearsig.angle.types import ShaftAngle

SPEED_FIGURES = ("drift", "swing", "swing_line", "swing_frequency_hz")
"""Relative linear change; relative rms about it; ratio of its strongest line to the others; that line's frequency."""


def speed_figures(angle: ShaftAngle) -> tuple[float, ...]:
    """Return `SPEED_FIGURES` of a shaft's speed, taken once per revolution.

    Faster changes belong to the shaft's orders and are left to the vibration.
    """
    n = int(angle.n_revolutions)
    time = np.linspace(angle.start_s, angle.end_s, 8 * n + 1)
    revolutions = angle.revolutions_at(time)
    whole = np.interp(np.arange(np.ceil(revolutions[0]), np.floor(revolutions[-1]) + 1), revolutions, time)
    speed = 1.0 / np.diff(whole)
    middle = 0.5 * (whole[1:] + whole[:-1])
    slope, level = np.polyfit(middle - middle.mean(), speed, 1)
    rest = (speed - level - slope * (middle - middle.mean())) / level
    window = np.hanning(len(rest) + 2)[1:-1]
    power = np.abs(np.fft.rfft(rest * window, 4 * len(rest)))[1:] ** 2
    strongest = int(np.argmax(power))
    typical = float(np.median(power)) / np.log(2.0)
    return (
        float(slope * (middle[-1] - middle[0]) / level),
        float(np.std(rest)),
        float(power[strongest] / max(typical, 1e-30)),
        float((strongest + 1) / (4 * len(rest)) * level),
    )
