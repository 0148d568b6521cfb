"""Features of the floor and of the amplitudes' distribution."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from gearsig.gap.gathered import ChannelSums, Gathered
from gearsig.gap.gear_lines import Feature, decibel

LEAST_SHARE = 1e-6
"""Below one sample of any record."""


def broadband_features(gathered: Gathered, channels: Sequence[ChannelSums]) -> Iterator[Feature]:
    """Yield band levels and kurtosis of the residual, tail figures of the raw signal, in dB; means over channels."""
    moments = np.stack([c.moments.mean(axis=0) for c in channels])  # (channel, band, moment)
    squares = np.log10(np.maximum(moments[:, :, 0], 1e-300)).mean(axis=0) * 10.0
    kurtosis = np.log10(np.maximum(moments[:, :, 1] / np.maximum(moments[:, :, 0], 1e-300) ** 2, 1e-3)) * 10.0
    for i in range(len(gathered.bands_hz) - 1):
        yield f"floor.band.{i + 1}", float(squares[i])
        yield f"floor.kurtosis.{i + 1}", float(kurtosis[:, i].max())
    yield "floor.total", float(squares[-1])
    raw = np.stack([c.tail.mean(axis=0) for c in channels])
    yield "floor.to_signal", float(squares[-1] - 10.0 * np.log10(raw[:, 0]).mean())
    yield "raw.level", float(10.0 * np.log10(raw[:, 0]).mean())
    yield "raw.kurtosis", float((10.0 * np.log10(raw[:, 1] / raw[:, 0] ** 2)).min())
    # Without the block that holds the extreme, the share may be 0.
    yield "raw.near_the_extreme", decibel(max(float(raw[:, 2].max()), LEAST_SHARE))


def speed_features(gathered: Gathered) -> Iterator[Feature]:
    """Yield the figures of the speed and of the supply's hum."""
    drift, swing, line, _ = gathered.speed
    yield "speed.drift", decibel(abs(drift) + 1e-5) * 2.0
    yield "speed.swing", decibel(swing + 1e-6) * 2.0
    yield "speed.swing_line", decibel(line)
    yield "hum", max(gathered.hum)
