"""From the features of simulated cracks to a model of their depth."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gearsig.checks import FloatArray
from gearsig.severity.features import FEATURES, RELIEF, RISING, SHAPED
from gearsig.severity.model import LEAST_SPREAD, DepthModel, segments

FALSE_ALARMS = 0.02
"""Part of the sound gear pairs whose score lies above the threshold."""

TAUGHT = 0.10
"""Part of the sound gear pairs whose score lies above the least one of a crack that the depth is learned from: cracks
just below the threshold tell as well, and without a reference few are above."""

CLEAR_MM = 1.0
"""Cracks at least so deep teach the detection what to look for."""

OUTSIDE = 0.01
"""Part of the calibration's own cracks that count as unlike a crack."""

_RIDGE = 3.0
_FOLDS = 10
_KNOTS = (1 / 3, 2 / 3)
_COVERAGE = (0.05, 0.95)
_SHAPED = [FEATURES.index(name) for name in SHAPED]


@dataclass(frozen=True)
class Cases:
    """Cracks with their features, and sound gears.

    Parameters
    ----------
    features : array, (n, n_features)
        Of the cracked gear.
    percent, depth_mm : arrays, (n,)
    sound : array, (n_sound, 2, n_features)
        Of both gears of sound pairs.
    """

    features: FloatArray
    percent: FloatArray
    depth_mm: FloatArray
    sound: FloatArray


def fit_model(cases: Cases, *, relief_known: bool) -> DepthModel:
    """Fit detection, depth and spread to all cases, and quantiles to errors of models that did not see the case."""
    rest = [i for i, name in enumerate(FEATURES) if name not in RISING and (relief_known or name not in RELIEF)]
    mean, scale = cases.features.mean(axis=0), cases.features.std(axis=0)
    z = (cases.features - mean) / scale
    sound = (cases.sound - mean) / scale
    detection = _detection_weights(z[cases.depth_mm >= CLEAR_MM], sound.reshape(-1, z.shape[1]))
    sound_scores = np.sort((sound @ detection).max(axis=1))
    threshold = float(np.quantile(sound_scores, 1.0 - FALSE_ALARMS))
    taught = z @ detection >= np.quantile(sound_scores, 1.0 - TAUGHT)
    y = np.log(cases.percent)
    knots = np.quantile(z[taught][:, _SHAPED], _KNOTS, axis=0).T
    depth, spread = _depth_and_spread(z[taught], y[taught], knots, rest)
    intercept, coefficients, slopes = depth
    precision = _precision(z[taught], rest)
    distances = np.sqrt(np.einsum("ij,jk,ik->i", z[taught], precision, z[taught]))
    return DepthModel(
        mean=mean,
        scale=scale,
        intercept=intercept,
        coefficients=coefficients,
        knots=knots,
        slopes=slopes,
        spread=spread,
        quantiles=_conformal(_errors_of_others(z[taught], y[taught], knots, rest)),
        detection=detection,
        threshold=threshold,
        sound_scores=sound_scores,
        precision=precision,
        largest_distance=float(np.quantile(distances, 1.0 - OUTSIDE)),
        lowest=cases.features[taught].min(axis=0),
        highest=cases.features[taught].max(axis=0),
        percent_range=(float(cases.percent[taught].min()), float(cases.percent[taught].max())),
    )


def _depth_and_spread(
    z: FloatArray, y: FloatArray, knots: FloatArray, rest: list[int]
) -> tuple[tuple[float, FloatArray, FloatArray], FloatArray]:
    depth = _depth_weights(z, y, knots, rest)
    return depth, _spread_weights(z, np.abs(y - _predicted(depth, z, knots)))


def _predicted(depth: tuple[float, FloatArray, FloatArray], z: FloatArray, knots: FloatArray) -> FloatArray:
    intercept, coefficients, slopes = depth
    predicted: FloatArray = intercept + z @ coefficients + _curves(z, knots) @ slopes.ravel()
    return predicted


def _errors_of_others(z: FloatArray, y: FloatArray, knots: FloatArray, rest: list[int]) -> FloatArray:
    """Return (y − ŷ)/σ of each case by the model fitted to the other nine tenths of the cases.

    R. F. Barber, E. J. Candès, A. Ramdas, R. J. Tibshirani, "Predictive inference with the jackknife+", 2021 (CV+).
    """
    scaled = np.empty(len(y))
    fold = np.arange(len(y)) % _FOLDS
    for k in range(_FOLDS):
        out = fold == k
        depth, spread = _depth_and_spread(z[~out], y[~out], knots, rest)
        sigma = np.maximum(spread[0] + z[out] @ spread[1:], LEAST_SPREAD)
        scaled[out] = (y[out] - _predicted(depth, z[out], knots)) / sigma
    return scaled


def _detection_weights(cracked: FloatArray, sound: FloatArray) -> FloatArray:
    """Logistic regression, crack against none, on what a crack raises; weights are not negative."""
    from scipy.optimize import minimize

    used = [FEATURES.index(name) for name in ("band_excess", "prominence", "pattern_excess")]
    x = np.vstack([cracked[:, used], sound[:, used]])
    sign = np.r_[np.ones(len(cracked)), -np.ones(len(sound))]
    share = np.r_[np.full(len(cracked), 0.5 / len(cracked)), np.full(len(sound), 0.5 / len(sound))]

    def loss(w: FloatArray) -> float:
        return float(share @ np.logaddexp(0.0, -sign * (x @ w[:-1] + w[-1])) + 0.003 * np.sum(w[:-1] ** 2))

    start = np.r_[np.ones(len(used)), 0.0]
    best = minimize(loss, start, bounds=[(0.0, None)] * len(used) + [(None, None)]).x
    weights = np.zeros(len(FEATURES))
    weights[used] = best[:-1]
    return weights


def _curves(z: FloatArray, knots: FloatArray) -> FloatArray:
    """Columns of the rising curves, three per shaped feature."""
    return np.hstack([segments(z[:, i], pair) for i, pair in zip(_SHAPED, knots, strict=True)])


def _depth_weights(
    z: FloatArray, y: FloatArray, knots: FloatArray, rest: list[int]
) -> tuple[float, FloatArray, FloatArray]:
    """Ridge regression: rising curves of what the depth is read from, and straight lines of the rest."""
    from scipy.optimize import lsq_linear

    columns = np.c_[np.ones(len(z)), _curves(z, knots), z[:, rest]]
    n, n_curves = columns.shape[1], knots.size // 2 * 3
    rows = np.vstack([columns, np.sqrt(_RIDGE) * np.eye(n)[1:]])
    low = np.full(n, -np.inf)
    low[1 : 1 + n_curves] = 0.0
    result = lsq_linear(rows, np.r_[y, np.zeros(n - 1)], bounds=(low, np.full(n, np.inf))).x
    coefficients = np.zeros(z.shape[1])
    coefficients[rest] = result[1 + n_curves :]
    return float(result[0]), coefficients, np.maximum(result[1 : 1 + n_curves], 0.0).reshape(-1, 3)


def _spread_weights(z: FloatArray, error: FloatArray) -> FloatArray:
    """Linear model of the size of errors over excess and prominence, σ where the error is √(2/π) σ on the mean."""
    used = [FEATURES.index(name) for name in ("band_excess", "prominence")]
    rows = np.c_[np.ones(len(z)), z[:, used]]
    ridge = 30.0 * np.diag([0.0, 1.0, 1.0])
    best = np.linalg.solve(rows.T @ rows + ridge, rows.T @ error) * np.sqrt(np.pi / 2)
    spread = np.zeros(len(FEATURES) + 1)
    spread[[0, *(1 + i for i in used)]] = best
    return spread


def _precision(z: FloatArray, rest: list[int]) -> FloatArray:
    """Inverse covariance of the features that the depth is read from; 0 for the others."""
    used = sorted([*_SHAPED, *rest])
    precision = np.zeros((z.shape[1], z.shape[1]))
    precision[np.ix_(used, used)] = np.linalg.inv(np.cov(z[:, used].T) + 1e-3 * np.eye(len(used)))
    return precision


def _conformal(scaled: FloatArray) -> tuple[float, float]:
    """Quantiles of n errors for a new case: the k-th of n + 1, rounded outwards."""
    ordered, n = np.sort(scaled), len(scaled)
    low = int(np.floor(_COVERAGE[0] * (n + 1))) - 1
    high = int(np.ceil(_COVERAGE[1] * (n + 1))) - 1
    return float(ordered[max(low, 0)]), float(ordered[min(high, n - 1)])
