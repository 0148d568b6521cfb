"""Speed over time from short-time comb scores: the path that collects most score without jumping."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit

from gearsig.angle.comb_lines import CombLines
from gearsig.angle.comb_score import candidate_speeds, score_candidates
from gearsig.angle.line_evidence import line_evidence
from gearsig.checks import FloatArray

# Standard deviation of the change of log speed from block to block, in steps of the speed grid; the limit lies three times as far.
_STEPS = 6.0


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

    `change` is the standard deviation of the change of log speed from block to block, or six steps of the grid if that is more.
    Blocks at half overlap are scored for all speeds; the path maximises Σ score - Σ (Δ ln speed)²/(2σ²), found by dynamic
    programming (A. J. Viterbi, *Error bounds for convolutional codes …*, IEEE Trans. Inf. Theory 13 (1967)).
    """
    starts = np.arange(0, samples.shape[1] - n_block + 1, max(1, n_block // 2))
    speeds: FloatArray | None = None
    rows = []
    for start in starts:
        evidence = line_evidence(samples[:, start : start + n_block], rate, n_block, top)
        if speeds is None:
            speeds = candidate_speeds(low, high, comb.highest, evidence)
        rows.append(score_candidates(evidence, comb, speeds))
    scores = np.array(rows)
    assert speeds is not None  # noqa: S101  # there is at least one block: the caller chooses n_block
    sigma = max(_STEPS, change / float(np.log(speeds[1] / speeds[0])))
    path = _best_path(scores, sigma, int(3 * sigma))
    mean = float(scores[np.arange(len(path)), path].mean())
    return SpeedRidge((starts + n_block / 2) / rate, speeds[path], mean)


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator,unused-ignore]
def _best_path(scores, sigma, reach):  # type: ignore[no-untyped-def]
    """Indices of the path with the highest sum of scores minus (step/sigma)²/2."""
    n_blocks, n = scores.shape
    total = scores[0].copy()
    came_from = np.zeros((n_blocks, n), dtype=np.int32)
    cost = np.empty(2 * reach + 1)
    for d in range(-reach, reach + 1):
        cost[d + reach] = 0.5 * (d / sigma) ** 2
    for b in range(1, n_blocks):
        following = np.empty(n)
        for i in range(n):
            best = -1e300
            at = i
            for j in range(max(0, i - reach), min(n, i + reach + 1)):
                value = total[j] - cost[j - i + reach]
                if value > best:
                    best = value
                    at = j
            following[i] = best + scores[b, i]
            came_from[b, i] = at
        total = following
    path = np.empty(n_blocks, dtype=np.int64)
    path[-1] = np.argmax(total)
    for b in range(n_blocks - 1, 0, -1):
        path[b - 1] = came_from[b, path[b]]
    return path
