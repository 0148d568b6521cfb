"""Lines of the electric supply, at their frequency whatever the speed."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gearsig.checks import FloatArray
from gearsig.gap.frame import GearFrame
from gearsig.recording.types import Recording

SUPPLIES_HZ = (50.0, 60.0)
N_HARMONICS = 3
_TOLERANCE = 0.002  # how far a supply's frequency wanders
_NEIGHBOURHOOD_HZ = 8.0
_N_SHAFT_HARMONICS = 8
_APART = 20.0
"""Widths between a shaft's orders from which they can be told from the supply in four places of five."""


def mains_lines(recording: Recording, names: Sequence[str], speed_hz: float, frame: GearFrame) -> tuple[float, ...]:
    """Return, for each supply, the mean excess in dB of its harmonics over the neighbourhood, on the best channel.

    Harmonics that fall on a line of the gears are left out; 0 where none is left.
    """
    return tuple(
        max(_excess(recording.values(name), recording, supply, speed_hz, frame) for name in names)
        for supply in SUPPLIES_HZ
    )


def _excess(values: FloatArray, recording: Recording, supply_hz: float, speed_hz: float, frame: GearFrame) -> float:
    n = len(values)
    x = np.asarray(values, dtype=np.float64)
    power = np.abs(np.fft.rfft((x - x.mean()) * np.hanning(n))) ** 2
    step = recording.sampling_rate_hz / n
    found = []
    for k in range(1, N_HARMONICS + 1):
        frequency = k * supply_hz
        width = max(2.0 * step, _TOLERANCE * frequency)
        if frequency + _NEIGHBOURHOOD_HZ > recording.sampling_rate_hz / 2 or _on_a_gear_line(
            frequency, width, speed_hz, frame
        ):
            continue
        positions = np.arange(len(power)) * step
        line = np.abs(positions - frequency) <= width
        around = (np.abs(positions - frequency) <= _NEIGHBOURHOOD_HZ) & (np.abs(positions - frequency) > 2.0 * width)
        found.append(10.0 * np.log10(power[line].max() / max(float(np.median(power[around])), 1e-300)))
    return float(np.mean(found)) if found else 0.0


def _on_a_gear_line(frequency_hz: float, width_hz: float, speed_hz: float, frame: GearFrame) -> bool:
    """Whether a frequency falls on a mesh harmonic or a shaft's order.

    Of a slow shaft only the first orders count, which are strong: all of them lie everywhere.
    """
    shafts_hz = [order * speed_hz for order in frame.shaft_orders]
    told = [hz for hz in shafts_hz if hz >= _APART * width_hz or round(frequency_hz / hz) <= _N_SHAFT_HARMONICS]
    return any(_to_a_multiple(frequency_hz, hz) < 2.0 * width_hz for hz in (frame.teeth[0] * speed_hz, *told))


def _to_a_multiple(frequency_hz: float, of_hz: float) -> float:
    """Return the distance to the nearest multiple, from 1 on."""
    return abs(max(round(frequency_hz / of_hz), 1) * of_hz - frequency_hz)
