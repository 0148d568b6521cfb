r"""Limits, change points and alarms of series of indicators, by closed forms with known false-alarm rates.

All series of a measuring point are processed together: an array of values (recordings × series) with the operating
conditions of each recording. Levels are in dB, so that scatter is a ratio.

Model of an unchanged machine: :math:`y_i = x_i^T \beta + \sigma \epsilon_i` with independent normal
:math:`\epsilon_i`; :math:`x_i` holds 1 and, if they vary over the baseline, the logarithms of speed and load. What
follows is exact for any number of baseline recordings, because the parameters are not assumed to be known:

* A new value lies above :math:`x^T b + t_{1-\alpha,\,n-p}\, s \sqrt{1 + x^T (X^T X)^{-1} x}` with probability
  :math:`\alpha` (prediction limit of a linear regression).
* The studentised recursive residuals of the whole series (R. L. Brown, J. Durbin, J. M. Evans, "Techniques for testing
  the constancy of regression relationships over time", 1975) are independent; transformed by their t distribution they
  are standard normal, so their cumulative sum has the run length of one with known parameters (self-starting CUSUM:
  D. M. Hawkins, "Self-starting cusum charts for location and scale", 1987).

False alarms are more frequent if recordings depend on each other (minutes apart) or their scatter has long tails.
"""

from __future__ import annotations

from math import exp
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gearsig.checks import FloatArray

BoolArray = NDArray[np.bool_]
IntArray = NDArray[np.integer[Any]]

MIN_FREEDOM = 5
"""Degrees of freedom that a limit needs: with fewer, t is so large that no fault would be detected."""

MIN_SPAN = 1.05
"""Minimum ratio of largest to smallest speed or load in a baseline for a level's dependence on it to be fitted."""

MIN_SCATTER = 0.1
"""Minimum scatter in dB; less is not plausible: an accelerometer alone drifts by 1 % with temperature."""

OUTSIDE = 1.25
"""Ratio beyond the baseline's range of speed or load from which a recording is not judged by the baseline."""

CUSUM_K = 0.5
"""Allowance of the CUSUM in standard deviations: quickest for a shift of one."""


def regressors(
    speed_rpm: FloatArray, load_nm: FloatArray, baseline: BoolArray
) -> tuple[FloatArray, BoolArray, tuple[str, ...]]:
    """Return the regressors of levels, which recordings they cover, and the names of the quantities that vary.

    Parameters
    ----------
    speed_rpm, load_nm : array, (n,)
        nan where unknown.
    baseline : bool array, (n,)

    Returns
    -------
    array, (n, p)
        1, and log10 of speed and load relative to their means over the baseline.
    bool array, (n,)
        Whether the recording's speed and load lie within the baseline's range, widened by `OUTSIDE` on either side.
    tuple of str
        "speed", "load".
    """
    n = len(speed_rpm)
    columns, names, inside = [np.ones(n)], [], np.ones(n, dtype=np.bool_)
    for name, values in (("speed", np.abs(speed_rpm)), ("load", np.abs(load_nm))):
        known = values[baseline & np.isfinite(values) & (values > 0)]
        if len(known) == 0:
            continue
        low, high = float(known.min()), float(known.max())
        with np.errstate(invalid="ignore"):
            inside &= ~((values > OUTSIDE * high) | (values < low / OUTSIDE))
        if len(known) == int(baseline.sum()) and high > MIN_SPAN * low:
            is_known = np.isfinite(values) & (values > 0)
            decades = np.log10(np.where(is_known, values, known.mean()))
            columns.append(decades - decades[baseline].mean())
            names.append(name)
            inside &= is_known
    freedom = int(baseline.sum()) - len(columns)
    if freedom < MIN_FREEDOM or (
        len(columns) > 1 and np.linalg.matrix_rank(np.column_stack(columns)[baseline], tol=1e-3) < len(columns)
    ):
        columns, names = columns[:1], []
    return np.column_stack(columns), inside, tuple(names)


def prediction_limits(
    y: FloatArray, x: FloatArray, baseline: BoolArray, false_alarm_rate: float, *, min_scatter: FloatArray | float = 0.0
) -> tuple[FloatArray, FloatArray]:
    """Return the expected values, and the deviation that an unchanged machine exceeds with the stated probability.

    Parameters
    ----------
    y : array, (n_recordings, n_series)
        Values, normally distributed about the regression; nan if a recording has none.
    x : array, (n_recordings, p)
        See `regressors`.
    baseline : bool array, (n_recordings,)
    false_alarm_rate : float
        For one value of one series, half on each side.
    min_scatter : float or array, (n_series,)
        Lower bound of the standard deviation.

    Returns
    -------
    array, (n_recordings, n_series)
        From the baseline's regression at each recording's speed and load; nan if there is none.
    array, (n_recordings, n_series)
        Half the width of the interval about the expected value.
    """
    from scipy.special import stdtrit

    n, m = y.shape
    p = x.shape[1]
    expected, width = np.full((n, m), np.nan), np.full((n, m), np.nan)
    min_scatters = np.broadcast_to(np.asarray(min_scatter, dtype=np.float64), (m,))
    for pattern, columns in _patterns(np.isfinite(y) & baseline[:, None]):
        freedom = int(pattern.sum()) - p
        if freedom < MIN_FREEDOM or np.linalg.matrix_rank(x[pattern]) < p:
            continue
        inverse = np.linalg.inv(x[pattern].T @ x[pattern])
        b = inverse @ (x[pattern].T @ y[np.ix_(pattern, columns)])
        residual = y[np.ix_(pattern, columns)] - x[pattern] @ b
        s = np.maximum(np.sqrt(np.square(residual).sum(axis=0) / freedom), min_scatters[columns])
        reach = np.sqrt(1.0 + np.einsum("ij,jk,ik->i", x, inverse, x))
        t = -float(stdtrit(freedom, 0.5 * false_alarm_rate))
        expected[:, columns] = x @ b
        width[:, columns] = t * reach[:, None] * s
    return expected, width


def _patterns(known: BoolArray) -> list[tuple[BoolArray, IntArray]]:
    """Group columns that are known in the same rows."""
    if known.shape[1] == 0:
        return []
    packed = np.packbits(known, axis=0)
    _, first, group = np.unique(packed, axis=1, return_index=True, return_inverse=True)
    return [(known[:, i], np.flatnonzero(group.ravel() == g)) for g, i in enumerate(first)]


def standardised_innovations(y: FloatArray, x: FloatArray) -> FloatArray:
    """Return the innovation of each value, standard normal and independent if the machine does not change.

    This is the studentised recursive residual of value i, from the regression over the values before it, transformed by
    the t distribution.

    Parameters
    ----------
    y : array, (n_recordings, n_series)
    x : array, (n_recordings, p)

    Returns
    -------
    array, (n_recordings, n_series)
        nan for at least the first p + 1 values of a series, and where there is no value.
    """
    result = np.full(y.shape, np.nan)
    p = x.shape[1]
    for pattern, columns in _patterns(np.isfinite(y)):
        rows = np.flatnonzero(pattern)
        start = p + 1
        while start < len(rows) and np.linalg.matrix_rank(x[rows[:start]], tol=1e-3) < p:
            start += 1
        if start >= len(rows):
            continue
        values, facts = y[np.ix_(rows, columns)], x[rows]
        result[np.ix_(rows[start:], columns)] = _recursive(values, facts, start)
    return result


def _recursive(values: FloatArray, facts: FloatArray, start: int) -> FloatArray:
    """Return standardised innovations by recursive least squares over complete rows."""
    from scipy.special import ndtri, stdtr

    p = facts.shape[1]
    inverse = np.linalg.inv(facts[:start].T @ facts[:start])
    b = inverse @ (facts[:start].T @ values[:start])
    squares = np.square(values[:start] - facts[:start] @ b).sum(axis=0)
    w = np.empty_like(values[start:])
    s = np.empty_like(w)
    for i in range(start, len(values)):
        row = facts[i]
        gain = inverse @ row
        size = 1.0 + row @ gain
        error = values[i] - row @ b
        w[i - start] = error / np.sqrt(size)
        s[i - start] = np.sqrt(squares / (i - p))
        inverse -= np.outer(gain, gain) / size
        b += np.outer(gain / size, error)
        squares += np.square(w[i - start])
    freedom = np.arange(start, len(values))[:, None] - p
    t = w / np.maximum(s, 1e-300)
    tail = stdtr(freedom, -np.abs(t))  # the smaller tail keeps its digits
    q: FloatArray = -np.sign(t) * ndtri(np.maximum(tail, 1e-300))
    return q


def cusum_threshold(run_length: float) -> float:
    """Return the threshold at which a two-sided CUSUM raises one false alarm in `run_length` values on average.

    D. Siegmund's approximation, *Sequential Analysis*, 1985, for one side: (exp(2kb) - 2kb - 1)/(2k²) with
    b = h + 1.166; the two sides together have half that run length.

    Examples
    --------
    >>> round(cusum_threshold(465.0), 1)  # tables: 5.0
    5.0
    """
    low, high = 0.0, 200.0
    for _ in range(80):
        h = 0.5 * (low + high)
        z = 2 * CUSUM_K * (h + 1.166)
        low, high = (h, high) if (exp(z) - z - 1) / (2 * CUSUM_K**2) < 2 * run_length else (low, h)
    return 0.5 * (low + high)


def change_points(q: FloatArray, run_length: float) -> tuple[IntArray, IntArray]:
    """Return where each series first changed, and where the change was detected; -1 if it has not changed.

    Two-sided CUSUM S = max(0, S + q - k), and likewise downwards; the estimated start of the change is the most likely
    step of the mean since S last left zero.

    Parameters
    ----------
    q : array, (n_recordings, n_series)
        Independent standard normal numbers; nan is skipped.
    run_length : float
        Average number of values between false alarms.
    """
    threshold, m = cusum_threshold(run_length), q.shape[1]
    began, noticed = np.full(m, -1), np.full(m, -1)
    for sign in (1.0, -1.0):
        total, since = np.zeros(m), np.zeros(m, dtype=np.int64)
        for i, row in enumerate(q):
            step = np.where(np.isfinite(row), sign * row - CUSUM_K, 0.0)
            since = np.where(total <= 0.0, i, since)
            total = np.maximum(0.0, total + step)
            first = (total > threshold) & ((noticed < 0) | (i < noticed))
            began, noticed = np.where(first, since, began), np.where(first, i, noticed)
    for column in np.flatnonzero(noticed >= 0):
        # The most likely step of the mean since the sum left zero, as the sum may have crept up before.
        steps = np.nan_to_num(q[began[column] : noticed[column] + 1, column])[::-1]
        likelihood = np.square(np.cumsum(steps)) / np.arange(1, len(steps) + 1)
        began[column] = noticed[column] - int(np.argmax(likelihood))
    return began, noticed


OK, WARNING, ALARM = 0, 1, 2
"""Levels of a series."""


def alarm_levels(sample: IntArray, calm: BoolArray, n_to_clear: int) -> IntArray:
    """Return the level after each value: raised at once, cleared after `n_to_clear` consecutive calm values.

    Parameters
    ----------
    sample : int array, (n_recordings, n_series)
        Level of each value alone; negative if there is none.
    calm : bool array, (n_recordings, n_series)
        Whether the value is below the level for clearing.
    n_to_clear : int
    """
    m = sample.shape[1]
    level, n_calm = np.zeros(m, dtype=np.int64), np.zeros(m, dtype=np.int64)
    result = np.zeros(sample.shape, dtype=np.int64)
    for i in range(len(sample)):
        known = sample[i] >= 0
        n_calm = np.where(known, np.where(calm[i], n_calm + 1, 0), n_calm)
        level = np.where(known, np.maximum(level, sample[i]), level)
        level = np.where(n_calm >= n_to_clear, np.maximum(sample[i], 0), level)
        result[i] = level
    return result


def decibels(values: FloatArray, baseline: BoolArray, is_signed: BoolArray) -> tuple[FloatArray, BoolArray]:
    """Return levels in dB if a series is positive over its baseline, else the values unchanged.

    Parameters
    ----------
    values : array, (n_recordings, n_series)
    baseline : bool array, (n_recordings,)
    is_signed : bool array, (n_series,)
        Series that may be negative, e.g. those already in dB, and stay unchanged.

    Returns
    -------
    array, (n_recordings, n_series)
        20 lg of the values; a later zero counts as a thousandth of the baseline's minimum.
    bool array, (n_series,)
        Whether the series was converted to dB.
    """
    known = np.where(baseline[:, None], values, np.nan)
    filled = np.where(np.isfinite(known), known, np.inf)
    smallest = filled.min(axis=0, initial=np.inf)
    in_db = (smallest > 0) & np.isfinite(smallest) & ~is_signed
    floor = np.where(in_db, 1e-3 * np.where(np.isfinite(smallest), smallest, 1.0), 1.0)
    with np.errstate(invalid="ignore", divide="ignore"):
        levels = 20.0 * np.log10(np.maximum(values, floor))
    return np.where(in_db, levels, values), in_db
