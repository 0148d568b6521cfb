"""Speed over time from short-time comb scores: the path that collects most score without jumping."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from gearsig.angle.comb_lines import CombLines
from gearsig.angle.comb_score import candidate_speeds, score_candidates
from gearsig.angle.line_evidence import line_evidence
from gearsig.checks import FloatArray

# Standard deviation of the change of log speed from block to block, in steps of the speed grid, at least.
_STEPS = 6.0
_N_KEPT = 200  # best candidates of each block; the others are not on any good path
_HIGHEST_COST = 20.0  # of a jump: a few blocks without lines must not decide over the rest


@dataclass(frozen=True)
class SpeedRidge:
    """Speed at the middles of blocks.

    Parameters
    ----------
    time_s, speed_rev_per_s : arrays, (n_blocks,)
    score : float
        Mean score per block along the path.
    """

    time_s: FloatArray
    speed_rev_per_s: FloatArray
    score: float


def track_speed(
    samples: FloatArray, rate: float, comb: CombLines, low: float, high: float, top: float, n_block: int, change: float
) -> SpeedRidge:
    """Return the most likely course of speed.

    `change` is the standard deviation of the change of log speed from block to block, or six steps of the grid if
    that is more.
    Blocks at half overlap are scored for all speeds; the path maximises Σ score - Σ min((Δ ln speed)²/(2σ²), 8),
    found by dynamic
    programming over the best candidates of each block (A. J. Viterbi, *Error bounds for convolutional codes …*, IEEE
    Trans. Inf. Theory 13 (1967)).
    """
    starts = np.arange(0, samples.shape[1] - n_block + 1, max(1, n_block // 2))
    speeds: FloatArray | None = None
    rows = []
    for start in starts:
        evidence = line_evidence(samples[:, start : start + n_block], rate, n_block, top)
        if speeds is None:
            speeds = candidate_speeds(low, high, comb.highest, evidence)
        rows.append(score_candidates(evidence, comb, speeds))
    assert speeds is not None  # noqa: S101  # there is at least one block: the caller chooses n_block
    scores = np.array(rows)
    kept = _best_candidates(scores)
    kept_scores = np.take_along_axis(scores, kept, axis=1)
    sigma = max(_STEPS * float(np.log(speeds[1] / speeds[0])), change)
    path = _best_path(np.log(speeds)[kept] / sigma, kept_scores, _HIGHEST_COST)
    at = np.arange(len(path))
    return SpeedRidge((starts + n_block / 2) / rate, speeds[kept[at, path]], float(kept_scores[at, path].mean()))


def _best_candidates(scores: FloatArray) -> NDArray[np.intp]:
    """Indices of each block's best local maxima, (n_blocks, n_kept)."""
    n_kept = min(_N_KEPT, scores.shape[1])
    peaks = np.full(scores.shape, -np.inf)
    peaks[:, 1:-1] = np.where(
        (scores[:, 1:-1] >= scores[:, :-2]) & (scores[:, 1:-1] >= scores[:, 2:]),
        scores[:, 1:-1],
        -1e6 + scores[:, 1:-1],
    )
    return np.argpartition(peaks, -n_kept, axis=1)[:, -n_kept:]


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator,unused-ignore]
def _best_path(places, scores, highest_cost):  # type: ignore[no-untyped-def]
    """Candidate per block on the path with the highest Σ score - Σ min((Δ place)²/2, highest_cost)."""
    n_blocks, n = scores.shape
    total = scores[0].copy()
    came_from = np.zeros((n_blocks, n), dtype=np.int64)
    for b in range(1, n_blocks):
        following = np.empty(n)
        for i in range(n):
            best = -1e300
            for j in range(n):
                value = total[j] - min(0.5 * (places[b, i] - places[b - 1, j]) ** 2, highest_cost)
                if value > best:
                    best = value
                    came_from[b, i] = j
            following[i] = best + scores[b, i]
        total = following
    path = np.empty(n_blocks, dtype=np.int64)
    path[-1] = np.argmax(total)
    for b in range(n_blocks - 1, 0, -1):
        path[b - 1] = came_from[b, path[b]]
    return path
