"""Which causes changed features look like: a forest of decision trees over the population of drawn machines."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gearsig.checks import FloatArray
from gearsig.errors import InputError
from gearsig.gap.contrasts import mirrored, seen_rows
from gearsig.gap.features import Features
from gearsig.gap.floors import REPEATABLE, StructuralFloor, soft_size
from gearsig.gap.population import Population, load_population
from gearsig.gap.types import NONE, UNKNOWN

N_TREES = 200
FEATURE_SHARE, FEWEST_IN_A_LEAF = 0.15, 3
"""Of the columns that each split may choose from, and the least rows that a split leaves on either side."""

LEAST_SIZE = 0.3
"""Structural floors, below which a drawn effect changed nothing that could be learned."""

LEAST_PROBABILITY = 2e-3
"""That a forest gives any cause: no tree having voted for it is no proof."""

_SEED = 0


@dataclass(frozen=True)
class Recogniser:
    """A fitted forest with the floors that its input is measured in.

    Parameters
    ----------
    causes : tuple of str
        Of the probabilities.
    floor : StructuralFloor
    forest : sklearn.ensemble.ExtraTreesClassifier
    """

    causes: tuple[str, ...]
    floor: StructuralFloor
    forest: Any

    def probabilities(self, change: Features) -> dict[str, float]:
        """Return cause → probability, uncalibrated.

        Parameters
        ----------
        change : Features
            Against the reference or against the twin, as the forest was fitted.
        """
        found = np.maximum(self.forest.predict_proba(self._row(change))[0], LEAST_PROBABILITY)
        return dict(zip(self.causes, (found / found.sum()).tolist(), strict=True))

    def _row(self, change: Features) -> FloatArray:
        if change.names != self.floor.names:
            raise InputError(
                "the population belongs to other features than this version computes",
                remedy="make it again: python -m app.calibration.gap.population",
            )
        return input_rows(self.floor, change.values[None], change.scatter[None])


def input_rows(floor: StructuralFloor, changes: FloatArray, scatter: FloatArray) -> FloatArray:
    """Return what the forest sees: changes over both floors, and what sets them apart from each other.

    Not the features themselves: a tachometer that jitters more than any in the population is no hunting speed.
    """
    both = np.hypot(floor.of(floor.names) / REPEATABLE, scatter)
    return seen_rows(floor.names, floor.from_centre(floor.names, changes) / both)


def fit_recogniser(population: Population, *, with_reference: bool) -> Recogniser:
    """Fit a forest to a population, and to the same with driver and driven gear exchanged.

    Extremely randomised trees: P. Geurts, D. Ernst, L. Wehenkel, "Extremely randomized trees", 2006.
    """
    from sklearn.ensemble import ExtraTreesClassifier

    floor = population.floor(with_reference=with_reference)
    tables = (
        (population.changes, population.change_scatter) if with_reference else (population.gaps, population.gap_scatter)
    )
    forest = ExtraTreesClassifier(
        N_TREES,
        max_features=FEATURE_SHARE,
        min_samples_leaf=FEWEST_IN_A_LEAF,
        class_weight="balanced",
        n_jobs=2,
        random_state=_SEED,
    )
    seen = _visible(floor, tables[0], population.causes)
    exchanged = mirrored(floor.names)
    both = [np.concatenate([table[seen], table[seen][:, exchanged]]) for table in tables]
    forest.fit(input_rows(floor, *both), np.tile(population.causes[seen], 2))
    return Recogniser(tuple(map(str, forest.classes_)), floor, forest)


def _visible(floor: StructuralFloor, changes: FloatArray, causes: NDArray[np.str_]) -> NDArray[np.bool_]:
    """Return which rows to learn from: an effect that changes nothing would only teach that nothing is that effect."""
    rows = floor.from_centre(floor.names, changes) / floor.of(floor.names)
    sizes = np.array([soft_size(floor.names, row) for row in rows]) / floor.whole_of(floor.names)
    seen: NDArray[np.bool_] = (sizes > LEAST_SIZE) | np.isin(causes, (NONE, UNKNOWN))
    return seen


@cache
def load_recogniser(*, with_reference: bool) -> Recogniser:
    """Return the forest over the population that comes with this version; fitted once per process."""
    return fit_recogniser(load_population(), with_reference=with_reference)
