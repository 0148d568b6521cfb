"""Whether a family of lines is a part of a slower train of impacts, or no better than families beside it.

A train of impacts at a low rate has lines everywhere: a multiple of its rate lies near any order one may look at.
"""

from __future__ import annotations

from math import gcd

import numpy as np
from numpy.typing import NDArray

from gearsig.checks import FloatArray
from gearsig.diagnosis.comb import Comb, LineExcess, best_comb, comb_at

LARGEST_DIVISOR = 30
LARGEST_NUMERATOR = 3
"""A family may sit on every third line of a train of which it then has two multiples in three."""

FEWEST_LINES_APART = 6
"""Trains with lines closer than that are not told from noise."""

SEEN = float(np.log(4.0))
"""Log ratio of a line that counts as seen (6 dB); a widened line of noise has it once in 18."""

SHARE_SEEN = 0.5
"""Share of a train's further lines that must be seen; sidebands of a race's family make few of them."""

FEWEST_FURTHER = 3
N_SIDEBANDS = 3
COST = 0.4
"""What a line costs, between noise (0) and the family's own mean (1): a train that adds noise lines loses."""

PLACEBO_DISTANCES = (-0.09, -0.05, 0.05, 0.09)
PLACEBO_RATIO = 0.9
"""A family that is a part's own scores clearly higher than the best ones beside it."""


def slower_train(excess: LineExcess, comb: Comb, shafts: tuple[float, ...] = ()) -> Comb | None:
    """Return the train of impacts whose lines a family is a part of, or None if the family stands alone.

    Tried are p/q of the family's fundamental (q to 30, p to 3), over the range of the family's own lines. The best is
    that of the largest sum of log ratios less a cost per line: a train that is too slow pays for lines of noise, one
    that is too fast leaves lines to others. It counts if at least half of its lines beside the family's are seen, and
    beside the sidebands of the family: a race that turns through the load has them a shaft's order apart.

    Parameters
    ----------
    excess : LineExcess
    comb : Comb
        A family of multiples of one fundamental.
    shafts : tuple of float
        Orders of the shafts that may modulate the family.

    Returns
    -------
    Comb or None
        With as many multiples as lie within the range; the p-value is that of the family.
    """
    if not comb.positions:
        return None
    reach = max(comb.positions) + excess.spectrum.resolution
    own = _unmasked(excess, comb.fundamental, reach)
    noise = float(np.median(excess.log_ratio[~excess.masked]))
    cost = noise + COST * (float(own.mean()) - noise) if len(own) else 0.0
    best, best_score = None, float(np.sum(own - cost))
    for fraction in _fractions():
        fundamental = comb.fundamental * fraction
        if fundamental < FEWEST_LINES_APART * excess.spectrum.resolution:
            continue
        score = float(np.sum(_unmasked(excess, fundamental, reach) - cost))
        if score > best_score and _is_seen_between(excess, fundamental, comb.fundamental, reach, shafts):
            best, best_score = fundamental, score
    if best is None:
        return None
    return comb_at(excess, best, np.arange(1, int(reach / best) + 1), comb.p_value)


def stands_out_from_neighbours(excess: LineExcess, comb: Comb, slip: float, others: tuple[float, ...]) -> bool:
    """Whether no family at orders a few percent to either side scores as high as this one.

    Neighbours in which one of the `others`, the orders of further parts, lies are left out: they may be families too.
    """
    for distance in PLACEBO_DISTANCES:
        low, high = (comb.fundamental * (1 + distance + side * slip) for side in (-1, 1))
        if any(low <= other * (1 + side * slip) <= high for other in others for side in (-1, 0, 1)):
            continue
        placebo = best_comb(excess, low, high)
        if placebo is not None and placebo.score >= PLACEBO_RATIO * comb.score:
            return False
    return True


def _fractions() -> list[float]:
    """Return the fractions below one, with a numerator to 3 and a denominator to 30."""
    return sorted(
        p / q for q in range(2, LARGEST_DIVISOR + 1) for p in range(1, min(q, LARGEST_NUMERATOR + 1)) if gcd(p, q) == 1
    )


def _unmasked(excess: LineExcess, fundamental: float, reach: float) -> FloatArray:
    """Return the log ratios of the multiples up to `reach` that are not explained already."""
    index = _lines_of(excess, np.arange(1, int(reach / fundamental) + 1) * fundamental)
    ratios: FloatArray = excess.log_ratio[index[~excess.masked[index]]]
    return ratios


def _is_seen_between(
    excess: LineExcess, fundamental: float, family: float, reach: float, shafts: tuple[float, ...]
) -> bool:
    """Whether at least half of the train's lines stand out that are none of the family's and none of its sidebands."""
    places = np.arange(1, int(reach / fundamental) + 1) * fundamental
    sidebands = [0.0, *(side * k * shaft for shaft in shafts for k in range(1, N_SIDEBANDS + 1) for side in (-1, 1))]
    explained = np.any([_is_of_family(excess, places, family, sideband) for sideband in sidebands], axis=0)
    index = _lines_of(excess, places[~explained])
    further = excess.log_ratio[index[~excess.masked[index]]]
    return len(further) >= FEWEST_FURTHER and float(np.mean(further >= SEEN)) >= SHARE_SEEN


def _is_of_family(excess: LineExcess, places: FloatArray, family: float, sideband: float) -> NDArray[np.bool_]:
    """Whether a multiple of the family, shifted by `sideband`, is near and meets the peak at least as well."""
    others = sideband + np.maximum(np.rint((places - sideband) / family), 0) * family
    near: NDArray[np.bool_] = np.abs(others - places) < 2 * excess.spectrum.resolution
    if sideband:
        height, other_height = (excess.spectrum.values[_clipped_lines(excess, x)] for x in (places, others))
        near = near & (other_height >= height)
    return near


def _clipped_lines(excess: LineExcess, places: FloatArray) -> NDArray[np.int64]:
    spectrum = excess.spectrum
    index = np.rint((places - spectrum.positions[0]) / spectrum.resolution).astype(np.int64)
    clipped: NDArray[np.int64] = np.clip(index, 0, len(spectrum.values) - 1)
    return clipped


def _lines_of(excess: LineExcess, places: FloatArray) -> NDArray[np.int64]:
    spectrum = excess.spectrum
    index = np.rint((places - spectrum.positions[0]) / spectrum.resolution).astype(np.int64)
    inside: NDArray[np.int64] = index[(index >= 0) & (index < len(excess.log_ratio))]
    return inside
