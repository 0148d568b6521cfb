"""The nearest neighbour that is none in time: a walk through a k-d tree that leaves out what is near in time.

A tree that knows nothing of time would have to be asked for hundreds of neighbours, to find one that is apart.
"""

from __future__ import annotations

import numpy as np
from numba import njit


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
    here,
    now,
    theiler,
    largest,
    equal_counts,
    limited,
    most,
    distance,
    index,
    equal,
):
    """Fill distance, index (−1: none) and equal (an equal point was met) for the references `here` at times `now`.

    largest : whether the largest coordinate is the distance, else the Euclidean one.
    most : a neighbour with so many points closer than it, near in time or equal to it, does not count; looked at where
        `limited`, or where there are equal points.
    """
    waiting, ahead = np.empty(len(nodes), dtype=np.int64), np.empty(len(nodes))
    for r in range(here.shape[0]):
        best, found, n_waiting = np.inf, -1, 1
        waiting[0], ahead[0] = 0, 0.0
        while n_waiting > 0:
            n_waiting -= 1
            node = waiting[n_waiting]
            if ahead[n_waiting] >= best or (first[node] >= now[r] - theiler and last[node] <= now[r] + theiler):
                continue
            start, end, lesser, greater = nodes[node]
            if lesser >= 0:
                one = _to_box(here[r], low[lesser], high[lesser], largest)
                other = _to_box(here[r], low[greater], high[greater], largest)
                if one < other:
                    lesser, greater, one, other = greater, lesser, other, one
                waiting[n_waiting], ahead[n_waiting] = lesser, one
                waiting[n_waiting + 1], ahead[n_waiting + 1] = greater, other
                n_waiting += 2
                continue
            for i in range(start, end):
                if abs(times[i] - now[r]) <= theiler:
                    continue
                size = _between(points[i], here[r], largest, best)
                if size == 0.0 and not equal_counts:
                    equal[r] = True
                elif size < best:
                    best, found = size, i
        if (
            (limited or equal[r])
            and found >= 0
            and _n_closer(points, nodes, low, high, here[r], largest, best, most, waiting) >= most
        ):
            best, found = np.inf, -1
        distance[r] = best if largest else np.sqrt(best)
        index[r] = found


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator,unused-ignore]
def _n_closer(points, nodes, low, high, here, largest, best, most, waiting):  # type: ignore[no-untyped-def]
    """Count the points that are closer than the neighbour, up to `most`."""
    n_closer, n_waiting = 0, 1
    waiting[0] = 0
    while n_waiting > 0 and n_closer < most:
        n_waiting -= 1
        node = waiting[n_waiting]
        start, end, lesser, greater = nodes[node]
        if _to_far_corner(here, low[node], high[node], largest) < best:
            n_closer += end - start
        elif lesser >= 0:
            for child in (lesser, greater):
                if _to_box(here, low[child], high[child], largest) < best:
                    waiting[n_waiting] = child
                    n_waiting += 1
        else:
            for i in range(start, end):
                if _between(points[i], here, largest, best) < best:
                    n_closer += 1
    return n_closer


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator,unused-ignore]
def _between(one, other, largest, enough):  # type: ignore[no-untyped-def]
    """Largest coordinate or sum of squares of the difference; what exceeds `enough` need not be exact."""
    size = 0.0
    for a in range(one.shape[0]):
        step = abs(one[a] - other[a])
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
