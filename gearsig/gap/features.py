"""A recording as named features with the scatter that its own blocks give."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gearsig.checks import FloatArray
from gearsig.gap.broadband import broadband_features, speed_features
from gearsig.gap.cyclic import cyclic_features
from gearsig.gap.gathered import Gathered
from gearsig.gap.gear_lines import line_features
from gearsig.gap.tooth import tooth_features

WHOLE_RECORD_DB = {"hum": 1.3, "speed.drift": 3.0, "speed.swing": 1.0, "speed.swing_line": 2.0}
"""Standard errors of features that no block can be left out of, from repeated synthetic records."""


@dataclass(frozen=True)
class Features:
    """Named figures of one recording.

    Parameters
    ----------
    names : tuple of str
    values : array, (n,)
        dB, or ten times the decadic logarithm.
    scatter : array, (n,)
        Standard error from leaving out blocks of revolutions, one at a time.
    left_out : tuple of arrays, (n_blocks, n)
        The values without each block of the recording, and of what it was compared with.
    """

    names: tuple[str, ...]
    values: FloatArray
    scatter: FloatArray
    left_out: tuple[FloatArray, ...] = ()


def features_of(gathered: Gathered) -> Features:
    """Return a recording's features with their standard errors by the jackknife over blocks of revolutions.

    SE² = (B − 1)/B Σ_b (f_(b) − mean)², f_(b) without block b.
    """
    names, values = whole_and_parts(gathered)
    without = values[1:]
    variance = (len(without) - 1.0) * without.var(axis=0) + whole_record_variance(names)
    return Features(names, values[0], np.sqrt(variance), (without,))


def whole_and_parts(gathered: Gathered) -> tuple[tuple[str, ...], FloatArray]:
    """Return names and values, (1 + n_blocks, n): of the whole, and without each of its blocks; computed once."""
    if not gathered.known:
        names, values = once(gathered)
        parts = [once(gathered.without(b))[1] for b in range(gathered.n_blocks)]
        gathered.known.append((names, np.stack([values, *parts])))
    return gathered.known[0]


def whole_record_variance(names: Sequence[str]) -> FloatArray:
    """Return the variance of what is taken from the whole record at once, and 0 for all else."""
    return np.array([WHOLE_RECORD_DB.get(name, 0.0) ** 2 for name in names])


def once(gathered: Gathered) -> tuple[tuple[str, ...], FloatArray]:
    """Return names and values of the features, without their scatter."""
    channels = list(gathered.channels.values())
    per_channel = [dict(line_features(gathered, sums)) for sums in channels]
    found = {name: float(np.mean([one[name] for one in per_channel])) for name in per_channel[0]}
    found |= dict(tooth_features(gathered, channels))
    found |= dict(cyclic_features(gathered, channels))
    found |= dict(broadband_features(gathered, channels))
    found |= dict(speed_features(gathered))
    return tuple(found), np.array(list(found.values()))
