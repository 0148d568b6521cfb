"""Spectral correlation and coherence over modulation frequency (or order) and carrier frequency."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from gearsig.checks import FloatArray, frozen_array, within
from gearsig.errors import InputError, RefusalError
from gearsig.spectra.types import Spectrum


@dataclass(frozen=True)
class SpectralCoherence:
    """How strongly each carrier band is modulated at each cyclic frequency.

    γ²(α, f) = |S(α, f)|² / (S(0, f) S(0, f - α)): 0 for stationary noise, 1 where the band's content at f is a copy
    of that at f - α.

    Parameters
    ----------
    coherence_squared : array, (n_alphas, n_bands)
    correlation : complex array, (n_alphas, n_bands)
        S(α, f), the one-sided spectral correlation density; at α = 0 it would be the power density.
    alpha : array, (n_alphas,)
        Cyclic frequencies (Hz) or orders (cycles per revolution of `shaft`), equally spaced.
    alpha_axis : str
        "frequency" or "order".
    frequency_hz : array, (n_bands,)
        Middles of the carrier bands, equally spaced; each is two spacings wide, with a raised-cosine weight.
    n_independent : float
        Independent products averaged in a cell.
    alpha_resolution : float
        Spacing of `alpha`: one over the length.
    unit : str
        Of the correlation, e.g. "(m/s^2)^2/Hz".
    source, shaft : str
    """

    coherence_squared: FloatArray
    correlation: NDArray[np.complexfloating[Any, Any]]
    alpha: FloatArray
    alpha_axis: Literal["frequency", "order"]
    frequency_hz: FloatArray
    n_independent: float
    alpha_resolution: float
    unit: str
    source: str
    shaft: str = ""

    def __post_init__(self) -> None:
        for name, ndim in (("coherence_squared", 2), ("alpha", 1), ("frequency_hz", 1)):
            object.__setattr__(self, name, frozen_array(getattr(self, name), name, ndim=ndim))
        correlation = np.asarray(self.correlation).view()
        correlation.flags.writeable = False
        object.__setattr__(self, "correlation", correlation)
        shape = (len(self.alpha), len(self.frequency_hz))
        if not self.coherence_squared.shape == self.correlation.shape == shape:
            raise InputError(f"values of shape {self.coherence_squared.shape} for {shape[0]} α × {shape[1]} bands")

    @property
    def alpha_label(self) -> str:
        """Axis of α with unit."""
        if self.alpha_axis == "frequency":
            return "cyclic frequency (Hz)"
        return f"cyclic order (per revolution of {self.shaft or 'the shaft'})"

    def level(self, probability: float = 0.05) -> float:
        """Return the squared coherence that stationary Gaussian noise exceeds in a cell with the given probability.

        P(γ² > t) = (1 - t)^(M-1) for M independent products, hence t = 1 - P^(1/(M-1)).
        """
        p = within(probability, "probability", 1e-12, 0.5)
        return float(-np.expm1(np.log(p) / (self.n_independent - 1.0)))


@dataclass(frozen=True)
class EnhancedEnvelope:
    """Squared coherence averaged over a range of carriers: an envelope spectrum in which all bands count alike.

    Parameters
    ----------
    spectrum : Spectrum
        Dimensionless, over cyclic frequency or order; its first line is not at zero.
    level : float
        What stationary noise exceeds in a line with `probability`.
    probability : float
    band_hz : (float, float)
        Middles of the first and last carrier band.
    """

    spectrum: Spectrum
    level: float
    probability: float
    band_hz: tuple[float, float]


def enhanced_envelope(
    coherence: SpectralCoherence, band_hz: tuple[float, float] | None = None, *, probability: float = 0.05
) -> EnhancedEnvelope:
    """Return the mean of the squared coherence over the carriers of a band, and noise's level of it.

    E(α) = (1/n) Σ_f γ²(α, f). Under stationary noise, each γ² has mean 1/M and nearly an exponential distribution, the
    mean over n bands nearly a gamma distribution of shape n/(1 + 2/36), neighbouring bands overlapping by half.

    Parameters
    ----------
    coherence : SpectralCoherence
    band_hz : (float, float) or None
        Carriers whose middles lie in it; None takes all (the "enhanced" spectrum), a band the "improved" one.
    probability : float
        Of the level, for one line. For all lines at once divide it by their number.

    Raises
    ------
    RefusalError
        If no carrier lies in the band.

    References
    ----------
    J. Antoni, G. Xin and N. Hamzaoui, "Fast computation of the spectral correlation", 2017.
    """
    from scipy.special import gammainccinv

    f = coherence.frequency_hz
    low, high = (f[0], f[-1]) if band_hz is None else (float(band_hz[0]), float(band_hz[1]))
    inside = (f >= low) & (f <= high)
    n = int(inside.sum())
    if n == 0:
        raise RefusalError(
            f"no carrier lies from {low:g} to {high:g} Hz; they go from {f[0]:g} to {f[-1]:g} Hz",
            remedy="widen the band, or lower the highest cyclic frequency, which sets the lowest carrier",
        )
    p = within(probability, "probability", 1e-12, 0.5)
    shape = n / (1.0 + 2.0 / 36.0) if n > 1 else 1.0
    level = coherence.level(p) if n == 1 else float(gammainccinv(shape, p)) / shape / coherence.n_independent
    spectrum = Spectrum(
        values=coherence.coherence_squared[:, inside].mean(axis=1),
        positions=coherence.alpha,
        axis=coherence.alpha_axis,
        scaling="dimensionless",
        unit="",
        resolution=coherence.alpha_resolution,
        noise_bandwidth=coherence.alpha_resolution,
        window="hann",
        n_averages=max(1, int(coherence.n_independent)),
        source=f"mean squared coherence {f[inside][0]:g}-{f[inside][-1]:g} Hz of {coherence.source}",
        shaft=coherence.shaft,
    )
    return EnhancedEnvelope(spectrum, level, p, (float(f[inside][0]), float(f[inside][-1])))
