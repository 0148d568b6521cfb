"""Tachometer pulses: edges with sub-sample times, spurious and missed pulses, clock ticks, shaft angle."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gearsig.angle._types import ShaftAngle, monotone_slopes
from gearsig.checks import FloatArray, count, frozen_array, one_of, positive
from gearsig.compiled import njit
from gearsig.errors import InputError, RefusalError
from gearsig.formatting import counted, percent


@dataclass(frozen=True)
class PulseEdges:
    """Edges found in a tachometer channel.

    Parameters
    ----------
    times_s : array, (n_pulses,)
        On the recording's time axis.
    tick_s : float
        Time step that the edges are quantised to: the sampling interval if the signal jumps from level to level within
        one sample, 0 if the edges are resolved by interpolation.
    threshold, hysteresis : float
        Values used, in the channel's unit.
    low, high : float
        Low and high level of the signal.
    """

    times_s: FloatArray
    tick_s: float
    threshold: float
    hysteresis: float
    low: float
    high: float


def find_pulse_edges(
    values: FloatArray,
    sampling_rate_hz: float,
    *,
    threshold: float | None = None,
    hysteresis: float | None = None,
    edge: str = "rising",
) -> PulseEdges:
    """Find the edges of a pulse signal with a Schmitt trigger.

    The trigger is armed below threshold - hysteresis/2 and fires above threshold + hysteresis/2; the edge lies where
    the straight line between the two samples around the last crossing meets the threshold.

    Parameters
    ----------
    values : array, (n_samples,)
    sampling_rate_hz : float
    threshold : float, optional
        Default: halfway between the low and the high level, which are the 0.05 and the 99.95 percentile.
    hysteresis : float, optional
        Full width; default: a quarter of the step from low to high.
    edge : str
        "rising" or "falling".

    Returns
    -------
    PulseEdges
        It may be empty: `pulse_train_angle` checks the number of pulses.

    Raises
    ------
    InputError
        On another `edge`, a negative hysteresis, or non-finite values.
    RefusalError
        If no threshold is given and the channel does not have two levels: it is constant, or noise.

    Notes
    -----
    Not for a channel with an analogue speed or an angle.
    """
    x = frozen_array(values, "tachometer channel", ndim=1)
    positive(sampling_rate_hz, "sampling_rate_hz", "Hz")
    one_of(edge, "edge", ("rising", "falling"))
    # Up to 0.05 % of spikes do no harm, and pulses may be as short as 0.1 % of a period.
    low, high = (float(v) for v in np.percentile(x, (0.05, 99.95)))
    if high - low < 0.1 * float(np.ptp(x)):  # pulses too short or too few for the percentiles
        low, high = float(x.min()), float(x.max())
    if threshold is None:
        _check_two_levels(x, low, high)
        threshold = 0.5 * (low + high)
    if hysteresis is None:
        hysteresis = 0.25 * (high - low)
    if hysteresis < 0:
        raise InputError(f"hysteresis is {hysteresis:g}", where="tachometer", allowed=">= 0")
    sign = 1.0 if edge == "rising" else -1.0
    positions, jumps = _schmitt(x, sign, sign * threshold, hysteresis / 2, 0.1 * (high - low))
    tick_s = 0.0
    if len(jumps) and np.mean(jumps) > 0.8:
        # After a jump within one sample, only the two samples around the edge are known; the middle is the best guess.
        positions = np.where(jumps, np.ceil(positions) - 0.5, positions)
        tick_s = 1.0 / sampling_rate_hz
    return PulseEdges(positions / sampling_rate_hz, tick_s, threshold, hysteresis, low, high)


def _check_two_levels(x: FloatArray, low: float, high: float) -> None:
    step = high - low
    remedy = "check which channel carries the pulses, or give threshold and hysteresis"
    if step <= 1e-12 * max(abs(low), abs(high)):
        raise RefusalError(f"the tachometer channel stays at {low:g}: there are no pulses", remedy=remedy)
    middle = float(np.mean((x > low + 0.25 * step) & (x < low + 0.75 * step)))
    if middle > 0.45:  # pulses have 0 to 0.1, a sine 0.33, uniform noise 0.5, Gaussian 0.9
        raise RefusalError(
            f"the tachometer channel has no two levels: {percent(middle)} of its samples lie in the middle "
            f"between {low:g} and {high:g}",
            remedy=remedy,
        )


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator,unused-ignore]
def _schmitt(x, sign, threshold, half_width, near):  # type: ignore[no-untyped-def]
    """Return positions (in samples) of upward edges of sign·x, and whether each is a jump from level to level.

    At a jump, the two samples around the edge differ by most of the step between the levels (ten times `near`), and the
    signal before and after changes by less than `near`.
    """
    n = x.shape[0]
    positions = np.empty(n // 2 + 1)
    jumps = np.zeros(n // 2 + 1, dtype=np.bool_)
    count = 0
    armed = False
    crossing = -1.0
    at = 0
    for i in range(n):
        value = sign * x[i]
        if value < threshold - half_width:
            armed = True
        if i > 0 and armed:
            before = sign * x[i - 1]
            if before < threshold <= value:
                crossing = i - 1 + (threshold - before) / (value - before)
                at = i
            if value >= threshold + half_width and crossing >= 0.0:
                positions[count] = crossing
                flat_before = at < 2 or abs(x[at - 1] - x[at - 2]) < near
                flat_after = at + 1 >= n or abs(x[at + 1] - x[at]) < near
                high_step = abs(x[at] - x[at - 1]) > 7 * near
                jumps[count] = high_step and flat_before and flat_after
                count += 1
                armed = False
                crossing = -1.0
    return positions[:count], jumps[:count]


# Spurious and missed pulses in a pulse train, distinguished from real changes of speed.


# An interval is suspicious if it is shorter or longer than the local trend by these factors.
_SHORT, _LONG = 0.6, 1.5


@dataclass(frozen=True)
class PulseCount:
    """A pulse train with numbered pulses.

    Parameters
    ----------
    times_s : array, (n,)
        Pulse times without the spurious pulses.
    counts : array of int, (n,)
        Number of each pulse; it jumps where pulses were missed.
    spurious_s, missed_s, pauses_s : arrays
        Times of the removed pulses, and starts of the gaps with missed pulses or with a stop of the machine.
    open_gaps_s : array
        Starts of gaps in which the number of missed pulses cannot be determined.
    """

    times_s: FloatArray
    counts: FloatArray
    spurious_s: FloatArray
    missed_s: FloatArray
    pauses_s: FloatArray
    open_gaps_s: FloatArray

    @property
    def n_missed(self) -> int:
        """Number of missed pulses."""
        return int(self.counts[-1]) + 1 - len(self.counts)


def count_pulses(times_s: FloatArray) -> PulseCount:
    """Number the pulses, omitting spurious ones and skipping numbers where pulses were missed."""
    t, spurious = _without_spurious(times_s)
    d = np.diff(t)
    steps = np.ones(len(d), dtype=np.int64)
    missed, pauses, gaps = [], [], []
    trend = local_trend(d) if len(d) >= 3 else d
    for k in np.flatnonzero((d > _LONG * trend) & (d > _LONG * _of_neighbours(d))):
        exact = float(d[k] / trend[k])
        whole = round(exact) if np.isfinite(exact) else 0
        # The trend is known to a few per cent per pulse; beyond eight missed pulses the count would be a guess.
        if _slows_down_around(d, int(k)):
            pauses.append(t[k])
        elif whole > 9 or abs(exact - whole) > 0.35:
            gaps.append(t[k])
        elif whole > 1:
            steps[k] = whole
            missed.append(t[k])
    counts = np.concatenate([[0], np.cumsum(steps)])
    places = (np.asarray(times, dtype=float) for times in (times_s[spurious], missed, pauses, gaps))
    return PulseCount(t, counts, *places)


def local_trend(intervals: FloatArray) -> FloatArray:
    """Return the length of each interval predicted from its neighbours; infinite where they indicate a standstill.

    At constant acceleration, the squared speed grows linearly with angle, so q = 1/interval² is almost linear in the
    pulse number, from a standing start to a stop. Each interval is predicted by symmetric means (q₋ᵢ + q₊ᵢ)/2, at
    the ends by extrapolations 2q₁ - q₂; the median of the predictions tolerates faulty neighbours.
    """
    n = len(intervals)
    q = 1.0 / np.square(intervals)
    predictions = np.full((9, n), np.nan)
    for i in range(1, 4):
        if n > 2 * i:
            predictions[i - 1, i : n - i] = 0.5 * (q[: n - 2 * i] + q[2 * i :])
    edge = min(3, n)
    for i in range(1, 4):
        for k in range(edge):
            if k + 2 * i < n:
                predictions[2 + i, k] = 2 * q[k + i] - q[k + 2 * i]
            if n - 1 - k - 2 * i >= 0:
                predictions[5 + i, n - 1 - k] = 2 * q[n - 1 - k - i] - q[n - 1 - k - 2 * i]
    # With four intervals or fewer there may be no prediction: such an interval is used unchanged.
    predictions = np.where(np.isnan(predictions).all(axis=0), q, predictions)
    expected_q = np.nanmedian(predictions, axis=0)
    with np.errstate(divide="ignore", invalid="ignore"):
        trend: FloatArray = np.where(expected_q > 0, 1.0 / np.sqrt(np.abs(expected_q)), np.inf)
    return trend


def _without_spurious(times_s: FloatArray) -> tuple[FloatArray, list[int]]:
    """Return the times without spurious pulses, and the indices of the spurious ones."""
    remaining = np.arange(len(times_s))
    removed: list[int] = []
    # Each round removes one pulse from each separate group of short intervals; a worse pulse train is refused later.
    for _ in range(20):
        t = times_s[remaining]
        if len(t) < 6:
            break
        d = np.diff(t)
        trend = local_trend(d)
        drop = [_spurious_end(t, trend, k) for k in _shortest_of_each_group(d / np.minimum(trend, _of_neighbours(d)))]
        spurious = sorted({k for k in drop if k is not None})
        if not spurious:
            break
        removed += [int(remaining[k]) for k in spurious]
        remaining = np.delete(remaining, spurious)
    return times_s[remaining], sorted(removed)


def _shortest_of_each_group(ratio: FloatArray) -> list[int]:
    """Return the indices of short intervals that are the shortest within three intervals on either side."""
    chosen: list[int] = []
    blocked = np.zeros(len(ratio), dtype=bool)
    for k in np.argsort(ratio):
        if ratio[k] >= _SHORT:
            break
        if not blocked[k]:
            chosen.append(int(k))
            blocked[max(0, k - 3) : k + 4] = True
    return chosen


def _spurious_end(t: FloatArray, trend: FloatArray, k: int) -> int | None:
    """Return the end of interval k whose removal makes its neighbours fit the trend best; None if neither helps."""
    expected = trend[k]
    if not np.isfinite(expected):
        return None
    best: tuple[float, int] | None = None
    for pulse in (k + 1, k):
        near = slice(max(0, pulse - 2), pulse + 3)
        rest = np.delete(t[near], pulse - near.start)
        misfit = float(np.abs(np.log(np.diff(rest) / expected)).sum()) if len(rest) > 1 else np.inf
        before = np.diff(t[near])
        gain = float(np.abs(np.log(before / expected)).sum()) - misfit
        if gain > 0.2 and (best is None or misfit < best[0] - 1e-12):
            best = (misfit, pulse)
    return None if best is None else best[1]


def _of_neighbours(d: FloatArray) -> FloatArray:
    """Return the median of the three intervals on either side of each interval.

    If the speed oscillates from one revolution to the next, a trend at the ends of the train extrapolates the swing.
    """
    if len(d) < 2:
        return d
    padded = np.pad(d, 3, constant_values=np.nan)
    around = np.stack([padded[i : i + len(d)] for i in (0, 1, 2, 4, 5, 6)])
    medians: FloatArray = np.nanmedian(around, axis=0)
    return medians


def _slows_down_around(d: FloatArray, k: int) -> bool:
    """Whether the speed falls before interval k and rises after it, so that a standstill within it is plausible."""
    q = 1.0 / np.square(d)
    left = k < 2 or 2 * q[k - 1] - q[k - 2] < 0.7 * q[k - 1]
    right = k > len(d) - 3 or 2 * q[k + 1] - q[k + 2] < 0.7 * q[k + 1]
    return bool(left and right)


# Clock of the pulse times: find its tick, and fit the angle within its quantisation.


IntArray = NDArray[np.integer[Any]]


def clock_tick(times_s: FloatArray) -> float:
    """Find the step of which all pulse times are multiples (plus an offset); 0 if there is none.

    The smallest difference between two intervals is the first guess of the tick; it is then refined over longer and
    longer spans, and accepted if the times lie on its grid within a tenth rms (uniform scatter would give 0.29).

    Parameters
    ----------
    times_s : array, (n,)
        Strictly increasing.

    Returns
    -------
    float
        In seconds. A tick below a millionth of the shortest interval is harmless and not searched for.
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

    Minimises Σ wₖ(yₖ - kₖ)² + Σ λⱼ (Δ³y)ⱼ², where Δ³ is the third divided difference scaled by the local interval. λ
    starts large; wherever a pulse's residual, divided by the local speed, exceeds half a tick, λ is reduced around it,
    until all residuals lie within half a tick. Constant acceleration passes unchanged. A single pulse that deviates
    from its neighbours' profile gets weight wₖ = 0.

    Parameters
    ----------
    t : array, (n,)
        Pulse times, s.
    counts : array, (n,)
        Pulse numbers.
    tick_s : float
        Above zero.
    breaks : array, optional
        Indices of intervals (standstills) across which nothing is smoothed.

    Returns
    -------
    array, (n,)
        Fitted angle in pulses at `t`.

    Notes
    -----
    Source: the penalised fit with third differences is P. H. C. Eilers, *A perfect smoother*, Anal. Chem. 75 (2003);
    choosing the penalty by the known error is C. H. Reinsch, *Smoothing by spline functions*, Numer. Math. 10 (1967).
    Reducing it locally is an addition.
    """
    n = len(t)
    counts = counts.astype(np.float64)
    if n < 6:
        return counts
    rows = _third_differences(t)
    # The smoothest fit averages over 60 pulses; slower changes of speed pass with any clock.
    penalty = np.full(n - 3, (60.0 / (2 * np.pi)) ** 6)
    for k in () if breaks is None else breaks:
        penalty[max(0, int(k) - 2) : int(k) + 1] = 0.0
    speed = np.gradient(counts, t)
    weights = np.ones(n)
    weights[late_pulses(t, counts, tick_s)] = 0.0
    # Nothing but its own time tells of a pulse at a standstill.
    weights[np.convolve(penalty, np.ones(4)) == 0.0] = 1.0
    fitted = counts
    for _ in range(30):  # each round reduces λ by 4, so that the last ones interpolate
        fitted = counts + _penalised(rows, penalty, weights, -_apply(rows, counts))
        # A hundredth of a tick of tolerance, as the times themselves are rounded.
        off = weights * np.abs(fitted - counts) > 0.51 * tick_s * speed
        if not off.any():
            return fitted
        reach = np.convolve(off, np.ones(9), mode="same") > 0
        touched = reach[:-3] | reach[1:-2] | reach[2:-1] | reach[3:]
        penalty = np.where(touched, penalty / 4, penalty)
    return np.where(off, counts, fitted)


def late_pulses(t: FloatArray, counts: FloatArray, tick_s: float) -> IntArray:
    """Return indices of single pulses that are earlier or later than quantisation explains, given two on each side.

    The cubic through the neighbours contains at most 1.33 ticks of quantisation; a real change of speed affects the
    neighbours, too.
    """
    n = len(t)
    neighbours = np.array([-2, -1, 1, 2])
    at = np.arange(2, n - 2)
    nodes, values = t[at[:, None] + neighbours], counts[at[:, None] + neighbours].astype(np.float64)
    gaps = nodes[:, :, None] - nodes[:, None, :] + np.eye(4)
    reach = t[at][:, None] - nodes
    lagrange = np.prod(reach, axis=1)[:, None] / (reach * np.prod(gaps, axis=2))
    slope = (values[:, 2] - values[:, 1]) / (nodes[:, 2] - nodes[:, 1])
    off = np.zeros(n)
    off[2 : n - 2] = np.abs(counts[at] - (lagrange * values).sum(axis=1)) / slope
    # A single late pulse disturbs the prediction of its neighbours by at most 4/6, two places away by 1/6.
    largest = np.maximum.reduce([np.roll(off, k) for k in (-2, -1, 1, 2)])
    beyond = np.maximum.reduce([np.roll(off, k) for k in (-5, -4, -3, 3, 4, 5)])
    late: IntArray = np.flatnonzero((off > 1.6 * tick_s) & (off > 1.1 * largest) & (beyond < 0.6 * off))
    return late


def _third_differences(t: FloatArray) -> FloatArray:
    """Return third divided differences times 6 × the mean interval cubed, (n - 3, 4): [-1 3 -3 1] at equal steps."""
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
    """Solve (W + DᵀΛD) z = DᵀΛ·target for the correction z, which is small, so that no digits of the angle are lost."""
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


# From tachometer pulse times to shaft angle and speed.


def pulse_train_angle(
    times_s: FloatArray, pulses_per_revolution: int = 1, *, tick_s: float | None = None
) -> ShaftAngle:
    """Convert pulse times to shaft angle.

    Pulse k lies at k / pulses_per_revolution revolutions. Spurious pulses are left out and missed ones counted; the
    notes state how many and where. Times on a clock's grid are smoothed within half a tick; others are taken as exact.

    Parameters
    ----------
    times_s : array, (n_pulses,)
        Increasing.
    pulses_per_revolution : int
    tick_s : float, optional
        Step of the clock; 0: exact times. Default: found from the times.

    Returns
    -------
    ShaftAngle
        Knots at the pulses; the speed is exact at constant acceleration. The uncertainty is the timing error of two
        pulses (tick/√12 each, or the scatter of the intervals) over the duration, and at least a clock's 5e-5.

    Raises
    ------
    InputError
        If there are fewer than two pulses, or the times do not increase.
    RefusalError
        If more than a tenth of the pulses are spurious or missed, or their number in a gap cannot be determined.

    Notes
    -----
    Pulses are assumed to be equally spaced around the shaft. A stop between two pulses is accepted: the angle stays
    constant within that interval.
    """
    t = frozen_array(times_s, "tachometer pulse times", ndim=1).astype(np.float64)
    n_per_rev = count(pulses_per_revolution, "pulses_per_revolution")
    _check_order(t)
    train = count_pulses(t)
    _check_faults(train, len(t))
    tick = clock_tick(t) if tick_s is None else float(tick_s)
    kept = train.times_s
    pulses = train.counts.astype(np.float64)
    late_s = kept[late_pulses(kept, pulses, tick)] if tick > 0 and len(kept) > 5 else kept[:0]
    if tick > 0:
        breaks = np.searchsorted(kept, train.pauses_s)
        pulses = np.maximum.accumulate(fit_within_ticks(kept, pulses, tick, breaks))
    revolutions = pulses / n_per_rev
    return ShaftAngle(
        "",
        kept,
        revolutions,
        monotone_slopes(kept, revolutions),
        "pulses",
        relative_speed_uncertainty=_uncertainty(kept, tick),
        quality=max(0.0, 1.0 - 5.0 * (len(train.spurious_s) + train.n_missed) / len(t)),
        notes=_notes(train, len(t), tick, late_s),
        standstills_s=tuple(map(float, train.pauses_s)),
    )


def _check_order(t: FloatArray) -> None:
    where = "tachometer pulse times"
    if len(t) < 2:
        problem = "there is only one pulse" if len(t) else "there are no pulses"
        remedy = "check the channel, its threshold and its cabling"
        raise InputError(problem, where=where, allowed="at least two pulses", remedy=remedy)
    backwards = np.flatnonzero(np.diff(t) <= 0)
    if len(backwards):
        k = int(backwards[0]) + 1
        raise InputError(
            f"pulse {k} (counted from 0) at {t[k]:.9g} s does not come after pulse {k - 1} at {t[k - 1]:.9g} s",
            where=where,
            allowed="increasing times",
            remedy="check the column and the order of the rows",
        )


def _check_faults(train: PulseCount, n_pulses: int) -> None:
    remedy = "check threshold, hysteresis and pulses_per_revolution, or estimate the speed from the vibration"
    if len(train.open_gaps_s):
        raise RefusalError(
            f"after {train.open_gaps_s[0]:.4g} s pulses are missing, and their number cannot be determined from the "
            f"neighbouring speed ({counted(len(train.open_gaps_s), 'such gap')})",
            remedy="analyse the parts before and after separately; " + remedy,
        )
    n_faulty = len(train.spurious_s) + train.n_missed
    # A tenth of the pulses: a 36-1 or 60-2 tooth wheel stays below it, and so do occasional glitches.
    if n_faulty > 0.1 * n_pulses + 1:
        raise RefusalError(
            f"{len(train.spurious_s)} spurious and {train.n_missed} missed pulses among {n_pulses} are too many "
            "to trust the rest",
            remedy=remedy,
        )


def _uncertainty(t: FloatArray, tick_s: float) -> float:
    """Return the error of first and last pulse over the duration; without a tick, from third differences of the times.

    It is at least the error of the clock's rate, which no pulse can reveal: crystals are accurate to about 50 ppm.
    """
    if tick_s > 0:
        timing_s = tick_s / np.sqrt(12.0)
    elif len(t) >= 5:
        # A third difference of independent errors has 1 + 9 + 9 + 1 = 20 times their variance.
        timing_s = float(np.median(np.abs(np.diff(t, 3)))) / 0.6745 / np.sqrt(20.0)
    else:
        return float("nan")
    return max(5e-5, float(np.sqrt(2.0) * timing_s / (t[-1] - t[0])))


def _notes(train: PulseCount, n_pulses: int, tick_s: float, late_s: FloatArray) -> tuple[str, ...]:
    clock = f"pulse times are quantised to {tick_s * 1e6:.4g} µs; the angle is smoothed within half of that"
    places = (
        (f"{len(train.spurious_s)} of {n_pulses} pulses were spurious and left out", train.spurious_s),
        (f"{counted(train.n_missed, 'missed pulse')} counted in", train.missed_s),
        (f"the machine stops or nearly stops within {counted(len(train.pauses_s), 'interval')}", train.pauses_s),
        (clock, np.empty(int(tick_s > 0))),
        (f"{counted(len(late_s), 'single pulse')} further than that from the neighbours, bridged", late_s),
    )
    return tuple(text if text == clock else f"{text}: {_at(times)}" for text, times in places if len(times))


def _at(times_s: FloatArray) -> str:
    shown = ", ".join(f"{t:.4g}" for t in times_s[:5])
    return f"at {shown}{' …' if len(times_s) > 5 else ''} s"
