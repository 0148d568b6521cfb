"""Decision trees as plain arrays: they can be kept in a file without running anything from it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gearsig.checks import FloatArray

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
