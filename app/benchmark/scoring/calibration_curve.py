"""Whether probabilities are worth what they say: Brier score, calibration error, calibration curve."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from gearsig.checks import FloatArray

N_BINS = 10
N_DRAWS = 500


@dataclass(frozen=True)
class CalibrationBin:
    """Answers of nearly the same confidence.

    Parameters
    ----------
    confidence : float
        Mean probability of the likeliest cause.
    accuracy : float
        Share of those that were right.
    n : int
    """

    confidence: float
    accuracy: float
    n: int


def brier(probabilities: Mapping[str, float], truth: str) -> float:
    """Return Σ_k (p_k − y_k)² over all causes, 0 (sure and right) to 2 (sure and wrong).

    Source: G. W. Brier, *Verification of forecasts expressed in terms of probability* (Monthly Weather Review, 1950).
    """
    names = {*probabilities, truth}
    return float(sum((probabilities.get(name, 0.0) - (name == truth)) ** 2 for name in names))


def bins_of(confidence: Sequence[float], right: Sequence[bool], n_bins: int = N_BINS) -> list[CalibrationBin]:
    """Return bins with equally many answers, by rising confidence."""
    order = np.argsort(confidence, kind="stable")
    parts = np.array_split(order, min(n_bins, len(order))) if len(order) else []
    c, r = np.asarray(confidence, dtype=np.float64), np.asarray(right, dtype=np.float64)
    return [CalibrationBin(float(c[part].mean()), float(r[part].mean()), len(part)) for part in parts]


def calibration_error(confidence: Sequence[float], right: Sequence[bool], n_bins: int = N_BINS) -> float:
    """Return Σ_b (n_b/n) |accuracy_b − confidence_b| over bins of equal mass.

    It is above 0 by chance even if every probability is true: see `error_by_chance`.

    Source: M. P. Naeini, G. F. Cooper, M. Hauskrecht, *Obtaining well calibrated probabilities using Bayesian binning*
    (AAAI, 2015), with bins of equal mass.
    """
    found = bins_of(confidence, right, n_bins)
    total = sum(b.n for b in found)
    return sum(b.n * abs(b.accuracy - b.confidence) for b in found) / total if total else float("nan")


def error_by_chance(confidence: Sequence[float], rng: np.random.Generator) -> float:
    """Return the calibration error that true probabilities would show with so many answers, on average."""
    if not len(confidence):
        return float("nan")
    values: FloatArray = np.asarray(confidence, dtype=np.float64)
    drawn = rng.random((N_DRAWS, len(values))) < values
    return float(np.mean([calibration_error(confidence, row.tolist()) for row in drawn]))
