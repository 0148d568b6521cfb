"""Ridges: the momentary frequency and amplitude of each component of a transform."""

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


def _local_median_power(power: FloatArray, n_reach: int) -> FloatArray:
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
"""A slope is read over so large a share of the meeting that it must tell about."""
_MEETING_GAPS = (3.0, 2.2, 1.6, 1.2, 1.0)
"""Gaps at which a meeting is looked at; from afar, the paths there are known better."""
_VALLEY = 0.8
"""Share of the power beside it below which nothing crosses; where two cross, it is above 0.95, in any phase."""


@dataclass(frozen=True)
class Meeting:
    """Columns [start, stop) in which two paths are closer than they can be told apart."""

    start: int
    stop: int


def crossing_segments(a: FloatArray, b: FloatArray, gap: float) -> list[Meeting]:
    """Return the segments where |a - b| <= gap, those less than a few columns apart taken as one."""
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
                _settle((paths[i], levels[i]), (paths[j], levels[j]), meeting, level_weight, power, gap)
    return paths


def _settled_from_afar(a: FloatArray, b: FloatArray, gap: float) -> list[Meeting]:
    """Return the meetings, each in the widest of several gaps that leaves columns to compare on both sides."""
    settled: list[Meeting] = []
    for share in _MEETING_GAPS:
        for meeting in crossing_segments(a, b, share * gap):
            room = min(meeting.start, len(a) - meeting.stop)
            known = any(m.start <= meeting.start and meeting.stop <= m.stop for m in settled)
            if not known and room >= (_N_FIT if share > _MEETING_GAPS[-1] else _MIN_FIT):
                settled.append(meeting)
    return settled


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


def _settle(a: _Track, b: _Track, meeting: Meeting, level_weight: float, power: FloatArray | None, gap: float) -> None:
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
    """Return whether little lies where two paths would cross, compared with what lies beside it."""
    columns = np.flatnonzero(np.abs(crossed[0] - crossed[1]) <= gap / 2)
    middle = np.round((crossed[0] + crossed[1])[columns] / 2).astype(np.int64)
    centre, around = (_largest_near(power, middle, columns + start, reach) for reach in (gap / 4, 2 * gap))
    return len(columns) > 0 and float(centre.mean()) < _VALLEY * float(around.mean())


def _largest_near(power: FloatArray, lines: NDArray[np.int64], columns: NDArray[np.int64], reach: float) -> FloatArray:
    shifts = np.arange(-int(reach), int(reach) + 1)[:, None]
    result: FloatArray = power[np.clip(lines + shifts, 0, len(power) - 1), columns].max(axis=0)
    return result


def maxima_of_separate_paths(power: FloatArray, parted: list[FloatArray], start: int) -> list[FloatArray]:
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


NOT_HIDDEN = -(1 << 14)
"""Mark of cells that no path covers, as in `ridge_path`; written here so that its compiler loads only on use."""
MAX_COLUMNS = 4000
"""Columns that the search for a path works on; longer transforms are pooled."""
_SPARE = 8
"""Ridges looked for beyond those asked, of which the strongest are kept: the clearest need not be strong."""
_MIN_UNCOVERED = 0.6  # share of its columns in which a path is not covered by others
_MIN_SCORE = 0.25  # mean score of a path: below, it hops between maxima of noise


@dataclass(frozen=True)
class _Grid:
    """Power over line and column, at most `MAX_COLUMNS` of them, and the power before squeezing."""

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
    """Return the `n_ridges` strongest of the clear ridges, which go straight on where they cross.

    Paths are found one after the other by dynamic programming over place and slope, with a price on changes of slope;
    what a path covers is taken out before the next one. Eight more than asked are looked for, and those of most power
    kept. Where two of them meet, they are then looked at together: if
    the power shows a valley all through the meeting, they part again; otherwise tails are exchanged if place, slope and
    level go on more evenly so. Place and level come from a parabola through the logarithm of the power, where the
    transform is squeezed of the power before squeezing: squeezing shows which way a component goes, and scatters its
    level over lines where there is noise.

    Parameters
    ----------
    transform : Coefficients or TimeFrequencyMap
        More than 4000 columns are pooled to their mean power first.
    n_ridges : int
    steepest : float
        Lines per (pooled) column that a ridge may rise or fall.
    stiffness : float
        Price of changing the slope by two lines per eight columns, in columns on the ridge; twice that is the price of
        a line where no ridge is. Raise it for chirps in noise, lower it for fast modulation.
    lowest, highest : float or None
        Hz or orders between which to look.

    Returns
    -------
    tuple of Ridge
        The largest rms amplitude first; fewer than asked where the rest of the map shows no further ridge.

    Raises
    ------
    InputError
        On numbers out of range; also on more ridges than lie side by side within the lines.
    RefusalError
        If the map holds no ridge at all.

    Notes
    -----
    Two components that come closer than the transform tells them apart, and turn back, look like two that cross: which
    is which is then not in the data, and the ridges cross. See `shared`, and take a longer wavelet or window. A ridge
    runs through the whole transform: one that begins or ends within it, or that noise covers for long, is carried on
    along what is nearest, so cut the recording, or look at `amplitude`. A component shows as long as its amplitude is
    above that of the noise within the wavelet's or window's band; a longer one has a narrower band.

    Source: R. A. Carmona, W. L. Hwang, B. Torrésani, *Multiridge detection and time-frequency reconstruction*, IEEE
    Transactions on Signal Processing 47 (1999), for ridges as penalised paths; the state with slope and the
    exchange of tails are this package's own.
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
            f"fewer than three of the transform's {len(positions)} lines are looked at",
            remedy="widen the range or compute more lines",
        )
    return slice(low, high)


def _check_room(n_ridges: int, part: slice, n_reach: int) -> None:
    """Raise InputError if so many ridges cannot be told apart on the lines."""
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
        for row, line in enumerate(values[:, part].T if is_map else values[part]):  # the whole may be large
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
        for i in range(len(paths)):  # once more, now that each knows where the others go
            hidden = _hidden(scores.shape, weaker + paths[:i] + paths[i + 1 :], grid.n_reach)
            paths[i] = _uncovered_path(scores, hidden, steepest, stiffness)
        paths = _settled(paths, grid, power)
    return paths


def _uncovered_path(scores: FloatArray, hidden: NDArray[np.int16], steepest: float, stiffness: float) -> FloatArray:
    """Return the best path; one that hides behind others, by weaving across them, is searched without credit."""
    path = best_path(scores, hidden, steepest, stiffness)
    if float(np.mean(_along(hidden, path) == NOT_HIDDEN)) >= _MIN_UNCOVERED:
        return path
    return best_path(scores, hidden, steepest, stiffness, credit=0.0)


def _settled(paths: list[FloatArray], grid: _Grid, power: FloatArray) -> list[FloatArray]:
    """Return the paths, read between the lines, each going on as what it was before it met another one."""
    paths = [_read(grid, p)[0] for p in paths]
    levels: list[FloatArray] = [np.log(np.maximum(_along(power, p), np.finfo(np.float64).tiny)) / 2 for p in paths]
    return reconnected_paths(paths, levels, 2.0 * grid.n_reach, float(grid.n_reach), power)


def _hidden(shape: tuple[int, ...], paths: list[FloatArray], n_cover: int) -> NDArray[np.int16]:
    """Return the slope of the path that covers each cell, in lines per node."""
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
        between = shared & (columns > known[0]) & (columns < known[-1])  # what meets until an end stays as it was read
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
    """Return place, between the lines, and height of the parabola through the log power around the maximum at a path.

    Of squeezed transforms, of the power before squeezing: noise scatters a component's squeezed share over lines, so
    that their sum reads low, and a sweep's share moves towards where the frequency is going.
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


CREDIT = 0.3  # score of a hidden cell for a path that crosses: what lies there cannot be seen
_NOTHING = 0.1  # score below which a cell holds no ridge
_ASTRAY = 2.0  # columns that a line costs where no ridge is: else paths leap to whatever is clearer for a while
_MIN_ANGLE = 2  # lines per node by which slopes must differ to cross


def nodes_apart(n_columns: int) -> int:
    """Return how many columns lie between nodes: eight, fewer in short tables."""
    return min(_MAX_COLUMNS_PER_NODE, max(1, n_columns // _MIN_NODES))


def best_path(
    scores: FloatArray, hidden: NDArray[np.int16], steepest: float, stiffness: float, *, credit: float = CREDIT
) -> FloatArray:
    """Return the line of the path in each column.

    The path is a chain of straight pieces over q columns each (eight, fewer in short tables), each rising by s lines.
    It maximises Σ scores along the path - `stiffness` Σ max(|s' - s| - 1, 0)²: it pays for changes of slope and not for
    slope, so that it goes straight through a crossing instead of turning into the other branch. Changes by one are
    free, as slopes between whole numbers need them. Where no ridge is, each line that it travels costs two columns: so
    it waits for a component that fades, and leaps to another one only if that is clearer for long.

    Parameters
    ----------
    scores : array, (n_lines, n_columns)
        0 to 1.
    hidden : array, (n_lines, n_columns)
        Slope, in lines per node, of the path that covers the cell, or `NOT_HIDDEN`. Covered cells score for paths that
        cross that one, and not for paths along it.
    steepest : float
        Lines per column.
    stiffness : float
    credit : float
        Score of a covered cell for a path that crosses. With one, a path may weave to and fro across another.
    """
    q = nodes_apart(scores.shape[1])
    n_slopes = min(max(1, int(np.ceil(steepest * q))), scores.shape[0] - 1)
    is_hidden = hidden != NOT_HIDDEN
    lost = np.where(is_hidden | (scores >= _NOTHING), 0.0, stiffness * _ASTRAY / q)
    # A column's cells lie side by side, as the search goes along them.
    seen, astray = (np.ascontiguousarray(a.T, dtype=np.float32) for a in (np.where(is_hidden, 0.0, scores), lost))
    covering = np.ascontiguousarray(hidden.T)
    lines = _search(seen, astray, covering, n_slopes, np.float32(stiffness), np.float32(credit), q)
    path: FloatArray = lines.astype(np.float64)
    return path


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator,unused-ignore]
def _search(seen, astray, covering, S, stiffness, credit, q):  # type: ignore[no-untyped-def]
    """Viterbi recursion over states (slope index s + S, line); inner loops go along lines, several at a time."""
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
    # Of states that are as good the lowest line, and of its slopes the steepest down.
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
    """Line after c of q columns on the way from k to k + s, rounded."""
    return k + (2 * s * c + q) // (2 * q)
