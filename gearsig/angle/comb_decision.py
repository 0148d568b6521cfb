"""Whether the best comb is the true one: against chance, against other speeds, against other teeth."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gearsig.angle.comb_lines import CombLines, with_other_teeth
from gearsig.angle.comb_score import chance_scores, score_speeds
from gearsig.angle.line_evidence import LineEvidence

# Ranges narrower than this ratio come from a known nominal speed: the scale of the speed is then not in question.
NARROW = 1.35
_N_CHANCE = 16


@dataclass(frozen=True)
class CombDecision:
    """The best comb and what speaks for and against it.

    Parameters
    ----------
    speed : float
        In the unit of the evidence: rev/s, or relative speed.
    score : float
        Sum of log likelihood ratios.
    chance_mean, chance_deviation : float
        Of the best score of wrong combs.
    runner_up_speed, runner_up_score : float
        Best other speed.
    other_teeth_score : float
        Best score of the same shafts with other teeth.
    side_score : float
        Part of the score that sidebands and shaft harmonics carry.
    narrow : bool
        Whether the search range left the scale of the speed open (False) or not.
    bin_width : float
        Of the spectrum it was found in.
    coverage : float
        Share of the recording in which the comb lies where a varying angle says.
    """

    speed: float
    score: float
    chance_mean: float
    chance_deviation: float
    runner_up_speed: float
    runner_up_score: float
    other_teeth_score: float
    side_score: float
    narrow: bool
    bin_width: float
    coverage: float = 1.0

    @property
    def significance(self) -> float:
        """Score over chance, in standard deviations."""
        return (self.score - self.chance_mean) / self.chance_deviation

    @property
    def quality(self) -> float:
        """0 to 1: product of the confidences that it is no chance, no other speed, no other teeth.

        The scales were set on simulated and measured recordings, see the tests; they are no probabilities from theory.
        """
        parts = [_sure(self.significance, 4.0, 3.0), _sure(self.score - self.runner_up_score, 2.0, 4.0)]
        parts.append(_sure(self.score - self.other_teeth_score, 2.0, 4.0))
        if not self.narrow:
            # Mesh lines alone fit any number of teeth at another speed; sidebands tell the scale.
            parts.append(_sure(self.side_score, 2.0, 4.0))
        # Speed that was followed rightly most of the time only is no angle to average over.
        parts.append(self.coverage**12)
        return float(np.prod(parts))

    def evidence(self, unit: str = "rev/s") -> str:
        """State the numbers in one sentence."""
        return (
            f"best comb at {self.speed:.5g} {unit}: score {self.score:.1f}, by chance {self.chance_mean:.1f} ± "
            f"{self.chance_deviation:.1f}, next best speed ({self.runner_up_speed / self.speed:.4g} times) "
            f"{self.runner_up_score:.1f}, other teeth {self.other_teeth_score:.1f}"
        )


def decide(evidence: LineEvidence, comb: CombLines, low: float, high: float) -> CombDecision:
    """Find the best comb between `low` and `high` and weigh it."""
    scores = score_speeds(evidence, comb, low, high)
    speed, score = scores.best()
    speed = refine_speed(evidence, comb, speed)
    # Within three bins of the lowest mesh line it is the same comb.
    same = 3.0 * evidence.bin_width / (comb.meshes[0] * speed)
    runner_up_speed, runner_up = scores.best_beyond(speed, same)
    mean, deviation = chance_scores(evidence, comb, low, high, _N_CHANCE)
    around = (speed * (1 - same / 2), speed * (1 + same / 2))
    others = max(
        (score_speeds(evidence, other, *around).best()[1] for other in with_other_teeth(comb)), default=-np.inf
    )
    return CombDecision(
        speed,
        score,
        mean,
        deviation,
        runner_up_speed,
        runner_up,
        others,
        _side_score(evidence, comb, speed),
        high / low <= NARROW,
        evidence.bin_width,
    )


def refine_speed(evidence: LineEvidence, comb: CombLines, speed: float) -> float:
    """Sharpen a speed by the middles of the lines that are there.

    Parabolas through the logarithm of each line's three highest bins give its frequency; the speed is the
    least-squares slope of frequency over order, weighted by the lines' heights, lines off by more than a bin left out.
    """
    found = [
        (order, place, height)
        for order in comb.orders
        if order * speed < evidence.top and (line := _line_at(evidence, order * speed)) is not None
        for place, height in (line,)
    ]
    if not found:
        return speed
    orders, places, weights = np.array(found).T
    refined = speed
    for _ in range(3):
        near = np.abs(places - orders * refined) < 1.5 * evidence.bin_width
        if not near.any():
            return speed
        weight = weights[near]
        refined = float((weight * orders[near]) @ places[near] / ((weight * orders[near]) @ orders[near]))
    return refined


def _line_at(evidence: LineEvidence, position: float) -> tuple[float, float] | None:
    """Position and height of the line within a bin or so of `position`, None where nothing stands out."""
    x = evidence.log_ratio
    k = int(np.floor(position / evidence.bin_width))
    if k < 2 or k + 3 >= len(x):
        return None
    p = k - 1 + int(np.argmax(x[k - 1 : k + 3]))
    if x[p] < 3.0 or x[p] < x[p - 1] or x[p] < x[p + 1]:
        return None
    bend = x[p - 1] - 2 * x[p] + x[p + 1]
    shift = 0.5 * (x[p - 1] - x[p + 1]) / bend if bend < 0 else 0.0
    return float((p + shift) * evidence.bin_width), float(x[p])


def _side_score(evidence: LineEvidence, comb: CombLines, speed: float) -> float:
    places = (comb.orders * speed / evidence.bin_width).astype(int)
    counts = ~comb.is_mesh & (places < evidence.ratios.shape[1]) & (places * evidence.bin_width < evidence.top)
    return float(evidence.ratios[comb.presence[counts], places[counts]].sum())


def _sure(value: float, zero: float, scale: float) -> float:
    return 1.0 - float(np.exp(-max(0.0, value - zero) / scale))
