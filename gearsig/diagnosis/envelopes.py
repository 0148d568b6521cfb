"""Envelope spectra of several bands, where impacts of bearings show."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

from gearsig.diagnosis.comb import LineExcess
from gearsig.diagnosis.signals import Signals, floor_of
from gearsig.errors import InputError, RefusalError
from gearsig.recording.types import Recording

DIVISIONS = (1, 2, 6)
"""The spectrum is taken whole, in halves and in sixths: wide bands gather weak impacts, narrow ones leave out gears."""

LOWEST_BAND_HZ = 300.0
"""Below it shaft and first mesh harmonics rule; impacts of a bearing ring at structural resonances above."""


@dataclass(frozen=True)
class BandEnvelope:
    """Envelope spectrum of one band of one channel, with its floor.

    Parameters
    ----------
    channel : str
    band_hz : (float, float)
    excess : LineExcess
        Over order where the speed is known, else over frequency.
    mean : float
        Mean of the envelope: lines over it are modulation depths.
    """

    channel: str
    band_hz: tuple[float, float]
    excess: LineExcess
    mean: float


def bands(sampling_rate_hz: float) -> tuple[tuple[float, float], ...]:
    """Return bands of equal relative width, coarse and fine, that cover the spectrum up to 0.45 of the sampling rate.

    Several bands are searched instead of one chosen by its kurtosis: the kurtosis of a gearbox is as often that of the
    gears, and the family of lines itself says which band carries it.
    """
    top = 0.45 * sampling_rate_hz
    low = min(LOWEST_BAND_HZ, top / 4)
    edges = [[low * (top / low) ** (i / n) for i in range(n + 1)] for n in DIVISIONS]
    return tuple(band for division in edges for band in pairwise(division))


def band_envelopes(signals: Signals) -> Iterator[BandEnvelope]:
    """Yield the envelope spectra of all channels and bands."""
    for band in bands(signals.recording.sampling_rate_hz):
        yield from envelopes_in(signals, signals.recording, band)


def envelopes_in(signals: Signals, recording: Recording, band: tuple[float, float]) -> Iterator[BandEnvelope]:
    """Yield the envelope spectra of a recording's channels in one band; none if it is too narrow or too short.

    Over order where the speed is known: then a speed that varies does not smear them.
    """
    from gearsig.angle.resample import resample_to_angle
    from gearsig.orders.spectrum import order_spectrum
    from gearsig.spectra.amplitude import channel_spectrum
    from gearsig.spectra.envelope import envelope_recording

    try:
        envelopes = envelope_recording(recording, band, kind="magnitude")
    except InputError:
        return  # the record is too short for so narrow a band
    over_angle = None
    if signals.angle is not None:
        fastest = max(signals.known_shaft_orders.values(), default=1.0)
        highest = min(
            signals.settings.highest_modulation_order * fastest,
            0.4 * envelopes.sampling_rate_hz / signals.frequency_per_order_hz,
        )
        try:
            over_angle = resample_to_angle(envelopes, signals.angle, highest_order=highest)
        except (InputError, RefusalError):
            return  # the band is narrower than the modulations sought
    for name in envelopes.channel_names:
        spectrum = channel_spectrum(envelopes, name) if over_angle is None else order_spectrum(over_angle, name)
        yield BandEnvelope(name, band, floor_of(spectrum), float(envelopes.values(name).mean()))
