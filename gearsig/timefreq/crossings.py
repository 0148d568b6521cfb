"""Which path goes on as which, where two come together."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gearsig.checks import FloatArray

_N_FIT = 24
_LEAST_FIT = 4
_OF_MEETING = 8
"""A slope is read over so large a share of the meeting that it must tell about."""
_SEEN_FROM = (3.0, 2.2, 1.6, 1.2, 1.0)
"""Gaps at which a meeting is looked at; from afar, the paths there are known better."""
_VALLEY = 0.8
"""Share of the power beside it below which nothing crosses; where two cross, it is above 0.95, in any phase."""


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


def untangled(
    paths: list[FloatArray],
    levels: list[FloatArray],
    gap: float,
    level_weight: float,
    power: FloatArray | None = None,
) -> list[FloatArray]:
    """Return the paths with their tails exchanged wherever both then go on more smoothly.

    Across a meeting of length L, cubics join place and slope on either side; a cubic's bending ∫ p''² dt is
    4 (u² + u v + v²) / L, u and v being its end slopes less its mean slope. The pairing with the smaller
    L³ Σ bending + weight² Σ (change of level)² is kept; where tails are exchanged, the cubics replace the paths. If the
    power shows a valley all through the place where they would cross, they part again whatever the cubics say.

    Parameters
    ----------
    paths : list of arrays, (n_columns,)
        Lines.
    levels : list of arrays, (n_columns,)
        Natural logarithm of the amplitude along each path.
    gap : float
        Lines within which two components cannot be told apart. A meeting is looked at from up to three times as far,
        less where it would reach an end of the paths.
    level_weight : float
        Lines that a change of level by a factor e is worth.
    power : array, (n_lines, n_columns), or None
    """
    paths, levels = [p.copy() for p in paths], [v.copy() for v in levels]
    for i in range(len(paths)):
        for j in range(i + 1, len(paths)):
            for meeting in _settled_from_afar(paths[i], paths[j], gap):
                _settle((paths[i], levels[i]), (paths[j], levels[j]), meeting, level_weight, _Ground(power, gap))
    return paths


def _settled_from_afar(a: FloatArray, b: FloatArray, gap: float) -> list[Meeting]:
    """Return the meetings, each in the widest of several gaps that leaves columns to compare on both sides."""
    found: list[Meeting] = []
    for share in _SEEN_FROM:
        for meeting in meetings(a, b, share * gap):
            room = min(meeting.start, len(a) - meeting.stop)
            known = any(m.start <= meeting.start and meeting.stop <= m.stop for m in found)
            if not known and room >= (_N_FIT if share > _SEEN_FROM[-1] else _LEAST_FIT):
                found.append(meeting)
    return found


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


@dataclass(frozen=True)
class _Ground:
    """What the paths run over, and the lines within which two components cannot be told apart."""

    power: FloatArray | None
    gap: float


def _settle(a: _Track, b: _Track, meeting: Meeting, level_weight: float, ground: _Ground) -> None:
    """Let two paths cross or part again after a meeting, in place, whichever goes on more smoothly."""
    start, stop, n = meeting.start, meeting.stop, len(a[0])
    first, last = start - 1, stop
    n_fit = max(_N_FIT, (stop - start) // _OF_MEETING)
    before = [_end(track, max(0, start - n_fit), start, first) for track in (a, b)]
    after = [_end(track, stop, min(n, stop + n_fit), last) for track in (a, b)]
    inside = np.arange(start, stop)
    keep, swap = (
        [_cubic(p, q, first, last, inside) for p, q in zip(before, ends, strict=True)] for ends in (after, after[::-1])
    )
    crosses_now = (before[0].place - before[1].place) * (after[0].place - after[1].place) < 0
    crossed, parted = (keep, swap) if crosses_now else (swap, keep)
    if ground.power is not None and _valley(ground.power, crossed, start, ground.gap):
        if crosses_now:
            _exchange(a, b, meeting, _tops_beside(ground.power, parted, start))
        return
    cost = [[_change(p, q, last - first, level_weight) for q in after] for p in before]
    if cost[0][1] + cost[1][0] < cost[0][0] + cost[1][1]:
        _exchange(a, b, meeting, swap)


def _exchange(a: _Track, b: _Track, meeting: Meeting, between: list[FloatArray]) -> None:
    stop = meeting.stop
    for one, other in zip(a, b, strict=True):
        one[stop:], other[stop:] = other[stop:].copy(), one[stop:].copy()
    for (path, _), piece in zip((a, b), between, strict=True):
        path[meeting.start : stop] = piece


def _valley(power: FloatArray, crossed: list[FloatArray], start: int, gap: float) -> bool:
    """Return whether little lies where two paths would cross, compared with what lies beside it."""
    columns = np.flatnonzero(np.abs(crossed[0] - crossed[1]) <= gap / 2)
    middle = np.round((crossed[0] + crossed[1])[columns] / 2).astype(np.int64)
    centre, around = (_largest_near(power, middle, columns + start, reach) for reach in (gap / 4, 2 * gap))
    return len(columns) > 0 and float(centre.mean()) < _VALLEY * float(around.mean())


def _largest_near(power: FloatArray, lines: NDArray[np.int64], columns: NDArray[np.int64], reach: float) -> FloatArray:
    shifts = np.arange(-int(reach), int(reach) + 1)[:, None]
    result: FloatArray = power[np.clip(lines + shifts, 0, len(power) - 1), columns].max(axis=0)
    return result


def _tops_beside(power: FloatArray, parted: list[FloatArray], start: int) -> list[FloatArray]:
    """Return the largest power's line on either side of the middle between two paths that part again."""
    middle = np.clip(np.round((parted[0] + parted[1]) / 2), 0, len(power) - 1).astype(np.int64)
    half = np.ceil(np.abs(parted[0] - parted[1])).astype(np.int64)
    result = [p.copy() for p in parted]
    for i in range(len(middle)):
        above = slice(middle[i], min(middle[i] + half[i], len(power) - 1) + 1)
        below = slice(max(middle[i] - half[i], 0), middle[i] + 1)
        top, bottom = (result[0], result[1]) if parted[0][i] > parted[1][i] else (result[1], result[0])
        top[i] = above.start + np.argmax(power[above, start + i])
        bottom[i] = below.start + np.argmax(power[below, start + i])
    return result


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
