"""Wavelet denoising of signals of any length."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gearsig.checks import FloatArray, positive
from gearsig.decompose.wavelet_thresholds import apply, bayes, noise_level, sure, universal
from gearsig.decompose.wavelet_types import Denoised, DenoisedLevel, DenoiseSettings
from gearsig.errors import InputError
from gearsig.recording.types import Recording
from gearsig.spectra.blocks import checked_signal

FILTER_LENGTHS_LEFT = 8
"""The default stops at the level that has this many filter lengths of coefficients: its noise can still be told."""


def denoise(
    values: FloatArray,
    sampling_rate_hz: float,
    settings: DenoiseSettings | None = None,
    *,
    unit: str = "",
    source: str = "",
) -> Denoised:
    """Take Gaussian noise out of a signal by thresholding its wavelet coefficients.

    x = s + σ z; the discrete wavelet transform leaves white noise white and gathers transients and smooth parts in few
    large coefficients. Coefficients below a threshold are set to zero, the others kept or shrunk, and the transform is
    inverted. With cycle spinning the signal is shifted against the wavelet grid, and the results are averaged.

    Parameters
    ----------
    values : array, (n_samples,)
        Finite, not constant, at least as long as the wavelet's filter. Any length.
    sampling_rate_hz : float
    settings : DenoiseSettings or None
        None: universal threshold, soft, "sym8", eight shifts.
    unit, source : str

    Returns
    -------
    Denoised
        Values in the signal's unit, double precision; `values + removed` is the signal.

    Raises
    ------
    InputError
        On NaN, a constant, or a signal too short for the level.

    Notes
    -----
    The signal is continued at both ends by its mirror image. Memory is about six times the signal's.

    When not to use it: for steady tones in noise (a spectrum or a synchronous average gathers them far better), and
    before indicators that measure impulsiveness, which thresholds raise by themselves.

    References
    ----------
    D. L. Donoho, "De-noising by soft-thresholding", 1995.
    R. R. Coifman and D. L. Donoho, "Translation-invariant de-noising", 1995.
    """
    x = checked_signal(values, minimum=8).astype(np.float64)
    fs = positive(sampling_rate_hz, "sampling_rate_hz", "Hz")
    settings = _with_levels(settings or DenoiseSettings(), x)
    n_levels, n_shifts = settings.n_levels or 1, settings.n_shifts
    found = np.zeros((n_levels, 3))  # noise, threshold, kept share
    clean = np.zeros_like(x)
    # A power of two leaves every digit as it is, and keeps squares of very small or large values in range.
    scale = 2.0 ** np.floor(np.log2(np.abs(x).max()))
    noise_rms = None if settings.noise_rms is None else settings.noise_rms / scale
    for shift in range(n_shifts):
        part, numbers = _denoise_shifted(x / scale, shift, n_levels, noise_rms, settings)
        clean += part * (scale / n_shifts)
        found += numbers * (np.array([scale, scale, 1.0]) / n_shifts)
    levels = tuple(
        DenoisedLevel(j, (fs / 2 ** (j + 1), fs / 2**j), *(float(v) for v in found[j - 1]))
        for j in range(1, n_levels + 1)
    )
    return Denoised(clean, x - clean, fs, levels, levels[0].noise, settings, unit, source)


def denoise_channel(recording: Recording, channel: str, settings: DenoiseSettings | None = None) -> Denoised:
    """Take the noise out of one channel of a recording; see `denoise`."""
    return denoise(
        recording.values(channel),
        recording.sampling_rate_hz,
        settings,
        unit=recording.channels[recording.index(channel)].unit,
        source=channel,
    )


def deepest_level(n_samples: int, wavelet: str) -> int:
    """Return the deepest level at which a coefficient still sees the signal more than its continuation; 0 if none."""
    import pywt

    return int(pywt.dwt_max_level(n_samples, pywt.Wavelet(wavelet).dec_len))


def _with_levels(settings: DenoiseSettings, x: FloatArray) -> DenoiseSettings:
    if float(x.min()) == float(x.max()):
        raise InputError(
            f"the signal is constant ({x[0]:g})",
            where="values",
            remedy="check the channel: there is no noise to remove",
        )
    deepest = deepest_level(len(x), settings.wavelet)
    if deepest < (settings.n_levels or 1):
        raise InputError(
            f"n_levels is {settings.n_levels or 1} for {len(x)} samples and wavelet {settings.wavelet}",
            allowed=f"1 to {deepest}" if deepest else "a longer signal",
            remedy="take fewer levels, a shorter wavelet (db2, haar) or a longer signal",
        )
    if settings.n_levels is not None:
        return settings
    return replace(settings, n_levels=max(1, deepest_level(len(x) // FILTER_LENGTHS_LEFT, settings.wavelet)))


def _denoise_shifted(
    x: FloatArray, shift: int, n_levels: int, noise_rms: float | None, settings: DenoiseSettings
) -> tuple[FloatArray, FloatArray]:
    """Denoise with the signal moved by `shift` samples; also return noise, threshold and kept share of each level."""
    import pywt

    n = len(x)
    moved = np.pad(x, (shift, 0), mode="symmetric")
    approximation, *details = pywt.wavedec(moved, settings.wavelet, mode="symmetric", level=n_levels)
    noise = noise_rms if noise_rms is not None else noise_level(details[-1])
    numbers = np.empty((n_levels, 3))
    for i, d in enumerate(details):
        level = n_levels - i
        sigma = noise_level(d) if settings.noise == "each level" else noise
        threshold = _threshold(d, sigma, n, settings.threshold)
        details[i] = apply(d, threshold, settings.rule)
        numbers[level - 1] = sigma, threshold, np.count_nonzero(details[i]) / len(d)
    clean = pywt.waverec([approximation, *details], settings.wavelet, mode="symmetric")
    return clean[shift : shift + n], numbers


def _threshold(d: FloatArray, sigma: float, n: int, name: str) -> float:
    if name == "universal":
        return universal(sigma, n)
    return sure(d, sigma, n) if name == "sure" else bayes(d, sigma)
