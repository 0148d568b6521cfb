"""A recording as named features with the scatter that its own blocks give."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gearsig.checks import FloatArray
from gearsig.gap.broadband import broadband_features, speed_features
from gearsig.gap.cyclic import cyclic_features
from gearsig.gap.gathered import Gathered
from gearsig.gap.gear_lines import line_features
from gearsig.gap.tooth import tooth_features


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
    """

    names: tuple[str, ...]
    values: FloatArray
    scatter: FloatArray


def features_of(gathered: Gathered) -> Features:
    """Return a recording's features with their standard errors by the jackknife over blocks of revolutions.

    SE² = (B − 1)/B Σ_b (f_(b) − mean)², f_(b) without block b.
    """
    names, values = once(gathered)
    n = gathered.n_blocks
    without = np.stack([once(gathered.without(b))[1] for b in range(n)]) if n > 2 else np.stack([values, values])
    scatter = np.sqrt((len(without) - 1.0) * without.var(axis=0))
    return Features(names, values, scatter)


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
