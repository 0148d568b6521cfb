"""Wavelet denoising of signals of any length."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal, get_args

import numpy as np

from gearsig.checks import FloatArray, count, freeze, instance_of, one_of, positive
from gearsig.errors import InputError
from gearsig.recording import Recording
from gearsig.results import Result
from gearsig.spectra import named_signal

MEDIAN_OF_NORMAL = 0.674489750196081743
"""Median of the magnitude of a standard normal variable."""


def noise_level(d: FloatArray) -> float:
    """Return the standard deviation of Gaussian noise if few coefficients contain signal: median|d| / 0.6745.

    Source: D. L. Donoho and I. M. Johnstone, "Ideal spatial adaptation by wavelet shrinkage", 1994.
    """
    return float(np.median(np.abs(d))) / MEDIAN_OF_NORMAL


def universal(sigma: float, n: int) -> float:
    """Return the universal threshold σ √(2 ln n), which the largest of n noise values hardly exceeds (same source)."""
    return float(sigma * np.sqrt(2.0 * np.log(max(n, 2))))


def sure(d: FloatArray, sigma: float, n: int) -> float:
    """Return the threshold with minimum estimated risk for the soft rule, or the universal one for a sparse level.

    SURE(T) = m - 2 #{|d| ≤ T} + Σ min(|d|, T)² in units of σ, with its minimum at one of the |d|. A level is sparse if
    Σ d²/m - 1 ≤ (log₂ m)^(3/2) / √m. `n` is the signal's length.

    Source: D. L. Donoho and I. M. Johnstone, "Adapting to unknown smoothness via wavelet shrinkage", 1995.
    """
    if sigma == 0.0:
        return 0.0
    m = len(d)
    square = np.sort(np.square(d / sigma))
    if m < 2 or square.mean() - 1.0 <= np.log2(m) ** 1.5 / np.sqrt(m):
        return universal(sigma, n)
    below = np.arange(1, m + 1)
    risk = m - 2.0 * below + np.cumsum(square) + (m - below) * square
    return min(float(sigma * np.sqrt(square[int(np.argmin(risk))])), universal(sigma, n))


def bayes(d: FloatArray, sigma: float) -> float:
    """Return the threshold σ²/σ_signal, with σ_signal² = mean d² - σ²; inf if there is no signal.

    Source: S. G. Chang, B. Yu and M. Vetterli, "Adaptive wavelet thresholding for image denoising and compression",
    2000.
    """
    signal = float(np.mean(np.square(d))) - sigma**2
    return float(sigma**2 / np.sqrt(signal)) if signal > 0.0 else float("inf")


def apply(d: FloatArray, threshold: float, rule: str) -> FloatArray:
    """Return thresholded coefficients.

    For |d| > T: soft: sign(d) (|d| - T); hard: d; garrote: d - T²/d. Otherwise 0.

    Source of the garrote: H.-Y. Gao, "Wavelet shrinkage denoising using the non-negative garrote", 1998.
    """
    kept = np.abs(d) > threshold
    if rule == "hard":
        return np.where(kept, d, 0.0)
    shrunk = np.zeros_like(d)
    if rule == "soft":
        return np.subtract(d, np.copysign(threshold, d), out=shrunk, where=kept)
    ratio = np.divide(threshold, d, out=shrunk, where=kept)
    return np.where(kept, d - threshold * ratio, 0.0) if kept.any() else ratio


ThresholdName = Literal["universal", "sure", "bayes"]
RuleName = Literal["soft", "hard", "garrote"]
NoiseScope = Literal["quietest level", "finest level", "each level"]
MIN_QUIET, QUIETER = 500, 0.8
"""Minimum coefficients of the quietest level, and factor below the finest level's noise: for white noise, levels of
this size scatter by 5 %."""


@dataclass(frozen=True)
class DenoiseSettings:
    """How wavelet coefficients are thresholded.

    Parameters
    ----------
    threshold : str
        "universal": σ √(2 ln n), leaves almost no noise; "sure": minimum estimated risk for each level, universal for
        sparse levels; "bayes": σ²/σ_signal for each level, keeps most.
    rule : str
        "soft": kept coefficients d shrink by the threshold T; "hard": they stay; "garrote": d - T²/d, in between.
        "sure" and "bayes" are derived for "soft".
    wavelet : str
        An orthogonal or biorthogonal wavelet of PyWavelets; "sym8" is smooth and nearly symmetric. With biorthogonal
        wavelets, the thresholds' assumptions on the noise hold only approximately.
    n_levels : int or None
        None: as many as leave eight filter lengths of samples on the coarsest level.
    noise : str
        Level at which the noise's standard deviation is estimated. White noise has the same on all levels, and a signal
        only adds to it: "quietest level" takes the minimum of all; "finest level", the usual choice, must be free of
        signal, which it seldom is for gears, whose mesh harmonics extend into it. "each level", separately, is for
        coloured noise; steady tones that fill a level are then mistaken for noise.
    noise_rms : float or None
        The standard deviation of white noise in the signal's unit, if known. None: estimated.
    n_shifts : int
        Cycle spinning: mean over this many shifts of the signal relative to the wavelet grid. 1: none. More than
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
    noise: NoiseScope = "quietest level"
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
    """Result of denoising on one level of the wavelet transform.

    Parameters
    ----------
    level : int
        1 is the finest.
    band_hz : (float, float)
        Approximate band of the level: sampling rate / 2^(level + 1) to twice that.
    noise : float
        Estimated standard deviation of the noise in its coefficients, in the signal's unit.
    threshold : float
        In the signal's unit; inf if all coefficients were set to zero. Mean over the shifts, like `noise` and
        `kept_share`.
    kept_share : float
        Share of the coefficients that are not zero afterwards.
    """

    level: int
    band_hz: tuple[float, float]
    noise: float
    threshold: float
    kept_share: float


@dataclass(frozen=True)
class Denoised(Result, columns=("time_s", "values", "removed")):
    """A denoised signal.

    Parameters
    ----------
    values : array, (n_samples,)
    removed : array, (n_samples,)
        Signal minus `values`: inspect it for content that should have been kept.
    sampling_rate_hz : float
    levels : tuple of DenoisedLevel
        Finest first. Content coarser than the last level is kept unchanged.
    noise_rms : float
        Estimated standard deviation of the noise, in the signal's unit; that of the finest level if they differ.
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
        freeze(self, "values", "removed")

    @property
    def time_s(self) -> FloatArray:
        """Times of the samples from 0, (n_samples,)."""
        return np.arange(len(self.values)) / self.sampling_rate_hz

    @property
    def removed_share(self) -> float:
        """Energy of the removed part relative to that of the signal without its mean."""
        signal = self.values + self.removed
        energy = float(np.sum(np.square(signal - signal.mean())))
        return float(np.sum(np.square(self.removed))) / energy if energy > 0.0 else 0.0


def denoise(
    signal: FloatArray | Recording,
    channel_or_rate_hz: str | float,
    settings: DenoiseSettings | None = None,
    *,
    unit: str = "",
    source: str = "",
) -> Denoised:
    """Remove Gaussian noise from a signal by thresholding its wavelet coefficients.

    x = s + σ z; the discrete wavelet transform leaves white noise white and concentrates transients and smooth parts in
    a few large coefficients. Coefficients below a threshold are set to zero, the others kept or shrunk, and the
    transform is inverted. With cycle spinning, results for several shifts of the signal are averaged.

    Parameters
    ----------
    signal : Recording or array, (n_samples,)
        Finite, not constant, of any length from that of the wavelet's filter on.
    channel_or_rate_hz : str or float
        A recording's channel, or an array's sampling rate in Hz.
    settings : DenoiseSettings or None
        None: universal threshold, soft, "sym8", eight shifts.
    unit, source : str
        Of the signal; default: the channel's.

    Returns
    -------
    Denoised
        Values in the signal's unit, double precision; `values + removed` is the signal.

    Raises
    ------
    InputError
        On NaN, a constant, or a signal too short for the number of levels.

    Notes
    -----
    The signal is continued at both ends by its mirror image. Memory is about six times that of the signal.

    When not to use it: for steady tones in noise (a spectrum or a synchronous average extracts them far better), and
    before indicators of impulsiveness, which thresholding itself raises.

    References
    ----------
    D. L. Donoho, "De-noising by soft-thresholding", 1995.
    R. R. Coifman and D. L. Donoho, "Translation-invariant de-noising", 1995.
    """
    values, fs, unit, source = named_signal(signal, channel_or_rate_hz, unit, source, minimum=8)
    x = values.astype(np.float64)
    instance_of(settings, DenoiseSettings | None, "settings")
    settings = _with_levels(settings or DenoiseSettings(), x)
    n_levels, n_shifts = settings.n_levels or 1, settings.n_shifts
    totals = np.zeros((n_levels, 3))  # noise, threshold, kept share
    clean = np.zeros_like(x)
    # Scaling by a power of two changes no digit, and keeps squares of very small or large values in range.
    scale = 2.0 ** np.floor(np.log2(np.abs(x).max()))
    noise_rms = None if settings.noise_rms is None else settings.noise_rms / scale
    for shift in range(n_shifts):
        part, numbers = _denoise_shifted(x / scale, shift, n_levels, noise_rms, settings)
        clean += part * (scale / n_shifts)
        totals += numbers * (np.array([scale, scale, 1.0]) / n_shifts)
    levels = tuple(
        DenoisedLevel(j, (fs / 2 ** (j + 1), fs / 2**j), *(float(v) for v in totals[j - 1]))
        for j in range(1, n_levels + 1)
    )
    return Denoised(clean, x - clean, fs, levels, levels[0].noise, settings, unit, source)


def _with_levels(settings: DenoiseSettings, x: FloatArray) -> DenoiseSettings:
    import pywt

    if float(x.min()) == float(x.max()):
        raise InputError(
            f"the signal is constant ({x[0]:g})",
            where="values",
            remedy="check the channel: there is no noise to remove",
        )
    # The deepest level at which coefficients still depend more on the signal than on its continuation.
    deepest = pywt.dwt_max_level(len(x), settings.wavelet)
    if deepest < (settings.n_levels or 1):
        raise InputError(
            f"n_levels is {settings.n_levels or 1} for {len(x)} samples and wavelet {settings.wavelet}",
            allowed=f"1 to {deepest}" if deepest else "a longer signal",
            remedy="take fewer levels, a shorter wavelet (db2, haar) or a longer signal",
        )
    if settings.n_levels is not None:
        return settings
    # The level with eight filter lengths of coefficients: its noise can still be estimated.
    return replace(settings, n_levels=max(1, pywt.dwt_max_level(len(x) // 8, settings.wavelet)))


def _denoise_shifted(
    x: FloatArray, shift: int, n_levels: int, noise_rms: float | None, settings: DenoiseSettings
) -> tuple[FloatArray, FloatArray]:
    """Return the signal denoised at a shift of `shift` samples, and (noise, threshold, kept share) of each level."""
    import pywt

    n = len(x)
    moved = np.pad(x, (shift, 0), mode="symmetric")
    approximation, *details = pywt.wavedec(moved, settings.wavelet, mode="symmetric", level=n_levels)
    noise = noise_rms if noise_rms is not None else noise_level(details[-1])
    if noise_rms is None and settings.noise == "quietest level":
        quietest = min((noise_level(d) for d in details if len(d) >= MIN_QUIET), default=noise)
        noise = quietest if quietest < QUIETER * noise else noise
    numbers = np.empty((n_levels, 3))
    for i, d in enumerate(details):
        level = n_levels - i
        sigma = noise_level(d) if settings.noise == "each level" else noise
        if settings.threshold == "bayes":
            threshold = bayes(d, sigma)
        else:
            threshold = sure(d, sigma, n) if settings.threshold == "sure" else universal(sigma, n)
        details[i] = apply(d, threshold, settings.rule)
        numbers[level - 1] = sigma, threshold, np.count_nonzero(details[i]) / len(d)
    clean = pywt.waverec([approximation, *details], settings.wavelet, mode="symmetric")
    return clean[shift : shift + n], numbers
