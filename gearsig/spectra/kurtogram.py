"""Fast kurtogram, the band it chooses, and the envelope spectrum in that band."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gearsig.checks import FloatArray, count, positive
from gearsig.errors import InputError, RefusalError
from gearsig.recording.types import Recording
from gearsig.spectra.band_choice import BandCandidate
from gearsig.spectra.blocks import checked_signal
from gearsig.spectra.envelope import Envelope, EnvelopeKind, band_envelope, envelope_spectrum
from gearsig.spectra.kurtogram_noise import kurtosis_error
from gearsig.spectra.kurtogram_preparation import Preparation, prepared_signal
from gearsig.spectra.kurtogram_tree import tree_moments
from gearsig.spectra.kurtogram_types import Kurtogram
from gearsig.spectra.types import Spectrum

FEWEST_SAMPLES = 512
"""Of a finest band's envelope: below it the kurtosis of noise alone scatters by more than 0.1."""
DEFAULT_LEVELS = 7
FEWEST_LINES = 8
"""Of an envelope's spectrum."""


@dataclass(frozen=True)
class ChosenBand:
    """A band with the kurtogram that chose it, and the envelope and its spectrum there.

    Parameters
    ----------
    band : BandCandidate
    kurtogram : Kurtogram
    envelope : Envelope
    spectrum : Spectrum
        Of the envelope, over modulation frequency.
    remarks : tuple of str
        What speaks against the choice; empty if nothing does.
    reason : str
        Why the band was chosen; empty if it was given.
    """

    band: BandCandidate
    kurtogram: Kurtogram
    envelope: Envelope
    spectrum: Spectrum
    remarks: tuple[str, ...]
    reason: str = ""


def kurtogram(
    values: FloatArray,
    sampling_rate_hz: float,
    *,
    n_levels: int | None = None,
    preparation: Preparation = "none",
    source: str = "",
) -> Kurtogram:
    """Return the fast kurtogram: the spectral kurtosis of 1, 2, 3, 4, 6 … 2^L, 3·2^(L-1) bands.

    K = ⟨|z|⁴⟩/⟨|z|²⟩² - 2, z the complex envelope from a tree of filters that halve the band and the rate, each node
    also cut into thirds. The mean is removed first.

    Parameters
    ----------
    values : array, (n_samples,)
    sampling_rate_hz : float
    n_levels : int or None
        L, the number of halvings. None is 7 (128 and 192 bands), or what the length allows: envelopes have at
        least 512 samples.
    preparation : str
        "none", "tones removed" or "whitened", see `prepared_signal`.
    source : str

    Returns
    -------
    Kurtogram

    Raises
    ------
    InputError
        On a wrong shape, rate or number of levels.
    RefusalError
        On a signal that is constant or too short for two bands.

    Notes
    -----
    Not for few strong shocks among many small impulses: the shocks choose the band. Read `remarks`.
    Borders between bands are half-amplitude points of filters with a skirt of a third of a band on either side. The
    memory needed does not grow with the length unless the signal is prepared.

    References
    ----------
    J. Antoni, "The spectral kurtosis: a useful tool for characterising non-stationary signals", 2006.
    J. Antoni, "Fast computation of the kurtogram for the detection of transient faults", 2007. The filters are longer
    than there (23 and 35 taps) and cut off at the bands' borders.

    Examples
    --------
    >>> t = np.arange(40000) / 10000.0
    >>> knocks = np.exp(-400 * (t % 0.05)) * np.sin(2 * np.pi * 3000 * (t % 0.05))
    >>> x = knocks + 0.1 * np.random.default_rng(0).normal(size=len(t))
    >>> low, high = kurtogram(x, 10000.0).best_band(narrowest_hz=300).band_hz
    >>> low <= 3000 <= high
    True
    """
    x = checked_signal(values, minimum=64)
    fs = positive(sampling_rate_hz, "sampling_rate_hz", "Hz")
    n_levels = _checked_levels(len(x), n_levels)
    x = prepared_signal(x, fs, preparation)
    low, high, mean = float(x.min()), float(x.max()), float(np.mean(x, dtype=np.float64))
    spread = max(high - mean, mean - low)
    if spread <= 1e-7 * max(-low, high) or spread == 0.0:
        raise RefusalError("the signal is constant: it has no impulses", remedy="check the channel")
    rows = [_row_of_bands(fs, *row) for row in tree_moments(x, n_levels, mean, spread)]
    lows, highs, level, kurtosis, error, share, n = (np.concatenate(column) for column in zip(*rows, strict=True))
    return Kurtogram(lows, highs, level, kurtosis, error, share, n, preparation, source or "signal")


def best_band(
    recording: Recording,
    channel: str,
    *,
    n_levels: int | None = None,
    preparation: Preparation = "none",
    narrowest_hz: float = 0.0,
    lowest_hz: float = 0.0,
    highest_hz: float | None = None,
) -> BandCandidate:
    """Return the most impulsive band of a channel, by its kurtogram; see `kurtogram` and `Kurtogram.best_band`."""
    found = channel_kurtogram(recording, channel, n_levels=n_levels, preparation=preparation)
    return found.best_band(narrowest_hz=narrowest_hz, lowest_hz=lowest_hz, highest_hz=highest_hz)


def channel_kurtogram(
    recording: Recording, channel: str, *, n_levels: int | None = None, preparation: Preparation = "none"
) -> Kurtogram:
    """Return the kurtogram of a recording's channel, see `kurtogram`."""
    x = recording.values(channel)
    return kurtogram(x, recording.sampling_rate_hz, n_levels=n_levels, preparation=preparation, source=channel)


def kurtogram_envelope(
    recording: Recording,
    channel: str,
    *,
    n_levels: int | None = None,
    preparation: Preparation = "none",
    narrowest_hz: float = 0.0,
    lowest_hz: float = 0.0,
    highest_hz: float | None = None,
    highest_modulation_hz: float | None = None,
    kind: EnvelopeKind = "squared",
    band_hz: tuple[float, float] | None = None,
) -> ChosenBand:
    """Return the envelope spectrum in the band that the channel's own kurtogram chooses, or in a given one.

    Parameters
    ----------
    recording : Recording
    channel : str
    n_levels, preparation
        As in `kurtogram`. The envelope is that of the prepared signal.
    narrowest_hz, lowest_hz, highest_hz : float
        As in `Kurtogram.best_band`.
    highest_modulation_hz : float or None
        Lines of the envelope spectrum above it are left out; the band is at least three times as wide.
    kind : str
        Of the envelope, "squared" or "magnitude".
    band_hz : (float, float) or None
        Overrides the choice; `narrowest_hz`, `lowest_hz` and `highest_hz` then mean nothing.

    Returns
    -------
    ChosenBand

    Raises
    ------
    InputError
        As `kurtogram`; also if `band_hz` lies outside of the spectrum.
    RefusalError
        As `kurtogram`; also if no band is allowed.
    """
    fs, unit = recording.sampling_rate_hz, recording.channels[recording.index(channel)].unit
    x = prepared_signal(recording.values(channel), fs, preparation)
    grid = kurtogram(x, fs, n_levels=n_levels, source=f"{channel}, {preparation}" if preparation != "none" else channel)
    if highest_modulation_hz is not None:
        narrowest_hz = max(narrowest_hz, 3.0 * _checked_modulation(highest_modulation_hz, fs, len(x)))
    reason = ""
    if band_hz is None:
        band = grid.best_band(narrowest_hz=narrowest_hz, lowest_hz=lowest_hz, highest_hz=highest_hz)
        reason = _reason(grid, band, narrowest_hz, of_modulation=highest_modulation_hz is not None)
    else:
        band = given_band(x, fs, band_hz)
    unit = "" if preparation == "whitened" else unit
    envelope = band_envelope(x, fs, band.band_hz, kind=kind, unit=unit, source=channel)
    spectrum = envelope_spectrum(envelope, highest_hz=highest_modulation_hz)
    return ChosenBand(band, grid, envelope, spectrum, grid.remarks(band), reason)


def _reason(grid: Kurtogram, band: BandCandidate, narrowest_hz: float, *, of_modulation: bool) -> str:
    """Return why a band was chosen, above all where others have more kurtosis."""
    text = "It has the largest kurtosis"
    if narrowest_hz > 0.0:
        text += f" of the bands at least {narrowest_hz:.4g} Hz wide"
        text += ", three times the highest modulation" if of_modulation else ""
    narrower = grid.kurtosis[grid.bandwidth_hz < narrowest_hz * (1.0 - 1e-9)]
    if narrower.size and float(narrower.max()) > band.kurtosis:
        text += f". Narrower ones reach {narrower.max():.3g}, but their envelopes are too slow to show so fast a rhythm"
    return text + "."


def _checked_modulation(highest_hz: float, fs: float, n: int) -> float:
    least = FEWEST_LINES * fs / n
    if not least <= positive(highest_hz, "highest_modulation_hz", "Hz") <= fs / 6.0:
        raise InputError(
            f"highest_modulation_hz is {highest_hz:g} Hz",
            allowed=f"{least:.4g} Hz, {FEWEST_LINES} over the length, to {fs / 6.0:.4g} Hz, a third of the spectrum",
        )
    return highest_hz


def given_band(values: FloatArray, sampling_rate_hz: float, band_hz: tuple[float, float]) -> BandCandidate:
    """Return the kurtosis of a band that was not chosen from the tree, see `Kurtogram` for its definition.

    Raises
    ------
    InputError
        If the band lies outside of the spectrum or holds fewer than three lines.
    RefusalError
        If there is nothing in the band.
    """
    square = band_envelope(values, sampling_rate_hz, band_hz, kind="squared").values
    mean = float(np.mean(square))
    if mean <= 0.0:
        raise RefusalError("there is no signal in the band", remedy="choose another band")
    n_bands = sampling_rate_hz / 2.0 / (band_hz[1] - band_hz[0])
    kurtosis = float(np.mean(np.square(square / mean))) - 2.0
    error = kurtosis_error(2, max(1, round(len(values) / n_bands)))
    return BandCandidate(float(band_hz[0]), float(band_hz[1]), float(np.log2(n_bands)), kurtosis, error)


def _checked_levels(n_samples: int, n_levels: int | None) -> int:
    most = int(np.floor(np.log2(n_samples / FEWEST_SAMPLES))) if n_samples >= FEWEST_SAMPLES else 0
    if most < 1:
        raise RefusalError(
            f"{n_samples} samples are too few for a kurtogram", remedy=f"record at least {2 * FEWEST_SAMPLES} samples"
        )
    if n_levels is None:
        return min(DEFAULT_LEVELS, most)
    if count(n_levels, "n_levels") > most:
        raise InputError(
            f"n_levels is {n_levels} for {n_samples} samples",
            allowed=f"1 to {most}",
            remedy=f"record at least {FEWEST_SAMPLES * 2**n_levels} samples, or take fewer levels",
        )
    return n_levels


def _row_of_bands(fs: float, n_bands: int, moments: FloatArray, n: int) -> tuple[FloatArray, ...]:
    """Return low, high, level, kurtosis, standard error, share of the largest, samples; each (n_bands,)."""
    second, fourth, largest = moments.T
    gaussian = 3.0 if n_bands == 1 else 2.0
    nothing = second <= 0.0
    ratio = np.divide(n * fourth, second**2, out=np.full(n_bands, gaussian), where=~nothing)
    share = np.divide(largest**2, fourth, out=np.zeros(n_bands), where=~nothing)
    edges = np.arange(n_bands + 1) * (fs / 2 / n_bands)
    full = [np.full(n_bands, value) for value in (np.log2(n_bands), kurtosis_error(n_bands, n), float(n))]
    return edges[:-1], edges[1:], full[0], ratio - gaussian, full[1], share, full[2]
