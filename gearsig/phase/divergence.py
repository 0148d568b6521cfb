"""Divergence curves: the mean logarithm of the distance of neighbours over time."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gearsig.checks import FloatArray
from gearsig.errors import RefusalError
from gearsig.phase.neighbours import IndexArray, nearest_apart, spaced

N_LIBRARY, N_REFERENCES, N_BLOCKS = 100_000, 4_000, 12
MOST_NEIGHBOURS = 10
N_UNRELATED = 20_000


@dataclass(frozen=True)
class Divergence:
    """Divergence curve, and the same from each stretch of the signal.

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
    """Return S(k) = mean over i of ln |x(i + k) - x(j(i) + k)|, j(i) the nearest neighbour of i.

    With `across` the distance is taken across the path: along it nothing diverges, and where a coarsely sampled path
    makes most of a neighbour's distance lie along it, the slope comes out too small.

    Source: M. T. Rosenstein, J. J. Collins, C. J. De Luca, *A practical method for calculating largest Lyapunov
    exponents from small data sets*, Physica D 65 (1993).
    """
    from gearsig.phase.divergence_kernel import mean_log_distance

    library, references = _library(points, n_steps)
    _, near = nearest_apart(points, library, references, theiler)
    references, near = references[near >= 0], near[near >= 0]
    block = _blocks(references, len(points))
    sums, counts = np.zeros((N_BLOCKS, n_steps)), np.zeros((N_BLOCKS, n_steps))
    mean_log_distance(points, references, near, block, across, sums, counts)
    return _curve(sums, counts, _unrelated(points, theiler, last_axis=False), len(references))


def kantz(points: FloatArray, theiler: int, n_steps: int) -> Divergence:
    """Return S(k) = mean over i of ln of the mean over i's neighbourhood of |x(i + k) - x(j + k)|, last coordinate.

    The neighbourhood holds the 10 nearest library points that are apart in time, so that the radius suits the density.

    Source: H. Kantz, *A robust method to estimate the maximal Lyapunov exponent of a time series*, Physics Letters A
    185 (1994).
    """
    from scipy.spatial import cKDTree

    from gearsig.phase.divergence_kernel import log_mean_distance

    library, references = _library(points, n_steps)
    k = min(4 * MOST_NEIGHBOURS, len(library))
    _, found = cKDTree(np.ascontiguousarray(points[library])).query(np.ascontiguousarray(points[references]), k=k)
    near = library[found]
    apart = np.abs(near - references[:, None]) > theiler
    apart &= np.cumsum(apart, axis=1) <= MOST_NEIGHBOURS
    per_reference = apart.sum(axis=1)
    used = per_reference >= MOST_NEIGHBOURS // 3
    if np.count_nonzero(used) < len(references) // 2:
        raise RefusalError("the path hardly ever comes back to where it was", remedy="record longer")
    starts = np.concatenate([[0], np.cumsum(per_reference[used])])
    block = _blocks(references[used], len(points))
    sums, counts = np.zeros((N_BLOCKS, n_steps)), np.zeros((N_BLOCKS, n_steps))
    log_mean_distance(points, references[used], starts, near[used][apart[used]], block, sums, counts)
    return _curve(sums, counts, _unrelated(points, theiler, last_axis=True), int(np.count_nonzero(used)))


def _library(points: FloatArray, n_steps: int) -> tuple[IndexArray, IndexArray]:
    """Points that can be followed for all steps: a mean over ever fewer pairs would bend the curve."""
    n = len(points) - n_steps - 2
    return 1 + spaced(n, N_LIBRARY), 1 + spaced(n, N_REFERENCES)


def _blocks(references: IndexArray, n: int) -> IndexArray:
    return np.minimum(references * N_BLOCKS // n, N_BLOCKS - 1)


def _unrelated(points: FloatArray, theiler: int, *, last_axis: bool) -> float:
    """Mean logarithm of the distance of points far apart in time: pairs by the golden ratio, spread over all delays."""
    n = len(points)
    here = spaced(n, N_UNRELATED)
    there = (here + 1 + theiler + ((np.arange(len(here)) * 0.6180339887498949) % 1.0 * (n - 2 * theiler - 2))) % n
    difference = points[here] - points[there.astype(np.intp)]
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
