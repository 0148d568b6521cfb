"""What the speed does besides standing still: figures of the shaft angle."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from gearsig.angle.types import ShaftAngle
from gearsig.checks import FloatArray

SPEED_FIGURES = ("drift", "swing", "swing_line", "swing_frequency_hz")
"""Relative linear change; relative rms about it; ratio of its strongest line to the others; that line's frequency."""

HIGHEST_SHAFT_ORDER = 2
"""Of each other shaft, that is taken out of the speed: a run-out shakes the speed at its shaft's orders."""


def speed_figures(angle: ShaftAngle, other_shafts: Sequence[float] = ()) -> tuple[float, ...]:
    """Return `SPEED_FIGURES` of a shaft's speed, taken once per revolution.

    Faster changes belong to the shaft's orders and are left to the vibration; so do those at other shafts' orders,
    which once a revolution look slower than they are.

    Parameters
    ----------
    angle : ShaftAngle
    other_shafts : sequence of float
        Their revolutions per revolution of this one.
    """
    n = int(angle.n_revolutions)
    time = np.linspace(angle.start_s, angle.end_s, 8 * n + 1)
    revolutions = angle.revolutions_at(time)
    whole = np.interp(np.arange(np.ceil(revolutions[0]), np.floor(revolutions[-1]) + 1), revolutions, time)
    speed = 1.0 / np.diff(whole)
    middle = 0.5 * (whole[1:] + whole[:-1])
    slope, level = np.polyfit(middle - middle.mean(), speed, 1)
    rest = (speed - level - slope * (middle - middle.mean())) / level
    rest = _without_cycles(rest, tuple(_cycles_per_revolution(other_shafts, len(rest))))
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


def _cycles_per_revolution(other_shafts: Sequence[float], n: int) -> Iterator[float]:
    """Yield the shafts' orders as they look once a revolution, 0 to 1/2; not those as slow as the record is long."""
    for ratio in other_shafts:
        for order in range(1, HIGHEST_SHAFT_ORDER + 1):
            cycles = abs(order * ratio - round(order * ratio))
            if cycles > 2.0 / n:
                yield cycles


def _without_cycles(rest: FloatArray, cycles: Sequence[float]) -> FloatArray:
    """Return a signal without the best-fitting sine at each of some frequencies, in cycles per sample."""
    if not cycles:
        return rest
    phase = 2.0 * np.pi * np.outer(np.arange(len(rest)), cycles)
    waves = np.hstack([np.cos(phase), np.sin(phase)])
    left: FloatArray = rest - waves @ np.linalg.lstsq(waves, rest, rcond=None)[0]
    return left
