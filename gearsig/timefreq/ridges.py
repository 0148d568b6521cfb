"""Ridges: the momentary frequency and amplitude of each component of a transform."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gearsig.checks import FloatArray, count, not_negative, positive
from gearsig.errors import InputError, RefusalError
from gearsig.timefreq.crossings import shared_columns, untangled
from gearsig.timefreq.ridge_scores import SQUEEZED_REACH, ridge_power, ridge_scores
from gearsig.timefreq.types import Coefficients, Ridge, TimeFrequencyMap

NOT_HIDDEN = -(1 << 14)
"""Mark of cells that no path covers, as in `ridge_path`; written here so that its compiler loads only on use."""
MOST_COLUMNS = 4000
"""Columns that the search for a path works on; longer transforms are pooled."""
_SPARE = 8
"""Ridges looked for beyond those asked, of which the strongest are kept: the clearest need not be strong."""
_LEAST_SEEN = 0.6  # share of its columns in which a path is not covered by others
_LEAST_SCORE = 0.25  # mean score of a path: below, it hops between maxima of noise


@dataclass(frozen=True)
class _Grid:
    """Power and complex values (where there are any) over line and column, at most `MOST_COLUMNS` of them."""

    power: FloatArray
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
    level go on more evenly so. Places between lines come from a parabola through the logarithm of the power (or its
    centre of gravity where the transform is squeezed).

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
    count(n_ridges, "n_ridges")
    positive(steepest, "steepest")
    not_negative(stiffness, "stiffness")
    part = _lines_between(transform.positions, lowest, highest)
    _check_room(n_ridges, part, transform.n_reach)
    grid = _grid(transform, part)
    paths, power = _paths(grid, n_ridges, steepest, stiffness)
    if not paths:
        raise RefusalError(
            "no ridge stands out from the rest of the transform",
            remedy="look between other lines (lowest, highest), take a longer wavelet or window, or average more",
        )
    shared = shared_columns(paths, 2.0 * grid.n_reach)
    found = [_ridge(transform, grid, power, part, p, s) for p, s in zip(paths, shared, strict=True)]
    return tuple(sorted(found, key=lambda r: -float(np.mean(r.amplitude**2))))


def _lines_between(positions: FloatArray, lowest: float | None, highest: float | None) -> slice:
    low = 0 if lowest is None else int(np.searchsorted(positions, lowest))
    high = len(positions) if highest is None else int(np.searchsorted(positions, highest, side="right"))
    if high - low < 3:
        raise RefusalError(
            f"fewer than three of the transform's {len(positions)} lines are looked at",
            remedy="widen the range or compute more lines",
        )
    return slice(low, high)


def _check_room(n_ridges: int, part: slice, n_reach: int) -> None:
    """Raise InputError if so many ridges cannot be told apart on the lines."""
    most = max(1, (part.stop - part.start) // (2 * n_reach + 1))
    if n_ridges > most:
        raise InputError(
            f"n_ridges is {n_ridges} on {part.stop - part.start} lines, each ridge covering {2 * n_reach + 1} of them",
            allowed=f"1 to {most}",
            remedy="ask for fewer, or compute more lines",
        )


def _grid(transform: Coefficients | TimeFrequencyMap, part: slice) -> _Grid:
    if isinstance(transform, TimeFrequencyMap):
        values = transform.values[:, part].T
        power = values**2 if transform.scaling == "amplitude peak" else 2.0 * values
        return _pooled(np.asarray(power, dtype=np.float64), transform.at, transform)
    n = len(transform.at)
    n_per = -(-n // MOST_COLUMNS)
    starts = np.arange(0, n, n_per)
    power = np.empty((part.stop - part.start, len(starts)))
    for row, line in enumerate(transform.values[part]):  # one line at a time: the whole may be large
        power[row] = np.add.reduceat(line.real**2 + line.imag**2, starts) / np.diff(starts, append=n)
    ends = np.append(starts[1:], n) - 1
    at = (transform.at[starts] + transform.at[ends]) / 2
    return _Grid(power, at, transform.n_reach, transform.squeezed)


def _pooled(power: FloatArray, at: FloatArray, transform: TimeFrequencyMap) -> _Grid:
    n_per = -(-len(at) // MOST_COLUMNS)
    starts = np.arange(0, len(at), n_per)
    ends = np.append(starts[1:], len(at)) - 1
    mean = np.add.reduceat(power, starts, axis=1) / (ends - starts + 1)
    return _Grid(mean, (at[starts] + at[ends]) / 2, transform.n_reach, transform.squeezed)


def _paths(grid: _Grid, n_ridges: int, steepest: float, stiffness: float) -> tuple[list[FloatArray], FloatArray]:
    """Return paths, and the power of a component at each cell."""
    power = ridge_power(grid.power, squeezed=grid.squeezed)
    scores = ridge_scores(power, grid.n_reach)
    found: list[FloatArray] = []
    strengths: list[float] = []
    for _ in range(n_ridges + _SPARE):
        hidden = _hidden(scores.shape, found, grid.n_reach)
        path = _seen_path(scores, hidden, steepest, stiffness)
        seen = _along(hidden, path) == NOT_HIDDEN
        if not seen.any() or float(_along(scores, path)[seen].mean()) < _LEAST_SCORE:
            break
        found.append(path)
        strengths.append(float(_along(power, path)[seen].mean()))
    strongest = sorted(range(len(found)), key=lambda i: -strengths[i])[:n_ridges]
    paths = [found[i] for i in sorted(strongest)]
    others = [found[i] for i in range(len(found)) if i not in strongest]
    if len(paths) > 1:
        paths = _settled(paths, grid, power)
        for i in range(len(paths)):  # once more, now that each knows where the others go
            hidden = _hidden(scores.shape, others + paths[:i] + paths[i + 1 :], grid.n_reach)
            paths[i] = _seen_path(scores, hidden, steepest, stiffness)
        paths = _settled(paths, grid, power)
    return paths, power


def _seen_path(scores: FloatArray, hidden: NDArray[np.int16], steepest: float, stiffness: float) -> FloatArray:
    """Return the best path; one that hides behind others, by weaving across them, is searched without credit."""
    from gearsig.timefreq.ridge_path import best_path

    path = best_path(scores, hidden, steepest, stiffness)
    if float(np.mean(_along(hidden, path) == NOT_HIDDEN)) >= _LEAST_SEEN:
        return path
    return best_path(scores, hidden, steepest, stiffness, credit=0.0)


def _settled(paths: list[FloatArray], grid: _Grid, power: FloatArray) -> list[FloatArray]:
    """Return the paths, read between the lines, each going on as what it was before it met another one."""
    paths = [_read(grid, power, p)[0] for p in paths]
    levels: list[FloatArray] = [np.log(np.maximum(_along(power, p), np.finfo(np.float64).tiny)) / 2 for p in paths]
    return untangled(paths, levels, 2.0 * grid.n_reach, float(grid.n_reach), power)


def _hidden(shape: tuple[int, ...], paths: list[FloatArray], n_cover: int) -> NDArray[np.int16]:
    """Return the slope of the path that covers each cell, in lines per node."""
    from gearsig.timefreq.ridge_path import nodes_apart

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
    power: FloatArray,
    part: slice,
    path: FloatArray,
    shared: np.ndarray[tuple[int], np.dtype[np.bool_]],
) -> Ridge:
    places, peak = _read(grid, power, path)
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


def _read(grid: _Grid, power: FloatArray, path: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return place, between the lines, and peak power next to a path."""
    return _centres(grid, path) if grid.squeezed else _parabolas(power, path)


def _parabolas(power: FloatArray, path: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return place and height of the parabola through the log power around the local maximum next to the path."""
    n, columns = len(power), np.arange(len(path))
    near = np.clip(np.round(path).astype(np.int64)[None, :] + np.arange(-2, 3)[:, None], 1, n - 2)
    best = near[np.argmax(power[near, columns[None, :]], axis=0), columns]
    lowest = float(np.finfo(np.float64).tiny)
    a, b, c = (np.log(np.maximum(power[best + shift, columns], lowest)) for shift in (-1, 0, 1))
    bend = a - 2 * b + c
    shift = np.where(bend < 0, np.clip((a - c) / 2 / np.where(bend < 0, bend, -1.0), -0.5, 0.5), 0.0)
    return best + shift, np.exp(b - (a - c) * shift / 4)


def _centres(grid: _Grid, path: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return centre of gravity and sum of the power within reach of the path."""
    n, columns = len(grid.power), np.arange(len(path))
    near = np.round(path).astype(np.int64)[None, :] + np.arange(-SQUEEZED_REACH, SQUEEZED_REACH + 1)[:, None]
    inside = (near >= 0) & (near < n)
    power = np.where(inside, grid.power[np.clip(near, 0, n - 1), columns[None, :]], 0.0)
    total = power.sum(axis=0)
    centre = (power * near).sum(axis=0) / np.where(total > 0, total, 1.0)
    return np.where(total > 0, centre, path), total


def _along(table: NDArray[Any], path: FloatArray) -> FloatArray:
    lines = np.clip(np.round(path).astype(np.int64), 0, len(table) - 1)
    result: FloatArray = table[lines, np.arange(len(path))]
    return result


def _unit(transform: Coefficients | TimeFrequencyMap) -> str:
    if isinstance(transform, TimeFrequencyMap) and transform.scaling == "power":
        return transform.unit.removesuffix("^2").removeprefix("(").removesuffix(")")
    return transform.unit
