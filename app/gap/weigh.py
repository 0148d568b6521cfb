"""What speaks for each cause: the forests, and the likeliest effects tried on the twin."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from app.gap.candidates import Tried, refuse_without_candidates, try_effects
from app.gap.conditions import Condition
from gearsig.gap.posterior import GapCalibration, load_gap_calibration, score_of
from gearsig.gap.recognise import load_recogniser
from gearsig.gap.simulator import GapEffect, Twin
from gearsig.gap.types import NONE, UNKNOWN

MOST_TRIED, LEAST_TRIED_PROBABILITY = 3, 0.06
"""Effects that are simulated: so many of the likeliest, none less likely than this."""


@dataclass(frozen=True)
class Weighed:
    """What calibrated probabilities are made of.

    Parameters
    ----------
    forest : mapping
        Cause → probability by the forests, uncalibrated.
    tried : mapping
        Effect → how it was tried.
    with_reference : bool
        Whether every condition has one.
    """

    forest: Mapping[str, float]
    tried: dict[str, Tried]
    with_reference: bool

    @property
    def scores(self) -> dict[str, float]:
        """Effect → what its held-out shrink says for it."""
        return {name: score_of(t.shrinkage.shrink.value, t.shrinkage.placebo) for name, t in self.tried.items()}

    @property
    def calibration(self) -> GapCalibration:
        """The one that belongs to this way of comparing."""
        return load_gap_calibration(with_reference=self.with_reference)

    def probabilities(self) -> dict[str, float]:
        """Return cause → calibrated probability, likeliest first."""
        return self.calibration.probabilities(self.forest, self.scores)


def weigh(
    conditions: Sequence[Condition],
    known: Mapping[str, GapEffect],
    effects: Sequence[str],
    twin: Twin,
    cache: Path | None,
    on_progress: Callable[[str, float], object],
    *,
    most_tried: int = MOST_TRIED,
    fresh: bool = False,
) -> Weighed:
    """Ask the forests, then simulate, fit and score the likeliest effects, `most_tried` at most.

    Raises
    ------
    RefusalError
        If none of the likeliest effects can be simulated.
    """
    forest = _forest(conditions, effects, known)
    with_reference = all(c.reference is not None for c in conditions)
    first = load_gap_calibration(with_reference=with_reference).probabilities(forest, {})
    likely = [name for name, p in first.items() if name in known and p >= LEAST_TRIED_PROBABILITY][:most_tried]
    tried = try_effects(likely, twin, conditions, cache, on_progress, fresh=fresh)
    refuse_without_candidates(tried, likely)
    return Weighed(forest, tried, with_reference)


def _forest(
    conditions: Sequence[Condition], effects: Sequence[str], known: Mapping[str, GapEffect]
) -> dict[str, float]:
    """Return the forests' joint probabilities: the geometric mean over conditions, over what may be named."""
    allowed = {NONE, UNKNOWN, *(effects or known)}
    joint: dict[str, float] = {}
    for condition in conditions:
        recogniser = load_recogniser(with_reference=condition.reference is not None)
        for name, p in recogniser.probabilities(condition.change).items():
            if name in allowed:
                joint[name] = joint.get(name, 1.0) * p ** (1.0 / len(conditions))
    total = sum(joint.values())
    return {name: p / total for name, p in joint.items()}
