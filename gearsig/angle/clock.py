"""The clock that pulse times were taken with: find its tick, and fit the angle within its quantisation."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gearsig.checks import FloatArray

IntArray = NDArray[np.integer[Any]]

# Length in pulses over which the smoothest fit averages; slower changes of speed pass whatever the clock.
_LONGEST_SMOOTHING = 60.0
# Rounds of local easing; each eases the penalty by 4, so the last ones interpolate.
_N_EASINGS = 30


def clock_tick(times_s: FloatArray) -> float:
    """Find the step that all pulse times are multiples of (plus an offset), 0 if there is none.

    The smallest difference between two intervals is a first guess of the tick; it is then sharpened over longer and
    longer spans, and accepted if the times lie on its grid within a tenth (a uniform scatter would give 0.29).

    Parameters
    ----------
    times_s : array, (n,)
        Strictly increasing.

    Returns
    -------
    float
        In seconds. A tick below a millionth of the shortest interval does no harm and is not looked for.
    """
    if len(times_s) < 16:
        return 0.0
    t = times_s - times_s[0]
    intervals = np.diff(t)
    floor = max(1e-6 * float(intervals.min()), 64 * np.finfo(float).eps * float(np.abs(times_s).max()))
    steps = np.diff(np.sort(intervals))
    steps = steps[steps > floor]
    if len(steps) == 0:
        return 0.0
    tick = float(np.median(steps[steps < 1.5 * steps.min()]))
    for n in np.unique(np.geomspace(4, len(t), 12).astype(int)):
        ticks = np.round(t[:n] / tick)
        if ticks[-1] < 1:
            return 0.0
        tick = float(ticks @ t[:n] / (ticks @ ticks))
    off = t / tick - np.round(t / tick)
    return tick if np.std(off) < 0.1 else 0.0


def fit_within_ticks(t: FloatArray, counts: FloatArray, tick_s: float, breaks: IntArray | None = None) -> FloatArray:
    """Smooth angles (in pulses) at times that are quantised to a tick.

    Minimise Σ wₖ(yₖ - kₖ)² + Σ λⱼ (Δ³y)ⱼ² where Δ³ is the third divided difference scaled by the local interval. Start
    with a large λ; wherever a pulse's residual, divided by the local speed, exceeds half a tick, λ is eased around it,
    until all residuals lie within. Constant acceleration passes unchanged. A single pulse that lies off its neighbours'
    course gets weight wₖ = 0.

    Parameters
    ----------
    t : array, (n,)
        Pulse times, s.
    counts : array, (n,)
        Pulse numbers.
    tick_s : float
        Above zero.
    breaks : array, optional
        Indices of intervals that nothing is smoothed across (standstill).

    Returns
    -------
    array, (n,)
        Fitted angle in pulses at `t`.

    Notes
    -----
    Source: the penalised fit with third differences is P. H. C. Eilers, *A perfect smoother*, Anal. Chem. 75 (2003);
    choosing the penalty by the known error is C. H. Reinsch, *Smoothing by spline functions*, Numer. Math. 10 (1967).
    Easing it locally is our own addition.
    """
    n = len(t)
    counts = counts.astype(np.float64)
    if n < 6:
        return counts
    rows = _third_differences(t)
    penalty = np.full(n - 3, (_LONGEST_SMOOTHING / (2 * np.pi)) ** 6)
    for k in () if breaks is None else breaks:
        penalty[max(0, int(k) - 2) : int(k) + 1] = 0.0
    speed = np.gradient(counts, t)
    weights = np.ones(n)
    weights[late_pulses(t, counts, tick_s)] = 0.0
    fitted = counts
    for _ in range(_N_EASINGS):
        fitted = counts + _penalised(rows, penalty, weights, -_apply(rows, counts))
        # A hundredth of a tick of slack: the times themselves are rounded numbers.
        off = weights * np.abs(fitted - counts) > 0.51 * tick_s * speed
        if not off.any():
            return fitted
        reach = np.convolve(off, np.ones(9), mode="same") > 0
        touched = reach[:-3] | reach[1:-2] | reach[2:-1] | reach[3:]
        penalty = np.where(touched, penalty / 4, penalty)
    return np.where(off, counts, fitted)


def late_pulses(t: FloatArray, counts: FloatArray, tick_s: float) -> IntArray:
    """Indices of single pulses that come early or late by more than quantisation explains, seen from two on each side.

    The cubic through the neighbours carries at most 1.33 ticks of quantisation; a real change of speed shows at the
    neighbours too.
    """
    n = len(t)
    others = np.array([-2, -1, 1, 2])
    at = np.arange(2, n - 2)
    nodes, values = t[at[:, None] + others], counts[at[:, None] + others].astype(np.float64)
    gaps = nodes[:, :, None] - nodes[:, None, :] + np.eye(4)
    reach = t[at][:, None] - nodes
    lagrange = np.prod(reach, axis=1)[:, None] / (reach * np.prod(gaps, axis=2))
    slope = (values[:, 2] - values[:, 1]) / (nodes[:, 2] - nodes[:, 1])
    off = np.zeros(n)
    off[2 : n - 2] = np.abs(counts[at] - (lagrange * values).sum(axis=1)) / slope
    # A lone late pulse disturbs the prediction of its neighbours by 4/6 at most, one two places away by 1/6.
    largest = np.maximum.reduce([np.roll(off, k) for k in (-2, -1, 1, 2)])
    beyond = np.maximum.reduce([np.roll(off, k) for k in (-5, -4, -3, 3, 4, 5)])
    found: IntArray = np.flatnonzero((off > 1.6 * tick_s) & (off > 1.1 * largest) & (beyond < 0.6 * off))
    return found


def _third_differences(t: FloatArray) -> FloatArray:
    """Rows (n - 3, 4) of third divided differences times 6 × the mean interval cubed: [-1 3 -3 1] at equal steps."""
    nodes = np.stack([t[:-3], t[1:-2], t[2:-1], t[3:]], axis=1)
    gaps = nodes[:, :, None] - nodes[:, None, :] + np.eye(4)
    scale = 6.0 * ((nodes[:, 3] - nodes[:, 0]) / 3.0) ** 3
    rows: FloatArray = scale[:, None] / np.prod(gaps, axis=2)
    return rows


def _apply(rows: FloatArray, y: FloatArray) -> FloatArray:
    n = len(y)
    result: FloatArray = sum((rows[:, j] * y[j : n - 3 + j] for j in range(4)), start=np.zeros(n - 3))
    return result


def _penalised(rows: FloatArray, penalty: FloatArray, weights: FloatArray, target: FloatArray) -> FloatArray:
    """Solve (W + DᵀΛD) z = DᵀΛ·target for the correction z; small numbers, so that no digits of the angle are lost."""
    from scipy.linalg import solveh_banded

    n = len(penalty) + 3
    band = np.zeros((4, n))
    band[0] = weights
    right = np.zeros(n)
    for i in range(4):
        right[i : n - 3 + i] += rows[:, i] * penalty * target
        for j in range(i, 4):
            band[j - i, i : n - 3 + i] += penalty * rows[:, i] * rows[:, j]
    solution: FloatArray = solveh_banded(band, right, lower=True)
    return solution
