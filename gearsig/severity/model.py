"""The fitted relation between features and depth, with its intervals and its limits; numbers only, no fitting."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from gearsig.checks import FloatArray, frozen_array
from gearsig.errors import InputError
from gearsig.severity.features import FEATURES, RISING, SHAPED

RANGE_MARGIN = 0.05
"""Of a feature's range in the calibration, by which it may lie beyond."""

LEAST_SPREAD = 0.1
"""Of ln percent: no machine is known better than to ten percent."""


def segments(values: FloatArray, knots: FloatArray) -> FloatArray:
    """Return how far values lie below the first knot, between both, and above the second; (…, 3).

    Examples
    --------
    >>> segments(np.array([-2.0, 0.5, 4.0]), np.array([0.0, 1.0])).tolist()
    [[-2.0, 0.0, 0.0], [0.0, 0.5, 0.0], [0.0, 1.0, 3.0]]
    """
    first, second = knots
    parts = (
        np.minimum(values, first) - first,
        np.clip(values, first, second) - first,
        np.maximum(values, second) - second,
    )
    result: FloatArray = np.stack(parts, axis=-1)
    return result


@dataclass(frozen=True)
class DepthModel:
    """ln percent = c + Σ b_i z_i + Σ_j g_j(z_j), z = (f − m)/s, with rising curves g_j; and what belongs to it.

    Parameters
    ----------
    mean, scale : arrays, (n_features,)
        m and s.
    intercept : float
    coefficients : array, (n_features,)
        b; 0 for the features that rise with the depth.
    knots, slopes : arrays, (n_shaped, 2) and (n_shaped, 3)
        Of the curves g of the features `SHAPED`: straight below, between and above the knots. Slopes are not negative.
    spread : array, (n_features + 1,)
        Of ln percent: σ = max(spread[0] + Σ spread[i] (f_i − m_i)/s_i, 0.1).
    quantiles : tuple of two floats
        5 % and 95 % quantiles of (ln true percent − predicted)/σ, each by a model that was not fitted to that rig.
    detection : array, (n_features,)
        Weights of the detection score.
    threshold : float
        Score from which a crack counts as seen.
    sound_scores : array, (n_sound,)
        Scores of sound gear pairs, rising: the higher one of either gear.
    precision : array, (n_features, n_features)
        Inverse covariance of the features (f_i − m_i)/s_i; 0 for those that the depth is not read from.
    largest_distance : float
        Mahalanobis distance beyond which a feature vector is unlike the calibration's.
    lowest, highest : arrays, (n_features,)
        Range of each feature among the calibration's cracks.
    percent_range : tuple of two floats
        Depths of the calibration.
    """

    mean: FloatArray
    scale: FloatArray
    intercept: float
    coefficients: FloatArray
    knots: FloatArray
    slopes: FloatArray
    spread: FloatArray
    quantiles: tuple[float, float]
    detection: FloatArray
    threshold: float
    sound_scores: FloatArray
    precision: FloatArray
    largest_distance: float
    lowest: FloatArray
    highest: FloatArray
    percent_range: tuple[float, float]

    def __post_init__(self) -> None:
        n = len(FEATURES)
        for name in ("mean", "scale", "coefficients", "spread", "detection", "lowest", "highest"):
            length = n + 1 if name == "spread" else n
            array = frozen_array(getattr(self, name), f"{name} of the model", ndim=1)
            if len(array) != length:
                raise InputError(f"{name} of the model has {len(array)} entries", allowed=str(length))
            object.__setattr__(self, name, array)
        object.__setattr__(self, "sound_scores", frozen_array(self.sound_scores, "sound_scores", ndim=1))
        for name in ("precision", "knots", "slopes"):
            object.__setattr__(self, name, frozen_array(getattr(self, name), name, ndim=2))
        if self.knots.shape != (len(SHAPED), 2) or self.slopes.shape != (len(SHAPED), 3):
            raise InputError(f"the curves of the model have shapes {self.knots.shape} and {self.slopes.shape}")
        rising = [FEATURES.index(name) for name in RISING]
        falls = np.any(self.coefficients[rising] < 0) or np.any(self.slopes < 0) or np.any(self.detection < 0)
        if np.any(self.scale <= 0) or np.any(np.diff(self.knots) <= 0) or falls:
            raise InputError("the model of crack depth would fall with a rising excess", remedy="fit it again")

    @classmethod
    def from_mapping(cls, values: Mapping[str, Any]) -> DepthModel:
        """Build it from what a JSON file holds."""

        def array(name: str) -> FloatArray:
            return np.asarray(values[name], dtype=np.float64)

        def two(name: str) -> tuple[float, float]:
            low, high = values[name]
            return float(low), float(high)

        return cls(
            mean=array("mean"),
            scale=array("scale"),
            intercept=float(values["intercept"]),
            coefficients=array("coefficients"),
            knots=array("knots"),
            slopes=array("slopes"),
            spread=array("spread"),
            quantiles=two("quantiles"),
            detection=array("detection"),
            threshold=float(values["threshold"]),
            sound_scores=array("sound_scores"),
            precision=array("precision"),
            largest_distance=float(values["largest_distance"]),
            lowest=array("lowest"),
            highest=array("highest"),
            percent_range=two("percent_range"),
        )

    def standardised(self, features: FloatArray) -> FloatArray:
        """Return (f − m)/s."""
        result: FloatArray = (features - self.mean) / self.scale
        return result

    def log_percent(self, features: FloatArray) -> float:
        """Return the predicted ln of the depth in percent of the root's thickness."""
        z = self.standardised(features)
        curves = [
            segments(z[FEATURES.index(name)], knots) @ slopes
            for name, knots, slopes in zip(SHAPED, self.knots, self.slopes, strict=True)
        ]
        return self.intercept + float(z @ self.coefficients) + float(sum(curves))

    def log_interval(self, features: FloatArray) -> tuple[float, float]:
        """Return the 90 % interval of ln percent."""
        centre, spread = self.log_percent(features), self.spread_of(features)
        return centre + self.quantiles[0] * spread, centre + self.quantiles[1] * spread

    def spread_of(self, features: FloatArray) -> float:
        """Return σ of ln percent."""
        spread = float(self.spread[0] + self.standardised(features) @ self.spread[1:])
        return max(spread, LEAST_SPREAD)

    def score(self, features: FloatArray) -> float:
        """Return the detection score."""
        return float(self.standardised(features) @ self.detection)

    def p_value(self, score: float) -> float:
        """Return (1 + number of sound pairs with as high a score)/(1 + number of sound pairs)."""
        higher = len(self.sound_scores) - int(np.searchsorted(self.sound_scores, score, side="left"))
        return (1.0 + higher) / (1.0 + len(self.sound_scores))

    def distance(self, features: FloatArray) -> float:
        """Return the Mahalanobis distance from the calibration's cracks."""
        z = self.standardised(features)
        return float(np.sqrt(z @ self.precision @ z))

    def unlike(self, features: FloatArray) -> str:
        """Say in which way a feature vector is unlike the calibration's cracks; empty if it is not."""
        margin = RANGE_MARGIN * (self.highest - self.lowest)
        beyond = np.maximum(self.lowest - margin - features, features - self.highest - margin)
        beyond[np.diag(self.precision) == 0] = 0.0  # a clearer event than any in the calibration is no harm
        i = int(np.argmax(beyond))
        if beyond[i] > 0:
            allowed = f"{self.lowest[i]:.2f} to {self.highest[i]:.2f}"
            return f"its {FEATURES[i]} is {features[i]:.2f}, the calibration has {allowed}"
        distance = self.distance(features)
        if distance > self.largest_distance:
            return f"its features lie {distance:.1f} from their middle, the limit is {self.largest_distance:.1f}"
        return ""

    def at_threshold(self, features: FloatArray) -> FloatArray:
        """Return the features that the least visible crack at this place would have.

        All energies of the event rise by the same factor until the score reaches the threshold. If it is there already,
        nothing changes.
        """
        rising = [FEATURES.index(name) for name in RISING]
        gain = float(np.sum(self.detection[rising] / self.scale[rising]))
        missing = max(0.0, self.threshold - self.score(features))
        result = np.array(features, dtype=np.float64)
        result[rising] += missing / gain
        return result
