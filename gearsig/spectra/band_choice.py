"""Choice of the demodulation band by the kurtosis of its complex envelope."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gearsig.checks import FloatArray, not_negative, positive
from gearsig.errors import RefusalError
from gearsig.spectra.blocks import ComplexArray, checked_signal
from gearsig.spectra.envelope import band_taper
from gearsig.spectra.floor import noise_floor
from gearsig.spectra.types import Spectrum

FEWEST_ENVELOPE_SAMPLES = 256
"""Below it the kurtosis of Gaussian noise alone scatters by more than 0.25."""


@dataclass(frozen=True)
class BandCandidate:
    """A frequency band and how impulsive it is.

    Parameters
    ----------
    low_hz, high_hz : float
    level : float
        The spectrum is cut into 2^level bands; thirds stand at log2(3), 1 + log2(3), …
    kurtosis : float
        Of the complex envelope, E|z|⁴/(E|z|²)² - 2: 0 for Gaussian noise, -1 for a tone.
    standard_error : float
        Of the kurtosis under Gaussian noise.
    """

    low_hz: float
    high_hz: float
    level: float
    kurtosis: float
    standard_error: float

    @property
    def band_hz(self) -> tuple[float, float]:
        """Lower and upper limit."""
        return self.low_hz, self.high_hz


def choose_band(
    values: FloatArray,
    sampling_rate_hz: float,
    *,
    narrowest_hz: float | None = None,
    lowest_hz: float = 0.0,
    tone_limit_db: float | None = 20.0,
) -> tuple[BandCandidate, ...]:
    """Return the bands of a dyadic-and-thirds grid, the most impulsive first.

    The spectrum from 0 to half the sampling rate is cut into 2, 3, 4, 6, 8, 12 … bands; each one's complex envelope z
    comes from its lines of one Fourier transform, and K = E|z|⁴/(E|z|²)² - 2 says how impulsive it is.

    Parameters
    ----------
    values : array, (n_samples,)
    sampling_rate_hz : float
    narrowest_hz : float or None
        Bands are not narrower than that: at least three times the highest modulation frequency sought. None goes on
        to 64 bands. Envelopes always have at least 256 samples.
    lowest_hz : float
        Bands that start below it are left out.
    tone_limit_db : float or None
        The spectrum is whitened by its noise floor, and lines more than this above the floor are cut down to it, so
        that steady mesh harmonics do not hide impulses in their band. None takes the signal as it is.

    Returns
    -------
    tuple of BandCandidate
        Sorted by falling kurtosis. A candidate within three standard errors of 0 is noise.

    Raises
    ------
    RefusalError
        If the signal is too short for any band.
    InputError
        On a wrong shape or rate.

    Notes
    -----
    One stray shock wins over a train of small ones: look at the envelope before believing the band.
    A train of impulses that repeats exactly is itself made of lines; the limit reduces, but keeps them.

    References
    ----------
    J. Antoni, "Fast computation of the kurtogram for the detection of transient faults", 2007. Antoni's filter bank
    is replaced by bands of the Fourier transform with raised-cosine edges.
    """
    x = checked_signal(values)
    fs = positive(sampling_rate_hz, "sampling_rate_hz", "Hz")
    low_limit = not_negative(lowest_hz, "lowest_hz", "Hz")
    lines = _whitened(x, fs, tone_limit_db)
    counts = _band_counts(len(lines), fs, narrowest_hz)
    found = [
        candidate
        for n_bands in counts
        for candidate in _candidates(lines, fs, n_bands)
        if candidate.low_hz >= low_limit - 1e-9
    ]
    if not found:
        raise RefusalError(
            f"{len(x)} samples are too few to compare bands", remedy=f"take {8 * FEWEST_ENVELOPE_SAMPLES} or more"
        )
    return tuple(sorted(found, key=lambda c: -c.kurtosis))


def _band_counts(n_lines: int, fs: float, narrowest_hz: float | None) -> list[int]:
    """Return 2, 3, 4, 6, 8, 12 … up to 64 bands or the narrowest allowed."""
    most = 64 if narrowest_hz is None else fs / 2 / positive(narrowest_hz, "narrowest_hz", "Hz")
    most = min(most, n_lines / FEWEST_ENVELOPE_SAMPLES)
    grid = sorted({2**k for k in range(1, 15)} | {3 * 2**k for k in range(14)})
    return [n for n in grid if n <= most * (1 + 1e-9)]


def _whitened(x: FloatArray, fs: float, tone_limit_db: float | None) -> ComplexArray:
    """Return the transform over its noise floor, its lines limited; without DC and Nyquist."""
    from scipy.fft import rfft

    lines: ComplexArray = rfft(x.astype(np.float64))[1 : (len(x) + 1) // 2]
    if tone_limit_db is None or len(lines) < 64:
        return lines
    power = lines.real**2 + lines.imag**2
    resolution = fs / len(x)
    raw = Spectrum(power, np.arange(len(power)) * resolution, "frequency", "power", "", resolution, 1.0, "", 1, "")
    floor = noise_floor(raw).values
    largest = 10.0 ** (not_negative(tone_limit_db, "tone_limit_db", "dB") / 10.0)
    gain: FloatArray = 1.0 / np.sqrt(np.maximum(floor, power / largest))
    lines *= gain
    return lines


def _candidates(lines: ComplexArray, fs: float, n_bands: int) -> list[BandCandidate]:
    from scipy.fft import ifft, next_fast_len

    per_band = len(lines) // n_bands
    taper = band_taper(per_band, 0.1)
    # Twice the band's lines: |z|² is then free of aliasing, and so is its mean square.
    padded = np.zeros((n_bands, next_fast_len(2 * per_band)), dtype=np.complex64)
    padded[:, :per_band] = _unit_power(lines[: n_bands * per_band]).reshape(n_bands, per_band) * taper
    z = ifft(padded, axis=1, overwrite_x=True)
    square = (z.real**2 + z.imag**2).astype(np.float64)
    mean = square.mean(axis=1)
    kurtosis = np.divide((square**2).mean(axis=1), mean**2, out=np.full(n_bands, 2.0), where=mean > 0) - 2.0
    # Var K ≈ 4/M for M independent complex Gaussian samples; the taper leaves Σw² of them.
    error = 2.0 / np.sqrt(float((taper**2).sum()))
    width = fs / 2 / n_bands
    return [
        BandCandidate(i * width, (i + 1) * width, float(np.log2(n_bands)), float(kurtosis[i]), error)
        for i in range(n_bands)
    ]


def _unit_power(lines: ComplexArray) -> ComplexArray:
    """Scale to a root mean square of 1 so that fourth powers fit single precision."""
    rms = np.sqrt(np.mean(lines.real**2 + lines.imag**2))
    return lines / rms if rms > 0 else lines
