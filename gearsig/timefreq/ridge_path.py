"""The best smooth path through a table of scores, by dynamic programming over place and slope."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from gearsig.checks import FloatArray

_MOST_COLUMNS_PER_NODE = 8
_FEWEST_NODES = 48
_MOST_BEND = 4


NOT_HIDDEN = -(1 << 14)
"""Mark of cells that no other path covers."""
CREDIT = 0.3  # score of a hidden cell for a path that crosses: what lies there cannot be seen
_NOTHING = 0.1  # score below which a cell holds no ridge
_ASTRAY = 2.0  # columns that a line costs where no ridge is: else paths leap to whatever is clearer for a while
_LEAST_ANGLE = 2  # lines per node by which slopes must differ to cross


def nodes_apart(n_columns: int) -> int:
    """Return how many columns lie between nodes: eight, fewer in short tables."""
    return min(_MOST_COLUMNS_PER_NODE, max(1, n_columns // _FEWEST_NODES))


def best_path(
    scores: FloatArray, hidden: NDArray[np.int16], steepest: float, stiffness: float, *, credit: float = CREDIT
) -> FloatArray:
    """Return the line of the path in each column.

    The path is a chain of straight pieces over q columns each (eight, fewer in short tables), each rising by s lines.
    It maximises Σ scores along the path - `stiffness` Σ max(|s' - s| - 1, 0)²: it pays for changes of slope and not for
    slope, so that it goes straight through a crossing instead of turning into the other branch. Changes by one are
    free, as slopes between whole numbers need them. Where no ridge is, each line that it travels costs two columns: so
    it waits for a component that fades, and leaps to another one only if that is clearer for long.

    Parameters
    ----------
    scores : array, (n_lines, n_columns)
        0 to 1.
    hidden : array, (n_lines, n_columns)
        Slope, in lines per node, of the path that covers the cell, or `NOT_HIDDEN`. Covered cells score for paths that
        cross that one, and not for paths along it.
    steepest : float
        Lines per column.
    stiffness : float
    credit : float
        Score of a covered cell for a path that crosses. With one, a path may weave to and fro across another.
    """
    q = nodes_apart(scores.shape[1])
    n_slopes = min(max(1, int(np.ceil(steepest * q))), scores.shape[0] - 1)
    table = np.ascontiguousarray(scores, dtype=np.float32)
    path: FloatArray = _search(table, hidden, n_slopes, np.float32(stiffness), np.float32(credit), q).astype(np.float64)
    return path


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator,unused-ignore]
def _search(scores, hidden, S, stiffness, credit, q):  # type: ignore[no-untyped-def]
    """Viterbi recursion over states (line, slope index s + S)."""
    n_lines, n_columns = scores.shape
    n_nodes = (n_columns + q - 1) // q
    n_s = 2 * S + 1
    best = np.zeros((n_lines, n_s), dtype=np.float32)
    came = np.zeros((n_nodes, n_lines, n_s), dtype=np.int16)
    moved = np.empty((n_lines, n_s), dtype=np.float32)
    for node in range(n_nodes):
        moved[:] = -1e30
        for k in range(n_lines):
            for i in range(n_s):
                to = k + i - S
                if to < 0 or to >= n_lines:
                    continue
                total = best[k, i]
                for c in range(min(q, n_columns - node * q)):
                    line, column = _at(k, i - S, c, q), node * q + c
                    if hidden[line, column] == NOT_HIDDEN:
                        total += scores[line, column]
                        if scores[line, column] < _NOTHING:
                            total -= stiffness * _ASTRAY * abs(i - S) / q
                    elif abs(i - S - hidden[line, column]) >= _LEAST_ANGLE:
                        total += credit
                moved[to, i] = total
        for k in range(n_lines):
            for i in range(n_s):
                top, source = np.float32(-1e30), i
                for j in range(max(0, i - _MOST_BEND), min(n_s, i + _MOST_BEND + 1)):
                    bend = max(abs(i - j) - 1, 0)
                    value = moved[k, j] - stiffness * bend * bend
                    if value > top:
                        top, source = value, j
                best[k, i] = top
                came[node, k, i] = source
    return _read_back(best, came, n_columns, S, q)


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator,unused-ignore]
def _read_back(best, came, n_columns, S, q):  # type: ignore[no-untyped-def]
    """Follow the best final state back to the first column."""
    flat = np.argmax(best)
    k, i = flat // best.shape[1], flat % best.shape[1]
    path = np.empty(n_columns, dtype=np.int64)
    for node in range(came.shape[0] - 1, -1, -1):
        i = came[node, k, i]
        k -= i - S
        for c in range(min(q, n_columns - node * q)):
            path[node * q + c] = _at(k, i - S, c, q)
    return path


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator,unused-ignore]
def _at(k, s, c, q):  # type: ignore[no-untyped-def]
    """Line after c of q columns on the way from k to k + s, rounded."""
    return k + (2 * s * c + q) // (2 * q)
