"""Which band's envelope shows a modulation best: kurtogram, spectral coherence and plain envelopes compared."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from gearsig.checks import FloatArray, count, positive
from gearsig.errors import RefusalError
from gearsig.recording import Recording
from gearsig.spectra._amplitude import Preparation, noise_floor, prepared_signal
from gearsig.spectra._coherence import SpectralCoherence, enhanced_envelope, spectral_coherence
from gearsig.spectra._envelope import envelope_spectrum
from gearsig.spectra._kurtogram import kurtogram
from gearsig.spectra._types import Spectrum, named_signal

LARGEST_SLIP = 0.02
"""Relative distance at which a modulation's lines are sought: bearings turn that far from their kinematic orders."""


@dataclass(frozen=True)
class BandChoice:
    """A way to look at a modulation, and how clearly it shows there.

    Parameters
    ----------
    method : str
        "plain": the envelope of all above the lowest carrier; "kurtogram": of its band; "coherence band": of the band
        in which the coherence at the modulation stands out; "enhanced": the mean squared coherence over all carriers.
    band_hz : (float, float)
    clarity_db : float
        Mean over the harmonics of the line's height over the floor around it.
    modulation_hz : float
        The modulation frequency as it was found, within the slip.
    spectrum : Spectrum
        Over modulation frequency.
    """

    method: str
    band_hz: tuple[float, float]
    clarity_db: float
    modulation_hz: float
    spectrum: Spectrum

    def __repr__(self) -> str:
        low, high = self.band_hz
        modulation = f"{self.clarity_db:.1f} dB at {self.modulation_hz:.5g} Hz"
        return f"BandChoice({self.method}: {low:.5g} to {high:.5g} Hz, {modulation})"


def compare_bands(
    signal: FloatArray | Recording,
    channel_or_rate_hz: str | float,
    modulation_hz: float,
    *,
    n_harmonics: int = 3,
    slip: float = LARGEST_SLIP,
    preparation: Preparation = "tones removed",
) -> tuple[BandChoice, ...]:
    r"""Return the ways to look at a modulation of known frequency, the clearest first.

    Clarity is :math:`\frac{1}{K} \sum_k 20 \lg (A(k\alpha)/F(k\alpha))` over the first K harmonics, A the line and F
    the floor of the same spectrum; of the squared coherence, a power, 10 lg.

    Parameters
    ----------
    signal : Recording or array, (n_samples,)
    channel_or_rate_hz : str or float
        The channel of a recording; of an array its sampling rate in Hz.
    modulation_hz : float
        The modulation frequency, e.g. how often elements pass a race.
    n_harmonics : int
    slip : float
        Relative range about it.
    preparation : str
        See `prepared_signal`.

    Returns
    -------
    tuple of BandChoice

    Raises
    ------
    InputError, RefusalError
        As of the spectra compared: on wrong shapes, constant or too short signals.

    Notes
    -----
    The band is chosen for the modulation that is looked for, so that some of its clarity is chance: noise alone reaches
    some 6 dB. The kurtogram knows nothing of the modulation, and takes the band of a few strong shocks where there are.

    References
    ----------
    J. Antoni, "Fast computation of the kurtogram for the detection of transient faults", 2007. A. Mauricio, W. A.
    Smith, R. B. Randall, J. Antoni and K. Gryllias, "Improved Envelope Spectrum via Feature Optimisation-gram
    (IESFOgram)", 2020 (band by the coherence at the modulation frequency).
    """
    x, fs, _, _ = named_signal(signal, channel_or_rate_hz, "", "", minimum=64)
    alpha, n = positive(modulation_hz, "modulation_hz", "Hz"), count(n_harmonics, "n_harmonics")
    x, highest = prepared_signal(x, fs, preparation), (n + 0.5) * alpha
    coherence = spectral_coherence(x, fs, highest_alpha_hz=highest)
    lowest_hz = float(coherence.frequency_hz[0])
    choices = [
        _choice("plain", (lowest_hz, 0.49 * fs), x, fs, alpha, n, slip),
        _choice("coherence band", coherence_band(coherence, alpha, n_harmonics=n, slip=slip), x, fs, alpha, n, slip),
    ]
    try:
        band = kurtogram(x, fs).best_band(narrowest_hz=3 * highest)
    except RefusalError:
        pass  # no band is wide enough for the modulation's harmonics
    else:
        choices.append(_choice("kurtogram", band.band_hz, x, fs, alpha, n, slip))
    enhanced = enhanced_envelope(coherence)
    clarity, rates = _clarity(enhanced.spectrum, alpha, n, slip, power=True)
    choices.append(BandChoice("enhanced", enhanced.band_hz, clarity, rates, enhanced.spectrum))
    return tuple(sorted(choices, key=lambda choice: -choice.clarity_db))


def coherence_band(
    coherence: SpectralCoherence, modulation_hz: float, *, n_harmonics: int = 3, slip: float = LARGEST_SLIP
) -> tuple[float, float]:
    r"""Return the band of carriers in which the coherence at a modulation frequency's harmonics stands out most.

    .. math:: \max_{a, b} \; \frac{1}{\sqrt{b - a}} \sum_{i=a}^{b} \Big( \sum_k \gamma^2(k\alpha, f_i) - K/M \Big)

    the sum's signal-to-noise ratio, each carrier's squared coherence having mean and scatter 1/M under noise.

    Parameters
    ----------
    coherence : SpectralCoherence
    modulation_hz : float
        In the unit of its cyclic axis: Hz or orders.
    n_harmonics : int
    slip : float
        Relative range about it, from which the clearest is taken.

    Returns
    -------
    (float, float)
        From edge to edge of the bands, which are two spacings wide.
    """
    alpha, f = coherence.alpha, coherence.frequency_hz
    spacing = coherence.alpha_resolution
    factors = np.linspace(1 - slip, 1 + slip, max(3, int(2 * slip * n_harmonics * modulation_hz / spacing) * 2 + 1))
    best, best_band = -np.inf, (0, len(f))
    for factor in factors:
        places = modulation_hz * factor * np.arange(1, n_harmonics + 1)
        rows = np.rint((places - alpha[0]) / spacing).astype(np.int64)
        rows = rows[(rows >= 0) & (rows < len(alpha))]
        if not len(rows):
            continue
        above = coherence.coherence_squared[rows].sum(axis=0) - len(rows) / coherence.n_independent
        sums = np.concatenate([[0.0], np.cumsum(above)])
        widths = np.arange(1, len(f) + 1)
        ratios = (sums[None, :] - sums[:, None])[np.triu_indices(len(f) + 1, 1)]
        first, last = np.triu_indices(len(f) + 1, 1)
        ratios = ratios / np.sqrt(widths[last - first - 1])
        i = int(np.argmax(ratios))
        if ratios[i] > best:
            best, best_band = float(ratios[i]), (int(first[i]), int(last[i]))
    step = float(f[1] - f[0]) if len(f) > 1 else float(f[0])
    low, high = float(f[best_band[0]]) - step, float(f[best_band[1] - 1]) + step
    return max(low, 0.0), high


def _choice(
    method: str, band_hz: tuple[float, float], x: FloatArray, fs: float, alpha: float, n: int, slip: float
) -> BandChoice:
    width = max(band_hz[1] - band_hz[0], 2.5 * (n + 0.5) * alpha)  # an envelope moves no faster than its band is wide
    middle = min(max(sum(band_hz) / 2, width / 2), fs / 2 - width / 2)
    band_hz = (max(middle - width / 2, 0.0), min(middle + width / 2, fs / 2))
    spectrum = envelope_spectrum(x, fs, band_hz=band_hz, highest_hz=(n + 0.5) * alpha)
    clarity, rates = _clarity(spectrum, alpha, n, slip, power=False)
    return BandChoice(method, band_hz, clarity, rates, spectrum)


def _clarity(spectrum: Spectrum, alpha: float, n: int, slip: float, *, power: bool) -> tuple[float, float]:
    """Return the mean height of the harmonics over the floor in dB, and the frequency at which it is largest."""
    values = np.sqrt(spectrum.values) if power else spectrum.values
    amplitudes = replace(spectrum, values=values, scaling="amplitude peak")
    floor = np.maximum(noise_floor(amplitudes).values, 1e-300)
    db = 20 * np.log10(np.maximum(values, 1e-300) / floor)
    step = spectrum.resolution / (2 * n * alpha)
    factors = np.arange(1 - slip, 1 + slip + step, step)
    places = alpha * factors[:, None] * np.arange(1, n + 1)
    rows = np.rint((places - spectrum.positions[0]) / spectrum.resolution).astype(np.int64)
    heights = db[np.clip(rows, 0, len(db) - 1)].mean(axis=1)
    best = int(np.argmax(heights))
    return float(heights[best]), float(alpha * factors[best])
