"""How small a bearing damage would still have shown."""

from __future__ import annotations

from collections.abc import Sequence
from math import inf
from statistics import median, median_high

import numpy as np

from gearsig.diagnosis.comb import LOG_RATIO_LIMIT, score_needed
from gearsig.diagnosis.envelopes import BandEnvelope

CLEAR_MODULATION = 0.05
"""Depth of the strongest line of the envelope from which a race is called damaged, not only worth watching."""

N_HARMONICS = 6
FEWEST_FREE = 3
"""Harmonics that must lie beside those of the shafts for a family to be seen."""


SLIPS = (-0.5, 0.0, 0.5)
"""Parts of the range searched: slip takes a part's lines to and from those of the shafts, here a median counts too."""


def smallest_depth(envelopes: Sequence[BandEnvelope], order: float, slip: float, probability: float) -> float:
    """Return the depth of modulation at which six equal harmonics near `order` would have shown in half of the bands.

    Each line needs the log ratio score/n over its floor, where `score` is what chance reaches with `probability` and n
    the number of harmonics that no shaft hides. The depth is the amplitude of such a line over the mean envelope. The
    band in which a damage rings is not known beforehand: the best one of all says little, so that it is the median
    over the bands, each with its best channel.

    Parameters
    ----------
    envelopes : sequence of BandEnvelope
        Multiples of the shafts masked.
    order : float
    slip : float
        Relative range searched to either side.
    probability : float
        Of a false alarm in one envelope.

    Returns
    -------
    float
        inf if no depth would have shown.
    """
    best: dict[tuple[float, float], float] = {}
    for envelope in envelopes:
        depth = median(_depth_in(envelope, order * (1 + part * slip), slip, probability) for part in SLIPS)
        best[envelope.band_hz] = min(depth, best.get(envelope.band_hz, inf))
    return median_high(best.values()) if best else inf


def _depth_in(envelope: BandEnvelope, order: float, slip: float, probability: float) -> float:
    excess = envelope.excess
    places = order * np.arange(1, N_HARMONICS + 1)
    places = places[places <= excess.spectrum.positions[-1]]
    index = np.array([excess.spectrum.index_of(place) for place in places], dtype=np.int64)
    free = index[~excess.masked[index]] if len(index) else index
    if len(free) < FEWEST_FREE or envelope.mean <= 0:
        return inf
    needed = score_needed(excess, N_HARMONICS, order * (1 - slip), order * (1 + slip), probability) / len(free)
    if needed > LOG_RATIO_LIMIT:
        return inf
    floor = float(np.exp(np.mean(np.log(np.maximum(excess.floor[free], 1e-300)))))
    return floor * float(np.exp(needed / 2)) / envelope.mean
