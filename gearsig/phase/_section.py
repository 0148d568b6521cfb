"""Poincaré sections, once per cycle or where the path crosses a plane, and bifurcation diagrams of their points."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
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
from gearsig.checks import FloatArray, count, freeze, frozen_array, instance_of, number, positive, read_only
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
        Interpolated between the samples, in chronological order.
    times_s : array, (n_points,)
    axis_names, units : tuples of str
    extent : array, (n_axes,)
        Standard deviation of the whole path along each axis.
    kind : str
        "locked": once per cycle of a mesh or a shaft; "geometric": where the path crosses a plane.
    section : str
        The cycle it is locked to, or the plane.
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
        """Number of points."""
        return int(self.points.shape[0])


@dataclass(frozen=True)
class CycleLock:
    """A shaft angle and the number of cycles per revolution.

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
        """Return the times in s between `start_s` and `end_s` at which the cycle's phase is `phase_cycles`, (n,).

        The angle's piecewise cubic is inverted exactly.

        Raises
        ------
        RefusalError
            If the angle is not known at any time in this range.
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
        Give at most one; without either, the reference shaft is used.
    rig : Rig, optional
        Default: the recording's rig.
    angle : ShaftAngle, optional
        Of the rig's reference shaft; default: found from the recording, see `find_shaft_angle`.

    Raises
    ------
    InputError
        If both are named, or the rig does not have it.
    RefusalError
        If there is no shaft angle, or the teeth that lead to the pair or shaft are not known: a section without a
        period is meaningless.
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
    """Return the lock to a known constant period, from time zero to `end_s`."""
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
    """Raise unless the value is a lock, or None if none is needed."""
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

    With a lock, band-limited interpolation gives the values between samples (error below 5e-6 of full scale up to 0.4
    of the sampling rate), at times from the exact inverse of the shaft angle, so the speed may vary. Without a lock,
    the crossing is the root of the cubic through the four samples around it.

    Parameters
    ----------
    portrait : PhasePortrait
        A periodic motion with the lock's period gives one point, one with twice the period two points; a quasi-periodic
        motion gives a closed curve.
    lock : CycleLock or None
        See `find_lock`; None uses the plane.
    phase_cycles : float
        Phase of the lock's cycle at which points are taken.
    normal : array, (n_axes,), or None
        Normal of the plane. None: the last axis; in a phase plane this is velocity rising through zero, i.e. the
        minimum displacements.
    offset : float
        In the unit of n·x.
    direction : int
        1: from below the plane to above, -1: from above to below, 0: both.

    Raises
    ------
    InputError
        On a normal of wrong length or zero, or a normal given together with a lock.
    RefusalError
        If no whole cycle lies in the portrait, its samples are too coarse for the cycle, or it never crosses the plane.

    Notes
    -----
    Do not use a lock with discontinuous states: an interpolated jump overshoots.

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
    distance = np.asarray(portrait.points @ n, dtype=np.float64) - number(offset, "offset")
    # Samples before a change of sign, with one more sample on either side.
    change = np.diff((distance >= 0.0).astype(np.int8))
    before = np.flatnonzero(change != 0 if direction == 0 else change == direction)
    before = before[(before >= 1) & (before + 2 < len(distance))]
    if len(before) == 0:
        raise RefusalError(
            f"the path never crosses the plane {n.tolist()}·x = {offset:g}; n·x runs from "
            f"{distance.min() + offset:.4g} to {distance.max() + offset:.4g}",
            remedy="choose a plane that the path crosses",
        )
    u = _cubic_roots(distance, before)
    weights = _lagrange(u)
    points = np.einsum("ki,kij->kj", weights, portrait.points[before[:, None] + np.arange(-1, 3)])
    times = portrait.start_s + (before + u) / portrait.sampling_rate_hz
    names, units, extent = portrait.axis_names, portrait.units, portrait.extent
    plane = f"{np.round(n, 6).tolist()}·x = {offset:g}"
    return PoincareSection(points, times, names, units, extent, "geometric", plane, portrait.source)


def section_period(section: PoincareSection, *, longest: int = 16, tolerance: float = 0.05) -> int:
    """Return the number of points after which the section repeats; 0 if it does not repeat within `longest`.

    It is the smallest p with median |xᵢ₊ₚ - xᵢ| ≤ tolerance, in standard deviations of the path's axes, that also holds
    at a lag of about half the section, since quasi-periodic motion that nearly closes drifts slowly.

    Parameters
    ----------
    section : PoincareSection
        At a steady operating condition, with at least 2·longest points; with fewer, the search is shorter.
    longest : int
    tolerance : float
        Above the scatter from noise, below the distance of the branches to be distinguished.
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
    """Return points of a band-limited path between its samples, (n, n_axes).

    Parameters
    ----------
    points : array, (n_points, n_axes)
        Band-limited to below 0.4 of the sampling rate.
    positions : array, (n,)
        In samples, sorted, at least `gearsig.angle.REACH` from either end.
    """
    points_at = np.empty((len(positions), points.shape[1]))
    for axis in range(points.shape[1]):
        x = np.ascontiguousarray(points[:, axis], dtype=np.float64)
        # The mean is treated separately, so that the interpolation error is relative to the motion, not to the mean.
        mean = float(x.mean())
        values = np.empty(len(positions))
        interpolate(read_only(x - mean), positions, doubling_filter(), delay_table(), values)
        points_at[:, axis] = values + mean
    return points_at


def _cubic_roots(distance: FloatArray, before: np.ndarray) -> FloatArray:
    """Return the zero, between 0 and 1, of the cubic through four samples between the middle two, by bisection."""
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
    """Return the weights of the samples at -1, 0, 1, 2 for the value at u, (n, 4)."""
    return np.column_stack(
        [
            -u * (u - 1.0) * (u - 2.0) / 6.0,
            (u + 1.0) * (u - 1.0) * (u - 2.0) / 2.0,
            -(u + 1.0) * u * (u - 2.0) / 2.0,
            (u + 1.0) * u * (u - 1.0) / 6.0,
        ]
    )


# --------------------
# Bifurcation diagrams: points over speed, load, roughness, backlash, or any other varied parameter.
# --------------------


@dataclass(frozen=True)
class BifurcationDiagram(Result, columns=("parameter", "points")):
    """One coordinate of the Poincaré points over a parameter.

    Parameters
    ----------
    parameter : array, (n_points,)
        Value of the parameter for each point, ascending.
    points : array, (n_points,)
    parameter_name, parameter_unit, axis_name, unit : str
    values : array, (n_values,)
        The parameter values that have points, ascending.
    periods : tuple of int, (n_values,)
        Cycles after which the section repeats at each value; 0 if it does not repeat within the longest tested.
    section : str
    extents : array, (n_values,)
        Standard deviation of the whole path along the plotted axis at each value; empty if not known.
    """

    parameter: FloatArray
    points: FloatArray
    parameter_name: str
    parameter_unit: str
    axis_name: str
    unit: str
    values: FloatArray
    periods: tuple[int, ...]
    section: str
    extents: FloatArray = field(default_factory=lambda: np.empty(0))

    def __post_init__(self) -> None:
        freeze(self, "parameter", "points", "values", "extents")
        if len(self.parameter) != len(self.points) or len(self.values) != len(self.periods):
            raise InputError(f"{len(self.parameter)} parameter values for {len(self.points)} points")
        if len(self.extents) not in (0, len(self.values)):
            raise InputError(f"{len(self.extents)} extents for {len(self.values)} values")


DIFFERS = 0.1
"""Two branches are distinct if their sizes differ by more than this share."""


def bifurcation_diagram(
    sections: Iterable[tuple[float, PoincareSection]],
    *,
    parameter: str,
    unit: str = "",
    axis: int = 0,
    max_points: int = 400,
    tolerance: float = 0.05,
) -> BifurcationDiagram:
    """Return the bifurcation diagram of one coordinate of Poincaré sections over a parameter.

    Parameters
    ----------
    sections : iterable of (value, PoincareSection)
        In any order, consumed one by one; only the points are kept. Axes must have the same meaning in all.
    parameter, unit : str
        E.g. "speed", "rpm".
    axis : int
        Coordinate to plot.
    max_points : int
        Only the last `max_points` points of each section are kept, as the first may still be a transient.
    tolerance : float
        See `section_period`.

    Raises
    ------
    InputError
        If there is no section, an axis is missing, or the sections' axes or units differ.
    """
    count(max_points, "max_points")
    kept: list[tuple[float, FloatArray, int, float]] = []
    first: PoincareSection | None = None
    for value, section in sections:
        first = section if first is None else first
        if not 0 <= axis < len(first.axis_names):
            raise InputError(f"axis is {axis}", allowed=f"0 to {len(first.axis_names) - 1}")
        if (section.axis_names, section.units) != (first.axis_names, first.units):
            raise InputError(
                f"sections differ in their axes: {section.axis_names} in {section.units}, "
                f"{first.axis_names} in {first.units}",
                remedy="take all of them from the same quantity in the same unit",
            )
        if not np.isfinite(value):
            raise InputError(f"{parameter} is {value}", allowed="finite numbers")
        period = section_period(section, tolerance=tolerance)
        kept.append((float(value), np.array(section.points[-max_points:, axis]), period, float(section.extent[axis])))
    if first is None:
        raise InputError("there are no sections", remedy="give at least one value of the parameter")
    kept.sort(key=lambda entry: entry[0])
    return BifurcationDiagram(
        parameter=np.concatenate([np.full(len(points), value) for value, points, _, _ in kept]),
        points=np.concatenate([points for _, points, _, _ in kept]),
        parameter_name=parameter,
        parameter_unit=unit,
        axis_name=first.axis_names[axis],
        unit=first.units[axis],
        values=np.array([value for value, _, _, _ in kept]),
        periods=tuple(period for _, _, period, _ in kept),
        section=first.section if first.kind == "geometric" else first.section.split(" of ")[0],
        extents=np.array([extent for _, _, _, extent in kept]),
    )


def coexistence_values(up: BifurcationDiagram, down: BifurcationDiagram, *, differs: float = DIFFERS) -> FloatArray:
    """Return the parameter values at which two branches differ, (n,): coexisting attractors, hysteresis.

    They differ if |s_up − s_down| > `differs` max(s_up, s_down), with s the standard deviation of the path along the
    plotted axis.

    Parameters
    ----------
    up, down : BifurcationDiagram
        Of the same parameter; values in only one of them are skipped.
    differs : float
        Relative difference above which two motions count as different.

    Raises
    ------
    InputError
        If the extents are not known, or the diagrams show different quantities.
    """
    if (up.parameter_name, up.axis_name, up.unit) != (down.parameter_name, down.axis_name, down.unit):
        raise InputError(f"diagrams of {up.axis_name} and {down.axis_name}", allowed="two of the same quantity")
    if len(up.extents) != len(up.values) or len(down.extents) != len(down.values):
        raise InputError("a diagram without extents", remedy="make it with bifurcation_diagram")
    values, i_up, i_down = np.intersect1d(up.values, down.values, return_indices=True)
    a, b = up.extents[i_up], down.extents[i_down]
    apart: FloatArray = values[np.abs(a - b) > differs * np.maximum(a, b)]
    return apart


@dataclass(frozen=True)
class TwoMotions:
    """A range of neighbouring parameter values at which two branches differ.

    Parameters
    ----------
    first, last : float
        The lowest and highest of these values.
    low, high : float
        Halfway to the values where the branches agree, at most half a step of the sweep further.
    begins_with_sweep, ends_with_sweep : bool
        Whether the range reaches an end of the sweep, and so may continue beyond it.
    """

    first: float
    last: float
    low: float
    high: float
    begins_with_sweep: bool
    ends_with_sweep: bool


def coexistence_ranges(
    up: BifurcationDiagram, down: BifurcationDiagram, *, differs: float = DIFFERS
) -> tuple[TwoMotions, ...]:
    """Return the ranges in which two motions coexist, ascending; see `coexistence_values` for the criterion.

    The limits of a range are known only to half a step, and its width depends on the sweep, which must go far enough
    for each motion to be lost.

    Raises
    ------
    InputError
        As `coexistence_values`.
    """
    values = np.intersect1d(up.values, down.values)
    apart = np.isin(values, coexistence_values(up, down, differs=differs))
    steps = np.diff(np.concatenate([[False], apart, [False]]).astype(int))
    half = 0.5 * step_of(up, down)
    ranges = []
    for start, stop in zip(np.flatnonzero(steps == 1), np.flatnonzero(steps == -1) - 1, strict=True):
        first, last = float(values[start]), float(values[stop])
        at_start, at_end = bool(start == 0), bool(stop == len(values) - 1)
        low = first if at_start else first - min(half, 0.5 * (first - float(values[start - 1])))
        high = last if at_end else last + min(half, 0.5 * (float(values[stop + 1]) - last))
        ranges.append(TwoMotions(first, last, low, high, at_start, at_end))
    return tuple(ranges)


def step_of(up: BifurcationDiagram, down: BifurcationDiagram) -> float:
    """Return the median step between the values common to both branches; 0 for a single value."""
    values = np.intersect1d(up.values, down.values)
    return float(np.median(np.diff(values))) if len(values) > 1 else 0.0
