"""What a simulator says an effect would change, over its severity; and the severity that fits what was observed."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from gearsig.checks import FloatArray
from gearsig.errors import InputError
from gearsig.gap.families import family_members
from gearsig.gap.simulator import Added
from gearsig.gap.types import Interval

STEPS = 41
"""Severities that are tried, over the whole range and again about the best."""

LEAST_TRIED = 0.3
"""Times the least simulated severity."""

LARGEST_DISTANCE = 6.0
"""In floors; what is further from a prediction counts no more: one wild feature must not decide."""

INTERVAL_COST = 2.71
"""Rise of the cost, a sum of squared standard deviations, that bounds the 90 % interval: 1.645²."""

FLOOR_IN_DEVIATIONS = 1.96
"""A floor holds 19 of 20: so many standard deviations."""


@dataclass(frozen=True)
class Observed:
    """One condition's observed distances from what is compared with.

    Parameters
    ----------
    condition : int
        Which operating condition.
    distances : array, (n,)
        dB, from where sound machines lie.
    floors : array, (n,)
        dB: structural floor and repeatability together.
    """

    condition: int
    distances: FloatArray
    floors: FloatArray

    @property
    def normalised(self) -> FloatArray:
        """Distances in floors."""
        result: FloatArray = self.distances / self.floors
        return result


@dataclass(frozen=True)
class EffectPath:
    """An effect with one set of options: the change it makes, over its severity, at every condition.

    Parameters
    ----------
    name : str
    options : mapping
    severities : array, (k,)
        Rising, above 0.
    distances : tuple of arrays, (k, n)
        dB from the sound simulation; one per condition.
    names : tuple of str
        Of the n features.
    """

    name: str
    options: Mapping[str, float | str]
    severities: FloatArray
    distances: tuple[FloatArray, ...]
    names: tuple[str, ...]

    def at(self, severity: float, condition: int) -> FloatArray:
        """Return the predicted distances: straight over ln s between simulations, and proportional to s below."""
        table = self.distances[condition]
        if severity <= self.severities[0]:
            low: FloatArray = table[0] * severity / self.severities[0]
            return low
        place = np.interp(np.log(severity), np.log(self.severities), np.arange(len(table)))
        i = min(int(place), len(table) - 2)
        between: FloatArray = table[i] + (place - i) * (table[i + 1] - table[i]) if len(table) > 1 else table[0]
        return between

    def tried(self) -> FloatArray:
        """Return the severities that a fit looks at."""
        return np.geomspace(LEAST_TRIED * self.severities[0], self.severities[-1], STEPS)


@dataclass(frozen=True)
class Fit:
    """The severity of a path that fits best.

    Parameters
    ----------
    path : EffectPath
    severity : Interval
    cost : float
        Mean squared distance between observed and predicted, in standard deviations.
    """

    path: EffectPath
    severity: Interval
    cost: float

    @property
    def added(self) -> Added:
        """The fitted setting."""
        return Added(self.path.name, float(f"{self.severity.value:.4g}"), dict(self.path.options))

    def at(self, condition: int) -> FloatArray:
        """Return the predicted distances."""
        return self.path.at(self.severity.value, condition)


def paths_of(
    names: tuple[str, ...], candidates: Sequence[Added], distances: Sequence[FloatArray]
) -> tuple[EffectPath, ...]:
    """Return the paths that an effect's candidates make: one for each set of options.

    Parameters
    ----------
    names : tuple of str
        Of the features.
    candidates : sequence of Added
    distances : sequence of arrays, (n_candidates, n)
        One per condition.
    """
    groups: dict[tuple[tuple[str, float | str], ...], list[int]] = {}
    for i, added in enumerate(candidates):
        groups.setdefault(tuple(sorted(added.options.items())), []).append(i)
    found = []
    for options, rows in groups.items():
        order = sorted(rows, key=lambda i: candidates[i].severity)
        severities = np.array([candidates[i].severity for i in order])
        found.append(
            EffectPath(
                candidates[rows[0]].name, dict(options), severities, tuple(table[order] for table in distances), names
            )
        )
    return tuple(found)


def fit_effect(paths: Iterable[EffectPath], observed: Sequence[Observed]) -> Fit:
    """Return the best fit over all paths of an effect.

    Raises
    ------
    InputError
        If there is no path.
    """
    fits = [fit_path(path, observed) for path in paths]
    if not fits:
        raise InputError("the effect has no candidate that can be simulated", remedy="describe the rig more fully")
    return min(fits, key=lambda fit: fit.cost)


def fit_path(path: EffectPath, observed: Sequence[Observed]) -> Fit:
    """Return the severity with the least cost, with the interval in which the cost rises little.

    The interval ends at the severities that were simulated, though a larger one may fit as well.
    """
    coarse = path.tried()
    low, high = _near_the_best(coarse, _costs(path, coarse, observed))
    tried = np.geomspace(low, high, STEPS)
    costs = _costs(path, tried, observed)
    best = int(np.argmin(costs))
    return Fit(path, Interval(float(tried[best]), *_near_the_best(tried, costs)), float(costs[best]))


def _near_the_best(tried: FloatArray, costs: FloatArray) -> tuple[float, float]:
    """Return the first severities on either side at which the cost has risen by more than `INTERVAL_COST`."""
    near = np.flatnonzero(costs <= costs.min() + INTERVAL_COST)
    return float(tried[max(near[0] - 1, 0)]), float(tried[min(near[-1] + 1, len(tried) - 1)])


def _costs(path: EffectPath, severities: FloatArray, observed: Sequence[Observed]) -> FloatArray:
    return np.array([_cost(path, severity, observed) for severity in severities])


def _cost(path: EffectPath, severity: float, observed: Sequence[Observed]) -> float:
    """Sum over families of the mean squared distance, mean over conditions."""
    return float(
        np.mean([family_square(path.names, one.distances - path.at(severity, one.condition), one) for one in observed])
    )


def family_square(
    names: tuple[str, ...], left: FloatArray, observed: Observed, used: FloatArray | None = None
) -> float:
    """Return Σ_f mean_{i∈f} min(|u_i|, 6)², u = left/floor in standard deviations; `used` is 1 for what counts."""
    squares = (np.minimum(np.abs(left / observed.floors), LARGEST_DISTANCE) * FLOOR_IN_DEVIATIONS) ** 2
    total = 0.0
    for rows in family_members(names).values():
        weights = np.ones(len(rows)) if used is None else used[rows]
        if weights.sum() > 0:
            total += float(weights @ squares[rows] / weights.sum())
    return total
