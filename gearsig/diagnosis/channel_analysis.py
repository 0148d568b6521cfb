"""What an analysis keeps of each channel: the signals that were looked at, and the bands that told most."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from gearsig.diagnosis.envelopes import BandEnvelope
from gearsig.diagnosis.own_band import OwnBand, witness
from gearsig.diagnosis.signals import Signals
from gearsig.diagnosis.types import ChannelAnalysis, Finding, Kind, OrderLevel
from gearsig.orders.types import SynchronousAverage


@dataclass(frozen=True)
class Material:
    """Everything that the detectors look at.

    Parameters
    ----------
    signals : Signals
    envelopes : list of BandEnvelope
        Of fixed bands.
    own_bands : tuple of OwnBand
        Bands that the kurtograms choose, at most one per channel.
    order_levels : mapping
        Channel → levels over speed, where the speed runs through a range.
    """

    signals: Signals
    envelopes: list[BandEnvelope]
    own_bands: tuple[OwnBand, ...]
    order_levels: Mapping[str, tuple[OrderLevel, ...]]


def channel_analysis(material: Material, name: str, findings: Sequence[Finding]) -> ChannelAnalysis:
    """Return the signals and spectra of one channel."""
    from gearsig.spectra.density import channel_density

    signals = material.signals
    envelope = _shown_envelope(material, name, findings)
    own = _telling_own_band(material, name, findings)
    return ChannelAnalysis(
        channel=name,
        spectrum=signals.spectra[name],
        power_density=channel_density(signals.recording, name),
        envelope_spectrum=envelope.excess.spectrum if envelope else None,
        envelope_band_hz=envelope.band_hz if envelope else None,
        order_spectrum=signals.order_excess[name].spectrum if name in signals.order_excess else None,
        order_map=signals.order_maps.get(name),
        averages=_averages(signals, name),
        kurtogram=own.kurtogram if own else None,
        kurtogram_band=own.band if own else None,
        order_levels=material.order_levels.get(name, ()),
    )


def _averages(signals: Signals, name: str) -> dict[tuple[str, str], SynchronousAverage]:
    averages = {}
    for shaft in signals.shafts:
        averages[shaft.shaft, "average"] = shaft.averages[name]
        if name in shaft.separated:
            parts = shaft.separated[name]
            for part in (parts.residual, parts.difference, parts.regular):
                averages[shaft.shaft, part.kind] = part
    return averages


def _shown_envelope(material: Material, name: str, findings: Sequence[Finding]) -> BandEnvelope | None:
    """Return the envelope in which the surest family of impacts was found, else the one whose lines stand out most."""
    every = [*material.envelopes, *(own.envelope for own in material.own_bands)]
    own = [e for e in every if e.channel == name]
    if not own:
        return None
    for finding in findings:
        for envelope in own:
            if finding.where.band_hz == envelope.band_hz and name in finding.where.channels:
                return envelope
    return max(own, key=lambda e: float(e.excess.scores().sum()))


def _telling_own_band(material: Material, name: str, findings: Sequence[Finding]) -> OwnBand | None:
    """Return the channel's own band where it shows a damage that is claimed of a bearing, on this channel."""
    own = next((band for band in material.own_bands if band.envelope.channel == name), None)
    places = [f.where for f in findings if f.where.bearing and f.kind in (Kind.FAULT, Kind.SUSPICION)]
    if own is None:
        return None
    orders = [where.order for where in places if name in where.channels and where.order is not None]
    return own if any(witness(own, order) for order in orders) else None
