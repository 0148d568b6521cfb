"""Nearest neighbours in phase space that are not neighbours in time."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gearsig.checks import FloatArray
from gearsig.errors import RefusalError

IndexArray = NDArray[np.intp]

_FIRST_LOOK = 6
_LARGEST_LOOK = 1500


def spaced(n: int, n_most: int) -> IndexArray:
    """Return at most `n_most` indices spread evenly over 0 to n - 1."""
    return np.unique(np.linspace(0, n - 1, min(n, n_most)).astype(np.intp))


def nearest_apart(
    points: FloatArray,
    library: IndexArray,
    references: IndexArray,
    theiler: int,
    norm: float = 2.0,
    *,
    equal_counts: bool = False,
) -> tuple[FloatArray, IndexArray]:
    """Return distance and index of each reference's nearest library point more than `theiler` samples away.

    Neighbours in time are close because the path is smooth, not because it returned: they are passed over. The k-d tree
    is asked for a few neighbours first, and for more where all of those were neighbours in time. Equal points are
    passed over too unless `equal_counts`: a distance of zero has no logarithm.

    Parameters
    ----------
    points : array, (n, d)
    library, references : arrays of int
    theiler : int
        Samples.
    norm : float
        2: Euclidean, inf: largest coordinate.

    Returns
    -------
    distance, index : arrays, (n_references,)
        inf and -1 where a reference has none among its nearest 1500.

    Raises
    ------
    RefusalError
        If fewer than half of the references have one: the path hardly ever comes back to where it was, or exactly.

    Source of the window: J. Theiler, *Spurious dimension from correlation algorithms applied to limited time-series
    data*, Physical Review A 34 (1986).
    """
    from scipy.spatial import cKDTree

    tree = cKDTree(np.ascontiguousarray(points[library]), balanced_tree=False, compact_nodes=False)
    distance = np.full(len(references), np.inf)
    index = np.full(len(references), -1, dtype=np.intp)
    open_ = np.arange(len(references))
    per_step = len(library) / max(1, int(library[-1]) - int(library[0]) + 1)
    # So many neighbours in time there can be; one more is apart.
    most = min(len(library), _LARGEST_LOOK, int(2 * theiler * per_step) + 3)
    k = min(_FIRST_LOOK, most)
    n_equal = 0
    while len(open_):
        found_d, found_i = _query(tree, points[references[open_]], k, norm)
        times = library[np.minimum(found_i, len(library) - 1)]
        apart = (np.abs(times - references[open_][:, None]) > theiler) & np.isfinite(found_d)
        if not equal_counts:
            n_equal = int(np.count_nonzero((apart & (found_d == 0.0)).any(axis=1)))
            apart &= found_d > 0.0
        first, has = apart.argmax(axis=1), apart.any(axis=1)
        rows = np.flatnonzero(has)
        distance[open_[rows]] = found_d[rows, first[rows]]
        index[open_[rows]] = times[rows, first[rows]]
        open_ = open_[~has]
        if k >= most:
            break
        k = min(6 * k, most)
    if len(open_) > 0.5 * len(references):
        raise _no_return(len(open_) / len(references), theiler, exact=n_equal > len(open_) // 2)
    return distance, index


def _no_return(share: float, theiler: int, *, exact: bool) -> RefusalError:
    if exact:
        return RefusalError(
            "the path comes back to exactly the same points: it is periodic, or its resolution is too coarse",
            remedy="look at its Poincaré section: no neighbours can part here",
        )
    return RefusalError(
        f"{share:.0%} of the points have no neighbour but those within {theiler} samples in time: the path does not "
        "come back to where it was",
        remedy="record longer, take the trend out of the signal, or lower the Theiler window",
    )


def _query(tree: Any, points: FloatArray, k: int, norm: float) -> tuple[FloatArray, IndexArray]:
    distance, index = tree.query(np.ascontiguousarray(points), k=k, p=norm)
    return distance.reshape(len(points), k), index.reshape(len(points), k)
