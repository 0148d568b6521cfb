"""From blind cases with known causes to the numbers that make the gap's probabilities right on the average."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from gearsig.checks import FloatArray
from gearsig.gap.posterior import GapCalibration
from gearsig.gap.types import NAMING, NONE, UNKNOWN

FALSE_ON_NONE, FALSE_ON_UNKNOWN = 0.05, 0.15
"""Parts of the healthy cases, and of those outside the catalogue, on which an effect may be named."""

THRESHOLDS = tuple(round(0.5 + 0.01 * i, 2) for i in range(46))

APART = 0.75
"""The likeliest of two effects is named alone from three to one: below that it was right three times in twelve, on
development and calibration cases."""
_START = np.array([1.0, 0.0, 0.3, 0.0, 0.0, 0.0, 0.0])
_BOUNDS = ((0.1, 5.0), (0.0, 10.0), (-1.0, 1.0), (-4.0, 4.0), (-4.0, 4.0), (0.0, 1.0), (-4.0, 0.0))
_BIAS_BOUNDS = (-2.0, 2.0)
_PRIOR = 0.5
"""Weight of the start, at which trials say nothing, beside that of one case."""
BIAS_SCATTER = 0.3
"""Of effects' biases, in which a handful of cases each must not be learned by heart."""


@dataclass(frozen=True)
class WeighedCase:
    """One blind case: what the forests and the trials said, and the truth.

    Parameters
    ----------
    truths : tuple of str
        Causes that are right; two for a pair.
    forest, scores : mapping
    size : float
        See `app.gap.weigh.Weighed`.
    """

    truths: tuple[str, ...]
    forest: Mapping[str, float]
    scores: Mapping[str, float]
    size: float = 1.0


def fit_calibration(cases: Sequence[WeighedCase], strange: Sequence[WeighedCase] = ()) -> GapCalibration:
    """Fit sharpness, what trials say and all biases by likelihood; then the threshold for naming an effect.

    Parameters
    ----------
    cases : sequence of WeighedCase
    strange : sequence of WeighedCase
        Further ones from outside the catalogue, for the threshold only: as many in the likelihood would make whatever
        is diagnosed look strange.

    J. C. Platt, "Probabilistic outputs for support vector machines", 1999; C. Guo, G. Pleiss, Y. Sun, K. Q. Weinberger,
    "On calibration of modern neural networks", 2017 (one temperature for all classes, a bias for each).
    """
    from scipy.optimize import minimize

    effects = sorted({t for c in cases for t in c.truths} - {NONE, UNKNOWN})
    start = np.append(_START, np.zeros(len(effects)))
    weights = np.append(np.full(len(_START), _PRIOR), np.full(len(effects), 0.5 / BIAS_SCATTER**2))

    def loss(x: FloatArray) -> float:
        fitted = _calibration(x, effects)
        right = [sum(fitted.probabilities(c.forest, c.scores, c.size)[t] for t in c.truths) for c in cases]
        return float(-np.mean(np.log(np.maximum(right, 1e-9))) + weights @ (x - start) ** 2 / len(cases))

    best = minimize(loss, start, method="L-BFGS-B", bounds=[*_BOUNDS, *[_BIAS_BOUNDS] * len(effects)]).x
    fitted = _calibration(np.round(best, 3), effects)
    return replace(fitted, named_from=_named_from(fitted, [*cases, *strange]))


def _calibration(x: FloatArray, effects: Sequence[str]) -> GapCalibration:
    sharpness, weight, neutral, none, unknown, sharper, none_slope, *biases = (float(v) for v in x)
    named = dict(zip(effects, biases, strict=True))
    return GapCalibration(
        sharpness, weight, neutral, none, unknown, 0.5, APART, named, sharper=sharper, none_slope=none_slope
    )


def _named_from(fitted: GapCalibration, cases: Sequence[WeighedCase]) -> float:
    """Return the least probability of effects together from which naming keeps both false rates."""
    without = [
        (rate, [fitted.probabilities(c.forest, c.scores, c.size) for c in cases if c.truths == (cause,)])
        for cause, rate in ((NONE, FALSE_ON_NONE), (UNKNOWN, FALSE_ON_UNKNOWN))
    ]
    for threshold in THRESHOLDS:
        named = replace(fitted, named_from=threshold)
        if all(sum(named.outcome(p) in NAMING for p in found) <= rate * len(found) for rate, found in without):
            return threshold
    return THRESHOLDS[-1]
