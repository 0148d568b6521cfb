"""The population of randomly drawn machines, and what is learned from it."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from dataclasses import dataclass, fields, replace
from functools import cache, cached_property
from hashlib import sha256
from os import environ
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gearsig.cache import cache_folder, modules_digest, read_arrays
from gearsig.checks import FloatArray
from gearsig.errors import InputError
from gearsig.gap._change import columns_with_shafts_swapped
from gearsig.gap._classifier import (
    LEARNED_FILE,
    EffectClassifier,
    ForestNodes,
    Learned,
    LinearRule,
    clipped_discriminant_input,
    fit_label_space,
    input_rows,
    read_learned,
    write_learned,
)
from gearsig.gap._floors import StructuralFloor, credibility_of, soft_size
from gearsig.gap._report import NONE, UNKNOWN
from gearsig.recording import sha256_of

# --------------------
# Drawn machines, healthy and with every effect; changes of features and their causes.
# --------------------


MAX_BYTES = 1_000_000_000
"""Limit of its arrays, which have nineteen million elements."""
MAKE_POPULATION = "in a checkout of the project: python -m app.studies.gap.population make, some hours"
INDEPENDENT = "independent"
"""Simulator of the rig used for blind cases; only its development gears are in the population."""
BY_HAND = "by hand"
"""Source of effects added to a healthy machine's recordings as described in the literature."""

LEFT_OUT: ContextVar[str] = ContextVar("LEFT_OUT", default="")
"""Simulator whose machines must not be learned from, see `without_machines_of`."""


def population_file() -> Path:
    """Return the file of the population: as GEARSIG_POPULATION states, otherwise in the user's cache.

    What is learned from it is shipped with the library (`LEARNED_FILE`). Only the studies that produce that file, and
    diagnoses that leave a simulator out, need the population itself.
    """
    return Path(environ.get("GEARSIG_POPULATION") or cache_folder("population") / "population.npz")


@dataclass(frozen=True)
class Population:
    """Recordings of randomly drawn machines, in which the cause of every change is known.

    Parameters
    ----------
    rigs : array, (n,)
        Machine of each row.
    simulators : array of str, (n,)
        Simulator of the machine.
    causes : array of str, (n,)
        Effect, "none" or "unknown".
    by_hand : bool array, (n,)
        Effects that were not made by a simulator, see `BY_HAND`.
    change_names, feature_names : tuple of str
        Names of the columns; the first changes are the differences of the features.
    changes, change_scatter : arrays, (n, n_changes)
        Against a healthy recording of the same machine on another day, and standard errors.
    features, feature_scatter : arrays, (n, n_features)
        Of the recording itself, and standard errors.
    simulated, simulated_scatter : arrays, (n, n_features)
        Of the twin, which knows only the rig file, and standard errors.
    loads_n_per_mm : array, (n,)
        Tooth loads.
    """

    rigs: NDArray[np.int64]
    simulators: NDArray[np.str_]
    causes: NDArray[np.str_]
    by_hand: NDArray[np.bool_]
    change_names: tuple[str, ...]
    feature_names: tuple[str, ...]
    changes: FloatArray
    change_scatter: FloatArray
    features: FloatArray
    feature_scatter: FloatArray
    simulated: FloatArray
    simulated_scatter: FloatArray
    loads_n_per_mm: FloatArray

    @cached_property
    def sources(self) -> NDArray[np.str_]:
        """Source of each effect: a simulator, or `BY_HAND`."""
        return np.where(self.by_hand, BY_HAND, self.simulators)

    def of_rows(self, rows: NDArray[np.bool_] | NDArray[np.intp]) -> Population:
        """Return the population reduced to some of its recordings."""
        by_row = {field.name for field in fields(self)} - {"change_names", "feature_names"}
        return replace(self, **{name: getattr(self, name)[rows] for name in by_row})

    @cached_property
    def credibility(self) -> FloatArray:
        """Fraction of each simulated feature that holds for healthy machines, 0 to 1, (n_features,)."""
        healthy = self.causes == NONE
        return credibility_of(self.features[healthy], self.simulated[healthy])

    @cached_property
    def gaps(self) -> FloatArray:
        """Features less the credible part of the simulation, (n, n_features)."""
        gaps: FloatArray = self.features - self.credibility * self.simulated
        return gaps

    @cached_property
    def gap_scatter(self) -> FloatArray:
        """Standard errors of the gaps."""
        scatter: FloatArray = np.hypot(self.feature_scatter, self.credibility * self.simulated_scatter)
        return scatter

    def floor(self, *, with_reference: bool) -> StructuralFloor:
        """Return the floor of healthy machines against themselves on another day, or against their simulation."""
        names, rows = (self.change_names, self.changes) if with_reference else (self.feature_names, self.gaps)
        return StructuralFloor.of_healthy(names, rows[self.causes == NONE])


@contextmanager
def without_machines_of(simulator: str) -> Iterator[None]:
    """Exclude a simulator's machines from what is known, to show how well other machines prepare for them."""
    token = LEFT_OUT.set(simulator)
    try:
        yield
    finally:
        LEFT_OUT.reset(token)


def load_population(path: Path | None = None) -> Population:
    """Return the population without what `without_machines_of` leaves out; see `population_file`.

    Raises
    ------
    InputError
        If the file is missing or belongs to other features.
    """
    return _read(path or population_file(), LEFT_OUT.get())


@cache
def _read(path: Path, left_out: str) -> Population:
    if left_out:
        whole = _read(path, "")
        return whole.of_rows(whole.simulators != left_out)
    arrays = read_arrays(path, MAX_BYTES)
    if arrays is None:
        raise InputError("the population is missing or damaged", where=path.name, remedy=MAKE_POPULATION)
    of_rigs = np.searchsorted(arrays["simulated_rigs"], arrays["rigs"])
    tables = {
        name: np.asarray(arrays[name], dtype=np.float64)
        for name in ("changes", "change_scatter", "features", "feature_scatter", "loads_n_per_mm")
    } | {name: np.asarray(arrays[name], dtype=np.float64)[of_rigs] for name in ("simulated", "simulated_scatter")}
    return Population(
        arrays["rigs"],
        arrays["simulators"],
        arrays["causes"],
        arrays["by_hand"],
        tuple(map(str, arrays["change_names"])),
        tuple(map(str, arrays["feature_names"])),
        **tables,
    )


# --------------------
# Learning from the population.
# --------------------


N_TREES = 150
ROW_SHARE, FEATURE_SHARE, MIN_IN_A_LEAF = 0.4, 0.3, 6
"""Fraction of the rows that each tree is fitted to, fraction of the columns that each split may choose from, and
minimum number of rows on either side of a split. The log losses on blind cases of two forests of 200 trees that differ
in their random numbers alone scatter by 0.02, and three in a hundred are named differently."""

LINEAR_SHRINKAGE = 0.2
"""Shrinkage of the discriminant's covariance towards its diagonal."""

EVENNESS = 0.5
"""0: all rows have equal weight; 1: all sources of a cause have equal weight."""

MIN_SIZE = 0.6
"""Structural floors below which a drawn effect changed nothing from which to learn."""

_SEED = 0


def learn(population: Population, *, n_trees: int = N_TREES) -> Learned:
    """Return everything that a diagnosis uses of a population."""
    return Learned(
        population.feature_names,
        population.credibility,
        {flag: fit_classifier(population, with_reference=flag, n_trees=n_trees) for flag in (False, True)},
    )


def fit_classifier(population: Population, *, with_reference: bool, n_trees: int = N_TREES) -> EffectClassifier:
    """Fit a classifier to a population and its copy with driver and driven gear exchanged.

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
        n_trees,
        bootstrap=True,
        max_samples=ROW_SHARE,
        max_features=FEATURE_SHARE,
        min_samples_leaf=MIN_IN_A_LEAF,
        class_weight="balanced",
        n_jobs=2,
        random_state=_SEED,
    )
    is_visible = _is_visible(floor, tables[0], population.causes)
    exchanged = columns_with_shafts_swapped(floor.names)
    changes, scatter = (np.concatenate([table[is_visible], table[is_visible][:, exchanged]]) for table in tables)
    loads = np.tile(population.loads_n_per_mm[is_visible], 2)
    rows = input_rows(floor, changes, scatter, loads).astype(np.float32)
    causes = np.tile(population.causes[is_visible], 2)
    forest.fit(
        rows,
        causes,
        sample_weight=np.tile(
            balanced_source_weights(population.sources[is_visible], population.causes[is_visible]), 2
        ),
    )
    names = tuple(map(str, forest.classes_))
    usual_load = float(np.median(population.loads_n_per_mm))
    simulated = np.tile(~population.by_hand[is_visible], 2)
    machines = np.concatenate([population.rigs[is_visible], -1 - population.rigs[is_visible]])[simulated]
    labels = fit_label_space(
        clipped_discriminant_input(rows[simulated]).astype(np.float64), causes[simulated], machines
    )
    if with_reference:
        return EffectClassifier(names, floor, ForestNodes.of(forest), usual_load, labels)
    even = np.full(len(names), 1.0 / len(names))
    linear = LinearDiscriminantAnalysis(solver="lsqr", shrinkage=LINEAR_SHRINKAGE, priors=even)
    linear.fit(clipped_discriminant_input(rows), causes)
    rule = LinearRule(linear.coef_, linear.intercept_)
    return EffectClassifier(names, floor, ForestNodes.of(forest), usual_load, labels, rule)


def balanced_source_weights(sources: NDArray[np.str_], causes: NDArray[np.str_]) -> FloatArray:
    """Return row weights that reduce the imbalance between the sources of a cause: n^(−`EVENNESS`).

    No source shows an effect exactly as it is; what they have in common holds for real machines.
    """
    _, kind, counts = np.unique(np.char.add(np.char.add(sources, "/"), causes), return_inverse=True, return_counts=True)
    weights: FloatArray = counts[kind] ** -EVENNESS
    weights /= weights.mean()
    return weights


def _is_visible(floor: StructuralFloor, changes: FloatArray, causes: NDArray[np.str_]) -> NDArray[np.bool_]:
    """Return which rows to learn from: an effect without a change would only teach that no change is that effect."""
    rows = floor.from_centre(floor.names, changes) / floor.of(floor.names)
    sizes = np.array([soft_size(floor.names, row) for row in rows]) / floor.floor_size(floor.names)
    is_visible: NDArray[np.bool_] = (sizes > MIN_SIZE) | np.isin(causes, (NONE, UNKNOWN))
    return is_visible


def load_learned() -> Learned:
    """Return what is shipped with this version or, within `without_machines_of`, learned from the other machines.

    Raises
    ------
    InputError
        If the file is missing or damaged; if a simulator is left out and there is no population.
    """
    return _learned(LEFT_OUT.get())


@cache
def _learned(left_out: str) -> Learned:
    if not left_out:
        learned = read_learned(LEARNED_FILE)
        if learned is None:
            raise InputError("is missing or damaged", where=LEARNED_FILE.name, remedy="install gearsig again")
        return learned
    population = load_population()
    code = modules_digest(f"gearsig.gap.{name}" for name in ("_change", "_features", "_floors", "_classifier"))
    made_of = sha256(f"{modules_digest([__name__])} {code} {sha256_of(population_file())}".encode()).hexdigest()[:16]
    path = cache_folder("forests") / f"without_{left_out}-{made_of}.npz"
    kept = read_learned(path)
    if kept is None:
        kept = learn(population)
        for old in path.parent.glob(f"without_{left_out}-*.npz"):
            old.unlink(missing_ok=True)
        with suppress(InputError):  # if the folder is not writable, the next process learns again
            write_learned(kept, path)
    return kept
