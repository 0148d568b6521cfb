"""Scores of comb candidates over speed, and the distribution of the best score by chance."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit

from gearsig.angle.comb_lines import CombLines
from gearsig.angle.line_evidence import LineEvidence
from gearsig.checks import FloatArray


@dataclass(frozen=True)
class CombScores:
    """Score of each candidate speed.

    Parameters
    ----------
    speeds : array, (n,)
        rev/s, or relative speed; equal steps of the logarithm.
    scores : array, (n,)
        Sum of the lines' log likelihood ratios.
    """

    speeds: FloatArray
    scores: FloatArray

    def best(self) -> tuple[float, float]:
        """Return (speed, score) of the best candidate."""
        i = int(np.argmax(self.scores))
        return float(self.speeds[i]), float(self.scores[i])

    def best_beyond(self, speed: float, relative: float) -> tuple[float, float]:
        """Return (speed, score) of the best candidate further than `relative` from `speed`, else (0, -inf)."""
        away = np.abs(self.speeds / speed - 1.0) > relative
        if not away.any():
            return 0.0, -np.inf
        i = int(np.argmax(np.where(away, self.scores, -np.inf)))
        return float(self.speeds[i]), float(self.scores[i])


def candidate_speeds(low: float, high: float, highest_line: float, evidence: LineEvidence) -> FloatArray:
    """Return speeds in equal ratios, so close that the highest line in sight moves by one bin."""
    # Lines above the top are not looked at, so the step of the highest line is at most that of the top.
    reach = min(highest_line * high, evidence.top)
    step = evidence.bin_width / reach
    n = int(np.clip(np.ceil(np.log(high / low) / step), 2, 4_000_000))
    return np.geomspace(low, high, n + 1)


def score_speeds(evidence: LineEvidence, comb: CombLines, low: float, high: float) -> CombScores:
    """Score all speeds between `low` and `high`."""
    speeds = candidate_speeds(low, high, comb.highest, evidence)
    return CombScores(speeds, score_candidates(evidence, comb, speeds))


def score_candidates(evidence: LineEvidence, comb: CombLines, speeds: FloatArray) -> FloatArray:
    """Return the score of each given speed, (n_speeds,)."""
    return _raw(evidence, comb, comb.orders, speeds)


def chance_scores(
    evidence: LineEvidence, comb: CombLines, low: float, high: float, n_trials: int
) -> tuple[float, float]:
    """Return mean and standard deviation of the best score of combs whose lines lie at wrong places.

    Each line of the comb is moved by its own random share of up to ± 12 %, which keeps number and spread of the
    lines but not their harmony. The search range is that of the real comb, so that its many trials are accounted for.
    """
    # A fixed seed: the same recording gives the same answer.
    rng = np.random.default_rng(20_230_501)
    speeds = candidate_speeds(low, high, comb.highest, evidence)
    if len(speeds) > 200_000:
        speeds = speeds[:: len(speeds) // 200_000 + 1]
    best = [
        float(_raw(evidence, comb, comb.orders * np.exp(rng.uniform(-0.12, 0.12, len(comb.orders))), speeds).max())
        for _ in range(n_trials)
    ]
    return float(np.mean(best)), max(float(np.std(best, ddof=1)), 1.0)


def _raw(evidence: LineEvidence, comb: CombLines, orders: FloatArray, speeds: FloatArray) -> FloatArray:
    scores = np.empty(len(speeds))
    _score(evidence.ratios, 1.0 / evidence.bin_width, evidence.top, orders, comb.presence, comb.is_mesh, speeds, scores)
    return scores


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator,unused-ignore]
def _score(ratios, per_bin, top, orders, presence, is_mesh, speeds, out):  # type: ignore[no-untyped-def]
    """out[i] = Σ over lines below top of the log likelihood ratio where order · speed falls."""
    limit = min(int(top * per_bin), ratios.shape[1] - 1)
    for i in range(speeds.shape[0]):
        total = 0.0
        # Sidebands closer than four bins to their mesh line cannot be told from it.
        resolved = speeds[i] * per_bin >= 4.0
        for j in range(orders.shape[0]):
            k = int(orders[j] * speeds[i] * per_bin)
            if k < limit and (is_mesh[j] or resolved):
                total += ratios[presence[j], k]
        out[i] = total
