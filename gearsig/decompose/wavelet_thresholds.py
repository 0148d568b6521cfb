"""Thresholds of wavelet coefficients, and the rules that apply them."""

from __future__ import annotations

import numpy as np

from gearsig.checks import FloatArray

MEDIAN_OF_NORMAL = 0.674489750196081743
"""Median of the magnitude of a standard normal variable."""


def noise_level(d: FloatArray) -> float:
    """Return the standard deviation of Gaussian noise in which few coefficients hold signal: median|d| / 0.6745.

    Source: D. L. Donoho and I. M. Johnstone, "Ideal spatial adaptation by wavelet shrinkage", 1994.
    """
    return float(np.median(np.abs(d))) / MEDIAN_OF_NORMAL


def universal(sigma: float, n: int) -> float:
    """Return σ √(2 ln n), which the largest of n noise values hardly exceeds (same source)."""
    return float(sigma * np.sqrt(2.0 * np.log(max(n, 2))))


def sure(d: FloatArray, sigma: float, n: int) -> float:
    """Return the threshold of least estimated risk of the soft rule, or the universal one on a sparse level.

    SURE(T) = m - 2 #{|d| ≤ T} + Σ min(|d|, T)² in units of σ, least at one of the |d|. A level counts as sparse if
    Σ d²/m - 1 ≤ (log₂ m)^(3/2) / √m. `n` is the signal's length.

    Source: D. L. Donoho and I. M. Johnstone, "Adapting to unknown smoothness via wavelet shrinkage", 1995.
    """
    if sigma == 0.0:
        return 0.0
    m = len(d)
    square = np.sort(np.square(d / sigma))
    if m < 2 or square.mean() - 1.0 <= np.log2(m) ** 1.5 / np.sqrt(m):
        return universal(sigma, n)
    below = np.arange(1, m + 1)
    risk = m - 2.0 * below + np.cumsum(square) + (m - below) * square
    return min(float(sigma * np.sqrt(square[int(np.argmin(risk))])), universal(sigma, n))


def bayes(d: FloatArray, sigma: float) -> float:
    """Return σ²/σ_signal, σ_signal² = mean d² - σ²; inf where there is no signal.

    Source: S. G. Chang, B. Yu and M. Vetterli, "Adaptive wavelet thresholding for image denoising and compression",
    2000.
    """
    signal = float(np.mean(np.square(d))) - sigma**2
    return float(sigma**2 / np.sqrt(signal)) if signal > 0.0 else float("inf")


def apply(d: FloatArray, threshold: float, rule: str) -> FloatArray:
    """Return thresholded coefficients.

    soft: sign(d) (|d| - T); hard: d; garrote: d - T²/d; each for |d| > T, else 0.

    Source of the garrote: H.-Y. Gao, "Wavelet shrinkage denoising using the non-negative garrote", 1998.
    """
    kept = np.abs(d) > threshold
    if rule == "hard":
        return np.where(kept, d, 0.0)
    shrunk = np.zeros_like(d)
    if rule == "soft":
        return np.subtract(d, np.copysign(threshold, d), out=shrunk, where=kept)
    ratio = np.divide(threshold, d, out=shrunk, where=kept)
    return np.where(kept, d - threshold * ratio, 0.0) if kept.any() else ratio
