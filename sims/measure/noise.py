"""Noise of a measurement chain: Gaussian, white or coloured."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gearsig.checks import FloatArray, not_negative, within


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
