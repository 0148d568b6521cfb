"""Derivatives of sampled motion by Savitzky–Golay filters of stated bandwidth."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gearsig.checks import FloatArray, count, positive
from gearsig.errors import InputError

ORDER = 3
SHORTEST = 7
"""Samples of the shortest window: cubic through seven."""


@dataclass(frozen=True)
class LocalPolynomial:
    """A cubic fitted to a sliding window; value and derivatives at its middle.

    Parameters
    ----------
    window : int
        Odd number of samples, 5 or more.
    sampling_rate_hz : float

    Notes
    -----
    Its smoothing is flat to the third power of frequency, its derivatives to the same order; what lies beyond the
    bandwidth is lost, an impact shorter than the window is smeared over it.

    Source: A. Savitzky, M. J. E. Golay, Smoothing and differentiation of data by simplified least squares procedures,
    Analytical Chemistry 36 (1964); R. W. Schafer, What is a Savitzky–Golay filter?, IEEE Signal Processing Magazine 28
    (2011).
    """

    window: int
    sampling_rate_hz: float

    def __post_init__(self) -> None:
        count(self.window, "window", minimum=5)
        if self.window % 2 == 0:
            raise InputError(f"window is {self.window}", allowed="an odd number of samples")
        positive(self.sampling_rate_hz, "sampling_rate_hz", "Hz")

    @property
    def bandwidth_hz(self) -> float:
        """Frequency at which smoothing halves the power."""
        from scipy.signal import freqz, savgol_coeffs

        f, response = freqz(savgol_coeffs(self.window, ORDER), worN=8192, fs=self.sampling_rate_hz)
        gain = np.abs(response)
        below = int(np.argmax(gain < np.sqrt(0.5)))
        share = (gain[below - 1] - np.sqrt(0.5)) / (gain[below - 1] - gain[below])
        return float(f[below - 1] + share * (f[below] - f[below - 1]))

    @property
    def text(self) -> str:
        """For the reader of a result."""
        return f"Savitzky–Golay, cubic over {self.window} samples, −3 dB at {self.bandwidth_hz:.4g} Hz"

    def apply(self, values: FloatArray, derivative: int = 0) -> FloatArray:
        """Smoothed values, or their first or second derivative, (n,); the ends are those of the last window's cubic."""
        from scipy.signal import savgol_filter

        if len(values) < self.window:
            raise InputError(f"{len(values)} samples are too few", allowed=f"{self.window} or more")
        result: FloatArray = savgol_filter(
            values, self.window, ORDER, deriv=derivative, delta=1.0 / self.sampling_rate_hz, mode="interp"
        )
        return result


def local_polynomial(sampling_rate_hz: float, bandwidth_hz: float | None = None) -> LocalPolynomial:
    """Return the filter whose bandwidth is nearest below the wanted one; None: the shortest.

    Raises
    ------
    InputError
        If the bandwidth is above that of the shortest window.
    """
    shortest = LocalPolynomial(SHORTEST, sampling_rate_hz)
    if bandwidth_hz is None:
        return shortest
    positive(bandwidth_hz, "bandwidth_hz", "Hz")
    if bandwidth_hz > shortest.bandwidth_hz * 1.001:
        raise InputError(
            f"bandwidth_hz is {bandwidth_hz:g} Hz",
            allowed=f"up to {shortest.bandwidth_hz:.4g} Hz at {sampling_rate_hz:g} Hz sampling rate",
        )
    # The bandwidth falls as 1/window, nearly: a start, then step by step.
    window = int(SHORTEST * shortest.bandwidth_hz / bandwidth_hz) // 2 * 2 + 1
    window = max(window - 4, SHORTEST)
    while LocalPolynomial(window, sampling_rate_hz).bandwidth_hz > bandwidth_hz:
        window += 2
    return LocalPolynomial(window, sampling_rate_hz)
