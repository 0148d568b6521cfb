"""What lies between forces and sensors: modes of the machine, shared by all channels, and each channel's own part."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from app.calibration.rigs import log_uniform
from gearsig.checks import FloatArray

MESH, SHAFTS, BEARINGS, FRICTION, INSIDE = range(5)
"""Where a force or motion begins; the last is the machine's own noise."""
N_WAYS = 5

MODES = (4, 11)
MODE_HZ, MODE_DAMPING = (120.0, 9000.0), (0.008, 0.1)
BY_BODY = 0.3
"""Part of the machine that follows without a mode of its own, beside modes whose parts are of the size of 1."""
MOVED, LOUDER = 0.02, 0.15
"""By how much a changed mounting moves and changes a mode: standard deviations of logarithms."""
MOUNTING_FROM_HZ = 1200.0
"""Lower modes are the machine's own and do not depend on the mounting of a sensor."""


@dataclass(frozen=True)
class Structure:
    """Modes, with each way's part in what each channel sees.

    Parameters
    ----------
    frequency_hz, damping_ratio : arrays, (n_modes,)
    parts : array, (n_channels, N_WAYS, n_modes + 1)
        The last: what follows without a mode.
    """

    frequency_hz: FloatArray
    damping_ratio: FloatArray
    parts: FloatArray

    @classmethod
    def drawn(cls, n_channels: int, rng: np.random.Generator) -> Structure:
        """Draw one."""
        n = int(rng.integers(*MODES))
        frequency = np.sort([log_uniform(rng, *MODE_HZ) for _ in range(n)])
        damping = np.array([log_uniform(rng, *MODE_DAMPING) for _ in range(n)])
        parts = rng.standard_normal((n_channels, N_WAYS, n + 1))
        parts[..., -1] *= BY_BODY
        return cls(frequency, damping, parts)

    def mounted_anew(self, rng: np.random.Generator) -> Structure:
        """Return it as sensors see it that were taken off and put on again."""
        touched = self.frequency_hz > MOUNTING_FROM_HZ
        moved = np.exp(MOVED * rng.standard_normal(len(touched)) * touched)
        louder = np.exp(LOUDER * rng.standard_normal((len(self.parts), 1, len(touched))) * touched)
        parts = self.parts.copy()
        parts[..., :-1] *= louder
        return replace(self, frequency_hz=self.frequency_hz * moved, parts=parts)

    def softer(self, share: float, below_hz: float) -> Structure:
        """Return it with modes below a frequency at lower ones, by `share` at most."""
        lower = self.frequency_hz < below_hz
        return replace(self, frequency_hz=self.frequency_hz * np.where(lower, 1.0 - share, 1.0))

    def accelerations(self, channel: int, frequency_hz: FloatArray, way: int) -> np.ndarray:
        """Return what a unit motion becomes, Σ aᵣ ω²/(1 − (f/fᵣ)² + 2iζ f/fᵣ), for each frequency."""
        total = np.full(len(frequency_hz), self.parts[channel, way, -1], dtype=np.complex128)
        for f, zeta, part in zip(self.frequency_hz, self.damping_ratio, self.parts[channel, way], strict=False):
            ratio = frequency_hz / f
            total += part / (1.0 - ratio**2 + 2j * zeta * ratio)
        found: np.ndarray = total * -((2.0 * np.pi * frequency_hz) ** 2)
        return found
