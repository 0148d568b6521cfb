"""Which path goes on as which, where two come together."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gearsig.checks import FloatArray

_N_FIT = 24


@dataclass(frozen=True)
class Meeting:
    """Columns [start, stop) in which two paths are closer than they can be told apart."""

    start: int
    stop: int


def meetings(a: FloatArray, b: FloatArray, gap: float) -> list[Meeting]:
    """Return the stretches where |a - b| <= gap, those less than a few columns apart taken as one."""
    near = np.abs(a - b) <= gap
    steps = np.diff(near.astype(np.int8), prepend=0, append=0)
    starts, stops = np.flatnonzero(steps == 1), np.flatnonzero(steps == -1)
    found: list[Meeting] = []
    for start, stop in zip(starts, stops, strict=True):
        if found and start - found[-1].stop < _N_FIT // 2:
            found[-1] = Meeting(found[-1].start, int(stop))
        else:
            found.append(Meeting(int(start), int(stop)))
    return found


def untangled(paths: list[FloatArray], levels: list[FloatArray], gap: float, level_weight: float) -> list[FloatArray]:
    """Return the paths with their tails exchanged wherever both then go on more smoothly.

    Across a meeting of length L, cubics join place and slope on either side; a cubic's bending ∫ p''² dt is
    4 (u² + u v + v²) / L, u and v being its end slopes less its mean slope. The pairing with the smaller
    L³ Σ bending + weight² Σ (change of level)² is kept; where tails are exchanged, the cubics replace the paths.

    Parameters
    ----------
    paths : list of arrays, (n_columns,)
        Lines.
    levels : list of arrays, (n_columns,)
        Natural logarithm of the amplitude along each path.
    gap : float
        Lines within which two components disturb each other.
    level_weight : float
        Lines that a change of level by a factor e is worth.
    """
    paths, levels = [p.copy() for p in paths], [v.copy() for v in levels]
    for i in range(len(paths)):
        for j in range(i + 1, len(paths)):
            for meeting in meetings(paths[i], paths[j], gap):
                _settle((paths[i], levels[i]), (paths[j], levels[j]), meeting, level_weight)
    return paths


def shared_columns(paths: list[FloatArray], gap: float) -> list[NDArray[np.bool_]]:
    """Return where each path has another one within `gap` lines."""
    result = [np.zeros(len(p), dtype=np.bool_) for p in paths]
    for i in range(len(paths)):
        for j in range(i + 1, len(paths)):
            near = np.abs(paths[i] - paths[j]) <= gap
            result[i] |= near
            result[j] |= near
    return result


_Track = tuple[FloatArray, FloatArray]


@dataclass(frozen=True)
class _End:
    """Place, slope (lines per column) and level of a path at one side of a meeting."""

    place: float
    slope: float
    level: float


def _settle(a: _Track, b: _Track, meeting: Meeting, level_weight: float) -> None:
    """Exchange the tails of two paths after a meeting, in place, if they go on more smoothly so."""
    start, stop, n = meeting.start, meeting.stop, len(a[0])
    if start < 4 or stop > n - 4:
        return  # nothing to compare on one of the sides
    first, last = start - 1, stop
    before = [_end(track, max(0, start - _N_FIT), start, first) for track in (a, b)]
    after = [_end(track, stop, min(n, stop + _N_FIT), last) for track in (a, b)]
    cost = [[_change(p, q, last - first, level_weight) for q in after] for p in before]
    if cost[0][1] + cost[1][0] >= cost[0][0] + cost[1][1]:
        return
    for one, other in zip(a, b, strict=True):
        one[stop:], other[stop:] = other[stop:].copy(), one[stop:].copy()
    inside = np.arange(start, stop)
    for (path, _), p, q in ((a, before[0], after[1]), (b, before[1], after[0])):
        path[start:stop] = _cubic(p, q, first, last, inside)


def _end(track: _Track, start: int, stop: int, at: int) -> _End:
    path, level = track
    slope, place = np.polyfit(np.arange(start, stop) - at, path[start:stop], 1)
    return _End(float(place), float(slope), float(level[start:stop].mean()))


def _change(p: _End, q: _End, length: int, level_weight: float) -> float:
    mean = (q.place - p.place) / length
    u, v = p.slope - mean, q.slope - mean
    bending = 4.0 * (u * u + u * v + v * v) / length
    return length**3 * bending + (level_weight * (q.level - p.level)) ** 2


def _cubic(p: _End, q: _End, first: int, last: int, columns: NDArray[np.int64]) -> FloatArray:
    from scipy.interpolate import CubicHermiteSpline

    result: FloatArray = CubicHermiteSpline([first, last], [p.place, q.place], [p.slope, q.slope])(columns)
    return result
