"""Ridges: the instantaneous frequency and amplitude of each component of a transform."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gearsig.checks import FloatArray, count, instance_of, not_negative, number, positive
from gearsig.compiled import njit
from gearsig.errors import InputError, RefusalError
from gearsig.peaks import parabola_vertex
from gearsig.timefreq._types import Coefficients, Ridge, TimeFrequencyMap

SQUEEZED_REACH = 2
"""Lines on either side over which a squeezed component may scatter."""
_FLOOR_OVER_MEDIAN = 4.0
_FLOOR_UNDER_TOP = 1e-5
_COLUMNS_OF_FLOOR = 8
_REACHES_OF_FLOOR = 5  # lines to either side relative to one component's reach, few enough to follow coloured noise
_DILATION = ((0, 1.0), (1, 0.7), (-1, 0.7), (2, 0.3), (-2, 0.3))


def ridge_power(power: FloatArray, *, squeezed: bool) -> FloatArray:
    """Return the power of one component at each line; if squeezed, the sum over its lines."""
    if not squeezed:
        return power
    from scipy.ndimage import uniform_filter1d

    width = 2 * SQUEEZED_REACH + 1
    summed: FloatArray = uniform_filter1d(power, width, axis=0, mode="constant") * width
    return np.maximum(summed, 0.0)  # the running sum may round below zero


def _local_median_power(power: FloatArray, n_reach: int) -> FloatArray:
    """Return the median power of the lines around each cell, averaged over a few columns, (n_lines, n_columns)."""
    from scipy.ndimage import median_filter

    starts = np.arange(0, power.shape[1], _COLUMNS_OF_FLOOR)
    n_columns = np.diff(starts, append=power.shape[1])
    mean = np.add.reduceat(power, starts, axis=1) / n_columns
    around = median_filter(mean, size=(2 * _REACHES_OF_FLOOR * n_reach + 1, 1), mode="nearest")
    return np.repeat(around, n_columns, axis=1)


def ridge_scores(power: FloatArray, n_reach: int) -> FloatArray:
    """Return scores from 0 to 1: near 1 on local maxima over frequency that stand out from the surrounding lines.

    The score saturates: a weak component on its own ridge counts about as much as a strong one, so that a path gains
    nothing by jumping to the stronger one. Skirts of strong components are not maxima and score zero.

    Parameters
    ----------
    power : array, (n_lines, n_columns)
    n_reach : int
    """
    from scipy.ndimage import maximum_filter1d

    largest = float(power.max())
    if largest <= 0:
        return np.zeros_like(power)
    floor = np.maximum(_FLOOR_OVER_MEDIAN * _local_median_power(power, n_reach), _FLOOR_UNDER_TOP * largest)
    top = power >= maximum_filter1d(power, 2 * n_reach + 1, axis=0, mode="constant")
    height = np.where(top, power / (power + floor), 0.0)
    result = np.zeros_like(height)
    n = len(height)
    for shift, share in _DILATION:
        low, high = max(0, shift), min(n, n + shift)
        part = result[low:high]
        np.maximum(part, share * height[low - shift : high - shift], out=part)
    return result


_N_FIT = 24
_MIN_FIT = 4
_OF_MEETING = 8
"""A slope beside a meeting is fitted over at least the meeting's length divided by this."""
_MEETING_GAPS = (3.0, 2.2, 1.6, 1.2, 1.0)
"""Gaps at which a meeting is examined; farther apart, the paths are known more accurately."""
_VALLEY = 0.8
"""Power ratio to the surroundings below which nothing crosses; where two cross, it is above 0.95 at any phase."""


@dataclass(frozen=True)
class Meeting:
    """Columns [start, stop) in which two paths are too close to be resolved."""

    start: int
    stop: int


def crossing_segments(a: FloatArray, b: FloatArray, gap: float) -> list[Meeting]:
    """Return the segments where |a - b| <= gap; those less than a few columns apart are merged."""
    near = np.abs(a - b) <= gap
    steps = np.diff(near.astype(np.int8), prepend=0, append=0)
    starts, stops = np.flatnonzero(steps == 1), np.flatnonzero(steps == -1)
    meetings: list[Meeting] = []
    for start, stop in zip(starts, stops, strict=True):
        if meetings and start - meetings[-1].stop < _N_FIT // 2:
            meetings[-1] = Meeting(meetings[-1].start, int(stop))
        else:
            meetings.append(Meeting(int(start), int(stop)))
    return meetings


def reconnected_paths(
    paths: list[FloatArray], levels: list[FloatArray], gap: float, level_weight: float, power: FloatArray | None = None
) -> list[FloatArray]:
    """Return the paths with their tails exchanged wherever both then continue more smoothly.

    Across a meeting of length L, cubics join position and slope on either side; a cubic's bending ∫ p''² dt is
    4 (u² + u v + v²) / L, with u and v its end slopes minus its mean slope. The pairing with the smaller
    L³ Σ bending + weight² Σ (change of level)² is kept; where tails are exchanged, the cubics replace the paths. If the
    power shows a valley all along where they would cross, they part again whatever the cubics suggest.

    Parameters
    ----------
    paths : list of arrays, (n_columns,)
        Lines.
    levels : list of arrays, (n_columns,)
        Natural logarithm of the amplitude along each path.
    gap : float
        Lines within which two components cannot be resolved. A meeting is examined from up to three times this
        distance, less if it would reach an end of the paths.
    level_weight : float
        Cost in lines of a change of level by a factor e.
    power : array, (n_lines, n_columns), or None
    """
    paths, levels = [p.copy() for p in paths], [v.copy() for v in levels]
    for i in range(len(paths)):
        for j in range(i + 1, len(paths)):
            for meeting in _settled_from_afar(paths[i], paths[j], gap):
                _settle((paths[i], levels[i]), (paths[j], levels[j]), meeting, level_weight, power, gap)
    return paths


def _settled_from_afar(a: FloatArray, b: FloatArray, gap: float) -> list[Meeting]:
    """Return the meetings, each at the widest of several gaps that leaves columns to compare on both sides."""
    settled: list[Meeting] = []
    for share in _MEETING_GAPS:
        for meeting in crossing_segments(a, b, share * gap):
            room = min(meeting.start, len(a) - meeting.stop)
            known = any(m.start <= meeting.start and meeting.stop <= m.stop for m in settled)
            if not known and room >= (_N_FIT if share > _MEETING_GAPS[-1] else _MIN_FIT):
                settled.append(meeting)
    return settled


def shared_columns(paths: list[FloatArray], gap: float) -> list[NDArray[np.bool_]]:
    """Return, for each path, where another one lies within `gap` lines, (n_columns,) each."""
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
    """Position (lines), slope (lines per column) and level of a path on one side of a meeting."""

    place: float
    slope: float
    level: float


def _settle(a: _Track, b: _Track, meeting: Meeting, level_weight: float, power: FloatArray | None, gap: float) -> None:
    """Let two paths cross or part again after a meeting, whichever is smoother; modifies them in place."""
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
    if power is not None and _valley(power, crossed, start, gap):
        if crosses_now:
            _exchange(a, b, meeting, maxima_of_separate_paths(power, parted, start))
        return
    cost = [[_change(p, q, last - first, level_weight) for q in after] for p in before]
    if cost[0][1] + cost[1][0] < cost[0][0] + cost[1][1]:
        _exchange(a, b, meeting, swap)


def _exchange(a: _Track, b: _Track, meeting: Meeting, between: list[FloatArray]) -> None:
    stop = meeting.stop
    for first, partner in zip(a, b, strict=True):
        first[stop:], partner[stop:] = partner[stop:].copy(), first[stop:].copy()
    for (path, _), piece in zip((a, b), between, strict=True):
        path[meeting.start : stop] = piece


def _valley(power: FloatArray, crossed: list[FloatArray], start: int, gap: float) -> bool:
    """Return whether the power where two paths would cross is low compared with that around it."""
    columns = np.flatnonzero(np.abs(crossed[0] - crossed[1]) <= gap / 2)
    middle = np.round((crossed[0] + crossed[1])[columns] / 2).astype(np.int64)
    centre, around = (_largest_near(power, middle, columns + start, reach) for reach in (gap / 4, 2 * gap))
    return len(columns) > 0 and float(centre.mean()) < _VALLEY * float(around.mean())


def _largest_near(power: FloatArray, lines: NDArray[np.int64], columns: NDArray[np.int64], reach: float) -> FloatArray:
    shifts = np.arange(-int(reach), int(reach) + 1)[:, None]
    result: FloatArray = power[np.clip(lines + shifts, 0, len(power) - 1), columns].max(axis=0)
    return result


def maxima_of_separate_paths(power: FloatArray, parted: list[FloatArray], start: int) -> list[FloatArray]:
    """Return, for two paths that part again, the line of largest power on their side of the middle in each column."""
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


NOT_HIDDEN = -(1 << 14)
"""Marks cells that no path covers."""
MAX_COLUMNS = 4000
"""Maximum number of columns for the path search; longer transforms are pooled."""
_SPARE = 8
"""Ridges searched beyond the requested number; the strongest are kept, as the clearest need not be strong."""
_MIN_UNCOVERED = 0.6  # share of its columns in which a path is not covered by others
_MIN_SCORE = 0.25  # mean score of a path, below which it hops between noise maxima


@dataclass(frozen=True)
class _Grid:
    """Power over lines and at most `MAX_COLUMNS` columns, and the power before squeezing."""

    power: FloatArray
    unsqueezed: FloatArray
    at: FloatArray
    n_reach: int
    squeezed: bool


def ridges(
    transform: Coefficients | TimeFrequencyMap,
    n_ridges: int = 1,
    *,
    steepest: float = 2.0,
    stiffness: float = 1.0,
    lowest: float | None = None,
    highest: float | None = None,
) -> tuple[Ridge, ...]:
    """Return the `n_ridges` strongest of the clear ridges, which continue straight on where they cross.

    Paths are found one by one by dynamic programming over position and slope, with a penalty on changes of slope; the
    cells that a path covers are hidden before the next search. Eight more than requested are searched, and those with
    the most power are kept. Where two of them meet, both are examined together: if the power shows a valley all along
    the meeting, they part again; otherwise their tails are exchanged if position, slope and level then continue more
    smoothly. Position and level come from a parabola through the logarithm of the power, for squeezed transforms of the
    power before squeezing: squeezing shows the direction of a component, but in noise scatters its level over lines.

    Parameters
    ----------
    transform : Coefficients or TimeFrequencyMap
        With more than 4000 columns, they are first pooled to their mean power.
    n_ridges : int
    steepest : float
        Maximum rise or fall of a ridge in lines per (pooled) column.
    stiffness : float
        Penalty for changing the slope by two lines per eight columns, in columns on the ridge; moving by one line where
        there is no ridge costs twice as much. Raise it for chirps in noise, lower it for fast modulation.
    lowest, highest : float or None
        Range of the search, in Hz or orders.

    Returns
    -------
    tuple of Ridge
        In descending rms amplitude; fewer than requested if the map shows no further ridge.

    Raises
    ------
    InputError
        On numbers out of range, or more ridges than fit side by side on the lines.
    RefusalError
        If the map shows no ridge at all.

    Notes
    -----
    Two components that come closer than the transform's resolution and turn back look like two that cross: the data do
    not show which is which, and the ridges cross. See `shared`, and use a longer wavelet or window. A ridge runs
    through the whole transform: one that begins or ends within it, or is masked by noise for long, continues along the
    nearest structure, so cut the recording, or check `amplitude`. A component is visible as long as its amplitude
    exceeds that of the noise within the band of the wavelet or window; a longer one has a narrower band.

    Source: R. A. Carmona, W. L. Hwang, B. Torrésani, *Multiridge detection and time-frequency reconstruction*, IEEE
    Transactions on Signal Processing 47 (1999), for ridges as penalised paths; the slope state and the exchange of
    tails are this package's own.
    """
    remedy = "transform the signal first: gearsig.cwt, stft, squeezed_cwt or squeezed_stft"
    instance_of(transform, Coefficients | TimeFrequencyMap, "transform", remedy=remedy)
    count(n_ridges, "n_ridges")
    positive(steepest, "steepest")
    not_negative(stiffness, "stiffness")
    part = _lines_between(transform.positions, lowest, highest)
    _check_room(n_ridges, part, transform.n_reach)
    grid = _grid(transform, part)
    paths = _paths(grid, n_ridges, steepest, stiffness)
    if not paths:
        raise RefusalError(
            "no ridge stands out from the rest of the transform",
            remedy="look between other lines (lowest, highest), take a longer wavelet or window, or average more",
        )
    shared = shared_columns(paths, 2.0 * grid.n_reach)
    ridges = [_ridge(transform, grid, part, p, s) for p, s in zip(paths, shared, strict=True)]
    return tuple(sorted(ridges, key=lambda r: -float(np.mean(r.amplitude**2))))


def _lines_between(positions: FloatArray, lowest: float | None, highest: float | None) -> slice:
    low = 0 if lowest is None else int(np.searchsorted(positions, number(lowest, "lowest")))
    high = (
        len(positions) if highest is None else int(np.searchsorted(positions, number(highest, "highest"), side="right"))
    )
    if high - low < 3:
        raise RefusalError(
            f"fewer than three of the transform's {len(positions)} lines lie in the range",
            remedy="widen the range or compute more lines",
        )
    return slice(low, high)


def _check_room(n_ridges: int, part: slice, n_reach: int) -> None:
    """Raise InputError if that many ridges cannot be resolved on the lines."""
    max_ridges = max(1, (part.stop - part.start) // (2 * n_reach + 1))
    if n_ridges > max_ridges:
        raise InputError(
            f"n_ridges is {n_ridges} on {part.stop - part.start} lines, each ridge covering {2 * n_reach + 1} of them",
            allowed=f"1 to {max_ridges}",
            remedy="ask for fewer, or compute more lines",
        )


def _grid(transform: Coefficients | TimeFrequencyMap, part: slice) -> _Grid:
    n = len(transform.at)
    starts = np.arange(0, n, -(-n // MAX_COLUMNS))
    n_pooled = np.diff(starts, append=n)
    is_map = isinstance(transform, TimeFrequencyMap)
    is_power = isinstance(transform, TimeFrequencyMap) and transform.scaling == "power"

    def pooled(values: NDArray[Any]) -> FloatArray:
        power = np.empty((part.stop - part.start, len(starts)))
        for row, line in enumerate(values[:, part].T if is_map else values[part]):  # row by row: the whole may be large
            square = 2.0 * line if is_power else np.square(np.abs(line), dtype=np.float64)
            power[row] = np.add.reduceat(square, starts) / n_pooled
        return power

    at = (transform.at[starts] + transform.at[starts + n_pooled - 1]) / 2
    power = pooled(transform.values)
    unsqueezed = power if transform.unsqueezed is None else pooled(transform.unsqueezed)
    return _Grid(power, unsqueezed, at, transform.n_reach, transform.squeezed)


def _paths(grid: _Grid, n_ridges: int, steepest: float, stiffness: float) -> list[FloatArray]:
    power = ridge_power(grid.power, squeezed=grid.squeezed)
    scores = ridge_scores(power, grid.n_reach)
    parts: list[FloatArray] = []
    strengths: list[float] = []
    for _ in range(n_ridges + _SPARE):
        hidden = _hidden(scores.shape, parts, grid.n_reach)
        path = _uncovered_path(scores, hidden, steepest, stiffness)
        is_uncovered = _along(hidden, path) == NOT_HIDDEN
        if not is_uncovered.any() or float(_along(scores, path)[is_uncovered].mean()) < _MIN_SCORE:
            break
        parts.append(path)
        strengths.append(float(_along(power, path)[is_uncovered].mean()))
    strongest = sorted(range(len(parts)), key=lambda i: -strengths[i])[:n_ridges]
    paths = [parts[i] for i in sorted(strongest)]
    weaker = [parts[i] for i in range(len(parts)) if i not in strongest]
    if len(paths) > 1:
        paths = _settled(paths, grid, power)
        for i in range(len(paths)):  # search again, with all other paths known
            hidden = _hidden(scores.shape, weaker + paths[:i] + paths[i + 1 :], grid.n_reach)
            paths[i] = _uncovered_path(scores, hidden, steepest, stiffness)
        paths = _settled(paths, grid, power)
    return paths


def _uncovered_path(scores: FloatArray, hidden: NDArray[np.int16], steepest: float, stiffness: float) -> FloatArray:
    """Return the best path; if it hides behind others by weaving across them, search again without credit."""
    path = best_path(scores, hidden, steepest, stiffness)
    if float(np.mean(_along(hidden, path) == NOT_HIDDEN)) >= _MIN_UNCOVERED:
        return path
    return best_path(scores, hidden, steepest, stiffness, credit=0.0)


def _settled(paths: list[FloatArray], grid: _Grid, power: FloatArray) -> list[FloatArray]:
    """Return the paths, interpolated between lines, each following the same component after a meeting."""
    paths = [_read(grid, p)[0] for p in paths]
    levels: list[FloatArray] = [np.log(np.maximum(_along(power, p), np.finfo(np.float64).tiny)) / 2 for p in paths]
    return reconnected_paths(paths, levels, 2.0 * grid.n_reach, float(grid.n_reach), power)


def _hidden(shape: tuple[int, ...], paths: list[FloatArray], n_cover: int) -> NDArray[np.int16]:
    """Return the slope of the path that covers each cell, in lines per node; `NOT_HIDDEN` elsewhere."""
    result = np.full(shape, NOT_HIDDEN, dtype=np.int16)
    q = nodes_apart(shape[1])
    columns = np.arange(shape[1])
    before, after = np.maximum(columns - q, 0), np.minimum(columns + q, shape[1] - 1)
    for path in paths:
        slope = np.round((path[after] - path[before]) / np.maximum(after - before, 1) * q).astype(np.int16)
        near = np.abs(np.arange(shape[0])[:, None] - path[None, :]) <= n_cover
        np.copyto(result, slope[None, :], where=near)
    return result


def _ridge(
    transform: Coefficients | TimeFrequencyMap,
    grid: _Grid,
    part: slice,
    path: FloatArray,
    shared: np.ndarray[tuple[int], np.dtype[np.bool_]],
) -> Ridge:
    places, peak = _read(grid, path)
    alone = ~shared
    if alone.any() and shared.any():
        columns, known = np.arange(len(path)), np.flatnonzero(alone)
        between = shared & (columns > known[0]) & (columns < known[-1])  # meetings that extend to an end stay as read
        places = np.where(between, np.interp(columns, known, places[known]), places)
    lines = transform.positions[part]
    index = np.arange(len(lines))
    if transform.spacing == "logarithmic":
        positions = np.exp(np.interp(places, index, np.log(lines)))
    else:
        positions = np.interp(places, index, lines)
    return Ridge(
        grid.at, positions, np.sqrt(peak), shared, transform.axis, _unit(transform), transform.source, transform.shaft
    )


def _read(grid: _Grid, path: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return position and height of the parabola through the log power around the maximum near a path, (n_columns,).

    For squeezed transforms, the power before squeezing is used: noise scatters a squeezed component over lines, so that
    their sum reads low, and a sweep's energy moves in the direction of the sweep.
    """
    power, columns = grid.unsqueezed, np.arange(len(path))
    n = len(power)
    near = np.clip(np.round(path).astype(np.int64)[None, :] + np.arange(-2, 3)[:, None], 1, n - 2)
    best = near[np.argmax(power[near, columns[None, :]], axis=0), columns]
    lowest = float(np.finfo(np.float64).tiny)
    a, b, c = (np.log(np.maximum(power[best + shift, columns], lowest)) for shift in (-1, 0, 1))
    offset, height = parabola_vertex(a, b, c)
    return best + offset, np.exp(height)


def _along(table: NDArray[Any], path: FloatArray) -> FloatArray:
    lines = np.clip(np.round(path).astype(np.int64), 0, len(table) - 1)
    result: FloatArray = table[lines, np.arange(len(path))]
    return result


def _unit(transform: Coefficients | TimeFrequencyMap) -> str:
    if isinstance(transform, TimeFrequencyMap) and transform.scaling == "power":
        return transform.unit.removesuffix("^2").removeprefix("(").removesuffix(")")
    return transform.unit


_MAX_COLUMNS_PER_NODE = 8
_MIN_NODES = 48
_MAX_BEND = 4


CREDIT = 0.3  # score of a hidden cell for a crossing path, since its own content there is not visible
_NOTHING = 0.1  # score below which a cell holds no ridge
_ASTRAY = 2.0  # cost in columns per line where there is no ridge: otherwise paths leap to anything clearer for a while
_MIN_ANGLE = 2  # lines per node by which slopes must differ to count as crossing


def nodes_apart(n_columns: int) -> int:
    """Return the number of columns between nodes: eight, fewer in short tables."""
    return min(_MAX_COLUMNS_PER_NODE, max(1, n_columns // _MIN_NODES))


def best_path(
    scores: FloatArray, hidden: NDArray[np.int16], steepest: float, stiffness: float, *, credit: float = CREDIT
) -> FloatArray:
    """Return the best path's line in each column, (n_columns,).

    The path is a chain of straight pieces over q columns each (eight, fewer in short tables), each rising by s lines.
    It maximises Σ scores along the path - `stiffness` Σ max(|s' - s| - 1, 0)²: changes of slope cost, slope does not,
    so that the path goes straight through a crossing instead of turning into the other branch. Changes by one are free,
    as fractional slopes need them. Where there is no ridge, each line travelled costs two columns (times `stiffness`):
    the path then waits for a fading component, and leaps to another only if that is clearer for long.

    Parameters
    ----------
    scores : array, (n_lines, n_columns)
        0 to 1.
    hidden : array, (n_lines, n_columns)
        Slope, in lines per node, of the path that covers the cell, or `NOT_HIDDEN`. Covered cells score for paths that
        cross that path, but not for paths along it.
    steepest : float
        Maximum slope in lines per column.
    stiffness : float
    credit : float
        Score of a covered cell for a crossing path. If it is not zero, a path may weave back and forth across another.
    """
    q = nodes_apart(scores.shape[1])
    n_slopes = min(max(1, int(np.ceil(steepest * q))), scores.shape[0] - 1)
    is_hidden = hidden != NOT_HIDDEN
    lost = np.where(is_hidden | (scores >= _NOTHING), 0.0, stiffness * _ASTRAY / q)
    # Cells of a column are contiguous, since the search runs along them.
    seen, astray = (np.ascontiguousarray(a.T, dtype=np.float32) for a in (np.where(is_hidden, 0.0, scores), lost))
    covering = np.ascontiguousarray(hidden.T)
    lines = _search(seen, astray, covering, n_slopes, np.float32(stiffness), np.float32(credit), q)
    path: FloatArray = lines.astype(np.float64)
    return path


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator,unused-ignore]
def _search(seen, astray, covering, S, stiffness, credit, q):  # type: ignore[no-untyped-def]
    """Viterbi recursion over states (slope index s + S, line); inner loops run along lines and are vectorised."""
    n_columns, n_lines = seen.shape
    n_nodes = (n_columns + q - 1) // q
    n_s = 2 * S + 1
    best = np.zeros((n_s, n_lines), dtype=np.float32)
    came = np.zeros((n_nodes, n_s, n_lines), dtype=np.int16)
    moved = np.empty((n_s, n_lines), dtype=np.float32)
    is_covered = np.zeros(n_columns, dtype=np.bool_)
    for column in range(n_columns):
        is_covered[column] = np.any(covering[column] != NOT_HIDDEN)
    for node in range(n_nodes):
        moved[:] = -1e30
        for i in range(n_s):
            s = i - S
            first, last = max(0, -s), min(n_lines, n_lines - s)  # lines from which a piece ends within the table
            total = moved[i, first + s : last + s]
            total[:] = best[i, first:last]
            for c in range(min(q, n_columns - node * q)):
                column, rise = node * q + c, _at(0, s, c, q)
                scores, lost = seen[column, first + rise : last + rise], astray[column, first + rise : last + rise]
                dear = np.float32(abs(s))
                for k in range(last - first):
                    total[k] += scores[k] - dear * lost[k]
                if is_covered[column]:
                    for k in range(last - first):
                        by = covering[column, first + rise + k]
                        if by != NOT_HIDDEN and abs(s - by) >= _MIN_ANGLE:
                            total[k] += credit
        for i in range(n_s):
            top, source = best[i], came[node, i]
            top[:] = np.float32(-1e30)
            source[:] = i
            for j in range(max(0, i - _MAX_BEND), min(n_s, i + _MAX_BEND + 1)):
                bend = max(abs(i - j) - 1, 0)
                price, values = np.float32(stiffness * bend * bend), moved[j]
                for k in range(n_lines):
                    value = values[k] - price
                    is_better = value > top[k]
                    top[k] = value if is_better else top[k]
                    source[k] = j if is_better else source[k]
    return _read_back(best, came, n_columns, S, q)


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator,unused-ignore]
def _read_back(best, came, n_columns, S, q):  # type: ignore[no-untyped-def]
    """Follow the best final state back to the first column."""
    # Among equally good states, take the lowest line, and of its slopes the steepest downward one.
    flat = np.argmax(best.T.copy())
    k, i = flat // best.shape[0], flat % best.shape[0]
    path = np.empty(n_columns, dtype=np.int64)
    for node in range(came.shape[0] - 1, -1, -1):
        i = came[node, i, k]
        k -= i - S
        for c in range(min(q, n_columns - node * q)):
            path[node * q + c] = _at(k, i - S, c, q)
    return path


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator,unused-ignore]
def _at(k, s, c, q):  # type: ignore[no-untyped-def]
    """Return the line after c of q columns on the way from k to k + s, rounded."""
    return k + (2 * s * c + q) // (2 * q)
