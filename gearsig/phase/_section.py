"""Poincaré sections: the path once per cycle, or where it crosses a plane."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from gearsig.angle import (
    REACH,
    ShaftAngle,
    check_shaft_angle,
    delay_table,
    doubling_filter,
    find_shaft_angle,
    interpolate,
    times_of_revolutions,
)
from gearsig.checks import FloatArray, count, freeze, frozen_array, instance_of, positive, read_only
from gearsig.errors import InputError, RefusalError
from gearsig.phase._plane import PhasePortrait, check_portrait
from gearsig.recording import Recording, check_recording
from gearsig.results import Result
from gearsig.rig import Rig, check_rig


@dataclass(frozen=True)
class PoincareSection(Result, matrix=("points", "times_s", "axis_names")):
    """Points at which a path meets its section.

    Parameters
    ----------
    points : array, (n_points, n_axes)
        Interpolated between the samples, in the order of time.
    times_s : array, (n_points,)
    axis_names, units : tuples of str
    extent : array, (n_axes,)
        Standard deviation of the whole path along each axis.
    kind : str
        "locked": once per cycle of a mesh or a shaft; "geometric": where the path crosses a plane.
    section : str
        What it is locked to, or the plane.
    source : str
    """

    points: FloatArray
    times_s: FloatArray
    axis_names: tuple[str, ...]
    units: tuple[str, ...]
    extent: FloatArray
    kind: Literal["locked", "geometric"]
    section: str
    source: str

    def __post_init__(self) -> None:
        freeze(self, "points", ndim=2)
        freeze(self, "times_s", "extent")
        if len(self.points) != len(self.times_s) or self.points.shape[1] != len(self.extent):
            raise InputError(f"points of shape {self.points.shape} for {len(self.times_s)} times")

    @property
    def n_points(self) -> int:
        """Crossings."""
        return int(self.points.shape[0])


@dataclass(frozen=True)
class CycleLock:
    """A shaft angle, and how many cycles make one of its revolutions.

    Parameters
    ----------
    angle : ShaftAngle
    cycles_per_revolution : float
        1 for the shaft itself, the mesh order for a gear pair, 1/2 for every second revolution.
    name : str
        E.g. "mesh of stage 1".
    """

    angle: ShaftAngle
    cycles_per_revolution: float
    name: str

    def __post_init__(self) -> None:
        positive(self.cycles_per_revolution, "cycles_per_revolution")

    def times_s(self, start_s: float, end_s: float, phase_cycles: float = 0.0) -> FloatArray:
        """Return the times between `start_s` and `end_s` at which a cycle is `phase_cycles` old, (n,).

        The angle's piecewise cubic is inverted exactly.

        Raises
        ------
        RefusalError
            If the angle is known in no part of that time.
        """
        part = self.angle.between(start_s, end_s)
        first = np.ceil(part.revolutions[0] * self.cycles_per_revolution - phase_cycles)
        last = np.floor(part.revolutions[-1] * self.cycles_per_revolution - phase_cycles)
        per_cycle = 1.0 / self.cycles_per_revolution
        return times_of_revolutions(part, (first + phase_cycles) * per_cycle, per_cycle, max(int(last - first) + 1, 0))


def find_lock(
    recording: Recording, *, pair: str = "", shaft: str = "", rig: Rig | None = None, angle: ShaftAngle | None = None
) -> CycleLock:
    """Return the lock to a gear pair's mesh cycles or to a shaft's revolutions.

    Parameters
    ----------
    recording : Recording
    pair, shaft : str
        One of them; neither: the reference shaft.
    rig : Rig, optional
        Default: the recording's own.
    angle : ShaftAngle, optional
        Of the rig's reference shaft; default: found from the recording, see `find_shaft_angle`.

    Raises
    ------
    InputError
        If both are named, or one that the rig does not have.
    RefusalError
        If there is no shaft angle, or the teeth that lead to the pair or shaft are not known: a section without a
        period means nothing.
    """
    check_recording(recording)
    check_rig(rig)
    rig = rig if rig is not None else recording.rig
    if pair and shaft:
        raise InputError(f"both pair {pair!r} and shaft {shaft!r} are given", allowed="one of them")
    if (pair or shaft) and rig is None:
        raise InputError(
            f"the recording has no rig, so {pair or shaft!r} is not known", remedy="give rig=, or lock to angle alone"
        )
    cycles, name = _cycles(rig, pair, shaft)
    if angle is not None:
        check_shaft_angle(angle, "angle")
    shaft_angle = angle if angle is not None else find_shaft_angle(recording, rig)
    return CycleLock(shaft_angle, cycles, name)


def constant_period_lock(period_s: float, end_s: float, name: str = "period") -> CycleLock:
    """Return the lock to a constant, known period, from time zero to `end_s`."""
    rate = 1.0 / positive(period_s, "period_s", "s")
    ends = np.array([0.0, positive(end_s, "end_s", "s")])
    angle = ShaftAngle(name, ends, ends * rate, np.full(2, rate), "constant")
    return CycleLock(angle, 1.0, f"{name} of {period_s:.6g} s")


def _cycles(rig: Rig | None, pair: str, shaft: str) -> tuple[float, str]:
    if rig is None:
        return 1.0, "revolution of the shaft"
    if pair:
        order, name = rig.mesh_order(rig.pair(pair)), f"mesh of {pair}"
    else:
        shaft = shaft or rig.reference_shaft
        order, name = (rig.ratio(shaft) if shaft else 1.0), f"revolution of {shaft or 'the shaft'}"
    if order is None:
        raise RefusalError(
            f"the period of the {name} is not known: tooth counts on the way from shaft {rig.reference_shaft!r} are "
            "missing",
            remedy="complete the teeth in the rig file",
        )
    return order, name


def check_lock(value: object, *, needed: bool = False) -> None:
    """Raise unless the value is a lock, or None where none is needed."""
    remedy = "gearsig.phase.find_lock(recording) finds one"
    instance_of(value, CycleLock if needed else CycleLock | None, "lock", remedy=remedy)


def poincare_section(
    portrait: PhasePortrait,
    lock: CycleLock | None = None,
    *,
    phase_cycles: float = 0.0,
    normal: FloatArray | None = None,
    offset: float = 0.0,
    direction: int = 1,
) -> PoincareSection:
    """Return the points of a path once per cycle of a mesh or a shaft, or where it crosses the plane n·x = offset.

    With a lock, values between the samples are interpolated band-limited (error below 5e-6 of full scale up to 0.4 of
    the sampling rate), at times from the exact inverse of the shaft angle: speed may vary. Without, the crossing is the
    root of the cubic through the four samples around it.

    Parameters
    ----------
    portrait : PhasePortrait
        A periodic motion with the lock's period gives one point, one with twice the period two; a quasi-periodic one a
        closed curve.
    lock : CycleLock or None
        See `find_lock`; None: the plane.
    phase_cycles : float
        Where in the lock's cycle the path is looked at.
    normal : array, (n_axes,), or None
        Of the plane; None: the last axis; in a phase plane, velocity zero upwards: the lowest displacements.
    offset : float
        In the unit of n·x.
    direction : int
        1: from below the plane to above, -1: from above to below, 0: both.

    Raises
    ------
    InputError
        On a normal of another length or of zero, or one beside a lock.
    RefusalError
        If no whole cycle lies in the portrait, its samples are too coarse for the cycle, or it never crosses the plane.

    Notes
    -----
    A lock is not for discontinuous states: an interpolated jump overshoots.

    Source: F. C. Moon, *Chaotic Vibrations* (1987), ch. 2 (Poincaré maps of forced motion).
    """
    check_portrait(portrait)
    check_lock(lock)
    if lock is None:
        return _geometric_section(portrait, normal, offset, direction)
    if normal is not None:
        raise InputError("a lock and a plane are given", where="lock, normal", remedy="give one of them")
    return _locked_section(portrait, lock, phase_cycles)


def _locked_section(portrait: PhasePortrait, lock: CycleLock, phase_cycles: float) -> PoincareSection:
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
    points = points_between(portrait.points, (times - portrait.start_s) * rate)
    names, units, extent = portrait.axis_names, portrait.units, portrait.extent
    return PoincareSection(points, times, names, units, extent, "locked", lock.name, portrait.source)


def _geometric_section(
    portrait: PhasePortrait, normal: FloatArray | None, offset: float, direction: int
) -> PoincareSection:
    if direction not in (-1, 0, 1):
        raise InputError(f"direction is {direction!r}", allowed="-1, 0, 1")
    n = np.eye(portrait.n_axes)[-1] if normal is None else frozen_array(normal, "normal", ndim=1)
    if len(n) != portrait.n_axes or not n.any():
        raise InputError(f"normal is {n.tolist()}", allowed=f"{portrait.n_axes} numbers, not all zero")
    distance = np.asarray(portrait.points @ n, dtype=np.float64) - offset
    # The samples before a change of sign that have one more on either side.
    change = np.diff((distance >= 0.0).astype(np.int8))
    before = np.flatnonzero(change != 0 if direction == 0 else change == direction)
    before = before[(before >= 1) & (before + 2 < len(distance))]
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
    names, units, extent = portrait.axis_names, portrait.units, portrait.extent
    plane = f"{np.round(n, 6).tolist()}·x = {offset:g}"
    return PoincareSection(points, times, names, units, extent, "geometric", plane, portrait.source)


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
    instance_of(section, PoincareSection, "section", remedy="gearsig.poincare_section(portrait) makes one")
    count(longest, "longest")
    x = section.points / np.where(section.extent > 0.0, section.extent, 1.0)
    half = section.n_points // 2
    for p in range(1, min(longest, half) + 1):
        if _return_distance(x, p) <= tolerance and _return_distance(x, half // p * p) <= tolerance:
            return p
    return 0


def _return_distance(x: FloatArray, lag: int) -> float:
    return float(np.median(np.linalg.norm(x[lag:] - x[:-lag], axis=1)))


def points_between(points: FloatArray, positions: FloatArray) -> FloatArray:
    """Return the points of a path of limited band between its samples, (n, n_axes).

    Parameters
    ----------
    points : array, (n_points, n_axes)
        Its band ends below 0.4 of the sampling rate.
    positions : array, (n,)
        In samples, sorted, at least `gearsig.angle.REACH` from either end.
    """
    points_at = np.empty((len(positions), points.shape[1]))
    for axis in range(points.shape[1]):
        x = np.ascontiguousarray(points[:, axis], dtype=np.float64)
        # The mean is kept apart: what is left is interpolated with an error relative to the motion, not to the mean.
        mean = float(x.mean())
        values = np.empty(len(positions))
        interpolate(read_only(x - mean), positions, doubling_filter(), delay_table(), values)
        points_at[:, axis] = values + mean
    return points_at


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
