"""What a simulator says an effect would change, over its severity; and the severity that fits what was observed."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

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
"""In floors; what is further from a prediction counts little more: one wild feature must not decide."""

INTERVAL_COST = 2.71
"""Rise of the cost, a sum of squared standard deviations, that bounds the 90 % interval, 1.645², where the best fit is
as near as floors allow, which is a cost of 1 for each family; in proportion more where it is not."""

FLOOR_IN_DEVIATIONS = 1.96
"""A floor holds 19 of 20: so many standard deviations."""

LEVELS_DB = tuple(float(level) for level in (*range(-30, 30, 5), *range(30, 61, 10)))
LEVEL_SCATTER_DB = 10.0
"""By how much louder than on the twin what an effect adds may be on the real machine, whose path from gears and shafts
to the sensor nobody knows; and its standard deviation, for each operating condition."""

GROUNDS_DB = (0.0, -25.0, -50.0)
"""By how much less a shaft's lowest orders shake a machine than one on soft mounts; the last is rigid ground. None is
likelier than another."""

WAYS_DB = tuple((level, ground) for ground in GROUNDS_DB for level in LEVELS_DB)
"""Level and ground: what is not known of how an effect reaches a sensor."""


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
    distances : tuple of arrays, (n_ways, k, n)
        dB from the sound machine; one per condition.
    names : tuple of str
        Of the n features.
    levels_db : tuple of float
        Of each of `WAYS_DB`, or whatever the distances were made for.
    """

    name: str
    options: Mapping[str, float | str]
    severities: FloatArray
    distances: tuple[FloatArray, ...]
    names: tuple[str, ...]
    levels_db: tuple[float, ...] = (0.0,)

    def at(self, severities: FloatArray, condition: int) -> FloatArray:
        """Return the predicted distances, (n_ways, n_severities, n).

        Straight over ln s between simulations, and proportional to s below them.
        """
        table = self.distances[condition]
        place = np.interp(np.log(severities), np.log(self.severities), np.arange(len(self.severities)))
        first = np.minimum(place.astype(np.intp), max(len(self.severities) - 2, 0))
        second = np.minimum(first + 1, len(self.severities) - 1)
        between = table[:, first] + (place - first)[:, None] * (table[:, second] - table[:, first])
        found: FloatArray = between * np.minimum(severities / self.severities[0], 1.0)[:, None]
        return found

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
        The least: squared distances between observed and predicted, in standard deviations.
    ways : mapping
        Condition → which of `WAYS_DB`, or of the path's levels where it was made for others.
    """

    path: EffectPath
    severity: Interval
    cost: float
    ways: Mapping[int, int]

    @property
    def added(self) -> Added:
        """The fitted setting."""
        return Added(self.path.name, float(f"{self.severity.value:.4g}"), dict(self.path.options))

    def at(self, condition: int) -> FloatArray:
        """Return the predicted distances; at a condition that it was not fitted to, at the level of the others."""
        by_level = sorted(self.ways.values(), key=lambda way: self.path.levels_db[way])
        way = self.ways.get(condition, by_level[len(by_level) // 2])
        found: FloatArray = self.path.at(np.array([self.severity.value]), condition)[way, 0]
        return found

    def at_level_of(self, one: Observed) -> Fit:
        """Return the fit with the level that suits another condition best; severity and options stay."""
        predicted = self.path.at(np.array([self.severity.value]), one.condition)[:, 0]
        costs = _squares(one.distances - predicted, one.floors) @ _family_weights(self.path.names)
        way = int(np.argmin(costs + _unusual(self.path)))
        return replace(self, ways={**self.ways, one.condition: way})

    def level_db(self, condition: int) -> float:
        """Return by how much louder than on the twin the effect is."""
        return self.path.levels_db[self.ways[condition]]


def paths_of(
    names: tuple[str, ...],
    candidates: Sequence[Added],
    distances: Sequence[FloatArray],
    levels_db: tuple[float, ...] = (0.0,),
) -> tuple[EffectPath, ...]:
    """Return the paths that an effect's candidates make: one for each set of options.

    Parameters
    ----------
    names : tuple of str
        Of the features.
    candidates : sequence of Added
    distances : sequence of arrays, (n_ways, n_candidates, n)
        One per condition.
    levels_db : tuple of float
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
                candidates[rows[0]].name,
                dict(options),
                severities,
                tuple(table[:, order] for table in distances),
                names,
                levels_db,
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
    """Return the likely severity, with the interval in which the cost rises little.

    s = exp(Σ w_i ln s_i/Σ w_i), w = exp(−(cost − least)/2): where many fit alike, the least cost is one of them by
    chance.

    How loud the effect is beside the twin's is fitted at each condition, within what paths differ by: two sensors of
    one gearbox show one unbalance 20 dB apart, and so do two speeds. What an effect changes, and which part of it more
    than another, is the simulation's.

    Where the best fit misses by more than floors allow, the simulation is wrong by as much, and the interval is as much
    wider (R. T. Birge, The calculation of errors by the method of least squares, *Phys. Rev.* 40, 1932). Where the
    largest severity that was simulated fits as well it has no upper end, and where the least does, it begins at 0.
    """
    coarse = path.tried()
    tried = np.geomspace(*_about(coarse, _near_the_best(path, _costs(path, coarse, observed)[0])), STEPS)
    costs, ways = _costs(path, tried, observed)
    near = _near_the_best(path, costs)
    low, high = _about(tried, near)
    if near[0] and tried[0] == coarse[0]:
        low = 0.0
    if near[-1] and tried[-1] == coarse[-1]:
        high = math.inf
    likelihood = np.exp(-0.5 * (costs - costs.min()))
    best = round(float(likelihood @ np.arange(len(tried)) / likelihood.sum()))  # they are even in ln s
    fitted = {one.condition: int(row[best]) for one, row in zip(observed, ways, strict=True)}
    return Fit(path, Interval(float(tried[best]), low, high), float(costs.min()), fitted)


def _near_the_best(path: EffectPath, costs: FloatArray) -> NDArray[np.bool_]:
    """Return at which severities the cost has risen by no more than is likely.

    That is `INTERVAL_COST`, and as many times more as the best fit misses by.
    """
    misses = max(1.0, float(costs.min()) / len(family_members(path.names)))
    near: NDArray[np.bool_] = costs <= costs.min() + misses * INTERVAL_COST
    return near


def _about(tried: FloatArray, near: NDArray[np.bool_]) -> tuple[float, float]:
    """Return the first severities on either side of those that are near; the ends where there are none."""
    rows = np.flatnonzero(near)
    return float(tried[max(rows[0] - 1, 0)]), float(tried[min(rows[-1] + 1, len(tried) - 1)])


def _costs(
    path: EffectPath, severities: FloatArray, observed: Sequence[Observed]
) -> tuple[FloatArray, NDArray[np.intp]]:
    """Return the costs, mean over conditions, (n_severities,), and the best ways, (n_conditions, n_severities).

    Σ over families of the mean squared distance, and the squared level over its standard deviation.
    """
    weights = _family_weights(path.names)
    costs, ways = [], []
    for one in observed:
        left = one.distances - path.at(severities, one.condition)
        each = _squares(left, one.floors) @ weights + _unusual(path)[:, None]
        ways.append(each.argmin(axis=0))
        costs.append(each.min(axis=0))
    return np.mean(costs, axis=0), np.array(ways)


def _unusual(path: EffectPath) -> FloatArray:
    """Return the levels' squares in standard deviations."""
    squares: FloatArray = (np.array(path.levels_db) / LEVEL_SCATTER_DB) ** 2
    return squares


def _squares(left: FloatArray, floors: FloatArray) -> FloatArray:
    """Return ρ(u), u = left/floor, in squared standard deviations: u² up to 6, from there 36 (1 + ln(u²/36)).

    It never ceases to rise: a fit must find its way to a change that is larger than anything that it starts from.
    """
    distances = np.abs(left / floors)
    near = np.minimum(distances, LARGEST_DISTANCE)
    further = np.maximum(distances / LARGEST_DISTANCE, 1.0)
    squares: FloatArray = (near * FLOOR_IN_DEVIATIONS) ** 2 * (1.0 + 2.0 * np.log(further))
    return squares


def _family_weights(names: tuple[str, ...]) -> FloatArray:
    """Return what makes a sum over features one over families of their means."""
    weights = np.zeros(len(names))
    for rows in family_members(names).values():
        weights[rows] = 1.0 / len(rows)
    return weights


def family_square(names: tuple[str, ...], left: FloatArray, observed: Observed, used: FloatArray) -> float:
    """Return Σ_f mean_{i∈f} ρ(u_i), u = left/floor in standard deviations; `used` is 1 for what counts."""
    squares, total = _squares(left, observed.floors), 0.0
    for rows in family_members(names).values():
        if used[rows].sum() > 0:
            total += float(used[rows] @ squares[rows] / used[rows].sum())
    return total
