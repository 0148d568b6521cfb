"""How far a gap shrinks once an effect is added, on data that the effect was not fitted to."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gearsig.checks import FloatArray
from gearsig.gap.prediction import FLOOR_IN_DEVIATIONS, EffectPath, Fit, Observed, family_square, fit_effect, fit_path
from gearsig.gap.types import LEAST_FORETOLD, Interval, Shrinkage

ALIKE = 0.8
"""Cosine of the angle between two predictions, in floors, from which they say the same."""

OWN_FROM = 1.5
"""Floors that an effect must change a feature by for it to be its own."""


@dataclass(frozen=True)
class Fold:
    """Observations to fit to, and others to score on.

    Parameters
    ----------
    fitted : tuple of Observed
    scored : Observed
    again : tuple of tuples of Observed
        `scored` with a block of revolutions left out, each block in turn: of the recording, and of its reference.
    """

    fitted: tuple[Observed, ...]
    scored: Observed
    again: tuple[tuple[Observed, ...], ...] = ()


@dataclass(frozen=True)
class _Score:
    """How an effect did on one fold.

    Parameters
    ----------
    sizes : (float, float, float)
        Before and after in floors, and the shrink.
    variances : array, (3,)
        Of the sizes.
    slope : float
        Of observed over predicted.
    placebo : float
        The best one's shrink.
    n_placebos : int
    foretold : float
        Largest change that the fit foretells, in floors.
    """

    sizes: tuple[float, float, float]
    variances: FloatArray
    slope: float
    placebo: float
    n_placebos: int
    foretold: float


def own_features(fit: Fit, observed: Observed) -> FloatArray:
    """Return 1 for the features that the fitted effect changes, 0 for the others; its strongest one at least."""
    predicted = np.abs(fit.at(observed.condition) / observed.floors)
    used: FloatArray = (predicted >= min(OWN_FROM, float(predicted.max()))).astype(np.float64)
    return used


def shrinkage(
    paths: Sequence[EffectPath], folds: Sequence[Fold], held_out: str, excluded: Sequence[EffectPath] = ()
) -> Shrinkage:
    """Return the shrinkage of the gap by an effect, mean over folds.

    shrink = 1 − (r² − n²)/(o² − n²) on the effect's own features: o the gap before, r what is left, n what the floors
    themselves make, o and r no less than n; the effect's severity and options are fitted to the other part of the data.

    Where the fitted effect foretells nothing, idle gears, say, it has no features of its own and nothing can shrink:
    such folds do not count, unless there are no others.

    The intervals hold the scatter of what is scored, from its blocks of revolutions; that of the fit is not in them.

    Parameters
    ----------
    paths : sequence of EffectPath
        Of the effect.
    folds : sequence of Fold
    held_out : str
    excluded : sequence of EffectPath
        Of the effect where the recordings tell that it is not: on the other shaft, say. They serve as placebos.
    """
    folds, scores = _telling(folds, [_score(paths, fold, excluded) for fold in folds])
    before, after, shrink = np.mean([score.sizes for score in scores], axis=0)
    wide = _t_quantile(folds) * np.sqrt(np.mean([score.variances for score in scores], axis=0))
    return Shrinkage(
        _interval(before, wide[0], 0.0, np.inf),
        _interval(after, wide[1], 0.0, np.inf),
        _interval(shrink, wide[2], -np.inf, 1.0),
        float(np.mean([score.slope for score in scores])),
        float(np.mean([score.placebo for score in scores])),
        held_out,
        n_placebos=max(score.n_placebos for score in scores),
        elsewhere=_mean([_elsewhere(paths, fold) for fold in folds]),
        foretold=max(score.foretold for score in scores),
    )


def _telling(folds: Sequence[Fold], scores: Sequence[_Score]) -> tuple[Sequence[Fold], Sequence[_Score]]:
    """Return the folds in which the effect shows on the simulator, and their scores; all where it does in none."""
    shown = [i for i, score in enumerate(scores) if score.foretold >= LEAST_FORETOLD] or range(len(scores))
    return [folds[i] for i in shown], [scores[i] for i in shown]


def _mean(values: Sequence[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return float(np.mean(known)) if known else None


def _elsewhere(paths: Sequence[EffectPath], fold: Fold) -> float | None:
    """Return the shrink where severity and options come from the other conditions alone; None if there is none.

    The level comes from the condition's own other revolutions: no other condition knows the path at this speed.
    """
    others = [one for one in fold.fitted if one.condition != fold.scored.condition]
    if not others:
        return None
    fit = fit_effect(paths, others)
    for one in fold.fitted:
        if one.condition == fold.scored.condition:
            fit = fit.at_level_of(one)
    return _before_and_after(fit, fold.scored, own_features(fit, fold.scored))[2]


def _interval(value: float, wide: float, least: float, most: float) -> Interval:
    return Interval(float(value), float(max(value - wide, least)), float(min(value + wide, most)))


def _t_quantile(folds: Sequence[Fold]) -> float:
    """Return what bounds 90 % with as few blocks as there are."""
    from scipy.special import stdtrit

    n_blocks = min((len(group) for fold in folds for group in fold.again), default=2)
    return float(stdtrit(max(n_blocks - 1, 1), 0.95))


def _score(paths: Sequence[EffectPath], fold: Fold, excluded: Sequence[EffectPath]) -> _Score:
    fit = fit_effect(paths, fold.fitted)
    used = own_features(fit, fold.scored)
    wrong = [fit_path(path, fold.fitted) for path in (*paths, *excluded) if path.options != fit.path.options]
    placebos = [
        _before_and_after(other, fold.scored, used)[2] for other in wrong if not _is_alike(fit, other, fold.scored)
    ]
    variances = np.zeros(3)
    for group in fold.again:
        rows = np.array([_before_and_after(fit, one, used) for one in group])
        variances += (len(rows) - 1.0) * rows.var(axis=0)
    return _Score(
        _before_and_after(fit, fold.scored, used),
        variances,
        _slope(fit, fold.scored, used),
        max(placebos, default=0.0),
        len(placebos),
        float(np.abs(fit.at(fold.scored.condition) / fold.scored.floors).max()),
    )


def _is_alike(fit: Fit, other: Fit, scored: Observed) -> bool:
    """Whether two places foretell the same: bearings of one type on one shaft do, and are no placebos of each other."""
    a, b = (one.at(scored.condition) / scored.floors for one in (fit, other))
    product = float(np.sqrt((a @ a) * (b @ b)))
    return product > 0.0 and float(a @ b) > ALIKE * product


def _before_and_after(fit: Fit, scored: Observed, used: FloatArray) -> tuple[float, float, float]:
    """Return before and after in floors, and the shrink of what exceeds them."""
    names = fit.path.names
    n_families = family_square(names, np.ones_like(used) * scored.floors, scored, used) / FLOOR_IN_DEVIATIONS**2
    left = scored.distances - fit.at(scored.condition)
    squares = [family_square(names, d, scored, used) / n_families for d in (scored.distances, left)]
    excess = max(squares[0] - 1.0, 0.1)
    shrink = (max(squares[0], 1.0) - max(squares[1], 1.0)) / excess  # where there was no gap, none can shrink
    before, after = (float(np.sqrt(s)) / FLOOR_IN_DEVIATIONS for s in squares)
    return before, after, float(np.clip(shrink, -1.0, 1.0))


def _slope(fit: Fit, scored: Observed, used: FloatArray) -> float:
    """Return the slope of observed over predicted distances, in floors, through zero."""
    predicted = used * fit.at(scored.condition) / scored.floors
    square = float(predicted @ predicted)
    return float(predicted @ scored.normalised) / square if square > 0 else 0.0
