"""A signal with its noise taken out by wavelet thresholds, and what was taken out."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from gearsig.checks import FloatArray, count, frozen_array, one_of, positive
from gearsig.errors import InputError

ThresholdName = Literal["universal", "sure", "bayes"]
RuleName = Literal["soft", "hard", "garrote"]
NoiseScope = Literal["finest level", "each level"]


@dataclass(frozen=True)
class DenoiseSettings:
    """How wavelet coefficients are thresholded.

    Parameters
    ----------
    threshold : str
        "universal": σ √(2 ln n), next to no noise is left; "sure": least estimated risk of each level, universal where
        the level is sparse; "bayes": σ²/σ_signal of each level, keeps most.
    rule : str
        "soft": kept coefficients d shrink by the threshold T; "hard": they stay; "garrote": d - T²/d, in between.
        "sure" and "bayes" are derived for "soft".
    wavelet : str
        An orthogonal or biorthogonal wavelet of PyWavelets; "sym8" is smooth and nearly symmetric. For biorthogonal
        wavelets the noise of the coefficients is only nearly what the thresholds assume.
    n_levels : int or None
        None: as many as leave eight filter lengths on the coarsest one, `deepest_level` at most.
    noise : str
        Where the noise's standard deviation is estimated: "finest level" (white noise), or "each level" by itself
        (coloured noise; steady tones that fill a level are then taken for noise).
    noise_rms : float or None
        The noise's standard deviation where it is known, in the signal's unit; white. None: estimated.
    n_shifts : int
        Cycle spinning: the mean over this many shifts of the signal against the wavelet grid. 1: none. More than
        2^n_levels shifts repeat.

    Raises
    ------
    InputError
        On a value out of range or a wavelet that has no discrete transform.
    """

    threshold: ThresholdName = "universal"
    rule: RuleName = "soft"
    wavelet: str = "sym8"
    n_levels: int | None = None
    noise: NoiseScope = "finest level"
    noise_rms: float | None = None
    n_shifts: int = 8

    def __post_init__(self) -> None:
        import pywt

        one_of(self.threshold, "threshold", get_args(ThresholdName))
        one_of(self.rule, "rule", get_args(RuleName))
        one_of(self.noise, "noise", get_args(NoiseScope))
        one_of(self.wavelet, "wavelet", pywt.wavelist(kind="discrete"))
        count(self.n_shifts, "n_shifts")
        if self.n_levels is not None:
            count(self.n_levels, "n_levels")
        if self.noise_rms is not None:
            positive(self.noise_rms, "noise_rms")
            if self.noise == "each level":
                raise InputError('noise_rms is given with noise "each level"', remedy="leave one of them out")


@dataclass(frozen=True)
class DenoisedLevel:
    """What happened on one level of the wavelet transform.

    Parameters
    ----------
    level : int
        1 is the finest.
    band_hz : (float, float)
        Sampling rate / 2^(level + 1) to twice that: where the level's coefficients come from, roughly.
    noise : float
        Estimated standard deviation of the noise in its coefficients, in the signal's unit.
    threshold : float
        In the signal's unit; inf where all coefficients were set to zero. Mean over the shifts, as `noise` and
        `kept_share`.
    kept_share : float
        Share of its coefficients that are not zero afterwards.
    """

    level: int
    band_hz: tuple[float, float]
    noise: float
    threshold: float
    kept_share: float


@dataclass(frozen=True)
class Denoised:
    """A signal without its noise.

    Parameters
    ----------
    values : array, (n_samples,)
    removed : array, (n_samples,)
        Signal less `values`: look at it for what should not have gone.
    sampling_rate_hz : float
    levels : tuple of DenoisedLevel
        Finest first. What is coarser than the last one is kept as it is.
    noise_rms : float
        Estimated standard deviation of the noise: of the finest level, in the signal's unit.
    settings : DenoiseSettings
        With the number of levels used.
    unit, source : str
    """

    values: FloatArray
    removed: FloatArray
    sampling_rate_hz: float
    levels: tuple[DenoisedLevel, ...]
    noise_rms: float
    settings: DenoiseSettings
    unit: str
    source: str

    def __post_init__(self) -> None:
        for name in ("values", "removed"):
            object.__setattr__(self, name, frozen_array(getattr(self, name), name, ndim=1))

    @property
    def removed_share(self) -> float:
        """Energy of the removed part over that of the signal without its mean."""
        signal = self.values + self.removed
        energy = float(np.sum(np.square(signal - signal.mean())))
        return float(np.sum(np.square(self.removed))) / energy if energy > 0.0 else 0.0

    def describe(self) -> str:
        """Return the levels as a table in text."""
        s, unit = self.settings, self.unit or "1"
        lines = [
            f"{self.source or 'signal'}: {s.threshold} thresholds, {s.rule}, {s.wavelet}, {s.n_shifts} shift(s)",
            f"noise {self.noise_rms:.3g} {unit}; removed {100 * self.removed_share:.3g} % of the energy",
            f"{'level':>5} {'band (Hz)':>20} {f'noise ({unit})':>16} {f'threshold ({unit})':>18} {'kept %':>8}",
        ]
        lines += [
            f"{v.level:>5} {f'{v.band_hz[0]:.4g} to {v.band_hz[1]:.4g}':>20} {v.noise:>16.3g} {v.threshold:>18.3g} "
            f"{100 * v.kept_share:>8.2f}"
            for v in self.levels
        ]
        return "\n".join(lines)
