"""Blows in a vibration signal of a machine that starts and stops: when, and at which angle."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gearsig.checks import FloatArray, positive
from gearsig.errors import InputError

WINDOW_S = 2e-3
DEAD_S = 4e-3
"""A blow rings; the next one is looked for after this time, where it stands out of the ringing."""
FACTOR = 8.0
"""Over the quiet level: white noise does not reach it in an hour."""
RISE = 2.0
"""Over the level just before: a blow begins at once, ringing does not."""
LEAST_PART = 0.35
"""Of the hardest blow: below it teeth that merely take up their load are counted as well."""


@dataclass(frozen=True)
class Burst:
    """A blow: time of its beginning and largest magnitude in its first milliseconds."""

    time_s: float
    peak: float


def find_bursts(values: FloatArray, sampling_rate_hz: float) -> tuple[Burst, ...]:
    """Find where a vibration rises at once, far over its quiet level.

    Those below a third of the hardest are left out. The level is the root mean square over 2 ms; quiet is its 20 %
    quantile, which a machine that stands now and then has.

    Raises
    ------
    InputError
        If the rate is below 2 kHz: a blow would be a single sample.
    """
    positive(sampling_rate_hz, "sampling_rate_hz", "Hz")
    if sampling_rate_hz < 2000.0:
        raise InputError(f"sampling_rate_hz is {sampling_rate_hz:g} Hz", allowed="2 kHz and more")
    n = max(2, round(WINDOW_S * sampling_rate_hz))
    if len(values) < 20 * n:
        raise InputError(f"{len(values)} samples are too few", allowed=f"{20 * n} or more")
    centred = values - np.median(values)
    power = np.concatenate([[0.0], np.cumsum(centred**2)])
    level = np.sqrt((power[n:] - power[:-n]) / n)  # level[i] covers samples i to i + n
    quiet = float(np.quantile(level, 0.2))
    ahead, behind = level[n:], level[:-n]
    rises = (ahead > FACTOR * quiet) & (ahead > RISE * behind)
    found: list[Burst] = []
    dead, next_free = round(DEAD_S * sampling_rate_hz), 0
    for i in map(int, np.flatnonzero(rises)):
        if i < next_free:
            continue
        stretch = np.abs(centred[i + n : i + n + dead])
        begin = i + n + int(np.argmax(stretch > 0.25 * stretch.max()))
        found.append(Burst(begin / sampling_rate_hz, float(stretch.max())))
        next_free = i + dead
    hardest = max((burst.peak for burst in found), default=0.0)
    return tuple(burst for burst in found if burst.peak >= LEAST_PART * hardest)
