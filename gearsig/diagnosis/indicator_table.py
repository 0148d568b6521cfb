"""All indicators of an analysis: per channel, per gear, per shaft, per bearing."""

from __future__ import annotations

from collections.abc import Iterator

from gearsig.diagnosis.envelopes import BandEnvelope
from gearsig.diagnosis.signals import ShaftSignals, Signals
from gearsig.errors import RefusalError
from gearsig.indicators.types import Indicator
from gearsig.orders.types import SynchronousAverage


def indicator_table(signals: Signals, envelopes: list[BandEnvelope]) -> tuple[Indicator, ...]:
    """Return every indicator that the recording and the rig allow, channel by channel."""
    return tuple(
        indicator
        for channel in signals.recording.channels
        for indicator in _of_channel(signals, channel.name, channel.unit, envelopes)
    )


def _of_channel(signals: Signals, name: str, unit: str, envelopes: list[BandEnvelope]) -> Iterator[Indicator]:
    from gearsig.indicators.time import time_indicators

    yield from time_indicators(signals.recording.values(name), name, unit)
    yield from _of_orders(signals, name)
    for shaft in signals.shafts:
        yield from time_indicators(
            shaft.averages[name].values, name, unit, computed_on="synchronous average", shaft=shaft.shaft
        )
        yield from _of_gears(signals, shaft, name)
    if signals.angle is not None:
        yield from _of_bearings(signals, name, envelopes)


def _of_orders(signals: Signals, name: str) -> Iterator[Indicator]:
    from gearsig.indicators.mesh import mesh_indicators
    from gearsig.indicators.shaft import shaft_indicators

    if name not in signals.order_excess:
        return
    spectrum = signals.order_excess[name].spectrum
    for pair in signals.rig.pairs:
        if signals.rig.mesh_order(pair) is not None:
            yield from mesh_indicators(spectrum, signals.rig, pair, channel=name)
    for shaft, order in signals.known_shaft_orders.items():
        yield from shaft_indicators(spectrum, shaft, shaft_ratio=order, channel=name)


def _of_gears(signals: Signals, shaft: ShaftSignals, name: str) -> Iterator[Indicator]:
    from gearsig.indicators.gear import gear_indicators

    if name not in shaft.separated:
        return
    parts = shaft.separated[name]
    for pair in signals.rig.pairs:
        if shaft.shaft not in (pair.driver, pair.driven) or (teeth := pair.teeth(shaft.shaft)) is None:
            continue
        yield from gear_indicators(
            parts.average,
            parts.residual,
            parts.difference,
            _band_passed(parts.average, teeth),
            teeth=teeth,
            gear=f"{pair.name}/{shaft.shaft}",
        )


def _band_passed(average: SynchronousAverage, teeth: int) -> SynchronousAverage | None:
    from gearsig.orders.separate import band_passed_mesh

    try:
        return band_passed_mesh(average, teeth)
    except RefusalError:  # the band reaches beyond the sampling rate
        return None


def _of_bearings(signals: Signals, name: str, envelopes: list[BandEnvelope]) -> Iterator[Indicator]:
    """Take the band whose envelope has the clearest lines; a quiet one would only state its floor."""
    from gearsig.indicators.bearing import bearing_indicators

    own = [e for e in envelopes if e.channel == name]
    if not own:
        return
    envelope = max(own, key=lambda e: float(e.excess.scores().sum()))
    band = f"{envelope.band_hz[0]:.0f} to {envelope.band_hz[1]:.0f} Hz"
    for bearing in signals.rig.bearings:
        ratio = signals.rig.ratio(bearing.shaft)
        if ratio is not None and bearing.orders():
            yield from bearing_indicators(envelope.excess.spectrum, bearing, shaft_ratio=ratio, channel=name, band=band)
