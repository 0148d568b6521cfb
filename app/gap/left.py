"""What is left of a gap once effects are added, one after another, on data that they were not fitted to."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from app.gap.candidates import Tried, folds_of, n_compared
from app.gap.conditions import Condition
from gearsig.checks import FloatArray
from gearsig.gap.floors import gap_size
from gearsig.gap.prediction import Fit, Observed, fit_effect
from gearsig.gap.shrinkage import Fold
from gearsig.gap.types import GapCause, GapStep, Interval

WORTH_IT = 0.05
"""Share of the gap that a further effect must take away to be shown."""

MOST_ADDED = 2


def steps_of(
    conditions: Sequence[Condition], tried: dict[str, Tried], causes: Sequence[GapCause]
) -> tuple[GapStep, ...]:
    """Return the gap before, and what is left with the likeliest effect, then with the next one as well."""
    folds = folds_of(conditions)
    names = [c.name for c in causes if c.name in tried][:MOST_ADDED]
    steps = [GapStep("before", _left(conditions, folds, []))]
    added: list[Tried] = []
    for name in names:
        left = _left(conditions, folds, [*added, tried[name]])
        if added and left.value > (1.0 - WORTH_IT) * steps[-1].left.value:
            break
        added.append(tried[name])
        title = next(c.title for c in causes if c.name == name)
        steps.append(GapStep(title, left))
    return tuple(steps)


def _left(conditions: Sequence[Condition], folds: Sequence[Fold], added: Sequence[Tried]) -> Interval:
    """Return the whole gap's size, mean over folds; each effect is fitted to what the ones before it leave."""
    sizes = []
    for fold in folds:
        condition = conditions[fold.scored.condition]
        total: FloatArray = np.zeros(len(condition.change.names))
        fits: list[Fit] = []
        for one in added:
            fits.append(fit_effect(one.paths, [_without(o, fits) for o in fold.fitted]))
            total[: n_compared(conditions)] += fits[-1].at(fold.scored.condition)
        sizes.append(_size(condition, fold.scored, total, n_compared(conditions)))
    low, value, high = np.mean([[s.low, s.value, s.high] for s in sizes], axis=0)
    return Interval(float(value), float(low), float(high))


def _without(one: Observed, fits: Sequence[Fit]) -> Observed:
    left = one.distances.copy()
    for fit in fits:
        left = left - fit.at(one.condition)
    return replace(one, distances=left)


def _size(condition: Condition, scored: Observed, taken: FloatArray, n: int) -> Interval:
    """Return the size of what a condition's change leaves, with the scored part's own distances."""
    change = condition.change
    structural = condition.floor
    whole = structural.from_centre(change.names, change.values)
    shift = np.zeros(len(change.names))
    shift[:n] = scored.distances - whole[:n]
    moved = replace(
        change,
        values=change.values + shift - taken,
        left_out=tuple(rows + shift - taken for rows in change.left_out),
    )
    return gap_size(moved, structural).structural
