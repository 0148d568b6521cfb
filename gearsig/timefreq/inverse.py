"""Back from coefficients to the signal, whole or between lines."""

from __future__ import annotations

import numpy as np

from gearsig.checks import FloatArray, not_negative
from gearsig.errors import InputError
from gearsig.timefreq.types import Coefficients, ComplexArray


def inverse(
    coefficients: Coefficients, *, lowest: FloatArray | float | None = None, highest: FloatArray | float | None = None
) -> ComplexArray:
    """Return the analytic signal at the columns; its real part is the signal.

    z(t) = Σ_l weight_l · value(l, t) over the lines between `lowest` and `highest`.

    Parameters
    ----------
    coefficients : Coefficients
    lowest, highest : float, array (n_columns,) or None
        In Hz or orders; an array follows a component. None: all lines.

    Returns
    -------
    complex array, (n_columns,)
        Peak amplitude in the coefficients' unit. Whole signals come back, as error over amplitude: from the STFT
        with all lines to 1e-6, ends included; from the CWT to 1e-4 away from the ends for frequencies that lie √2 or
        more inside the outermost lines (the default wavelet), 1e-2 next to them; from the squeezed transforms to 1e-4
        rms, with single samples 1e-2 off where components cancel. What lies outside the lines, the mean
        included, is lost.

    Raises
    ------
    InputError
        If limits have another length than the columns.
    """
    values, lines = coefficients.values, coefficients.positions
    n = values.shape[1]
    low, high = _limit(lowest, -np.inf, n, "lowest"), _limit(highest, np.inf, n, "highest")
    result = np.zeros(n, dtype=np.complex128)
    for line, weight, row in zip(lines, coefficients.weights, values, strict=True):
        inside = (line >= low) & (line <= high)
        if inside.any():
            result += np.where(inside, weight * row, 0.0)
    return result


def _limit(value: FloatArray | float | None, default: float, n: int, name: str) -> FloatArray:
    if value is None:
        return np.full(1, default)
    limit = np.atleast_1d(np.asarray(value, dtype=np.float64))
    if limit.shape not in ((1,), (n,)):
        raise InputError(f"{name} has shape {limit.shape}", allowed=f"a number, or an array of {n} columns")
    if np.isnan(limit).any():
        raise InputError(f"{name} holds NaN", allowed="numbers")
    not_negative(float(limit.min()), name)
    return limit
