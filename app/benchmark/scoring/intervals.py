"""90 % intervals of shares and of anything that is computed from a list of cases."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import isfinite, sqrt
from typing import TypeVar

import numpy as np

Z = 1.6448536269514722
"""Two-sided 90 % of the normal distribution."""

N_RESAMPLES = 500

T = TypeVar("T")


@dataclass(frozen=True)
class Score:
    """A figure with its 90 % interval and the number of cases it is made of.

    Parameters
    ----------
    value, low, high : float
        nan without cases.
    n : int
    """

    value: float
    low: float
    high: float
    n: int


NOTHING = Score(float("nan"), float("nan"), float("nan"), 0)


def share(n_hits: int, n: int) -> Score:
    """Return a share with Wilson's score interval.

    (p + z²/2n ± z √(p(1−p)/n + z²/4n²))/(1 + z²/n).

    Source: E. B. Wilson, *Probable inference, the law of succession, and statistical inference* (J. Am. Stat. Assoc.,
    1927).
    """
    if n == 0:
        return NOTHING
    p, z2 = n_hits / n, Z**2
    middle = (p + z2 / (2 * n)) / (1 + z2 / n)
    half = Z * sqrt(p * (1 - p) / n + z2 / (4 * n**2)) / (1 + z2 / n)
    # Rounding may leave 1e-17 beyond the ends.
    return Score(p, max(0.0, min(middle - half, p)), min(1.0, max(middle + half, p)), n)


def resampled(
    rows: Sequence[T],
    statistic: Callable[[Sequence[T]], float],
    rng: np.random.Generator,
    *,
    centred: bool = False,
) -> Score:
    """Return a statistic with the 5 and 95 % quantiles over cases drawn with replacement.

    `centred` is for a sum of absolute errors, to which drawing adds errors of its own: the quantiles are moved by the
    difference of their mean from the value, not below 0.

    Source: B. Efron, R. J. Tibshirani, *An Introduction to the Bootstrap* (1993), chapter 13.
    """
    value = statistic(rows) if rows else float("nan")
    if not isfinite(value):
        return NOTHING
    picks = rng.integers(len(rows), size=(N_RESAMPLES, len(rows)))
    found = [other for pick in picks if isfinite(other := statistic([rows[i] for i in pick]))]
    low, high = np.quantile(found, (0.05, 0.95))
    if centred:
        low, high = (max(0.0, value + q - float(np.mean(found))) for q in (low, high))
    return Score(value, float(low), float(high), len(rows))


def median_of(values: Sequence[float], rng: np.random.Generator) -> Score:
    """Return the median of the finite values, with its interval by `resampled`."""
    return resampled([v for v in values if isfinite(v)], lambda drawn: float(np.median(drawn)), rng)
