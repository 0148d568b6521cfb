"""How likely each cell of a transform lies on a ridge."""

from __future__ import annotations

import numpy as np

from gearsig.checks import FloatArray

SQUEEZED_REACH = 2
"""Lines on either side over which a squeezed component's share may scatter."""
_FLOOR_OVER_MEDIAN = 4.0
_FLOOR_UNDER_TOP = 1e-5
_DILATION = ((0, 1.0), (1, 0.7), (-1, 0.7), (2, 0.3), (-2, 0.3))


def ridge_power(power: FloatArray, *, squeezed: bool) -> FloatArray:
    """Return the power that one component has at each line: of squeezed ones, the sum over its lines."""
    if not squeezed:
        return power
    from scipy.ndimage import uniform_filter1d

    width = 2 * SQUEEZED_REACH + 1
    summed: FloatArray = uniform_filter1d(power, width, axis=0, mode="constant") * width
    return np.maximum(summed, 0.0)  # the running sum may round below zero


def ridge_scores(power: FloatArray, n_reach: int) -> FloatArray:
    """Return scores from 0 to 1: near 1 on local maxima over frequency that stand out, falling off beside them.

    The score saturates: a weak component on its own ridge counts about as much as a strong one, so that nothing is won
    by changing over to the stronger one. Skirts of strong components are no maxima and count nothing.

    Parameters
    ----------
    power : array, (n_lines, n_columns)
    n_reach : int
    """
    from scipy.ndimage import maximum_filter1d

    largest = float(power.max())
    positive = power[power > 0]
    if largest <= 0 or positive.size == 0:
        return np.zeros_like(power)
    floor = max(_FLOOR_OVER_MEDIAN * float(np.median(power)), _FLOOR_UNDER_TOP * largest)
    top = power >= maximum_filter1d(power, 2 * n_reach + 1, axis=0, mode="constant")
    height = np.where(top, power / (power + floor), 0.0)
    result = np.zeros_like(height)
    n = len(height)
    for shift, share in _DILATION:
        low, high = max(0, shift), min(n, n + shift)
        part = result[low:high]
        np.maximum(part, share * height[low - shift : high - shift], out=part)
    return result
