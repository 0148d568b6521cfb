"""Spurious and missed pulses in a pulse train, told from real changes of speed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gearsig.checks import FloatArray

# An interval is suspicious when it is shorter or longer than the local trend says by these factors.
_SHORT, _LONG = 0.6, 1.5
# Without a slowdown around it, a longer gap than this many pulses leaves the count open.
MOST_MISSED_IN_ONE_GAP = 8


@dataclass(frozen=True)
class PulseCount:
    """A pulse train whose pulses have been counted.

    Parameters
    ----------
    times_s : array, (n,)
        Without the spurious pulses.
    counts : array of int, (n,)
        Number of each pulse; it jumps where pulses were missed.
    spurious_s, missed_s, pauses_s : arrays
        Times of the pulses taken out, and starts of the gaps that pulses were missed in or the machine stopped in.
    open_gaps_s : array
        Starts of gaps in which the number of missed pulses cannot be told.
    """

    times_s: FloatArray
    counts: FloatArray
    spurious_s: FloatArray
    missed_s: FloatArray
    pauses_s: FloatArray
    open_gaps_s: FloatArray

    @property
    def n_missed(self) -> int:
        """Pulses that were missed."""
        return int(self.counts[-1]) + 1 - len(self.counts)


def count_pulses(times_s: FloatArray) -> PulseCount:
    """Number the pulses, leaving out spurious ones and skipping numbers where pulses were missed."""
    kept, spurious = _without_spurious(times_s)
    return _numbered(kept, times_s[spurious])


def local_trend(intervals: FloatArray) -> FloatArray:
    """Expected length of each interval from its neighbours; infinite where they point to a standstill.

    At constant acceleration the squared speed grows linearly with angle, so q = 1/interval² is almost linear in the
    pulse number, from a standing start to a stop. Each interval is predicted by symmetric means (q₋ᵢ + q₊ᵢ)/2, at
    the ends by extrapolations 2q₁ - q₂; the median over them tolerates faulty neighbours.
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
    # With four intervals or fewer there may be no prediction: such an interval is taken as it is.
    predictions = np.where(np.isnan(predictions).all(axis=0), q, predictions)
    expected_q = np.nanmedian(predictions, axis=0)
    with np.errstate(divide="ignore", invalid="ignore"):
        trend: FloatArray = np.where(expected_q > 0, 1.0 / np.sqrt(np.abs(expected_q)), np.inf)
    return trend


def _without_spurious(times_s: FloatArray) -> tuple[FloatArray, list[int]]:
    """Return the times without spurious pulses, and the indices of those."""
    left = np.arange(len(times_s))
    removed: list[int] = []
    # Each round takes out one pulse of every separate group of short intervals; a train worse than that is refused
    # later.
    for _ in range(20):
        t = times_s[left]
        if len(t) < 6:
            break
        d = np.diff(t)
        trend = local_trend(d)
        drop = [_spurious_end(t, trend, k) for k in _shortest_of_each_group(d / np.minimum(trend, _of_neighbours(d)))]
        found = sorted({k for k in drop if k is not None})
        if not found:
            break
        removed += [int(left[k]) for k in found]
        left = np.delete(left, found)
    return times_s[left], sorted(removed)


def _shortest_of_each_group(ratio: FloatArray) -> list[int]:
    """Indices of short intervals that are the shortest within three intervals each way."""
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
    """Which end of interval k to take out so that its neighbours fit the trend best; None if neither helps."""
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


def _numbered(t: FloatArray, spurious_s: FloatArray) -> PulseCount:
    d = np.diff(t)
    steps = np.ones(len(d), dtype=np.int64)
    missed: list[float] = []
    pauses: list[float] = []
    gaps: list[float] = []
    trend = local_trend(d) if len(d) >= 3 else d
    for k in np.flatnonzero((d > _LONG * trend) & (d > _LONG * _of_neighbours(d))):
        if _slows_down_around(d, int(k)):
            pauses.append(float(t[k]))
            continue
        exact = float(d[k] / trend[k])
        whole = round(exact)
        # The trend is known to a few per cent per pulse; beyond that the count would be a guess.
        if whole > MOST_MISSED_IN_ONE_GAP + 1 or abs(exact - whole) > 0.35:
            gaps.append(float(t[k]))
        elif whole > 1:
            steps[k] = whole
            missed.append(float(t[k]))
    counts = np.concatenate([[0], np.cumsum(steps)])
    return PulseCount(
        t, counts, np.asarray(spurious_s), *(np.asarray(list_, dtype=float) for list_ in (missed, pauses, gaps))
    )


def _of_neighbours(d: FloatArray) -> FloatArray:
    """Return the median of the three intervals on either side of each.

    Where speed swings from one revolution to the next a trend at the ends of the train extrapolates the swing.
    """
    if len(d) < 2:
        return d
    padded = np.pad(d, 3, constant_values=np.nan)
    around = np.stack([padded[i : i + len(d)] for i in (0, 1, 2, 4, 5, 6)])
    medians: FloatArray = np.nanmedian(around, axis=0)
    return medians


def _slows_down_around(d: FloatArray, k: int) -> bool:
    """Whether speed falls towards interval k from the left and rises after it so that a standstill in it fits."""
    q = 1.0 / np.square(d)
    left = k < 2 or 2 * q[k - 1] - q[k - 2] < 0.7 * q[k - 1]
    right = k > len(d) - 3 or 2 * q[k + 1] - q[k + 2] < 0.7 * q[k + 1]
    return bool(left and right)
