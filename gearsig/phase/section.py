"""Poincaré sections: the path once per cycle, or where it crosses a plane."""

from __future__ import annotations

import numpy as np

from gearsig.checks import FloatArray, count, frozen_array
from gearsig.errors import InputError, RefusalError
from gearsig.phase.lock import CycleLock
from gearsig.phase.types import PhasePortrait, PoincareSection


def locked_section(portrait: PhasePortrait, lock: CycleLock, *, phase_cycles: float = 0.0) -> PoincareSection:
    """Return the points of the path once per cycle of a mesh or a shaft.

    Values between the samples are interpolated band-limited (error below 5e-6 of full scale up to 0.4 of the sampling
    rate), at times from the exact inverse of the shaft angle: speed may vary.

    Parameters
    ----------
    portrait : PhasePortrait
        A periodic motion with the lock's period gives one point, one with twice the period two; a quasi-periodic one a
        closed curve.
    lock : CycleLock
        See `find_lock`.
    phase_cycles : float
        Where in the cycle the path is looked at.

    Raises
    ------
    RefusalError
        If no whole cycle lies in the portrait, or its samples are too coarse for the cycle.

    Notes
    -----
    Not for discontinuous states: an interpolated jump overshoots.

    Source: F. C. Moon, *Chaotic Vibrations* (1987), ch. 2 (Poincaré maps of forced motion).
    """
    from gearsig.angle.interpolation import REACH

    rate = portrait.sampling_rate_hz
    start = portrait.start_s + (REACH + 1) / rate
    end = portrait.end_s - (REACH + 1) / rate
    if end <= start:
        raise InputError(f"the portrait has {portrait.n_points} points", allowed=f"more than {2 * REACH + 2}")
    times = lock.times_s(start, end, phase_cycles)
    if len(times) == 0:
        raise RefusalError(
            f"the portrait from {portrait.start_s:.4g} to {portrait.end_s:.4g} s holds no whole cycle: {lock.name}",
            remedy="record longer or lock to something faster",
        )
    if len(times) > 1 and float(np.median(np.diff(times))) < 2.0 / rate:
        raise RefusalError(
            f"the {lock.name} is faster than two samples per cycle at {rate:g} Hz",
            remedy="lock to a slower shaft or sample faster",
        )
    points = _interpolated(portrait.points, (times - portrait.start_s) * rate)
    return _section(portrait, points, times, "locked", lock.name)


def geometric_section(
    portrait: PhasePortrait, *, normal: FloatArray | None = None, offset: float = 0.0, direction: int = 1
) -> PoincareSection:
    """Return the points where the path crosses the plane n·x = offset, upwards, downwards or both.

    The crossing is the root of the cubic through the four samples around it.

    Parameters
    ----------
    portrait : PhasePortrait
    normal : array, (n_axes,)
        Default: the last axis; in a phase plane, velocity zero upwards: the lowest displacements.
    offset : float
        In the unit of n·x.
    direction : int
        1: from below to above, -1: from above to below, 0: both.

    Raises
    ------
    InputError
        On a normal of another length or of zero.
    RefusalError
        If the path never crosses the plane.
    """
    if direction not in (-1, 0, 1):
        raise InputError(f"direction is {direction!r}", allowed="-1, 0, 1")
    n = np.eye(portrait.n_axes)[-1] if normal is None else frozen_array(normal, "normal", ndim=1)
    if len(n) != portrait.n_axes or not n.any():
        raise InputError(f"normal is {n.tolist()}", allowed=f"{portrait.n_axes} numbers, not all zero")
    distance = np.asarray(portrait.points @ n, dtype=np.float64) - offset
    before = _crossings(distance, direction)
    if len(before) == 0:
        raise RefusalError(
            f"the path never crosses the plane {n.tolist()}·x = {offset:g}; n·x runs from "
            f"{distance.min() + offset:.4g} to {distance.max() + offset:.4g}",
            remedy="put the plane through the path",
        )
    u = _cubic_roots(distance, before)
    weights = _lagrange(u)
    points = np.einsum("ki,kij->kj", weights, portrait.points[before[:, None] + np.arange(-1, 3)])
    times = portrait.start_s + (before + u) / portrait.sampling_rate_hz
    return _section(portrait, points, times, "geometric", f"{np.round(n, 6).tolist()}·x = {offset:g}")


def section_period(section: PoincareSection, *, longest: int = 16, tolerance: float = 0.05) -> int:
    """Return after how many crossings the section repeats itself; 0 if it does not within `longest`.

    The smallest p with median |xᵢ₊ₚ - xᵢ| / size ≤ tolerance, distances in standard deviations of the path's axes, that
    holds over half of the section as well: quasi-periodic motion that nearly closes creeps.

    Parameters
    ----------
    section : PoincareSection
        Of a steady operating condition; at least 2·longest points, or fewer for a shorter search.
    longest : int
    tolerance : float
        Above the scatter from noise, below the distance of the branches that are to be told apart.
    """
    count(longest, "longest")
    x = section.points / np.where(section.extent > 0.0, section.extent, 1.0)
    half = section.n_points // 2
    for p in range(1, min(longest, half) + 1):
        if _return_distance(x, p) <= tolerance and _return_distance(x, half // p * p) <= tolerance:
            return p
    return 0


def _return_distance(x: FloatArray, lag: int) -> float:
    return float(np.median(np.linalg.norm(x[lag:] - x[:-lag], axis=1)))


def _interpolated(points: FloatArray, positions: FloatArray) -> FloatArray:
    from gearsig.angle.interpolation import delay_table, doubling_filter, interpolate

    found = np.empty((len(positions), points.shape[1]))
    for axis in range(points.shape[1]):
        x = np.ascontiguousarray(points[:, axis], dtype=np.float64)
        # The mean is kept apart: what is left is interpolated with an error relative to the motion, not to the mean.
        mean = float(x.mean())
        values = np.empty(len(positions))
        interpolate(x - mean, positions, doubling_filter(), delay_table(), values)
        found[:, axis] = values + mean
    return found


def _section(
    portrait: PhasePortrait, points: FloatArray, times: FloatArray, kind: str, section: str
) -> PoincareSection:
    return PoincareSection(
        points,
        times,
        portrait.axis_names,
        portrait.units,
        portrait.extent,
        "locked" if kind == "locked" else "geometric",
        section,
        portrait.source,
    )


def _crossings(distance: FloatArray, direction: int) -> np.ndarray:
    """Indices of the samples before a change of sign that have one more on either side."""
    above = distance >= 0.0
    change = above[1:].astype(np.int8) - above[:-1].astype(np.int8)
    wanted = change != 0 if direction == 0 else change == direction
    before = np.flatnonzero(wanted)
    return before[(before >= 1) & (before + 2 < len(distance))]


def _cubic_roots(distance: FloatArray, before: np.ndarray) -> FloatArray:
    """Where between the two middle samples the cubic through four is zero, by bisection."""
    d = distance[before[:, None] + np.arange(-1, 3)]
    low, high = np.zeros(len(before)), np.ones(len(before))
    rising = d[:, 2] > d[:, 1]
    for _ in range(52):
        middle = 0.5 * (low + high)
        value = np.einsum("ki,ki->k", _lagrange(middle), d)
        below = (value < 0.0) == rising
        low, high = np.where(below, middle, low), np.where(below, high, middle)
    return 0.5 * (low + high)


def _lagrange(u: FloatArray) -> FloatArray:
    """Weights of the samples at -1, 0, 1, 2 for the value at u, (n, 4)."""
    return np.column_stack(
        [
            -u * (u - 1.0) * (u - 2.0) / 6.0,
            (u + 1.0) * (u - 1.0) * (u - 2.0) / 2.0,
            -(u + 1.0) * u * (u - 2.0) / 2.0,
            (u + 1.0) * u * (u - 1.0) / 6.0,
        ]
    )
