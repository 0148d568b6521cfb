"""What Gaussian noise alone does to the spectral kurtosis of a kurtogram's bands."""

from __future__ import annotations

import numpy as np

from gearsig.checks import FloatArray

OVERLAP = 1.66
"""Σ|ρ(m)|⁴ over the envelope's lags for the tree's filters (1.60 to 1.75 by path): samples per independent one."""
REAL_BIAS = 0.01
"""Kurtosis that a real signal's bands at 0 and half the rate show: the mirror image is close."""


def kurtosis_error(n_bands: int, n_samples: int) -> float:
    """Return the standard error of the kurtosis of white Gaussian noise.

    The influence function of ⟨|z|⁴⟩/⟨|z|²⟩² is 2 L₂(|z|²), Laguerre's polynomial, whose covariance is 4|ρ(m)|⁴, hence
    Var K = (4/n) Σ|ρ(m)|⁴. The whole real band has Hermite's H₄ instead: Var K = 24/n.
    """
    return float(np.sqrt((24.0 if n_bands == 1 else 4.0 * OVERLAP) / n_samples))


def noise_limit(n_samples: FloatArray, standard_error: FloatArray, probability: float) -> FloatArray:
    """Return the kurtosis that noise exceeds in any of the bands with at most about `probability`.

    Bonferroni's quantile q of the normal distribution, bent by the third and fourth moments of 2 L₂: skewness 10/√m and
    excess 294/m for m independent samples (Cornish and Fisher's expansion).
    """
    from scipy.special import ndtri

    q = float(-ndtri(probability / len(n_samples)))
    m = n_samples / OVERLAP
    skewness = 10.0 / np.sqrt(m)
    bent = q + skewness * (q**2 - 1) / 6 + 294.0 / m * (q**3 - 3 * q) / 24 - skewness**2 * (2 * q**3 - 5 * q) / 36
    result: FloatArray = bent * standard_error + REAL_BIAS
    return result
