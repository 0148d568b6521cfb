"""How likely each cell of a transform lies on a ridge."""

from __future__ import annotations

import numpy as np

from gearsig.checks import FloatArray

SQUEEZED_REACH = 2
"""Lines on either side over which a squeezed component's share may scatter."""
_FLOOR_OVER_MEDIAN = 4.0
_FLOOR_UNDER_TOP = 1e-5
_COLUMNS_OF_FLOOR = 8
_REACHES_OF_FLOOR = 5  # lines to either side over the reach of one component, few enough to follow coloured noise
_DILATION = ((0, 1.0), (1, 0.7), (-1, 0.7), (2, 0.3), (-2, 0.3))


def ridge_power(power: FloatArray, *, squeezed: bool) -> FloatArray:
    """Return the power that one component has at each line: of squeezed ones, the sum over its lines."""
    if not squeezed:
        return power
    from scipy.ndimage import uniform_filter1d

    width = 2 * SQUEEZED_REACH + 1
    summed: FloatArray = uniform_filter1d(power, width, axis=0, mode="constant") * width
    return np.maximum(summed, 0.0)  # the running sum may round below zero


def _surroundings(power: FloatArray, n_reach: int) -> FloatArray:
    """Return the median power of the lines around each cell, in means over a few columns."""
    from scipy.ndimage import median_filter

    starts = np.arange(0, power.shape[1], _COLUMNS_OF_FLOOR)
    n_columns = np.diff(starts, append=power.shape[1])
    mean = np.add.reduceat(power, starts, axis=1) / n_columns
    around = median_filter(mean, size=(2 * _REACHES_OF_FLOOR * n_reach + 1, 1), mode="nearest")
    return np.repeat(around, n_columns, axis=1)


def ridge_scores(power: FloatArray, n_reach: int) -> FloatArray:
    """Return scores from 0 to 1: near 1 on local maxima over frequency that stand out from the lines around them.

    The score saturates: a weak component on its own ridge counts about as much as a strong one, so that nothing is won
    by changing over to the stronger one. Skirts of strong components are no maxima and count nothing.

    Parameters
    ----------
    power : array, (n_lines, n_columns)
    n_reach : int
    """
    from scipy.ndimage import maximum_filter1d

    largest = float(power.max())
    if largest <= 0:
        return np.zeros_like(power)
    floor = np.maximum(_FLOOR_OVER_MEDIAN * _surroundings(power, n_reach), _FLOOR_UNDER_TOP * largest)
    top = power >= maximum_filter1d(power, 2 * n_reach + 1, axis=0, mode="constant")
    height = np.where(top, power / (power + floor), 0.0)
    result = np.zeros_like(height)
    n = len(height)
    for shift, share in _DILATION:
        low, high = max(0, shift), min(n, n + shift)
        part = result[low:high]
        np.maximum(part, share * height[low - shift : high - shift], out=part)
    return result
