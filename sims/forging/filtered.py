"""Slow channels as a data logger stores them: through an anti-alias filter, not at instants."""

from __future__ import annotations

from collections.abc import Sequence
from math import ceil

import numpy as np

from gearsig.checks import FloatArray
from sims.forging.drive import ForgingDrive
from sims.forging.respond import respond
from sims.forging.schedule import Schedule
from sims.measure import AntiAlias

FINE_POINTS = 8
"""Points of the motion per sample: what the teeth do above seven times the sampling rate is below a millinewton."""
MOST_VALUES = 40_000_000
"""Of the fine motion at a time: a third of a gigabyte."""


def filtered_signals(
    drive: ForgingDrive, courses: Schedule, names: Sequence[str], *, sampling_rate_hz: float, n_samples: int
) -> dict[str, FloatArray]:
    """Return signals of the drive, low-pass filtered and sampled, each (n_samples,).

    The filter has no delay: a sine up to 0.4 of the sampling rate keeps amplitude and phase, one above half of it is
    down by 90 dB. Ahead of the run everything stands as it does at its begin. The courses must last 30 samples longer.

    Parameters
    ----------
    drive : ForgingDrive
    courses : Schedule
    names : sequence of str
        Of `sims.forging.numbers.SIGNALS`.
    sampling_rate_hz : float
    n_samples : int
    """
    chain = AntiAlias()
    step_s = 1.0 / (FINE_POINTS * sampling_rate_hz)
    reach = ceil(chain.reach_s(sampling_rate_hz) * sampling_rate_hz) + 1
    lasts_s = (n_samples + reach) / sampling_rate_hz
    together = max(1, MOST_VALUES // ((n_samples + 2 * reach) * FINE_POINTS))
    found: dict[str, FloatArray] = {}
    for first in range(0, len(names), together):
        chosen = names[first : first + together]
        run = respond(drive, courses, duration_s=lasts_s, interval_s=step_s, signals=chosen)
        fine = np.pad(np.stack([run[name] for name in chosen]), ((0, 0), (reach * FINE_POINTS, 0)), mode="edge")
        found |= zip(chosen, chain.sample(fine, step_s, sampling_rate_hz, reach, n_samples), strict=True)
    return found
