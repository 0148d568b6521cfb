"""Changes that a simulator predicts for an effect over its severity, and the severity that fits the observed ones."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gearsig.checks import FloatArray
from gearsig.gap._features import Feature, jackknife_variance
from gearsig.gap._floors import FLOOR_IN_DEVIATIONS, family_members, t_quantile
from gearsig.gap._report import MIN_PREDICTED, Interval, Shrinkage
from gearsig.gap._simulator import AddedEffect
from gearsig.rig import SIDES

N_SEVERITIES = 41
"""Severities tried over the whole range, and again around the best."""

MIN_TRIED = 0.3
"""Lowest tried severity, relative to the lowest simulated one."""

LARGEST_DISTANCE = 6.0
"""In floors; larger distances from a prediction hardly count more, so that one outlier cannot decide."""

INTERVAL_COST = 2.71
"""Rise of the cost, a sum of squared standard deviations, that bounds the 90 % interval: 1.645² where the best fit is
as close as floors allow, which is a cost of 1 per family; proportionally more otherwise."""

LEVELS_DB = tuple(float(level) for level in (*range(-30, 30, 5), *range(30, 61, 10)))
LEVEL_SCATTER_DB = 10.0
"""Levels of an effect on the real machine relative to the twin, since the path from gears and shafts to the sensor is
not known, and their standard deviation for each operating condition."""

GROUNDS_DB = (0.0, -25.0, -50.0)
"""Reduction of a shaft's lowest orders relative to a machine on soft mounts; the last is for rigid ground. All are
equally likely."""

WAYS_DB = tuple((level, ground) for ground in GROUNDS_DB for level in LEVELS_DB)
"""Level and ground: the unknowns of an effect's path to a sensor."""


@dataclass(frozen=True)
class ObservedChange:
    """One condition's observed distances from its baseline.

    Parameters
    ----------
    condition : int
        Index of the operating condition.
    distances : array, (n,)
        dB, from the centre of healthy machines.
    floors : array, (n,)
        dB: structural and repeatability floor combined.
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
    """An effect with one set of options: its change over severity, at every condition.

    Parameters
    ----------
    name : str
    options : mapping
    severities : array, (k,)
        Ascending, positive.
    distances : tuple of arrays, (n_ways, k, n)
        Distances from the healthy machine in dB; one array per condition.
    names : tuple of str
        Names of the n features.
    levels_db : tuple of float
        Level of each of `WAYS_DB`, or of other ways for which the distances were computed.
    """

    name: str
    options: Mapping[str, float | str]
    severities: FloatArray
    distances: tuple[FloatArray, ...]
    names: tuple[str, ...]
    levels_db: tuple[float, ...] = (0.0,)

    def at(self, severities: FloatArray, condition: int) -> FloatArray:
        """Return the predicted distances, (n_ways, n_severities, n).

        They are interpolated linearly over ln s between simulations, and proportional to s below them.
        """
        table = self.distances[condition]
        place = np.interp(np.log(severities), np.log(self.severities), np.arange(len(self.severities)))
        first = np.minimum(place.astype(np.intp), max(len(self.severities) - 2, 0))
        second = np.minimum(first + 1, len(self.severities) - 1)
        between = table[:, first] + (place - first)[:, None] * (table[:, second] - table[:, first])
        predicted: FloatArray = between * np.minimum(severities / self.severities[0], 1.0)[:, None]
        return predicted

    def tried(self) -> FloatArray:
        """Return the severities that a fit evaluates."""
        return np.geomspace(MIN_TRIED * self.severities[0], self.severities[-1], N_SEVERITIES)


@dataclass(frozen=True)
class Fit:
    """The best-fitting severity of a path.

    Parameters
    ----------
    path : EffectPath
    severity : Interval
    cost : float
        Minimum cost: squared distances between observed and predicted, in standard deviations.
    ways : mapping
        Condition → index in `WAYS_DB`, or in the path's own levels.
    """

    path: EffectPath
    severity: Interval
    cost: float
    ways: Mapping[int, int]

    @property
    def added(self) -> AddedEffect:
        """The fitted setting."""
        return AddedEffect(self.path.name, float(f"{self.severity.value:.4g}"), dict(self.path.options))

    def at(self, condition: int) -> FloatArray:
        """Return the predicted distances; at a condition outside the fit, at the median level of the others."""
        by_level = sorted(self.ways.values(), key=lambda way: self.path.levels_db[way])
        way = self.ways.get(condition, by_level[len(by_level) // 2])
        predicted: FloatArray = self.path.at(np.array([self.severity.value]), condition)[way, 0]
        return predicted

    def at_level_of(self, observed: ObservedChange) -> Fit:
        """Return the fit with the best level for another condition; severity and options stay."""
        predicted = self.path.at(np.array([self.severity.value]), observed.condition)[:, 0]
        costs = _squares(observed.distances - predicted, observed.floors) @ _family_weights(self.path.names)
        way = int(np.argmin(costs + _level_costs(self.path)))
        return replace(self, ways={**self.ways, observed.condition: way})


def paths_of(
    names: tuple[str, ...],
    candidates: Sequence[AddedEffect],
    distances: Sequence[FloatArray],
    levels_db: tuple[float, ...] = (0.0,),
) -> tuple[EffectPath, ...]:
    """Return the paths formed by an effect's candidates: one for each set of options.

    Parameters
    ----------
    names : tuple of str
        Names of the features.
    candidates : sequence of AddedEffect
    distances : sequence of arrays, (n_ways, n_candidates, n)
        One array per condition.
    levels_db : tuple of float
    """
    groups: dict[tuple[tuple[str, float | str], ...], list[int]] = {}
    for i, added in enumerate(candidates):
        groups.setdefault(added.place, []).append(i)
    paths = []
    for options, rows in groups.items():
        order = sorted(rows, key=lambda i: candidates[i].severity)
        severities = np.array([candidates[i].severity for i in order])
        paths.append(
            EffectPath(
                candidates[rows[0]].name,
                dict(options),
                severities,
                tuple(table[:, order] for table in distances),
                names,
                levels_db,
            )
        )
    return tuple(paths)


def fit_effect(paths: Iterable[EffectPath], observed: Sequence[ObservedChange]) -> Fit:
    """Return the best fit over all paths of an effect: that of minimum cost, see `fit_path`.

    Parameters
    ----------
    paths : iterable of EffectPath
        The effect with each set of options.
    observed : sequence of ObservedChange
        From one or several conditions.
    """
    return min((fit_path(path, observed) for path in paths), key=lambda fit: fit.cost)


def fit_path(path: EffectPath, observed: Sequence[ObservedChange]) -> Fit:
    """Return the likely severity, with the interval in which the cost rises little.

    s = exp(Σ w_i ln s_i/Σ w_i), w = exp(−(cost − minimum)/2): where many severities fit similarly, the minimum is one
    of them by chance.

    The level relative to the twin is fitted for each condition, within the variation between transfer paths: two
    sensors on one gearbox show the same unbalance 20 dB apart, and so do two speeds. Which features an effect changes,
    and in what proportion, comes from the simulation.

    Where the best fit misses by more than floors allow, the simulation's error is of that size, and the interval is
    widened in proportion (R. T. Birge, The calculation of errors by the method of least squares, *Phys. Rev.* 40,
    1932). The interval has no upper end where the largest simulated severity fits as well, and starts at 0 where the
    smallest does.
    """
    coarse = path.tried()
    tried = np.geomspace(*_bracket(coarse, _is_near_best(path, _costs(path, coarse, observed)[0])), N_SEVERITIES)
    costs, ways = _costs(path, tried, observed)
    near = _is_near_best(path, costs)
    low, high = _bracket(tried, near)
    if near[0] and tried[0] == coarse[0]:
        low = 0.0
    if near[-1] and tried[-1] == coarse[-1]:
        high = math.inf
    likelihood = np.exp(-0.5 * (costs - costs.min()))
    best = round(float(likelihood @ np.arange(len(tried)) / likelihood.sum()))  # uniform in ln s
    fitted = {change.condition: int(row[best]) for change, row in zip(observed, ways, strict=True)}
    return Fit(path, Interval(float(tried[best]), low, high), float(costs.min()), fitted)


def _is_near_best(path: EffectPath, costs: FloatArray) -> NDArray[np.bool_]:
    """Return which severities have a cost within the likely range of the minimum.

    The range is `INTERVAL_COST`, multiplied by the factor by which the best fit misses.
    """
    misses = max(1.0, float(costs.min()) / len(family_members(path.names)))
    near: NDArray[np.bool_] = costs <= costs.min() + misses * INTERVAL_COST
    return near


def _bracket(tried: FloatArray, near: NDArray[np.bool_]) -> tuple[float, float]:
    """Return the first severities outside the near ones on either side, or the ends of the range."""
    rows = np.flatnonzero(near)
    return float(tried[max(rows[0] - 1, 0)]), float(tried[min(rows[-1] + 1, len(tried) - 1)])


def _costs(
    path: EffectPath, severities: FloatArray, observed: Sequence[ObservedChange]
) -> tuple[FloatArray, NDArray[np.intp]]:
    """Return the costs, mean over conditions, (n_severities,), and the best ways, (n_conditions, n_severities).

    The cost is the sum over families of the mean squared distance, plus the squared level over its standard deviation.
    """
    weights = _family_weights(path.names)
    costs, ways = [], []
    for change in observed:
        misses = change.distances - path.at(severities, change.condition)
        cost_of_way = _squares(misses, change.floors) @ weights + _level_costs(path)[:, None]
        ways.append(cost_of_way.argmin(axis=0))
        costs.append(cost_of_way.min(axis=0))
    return np.mean(costs, axis=0), np.array(ways)


def _level_costs(path: EffectPath) -> FloatArray:
    """Return the squared levels in standard deviations."""
    squares: FloatArray = (np.array(path.levels_db) / LEVEL_SCATTER_DB) ** 2
    return squares


def _squares(misses: FloatArray, floors: FloatArray) -> FloatArray:
    """Return ρ(u), u = miss/floor, in squared standard deviations: u² up to 6, from there 36 (1 + ln(u²/36)).

    It keeps rising, so that a fit can find its way to a change larger than any that it starts from.
    """
    distances = np.abs(misses / floors)
    near = np.minimum(distances, LARGEST_DISTANCE)
    further = np.maximum(distances / LARGEST_DISTANCE, 1.0)
    squares: FloatArray = (near * FLOOR_IN_DEVIATIONS) ** 2 * (1.0 + 2.0 * np.log(further))
    return squares


def _family_weights(names: tuple[str, ...]) -> FloatArray:
    """Return weights that turn a sum over features into a sum over families of their means."""
    weights = np.zeros(len(names))
    for rows in family_members(names).values():
        weights[rows] = 1.0 / len(rows)
    return weights


def family_square(names: tuple[str, ...], misses: FloatArray, observed: ObservedChange, used: FloatArray) -> float:
    """Return Σ_f mean_{i∈f} ρ(u_i), u = miss/floor in standard deviations; `used` is 1 for features that count."""
    squares, total = _squares(misses, observed.floors), 0.0
    for rows in family_members(names).values():
        if used[rows].sum() > 0:
            total += float(used[rows] @ squares[rows] / used[rows].sum())
    return total


# --------------------
# Transfer of an effect from the twin to the real machine, whose own irregularity is different.
# --------------------


_STRONGEST = {"shaft.{}.strongest": "shaft.{}.strongest.to_mesh", "sideband.{}.strongest": "sideband.{}.6to12"}
"""Prominence of the strongest line, and the power through which an effect raises it."""

_BANDS, _KURTOSIS = "floor.band.", "floor.kurtosis."
_OF_A_PATTERN = ("prominence", "second", "kurtosis", "width", "below_mesh", "centroid")


def predicted_on_baseline(
    names: Sequence[str],
    change: FloatArray,
    simulated: Mapping[str, float],
    real: Mapping[str, float],
    usual: Mapping[str, float],
    level_db: float = 0.0,
    ground_db: float = 0.0,
) -> FloatArray:
    """Return the changes that a simulated effect causes on the real machine's own baseline.

    Powers of different causes add: P = P_real + (P_with − P_healthy). On a twin whose teeth are rougher than the real
    ones, or whose floor is lower, the same effect changes the levels less or more. Mesh harmonics pass through the same
    resonances as those of the healthy machine, so each changes by the same decibels; their total depends on which of
    them the real machine has. Decreases are transferred unchanged in decibels.

    Parameters
    ----------
    names : sequence of str
        Names of the changes, see `change_feature_values`; those of patterns last, or none.
    change : array, (…, n)
        dB, with the effect minus healthy, both simulated. `change.…`: the pattern's own value.
    simulated, real : mapping
        Feature → value for the healthy twin and for the healthy machine.
    usual : mapping
        `change.…` → value from repetition alone.
    level_db : float
        How much louder an effect is on the real machine than on the twin, because of the different path.
    ground_db : float
        How much louder still the lowest shaft orders are, because of the different support. At these orders the machine
        moves as a whole, as force over mass, not through the path from the mesh to a sensor: the added level does not
        decrease with a mesh that is quieter than the twin's.

    Returns
    -------
    array, (…, n)
        dB; `change.…` relative to repetition alone.
    """
    simulated_change = dict(zip(names, np.moveaxis(change, -1, 0), strict=True))
    moved = dict(simulated_change)
    gain_db = real["mesh.total"] - simulated["mesh.total"]
    floor_db = real["floor.total"] - simulated["floor.total"] - gain_db
    for name in names:
        feature = Feature.of(name)
        gain_of_effect_db = level_db + (ground_db - gain_db if feature.is_of_the_body else 0.0)
        if (feature.is_relative and feature.family != "change") or name == "mesh.half":
            moved[name] = _added(simulated_change[name], simulated[name], real[name], gain_of_effect_db)
        elif feature.is_shaft_level or name == "floor.total" or name.startswith(_BANDS):
            moved[name] = _added(simulated_change[name], simulated[name], real[name], gain_db + gain_of_effect_db)
        elif feature.family in ("envelope", "line") and name != "envelope.depth":
            moved[name] = _added(simulated_change[name], simulated[name], real[name], level_db - floor_db)
    moved |= _mesh(simulated_change, real, level_db)
    for name in names:
        if name.startswith(_KURTOSIS):
            part = _part(moved[name.replace(_KURTOSIS, _BANDS)])
            moved[name] = part * (simulated[name] + simulated_change[name] - real[name])
    for side in SIDES:
        for name, rose in _STRONGEST.items():
            strongest = name.format(side)
            moved[strongest] = _prominence_rise(
                real[strongest], simulated[strongest] + simulated_change[strongest], moved[rose.format(side)]
            )
        moved |= _tooth(f"tooth.{side}", moved, simulated_change, simulated, real)
        if f"change.{side}.level" in simulated_change:
            moved |= _pattern(f"change.{side}", simulated_change, usual, real[f"tooth.{side}.level"], level_db)
    return np.stack([moved[name] for name in names], axis=-1)


def _power(decibels: FloatArray | float) -> FloatArray:
    power: FloatArray = np.power(10.0, np.asarray(decibels) / 10.0)
    return power


def _added(change_db: FloatArray, simulated_db: float, real_db: float, gain_db: float) -> FloatArray:
    """Return the change that the same added power causes on the real baseline; decreases are unchanged in decibels."""
    risen = (_power(simulated_db + np.maximum(change_db, 0.0)) - _power(simulated_db)) * _power(gain_db - real_db)
    return np.minimum(change_db, 0.0) + 10.0 * np.log10(1.0 + risen)


def _mesh(change: Mapping[str, FloatArray], real: Mapping[str, float], level_db: float) -> dict[str, FloatArray]:
    """Return the mesh harmonics' changes: added power is scaled by the level, on the harmonics it has."""
    shares = [name for name in change if name.startswith("mesh.share.")]
    levels = np.array([_added(change[name] + change["mesh.total"], 0.0, 0.0, level_db) for name in shares])
    powers = np.array([_power(real[name]) for name in shares])
    total = 10.0 * np.log10(np.tensordot(powers, _power(levels), axes=1) / powers.sum())
    return {"mesh.total": total} | dict(zip(shares, levels - total, strict=True))


def _part(change_db: FloatArray) -> FloatArray:
    """Return the effect's fraction of the power that it raised by so many decibels."""
    return 1.0 - 1.0 / _power(np.maximum(change_db, 0.0))


def _prominence_rise(born_db: float, alone_db: FloatArray, more_db: FloatArray) -> FloatArray:
    """Return the increase in prominence: the rise of the line, but not beyond its prominence in the simulation."""
    return np.minimum(born_db + np.maximum(more_db, 0.0), np.maximum(alone_db, born_db)) - born_db


def _tooth(
    name: str,
    moved: Mapping[str, FloatArray],
    change: Mapping[str, FloatArray],
    simulated: Mapping[str, float],
    real: Mapping[str, float],
) -> dict[str, FloatArray]:
    """Return the shape of a shaft's pattern where the effect's own is added to that of the real teeth."""
    peak, elsewhere = moved[f"{name}.peak"], moved[f"{name}.elsewhere"]
    part = _part(moved[f"{name}.level"])
    shapes = {
        f"{name}.{detail}": part
        * (simulated[f"{name}.{detail}"] + change[f"{name}.{detail}"] - real[f"{name}.{detail}"])
        for detail in ("kurtosis", "width", "below_mesh", "centroid")
    }
    second = _prominence_rise(real[f"{name}.second"], simulated[f"{name}.second"] + change[f"{name}.second"], peak)
    return {f"{name}.prominence": peak - elsewhere, f"{name}.second": second, **shapes}


def _pattern(
    name: str, change: Mapping[str, FloatArray], usual: Mapping[str, float], pattern_db: float, level_db: float
) -> dict[str, FloatArray]:
    """Return the distances of the difference pattern's features from repetition alone."""
    moved = {}
    for detail in ("level", "elsewhere", "peak"):
        key = f"{name}.{detail}"
        moved[key] = 10.0 * np.log10(1.0 + _power(change[key] + level_db - usual[key]))
    part = _part(moved[f"{name}.level"])
    for detail in _OF_A_PATTERN:
        key = f"{name}.{detail}"
        moved[key] = part * (change[key] - usual[key])
    agreement = (1.0 + _power(change[f"{name}.level"] + level_db - pattern_db)) ** -0.5
    moved[f"{name}.agreement"] = 10.0 * (agreement - 1.0)
    return moved


# --------------------
# Shrinkage of a gap once an effect is added, on data that the effect was not fitted to.
# --------------------


SAME_PREDICTION = 0.8
"""Cosine of the angle between two predictions, in floors, from which they are equivalent."""

MIN_AFFECTED = 1.5
"""Floors by which an effect must change a feature for it to count as affected."""


@dataclass(frozen=True)
class Fold:
    """Observations to fit to, and others to score on.

    Parameters
    ----------
    fitted : tuple of ObservedChange
    scored : ObservedChange
    again : tuple of tuples of ObservedChange
        `scored` with each block of revolutions left out in turn: those of the recording, and those of its reference.
    """

    fitted: tuple[ObservedChange, ...]
    scored: ObservedChange
    again: tuple[tuple[ObservedChange, ...], ...] = ()


def affected_features(fit: Fit, observed: ObservedChange) -> FloatArray:
    """Return 1 for the features that the fitted effect changes, else 0; its strongest feature always has 1."""
    predicted = np.abs(fit.at(observed.condition) / observed.floors)
    used: FloatArray = (predicted >= min(MIN_AFFECTED, float(predicted.max()))).astype(np.float64)
    return used


def closed_shares(fits: Mapping[str, Sequence[Fit]], folds: Sequence[Fold]) -> dict[str, float]:
    """Return each effect's shrink, as in `shrinkage`, on the features that any of the effects changes; mean over folds.

    On its own features, a flexible wrong effect shrinks a gap as much as the true one. Here the rest of the gap counts
    as well, so that effects can be compared.

    Parameters
    ----------
    fits : mapping
        Effect → its fits to the part of each fold that is not scored.
    folds : sequence of Fold
    """
    shares: dict[str, list[float]] = {name: [] for name in fits}
    for i, fold in enumerate(folds):
        fits_of_fold = {name: of_effect[i] for name, of_effect in fits.items()}
        shown = [fit for fit in fits_of_fold.values() if _largest_predicted(fit, fold.scored) >= MIN_PREDICTED]
        if not shown:
            continue
        used = np.max([affected_features(fit, fold.scored) for fit in shown], axis=0)
        for name, fit in fits_of_fold.items():
            shares[name].append(_before_and_after(fit, fold.scored, used)[2])
    return {name: float(np.mean(values)) for name, values in shares.items() if values}


def _largest_predicted(fit: Fit, scored: ObservedChange) -> float:
    """Return the largest change that a fit predicts, in floors."""
    return float(np.abs(fit.at(scored.condition) / scored.floors).max())


HELD_OUT = "other revolutions of the same recordings"


def shrinkage(
    paths: Sequence[EffectPath],
    folds: Sequence[Fold],
    excluded: Sequence[EffectPath] = (),
    fits: Sequence[Fit] = (),
) -> Shrinkage:
    """Return the shrinkage of the gap by an effect, mean over folds.

    shrink = 1 − (r² − n²)/(o² − n²) on the effect's own features: o is the gap before, r the remainder, n the
    contribution of the floors, with o and r at least n. Severity and options are fitted to the other part of the data.

    Where the fitted effect predicts nothing, for example with unloaded gears, it has no features of its own and nothing
    can shrink: such folds do not count, unless there are no others.

    The intervals contain the scatter of the scored data, from its blocks of revolutions, but not that of the fit.

    Parameters
    ----------
    paths : sequence of EffectPath
        Paths of the effect.
    folds : sequence of Fold
    excluded : sequence of EffectPath
        Paths that the recordings rule out, for example on the other shaft. They serve as placebos.
    fits : sequence of Fit
        Fits to the part of each fold that is not scored, if known.
    """
    pairs = list(zip(folds, fits or [fit_effect(paths, fold.fitted) for fold in folds], strict=True))
    shown = [(fold, fit) for fold, fit in pairs if _largest_predicted(fit, fold.scored) >= MIN_PREDICTED] or pairs
    scores = [_score(fold, fit) for fold, fit in shown]
    before, after, shrink = np.mean([sizes for sizes, _, _ in scores], axis=0).tolist()
    n_blocks = min((len(group) for fold, _ in shown for group in fold.again), default=2)
    variances = np.mean([variances for _, variances, _ in scores], axis=0)
    wide = (t_quantile(max(n_blocks - 1, 1)) * np.sqrt(variances)).tolist()
    placebos = [_placebos((*paths, *excluded), fold, fit) for fold, fit in shown]
    return Shrinkage(
        Interval.around(before, wide[0], low=0.0),
        Interval.around(after, wide[1], low=0.0),
        Interval.around(shrink, wide[2], high=1.0),
        float(np.mean([slope for _, _, slope in scores])),
        float(np.mean([max(shrinks, default=0.0) for shrinks in placebos])),
        HELD_OUT,
        n_placebos=max(map(len, placebos)),
        elsewhere=_mean([_shrink_across_conditions(paths, fold) for fold, _ in shown]),
        predicted=max(_largest_predicted(fit, fold.scored) for fold, fit in shown),
    )


def _mean(values: Sequence[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return float(np.mean(known)) if known else None


def _shrink_across_conditions(paths: Sequence[EffectPath], fold: Fold) -> float | None:
    """Return the shrink where severity and options come from the other conditions alone; None if there are none.

    The level comes from other revolutions of the same condition, as no other condition shows the path at this speed.
    """
    elsewhere = [change for change in fold.fitted if change.condition != fold.scored.condition]
    if not elsewhere:
        return None
    fit = fit_effect(paths, elsewhere)
    for change in fold.fitted:
        if change.condition == fold.scored.condition:
            fit = fit.at_level_of(change)
    return _before_and_after(fit, fold.scored, affected_features(fit, fold.scored))[2]


def _score(fold: Fold, fit: Fit) -> tuple[tuple[float, float, float], FloatArray, float]:
    """Return before, after and shrink on one fold, their variances, (3,), and the slope of observed over predicted."""
    used = affected_features(fit, fold.scored)
    variances = np.zeros(3)
    for group in fold.again:
        variances += jackknife_variance(np.array([_before_and_after(fit, change, used) for change in group]))
    return _before_and_after(fit, fold.scored, used), variances, _slope(fit, fold.scored, used)


def _placebos(paths: Sequence[EffectPath], fold: Fold, fit: Fit) -> list[float]:
    """Return the effect's shrinks in wrong places, without places whose predictions are equivalent."""
    used = affected_features(fit, fold.scored)
    wrong = [fit_path(path, fold.fitted) for path in paths if path.options != fit.path.options]
    return [_before_and_after(w, fold.scored, used)[2] for w in wrong if not _is_alike(fit, w, fold.scored)]


def _is_alike(first: Fit, second: Fit, scored: ObservedChange) -> bool:
    """Whether two places have equivalent predictions, as bearings of one type on one shaft do: no placebos."""
    a, b = (fitted.at(scored.condition) / scored.floors for fitted in (first, second))
    product = float(np.sqrt((a @ a) * (b @ b)))
    return product > 0.0 and float(a @ b) > SAME_PREDICTION * product


def _before_and_after(fit: Fit, scored: ObservedChange, used: FloatArray) -> tuple[float, float, float]:
    """Return before and after in floors, and the shrink of what exceeds them."""
    names = fit.path.names
    n_families = family_square(names, np.ones_like(used) * scored.floors, scored, used) / FLOOR_IN_DEVIATIONS**2
    misses = scored.distances - fit.at(scored.condition)
    squares = [family_square(names, d, scored, used) / n_families for d in (scored.distances, misses)]
    excess = max(squares[0] - 1.0, 0.1)
    shrink = (max(squares[0], 1.0) - max(squares[1], 1.0)) / excess  # without a gap nothing can shrink
    before, after = (float(np.sqrt(s)) / FLOOR_IN_DEVIATIONS for s in squares)
    return before, after, float(np.clip(shrink, -1.0, 1.0))


def _slope(fit: Fit, scored: ObservedChange, used: FloatArray) -> float:
    """Return the slope of observed over predicted distances, in floors, through zero."""
    predicted = used * fit.at(scored.condition) / scored.floors
    square = float(predicted @ predicted)
    return float(predicted @ scored.normalised) / square if square > 0 else 0.0
