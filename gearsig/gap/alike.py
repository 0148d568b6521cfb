"""What changed about each mesh harmonic: the harmonic itself, what either gear repeats beside it, what nothing repeats.

A path to a sensor changes all three alike. Flanks that wear alike change the harmonic and leave the rest; friction
takes along what is beside it; rough flanks raise what a gear repeats and the noise, and leave the harmonic; teeth that
part raise the noise. So each stretch of orders from half a tooth below a harmonic to half a tooth above is compared
with what it was when the gears were sound.

Source of the separation into what is common to all teeth, to one gear, and to nothing: R. B. Randall,
*Vibration-based Condition Monitoring*, 2nd ed., 2021, chapter 5.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

import numpy as np

from gearsig.checks import FloatArray
from gearsig.gap.frame import DRIVEN, DRIVER
from gearsig.gap.gathered import ChannelSums, Gathered
from gearsig.gap.gear_lines import N_MESH_HARMONICS, Feature, average_lines, visible_orders

ALIKE = "alike."
"""Of these features; 0 where nothing that they compare stands clear of noise."""

MESH, REPEATED, NOISE = range(3)
_PARTS = ("mesh", "repeated", "noise")
_PAIRS = ((MESH, REPEATED), (REPEATED, NOISE), (MESH, NOISE))

CLEAR = (4.0, 0.5)
"""Power of a harmonic over the noise on its line, and of all repeated lines over the noise on them, to be compared."""

MOST_DB = 30.0
LEAST_POWER = 1.0
"""dB²: changes as small as a decibel are alike by chance."""


def alike_features(now: Gathered, sound: Gathered) -> Iterator[Feature]:
    """Yield medians, spreads and differences of the three parts' changes, in dB, over stretches and channels."""
    changes = stretch_changes(now, sound)
    for part, name in enumerate(_PARTS):
        level = changes[..., part]
        yield f"{ALIKE}{name}", _median(level)
        yield f"{ALIKE}{name}.spread", _rms(level - _median(level))
        yield f"{ALIKE}{name}.rise", _rise(level)
    for first, second in _PAIRS:
        name = f"{ALIKE}{_PARTS[first]}_{_PARTS[second]}"
        a, b = changes[..., first], changes[..., second]
        yield f"{name}.less", _median(a - b)
        yield f"{name}.apart", _rms(a - b)
        yield f"{name}.together", _together(a, b)


def stretch_changes(now: Gathered, sound: Gathered) -> FloatArray:
    """Return the changes in dB, (n_channels, n_harmonics, 3); nan where a part does not stand clear of noise."""
    rows = []
    for name, sums in now.channels.items():
        here, before = _stretches(now, sums), _stretches(sound, sound.channels[name])
        rows.append(np.clip(here - before, -MOST_DB, MOST_DB))
    changes: FloatArray = np.array(rows)
    return changes


def _stretches(gathered: Gathered, sums: ChannelSums) -> FloatArray:
    """Return the levels of the three parts of each stretch, (n_harmonics, 3), in dB."""
    power = np.zeros((N_MESH_HARMONICS, 3))
    floor = np.zeros((N_MESH_HARMONICS, 2))
    for side in (DRIVER, DRIVEN):
        lines, noise = average_lines(sums, side)
        square, teeth = np.abs(lines) ** 2, gathered.frame.teeth[side]
        highest = visible_orders(gathered, side, len(square))
        for k in range(1, N_MESH_HARMONICS + 1):
            low, high = round((k - 0.5) * teeth) + 1, round((k + 0.5) * teeth)
            if high > highest:
                power[k - 1] = np.nan
                continue
            own = np.arange(low, high) != k * teeth
            beside, under = square[low:high][own], noise[low:high][own]
            power[k - 1, REPEATED] += max(float(np.sum(beside - under)), 0.0)
            floor[k - 1, 1] += float(under.sum())
            if side == DRIVER:
                power[k - 1, MESH], floor[k - 1, 0] = max(square[k * teeth] - noise[k * teeth], 0.0), noise[k * teeth]
                power[k - 1, NOISE] = float(under.sum()) * float(sums.counts[side].sum())
    seen = np.column_stack([power[:, :2] > np.array(CLEAR) * floor, power[:, NOISE] > 0.0])
    levels: FloatArray = 10.0 * np.log10(np.where(seen, power, np.nan))
    return levels


def _seen(values: FloatArray) -> FloatArray:
    found: FloatArray = values[np.isfinite(values)]
    return found


def _median(values: FloatArray) -> float:
    seen = _seen(values)
    return float(np.median(seen)) if len(seen) else 0.0


def _rms(values: FloatArray) -> float:
    seen = _seen(values)
    return float(np.sqrt(np.mean(seen**2))) if len(seen) else 0.0


def _rise(values: FloatArray) -> float:
    """Return the mean step from one harmonic to the next."""
    steps = [values[:, b] - values[:, a] for a, b in pairwise(range(values.shape[1]))]
    seen = _seen(np.array(steps))
    return float(seen.mean()) if len(seen) else 0.0


def _together(a: FloatArray, b: FloatArray) -> float:
    """Return 10 (2 Σ ab)/(Σ a² + Σ b² + n): 10 where both changed alike and much, −10 where in opposite directions."""
    both = np.isfinite(a) & np.isfinite(b)
    x, y = a[both], b[both]
    return float(20.0 * np.sum(x * y) / (np.sum(x**2 + y**2) + LEAST_POWER * max(len(x), 1)))
