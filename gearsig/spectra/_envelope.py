"""Decimated envelope of a frequency band, and its spectrum; the band is given or chosen by a kurtogram."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from gearsig.checks import ComplexArray, FloatArray, count, freeze, limits, one_of, positive, within
from gearsig.compiled import njit
from gearsig.errors import InputError, RefusalError
from gearsig.recording import Channel, Recording
from gearsig.results import Result
from gearsig.spectra._amplitude import Preparation, amplitude_spectrum, noise_floor, prepared_signal
from gearsig.spectra._coherence import SpectralCoherence, enhanced_envelope, spectral_coherence
from gearsig.spectra._kurtogram import BandCandidate, Kurtogram, kurtogram, kurtosis_error
from gearsig.spectra._types import BATCH_SAMPLES, Scaling, Spectrum, named_signal, squared_unit

EnvelopeKind = Literal["magnitude", "squared"]


@dataclass(frozen=True)
class Envelope(Result, columns=("time_s", "values")):
    """Envelope of a band as a time series with its own, lower sampling rate; sample 0 is at time 0.

    Parameters
    ----------
    values : array, (n_samples,)
        Magnitude of the band's analytic signal ("magnitude": for a sine, its amplitude), or the magnitude squared.
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
    continued: bool = False,
) -> Envelope:
    """Return the envelope of a frequency band, decimated to the lowest rate that the band allows.

    The band's Fourier lines are doubled, shifted to zero and transformed back, which gives the complex envelope z; the
    result is |z| or |z|². The filter has no phase shift; raised-cosine edges inside the band keep its ringing short.
    |z|² is represented exactly at the new rate; |z| is not band-limited and is sampled twice as densely.

    Parameters
    ----------
    signal : Recording or array, (n_samples,)
    channel_or_rate_hz : str or float
        A recording's channel, or an array's sampling rate in Hz.
    band_hz : (float, float)
        Lower and upper limit, 0 ≤ lower < upper ≤ half the sampling rate.
    kind : str
        "squared" (its spectrum is exact, best for detection) or "magnitude" (in the signal's unit).
    edge_fraction : float
        Fraction of the band that each edge occupies, 0 (brick wall) to 0.5.
    unit, source : str
    transform : array or None
        The `rfft` of `with_continuous_ends` of the signal, to reuse it for several bands of one signal.
    highest_hz : float or None
        Highest modulation frequency of interest. A magnitude that would be sampled much faster may be low-passed and
        returned at three times this frequency.
    continued : bool
        Whether to continue the signal even if its ends meet, so that the envelopes of several signals have one length.

    Returns
    -------
    Envelope

    Raises
    ------
    InputError
        On a band outside the spectrum or narrower than three lines.

    Notes
    -----
    The transform treats the signal as periodic: within about 1/bandwidth of either end, the envelope mixes both ends
    or, where they do not meet, each end with its reflection, see `with_continuous_ends`. The band must be wider than
    the highest modulation frequency of interest.

    References
    ----------
    R. B. Randall and J. Antoni, "Rolling element bearing diagnostics – a tutorial", 2011.
    """
    from scipy.fft import rfft

    x, fs, unit, source = named_signal(signal, channel_or_rate_hz, unit, source, minimum=8)
    one_of(kind, "kind", get_args(EnvelopeKind))
    within(edge_fraction, "edge_fraction", 0.0, 0.5)
    _band_lines(band_hz, fs, len(x))  # refuses early
    blocks = None
    if highest_hz is not None and kind == "magnitude" and edge_fraction > 0:
        blocks = _Blocks.of(band_hz, fs, edge_fraction, positive(highest_hz, "highest_hz", "Hz"), len(x))
    if blocks is not None and blocks.pay(has_transform=transform is not None):
        values, rate_hz = blocks.magnitude(x), fs * blocks.n_out / blocks.n
    else:
        known = rfft(with_continuous_ends(x, continued=continued)) if transform is None else transform
        n = joined_length(len(x), len(known))
        z = _complex_envelope(known, n, *_band_lines(band_hz, fs, n), edge_fraction, 2 if kind == "squared" else 4)
        rate_hz = fs * len(z) / n
        z = z[: len(x) * len(z) // n]
        values = z.real**2 + z.imag**2
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
    """Return the spectrum of an envelope over modulation frequency, with its mean removed.

    Parameters
    ----------
    signal : Envelope, Recording or array, (n_samples,)
    channel_or_rate_hz : str or float
        A recording's channel, or an array's sampling rate in Hz.
    band_hz : (float, float) or None
        For a recording or an array: the band whose envelope is taken. None takes the band with the largest kurtosis in
        the kurtogram, at least three times as wide as `highest_hz`.
    kind : str
        Kind of that envelope, see `band_envelope`.
    window, scaling : str
        As in `amplitude_spectrum`.
    highest_hz : float or None
        Lines above it are left out.

    Returns
    -------
    Spectrum
        Over modulation frequency.
    """
    if highest_hz is not None:
        positive(highest_hz, "highest_hz", "Hz")
    if isinstance(signal, Envelope):
        envelope = signal
    else:
        x, fs, unit, source = named_signal(signal, channel_or_rate_hz, "", "")
        if band_hz is None:
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
    n_lines = np.searchsorted(spectrum.positions, positive(highest_hz, "highest_hz", "Hz"), side="right")
    return spectrum.head(int(n_lines))


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
    """Return a recording whose channels are the band envelopes of the given recording's vibration channels.

    Resample it to the shaft angle for an envelope spectrum over order. The speed source is dropped, since pulses do
    not survive the lower rate: find the shaft angle on the original. `transforms` holds the `rfft` of each channel's
    `with_continuous_ends`, all or none of them continued, to reuse them for several bands; `highest_hz` is as in
    `band_envelope`.
    """
    names = tuple(channels) if channels is not None else recording.vibration_names()
    if not names:
        raise InputError("there is no channel to take the envelope of", remedy="name the channels")
    old = [recording.channels[recording.index(name)] for name in names]
    continued = transforms is None and not all(ends_meet(recording.values(name)) for name in names)
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
            continued=continued,
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
    low, high = limits(band_hz, "band_hz", "Hz")
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
    known: ComplexArray, n: int, first: int, last: int, edge_fraction: float, oversampling: int
) -> ComplexArray:
    """Return the band's complex envelope with about `oversampling` samples per line of the band, from n's `rfft`."""
    from scipy.fft import ifft, next_fast_len

    n_band = last - first + 1
    m = next_fast_len(oversampling * n_band + 1)
    lines = np.zeros(m, dtype=known.dtype)
    lines[:n_band] = known[first : last + 1]
    lines[:n_band] *= band_taper(n_band, edge_fraction)
    z: ComplexArray = ifft(lines, overwrite_x=True)
    z *= 2.0 * m / n
    return z


BEYOND_THE_ENDS = 2048
"""Number of samples by which a record is continued at either end."""


def reflected_ends(values: FloatArray, n_beyond: int = BEYOND_THE_ENDS) -> tuple[FloatArray, FloatArray]:
    """Return continuations of a record before its start and after its end: reflections there, which fade out.

    The reflections are odd, 2 x₀ - x₋ₖ, so that neither value nor slope has a step. A transform of the record alone
    joins its end to its start. If a strong slow component, such as hum, or a drift differs between the two, the step
    is a click in every band: impulsive noise that is not in the recording.

    Parameters
    ----------
    values : array, (n_samples,)
    n_beyond : int
        Below the number of samples.

    Returns
    -------
    (array, array)
        Each (n_beyond,), in chronological order.
    """
    rise = np.sin(0.5 * np.pi * np.arange(1, n_beyond + 1) / (n_beyond + 1)) ** 2
    before = (2.0 * values[0] - values[n_beyond:0:-1]) * rise
    after = (2.0 * values[-1] - values[-2 : -n_beyond - 2 : -1]) * rise[::-1]
    return before, after


def ends_meet(values: FloatArray) -> bool:
    """Whether the step from a record's end to its start is no larger than the largest step within it."""
    step = abs(values[0] - values[-1])
    parts = (values[i : i + BATCH_SAMPLES + 1] for i in range(0, len(values), BATCH_SAMPLES))
    return not step > 0.0 or any(np.any(np.abs(np.diff(part)) >= step) for part in parts)  # most often the first


def with_continuous_ends(values: FloatArray, *, continued: bool = False) -> FloatArray:
    """Return a record whose end meets its start, as a transform assumes: unchanged, or with its continuations.

    A record whose ends already meet (see `ends_meet`) is returned unchanged: what is periodic stays periodic. Otherwise
    the continuation after the end is appended, and the one before the start comes last; sample 0 keeps its index. The
    length, `joined_length`, then suits a fast transform.

    Parameters
    ----------
    values : array, (n_samples,)
    continued : bool
        Whether to continue the record even if its ends meet.

    Returns
    -------
    array, (n,)
        In the precision of the values.
    """
    if not continued and ends_meet(values):
        return values
    before, after = reflected_ends(values, min(BEYOND_THE_ENDS, len(values) - 1))
    joined = np.zeros(_continued_length(len(values)), dtype=values.dtype)
    joined[: len(values)] = values
    joined[len(values) : len(values) + len(after)] = after
    joined[len(joined) - len(before) :] = before
    return joined


def joined_length(n_samples: int, n_lines: int) -> int:
    """Return of how many samples a transform of `with_continuous_ends` is, from its number of lines."""
    return n_samples if n_lines == n_samples // 2 + 1 else _continued_length(n_samples)


def _continued_length(n_samples: int) -> int:
    from scipy.fft import next_fast_len

    return int(next_fast_len(n_samples + 2 * min(BEYOND_THE_ENDS, n_samples - 1), real=True))


PERIODS_OF_EDGE = 50
"""Length of the filter's ringing, in periods of the edge width: it decays as 1/n³ for a raised-cosine edge, to 1e-5."""


def edged_band(
    frequency_hz: FloatArray, band_hz: tuple[float, float], edge_hz: float
) -> tuple[NDArray[np.intp], FloatArray]:
    """Return the indices of a band's lines and its response there: 1 between raised-cosine edges inside the band.

    Parameters
    ----------
    frequency_hz : array, (n_lines,)
    band_hz : (float, float)
    edge_hz : float
        Width of each edge.
    """
    inside = np.clip(np.minimum(frequency_hz - band_hz[0], band_hz[1] - frequency_hz) / edge_hz, 0.0, 1.0)
    lines = np.flatnonzero(inside)
    return lines, np.sin(np.pi / 2 * inside[lines]) ** 2


@dataclass(frozen=True)
class _Blocks:
    """Blocks of a long signal that fit the processor's cache and overlap by the ringing of the filters.

    Each block is filtered to the band and transformed back at four times the bandwidth; a second pair of transforms
    low-passes and decimates its magnitude. The signal's ends are joined, as in a transform of the whole signal.

    Parameters
    ----------
    n, n_band, n_out : int
        Samples of a block, of its complex envelope and of its decimated magnitude; multiples of eight. An eighth
        overlaps at either end.
    first : int
        Line at the band's lower end.
    response, low_pass : arrays
        Responses of the band filter from that line on, and of the low-pass at the magnitude's lines.
    """

    n: int
    n_band: int
    n_out: int
    first: int
    response: FloatArray
    low_pass: FloatArray

    @classmethod
    def of(
        cls, band_hz: tuple[float, float], fs: float, edge_fraction: float, highest_hz: float, n_samples: int
    ) -> _Blocks | None:
        """Return the blocks, or None for fewer than eight; at low frequencies a block may exceed the whole signal."""
        edge_hz = edge_fraction * (band_hz[1] - band_hz[0])
        ringing = PERIODS_OF_EDGE * fs * (1.0 / edge_hz + 1.0 / highest_hz)
        n = 1 << max(13, int(np.ceil(np.log2(8 * ringing))))
        if 8 * n > n_samples:
            return None
        hertz = np.arange(n // 2) * fs / n
        lines, response = edged_band(hertz, band_hz, edge_hz)
        n_band, n_out = (_multiple_of_eight(k) for k in (4 * len(lines) + 1, 3 * highest_hz * n / fs))
        # 1 up to the highest modulation, 0 from twice that on, which would alias onto it.
        slow = np.clip(2.0 - hertz[: n_out // 2 + 1] / highest_hz, 0.0, 1.0)
        return cls(n, n_band, n_out, int(lines[0]), response, np.sin(np.pi / 2 * slow) ** 2)

    def pay(self, *, has_transform: bool) -> bool:
        """Whether blocks cost less than transforms of all samples; not for a narrow band of a known transform."""
        return self.n_band > (2 if has_transform else 1) * self.n_out and 2 * self.n_out <= self.n

    def magnitude(self, x: FloatArray) -> FloatArray:
        """Return the low-passed magnitude, `n_out` samples for `n` of the signal, computed in the signal's precision.

        Single precision adds noise of 2e-7 of the signal's rms, a few times the rounding of its samples.
        """
        from scipy.fft import ifft, irfft, rfft

        step, side = 3 * self.n // 4, self.n // 8
        before, after = (x[-side:], x[: self.n]) if ends_meet(x) else reflected_ends(x, side)
        joined = np.concatenate([before, x, after, np.zeros(self.n)], dtype=x.dtype, casting="same_kind")
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
            magnitude = np.empty(z.shape, precision)
            _magnitudes(z, magnitude)
            slow = rfft(magnitude, axis=1, overwrite_x=True)[:, : len(low_pass)]
            slow *= low_pass
            values[start : start + at_once] = irfft(slow, self.n_out, axis=1, overwrite_x=True)[:, inner]
        return values.reshape(-1)[: len(x) * self.n_out // self.n]


@njit(cache=True, nogil=True, fastmath=True)  # type: ignore[untyped-decorator,unused-ignore]
def _magnitudes(z, magnitudes):  # type: ignore[no-untyped-def]
    """Compute |z| in one pass; NumPy's `abs` also guards against overflow, which takes longer."""
    for i in range(z.shape[0]):
        for j in range(z.shape[1]):
            magnitudes[i, j] = np.sqrt(z[i, j].real * z[i, j].real + z[i, j].imag * z[i, j].imag)


def _multiple_of_eight(n: float) -> int:
    from scipy.fft import next_fast_len

    return 8 * int(next_fast_len(int(np.ceil(n / 8))))


def band_taper(n_lines: int, edge_fraction: float) -> FloatArray:
    """Return a taper of ones with raised-cosine edges, each `edge_fraction` of the band, (n_lines,)."""
    n_edge = round(edge_fraction * n_lines)
    taper = np.ones(n_lines)
    if n_edge:
        edge = 0.5 - 0.5 * np.cos(np.pi * (np.arange(n_edge) + 0.5) / n_edge)
        taper[:n_edge], taper[n_lines - n_edge :] = edge, edge[::-1]
    return taper


# --------------------
# The envelope in the band that the kurtogram chooses.
# --------------------


@dataclass(frozen=True)
class ChosenBand:
    """A band, the kurtogram that chose it, and the band's envelope and envelope spectrum.

    Parameters
    ----------
    band : BandCandidate
    kurtogram : Kurtogram
    envelope : Envelope
    spectrum : Spectrum
        Of the envelope, over modulation frequency.
    warnings : tuple of str
        Reasons to distrust the choice, if any.
    reason : str
        Why the band was chosen; empty if it was given.
    """

    band: BandCandidate
    kurtogram: Kurtogram
    envelope: Envelope
    spectrum: Spectrum
    warnings: tuple[str, ...]
    reason: str = ""


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
    """Return the envelope spectrum in the band that the channel's kurtogram chooses, or in a given band.

    Parameters
    ----------
    recording : Recording
    channel : str
    n_levels, preparation
        As in `kurtogram`. The envelope is taken of the prepared signal.
    narrowest_hz, lowest_hz, highest_hz : float
        As in `Kurtogram.best_band`.
    highest_modulation_hz : float or None
        Lines of the envelope spectrum above it are left out; the band is at least three times as wide.
    kind : str
        Of the envelope, "squared" or "magnitude".
    band_hz : (float, float) or None
        Overrides the choice; `narrowest_hz`, `lowest_hz` and `highest_hz` are then ignored. The whole spectrum is
        chosen only if no part of it fits.

    Returns
    -------
    ChosenBand

    Raises
    ------
    InputError
        As `kurtogram`; also if `band_hz` lies outside the spectrum, or `highest_modulation_hz` outside the range from
        8/duration to a sixth of the sampling rate.
    RefusalError
        As `kurtogram`; also if no band is allowed.
    """
    fs, unit = recording.sampling_rate_hz, recording.channels[recording.index(channel)].unit
    x = prepared_signal(recording.values(channel), fs, preparation)
    grid = kurtogram(x, fs, n_levels=n_levels, source=f"{channel}, {preparation}" if preparation != "none" else channel)
    if highest_modulation_hz is not None:
        highest = positive(highest_modulation_hz, "highest_modulation_hz", "Hz")
        if not 8 * fs / len(x) <= highest <= fs / 6.0:
            raise InputError(
                f"highest_modulation_hz is {highest:g} Hz",
                allowed=f"{8 * fs / len(x):.4g} Hz, 8 over the length, to {fs / 6.0:.4g} Hz, a third of the spectrum",
            )
        narrowest_hz = max(narrowest_hz, 3.0 * highest)
    reason = ""
    if band_hz is None:
        best = partial(grid.best_band, narrowest_hz=narrowest_hz, lowest_hz=lowest_hz, highest_hz=highest_hz)
        band = best()
        if band.level == 0:  # the full-band envelope mixes in low-frequency lines: take the best part, if one fits
            with suppress(RefusalError):
                band = best(with_whole=False)
        reason = _reason(grid, band, narrowest_hz, of_modulation=highest_modulation_hz is not None)
    else:
        band = _given_band(x, fs, band_hz)
    unit = "" if preparation == "whitened" else unit
    envelope = band_envelope(x, fs, band.band_hz, kind=kind, unit=unit, source=channel)
    spectrum = envelope_spectrum(envelope, highest_hz=highest_modulation_hz)
    return ChosenBand(band, grid, envelope, spectrum, grid.warnings(band), reason)


def _reason(grid: Kurtogram, band: BandCandidate, narrowest_hz: float, *, of_modulation: bool) -> str:
    """Return why a band was chosen, in particular where others have a larger kurtosis."""
    if band.level == 0:
        return "It is the whole spectrum: no part of it is wide enough."
    text = "It has the largest kurtosis"
    if narrowest_hz > 0.0:
        text += f" of the bands at least {narrowest_hz:.4g} Hz wide"
        text += ", three times the highest modulation" if of_modulation else ""
    narrower = grid.kurtosis[grid.bandwidth_hz < narrowest_hz * (1.0 - 1e-9)]
    if narrower.size and float(narrower.max()) > band.kurtosis:
        text += (
            f". Narrower ones reach {narrower.max():.3g}, but their envelopes are too slow to show so fast a modulation"
        )
    whole = float(grid.kurtosis[grid.level == 0].max(initial=-np.inf))
    if whole > band.kurtosis:
        text += f". The whole spectrum reaches {whole:.3g}, but is no band: impacts may ring all over it"
    return text + "."


def _given_band(values: FloatArray, sampling_rate_hz: float, band_hz: tuple[float, float]) -> BandCandidate:
    """Return a given band with its kurtosis as defined in `Kurtogram`.

    Raises
    ------
    InputError
        If the band lies outside the spectrum or holds fewer than three lines.
    RefusalError
        If there is no signal in the band.
    """
    square = band_envelope(values, sampling_rate_hz, band_hz, kind="squared").values
    mean = float(np.mean(square))
    if mean <= 0.0:
        raise RefusalError("there is no signal in the band", remedy="choose another band")
    n_bands = sampling_rate_hz / 2.0 / (band_hz[1] - band_hz[0])
    kurtosis = float(np.mean(np.square(square / mean))) - 2.0
    error = kurtosis_error(2, max(1, round(len(values) / n_bands)))
    return BandCandidate(float(band_hz[0]), float(band_hz[1]), float(np.log2(n_bands)), kurtosis, error)


# --------------------
# Which band's envelope shows a modulation best: comparison of kurtogram, spectral coherence and plain envelope.
# --------------------


LARGEST_SLIP = 0.02
"""Relative search range for a modulation's lines: slip moves bearing orders this far from their kinematic values."""


@dataclass(frozen=True)
class BandChoice:
    """A method and band for observing a modulation, and how clearly it shows there.

    Parameters
    ----------
    method : str
        "plain": the envelope of everything above the lowest carrier; "kurtogram": the envelope of its band; "coherence
        band": the envelope of the band in which the coherence at the modulation stands out; "enhanced": the mean
        squared coherence over all carriers.
    band_hz : (float, float)
    clarity_db : float
        Height of the harmonics' lines above the floor around them, averaged over the harmonics.
    modulation_hz : float
        The modulation frequency found within the slip.
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
    r"""Return the methods and bands that show a modulation of known frequency, the clearest first.

    Clarity is :math:`\frac{1}{K} \sum_k 20 \lg (A(k\alpha)/F(k\alpha))` over the first K harmonics, with A the line and
    F the floor of the same spectrum; for the squared coherence, a power, 10 lg.

    Parameters
    ----------
    signal : Recording or array, (n_samples,)
    channel_or_rate_hz : str or float
        A recording's channel, or an array's sampling rate in Hz.
    modulation_hz : float
        The modulation frequency, e.g. a bearing's ball pass frequency.
    n_harmonics : int
    slip : float
        Relative search range around it.
    preparation : str
        See `prepared_signal`.

    Returns
    -------
    tuple of BandChoice

    Raises
    ------
    InputError, RefusalError
        As for the spectra compared: on wrong shapes and on constant or too short signals.

    Notes
    -----
    The coherence band is chosen for this very modulation, so part of its clarity is chance: noise alone reaches about
    6 dB. The kurtogram ignores the modulation; where there are a few strong shocks, it chooses their band.

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
    clarity_db, found_hz = _clarity(enhanced.spectrum, alpha, n, slip, power=True)
    choices.append(BandChoice("enhanced", enhanced.band_hz, clarity_db, found_hz, enhanced.spectrum))
    return tuple(sorted(choices, key=lambda choice: -choice.clarity_db))


def coherence_band(
    coherence: SpectralCoherence, modulation_hz: float, *, n_harmonics: int = 3, slip: float = LARGEST_SLIP
) -> tuple[float, float]:
    r"""Return the carrier band in which the coherence at a modulation's harmonics stands out most, in Hz.

    .. math:: \max_{a, b} \; \frac{1}{\sqrt{b - a}} \sum_{i=a}^{b} \Big( \sum_k \gamma^2(k\alpha, f_i) - K/M \Big)

    This is the signal-to-noise ratio of the sum: under noise, each squared coherence has mean and scatter 1/M.

    Parameters
    ----------
    coherence : SpectralCoherence
    modulation_hz : float
        In the unit of the coherence's cyclic axis: Hz or orders.
    n_harmonics : int
    slip : float
        Relative range around it from which the clearest frequency is taken.

    Returns
    -------
    (float, float)
        Outer edges of the first and last carrier band; each is two spacings wide.
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
    width = max(band_hz[1] - band_hz[0], 2.5 * (n + 0.5) * alpha)  # an envelope cannot vary faster than its bandwidth
    middle = min(max(sum(band_hz) / 2, width / 2), fs / 2 - width / 2)
    band_hz = (max(middle - width / 2, 0.0), min(middle + width / 2, fs / 2))
    spectrum = envelope_spectrum(x, fs, band_hz=band_hz, highest_hz=(n + 0.5) * alpha)
    clarity_db, found_hz = _clarity(spectrum, alpha, n, slip, power=False)
    return BandChoice(method, band_hz, clarity_db, found_hz, spectrum)


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
