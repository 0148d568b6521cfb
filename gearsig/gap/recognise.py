"""Which causes changed features look like: decision trees, and a linear rule, over the population of drawn machines."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from math import nan

import numpy as np
from numpy.typing import NDArray

from gearsig.checks import FloatArray
from gearsig.errors import InputError
from gearsig.gap.change import SURPRISE
from gearsig.gap.contrasts import mirrored, seen_rows
from gearsig.gap.features import Features
from gearsig.gap.floors import REPEATABLE, StructuralFloor, soft_size
from gearsig.gap.kept_recogniser import Fitted, keep_fitted, read_fitted
from gearsig.gap.population import LEFT_OUT, Population, load_population
from gearsig.gap.relative import beyond_the_mesh, counted_from_the_mesh
from gearsig.gap.textbook import NOTHING_SAID, strengths
from gearsig.gap.trees import LinearRule, Trees
from gearsig.gap.types import NONE, UNKNOWN

N_TREES = 400
ROW_SHARE, FEATURE_SHARE, FEWEST_IN_A_LEAF = 0.4, 0.1, 3
"""Of the rows that each tree is fitted to, of the columns that each split may choose from, and the least rows that a
split leaves on either side. Two forests of 200 trees that differ in their random numbers alone have log losses on blind
cases that scatter by 0.02, and name three in a hundred differently."""

LINEAR_SHARE, LINEAR_SHRINKAGE, LINEAR_REACH = 0.5, 0.2, 8.0
"""Of the probabilities without a reference that a linear discriminant gives; how far its covariance is drawn towards a
diagonal one; where its input is cut. Without a reference nearly all that is seen is what one machine differs from
another by: trees cut along single features and miss a small change across it, a pooled covariance takes it out."""

RULES_WEIGHT = 0.3
"""Of what the textbook's rules say without a reference, p ∝ p_learned exp(w strength): the population's balance of a
machine's lines is its own, and where nothing cancels what is usual, the rules' few signs hold on any machine."""

EVENNESS = 0.5
"""0: every row counts alike; 1: every source of a cause does."""

LEAST_SIZE = 0.6
"""Structural floors, below which a drawn effect changed nothing that could be learned."""

LEAST_PROBABILITY = 2e-3
"""That a forest gives any cause: no tree having voted for it is no proof."""

LEAST_LOAD_N_PER_MM = 0.01
"""Of the teeth: less is none."""

_SEED = 0


@dataclass(frozen=True)
class Recogniser:
    """A fitted forest with the floors that its input is measured in.

    Parameters
    ----------
    causes : tuple of str
        Of the probabilities.
    floor : StructuralFloor
    trees : Trees
    usual_load_n_per_mm : float
        Of the teeth, where a rig does not say.
    linear : LinearRule or None
        What is heard besides the forest, by `LINEAR_SHARE`.
    """

    causes: tuple[str, ...]
    floor: StructuralFloor
    trees: Trees
    usual_load_n_per_mm: float
    linear: LinearRule | None = None

    def probabilities(self, change: Features, tooth_load_n_per_mm: float = nan) -> dict[str, float]:
        """Return cause → probability, uncalibrated.

        Parameters
        ----------
        change : Features
            Against the reference or against the twin, as the forest was fitted.
        tooth_load_n_per_mm : float
            See `gearsig.gap.tooth_load`; nan where it is not known.
        """
        if change.names != self.floor.names:
            raise InputError(
                "the population belongs to other features than this version computes",
                remedy="make it again: python -m app.calibration.gap.population",
            )
        load = tooth_load_n_per_mm if tooth_load_n_per_mm > 0.0 else self.usual_load_n_per_mm
        row = input_rows(self.floor, change.values[None], change.scatter[None], np.array([load]))[0]
        found = self.trees.probabilities(row)
        if self.linear is not None:
            told = self.linear.probabilities(_within_reach(row))
            found = (1.0 - LINEAR_SHARE) * found + LINEAR_SHARE * told
            found = found * self._by_the_rules(change)
        found = np.maximum(found, LEAST_PROBABILITY)
        return dict(zip(self.causes, (found / found.sum()).tolist(), strict=True))

    def _by_the_rules(self, change: Features) -> FloatArray:
        """Return the factors of the causes, by how far features are from usual, in standard deviations."""
        names = self.floor.names
        spreads = self.floor.of(names) / REPEATABLE
        deviations = self.floor.from_centre(names, change.values) / spreads
        said = strengths(dict(zip(names, deviations.tolist(), strict=True)))
        factors: FloatArray = np.exp(RULES_WEIGHT * np.array([said.get(name, NOTHING_SAID) for name in self.causes]))
        return factors


def input_rows(
    floor: StructuralFloor, changes: FloatArray, scatter: FloatArray, loads_n_per_mm: FloatArray
) -> FloatArray:
    """Return what the forest sees: changes over both floors, and what sets them apart from each other.

    Not the features themselves: a tachometer that jitters more than any in the population is no hunting speed. Levels
    come twice, as they changed and as far as that holds both relative to the mesh and by itself. Where two averages
    can be subtracted, what a tooth did is in the difference: the change of either average's own figures is left out.
    Against a simulation, of the speed only how much it swings counts: how steadily it does, beside the tachometer's
    jitter, says more of the tachometer.
    """
    patterns = any(name.startswith(SURPRISE) for name in floor.names)
    left_out = "tooth." if patterns else ("speed.drift", "speed.swing_line")
    kept = [i for i, name in enumerate(floor.names) if not name.startswith(left_out)]
    names = [floor.names[i] for i in kept]
    distances = floor.from_centre(floor.names, changes)[:, kept]
    both = np.hypot(floor.of(names) / REPEATABLE, scatter[:, kept])
    held = seen_rows(names, beyond_the_mesh(names, distances) / both)
    further = np.ones(held.shape[1], dtype=bool)
    further[: 2 * len(names)] = np.tile(counted_from_the_mesh(names) != 0.0, 2)  # the others are as they were
    return np.column_stack(
        [
            seen_rows(names, distances / both),
            held[:, further],
            np.log10(np.maximum(loads_n_per_mm, LEAST_LOAD_N_PER_MM)),
        ]
    )


def fit_recogniser(population: Population, *, with_reference: bool) -> Recogniser:
    """Return the recogniser that is fitted to a population."""
    return _with_floor(population, _fit(population, with_reference=with_reference), with_reference=with_reference)


def _with_floor(population: Population, fitted: Fitted, *, with_reference: bool) -> Recogniser:
    causes, trees, linear = fitted
    usual_load = float(np.median(population.loads_n_per_mm))
    return Recogniser(causes, population.floor(with_reference=with_reference), trees, usual_load, linear)


def _fit(population: Population, *, with_reference: bool) -> Fitted:
    """Fit to a population, and to the same with driver and driven gear exchanged.

    Extremely randomised trees: P. Geurts, D. Ernst, L. Wehenkel, "Extremely randomized trees", 2006. The linear
    discriminant with a shrunken covariance: J. H. Friedman, "Regularized discriminant analysis", 1989.
    """
    from sklearn.discriminant_analysis import LinearDiscriminantAnalysis
    from sklearn.ensemble import ExtraTreesClassifier

    floor = population.floor(with_reference=with_reference)
    tables = (
        (population.changes, population.change_scatter) if with_reference else (population.gaps, population.gap_scatter)
    )
    forest = ExtraTreesClassifier(
        N_TREES,
        bootstrap=True,
        max_samples=ROW_SHARE,
        max_features=FEATURE_SHARE,
        min_samples_leaf=FEWEST_IN_A_LEAF,
        class_weight="balanced",
        n_jobs=2,
        random_state=_SEED,
    )
    seen = _visible(floor, tables[0], population.causes)
    exchanged = mirrored(floor.names)
    changes, scatter = (np.concatenate([table[seen], table[seen][:, exchanged]]) for table in tables)
    loads = np.tile(population.loads_n_per_mm[seen], 2)
    rows = input_rows(floor, changes, scatter, loads).astype(np.float32)
    causes = np.tile(population.causes[seen], 2)
    forest.fit(rows, causes, sample_weight=np.tile(even_weights(population.sources[seen], population.causes[seen]), 2))
    names = tuple(map(str, forest.classes_))
    if with_reference:
        return names, Trees.of(forest), None
    even = np.full(len(names), 1.0 / len(names))
    linear = LinearDiscriminantAnalysis(solver="lsqr", shrinkage=LINEAR_SHRINKAGE, priors=even)
    linear.fit(_within_reach(rows), causes)
    return names, Trees.of(forest), LinearRule(linear.coef_, linear.intercept_)


def even_weights(sources: NDArray[np.str_], causes: NDArray[np.str_]) -> FloatArray:
    """Return weights of rows by which the sources of a cause count more alike than they have rows: n^(−`EVENNESS`).

    None of them shows an effect as it is; what they have in common is what holds for a machine.
    """
    _, kind, counts = np.unique(np.char.add(np.char.add(sources, "/"), causes), return_inverse=True, return_counts=True)
    weights: FloatArray = counts[kind] ** -EVENNESS
    weights /= weights.mean()
    return weights


def _within_reach(rows: FloatArray) -> FloatArray:
    reached: FloatArray = np.clip(rows, -LINEAR_REACH, LINEAR_REACH)
    return reached


def _visible(floor: StructuralFloor, changes: FloatArray, causes: NDArray[np.str_]) -> NDArray[np.bool_]:
    """Return which rows to learn from: an effect that changes nothing would only teach that nothing is that effect."""
    rows = floor.from_centre(floor.names, changes) / floor.of(floor.names)
    sizes = np.array([soft_size(floor.names, row) for row in rows]) / floor.whole_of(floor.names)
    seen: NDArray[np.bool_] = (sizes > LEAST_SIZE) | np.isin(causes, (NONE, UNKNOWN))
    return seen


def load_recogniser(*, with_reference: bool) -> Recogniser:
    """Return the one for the population that comes with this version: fitted once, then kept among the user's files."""
    return _load(with_reference, LEFT_OUT.get())


@cache
def _load(with_reference: bool, left_out: str) -> Recogniser:
    name = "_".join(["with" if with_reference else "without", "reference", *([left_out] if left_out else [])])
    population, fitted = load_population(), read_fitted(name)
    if fitted is None:
        fitted = _fit(population, with_reference=with_reference)
        keep_fitted(name, fitted)
    return _with_floor(population, fitted, with_reference=with_reference)
