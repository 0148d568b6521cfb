"""Spectral correlation and coherence of cyclostationary signals at constant speed."""

from __future__ import annotations

import numpy as np

from gearsig.checks import FloatArray, positive
from gearsig.errors import InputError, RefusalError
from gearsig.recording.types import Recording
from gearsig.spectra.blocks import ComplexArray, checked_signal, scaled_unit
from gearsig.spectra.coherence_bands import FIRST_LINE, CarrierBands, lay_bands
from gearsig.spectra.coherence_types import SpectralCoherence
from gearsig.spectra.kurtogram_preparation import Preparation, prepared_signal
from gearsig.spectra.window import make_window


def spectral_coherence(
    values: FloatArray,
    sampling_rate_hz: float,
    *,
    highest_alpha_hz: float,
    n_bands: int = 64,
    unit: str = "",
    source: str = "",
) -> SpectralCoherence:
    """Return the spectral correlation and coherence up to a cyclic frequency.

    S(α, f) = Σ_ν G(ν - f) X(ν) X*(ν - α) / ΣG: the cyclic periodogram of the whole signal (Hann's window), averaged
    over the carriers of a band. γ² divides |S|² by the same averages of |X(ν)|² and |X(ν - α)|², so that γ² ≤ 1. All α
    of a band come from one correlation of lines by the fast Fourier transform.

    Parameters
    ----------
    values : array, (n_samples,)
    sampling_rate_hz : float
    highest_alpha_hz : float
        The highest cyclic frequency: a few times the fastest modulation sought.
    n_bands : int
        Carrier bands from 0 to half the sampling rate. Fewer bands average more and find weaker modulation; more show
        better where its carrier is. Bands below half of `highest_alpha_hz` are left out.
    unit, source : str

    Returns
    -------
    SpectralCoherence
        α every 1/length, from 4/length on. A modulation between two lines of α loses up to 7 % of γ.

    Raises
    ------
    InputError
        On a wrong shape or rate, or bands and cyclic frequencies that do not fit.
    RefusalError
        On a signal that is constant, or too short for the bands.

    Notes
    -----
    The level of noise is that of a stationary signal: one strong modulation raises the cells of all other α a little.
    A steady tone is coherent with every other tone: remove synchronous parts first, see `prepared_signal`. For a speed
    that changes by more than one part in α times length, use `order_coherence`.

    References
    ----------
    W. A. Gardner, "Measurement of spectral correlation", 1986 (frequency smoothing). J. Antoni, "Cyclic spectral
    analysis in practice", 2007. J. Antoni, G. Xin and N. Hamzaoui, "Fast computation of the spectral correlation",
    2017, reach nearly the same average by short-time transforms.
    """
    x = checked_signal(values, minimum=64)
    fs = positive(sampling_rate_hz, "sampling_rate_hz", "Hz")
    n_alphas = _n_alphas(positive(highest_alpha_hz, "highest_alpha_hz", "Hz"), fs, len(x))
    window = make_window("hann", len(x)).values
    energy = float(np.dot(window, window))
    # Σ|R(d)|² of the window's own correlation between lines d apart.
    inflation = len(x) * float(np.sum(window**4)) / energy**2
    n_lines = (len(x) + 1) // 2  # without Nyquist
    bands = lay_bands(n_lines, n_bands, n_alphas, inflation, n_alphas - FIRST_LINE + 1)
    lines = transform_of(x, window)
    S, gamma = correlate_lines(lines, bands, n_alphas)
    S *= 2.0 / (fs * energy)
    return SpectralCoherence(
        coherence_squared=gamma,
        correlation=S,
        alpha=np.arange(FIRST_LINE, n_alphas + 1) * (fs / len(x)),
        alpha_axis="frequency",
        frequency_hz=bands.centres * (fs / len(x)),
        n_independent=bands.products_per_band / inflation,
        alpha_resolution=fs / len(x),
        unit=scaled_unit(unit, "power density"),
        source=source or "signal",
    )


def channel_coherence(
    recording: Recording,
    channel: str,
    *,
    highest_alpha_hz: float,
    n_bands: int = 64,
    preparation: Preparation = "none",
) -> SpectralCoherence:
    """Return the spectral coherence of a recording's channel, see `spectral_coherence`.

    Of the signal as it is, with its steady "tones removed" (gears), or "whitened"; see `prepared_signal`.
    """
    unit = recording.channels[recording.index(channel)].unit if preparation != "whitened" else ""
    return spectral_coherence(
        prepared_signal(recording.values(channel), recording.sampling_rate_hz, preparation),
        recording.sampling_rate_hz,
        highest_alpha_hz=highest_alpha_hz,
        n_bands=n_bands,
        unit=unit,
        source=channel if preparation == "none" else f"{channel}, {preparation}",
    )


def transform_of(x: FloatArray, window: FloatArray) -> ComplexArray:
    """Return the windowed signal's lines from 0 to below half the rate, its mean removed."""
    from scipy.fft import rfft

    y = x.astype(np.float64)
    largest = float(np.abs(y).max())
    y -= y.mean()
    if float(np.abs(y).max()) <= 1e-7 * largest:
        raise RefusalError("the signal is constant: it has no modulation", remedy="check the channel")
    y *= window
    lines: ComplexArray = rfft(y, overwrite_x=True)[: (len(x) + 1) // 2]
    return lines


def correlate_lines(lines: ComplexArray, bands: CarrierBands, n_alphas: int) -> tuple[ComplexArray, FloatArray]:
    """Return Σ G X(ν) X*(ν - α)/ΣG and its squared coherence for α = 4 … n_alphas lines, (n, n_bands) each."""
    from scipy.fft import fft, ifft, next_fast_len

    G, half = bands.weight, bands.half
    n_band = len(G)
    n_fft = next_fast_len(n_band + n_alphas)
    # Lines below zero are the mirror image of those above it.
    lines = np.concatenate([np.conj(lines[1 : n_alphas + 1][::-1]), lines])
    weight = np.conj(fft(G, n_fft))
    S = np.empty((n_alphas - FIRST_LINE + 1, bands.n_bands), dtype=np.complex128)
    gamma = np.empty(S.shape)
    for i, centre in enumerate(bands.centres):
        start = int(centre) - half + 1 + n_alphas  # the band's first line in the extended array
        u = lines[start : start + n_band]
        v = lines[start - n_alphas : start + n_band]
        # d[m] = Σ_i G u[i] v*[i + m] for v shifted down by α = n_alphas - m lines.
        d = np.conj(ifft(np.conj(fft(u * G, n_fft)) * fft(v, n_fft), overwrite_x=True))
        power = v.real**2 + v.imag**2
        shifted = ifft(weight * fft(power, n_fft), overwrite_x=True).real
        m = n_alphas - np.arange(FIRST_LINE, n_alphas + 1)
        own = float(np.dot(G, power[n_alphas:]))
        S[:, i] = d[m] / G.sum()
        below = own * np.maximum(shifted[m], 1e-14 * float(power.max()))
        square = d[m].real ** 2 + d[m].imag ** 2
        gamma[:, i] = np.divide(square, below, out=np.zeros(len(m)), where=below > 0)
    return S, gamma


def _n_alphas(highest_hz: float, fs: float, n: int) -> int:
    n_alphas = int(np.floor(highest_hz * n / fs * (1 + 1e-12)))
    if not FIRST_LINE < n_alphas < n // 2:
        raise InputError(
            f"highest_alpha_hz is {highest_hz:g} Hz",
            allowed=f"{(FIRST_LINE + 1) * fs / n:g} to below {fs / 2:g} Hz for this signal",
            remedy="record longer for lower ones",
        )
    return n_alphas
