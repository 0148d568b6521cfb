"""What speaks for each cause: the forests; of an effect that they do not know, its trial on the twin.

The trials of effects that they do know say how far the gap shrinks. How well one explains it can weigh as well, and the
calibration gives that the weight 0: on blind cases look-alikes shrink the gap as far as the true effect does.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from gearsig.gap._conditions import Condition
from gearsig.gap._posterior import (
    GapCalibration,
    joint_probabilities,
    load_gap_calibration,
    score_of,
    tooth_load_n_per_mm,
)
from gearsig.gap._recognition import load_recogniser
from gearsig.gap._simulator import GapEffect, Twin
from gearsig.gap._trials import TriedEffect, refuse_where_none_ran, try_effects
from gearsig.gap._types import NONE, UNKNOWN

MOST_TRIED, LEAST_TRIED_PROBABILITY = 3, 0.06
"""Effects that are simulated: so many of the likeliest, none less likely than this."""


@dataclass(frozen=True)
class Attribution:
    """What calibrated probabilities are made of.

    Parameters
    ----------
    forest : mapping
        Cause → probability by the forests, uncalibrated.
    tried : mapping
        Effect → how it was tried.
    with_reference : bool
        Whether every condition has one.
    size : float
        Of the gap in structural floors; of several conditions the largest.
    unheard_of : tuple of str
        Effects that the forests do not know, the user's own: each was to be tried.
    """

    forest: Mapping[str, float]
    tried: dict[str, TriedEffect]
    with_reference: bool
    size: float
    unheard_of: tuple[str, ...] = ()

    @property
    def scores(self) -> dict[str, float]:
        """Effect → what its held-out shrink says for it."""
        return {name: score_of(t.shrinkage.shrink.value, t.shrinkage.placebo) for name, t in self.tried.items()}

    @property
    def calibration(self) -> GapCalibration:
        """The one that belongs to this way of comparing."""
        return load_gap_calibration(with_reference=self.with_reference)

    def probabilities(self) -> dict[str, float]:
        """Return cause → probability, likeliest first; calibrated, but for effects that the forests do not know."""
        found = self.calibration.probabilities(self.forest, self.scores, self.size)
        return shared(found, {name: self.scores[name] for name in self.unheard_of if name in self.tried})


def shared(probabilities: Mapping[str, float], scores: Mapping[str, float]) -> dict[str, float]:
    """Return the probabilities with those of effects that only a trial speaks for, likeliest first.

    They share max_i s_i of what is unknown, each in proportion to its own s_i = max(score, 0): to the forests, a gap
    that none of their effects explains is unknown, whoever else explains it.
    """
    positive = {name: max(score, 0.0) for name, score in scores.items()}
    total = sum(positive.values())
    taken = probabilities[UNKNOWN] * max(positive.values(), default=0.0)
    found = {**probabilities, UNKNOWN: probabilities[UNKNOWN] - taken}
    found |= {name: taken * score / total if total else 0.0 for name, score in positive.items()}
    return dict(sorted(found.items(), key=lambda item: -item[1]))


def attribute(
    conditions: Sequence[Condition],
    known: Mapping[str, GapEffect],
    effects: Sequence[str],
    twin: Twin,
    cache: Path | None,
    on_progress: Callable[[str, float], object],
    *,
    most_tried: int = MOST_TRIED,
    fresh: bool = False,
) -> Attribution:
    """Ask the forests, then simulate, fit and score the likeliest effects, `most_tried` at most.

    Effects that the forests do not know are tried as well, unless nothing is.

    Raises
    ------
    RefusalError
        If the rig has a place for some of the likeliest effects, and none of them can be simulated there.
    """
    forest = _forest(conditions, effects, known)
    with_reference = all(c.reference is not None for c in conditions)
    size = max(condition.size.structural.value for condition in conditions)
    first = load_gap_calibration(with_reference=with_reference).probabilities(forest, {}, size)
    likely = [name for name, p in first.items() if name in known and p >= LEAST_TRIED_PROBABILITY][:most_tried]
    heard_of = _known_to_forests(conditions)
    own = [name for name in effects or known if name not in heard_of] if most_tried else []
    likely += own
    tried = try_effects([known[name] for name in likely], twin, conditions, cache, on_progress, fresh=fresh)
    refuse_where_none_ran(tried, likely, twin)
    return Attribution(forest, tried, with_reference, size, tuple(own))


def _known_to_forests(conditions: Sequence[Condition]) -> set[str]:
    return {name for c in conditions for name in load_recogniser(with_reference=c.reference is not None).causes}


def _forest(
    conditions: Sequence[Condition], effects: Sequence[str], known: Mapping[str, GapEffect]
) -> dict[str, float]:
    """Return the forests' joint probabilities over what may be named."""
    allowed = {NONE, UNKNOWN, *(effects or known)} & _known_to_forests(conditions)
    found, loads = [], []
    for condition in conditions:
        recogniser = load_recogniser(with_reference=condition.reference is not None)
        loads.append(tooth_load_n_per_mm(condition.now.frame.pair, condition.facts.point.torque_nm))
        found.append(recogniser.probabilities(condition.change, loads[-1], known.values()))
    return joint_probabilities(found, loads, allowed)
