"""Which causes changed features look like: a forest of decision trees over the population of drawn machines."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from gearsig.checks import FloatArray
from gearsig.errors import InputError
from gearsig.gap.features import Features
from gearsig.gap.floors import REPEATABLE, StructuralFloor
from gearsig.gap.population import Population, load_population

N_TREES = 500
FEATURE_SHARE = 0.3
"""Of the features that each split may choose from."""

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
        found = np.maximum(self.forest.predict_proba(self._row(change)[None])[0], LEAST_PROBABILITY)
        return dict(zip(self.causes, (found / found.sum()).tolist(), strict=True))

    def _row(self, change: Features) -> FloatArray:
        if change.names != self.floor.names:
            raise InputError(
                "the population belongs to other features than this version computes",
                remedy="make it again: python -m app.calibration.gap.population",
            )
        return input_rows(self.floor, change.values, change.scatter)


def input_rows(floor: StructuralFloor, changes: FloatArray, scatter: FloatArray) -> FloatArray:
    """Return what the forest sees: changes over both floors, large ones compressed.

    Not the features themselves: a tachometer that jitters more than any in the population is no hunting speed.
    """
    both = np.hypot(floor.of(floor.names), REPEATABLE * scatter)
    distances: FloatArray = np.arcsinh(2.0 * floor.from_centre(floor.names, changes) / both)
    return distances


def fit_recogniser(population: Population, *, with_reference: bool) -> Recogniser:
    """Fit a forest to a population.

    Extremely randomised trees: P. Geurts, D. Ernst, L. Wehenkel, "Extremely randomized trees", 2006.
    """
    from sklearn.ensemble import ExtraTreesClassifier

    floor = population.floor(with_reference=with_reference)
    tables = (
        (population.changes, population.change_scatter) if with_reference else (population.gaps, population.gap_scatter)
    )
    forest = ExtraTreesClassifier(
        N_TREES, max_features=FEATURE_SHARE, class_weight="balanced", n_jobs=2, random_state=_SEED
    )
    forest.fit(input_rows(floor, *tables), population.causes)
    return Recogniser(tuple(map(str, forest.classes_)), floor, forest)


@cache
def load_recogniser(*, with_reference: bool) -> Recogniser:
    """Return the forest over the population that comes with this version; fitted once per process."""
    return fit_recogniser(load_population(), with_reference=with_reference)
