"""Modes of a recording's channel, of a signal over angle, of a band's envelope."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gearsig.angle.types import AngleSignal
from gearsig.decompose.types import Modes, VmdSettings
from gearsig.decompose.vmd import variational_modes
from gearsig.recording.types import Recording
from gearsig.spectra.envelope import Envelope, EnvelopeKind, band_envelope


def channel_modes(
    recording: Recording, channel: str, settings: VmdSettings, *, rng: np.random.Generator | None = None
) -> Modes:
    """Return the modes of one channel over frequency; see `variational_modes`."""
    return variational_modes(
        recording.values(channel),
        recording.sampling_rate_hz,
        settings,
        rng=rng,
        unit=recording.channels[recording.index(channel)].unit,
        source=channel,
    )


def angle_modes(
    signal: AngleSignal, channel: str, settings: VmdSettings, *, rng: np.random.Generator | None = None
) -> Modes:
    """Return the modes of one channel over the shaft's angle: centres and bandwidths are orders.

    At variable speed an order stays one narrow mode, where over time it would be smeared.
    """
    return variational_modes(
        signal.values(channel),
        float(signal.samples_per_revolution),
        settings,
        rng=rng,
        axis="order",
        unit=signal.units[signal.channel_names.index(channel)],
        source=f"{channel} over angle",
        shaft=signal.shaft_angle.shaft,
    )


def envelope_modes(envelope: Envelope, settings: VmdSettings, *, rng: np.random.Generator | None = None) -> Modes:
    """Return the modes of an envelope, its mean taken out first and kept as `offset`.

    Centres are modulation frequencies, the sampling rate is the envelope's own. Without its mean the envelope shows
    the modulation alone; the mean would be a mode of its own that outweighs the others.
    """
    mean = float(envelope.values.mean(dtype=np.float64))
    modes = variational_modes(
        envelope.values - mean, envelope.sampling_rate_hz, settings, rng=rng, unit=envelope.unit, source=envelope.source
    )
    return replace(modes, offset=mean)


def channel_envelope_modes(
    recording: Recording,
    channel: str,
    band_hz: tuple[float, float],
    settings: VmdSettings,
    *,
    kind: EnvelopeKind = "magnitude",
    rng: np.random.Generator | None = None,
) -> Modes:
    """Return the modes of the envelope of one channel's band; see `envelope_modes` and `band_envelope`.

    The magnitude is in the channel's unit, and its modes are the amplitude modulation's own lines; the squared envelope
    adds their sums and differences.
    """
    unit = recording.channels[recording.index(channel)].unit
    values = recording.values(channel)
    envelope = band_envelope(values, recording.sampling_rate_hz, band_hz, kind=kind, unit=unit, source=channel)
    return envelope_modes(envelope, settings, rng=rng)
