"""Anti-alias filter and sampling: from the solver's grid to the recording's rate."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from math import ceil, floor

import numpy as np

from gearsig.checks import FloatArray, positive, within
from gearsig.errors import InputError

_LARGEST_TERM = 4096  # of the ratio of rates; beyond, the filter's table outgrows the signal


@dataclass(frozen=True)
class AntiAlias:
    """Linear-phase low-pass with its delay taken out, as converters with digital decimation have it.

    A sine below `passband_fraction` of the sampling rate keeps its amplitude within 10^(-A/20) and its phase; one
    above half the sampling rate is down by A or more.

    Parameters
    ----------
    attenuation_db : float
        A, 40 to 140.
    passband_fraction : float
        Pass-band edge over sampling rate, 0.2 to 0.48. Nearer to 0.5 is longer: see `reach_s`.
    """

    attenuation_db: float = 90.0
    passband_fraction: float = 0.4

    def __post_init__(self) -> None:
        within(self.attenuation_db, "attenuation_db of the anti-alias filter", 40.0, 140.0, "dB")
        within(self.passband_fraction, "passband_fraction of the anti-alias filter", 0.2, 0.48)

    @property
    def passband_error(self) -> float:
        """Largest relative error of a sine's amplitude in the pass band, 10^(-A/20)."""
        return float(10.0 ** (-self.attenuation_db / 20.0))

    def reach_s(self, sampling_rate_hz: float) -> float:
        """Time on each side of a sample that takes part in it: half the filter's length, by Kaiser's formula."""
        width_rad = 2 * np.pi * (0.5 - self.passband_fraction)
        return float((self.attenuation_db - 7.95) / (2 * 2.285 * width_rad) / sampling_rate_hz)

    def sample(
        self, signals: FloatArray, step_s: float, sampling_rate_hz: float, first: int, n_samples: int
    ) -> FloatArray:
        """Filter and sample, (n, n_steps) → (n, n_samples): samples at times (first + j)/rate of the solver's axis.

        Raises
        ------
        InputError
            If a sample would reach past the signals' ends, if the sampling rate is above the solver's, or if the two
            are not in the ratio of whole numbers up to 4096.
        """
        from scipy.signal import firwin, kaiser_beta, resample_poly

        up, down = ratio_of_rates(step_s, sampling_rate_hz)
        half = ceil(self.reach_s(sampling_rate_hz) / step_s * up)
        low, high = covered(signals.shape[1], step_s, sampling_rate_hz, half / up * step_s)
        if first < low or first + n_samples - 1 > high:
            raise InputError(
                f"samples {first} to {first + n_samples - 1} reach past the simulated time",
                where="anti-alias filter",
                allowed=f"{low} to {high}",
                remedy="simulate longer",
            )
        taps = firwin(
            2 * half + 1,
            0.5 * (self.passband_fraction + 0.5) * sampling_rate_hz,
            window=("kaiser", kaiser_beta(self.attenuation_db)),
            fs=up / step_s,
        )
        # Only the stretch that these samples need; it starts at a common point of both grids.
        start = max(0, floor((first * down / up - half / up) / down) * down)
        stop = min(signals.shape[1], ceil((first + n_samples) * down / up + half / up) + 1)
        skipped = start // down * up
        stretch = signals[:, start:stop]
        # The stubs know only named windows; an array of coefficients is documented.
        sampled: FloatArray = resample_poly(stretch, up, down, axis=1, window=taps)  # type: ignore[call-overload]
        return sampled[:, first - skipped : first - skipped + n_samples]


def ratio_of_rates(step_s: float, sampling_rate_hz: float) -> tuple[int, int]:
    """(up, down) with sampling rate · step = up/down in lowest terms."""
    positive(step_s, "step_s", "s")
    positive(sampling_rate_hz, "sampling_rate_hz", "Hz")
    product = sampling_rate_hz * step_s
    if product > 1.0:
        raise InputError(
            f"sampling_rate_hz is {sampling_rate_hz:g} Hz", allowed=f"at most the solver's rate, {1 / step_s:g} Hz"
        )
    ratio = Fraction(product).limit_denominator(_LARGEST_TERM)
    if abs(float(ratio) / product - 1.0) > 1e-12:
        raise InputError(
            f"a step of {step_s!r} s does not go into a sampling rate of {sampling_rate_hz:g} Hz",
            allowed=f"rates in the ratio of whole numbers up to {_LARGEST_TERM}",
            remedy=f"take {1 / (sampling_rate_hz * ceil(1 / product))!r} s",
        )
    return ratio.numerator, ratio.denominator


def covered(n_steps: int, step_s: float, sampling_rate_hz: float, reach_s: float) -> tuple[int, int]:
    """First and last sample, counted from the solver's start, whose filter lies within the signals."""
    tiny = 1e-9  # of a sample, against rounding of whole ratios
    first = ceil(reach_s * sampling_rate_hz - tiny)
    last = floor(((n_steps - 1) * step_s - reach_s) * sampling_rate_hz + tiny)
    return first, last
