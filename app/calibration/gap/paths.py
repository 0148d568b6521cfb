"""Paths from the gears to a sensor that have changed: everything that comes through changes with them.

Mesh harmonics, sidebands, teeth and the noise of the machine go through the same path; what the sensor itself adds does
not. A fault of the flanks changes the mesh and leaves its neighbourhood. So a path is changed behind all that a machine
does, its tolerances included, and before the sensor's own noise.

Source: R. B. Randall, *Vibration-based Condition Monitoring*, 2nd ed., 2021, chapter 3 (separation of force and path).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from app.calibration.rigs import log_uniform
from gearsig.checks import FloatArray

LOWEST_HZ, HIGHEST_OF_RATE = 150.0, 0.45
DAMPING_RATIOS = (0.01, 0.2)
MOST_MODES = 3
PEAK, SHIFT, GAIN = 3.0, 0.3, 0.3
"""Logarithms: by how much a mode is louder or softer at its frequency, how far it moves, what all is multiplied by; at
the largest size, the latter two as standard deviations."""

ONE_CHANNEL_SHARE = 0.4
"""Changes that one sensor alone sees: it came loose; the others are of the housing."""


@dataclass(frozen=True)
class ModeChange:
    """A mode that is louder at its frequency by a factor, and moved from there.

    Parameters
    ----------
    frequency_hz, damping_ratio : float
    factor : float
        At its frequency.
    moved_hz : float
        Where it is now.
    """

    frequency_hz: float
    damping_ratio: float
    factor: float
    moved_hz: float

    def answer(self, frequency_hz: FloatArray) -> np.ndarray:
        """Return by what vibration of each frequency is multiplied, (f0² + 2jAζff0 − f²)/(f1² + 2jζff1 − f²)."""
        f, old, new, zeta = frequency_hz, self.frequency_hz, self.moved_hz, self.damping_ratio
        above = old**2 - f**2 + 2j * zeta * self.factor * f * old
        below = new**2 - f**2 + 2j * zeta * f * new
        found: np.ndarray = above / below * (new / old) ** 2
        return found


@dataclass(frozen=True)
class PathChange:
    """What one channel's path is multiplied by."""

    gain: float = 1.0
    modes: tuple[ModeChange, ...] = ()

    def of(self, values: FloatArray, rate_hz: float) -> FloatArray:
        """Return a vibration as it comes through the changed path."""
        frequency = np.fft.rfftfreq(len(values), 1.0 / rate_hz)
        answer = np.full(len(frequency), self.gain, dtype=np.complex128)
        for mode in self.modes:
            answer *= mode.answer(frequency)
        found: FloatArray = np.fft.irfft(np.fft.rfft(values) * answer, len(values))
        return found


def size_of(strength: float) -> float:
    """Return the size, 0.16 to 1, of a change of a strength from 0 to 1: as many per decade."""
    size: float = 10.0 ** (0.8 * (strength - 1.0))
    return size


def draw_path_changes(
    n_channels: int, size: float, rate_hz: float, rng: np.random.Generator, *, everywhere: bool = False
) -> Sequence[PathChange]:
    """Draw each channel's change, of size 0 to 1; modes of a housing are the same for all, their shares are not.

    Unless it is everywhere, one channel alone may change.
    """
    places = [
        (log_uniform(rng, LOWEST_HZ, HIGHEST_OF_RATE * rate_hz), log_uniform(rng, *DAMPING_RATIOS))
        for _ in range(int(rng.integers(1, MOST_MODES + 1)))
    ]
    shifts = np.exp(SHIFT * size * rng.standard_normal(len(places)))
    only = int(rng.integers(n_channels)) if not everywhere and rng.uniform() < ONE_CHANNEL_SHARE else None
    found = []
    for i in range(n_channels):
        modes = tuple(
            ModeChange(f, zeta, float(np.exp(PEAK * size * rng.uniform(-1.0, 1.0))), min(f * shift, 0.49 * rate_hz))
            for (f, zeta), shift in zip(places, shifts.tolist(), strict=True)
        )
        gain = float(np.exp(GAIN * size * rng.standard_normal()))
        found.append(PathChange() if only not in (None, i) else PathChange(gain, modes))
    return found
