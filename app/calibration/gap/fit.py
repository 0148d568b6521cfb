"""From blind cases with known causes to the numbers that make the gap's probabilities right on the average."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from gearsig.checks import FloatArray
from gearsig.gap.posterior import GapCalibration
from gearsig.gap.types import NONE, UNKNOWN

FALSE_ON_NONE, FALSE_ON_UNKNOWN = 0.05, 0.15
"""Parts of the healthy cases, and of those outside the catalogue, on which an effect may be named."""

APART = 0.65
_START = np.array([1.0, 0.0, 0.3, 0.0, 0.0])
_BOUNDS = ((0.1, 5.0), (0.0, 10.0), (-1.0, 1.0), (-4.0, 4.0), (-4.0, 4.0))
_PRIOR = 0.5
"""Weight of the start, at which trials say nothing, beside that of one case."""


@dataclass(frozen=True)
class WeighedCase:
    """One blind case: what the forests and the trials said, and the truth.

    Parameters
    ----------
    truths : tuple of str
        Causes that are right; two for a pair.
    forest, scores : mapping
        See `app.gap.weigh.Weighed`.
    """

    truths: tuple[str, ...]
    forest: Mapping[str, float]
    scores: Mapping[str, float]


def fit_calibration(cases: Sequence[WeighedCase]) -> GapCalibration:
    """Fit sharpness, what trials say and both biases by likelihood; then the threshold for naming an effect.

    J. C. Platt, "Probabilistic outputs for support vector machines", 1999; C. Guo, G. Pleiss, Y. Sun, K. Q. Weinberger,
    "On calibration of modern neural networks", 2017 (one temperature for all classes).
    """
    from scipy.optimize import minimize

    def loss(x: FloatArray) -> float:
        fitted = _calibration(x)
        right = [sum(fitted.probabilities(c.forest, c.scores)[t] for t in c.truths) for c in cases]
        off = x - _START
        return float(-np.mean(np.log(np.maximum(right, 1e-9))) + _PRIOR / len(cases) * off @ off)

    best = minimize(loss, _START, method="L-BFGS-B", bounds=_BOUNDS).x
    fitted = _calibration(np.round(best, 3))
    return replace(fitted, named_from=_named_from(fitted, cases))


def _calibration(x: FloatArray) -> GapCalibration:
    sharpness, weight, neutral, none, unknown = (float(v) for v in x)
    return GapCalibration(sharpness, weight, neutral, none, unknown, 0.5, APART)


def _named_from(fitted: GapCalibration, cases: Sequence[WeighedCase]) -> float:
    """Return the least probability of an effect that keeps both false rates, a half at least."""
    found = [0.5]
    for cause, rate in ((NONE, FALSE_ON_NONE), (UNKNOWN, FALSE_ON_UNKNOWN)):
        others = [_effects(fitted, c) for c in cases if c.truths == (cause,)]
        if others:
            found.append(float(np.quantile(others, 1.0 - rate)))
    return float(f"{min(max(found), 0.95):.3f}")


def _effects(fitted: GapCalibration, case: WeighedCase) -> float:
    p = fitted.probabilities(case.forest, case.scores)
    return 1.0 - p[NONE] - p[UNKNOWN]
