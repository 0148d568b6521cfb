"""Recurrence plots and their quantification, with bounded time and memory."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gearsig.checks import FloatArray, count, freeze, positive, within
from gearsig.compiled import njit
from gearsig.errors import InputError, RefusalError
from gearsig.phase._neighbours import GOLDEN
from gearsig.phase._plane import PhasePortrait, check_portrait, mean_period_samples
from gearsig.results import Result

BoolArray = NDArray[np.bool_]


@dataclass(frozen=True)
class RecurrencePlot(Result, matrix=("recurrent", "times_s", "times_s")):
    """Which pairs of points of a path are close to each other.

    Parameters
    ----------
    recurrent : array of bool, (n, n)
        Symmetric; read-only.
    times_s : array, (n,)
    radius : float
        Points closer than this are recurrent; in standard deviations of the axes.
    stride : int
        Every `stride`-th point of the portrait was used.
    source : str
    """

    recurrent: BoolArray
    times_s: FloatArray
    radius: float
    stride: int
    source: str

    def __post_init__(self) -> None:
        freeze(self, "recurrent", ndim=None)
        freeze(self, "times_s")


@dataclass(frozen=True)
class RecurrenceMeasures(Result):
    """Recurrence quantification; lengths in seconds, shares from 0 to 1.

    Parameters
    ----------
    recurrence_rate : float
        RR: share of recurrent pairs.
    determinism : float
        DET: share of the recurrent points on diagonal lines of at least `shortest_line` points.
    mean_line_s, longest_line_s : float
        L and Lmax: mean and maximum length of these lines.
    entropy_nats : float
        ENTR: Shannon entropy of their lengths.
    laminarity : float
        LAM: share of the recurrent points on vertical lines of at least `shortest_line` points.
    trapping_time_s : float
        TT: mean length of these.
    radius : float
        In standard deviations of the axes.
    shortest_line, theiler_points, stride, n_points : int
        In points used, i.e. every `stride`-th sample.
    duration_s : float
        Length of the segment.
    source : str
    """

    recurrence_rate: float
    determinism: float
    mean_line_s: float
    longest_line_s: float
    entropy_nats: float
    laminarity: float
    trapping_time_s: float
    radius: float
    shortest_line: int
    theiler_points: int
    stride: int
    n_points: int
    duration_s: float
    source: str


N_PAIRS = 200_000
MAX_PLOT_POINTS, MAX_MEASURE_POINTS = 3_000, 20_000


def recurrence_plot(
    portrait: PhasePortrait,
    *,
    recurrence_rate: float = 0.05,
    radius: float | None = None,
    n_points: int = 1_000,
    stride: int | None = None,
) -> RecurrencePlot:
    """Return which points lie closer to each other than a radius: R(i, j) = |x(i) - x(j)| < ε.

    Parameters
    ----------
    portrait : PhasePortrait
    recurrence_rate : float
        Share of recurrent pairs for which the radius is chosen, 0.001 to 0.5.
    radius : float or None
        In standard deviations of the axes; overrides `recurrence_rate`.
    n_points : int
        Maximum number of points from the start of the path (2 to 3000), so that the matrix does not grow with the
        signal. For another segment see `PhasePortrait.between`.
    stride : int or None
        Every `stride`-th point is used; None leaves 16 points per mean period.

    Raises
    ------
    InputError
        On a radius, rate or number of points out of range.
    RefusalError
        If the path does not move.

    Source: J.-P. Eckmann, S. Oliffson Kamphorst, D. Ruelle, *Recurrence plots of dynamical systems*, Europhysics
    Letters 4 (1987).
    """
    from scipy.spatial.distance import cdist

    count(n_points, "n_points", minimum=2, maximum=MAX_PLOT_POINTS)
    points, step = _thinned_points(portrait, n_points, stride)
    limit = _radius(points, recurrence_rate, radius, 0)
    matrix = cdist(points, points) < limit
    times = portrait.start_s + np.arange(len(points)) * (step / portrait.sampling_rate_hz)
    return RecurrencePlot(matrix, times, limit, step, portrait.source)


def recurrence_measures(
    portrait: PhasePortrait,
    *,
    recurrence_rate: float = 0.05,
    radius: float | None = None,
    shortest_line: int = 2,
    theiler_samples: int | None = None,
    n_points: int = 5_000,
    stride: int | None = None,
) -> RecurrenceMeasures:
    """Return recurrence rate, determinism, line lengths, entropy, laminarity and trapping time.

    With P(l) the number of diagonal lines of length l: DET = Σ_{l≥l_min} l P(l) / Σ l P(l), L = Σ l P / Σ P,
    ENTR = -Σ p ln p with p = P / Σ P over l ≥ l_min; LAM and TT are the same for vertical lines. Pairs close in time
    (Theiler window) are not counted. Lines cut off at the border count with their remaining length.

    Parameters
    ----------
    portrait : PhasePortrait
    recurrence_rate, radius
        As in `recurrence_plot`.
    shortest_line : int
        l_min, at least 2, in points used.
    theiler_samples : int or None
        None: one mean period, but at least one point.
    n_points : int
        Maximum number of points from the start of the path (100 to 20 000). Time grows with its square, but memory does
        not, as the matrix is never stored. For another segment see `PhasePortrait.between`.
    stride : int or None
        Every `stride`-th point is used; None leaves 16 points per mean period. A larger stride loses lines.

    Returns
    -------
    RecurrenceMeasures
        Lengths in seconds.

    Raises
    ------
    RefusalError
        If the path does not move, or is too short for the Theiler window.

    Notes
    -----
    High determinism is not a proof: narrow-band noise has it as well.

    Source: N. Marwan, M. C. Romano, M. Thiel, J. Kurths, *Recurrence plots for the analysis of complex systems*,
    Physics Reports 438 (2007).
    """
    count(n_points, "n_points", minimum=100, maximum=MAX_MEASURE_POINTS)
    count(shortest_line, "shortest_line", minimum=2)
    points, stride_taken = _thinned_points(portrait, n_points, stride)
    window = _theiler(portrait, theiler_samples, stride_taken)
    if len(points) < 2 * window + 20:
        raise RefusalError(
            f"{len(points)} points are too few for a Theiler window of {window}", remedy="record longer or lower it"
        )
    limit = _radius(points, recurrence_rate, radius, window)
    diagonal, vertical = np.zeros(len(points) + 1, dtype=np.int64), np.zeros(len(points) + 1, dtype=np.int64)
    line_lengths(points, limit, window, diagonal, vertical)
    step = stride_taken / portrait.sampling_rate_hz
    n_apart = len(points) - window - 1
    recurrent = float(np.dot(np.arange(len(diagonal)), diagonal))
    determinism, mean_line, longest, entropy = _lines(diagonal, shortest_line)
    laminarity, trapping, _, _ = _lines(vertical, shortest_line)
    return RecurrenceMeasures(
        recurrence_rate=recurrent / (0.5 * n_apart * (n_apart + 1)),
        determinism=determinism,
        mean_line_s=mean_line * step,
        longest_line_s=longest * step,
        entropy_nats=entropy,
        laminarity=laminarity,
        trapping_time_s=trapping * step,
        radius=limit,
        shortest_line=shortest_line,
        theiler_points=window,
        stride=stride_taken,
        n_points=len(points),
        duration_s=len(points) * step,
        source=portrait.source,
    )


def _lines(counts: np.ndarray, shortest: int) -> tuple[float, float, float, float]:
    """Return the share of points on lines, the lines' mean and maximum length, and the entropy of the lengths."""
    lengths = np.arange(len(counts))
    total = float(np.dot(lengths, counts))
    long, n_long = lengths[shortest:], counts[shortest:].astype(np.float64)
    n = n_long.sum()
    if total == 0.0 or n == 0.0:
        return 0.0, 0.0, 0.0, 0.0
    share = n_long[n_long > 0] / n
    on_lines = float(np.dot(long, n_long))
    return on_lines / total, on_lines / float(n), float(long[n_long > 0].max()), float(-np.sum(share * np.log(share)))


def _thinned_points(portrait: PhasePortrait, n_points: int, stride: int | None) -> tuple[FloatArray, int]:
    """Return the first points at a stride, in standard deviations of the axes, and the stride."""
    check_portrait(portrait)
    extent = portrait.extent
    if not bool((extent > 0.0).any()):
        raise RefusalError("the path does not move", remedy="take a channel that vibrates")
    step = max(1, int(_period(portrait) / 16.0)) if stride is None else count(stride, "stride")
    points = portrait.points[::step][:n_points] / np.where(extent > 0.0, extent, 1.0)
    return np.ascontiguousarray(points, dtype=np.float64), step


def _theiler(portrait: PhasePortrait, n_samples: int | None, stride: int) -> int:
    if n_samples is not None:
        return -(-count(n_samples, "theiler_samples", minimum=0) // stride)
    return max(1, round(_period(portrait) / stride))


def _period(portrait: PhasePortrait) -> float:
    """Return the mean period along the first axis that moves, in samples."""
    axis = int(np.argmax(portrait.extent > 0.0))
    return mean_period_samples(np.ascontiguousarray(portrait.points[:, axis], dtype=np.float64))


def _radius(points: FloatArray, rate: float, radius: float | None, theiler: int) -> float:
    """Return the given radius, or the `rate` quantile of the distances of pairs spread evenly over all delays."""
    if radius is not None:
        return positive(radius, "radius", "standard deviations")
    within(rate, "recurrence_rate", 0.001, 0.5)
    n = len(points)
    lowest = theiler + 1
    if n <= lowest + 1:
        raise InputError(f"the portrait has {n} points", allowed=f"more than {lowest + 1}")
    # Pairs (i, j) are spread uniformly over the triangle j - i > theiler.
    u, v = (np.arange(N_PAIRS) + 0.5) / N_PAIRS, (np.arange(N_PAIRS) * GOLDEN) % 1.0
    lag = lowest + np.minimum(((n - lowest) * (1.0 - np.sqrt(1.0 - u))).astype(np.intp), n - lowest - 1)
    starts = (v * (n - lag)).astype(np.intp)
    distance = np.linalg.norm(points[starts + lag] - points[starts], axis=1)
    quantile = float(np.quantile(distance, rate))
    return quantile if quantile > 0.0 else float(np.nextafter(0.0, 1.0))


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator,unused-ignore]
def line_lengths(points, radius, theiler, diagonal, vertical):  # type: ignore[no-untyped-def]
    """Count lines by length: diagonal[l] in the upper triangle, vertical[l] in all columns; index 0 is not a line.

    Pairs within `theiler` points in time count as not recurrent. The matrix is symmetric: a column below the excluded
    band equals a row above it, so one pass over the upper triangle finds the vertical lines of both halves.
    """
    n, d = points.shape
    limit = radius * radius
    column_run = np.zeros(n, dtype=np.int64)
    diagonal_run = np.zeros(n, dtype=np.int64)  # by j - i
    for i in range(n):
        run = 0
        for j in range(i + theiler + 1, n):
            square = 0.0
            for a in range(d):
                difference = points[i, a] - points[j, a]
                square += difference * difference
            lag = j - i
            if square < limit:
                diagonal_run[lag] += 1
                column_run[j] += 1  # along i at fixed j: column of the upper triangle
                run += 1  # along j at fixed i: column of the lower triangle
            else:
                diagonal[diagonal_run[lag]] += 1
                diagonal_run[lag] = 0
                vertical[column_run[j]] += 1
                column_run[j] = 0
                vertical[run] += 1
                run = 0
        vertical[run] += 1
        if i + theiler + 1 < n:
            j = i + theiler + 1  # the next row enters this column's excluded band: its run ends here
            vertical[column_run[j]] += 1
            column_run[j] = 0
    for lag in range(theiler + 1, n):
        diagonal[diagonal_run[lag]] += 1
