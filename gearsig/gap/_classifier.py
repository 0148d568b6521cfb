"""Which causes changed features resemble: decision trees and a linear rule, learned from the population."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from math import nan
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gearsig.cache import read_arrays, write_arrays
from gearsig.checks import FloatArray, closest_match_hint
from gearsig.errors import InputError
from gearsig.gap._change import change_relative_to_mesh, contrast_rows, counted_from_the_mesh
from gearsig.gap._features import Features
from gearsig.gap._floors import FLOOR_IN_DEVIATIONS, StructuralFloor
from gearsig.gap._report import UNKNOWN
from gearsig.gap._simulator import GapEffect
from gearsig.rig import SIDES

# --------------------
# Decision trees as plain arrays, packed for a file shipped with the library.
# --------------------


LEAF = -1


@dataclass(frozen=True)
class ForestNodes:
    """Trees stored one after another with consecutive node numbers, depth first: a node's left branch follows it.

    Parameters
    ----------
    columns : int16 array, (n_nodes,)
        Input column by which a node splits; `LEAF` for a leaf.
    thresholds : float16 array, (n_nodes,)
        Values at or below the threshold go to the left branch.
    roots : int32 array, (n_trees,)
    shares : uint8 array, (n_leaves, n_causes)
        Shares of the causes in each leaf, in units of 1/`WHOLE`.
    """

    columns: NDArray[np.int16]
    thresholds: NDArray[np.float16]
    roots: NDArray[np.int32]
    shares: NDArray[np.uint8]

    @classmethod
    def of(cls, forest: Any) -> ForestNodes:
        """Return the nodes of a fitted scikit-learn forest, whose trees are numbered depth first, left before right."""
        trees = [estimator.tree_ for estimator in forest.estimators_]
        roots = np.cumsum([0, *(tree.node_count for tree in trees[:-1])]).astype(np.int32)
        columns = np.concatenate([tree.feature for tree in trees]).astype(np.int16)
        leaves = columns < 0
        columns[leaves] = LEAF
        counts = np.concatenate([tree.value[:, 0] for tree in trees])[leaves]
        shares = np.round(WHOLE * counts / counts.sum(axis=1, keepdims=True)).astype(np.uint8)
        largest = float(np.finfo(np.float16).max)
        thresholds = np.clip(np.concatenate([tree.threshold for tree in trees]), -largest, largest).astype(np.float16)
        return cls(columns, thresholds, roots, shares)

    @cached_property
    def _leaf(self) -> NDArray[np.intp]:
        """Row of `shares` of each node that is a leaf."""
        return np.cumsum(self.columns == LEAF) - 1

    @cached_property
    def _right(self) -> NDArray[np.intp]:
        """Start of each node's right branch: after a leaf comes that of the last node that still waits for it."""
        right, waiting = np.zeros(len(self.columns), dtype=np.intp), list[int]()
        for node, is_leaf in enumerate((self.columns == LEAF).tolist()):
            if not is_leaf:
                waiting.append(node)
            elif waiting:
                right[waiting.pop()] = node + 1
        return right

    def probabilities(self, row: FloatArray) -> FloatArray:
        """Return the mean of the trees' shares, (n_causes,), for one row of input."""
        values, nodes = row.astype(np.float32), self.roots.astype(np.intp)
        while True:
            columns = self.columns[nodes]
            leaves = columns == LEAF
            if leaves.all():
                break
            goes_left = values[columns] <= self.thresholds[nodes]
            nodes = np.where(leaves, nodes, np.where(goes_left, nodes + 1, self._right[nodes]))
        shares: FloatArray = self.shares[self._leaf[nodes]].astype(np.float64).mean(axis=0)
        shares /= shares.sum()
        return shares


WHOLE = 15
"""Unit of stored shares is 1/`WHOLE`: the mean over hundreds of trees is much finer."""


@dataclass(frozen=True)
class LinearRule:
    """A linear classifier: probabilities are the softmax of W x + b.

    Parameters
    ----------
    weights : array, (n_causes, n_columns)
    offsets : array, (n_causes,)
    """

    weights: FloatArray
    offsets: FloatArray

    def probabilities(self, row: FloatArray) -> FloatArray:
        """Return the probabilities of the causes, (n_causes,), for one row of input."""
        levels = self.weights @ row + self.offsets
        weights = np.exp(levels - levels.max())
        probabilities: FloatArray = weights / weights.sum()
        return probabilities


# --------------------
# Clusters of one machine's effects: learned from machines with several recordings of each effect.
# --------------------


N_DIRECTIONS = 40
"""Number of directions in which recordings are compared: of 20, 40 and 80 no worse than the others on simulators left
out."""

WITHIN_SHRINKAGE = 0.3
"""Shrinkage of the covariance within a machine's effect towards its diagonal."""

MIN_BETWEEN = 0.05


@dataclass(frozen=True)
class LabelSpace:
    """Directions that separate a machine's effects, x = Dᵀ z; recordings of one effect scatter by 1 in each.

    x ~ (μ, 1), μ ~ (m_c, b): cause c is at μ on one machine, and around m_c on all machines. Given a labelled recording
    x_1 of it, μ ~ ((m_c + b x_1)/(1 + b), b/(1 + b)). The likelihood of a further recording follows from this and the
    unit scatter, with Student's tails.

    Source: S. Ioffe, "Probabilistic linear discriminant analysis", ECCV 2006.

    Parameters
    ----------
    directions : array, (n_columns, k)
        Applied to a classifier's input.
    causes : tuple of str
    means : array, (n_causes, k)
    between : array, (k,)
        Variance of machines around the means.
    whole : arrays, (2, k)
        Mean and variance over all causes and machines, for an effect that is not in the population.
    """

    directions: FloatArray
    causes: tuple[str, ...]
    means: FloatArray
    between: FloatArray
    whole: FloatArray

    def log_ratios(self, row: FloatArray, rows: FloatArray, cause: str) -> FloatArray:
        """Return ln p(x | cause, labelled recording of it) − ln p(x | cause) for each labelled recording, (n,).

        Parameters
        ----------
        row : array, (n_columns,)
            Input of the recording.
        rows : array, (n, n_columns)
            Inputs of the labelled recordings.
        cause : str
            Their label.
        """
        known = cause in self.causes and cause != UNKNOWN
        mean = self.means[self.causes.index(cause)] if known else self.whole[0]
        between = self.between if known else self.whole[1]
        x, variance = row @ self.directions, between / (1.0 + between)
        centres = (mean + between * (rows @ self.directions)) / (1.0 + between)
        ratios: FloatArray = np.sum(_log_student(x - centres, 1.0 + variance), axis=1) - np.sum(
            _log_student(x - mean, 1.0 + between)
        )
        return ratios


DEGREES = 3.0
"""Degrees of freedom: place and severity differ between recordings, which is not normal scatter. On a simulator left
out, a normal density is overconfident from the first labelled recording on (log loss 1.21 → 1.58), Student's is not
(0.95)."""


def _log_student(away: FloatArray, variance: FloatArray) -> FloatArray:
    """Return the logarithm of Student's density, without its constant, with the given variance as squared scale."""
    return np.asarray(-0.5 * ((DEGREES + 1.0) * np.log1p(away**2 / variance / DEGREES) + np.log(variance)))


def fit_label_space(rows: FloatArray, causes: NDArray[np.str_], machines: NDArray[np.int64]) -> LabelSpace:
    """Return the directions with the largest ratio of variance between machines' effects to that within one.

    Parameters
    ----------
    rows : array, (n, n_columns)
        Input of a classifier.
    causes : array of str, (n,)
    machines : int array, (n,)
    """
    from scipy.linalg import eigh

    names, cause = np.unique(causes, return_inverse=True)
    _, first, group = np.unique(machines * len(names) + cause, return_index=True, return_inverse=True)
    counts = np.bincount(group)
    centres = np.zeros((len(counts), rows.shape[1]))
    np.add.at(centres, group, rows)
    centres /= counts[:, None]
    several = counts[group] > 1
    apart = rows[several] - centres[group[several]]
    within = apart.T @ apart / max(int((counts[counts > 1] - 1).sum()), 1)
    diagonal = np.diag(within) + 1e-3 / WITHIN_SHRINKAGE  # also for features that never changed
    regular = (1.0 - WITHIN_SHRINKAGE) * within + WITHIN_SHRINKAGE * np.diag(diagonal)
    _, vectors = eigh(np.cov(centres.T), regular)
    directions = vectors[:, ::-1][:, :N_DIRECTIONS]
    projected, of = centres @ directions, cause[first]
    means = np.array([projected[of == i].mean(axis=0) for i in range(len(names))])
    spread = np.mean((projected - means[of]) ** 2, axis=0) - np.mean(1.0 / counts)
    whole = np.array([projected.mean(axis=0), projected.var(axis=0)])
    return LabelSpace(directions, tuple(map(str, names)), means, np.maximum(spread, MIN_BETWEEN), whole)


# --------------------
# Textbook rules: effects define their signs as features of `feature_values` and `change_feature_values`; of several
# rules for a cause the strongest counts.
# --------------------


Signs = tuple[tuple[str, int], ...]

NEUTRAL_STRENGTH = 1.0
"""Strength assumed for no gap, which has no rule: healthy machines deviate by one spread."""

MAX_OF_A_SIGN = 8.0
"""In spreads: a single sign must not dominate a rule of three."""


def textbook_rules(effects: Iterable[GapEffect]) -> list[tuple[str, Signs]]:
    """Return cause and signs of each rule: of the effects, and for lines and modulations of unknown origin."""
    of_effects = [(effect.name, effect.signs) for effect in effects if effect.signs]
    return [*of_effects, (UNKNOWN, (("envelope.strange", 1),)), (UNKNOWN, (("line.strange", 1),))]


def rule_strengths(signs: Signs, deviations: Mapping[str, float]) -> dict[str, float]:
    """Return side → mean of a rule's signs in units of their spreads; the key is "" for a rule without sides.

    Raises
    ------
    InputError
        If a sign names an unknown feature.
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
    """Return cause → strength of its strongest rule on either side, in spreads.

    Parameters
    ----------
    rules : iterable of (str, signs)
        See `textbook_rules`.
    deviations : mapping
        Feature → deviation from the usual value, in spreads of healthy machines.
    """
    strongest: dict[str, float] = {}
    for cause, signs in rules:
        strength = max(rule_strengths(signs, deviations).values())
        strongest[cause] = max(strength, strongest.get(cause, -np.inf))
    return strongest


LINEAR_SHARE, LINEAR_REACH = 0.5, 8.0
"""Weight of a linear discriminant in the probabilities without a reference, and the limit of its input. Without a
reference, most of what is seen is the difference between machines: trees split along single features and miss a small
change across it, while a pooled covariance removes it."""

RULES_WEIGHT = 0.3
"""Weight w of the textbook rules without a reference, p ∝ p_learned exp(w strength): the balance of lines differs
between the population's machines and others. Where nothing cancels that baseline, the few signs of the rules hold on
any machine."""

MIN_PROBABILITY = 2e-3
"""Minimum probability that a forest gives any cause: that no tree voted for it is no proof."""

MIN_LOAD_N_PER_MM = 0.01
"""Minimum tooth load; smaller loads count as this."""


@dataclass(frozen=True)
class EffectClassifier:
    """A fitted forest with the floors by which its input is scaled.

    Parameters
    ----------
    causes : tuple of str
        Causes to which the probabilities belong.
    floor : StructuralFloor
    trees : ForestNodes
    usual_load_n_per_mm : float
        Tooth load assumed where the rig does not determine it.
    labels : LabelSpace
        Clusters of one machine's effects, for labelled recordings.
    linear : LinearRule or None
        Used in addition to the forest, with the weight `LINEAR_SHARE`.
    """

    causes: tuple[str, ...]
    floor: StructuralFloor
    trees: ForestNodes
    usual_load_n_per_mm: float
    labels: LabelSpace
    linear: LinearRule | None = None

    def probabilities(
        self, change: Features, tooth_load_n_per_mm: float = nan, effects: Iterable[GapEffect] = ()
    ) -> dict[str, float]:
        """Return cause → probability, uncalibrated.

        Parameters
        ----------
        change : Features
            Against the reference or the twin, whichever the forest was fitted to.
        tooth_load_n_per_mm : float
            See `tooth_load_n_per_mm`; nan where not known.
        effects : iterable of GapEffect
            Effects whose textbook signs are used without a reference.
        """
        row = self.input_row(change, tooth_load_n_per_mm)
        shares = self.trees.probabilities(row)
        if self.linear is not None:
            linear_shares = self.linear.probabilities(clipped_discriminant_input(row))
            shares = (1.0 - LINEAR_SHARE) * shares + LINEAR_SHARE * linear_shares
            shares = shares * self._rule_factors(change, textbook_rules(effects))
        shares = np.maximum(shares, MIN_PROBABILITY)
        return dict(zip(self.causes, (shares / shares.sum()).tolist(), strict=True))

    def input_row(self, change: Features, tooth_load_n_per_mm: float = nan) -> FloatArray:
        """Return the input of trees and rules for a change, see `input_rows`."""
        if change.names != self.floor.names:
            raise InputError(
                "what was learned belongs to other features than this version computes",
                remedy="make it anew: python -m app.studies.gap.population learn",
            )
        load = tooth_load_n_per_mm if tooth_load_n_per_mm > 0.0 else self.usual_load_n_per_mm
        row: FloatArray = input_rows(self.floor, change.values[None], change.scatter[None], np.array([load]))[0]
        return row

    def _rule_factors(self, change: Features, rules: Iterable[tuple[str, Signs]]) -> FloatArray:
        """Return the factors of the causes, from the deviations of features in standard deviations."""
        names = self.floor.names
        spreads = self.floor.of(names) / FLOOR_IN_DEVIATIONS
        deviations = self.floor.from_centre(names, change.values) / spreads
        strengths = textbook_strengths(rules, dict(zip(names, deviations.tolist(), strict=True)))
        factors: FloatArray = np.exp(
            RULES_WEIGHT * np.array([strengths.get(name, NEUTRAL_STRENGTH) for name in self.causes])
        )
        return factors


BURST_UNIT_DB = 10.0
"""Unit of a burst's shares, which keeps them within `LINEAR_REACH`."""


def input_rows(
    floor: StructuralFloor, changes: FloatArray, scatter: FloatArray, loads_n_per_mm: FloatArray
) -> FloatArray:
    """Return the forest's input: changes over both floors, and the contrasts between them.

    Features themselves are not used: a tachometer with more jitter than any in the population does not mean a hunting
    speed. Levels are included twice: as they changed, and as far as the change holds both relative to the mesh and by
    itself. Where two averages can be subtracted, the difference shows the change of a tooth, so changes in either
    average's own tooth features are omitted. Against a simulation, only the swing of the speed counts: beside the
    tachometer's jitter, its steadiness says more about the tachometer. A burst's shares describe a shape and are not
    scaled by floors.
    """
    patterns = any(name.startswith("surprise.") for name in floor.names)
    left_out = ("tooth.", "burst.") if patterns else ("speed.drift", "speed.swing_line")
    kept = [i for i, name in enumerate(floor.names) if not name.startswith(left_out)]
    names = [floor.names[i] for i in kept]
    distances = floor.from_centre(floor.names, changes)[:, kept]
    scatters = np.hypot(floor.of(names) / FLOOR_IN_DEVIATIONS, scatter[:, kept])
    held = contrast_rows(names, change_relative_to_mesh(names, distances) / scatters)
    further = np.ones(held.shape[1], dtype=bool)
    further[: 2 * len(names)] = np.tile(counted_from_the_mesh(names) != 0.0, 2)  # the others are unchanged
    return np.column_stack(
        [
            contrast_rows(names, distances / scatters),
            held[:, further],
            changes[:, [i for i, name in enumerate(floor.names) if name.startswith("burst.")]] / BURST_UNIT_DB,
            np.log10(np.maximum(loads_n_per_mm, MIN_LOAD_N_PER_MM)),
        ]
    )


def clipped_discriminant_input(rows: FloatArray) -> FloatArray:
    """Return the input of the linear discriminant, clipped so that no column dominates."""
    reached: FloatArray = np.clip(rows, -LINEAR_REACH, LINEAR_REACH)
    return reached


# --------------------
# Everything that a diagnosis uses of the population, as plain arrays in one file shipped with the library.
# --------------------


LEARNED_FILE = Path(__file__).with_name("learned.npz")
MAX_BYTES = 100_000_000
"""Limit of its arrays; a real file has a tenth."""
_TREES = ("columns", "thresholds", "roots", "shares")
_LINEAR = ("weights", "offsets")
_LABELS = ("directions", "means", "between", "whole")
_WAYS = {True: "with_reference", False: "without_reference"}


@dataclass(frozen=True)
class Learned:
    """What was learned from the population.

    Parameters
    ----------
    feature_names : tuple of str
    credibility : array, (n_features,)
        Fraction of the simulated value of each feature that holds for healthy machines, 0 to 1.
    classifiers : mapping
        With a reference (True) and without (False).
    """

    feature_names: tuple[str, ...]
    credibility: FloatArray
    classifiers: Mapping[bool, EffectClassifier] = field(repr=False)

    @property
    def change_names(self) -> tuple[str, ...]:
        """Names of changes against a reference; those of the features come first."""
        return self.classifiers[True].floor.names

    @property
    def causes(self) -> tuple[str, ...]:
        """Causes that can be recognised, including "none" and "unknown"."""
        return self.classifiers[True].causes

    def floor(self, *, with_reference: bool) -> StructuralFloor:
        """Return the distances of healthy machines from themselves on another day, or from their simulation."""
        return self.classifiers[with_reference].floor


def write_learned(learned: Learned, path: Path) -> None:
    """Write it atomically as plain arrays, rounded without effect on any result.

    Raises
    ------
    InputError
        If the folder cannot be written.
    """
    arrays: dict[str, Any] = {
        "feature_names": np.array(learned.feature_names),
        "credibility": learned.credibility.astype(np.float32),
    }
    for flag, way in _WAYS.items():
        classifier = learned.classifiers[flag]
        arrays_of_classifier = {key: getattr(classifier.trees, key) for key in _TREES} | {
            "causes": np.array(classifier.causes),
            "usual_load_n_per_mm": np.float64(classifier.usual_load_n_per_mm),
            "floor_names": np.array(classifier.floor.names),
            "floors": classifier.floor.values.astype(np.float32),
            "centres": np.asarray(classifier.floor.centres, dtype=np.float32),
            "largest": np.float64(classifier.floor.floor_size(classifier.floor.names)),
            "labels": np.array(classifier.labels.causes),
        }
        arrays_of_classifier |= {key: getattr(classifier.labels, key).astype(np.float32) for key in _LABELS}
        if classifier.linear is not None:
            arrays_of_classifier |= {key: getattr(classifier.linear, key).astype(np.float16) for key in _LINEAR}
        arrays |= {f"{way}/{key}": array for key, array in arrays_of_classifier.items()}
    write_arrays(path, arrays)


def read_learned(path: Path) -> Learned | None:
    """Return the contents of a file; None where it is missing or damaged."""
    arrays = read_arrays(path, MAX_BYTES)
    if arrays is None:
        return None
    try:
        names = tuple(map(str, arrays["feature_names"]))
        classifiers = {flag: _classifier_from(arrays, way) for flag, way in _WAYS.items()}
        return Learned(names, arrays["credibility"].astype(np.float64), classifiers)
    except (KeyError, TypeError, ValueError):
        return None


def _classifier_from(arrays: Mapping[str, Any], way: str) -> EffectClassifier:
    stored = {key.removeprefix(f"{way}/"): array for key, array in arrays.items() if key.startswith(f"{way}/")}
    floor = StructuralFloor(
        tuple(map(str, stored["floor_names"])),
        stored["floors"].astype(np.float64),
        stored["centres"].astype(np.float64),
        float(stored["largest"]),
    )
    linear = LinearRule(*(stored[key].astype(np.float64) for key in _LINEAR)) if _LINEAR[0] in stored else None
    directions, *remaining = (stored[key].astype(np.float64) for key in _LABELS)
    labels = LabelSpace(directions, tuple(map(str, stored["labels"])), *remaining)
    trees, usual_load = ForestNodes(*(stored[key] for key in _TREES)), float(stored["usual_load_n_per_mm"])
    return EffectClassifier(tuple(map(str, stored["causes"])), floor, trees, usual_load, labels, linear)
