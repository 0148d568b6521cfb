"""Mains hum: pick-up from the electric supply."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gearsig.checks import FloatArray, positive


@dataclass(frozen=True)
class MainsHum:
    """Pick-up from the electric supply: a fixed frequency, whatever the shaft does.

    Parameters
    ----------
    amplitudes_mps2 : tuple of float
        Peak amplitude of harmonics 1, 2, … as the sensor reads them.
    frequency_hz : float
    phase_rad : float
    """

    amplitudes_mps2: tuple[float, ...] = ()
    frequency_hz: float = 50.0
    phase_rad: float = 0.0

    def __post_init__(self) -> None:
        positive(self.frequency_hz, "frequency_hz of the mains", "Hz")

    def values(self, time_s: FloatArray) -> FloatArray:
        """Σ_h A_h cos(h (2πft + φ)), (n_samples,)."""
        total = np.zeros(np.shape(time_s))
        for h, amplitude in enumerate(self.amplitudes_mps2, start=1):
            total += amplitude * np.cos(h * (2 * np.pi * self.frequency_hz * np.asarray(time_s) + self.phase_rad))
        return total
