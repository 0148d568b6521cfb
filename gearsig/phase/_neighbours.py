"""Nearest neighbours in phase space that are not neighbours in time."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gearsig.checks import FloatArray
from gearsig.compiled import njit
from gearsig.errors import RefusalError
from gearsig.formatting import percent

IndexArray = NDArray[np.intp]

_FIRST_LOOK = 6
_LARGEST_LOOK = 1500


GOLDEN = 0.6180339887498949
"""Fractional part of the golden ratio: k times it, modulo one, is spread evenly whatever the number of k."""


def spaced(n: int, n_max: int) -> IndexArray:
    """Return at most `n_max` indices spread evenly over 0 to n - 1."""
    return np.unique(np.linspace(0, n - 1, min(n, n_max)).astype(np.intp))


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
    is asked for a few neighbours; where all of those are neighbours in time, it is walked through for one that is not.
    Equal points are passed over too unless `equal_counts`: a distance of zero has no logarithm.

    Parameters
    ----------
    points : array, (n, d)
    library, references : arrays of int
    theiler : int
        Samples.
    norm : float
        2: Euclidean, inf: largest coordinate.
    equal_counts : bool
        Whether a point at distance 0 is a neighbour.

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
    distances, positions = _query(tree, points[references], min(_FIRST_LOOK, len(library)), norm)
    times = library[np.minimum(positions, len(library) - 1)]
    apart = (np.abs(times - references[:, None]) > theiler) & np.isfinite(distances)
    if not equal_counts:
        apart &= distances > 0.0
    first, rows = apart.argmax(axis=1), np.flatnonzero(apart.any(axis=1))
    distance[rows], index[rows] = distances[rows, first[rows]], times[rows, first[rows]]
    open_ = np.flatnonzero(index < 0)
    n_equal = 0
    if len(open_) and len(library) > _FIRST_LOOK:
        distance[open_], index[open_], n_equal = _nearest_by_walk(
            tree, library, points[references[open_]], references[open_], theiler, norm, equal_counts=equal_counts
        )
        open_ = np.flatnonzero(index < 0)
    if len(open_) > 0.5 * len(references):
        raise _no_neighbour_error(len(open_) / len(references), theiler, exact=n_equal > len(open_) // 2)
    return distance, index


def _nearest_by_walk(
    tree: Any,
    library: IndexArray,
    points: FloatArray,
    now: IndexArray,
    theiler: int,
    norm: float,
    *,
    equal_counts: bool,
) -> tuple[FloatArray, IndexArray, int]:
    """Return distance and index as `nearest_apart`, and how many points met nothing but an equal one."""
    # So many neighbours in time there can be; one more is apart.
    n_near = int(2 * theiler * len(library) / max(1, int(library[-1]) - int(library[0]) + 1)) + 3
    nodes, places = _flat(tree)
    held, times = np.ascontiguousarray(tree.data[places]), library[places]
    low, high = np.empty((len(nodes), held.shape[1])), np.empty((len(nodes), held.shape[1]))
    first, last = np.empty(len(nodes), dtype=np.intp), np.empty(len(nodes), dtype=np.intp)
    fill_boxes(held, times, nodes, low, high, first, last)
    distance, place = np.empty(len(now)), np.empty(len(now), dtype=np.intp)
    equal = np.zeros(len(now), dtype=np.bool_)
    nearest(
        held,
        times,
        nodes,
        low,
        high,
        first,
        last,
        np.ascontiguousarray(points, dtype=np.float64),
        now,
        theiler,
        norm == np.inf,
        equal_counts,
        n_near >= _LARGEST_LOOK,
        min(n_near, _LARGEST_LOOK),
        distance,
        place,
        equal,
    )
    neighbour_times = np.where(place >= 0, times[place], -1)
    return distance, neighbour_times, int(np.count_nonzero(equal & (place < 0)))


def _flat(tree: Any) -> tuple[IndexArray, IndexArray]:
    """Return a k-d tree's nodes as rows (start, end, children or -1), the root first, and the order they count in."""
    rows, waiting = [[0, len(tree.indices), -1, -1]], [(0, tree.tree)]
    while waiting:
        row, node = waiting.pop()
        if node.split_dim < 0:
            continue
        for place, child in ((2, node.lesser), (3, node.greater)):
            rows[row][place] = len(rows)
            waiting.append((len(rows), child))
            rows.append([child.start_idx, child.end_idx, -1, -1])
    return np.array(rows, dtype=np.intp), np.asarray(tree.indices, dtype=np.intp)


def _no_neighbour_error(share: float, theiler: int, *, exact: bool) -> RefusalError:
    if exact:
        return RefusalError(
            "the path comes back to exactly the same points: it is periodic, or its resolution is too coarse",
            remedy="look at its Poincaré section: no neighbours can part here",
        )
    return RefusalError(
        f"{percent(share)} of the points have no neighbour but those within {theiler} samples in time: the path "
        "does not come back to where it was",
        remedy="record longer, take the trend out of the signal, or lower the Theiler window",
    )


def _query(tree: Any, points: FloatArray, k: int, norm: float) -> tuple[FloatArray, IndexArray]:
    distance, index = tree.query(np.ascontiguousarray(points), k=k, p=norm)
    return distance.reshape(len(points), k), index.reshape(len(points), k)


# The nearest neighbour that is none in time: a walk through a k-d tree that leaves out what is near in time.
#
# A tree that knows nothing of time would have to be asked for hundreds of neighbours, to find one that is apart.


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator,unused-ignore]
def fill_boxes(points, times, nodes, low, high, first, last):  # type: ignore[no-untyped-def]
    """Bound every node's points by low, high (n_nodes, d) and times by first, last; children stand behind parents.

    nodes : (n_nodes, 4): start and end in the points' order, both children or −1.
    """
    for node in range(nodes.shape[0] - 1, -1, -1):
        start, end, lesser, greater = nodes[node]
        if lesser < 0:
            low[node], high[node] = points[start], points[start]
            first[node], last[node] = times[start], times[start]
            for i in range(start + 1, end):
                for a in range(points.shape[1]):
                    low[node, a], high[node, a] = min(low[node, a], points[i, a]), max(high[node, a], points[i, a])
                first[node], last[node] = min(first[node], times[i]), max(last[node], times[i])
        else:
            for a in range(points.shape[1]):
                low[node, a] = min(low[lesser, a], low[greater, a])
                high[node, a] = max(high[lesser, a], high[greater, a])
            first[node], last[node] = min(first[lesser], first[greater]), max(last[lesser], last[greater])


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator,unused-ignore]
def nearest(  # type: ignore[no-untyped-def]
    points,
    times,
    nodes,
    low,
    high,
    first,
    last,
    references,
    now,
    theiler,
    largest,
    equal_counts,
    limited,
    n_max,
    distance,
    index,
    equal,
):
    """Fill distance, index (−1: none) and equal (an equal point was met) for `references` at times `now`.

    largest : whether the largest coordinate is the distance, else the Euclidean one.
    n_max : a neighbour with so many points closer than it, near in time or equal to it, does not count; looked at where
        `limited`, or where there are equal points.
    """
    waiting, ahead = np.empty(len(nodes), dtype=np.int64), np.empty(len(nodes))
    for r in range(references.shape[0]):
        best, nearest, n_waiting = np.inf, -1, 1
        waiting[0], ahead[0] = 0, 0.0
        while n_waiting > 0:
            n_waiting -= 1
            node = waiting[n_waiting]
            if ahead[n_waiting] >= best or (first[node] >= now[r] - theiler and last[node] <= now[r] + theiler):
                continue
            start, end, lesser, greater = nodes[node]
            if lesser >= 0:
                to_lesser = _to_box(references[r], low[lesser], high[lesser], largest)
                to_greater = _to_box(references[r], low[greater], high[greater], largest)
                if to_lesser < to_greater:
                    lesser, greater, to_lesser, to_greater = greater, lesser, to_greater, to_lesser
                waiting[n_waiting], ahead[n_waiting] = lesser, to_lesser
                waiting[n_waiting + 1], ahead[n_waiting + 1] = greater, to_greater
                n_waiting += 2
                continue
            for i in range(start, end):
                if abs(times[i] - now[r]) <= theiler:
                    continue
                size = _between(points[i], references[r], largest, best)
                if size == 0.0 and not equal_counts:
                    equal[r] = True
                elif size < best:
                    best, nearest = size, i
        if (
            (limited or equal[r])
            and nearest >= 0
            and _n_closer(points, nodes, low, high, references[r], largest, best, n_max, waiting) >= n_max
        ):
            best, nearest = np.inf, -1
        distance[r] = best if largest else np.sqrt(best)
        index[r] = nearest


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator,unused-ignore]
def _n_closer(points, nodes, low, high, point, largest, best, n_max, waiting):  # type: ignore[no-untyped-def]
    """Count the points that are closer than the neighbour, up to `n_max`."""
    n_closer, n_waiting = 0, 1
    waiting[0] = 0
    while n_waiting > 0 and n_closer < n_max:
        n_waiting -= 1
        node = waiting[n_waiting]
        start, end, lesser, greater = nodes[node]
        if _to_far_corner(point, low[node], high[node], largest) < best:
            n_closer += end - start
        elif lesser >= 0:
            for child in (lesser, greater):
                if _to_box(point, low[child], high[child], largest) < best:
                    waiting[n_waiting] = child
                    n_waiting += 1
        else:
            for i in range(start, end):
                if _between(points[i], point, largest, best) < best:
                    n_closer += 1
    return n_closer


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator,unused-ignore]
def _between(first, second, largest, enough):  # type: ignore[no-untyped-def]
    """Largest coordinate or sum of squares of the difference; what exceeds `enough` need not be exact."""
    size = 0.0
    for a in range(first.shape[0]):
        step = abs(first[a] - second[a])
        size = max(size, step) if largest else size + step * step
        if size >= enough:
            break
    return size


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator,unused-ignore]
def _to_box(point, low, high, largest):  # type: ignore[no-untyped-def]
    """Distance of a point to a box as `_between` measures it; 0 inside."""
    size = 0.0
    for a in range(point.shape[0]):
        step = max(low[a] - point[a], point[a] - high[a], 0.0)
        size = max(size, step) if largest else size + step * step
    return size


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator,unused-ignore]
def _to_far_corner(point, low, high, largest):  # type: ignore[no-untyped-def]
    """Distance of a point to what lies farthest from it in a box, as `_between` measures it."""
    size = 0.0
    for a in range(point.shape[0]):
        step = max(point[a] - low[a], high[a] - point[a])
        size = max(size, step) if largest else size + step * step
    return size
