"""Envelope of a frequency band, decimated, and its spectrum."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from gearsig.checks import FloatArray, frozen_array, one_of, positive, within
from gearsig.errors import InputError
from gearsig.recording.types import Channel, Recording
from gearsig.spectra.amplitude import amplitude_spectrum
from gearsig.spectra.blocks import ComplexArray, checked_signal, squared_unit
from gearsig.spectra.types import Scaling, Spectrum

EnvelopeKind = Literal["magnitude", "squared"]


@dataclass(frozen=True)
class Envelope:
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
        object.__setattr__(self, "values", frozen_array(self.values, "values", ndim=1))


def band_envelope(
    values: FloatArray,
    sampling_rate_hz: float,
    band_hz: tuple[float, float],
    *,
    kind: EnvelopeKind = "squared",
    edge_fraction: float = 0.1,
    unit: str = "",
    source: str = "",
) -> Envelope:
    """Return the envelope of a frequency band, decimated to what the band needs.

    The band's lines of the Fourier transform, doubled, shifted to zero and transformed back give the complex
    envelope z; the result is |z| or |z|². The band is cut without phase shift; raised-cosine edges inside it keep
    ringing short. |z|² fits the new rate exactly; |z| is not band-limited and is sampled twice as densely.

    Parameters
    ----------
    values : array, (n_samples,)
    sampling_rate_hz : float
    band_hz : (float, float)
        Lower and upper limit, 0 ≤ lower < upper ≤ half the sampling rate.
    kind : str
        "squared" (its spectrum is exact, best for detection) or "magnitude" (in the signal's unit).
    edge_fraction : float
        0 (brick wall) to 0.5: part of the band that each edge takes.
    unit, source : str

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
    x = checked_signal(values, minimum=8)
    fs = positive(sampling_rate_hz, "sampling_rate_hz", "Hz")
    one_of(kind, "kind", ("magnitude", "squared"))
    within(edge_fraction, "edge_fraction", 0.0, 0.5)
    first, last = _band_lines(band_hz, fs, len(x))
    z = _complex_envelope(x, first, last, edge_fraction, 2 if kind == "squared" else 4)
    square = z.real**2 + z.imag**2
    return Envelope(
        values=square if kind == "squared" else np.sqrt(square),
        sampling_rate_hz=fs * len(z) / len(x),
        band_hz=(float(band_hz[0]), float(band_hz[1])),
        kind=kind,
        unit=squared_unit(unit) if kind == "squared" else unit,
        source=f"{kind} envelope {band_hz[0]:g}-{band_hz[1]:g} Hz of {source or 'signal'}",
    )


def envelope_spectrum(
    envelope: Envelope,
    *,
    window: str = "hann",
    scaling: Scaling = "amplitude peak",
    highest_hz: float | None = None,
) -> Spectrum:
    """Return the spectrum of an envelope over frequency, its mean removed.

    Parameters
    ----------
    envelope : Envelope
    window, scaling : str
        As in `amplitude_spectrum`.
    highest_hz : float or None
        Lines above it are left out.

    Returns
    -------
    Spectrum
        Over modulation frequency.
    """
    x = envelope.values - envelope.values.mean()
    spectrum = amplitude_spectrum(
        x, envelope.sampling_rate_hz, unit=envelope.unit, source=envelope.source, window=window, scaling=scaling
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
) -> Recording:
    """Return a recording whose channels are the band envelopes of the given one's vibration channels.

    It is what angular resampling takes to give an envelope spectrum over order. The speed source is dropped, since
    pulses do not survive the lower rate: find the shaft angle on the original.
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


def _complex_envelope(x: FloatArray, first: int, last: int, edge_fraction: float, oversampling: int) -> ComplexArray:
    """Return the band's complex envelope with about `oversampling` samples per line of the band."""
    from scipy.fft import ifft, next_fast_len, rfft

    n, n_band = len(x), last - first + 1
    m = next_fast_len(oversampling * n_band + 1)
    lines = np.zeros(m, dtype=np.complex128)
    lines[:n_band] = rfft(x.astype(np.float64))[first : last + 1]
    lines[:n_band] *= band_taper(n_band, edge_fraction)
    z: ComplexArray = ifft(lines, overwrite_x=True)
    z *= 2.0 * m / n
    return z


def band_taper(n_lines: int, edge_fraction: float) -> FloatArray:
    """Return ones with raised-cosine edges of `edge_fraction` of the band each."""
    n_edge = round(edge_fraction * n_lines)
    taper = np.ones(n_lines)
    if n_edge:
        edge = 0.5 - 0.5 * np.cos(np.pi * (np.arange(n_edge) + 0.5) / n_edge)
        taper[:n_edge], taper[n_lines - n_edge :] = edge, edge[::-1]
    return taper
