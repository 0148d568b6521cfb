"""The largest Lyapunov exponent: the slope of a divergence curve over a range set by a stated rule."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal, get_args

import numpy as np

from gearsig.checks import FloatArray, count, freeze, limits, one_of
from gearsig.compiled import njit
from gearsig.errors import InputError, RefusalError
from gearsig.formatting import percent
from gearsig.phase._neighbours import GOLDEN, IndexArray, evenly_spaced_indices, nearest_beyond_theiler_window
from gearsig.phase._plane import PhasePortrait, check_portrait, checked_series, mean_period_samples
from gearsig.results import Result


@dataclass(frozen=True)
class LyapunovExponent(Result, columns=("times_s", "log_distance")):
    """Largest Lyapunov exponent and the divergence curve from which it was estimated.

    Parameters
    ----------
    exponent_per_s, uncertainty_per_s : float
        Slope of the curve and its standard deviation, from the scatter between segments of the signal and the
        dependence on the limits of the fit. nan in the `looked_at` of a `RefusalError`.
    log_distance : array, (n_steps,)
        Mean logarithm of the distance of neighbours after 0, 1, 2, … steps of `step_s`.
    step_s : float
    fit_s : (float, float)
        Fitted segment of the curve.
    saturation_log_distance : float
        Mean logarithm of the distance of unrelated points.
    verdict : str
        "diverging": the exponent is above twice its uncertainty and distances grow by at least e; "not diverging": they
        do not, although there was room; "undecided".
    method : str
        "rosenstein", "transverse" or "kantz".
    n_references, theiler_samples : int
    source : str
    """

    exponent_per_s: float
    uncertainty_per_s: float
    log_distance: FloatArray
    step_s: float
    fit_s: tuple[float, float]
    saturation_log_distance: float
    verdict: Literal["diverging", "not diverging", "undecided"]
    method: str
    n_references: int
    theiler_samples: int
    source: str

    def __post_init__(self) -> None:
        freeze(self, "log_distance")

    @property
    def times_s(self) -> FloatArray:
        """Times of the divergence curve in s, (n_steps,)."""
        return np.arange(len(self.log_distance)) * self.step_s


N_LIBRARY, N_REFERENCES, N_BLOCKS = 100_000, 4_000, 12
MAX_NEIGHBOURS = 10
N_UNRELATED = 20_000


@dataclass(frozen=True)
class Divergence:
    """Divergence curve, overall and for each segment of the signal.

    Parameters
    ----------
    log_distance : array, (n_steps,)
    by_block : array, (n_blocks, n_steps)
    saturation : float
        Mean logarithm of the distance of unrelated points.
    n_references : int
    """

    log_distance: FloatArray
    by_block: FloatArray
    saturation: float
    n_references: int


def rosenstein(points: FloatArray, theiler: int, n_steps: int, *, across: bool = False) -> Divergence:
    """Return S(k) = mean over i of ln |x(i + k) - x(j(i) + k)|, with j(i) the nearest neighbour of i.

    With `across`, the distance is taken across the path. Nothing diverges along the path, so the slope is too small if
    coarse sampling makes most of a neighbour's distance lie along it.

    Source: M. T. Rosenstein, J. J. Collins, C. J. De Luca, *A practical method for calculating largest Lyapunov
    exponents from small data sets*, Physica D 65 (1993).
    """
    library, references = _library(points, n_steps)
    _, near = nearest_beyond_theiler_window(points, library, references, theiler)
    references, near = references[near >= 0], near[near >= 0]
    block = _blocks(references, len(points))
    sums, counts = np.zeros((N_BLOCKS, n_steps)), np.zeros((N_BLOCKS, n_steps))
    mean_log_distance(points, references, near, block, across, sums, counts)
    return _curve(sums, counts, _unrelated_log_distance(points, theiler, last_axis=False), len(references))


def kantz(points: FloatArray, theiler: int, n_steps: int) -> Divergence:
    """Return S(k) = mean over i of ln(mean of |x(i + k) - x(j + k)| over i's neighbours j), for the last coordinate.

    The neighbours are the 10 nearest library points that are apart in time, so that the radius adapts to the density.

    Source: H. Kantz, *A robust method to estimate the maximal Lyapunov exponent of a time series*, Physics Letters A
    185 (1994).
    """
    from scipy.spatial import cKDTree

    library, references = _library(points, n_steps)
    k = min(4 * MAX_NEIGHBOURS, len(library))
    _, neighbours = cKDTree(np.ascontiguousarray(points[library])).query(np.ascontiguousarray(points[references]), k=k)
    near = library[neighbours]
    apart = np.abs(near - references[:, None]) > theiler
    apart &= np.cumsum(apart, axis=1) <= MAX_NEIGHBOURS
    per_reference = apart.sum(axis=1)
    used = per_reference >= MAX_NEIGHBOURS // 3
    if np.count_nonzero(used) < len(references) // 2:
        raise RefusalError("the path hardly ever returns close to itself", remedy="record longer")
    starts = np.concatenate([[0], np.cumsum(per_reference[used])])
    block = _blocks(references[used], len(points))
    sums, counts = np.zeros((N_BLOCKS, n_steps)), np.zeros((N_BLOCKS, n_steps))
    log_mean_distance(points, references[used], starts, near[used][apart[used]], block, sums, counts)
    return _curve(sums, counts, _unrelated_log_distance(points, theiler, last_axis=True), int(np.count_nonzero(used)))


def _library(points: FloatArray, n_steps: int) -> tuple[IndexArray, IndexArray]:
    """Return library and reference points that can be followed for all steps, so that all means use the same pairs."""
    n = len(points) - n_steps - 2
    return 1 + evenly_spaced_indices(n, N_LIBRARY), 1 + evenly_spaced_indices(n, N_REFERENCES)


def _blocks(references: IndexArray, n: int) -> IndexArray:
    return np.minimum(references * N_BLOCKS // n, N_BLOCKS - 1)


def _unrelated_log_distance(points: FloatArray, theiler: int, *, last_axis: bool) -> float:
    """Return the mean log distance of points far apart in time, in pairs spread by the golden ratio over all delays."""
    n = len(points)
    firsts = evenly_spaced_indices(n, N_UNRELATED)
    seconds = (firsts + 1 + theiler + ((np.arange(len(firsts)) * GOLDEN) % 1.0 * (n - 2 * theiler - 2))) % n
    difference = points[firsts] - points[seconds.astype(np.intp)]
    distance = np.abs(difference[:, -1]) if last_axis else np.linalg.norm(difference, axis=1)
    return float(np.log(distance[distance > 0.0]).mean())


def _curve(sums: FloatArray, counts: FloatArray, saturation: float, n_references: int) -> Divergence:
    with np.errstate(invalid="ignore", divide="ignore"):
        by_block = np.where(counts > 0, sums / counts, np.nan)
    total = counts.sum(axis=0)
    if bool((total == 0).any()):
        raise RefusalError(
            "neighbours stay at distance zero: the signal repeats itself exactly",
            remedy="nothing diverges here; look at the Poincaré section instead",
        )
    return Divergence(sums.sum(axis=0) / total, by_block, saturation, n_references)


Method = Literal["rosenstein", "transverse", "kantz"]

ROOM = 2.0
"""The fit ends where the mean log distance comes this close to that of unrelated points: 14 % of their distance."""

FLAT, MIN_MISSING = 0.3, 0.7
"""A curve is flat if it rises by less than `FLAT` of its gap to saturation, provided the gap exceeds `MIN_MISSING`."""

PERIODS_FOLLOWED = 30.0
MIN_STEPS = 4


def largest_lyapunov_exponent(
    portrait: PhasePortrait,
    *,
    method: Method = "rosenstein",
    theiler_samples: int | None = None,
    n_steps: int | None = None,
    fit_s: tuple[float, float] | None = None,
) -> LyapunovExponent:
    """Return the rate at which neighbouring segments of a path diverge, λ = dS/dt of the divergence curve S.

    The fit extends from the embedding's length (d-1)τ, before which the segments still share values, to where S first
    comes within 2 of its saturation, or to the last step. Saturation is the mean log distance of unrelated points, or
    the end of the curve if that is lower and the curve has risen by more than 3 (phase-coherent motion diverges fully
    only much later). The uncertainty combines the jackknife over 12 segments of the signal with half the span of the
    slopes in either half of the fit and with 1.5 and 2.5 instead of 2.

    Parameters
    ----------
    portrait : PhasePortrait
        Preferably a delay embedding, or states of a model. The phase plane of a driven machine is only a projection:
        use an embedding instead.
    method : str
        "rosenstein": nearest neighbour, full distance; "transverse": the same across the path, better for coarsely
        sampled flows, meaningless for maps; "kantz": 10 neighbours, last coordinate, better for noisy data with many
        points.
    theiler_samples : int or None
        Neighbours closer in time do not count; None: one mean period, but at least the embedding's length.
    n_steps : int or None
        Number of steps followed; None: 30 mean periods, at most a quarter of the path.
    fit_s : (float, float) or None
        Segment of the curve to fit, overriding the rule.

    Returns
    -------
    LyapunovExponent
        "diverging" only if λ is above twice its uncertainty and the distance grows by e or more within the fit; "not
        diverging" if the distance grows by less although there was room; "undecided" otherwise.

    Raises
    ------
    RefusalError
        If neighbours are immediately as far apart as unrelated points (noise, or too few points), or the path does not
        return close to itself.

    Notes
    -----
    The estimate presumes determinism: check the signal with `embedding_dimension` first. Noise raises the start of the
    curve. With noise of 1 % of the standard deviation, the Lorenz system's exponent is 5 % too low, with 2 % it is 12 %
    too low; with 5 % a fit is possible only across the path ("transverse", "undecided"); with 10 % there is no answer.

    Source: M. T. Rosenstein, J. J. Collins, C. J. De Luca, Physica D 65 (1993); H. Kantz, Physics Letters A 185 (1994).
    """
    check_portrait(portrait)
    one_of(method, "method", get_args(Method))
    x = checked_series(np.ascontiguousarray(portrait.points[:, 0]), minimum=100, name="the portrait's first axis")
    period = mean_period_samples(x)
    memory = (portrait.n_axes - 1) * portrait.delay_samples
    window = round(max(period, memory)) if theiler_samples is None else count(theiler_samples, "theiler_samples")
    steps = _steps(n_steps, period, memory, portrait.n_points, window)
    points = _comparable(portrait)
    curve = (
        kantz(points, window, steps)
        if method == "kantz"
        else rosenstein(points, window, steps, across=method == "transverse")
    )
    rate = portrait.sampling_rate_hz
    curve = replace(curve, saturation=_saturation(curve, memory))
    not_fitted = LyapunovExponent(
        exponent_per_s=float("nan"),
        uncertainty_per_s=float("nan"),
        log_distance=curve.log_distance,
        step_s=1.0 / rate,
        fit_s=(memory / rate, memory / rate),
        saturation_log_distance=curve.saturation,
        verdict="undecided",
        method=method,
        n_references=curve.n_references,
        theiler_samples=window,
        source=portrait.source,
    )
    if fit_s is None:
        try:
            first, stop = fit_limits(curve, memory, max(MIN_STEPS, round(0.25 * period)))
        except RefusalError as refusal:
            refusal.looked_at = not_fitted
            raise
    else:
        first, stop = _requested_limits(fit_s, rate, len(curve.log_distance))
    slope, uncertainty = slope_of(curve, first, stop)
    return replace(
        not_fitted,
        exponent_per_s=slope * rate,
        uncertainty_per_s=uncertainty * rate,
        fit_s=(first / rate, (stop - 1) / rate),
        verdict=_verdict(slope, uncertainty, stop - 1 - first, has_room=stop == len(curve.log_distance)),
    )


def fit_limits(curve: Divergence, memory: int, n_min: int) -> tuple[int, int]:
    """Return the first step of the fit and the step after its last.

    A flat curve, see `FLAT`, even within `ROOM` of saturation, is noise on a motion that does not diverge: it is fitted
    as a whole.
    """
    s = curve.log_distance
    missing = curve.saturation - float(s[memory])
    if missing > MIN_MISSING and float(s[memory:].max()) < s[memory] + FLAT * missing:
        return memory, len(s)
    near = np.flatnonzero(s[memory:] >= curve.saturation - ROOM)
    stop = memory + int(near[0]) if len(near) else len(s)
    if stop - memory >= n_min:
        return memory, stop
    raise RefusalError(
        f"after {memory} steps, neighbours are {percent(np.exp(-missing))} as far apart as unrelated points: no "
        "segment of exponential growth is visible, as the signal is stochastic or too noisy",
        remedy="filter it, record longer, or embed it with fewer dimensions",
    )


def _requested_limits(fit_s: tuple[float, float], rate: float, n_steps: int) -> tuple[int, int]:
    fit_s = limits(fit_s, "fit_s", "s")
    first, stop = round(fit_s[0] * rate), round(fit_s[1] * rate) + 1
    if first < 0 or not first + MIN_STEPS <= stop <= n_steps:
        raise InputError(
            f"fit_s goes from {fit_s[0]:g} to {fit_s[1]:g} s",
            allowed=f"at least {MIN_STEPS} steps of {1.0 / rate:.3g} s within 0 to {(n_steps - 1) / rate:.4g} s",
        )
    return first, stop


def _saturation(curve: Divergence, memory: int) -> float:
    """Return the log distance at the end of the curve if it has clearly risen, or that of unrelated points if lower."""
    s = curve.log_distance
    end = float(np.median(s[-max(1, (len(s) - memory) // 4) :]))
    return min(end, curve.saturation) if end - s[memory] > ROOM + 1.0 else curve.saturation


def slope_of(curve: Divergence, first: int, stop: int) -> tuple[float, float]:
    """Return the slope of the curve per step and its standard deviation."""
    s, k = curve.log_distance, np.arange(len(curve.log_distance), dtype=np.float64)
    slope = _slope(k[first:stop], s[first:stop])
    blocks = curve.by_block[:, first:stop]
    blocks = blocks[np.isfinite(blocks).all(axis=1)]
    n = len(blocks)
    without_block = [(blocks.sum(axis=0) - b) / (n - 1) for b in blocks] if n > 2 else []
    without = np.array([_slope(k[first:stop], r) for r in without_block] or [slope])
    scatter = float(np.sqrt(max(n - 1, 0) * np.var(without)))
    further_slopes = [_slope(k[a:b], s[a:b]) for a, b in _fits_of_other_limits(curve, first, stop)]
    return slope, float(np.hypot(scatter, 0.5 * (max(further_slopes) - min(further_slopes))))


def _fits_of_other_limits(curve: Divergence, first: int, stop: int) -> list[tuple[int, int]]:
    middle = (first + stop) // 2
    fits = [(first, middle + 1), (middle, stop)]
    if stop < len(curve.log_distance):
        for room in (ROOM - 0.5, ROOM + 0.5):
            beyond = first + int(np.argmax(curve.log_distance[first:] >= curve.saturation - room))
            if beyond - first >= 3:
                fits.append((first, beyond))
    return fits


def _verdict(
    slope: float, uncertainty: float, n_fitted: int, *, has_room: bool
) -> Literal["diverging", "not diverging", "undecided"]:
    if slope * n_fitted >= 1.0 and slope > 2.0 * uncertainty:
        return "diverging"
    return "not diverging" if has_room and slope * n_fitted < 1.0 else "undecided"


def _slope(k: FloatArray, s: FloatArray) -> float:
    centred = k - k.mean()
    return float(np.dot(centred, s) / np.dot(centred, centred))


def _steps(n_steps: int | None, period: float, memory: int, n_points: int, window: int) -> int:
    steps = (
        int(min(PERIODS_FOLLOWED * period + memory, n_points // 4)) if n_steps is None else count(n_steps, "n_steps")
    )
    if n_points - steps < 4 * window + 100 or steps < memory + MIN_STEPS:
        raise RefusalError(
            f"{n_points} points are too few: {steps} steps are followed, and neighbours must be {window} samples apart",
            remedy=f"record at least {4 * (memory + window) + steps + 200} points or follow fewer steps",
        )
    return steps


def _comparable(portrait: PhasePortrait) -> FloatArray:
    """Return the points, in standard deviations of their axes unless all axes are the same quantity."""
    if portrait.kind == "delay embedding":
        return portrait.points
    return np.ascontiguousarray(portrait.points / np.where(portrait.extent > 0.0, portrait.extent, 1.0))


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator,unused-ignore]
def mean_log_distance(points, firsts, seconds, block, across, sums, counts):  # type: ignore[no-untyped-def]
    """Add ln|x(i + k) - x(j + k)| for all pairs i, j and steps k to sums[block, k], omitting zero distances.

    Points are the path in time, (n, d); `firsts` and `seconds` hold the pairs, with a sample before and after each
    step. With `across`, only the distance across the path counts: the component along x(i + k + 1) - x(i + k - 1) is
    removed.
    """
    d = points.shape[1]
    # One logarithm for the product of many squares, as long as the product is a normal number.
    products = np.ones(sums.shape)
    for r in range(firsts.shape[0]):
        i, j, b = firsts[r], seconds[r], block[r]
        for k in range(sums.shape[1]):
            square, along, speed = 0.0, 0.0, 0.0
            for a in range(d):
                difference = points[i + k, a] - points[j + k, a]
                square += difference * difference
                if across:
                    step = points[i + k + 1, a] - points[i + k - 1, a]
                    along += difference * step
                    speed += step * step
            if speed > 0.0:
                square -= along * along / speed
            if square > 0.0:
                product = products[b, k] * square
                if not 1e-280 < product < 1e280:
                    sums[b, k] += 0.5 * (np.log(products[b, k]) + np.log(square))
                    product = 1.0
                products[b, k] = product
                counts[b, k] += 1
    sums += 0.5 * np.log(products)


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator,unused-ignore]
def log_mean_distance(points, references, starts, near, block, sums, counts):  # type: ignore[no-untyped-def]
    """Add ln of the mean distance of a neighbourhood (Kantz) to sums[block, k].

    Neighbours of reference r are near[starts[r] : starts[r + 1]]; the distance is that of the last coordinate.
    """
    n, d = points.shape
    n_steps = sums.shape[1]
    for r in range(references.shape[0]):
        i, b = references[r], block[r]
        for k in range(min(n_steps, n - i)):
            total, m = 0.0, 0
            for q in range(starts[r], starts[r + 1]):
                j = near[q]
                if j + k < n:
                    total += abs(points[i + k, d - 1] - points[j + k, d - 1])
                    m += 1
            if m > 0 and total > 0.0:
                sums[b, k] += np.log(total / m)
                counts[b, k] += 1
