"""Which causes changed features look like: decision trees, and a linear rule, over the population of drawn machines."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cache
from hashlib import sha256
from importlib.metadata import version
from math import nan
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gearsig.cache import cache_folder, keep, modules_digest, read_arrays
from gearsig.checks import FloatArray, closest_match_hint
from gearsig.errors import InputError
from gearsig.gap._change import beyond_the_mesh, counted_from_the_mesh, mirrored, seen_rows
from gearsig.gap._features import SIDES, Features
from gearsig.gap._floors import (
    LEFT_OUT,
    MAKE_POPULATION,
    POPULATION_FILE,
    REPEATABLE,
    Population,
    StructuralFloor,
    load_population,
    soft_size,
)
from gearsig.gap._simulator import GapEffect
from gearsig.gap._types import NONE, UNKNOWN

# --------------------
# Decision trees as plain arrays: they can be kept in a file without running anything from it.
# --------------------


LEAF = -1


@dataclass(frozen=True)
class Trees:
    """Trees one after another, their nodes numbered throughout.

    Parameters
    ----------
    columns : int array, (n_nodes,)
        Of the input, by which a node splits; `LEAF` for a leaf.
    thresholds : array, (n_nodes,)
        At or below which it goes on with `left`.
    left, right : int arrays, (n_nodes,)
        Node; of a leaf, `left` is its row of `shares`.
    roots : int array, (n_trees,)
    shares : float16 array, (n_leaves, n_causes)
        Of the causes, in each leaf.
    """

    columns: NDArray[np.int16]
    thresholds: FloatArray
    left: NDArray[np.int32]
    right: NDArray[np.int32]
    roots: NDArray[np.int32]
    shares: NDArray[np.float16]

    @classmethod
    def of(cls, forest: Any) -> Trees:
        """Return those of a fitted forest of scikit-learn, which sorts by single-precision input."""
        trees = [one.tree_ for one in forest.estimators_]
        roots = np.cumsum([0, *(tree.node_count for tree in trees[:-1])]).astype(np.int32)
        columns = np.concatenate([tree.feature for tree in trees]).astype(np.int16)
        left, right = (
            np.concatenate([getattr(tree, side) + root for tree, root in zip(trees, roots, strict=True)])
            for side in ("children_left", "children_right")
        )
        leaves = columns < 0
        columns[leaves], right[leaves] = LEAF, 0
        left[leaves] = np.arange(int(leaves.sum()))
        counts = np.concatenate([tree.value[:, 0] for tree in trees])[leaves]
        shares = (counts / counts.sum(axis=1, keepdims=True)).astype(np.float16)
        thresholds = np.concatenate([tree.threshold for tree in trees])
        return cls(columns, thresholds, left.astype(np.int32), right.astype(np.int32), roots, shares)

    def probabilities(self, row: FloatArray) -> FloatArray:
        """Return the mean of the trees' shares, (n_causes,), for one row of input."""
        values, nodes = row.astype(np.float32), self.roots
        while True:
            columns = self.columns[nodes]
            leaves = columns == LEAF
            if leaves.all():
                break
            on = np.where(values[columns] <= self.thresholds[nodes], self.left[nodes], self.right[nodes])
            nodes = np.where(leaves, nodes, on)
        found: FloatArray = self.shares[self.left[nodes]].astype(np.float64).mean(axis=0)
        return found


@dataclass(frozen=True)
class LinearRule:
    """Probabilities from weights: softmax of W x + b.

    Parameters
    ----------
    weights : array, (n_causes, n_columns)
    offsets : array, (n_causes,)
    """

    weights: FloatArray
    offsets: FloatArray

    def probabilities(self, row: FloatArray) -> FloatArray:
        """Return those of the causes, (n_causes,), for one row of input."""
        levels = self.weights @ row + self.offsets
        weights = np.exp(levels - levels.max())
        found: FloatArray = weights / weights.sum()
        return found


# --------------------
# A fitted recogniser on disk, so that not every command fits it anew: plain arrays; a damaged file is no file.
# --------------------


MAX_BYTES = 200_000_000
"""Of a file's arrays; a real one has a tenth."""

_MODULES = ("_change", "_features", "_floors", "_recognition")
_TREES = ("columns", "thresholds", "left", "right", "roots", "shares")
_LINEAR = ("weights", "offsets")

Fitted = tuple[tuple[str, ...], Trees, LinearRule | None]
"""Causes, trees, and what is heard besides them."""


def read_fitted(name: str) -> Fitted | None:
    """Return what was kept under a name for this very code and population; None where nothing was, or it is damaged."""
    arrays = read_arrays(_path(name), MAX_BYTES)
    if arrays is None:
        return None
    try:
        trees = Trees(*(arrays[key] for key in _TREES))
        linear = LinearRule(*(arrays[key] for key in _LINEAR)) if _LINEAR[0] in arrays else None
        return tuple(map(str, arrays["causes"])), trees, linear
    except (KeyError, TypeError):
        return None


def keep_fitted(name: str, fitted: Fitted) -> None:
    """Keep it, in place of what other versions kept; where the folder cannot be written, the next process fits anew."""
    causes, trees, linear = fitted
    arrays = {key: getattr(trees, key) for key in _TREES}
    arrays |= {key: getattr(linear, key) for key in _LINEAR} if linear is not None else {}
    path = _path(name)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        for old in path.parent.glob(f"{name}-*.npz"):
            old.unlink(missing_ok=True)
    except OSError:
        return
    keep(path, lambda file: np.savez(file, allow_pickle=False, causes=np.array(causes), **arrays))


def _path(name: str) -> Path:
    return cache_folder("forests") / f"{name}-{_made_of()}.npz"


@cache
def _made_of() -> str:
    """Return a short hash of all that a fit depends on."""
    code = modules_digest(f"gearsig.gap.{module}" for module in _MODULES)
    return sha256(POPULATION_FILE.read_bytes() + f"{code} {version('scikit-learn')}".encode()).hexdigest()[:16]


# --------------------
# The textbook's rules: effects bring their signs along, in the features of `gearsig.gap`; of several rules for a cause
# the strongest counts.
# --------------------


Signs = tuple[tuple[str, int], ...]

NOTHING_SAID = 1.0
"""Strength that counts for no gap, of which there is no rule: healthy machines are one spread from usual."""

MAX_OF_A_SIGN = 8.0
"""In spreads: one sign alone shall not carry a rule of three."""


def textbook_rules(effects: Iterable[GapEffect]) -> list[tuple[str, Signs]]:
    """Return cause and signs of each rule: of the effects, and of lines and modulations that belong to no part."""
    of_effects = [(effect.name, effect.signs) for effect in effects if effect.signs]
    return [*of_effects, (UNKNOWN, (("envelope.strange", 1),)), (UNKNOWN, (("line.strange", 1),))]


def rule_strengths(signs: Signs, deviations: Mapping[str, float]) -> dict[str, float]:
    """Return the mean of a rule's signs, each over its spread, by side; by an empty one where it asks for none.

    Raises
    ------
    InputError
        If a sign is of no feature.
    """
    names = {name.format(side=side) for name, _ in signs for side in SIDES}
    for name in names - deviations.keys():
        raise InputError(
            f"there is no feature {name!r}", where="the textbook's signs", remedy=closest_match_hint(name, deviations)
        )
    strengths = {}
    for side in SIDES if any("{side}" in name for name, _ in signs) else ("",):
        values = [(deviations[name.format(side=side)], direction) for name, direction in signs]
        strengths[side] = float(np.mean([min(d * value if d else abs(value), MAX_OF_A_SIGN) for value, d in values]))
    return strengths


def textbook_strengths(rules: Iterable[tuple[str, Signs]], deviations: Mapping[str, float]) -> dict[str, float]:
    """Return cause → how strongly its rules speak for it, in spreads: the strongest rule, at either side.

    Parameters
    ----------
    rules : iterable of (str, signs)
        See `textbook_rules`.
    deviations : mapping
        Feature → distance from usual, in spreads of healthy machines.
    """
    strongest: dict[str, float] = {}
    for cause, signs in rules:
        strength = max(rule_strengths(signs, deviations).values())
        strongest[cause] = max(strength, strongest.get(cause, -np.inf))
    return strongest


N_TREES = 400
ROW_SHARE, FEATURE_SHARE, MIN_IN_A_LEAF = 0.4, 0.1, 3
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

MIN_SIZE = 0.6
"""Structural floors, below which a drawn effect changed nothing that could be learned."""

MIN_PROBABILITY = 2e-3
"""That a forest gives any cause: no tree having voted for it is no proof."""

MIN_LOAD_N_PER_MM = 0.01
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

    def probabilities(
        self, change: Features, tooth_load_n_per_mm: float = nan, effects: Iterable[GapEffect] = ()
    ) -> dict[str, float]:
        """Return cause → probability, uncalibrated.

        Parameters
        ----------
        change : Features
            Against the reference or against the twin, as the forest was fitted.
        tooth_load_n_per_mm : float
            See `gearsig.gap`; nan where it is not known.
        effects : iterable of GapEffect
            Whose textbook signs are asked, without a reference.
        """
        if change.names != self.floor.names:
            raise InputError(
                "the population belongs to other features than this version computes",
                remedy=MAKE_POPULATION,
            )
        load = tooth_load_n_per_mm if tooth_load_n_per_mm > 0.0 else self.usual_load_n_per_mm
        row = input_rows(self.floor, change.values[None], change.scatter[None], np.array([load]))[0]
        found = self.trees.probabilities(row)
        if self.linear is not None:
            told = self.linear.probabilities(_within_reach(row))
            found = (1.0 - LINEAR_SHARE) * found + LINEAR_SHARE * told
            found = found * self._by_the_rules(change, textbook_rules(effects))
        found = np.maximum(found, MIN_PROBABILITY)
        return dict(zip(self.causes, (found / found.sum()).tolist(), strict=True))

    def _by_the_rules(self, change: Features, rules: Iterable[tuple[str, Signs]]) -> FloatArray:
        """Return the factors of the causes, by how far features are from usual, in standard deviations."""
        names = self.floor.names
        spreads = self.floor.of(names) / REPEATABLE
        deviations = self.floor.from_centre(names, change.values) / spreads
        said = textbook_strengths(rules, dict(zip(names, deviations.tolist(), strict=True)))
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
    patterns = any(name.startswith("surprise.") for name in floor.names)
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
            np.log10(np.maximum(loads_n_per_mm, MIN_LOAD_N_PER_MM)),
        ]
    )


def fit_recogniser(population: Population, *, with_reference: bool, n_trees: int = N_TREES) -> Recogniser:
    """Return the recogniser that is fitted to a population."""
    fitted = _fit(population, with_reference=with_reference, n_trees=n_trees)
    return _with_floor(population, fitted, with_reference=with_reference)


def _with_floor(population: Population, fitted: Fitted, *, with_reference: bool) -> Recogniser:
    causes, trees, linear = fitted
    usual_load = float(np.median(population.loads_n_per_mm))
    return Recogniser(causes, population.floor(with_reference=with_reference), trees, usual_load, linear)


def _fit(population: Population, *, with_reference: bool, n_trees: int = N_TREES) -> Fitted:
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
        n_trees,
        bootstrap=True,
        max_samples=ROW_SHARE,
        max_features=FEATURE_SHARE,
        min_samples_leaf=MIN_IN_A_LEAF,
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
    seen: NDArray[np.bool_] = (sizes > MIN_SIZE) | np.isin(causes, (NONE, UNKNOWN))
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
