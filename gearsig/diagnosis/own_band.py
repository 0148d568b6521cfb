"""The band that a channel's own kurtogram chooses: searched beside the fixed ones, and a witness for bearings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from gearsig.diagnosis.comb import Comb, best_comb
from gearsig.diagnosis.envelopes import BandEnvelope, envelopes_in
from gearsig.diagnosis.signals import Signals
from gearsig.errors import RefusalError
from gearsig.spectra.band_choice import BandCandidate
from gearsig.spectra.kurtogram_types import Kurtogram

N_HARMONICS = 6
"""Of the fastest race, which the band must be wide enough to carry."""

SAME_FAMILY = 3e-3
"""Relative: the same bearing slips alike in all bands."""

SHOWS = 0.01
"""p-value of a family at a given order in this one band, from which on it bears the other bands out."""

FEWEST_LINES = 3

ROUNDING = 1e-9
"""Of the signal: what is left without its tones and lies below is no vibration."""


@dataclass(frozen=True)
class OwnBand:
    """A channel's kurtogram, the band it chooses, and the envelope there.

    Parameters
    ----------
    kurtogram : Kurtogram
        Of the channel without its steady tones.
    band : BandCandidate
        The most impulsive one that is wide enough.
    envelope : BandEnvelope
    """

    kurtogram: Kurtogram
    band: BandCandidate
    envelope: BandEnvelope

    @property
    def text(self) -> str:
        """The band in words."""
        low, high = self.band.band_hz
        return (
            f"The kurtogram's own band, {low / 1000:.3g} to {high / 1000:.3g} kHz (kurtosis {self.band.kurtosis:.2g})"
        )


def own_bands(signals: Signals) -> tuple[OwnBand, ...]:
    """Return each channel's own band; none where no bearing's speed is known or no band is wide enough."""
    races = [
        ratio * order
        for bearing in signals.rig.bearings
        if (ratio := signals.rig.ratio(bearing.shaft)) is not None
        for name, order in bearing.orders().items()
        if name == "BPFI"
    ]
    if signals.angle is None or not races:
        return ()
    narrowest_hz = N_HARMONICS * max(races) * signals.frequency_per_order_hz
    found = (_own_band(signals, name, narrowest_hz) for name in signals.recording.channel_names)
    return tuple(own for own in found if own is not None)


def witness(own: OwnBand, order: float) -> Comb | None:
    """Return the family at an order found elsewhere, if the own band shows it too."""
    comb = best_comb(own.envelope.excess, order * (1 - SAME_FAMILY), order * (1 + SAME_FAMILY))
    return comb if comb is not None and comb.p_value <= SHOWS and len(comb.positions) >= FEWEST_LINES else None


def witness_text(bands: Sequence[OwnBand], channel: str, band_hz: tuple[float, float], order: float) -> tuple[str, ...]:
    """Say what a channel's own band shows of a family found at `order` in the band `band_hz`."""
    own = next((b for b in bands if b.envelope.channel == channel), None)
    if own is None:
        return ()
    comb = witness(own, order)
    if comb is None:
        return (f"{own.text}, does not show it.",)
    largest = f"{max(comb.ratios_db):.0f} dB over its floor"
    if own.envelope.band_hz == band_hz:
        return (f"{own.text}, shows it clearest of all bands, {largest}.",)
    return (f"{own.text}, shows the same family, {largest}.",)


def _own_band(signals: Signals, channel: str, narrowest_hz: float) -> OwnBand | None:
    from gearsig.spectra.kurtogram import kurtogram
    from gearsig.spectra.kurtogram_preparation import prepared_signal

    fs = signals.recording.sampling_rate_hz
    recorded = signals.recording.values(channel)
    x = prepared_signal(recorded, fs, "tones removed")
    if np.std(x) < ROUNDING * np.std(recorded):
        return None  # a model's tones are all there is: what is left of them are the rounding errors of their removal
    try:
        grid = kurtogram(x, fs, source=f"{channel}, tones removed")
        band = grid.best_band(narrowest_hz=narrowest_hz)
    except RefusalError:  # the record is too short, or the races too fast for the sampling rate
        return None
    without_tones = replace(signals.recording.select([channel]), samples=x[None, :])
    envelope = next(envelopes_in(signals, without_tones, band.band_hz), None)
    return None if envelope is None else OwnBand(grid, band, envelope)
