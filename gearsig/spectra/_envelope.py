"""Envelope of a frequency band, decimated, and its spectrum."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from gearsig.checks import FloatArray, freeze, one_of, positive, within
from gearsig.errors import InputError
from gearsig.recording import Channel, Recording
from gearsig.results import Result
from gearsig.spectra._amplitude import amplitude_spectrum, floor_of_powers
from gearsig.spectra._types import (
    BATCH_SAMPLES,
    ComplexArray,
    Scaling,
    Spectrum,
    checked_signal,
    named_signal,
    squared_unit,
)

EnvelopeKind = Literal["magnitude", "squared"]


@dataclass(frozen=True)
class Envelope(Result, columns=("time_s", "values")):
    """Envelope of a band as a time series of its own, lower sampling rate; sample 0 is at time 0.

    Parameters
    ----------
    values : array, (n_samples,)
        Magnitude of the band's analytic signal ("magnitude": the amplitude of a sine), or its square.
    sampling_rate_hz : float
    band_hz : (float, float)
    kind : str
    unit, source : str
    """

    values: FloatArray
    sampling_rate_hz: float
    band_hz: tuple[float, float]
    kind: EnvelopeKind
    unit: str
    source: str

    def __post_init__(self) -> None:
        freeze(self, "values")

    @property
    def time_s(self) -> FloatArray:
        """Times of the samples from 0, (n_samples,)."""
        return np.arange(len(self.values)) / self.sampling_rate_hz


def band_envelope(
    signal: FloatArray | Recording,
    channel_or_rate_hz: str | float,
    band_hz: tuple[float, float],
    *,
    kind: EnvelopeKind = "squared",
    edge_fraction: float = 0.1,
    unit: str = "",
    source: str = "",
    transform: ComplexArray | None = None,
    highest_hz: float | None = None,
) -> Envelope:
    """Return the envelope of a frequency band, decimated to what the band needs.

    The band's lines of the Fourier transform, doubled, shifted to zero and transformed back give the complex
    envelope z; the result is |z| or |z|². The band is cut without phase shift; raised-cosine edges inside it keep
    ringing short. |z|² fits the new rate exactly; |z| is not band-limited and is sampled twice as densely.

    Parameters
    ----------
    signal : Recording or array, (n_samples,)
    channel_or_rate_hz : str or float
        The channel of a recording; of an array its sampling rate in Hz.
    band_hz : (float, float)
        Lower and upper limit, 0 ≤ lower < upper ≤ half the sampling rate.
    kind : str
        "squared" (its spectrum is exact, best for detection) or "magnitude" (in the signal's unit).
    edge_fraction : float
        0 (brick wall) to 0.5: part of the band that each edge takes.
    unit, source : str
    transform : array, (n_samples // 2 + 1,), or None
        The signal's `rfft`, where several bands of one signal are wanted.
    highest_hz : float or None
        Highest modulation of interest: a magnitude that is sampled much faster than that needs may come at three times
        this frequency, without what is faster.

    Returns
    -------
    Envelope

    Raises
    ------
    InputError
        On a band outside the spectrum or narrower than three lines.

    Notes
    -----
    The transform takes the signal as periodic: within about 1/bandwidth of either end the envelope mixes both ends.
    The band must be wider than the modulation sought.

    References
    ----------
    R. B. Randall and J. Antoni, "Rolling element bearing diagnostics – a tutorial", 2011.
    """
    x, fs, unit, source = named_signal(signal, channel_or_rate_hz, unit, source, minimum=8)
    one_of(kind, "kind", ("magnitude", "squared"))
    within(edge_fraction, "edge_fraction", 0.0, 0.5)
    first, last = _band_lines(band_hz, fs, len(x))
    blocks = None
    if highest_hz is not None and kind == "magnitude" and edge_fraction > 0:
        blocks = _Blocks.of(band_hz, fs, edge_fraction, positive(highest_hz, "highest_hz", "Hz"))
    if blocks is not None and blocks.pay(len(x), transform is not None):
        values, rate_hz = blocks.magnitude(x), fs * blocks.n_out / blocks.n
    else:
        z = _complex_envelope(x, first, last, edge_fraction, 2 if kind == "squared" else 4, transform)
        values, rate_hz = z.real**2 + z.imag**2, fs * len(z) / len(x)
        if kind == "magnitude":
            np.sqrt(values, out=values)
    return Envelope(
        values=values,
        sampling_rate_hz=rate_hz,
        band_hz=(float(band_hz[0]), float(band_hz[1])),
        kind=kind,
        unit=squared_unit(unit) if kind == "squared" else unit,
        source=f"{kind} envelope {band_hz[0]:g}-{band_hz[1]:g} Hz of {source or 'signal'}",
    )


def envelope_spectrum(
    signal: Envelope | Recording | FloatArray,
    channel_or_rate_hz: str | float = "",
    *,
    band_hz: tuple[float, float] | None = None,
    kind: EnvelopeKind = "squared",
    window: str = "hann",
    scaling: Scaling = "amplitude peak",
    highest_hz: float | None = None,
) -> Spectrum:
    """Return the spectrum of an envelope over frequency, its mean removed.

    Parameters
    ----------
    signal : Envelope, Recording or array, (n_samples,)
    channel_or_rate_hz : str or float
        The channel of a recording; of an array its sampling rate in Hz.
    band_hz : (float, float) or None
        Of a recording or an array: the band whose envelope is taken; None takes the most impulsive one of the signal's
        kurtogram, at least three times as wide as `highest_hz`.
    kind : str
        Of that envelope, see `band_envelope`.
    window, scaling : str
        As in `amplitude_spectrum`.
    highest_hz : float or None
        Lines above it are left out.

    Returns
    -------
    Spectrum
        Over modulation frequency.
    """
    if isinstance(signal, Envelope):
        envelope = signal
    else:
        x, fs, unit, source = named_signal(signal, channel_or_rate_hz, "", "")
        if band_hz is None:
            from gearsig.spectra._kurtogram import kurtogram  # it takes this module's envelopes

            band_hz = kurtogram(x, fs).best_band(narrowest_hz=3.0 * (highest_hz or 0.0)).band_hz
        envelope = band_envelope(x, fs, band_hz, kind=kind, unit=unit, source=source)
    spectrum = amplitude_spectrum(
        envelope.values - envelope.values.mean(),
        envelope.sampling_rate_hz,
        unit=envelope.unit,
        source=envelope.source,
        window=window,
        scaling=scaling,
    )
    if highest_hz is None:
        return spectrum
    keep = spectrum.positions <= positive(highest_hz, "highest_hz", "Hz")
    return replace(spectrum, values=spectrum.values[keep], positions=spectrum.positions[keep])


def envelope_recording(
    recording: Recording,
    band_hz: tuple[float, float],
    *,
    channels: Iterable[str] | None = None,
    kind: EnvelopeKind = "squared",
    edge_fraction: float = 0.1,
    transforms: Mapping[str, ComplexArray] | None = None,
    highest_hz: float | None = None,
) -> Recording:
    """Return a recording whose channels are the band envelopes of the given one's vibration channels.

    It is what angular resampling takes to give an envelope spectrum over order. The speed source is dropped, since
    pulses do not survive the lower rate: find the shaft angle on the original. `transforms` holds the `rfft` of each
    channel, where several bands of one recording are wanted; `highest_hz` is as of `band_envelope`.
    """
    names = tuple(channels) if channels is not None else recording.vibration_names()
    if not names:
        raise InputError("there is no channel to take the envelope of", remedy="name the channels")
    old = [recording.channels[recording.index(name)] for name in names]
    envelopes = [
        band_envelope(
            recording.values(c.name),
            recording.sampling_rate_hz,
            band_hz,
            kind=kind,
            edge_fraction=edge_fraction,
            unit=c.unit,
            source=c.name,
            transform=None if transforms is None else transforms[c.name],
            highest_hz=highest_hz,
        )
        for c in old
    ]
    step = f"{kind} envelope {band_hz[0]:g}-{band_hz[1]:g} Hz"
    history = (*recording.provenance.history, step)
    return replace(
        recording,
        samples=np.stack([e.values for e in envelopes]),
        sampling_rate_hz=envelopes[0].sampling_rate_hz,
        channels=tuple(
            Channel(c.name, "unknown" if kind == "squared" else c.quantity, e.unit, c.position)
            for c, e in zip(old, envelopes, strict=True)
        ),
        speed=None,
        provenance=replace(recording.provenance, history=history),
    )


def _band_lines(band_hz: tuple[float, float], fs: float, n: int) -> tuple[int, int]:
    low, high = float(band_hz[0]), float(band_hz[1])
    if not 0.0 <= low < high <= fs / 2:
        raise InputError(
            f"band is {low:g} to {high:g} Hz", allowed=f"0 <= lower < upper <= {fs / 2:g} Hz (half the sampling rate)"
        )
    first, last = int(np.ceil(low * n / fs)), int(np.floor(high * n / fs))
    first, last = max(first, 1), min(last, (n - 1) // 2)  # DC and Nyquist have no analytic counterpart
    if last - first < 2:
        raise InputError(
            f"band {low:g} to {high:g} Hz holds fewer than three lines of {fs / n:g} Hz",
            remedy="widen the band or take a longer signal",
        )
    return first, last


def _complex_envelope(
    x: FloatArray, first: int, last: int, edge_fraction: float, oversampling: int, transform: ComplexArray | None = None
) -> ComplexArray:
    """Return the band's complex envelope with about `oversampling` samples per line of the band."""
    from scipy.fft import ifft, next_fast_len, rfft

    n, n_band = len(x), last - first + 1
    m = next_fast_len(oversampling * n_band + 1)
    known = rfft(x.astype(np.float64)) if transform is None else transform
    lines = np.zeros(m, dtype=known.dtype)
    lines[:n_band] = known[first : last + 1]
    lines[:n_band] *= band_taper(n_band, edge_fraction)
    z: ComplexArray = ifft(lines, overwrite_x=True)
    z *= 2.0 * m / n
    return z


PERIODS_OF_EDGE = 50
"""Of the width of a raised-cosine edge, beyond which the filter's response is 1e-5."""


@dataclass(frozen=True)
class _Blocks:
    """Blocks of a long signal that overlap by what its filters ring: they stay near the processor.

    Each is cut to the band and transformed back at four times the bandwidth; its magnitude is low-passed and thinned
    out by a second pair of transforms. The ends of the signal are joined, as by a transform of all of it.

    Parameters
    ----------
    n, n_band, n_out : int
        Samples of a block, of its complex envelope, and of what is left of its magnitude; multiples of eight. An eighth
        at either end overlaps.
    first : int
        Line at the band's lower end.
    response, low_pass : arrays
        Of the lines from there on, and of the magnitude's lines.
    """

    n: int
    n_band: int
    n_out: int
    first: int
    response: FloatArray
    low_pass: FloatArray

    @classmethod
    def of(cls, band_hz: tuple[float, float], fs: float, edge_fraction: float, highest_hz: float) -> _Blocks:
        low_hz, high_hz = band_hz
        edge_hz = edge_fraction * (high_hz - low_hz)
        ringing = PERIODS_OF_EDGE * fs * (1.0 / edge_hz + 1.0 / highest_hz)
        n = 1 << max(13, int(np.ceil(np.log2(8 * ringing))))
        hertz = np.arange(n // 2) * fs / n
        inside = np.clip(np.minimum(hertz - low_hz, high_hz - hertz) / edge_hz, 0.0, 1.0)
        lines = np.flatnonzero(inside)
        n_band, n_out = (_multiple_of_eight(k) for k in (4 * len(lines) + 1, 3 * highest_hz * n / fs))
        # Full up to the highest modulation, nothing from twice that on, which would be mirrored to it.
        slow = np.clip(2.0 - hertz[: n_out // 2 + 1] / highest_hz, 0.0, 1.0)
        response = np.sin(np.pi / 2 * inside[lines]) ** 2
        return cls(n, n_band, n_out, int(lines[0]), response, np.sin(np.pi / 2 * slow) ** 2)

    def pay(self, n_samples: int, has_transform: bool) -> bool:
        """Whether blocks cost less than transforms of all samples; a narrow band of a known transform does not."""
        is_slow = self.n_band > (2 if has_transform else 1) * self.n_out and 2 * self.n_out <= self.n
        return is_slow and 8 * self.n <= n_samples

    def magnitude(self, x: FloatArray) -> FloatArray:
        """Return the low-passed magnitude, `n_out` samples for `n` of the signal, computed in the signal's precision.

        Single precision adds noise 2e-7 of the signal's rms, a few times what its samples were rounded by.
        """
        from scipy.fft import ifft, irfft, rfft

        step, side = 3 * self.n // 4, self.n // 8
        joined = np.concatenate([x[-side:], x, x[: self.n]])
        blocks = np.lib.stride_tricks.sliding_window_view(joined, self.n)[: len(x) : step]
        inner = slice(self.n_out // 8, 7 * self.n_out // 8)
        values = np.empty((len(blocks), 3 * self.n_out // 4))
        at_once = max(4, BATCH_SAMPLES // self.n // 4)  # transforms go four abreast
        precision = np.result_type(x.dtype, np.float32)
        response = self.response.astype(precision)
        low_pass = (self.low_pass * (2.0 * self.n_out / self.n)).astype(precision)
        for start in range(0, len(blocks), at_once):
            lines = rfft(blocks[start : start + at_once].astype(precision), axis=1, overwrite_x=True)
            band = np.zeros((len(lines), self.n_band), dtype=lines.dtype)
            band[:, : len(response)] = lines[:, self.first : self.first + len(response)] * response
            z = ifft(band, axis=1, overwrite_x=True)
            magnitude = z.real**2
            magnitude += z.imag**2
            slow = rfft(np.sqrt(magnitude, out=magnitude), axis=1, overwrite_x=True)[:, : len(low_pass)]
            slow *= low_pass
            values[start : start + at_once] = irfft(slow, self.n_out, axis=1, overwrite_x=True)[:, inner]
        return values.reshape(-1)[: len(x) * self.n_out // self.n]


def _multiple_of_eight(n: float) -> int:
    from scipy.fft import next_fast_len

    return 8 * int(next_fast_len(int(np.ceil(n / 8))))


def band_taper(n_lines: int, edge_fraction: float) -> FloatArray:
    """Return ones with raised-cosine edges of `edge_fraction` of the band each."""
    n_edge = round(edge_fraction * n_lines)
    taper = np.ones(n_lines)
    if n_edge:
        edge = 0.5 - 0.5 * np.cos(np.pi * (np.arange(n_edge) + 0.5) / n_edge)
        taper[:n_edge], taper[n_lines - n_edge :] = edge, edge[::-1]
    return taper


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


Preparation = Literal["none", "tones removed", "whitened"]
PREPARATIONS = ("none", "tones removed", "whitened")


def prepared_signal(values: FloatArray, sampling_rate_hz: float, preparation: Preparation) -> FloatArray:
    """Return a signal without its steady tones, or with all lines equally strong.

    Parameters
    ----------
    values : array, (n_samples,)
    sampling_rate_hz : float
    preparation : str
        "none"; "tones removed": lines of the whole signal's spectrum more than 13 dB above the floor are cut down to
        the floor, phases kept, which takes out mesh and shaft harmonics of a steady speed; "whitened": every line is
        divided by its magnitude (cepstral prewhitening), which takes out tones and resonances alike.

    Returns
    -------
    array, (n_samples,)
        In the signal's unit; dimensionless with a mean square of 1 where whitened. Without mean.

    Notes
    -----
    Impulses that repeat exactly are lines themselves and go with the tones; a bearing's slip keeps them. Where the
    speed drifts by more than a line, harmonics are no lines: average over the shaft angle, and take the residual.

    References
    ----------
    P. Borghesani, P. Pennacchi, R. B. Randall, N. Sawalhi and R. Ricci, "Application of cepstrum pre-whitening for
    the diagnosis of bearing faults under variable speed conditions", 2013.
    """
    from scipy.fft import irfft, rfft

    x = checked_signal(values, minimum=64)
    positive(sampling_rate_hz, "sampling_rate_hz", "Hz")
    if one_of(preparation, "preparation", PREPARATIONS) == "none":
        return x
    return np.asarray(irfft(prepared_lines(rfft(x.astype(np.float64)), preparation), len(x), overwrite_x=True))


def prepared_lines(transform: ComplexArray, preparation: Preparation) -> ComplexArray:
    """Return the `rfft` of what `prepared_signal` makes of a signal, from the signal's own.

    Parameters
    ----------
    transform : array, (n_samples // 2 + 1,)
    preparation : str
        As of `prepared_signal`.

    Returns
    -------
    array, (n_samples // 2 + 1,)
        Another array, in the transform's precision.
    """
    lines = transform.copy()
    if preparation == "none":
        return lines
    lines[0] = 0.0
    power = lines.real**2 + lines.imag**2
    if preparation == "tones removed":
        floor = floor_of_powers(power)
        tones = power > 20.0 * floor  # of noise, one line in e²⁰, half a billion, gets there
        lines[tones] *= np.sqrt(floor[tones] / power[tones])
    else:
        level = np.sqrt(2.0 * (len(lines) - 1.0))  # gives a mean square of about 1
        magnitude = np.abs(lines)
        lines *= np.divide(level, magnitude, out=np.zeros_like(magnitude), where=magnitude > 0)
    return lines
