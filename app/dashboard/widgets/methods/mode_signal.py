"""What is taken apart into modes: the signal over time, over the shaft's angle, or the envelope of a band."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from app.dashboard import state
from app.dashboard.widgets.methods.choice import choose_one
from app.dashboard.widgets.methods.stretch import Stretch
from app.dashboard.widgets.methods.uniform_signal import signal_of
from app.dashboard.widgets.range_slider import choose_range
from gearsig.checks import FloatArray
from gearsig.diagnosis.types import Analysis, ChannelAnalysis

if TYPE_CHECKING:
    from gearsig.decompose.types import ModeAxis

KINDS = ("Signal", "Envelope", "Over angle")
USUAL_BAND = (0.5, 0.9)
"""Of half the sampling rate, where the analysis found no band that carries impacts."""


@dataclass(frozen=True)
class ModeSignal:
    """Samples at equal steps of time or angle, the first at `start`; `key` stands for all of it."""

    values: FloatArray
    rate: float
    axis: ModeAxis
    unit: str
    source: str
    key: str
    shaft: str = ""
    offset: float = 0.0
    start: float = 0.0
    quantity: str = "unknown"


def choose_signal(analysis: Analysis, channel: ChannelAnalysis, stretch: Stretch) -> ModeSignal:
    """Let the user choose what of the stretch is taken apart."""
    kinds = KINDS if stretch.angle is not None else KINDS[:2]
    about = "The envelope of a band shows what modulates it. Over the shaft's angle, centres are orders."
    kind = choose_one("Modes of", kinds, state.view_key(f"modes of {kinds}", analysis), about=about)
    if kind == "Envelope":
        return _envelope(analysis, channel, stretch)
    if kind == "Over angle" and stretch.angle is not None:
        return _over_angle(stretch)
    recording = stretch.recording
    return ModeSignal(
        recording.values(stretch.channel),
        recording.sampling_rate_hz,
        "frequency",
        stretch.unit,
        stretch.channel,
        stretch.key,
        start=stretch.start_s,
        quantity=recording.channels[0].quantity,
    )


def _envelope(analysis: Analysis, channel: ChannelAnalysis, stretch: Stretch) -> ModeSignal:
    from gearsig.spectra.envelope import band_envelope

    rate = stretch.recording.sampling_rate_hz
    usual = channel.envelope_band_hz or (USUAL_BAND[0] * rate / 2.0, USUAL_BAND[1] * rate / 2.0)
    band = choose_range("Band of the envelope (Hz)", analysis, rate / 2.0, shown=usual, name=f"modes {channel.channel}")
    envelope = band_envelope(
        stretch.recording.values(stretch.channel),
        rate,
        band,
        kind="magnitude",
        unit=stretch.unit,
    )
    # Its mean would be a mode of its own that outweighs the others.
    mean = float(envelope.values.mean())
    key = f"{stretch.key} envelope {band!r}"
    values = envelope.values - mean
    return ModeSignal(
        values,
        envelope.sampling_rate_hz,
        "frequency",
        envelope.unit,
        envelope.source,
        key,
        offset=mean,
        start=stretch.start_s,
    )


def _over_angle(stretch: Stretch) -> ModeSignal:
    signal = signal_of(stretch, over_angle=True)
    return ModeSignal(
        signal.values,
        signal.rate,
        "order",
        stretch.unit,
        stretch.channel,
        f"{stretch.key} angle",
        signal.shaft,
        start=signal.start,
        quantity=stretch.recording.channels[0].quantity,
    )
