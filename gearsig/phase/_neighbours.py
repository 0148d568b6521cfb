"""Nearest neighbours in phase space that are not neighbours in time."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gearsig.checks import FloatArray
from gearsig.errors import RefusalError
from gearsig.formatting import percent

IndexArray = NDArray[np.intp]

_FIRST_LOOK = 6
_LARGEST_LOOK = 1500


GOLDEN = 0.6180339887498949
"""Fractional part of the golden ratio: its multiples modulo one are evenly spread for any number of them."""


def evenly_spaced_indices(n: int, n_max: int) -> IndexArray:
    """Return at most `n_max` indices spread evenly over 0 to n - 1."""
    return np.unique(np.linspace(0, n - 1, min(n, n_max)).astype(np.intp))


def nearest_beyond_theiler_window(
    points: FloatArray,
    library: IndexArray,
    references: IndexArray,
    theiler: int,
    norm: float = 2.0,
    *,
    equal_counts: bool = False,
) -> tuple[FloatArray, IndexArray]:
    """Return distance and index of each reference's nearest library point more than `theiler` samples away.

    Neighbours in time are close because the path is smooth, not because it returned: they are skipped. The k-d tree is
    queried for a few neighbours, and for more, up to 1500, if all of these are neighbours in time. Equal points are
    also skipped unless `equal_counts`, as a distance of zero has no logarithm.

    Parameters
    ----------
    points : array, (n, d)
    library, references : arrays of int
    theiler : int
        Samples.
    norm : float
        2: Euclidean, inf: largest coordinate.
    equal_counts : bool
        Whether a point at distance 0 counts as a neighbour.

    Returns
    -------
    distance, index : arrays, (n_references,)
        inf and -1 if a reference has none among its nearest 1500.

    Raises
    ------
    RefusalError
        If fewer than half of the references have one: the path hardly ever returns close to itself, or returns exactly.

    Source of the window: J. Theiler, *Spurious dimension from correlation algorithms applied to limited time-series
    data*, Physical Review A 34 (1986).
    """
    from scipy.spatial import cKDTree

    tree = cKDTree(np.ascontiguousarray(points[library]), balanced_tree=False, compact_nodes=False)
    # Maximum number of neighbours in time; one more must lie outside the window.
    n_near = int(2 * theiler * len(library) / max(1, int(library[-1]) - int(library[0]) + 1)) + 3
    largest = min(max(n_near, _FIRST_LOOK), _LARGEST_LOOK, len(library))
    distance = np.full(len(references), np.inf)
    index = np.full(len(references), -1, dtype=np.intp)
    open_, n_equal = np.arange(len(references)), 0
    for k in sorted({min(k, largest) for k in (_FIRST_LOOK, 8 * _FIRST_LOOK, largest)}):
        now = references[open_]
        answer = tree.query(np.ascontiguousarray(points[now]), k=[*range(1, k + 1)], p=norm)
        distances, positions = map(np.asarray, answer)
        times = library[np.minimum(positions, len(library) - 1)]
        apart = (np.abs(times - now[:, None]) > theiler) & np.isfinite(distances)
        is_equal = apart & (distances == 0.0)
        if not equal_counts:
            apart &= ~is_equal
        first, is_found = apart.argmax(axis=1), apart.any(axis=1)
        rows = np.flatnonzero(is_found)
        distance[open_[rows]], index[open_[rows]] = distances[rows, first[rows]], times[rows, first[rows]]
        open_, n_equal = open_[~is_found], int(is_equal[~is_found].any(axis=1).sum())
        if not len(open_):
            break
    if len(open_) > 0.5 * len(references):
        raise _no_neighbour_error(len(open_) / len(references), theiler, exact=n_equal > len(open_) // 2)
    return distance, index


def _no_neighbour_error(share: float, theiler: int, *, exact: bool) -> RefusalError:
    if exact:
        return RefusalError(
            "the path returns to exactly the same points: it is periodic, or its resolution is too coarse",
            remedy="look at its Poincaré section: no neighbours can diverge here",
        )
    return RefusalError(
        f"{percent(share)} of the points have only neighbours within {theiler} samples in time: the path does not "
        "return close to itself",
        remedy="record longer, remove the trend from the signal, or lower the Theiler window",
    )
