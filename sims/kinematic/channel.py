"""What a sensor adds: its path, coloured noise and mains hum."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from gearsig.checks import FloatArray, not_negative, positive, within
from sims.kinematic.path import TransferPath


@dataclass(frozen=True)
class ColouredNoise:
    """Gaussian noise with a power density that goes as 1/f^slope.

    Parameters
    ----------
    rms_mps2 : float
        Standard deviation expected over the whole band.
    slope : float
        0: white, 1: pink, 2: red. Below 10 Hz the density stays level.
    """

    rms_mps2: float = 0.0
    slope: float = 0.0

    def __post_init__(self) -> None:
        not_negative(self.rms_mps2, "rms_mps2 of the noise", "m/s^2")
        within(self.slope, "slope of the noise", -2.0, 3.0)

    def draw(self, n_samples: int, sampling_rate_hz: float, rng: np.random.Generator) -> FloatArray:
        """Return noise of `n_samples` samples, (n_samples,)."""
        from scipy import fft

        white: FloatArray = rng.standard_normal(n_samples)
        if self.slope == 0.0:
            return self.rms_mps2 * white
        frequency = fft.rfftfreq(n_samples, 1 / sampling_rate_hz)
        shape = np.maximum(frequency, 10.0) ** (-self.slope / 2)
        weight = np.full(len(shape), 2.0)
        weight[0] = 1.0
        if n_samples % 2 == 0:
            weight[-1] = 1.0
        # Scaled by the expected power of the filtered noise, so that rms_mps2 is a property of the model and not forced
        # on each drawn sample.
        scale = self.rms_mps2 / np.sqrt(np.sum(weight * shape**2) / n_samples)
        coloured: FloatArray = scale * fft.irfft(fft.rfft(white) * shape, n_samples)
        return coloured


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


@dataclass(frozen=True)
class SensorChannel:
    """One accelerometer: value = path applied to the machine's vibration + hum + noise.

    Parameters
    ----------
    name : str
    path : TransferPath
    noise : ColouredNoise
    hum : MainsHum
    position : str
    """

    name: str = "a1"
    path: TransferPath = field(default_factory=TransferPath)
    noise: ColouredNoise = field(default_factory=ColouredNoise)
    hum: MainsHum = field(default_factory=MainsHum)
    position: str = ""
