"""From the looks of simulated cracks, chips and spalls to a model of which it is."""

from __future__ import annotations

import numpy as np

from gearsig.checks import FloatArray
from gearsig.severity.kind import CRACKED, KINDS, KindModel

_RIDGE = 2.0


def fit_kind(vectors: FloatArray, kinds: list[str]) -> KindModel:
    """Fit a softmax regression; cracks weigh as much as chips and spalls together.

    Parameters
    ----------
    vectors : array, (n, n_features)
        Of events that are seen; see `gearsig.severity.kind.kind_vector`.
    kinds : list of str
        What each is.
    """
    from scipy.optimize import minimize

    mean, scale = vectors.mean(axis=0), vectors.std(axis=0)
    z = np.clip((vectors - mean) / scale, -4.0, 4.0)
    rows = np.c_[np.ones(len(z)), z]
    truth = np.array([[kind == name for name in KINDS] for kind in kinds], dtype=np.float64)
    shares = np.array([0.5 if name == CRACKED else 0.5 / (len(KINDS) - 1) for name in KINDS])
    weight = truth @ (len(z) * shares / truth.sum(axis=0))

    def loss(flat: FloatArray) -> tuple[float, FloatArray]:
        weights = flat.reshape(len(KINDS), -1)
        levels = rows @ weights.T
        levels -= levels.max(axis=1, keepdims=True)
        logs = levels - np.log(np.exp(levels).sum(axis=1, keepdims=True))
        slope = ((np.exp(logs) - truth) * weight[:, None]).T @ rows
        slope[:, 1:] += 2.0 * _RIDGE * weights[:, 1:]
        return float(-weight @ (truth * logs).sum(axis=1) + _RIDGE * np.sum(weights[:, 1:] ** 2)), slope.ravel()

    best = minimize(loss, np.zeros(len(KINDS) * rows.shape[1]), jac=True, method="L-BFGS-B").x
    return KindModel(mean, scale, best.reshape(len(KINDS), -1))
