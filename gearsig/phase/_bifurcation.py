"""Bifurcation diagrams: Poincaré points over speed, load, roughness, backlash, or anything else that is varied."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np

from gearsig.checks import FloatArray, count, frozen_array, not_negative, one_of
from gearsig.errors import InputError
from gearsig.phase._plane import phase_plane
from gearsig.phase._section import CycleLock, constant_period_lock, find_lock, poincare_section, section_period
from gearsig.phase._types import BifurcationDiagram, PhasePortrait, PoincareSection
from gearsig.recording import Recording

Run = Callable[[float], tuple[FloatArray, float | CycleLock]]
"""From a value of the parameter to a time series, (n,) or (n, n_axes), and the period in s or what it is locked to."""

DIFFERS = 0.1
"""Two branches are apart where their sizes differ by more than this share."""


def bifurcation_diagram(
    sections: Iterable[tuple[float, PoincareSection]],
    *,
    parameter: str,
    unit: str = "",
    axis: int = 0,
    max_points: int = 400,
    tolerance: float = 0.05,
) -> BifurcationDiagram:
    """Return the diagram of one coordinate of Poincaré sections over the parameter they were taken at.

    Parameters
    ----------
    sections : iterable of (value, PoincareSection)
        In any order, consumed one by one: nothing but the points is kept. The same axis must mean the same in all.
    parameter, unit : str
        E.g. "speed", "rpm".
    axis : int
        Coordinate that is drawn.
    max_points : int
        The last so many points of each section are kept: what comes first may still be a transient.
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
        _check_alike(first, section, axis)
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


def bifurcation_of_recordings(
    recordings: Iterable[tuple[float, Recording]],
    channel: str,
    *,
    parameter: str,
    unit: str = "",
    low_cut_hz: float | None = None,
    pair: str = "",
    shaft: str = "",
    axis: int = 0,
    phase_cycles: float = 0.0,
    max_points: int = 400,
    tolerance: float = 0.05,
) -> BifurcationDiagram:
    """Return the diagram of a channel's displacement (axis 0) or velocity (axis 1), once per mesh cycle or revolution.

    Parameters
    ----------
    recordings : iterable of (value, Recording)
        A generator is fine: one recording is held at a time.
    channel : str
        Measures acceleration, velocity or displacement; see `phase_plane` for `low_cut_hz`.
    parameter, unit, axis, max_points, tolerance
        As in `bifurcation_diagram`.
    pair, shaft, phase_cycles
        What the sections are locked to; see `find_lock`, `poincare_section`.
    """

    def sections() -> Iterable[tuple[float, PoincareSection]]:
        for value, recording in recordings:
            portrait = phase_plane(recording, channel, low_cut_hz=low_cut_hz)
            lock = find_lock(recording, pair=pair, shaft=shaft)
            yield value, poincare_section(portrait, lock, phase_cycles=phase_cycles)

    return bifurcation_diagram(
        sections(), parameter=parameter, unit=unit, axis=axis, max_points=max_points, tolerance=tolerance
    )


def bifurcation_of_runs(
    run: Run,
    values: Iterable[float],
    sampling_rate_hz: float,
    *,
    parameter: str,
    unit: str = "",
    axis: int = 0,
    axis_names: tuple[str, ...] = ("displacement", "velocity"),
    units: tuple[str, ...] = ("m", "m/s"),
    transient_s: float = 0.0,
    direction: str = "up",
    max_points: int = 400,
    tolerance: float = 0.05,
) -> BifurcationDiagram:
    """Return the diagram of a model: `run` makes the time series and its period at each value of the parameter.

    Parameters
    ----------
    run : callable
        value → (series, period_s or lock); the series (n,) or (n, n_axes) starts at time zero. Called in the order of
        `direction`, so that one that goes on from its last state shows hysteresis.
    values : iterable of float
    sampling_rate_hz : float
        Of all series.
    axis_names, units : tuples of str
        As many as the series has axes; for a single axis the first of each is taken.
    transient_s : float
        Left out at the start of each series.
    direction : str
        "up": ascending values, "down": descending, "as given".
    parameter, unit, axis, max_points, tolerance
        As in `bifurcation_diagram`.
    """
    one_of(direction, "direction", ("up", "down", "as given"))
    not_negative(transient_s, "transient_s", "s")
    ordered = [float(v) for v in values]
    if direction != "as given":
        ordered.sort(reverse=direction == "down")

    def sections() -> Iterable[tuple[float, PoincareSection]]:
        for value in ordered:
            series, period = run(value)
            portrait = _steady(series, sampling_rate_hz, transient_s, axis_names, units)
            end_s = portrait.end_s + 1.0 / sampling_rate_hz
            lock = period if isinstance(period, CycleLock) else constant_period_lock(period, end_s)
            yield value, poincare_section(portrait, lock)

    return bifurcation_diagram(
        sections(), parameter=parameter, unit=unit, axis=axis, max_points=max_points, tolerance=tolerance
    )


def values_apart(up: BifurcationDiagram, down: BifurcationDiagram, *, differs: float = DIFFERS) -> FloatArray:
    """Return the values at which two branches hold different motions, (n,): coexisting attractors, hysteresis.

    |s_up − s_down| > 0.1 max(s_up, s_down), with s the standard deviation of the path along the drawn axis.

    Parameters
    ----------
    up, down : BifurcationDiagram
        Of the same parameter; values that only one of them has are passed over.
    differs : float
        The share.

    Raises
    ------
    InputError
        If the extents are not known, or the diagrams are of different things.
    """
    if (up.parameter_name, up.axis_name, up.unit) != (down.parameter_name, down.axis_name, down.unit):
        raise InputError(f"diagrams of {up.axis_name} and {down.axis_name}", allowed="two of the same quantity")
    if len(up.extents) != len(up.values) or len(down.extents) != len(down.values):
        raise InputError("a diagram without extents", remedy="make it with bifurcation_diagram")
    values, one, other = np.intersect1d(up.values, down.values, return_indices=True)
    a, b = up.extents[one], down.extents[other]
    apart: FloatArray = values[np.abs(a - b) > differs * np.maximum(a, b)]
    return apart


def _steady(
    series: FloatArray, rate: float, transient_s: float, names: tuple[str, ...], units: tuple[str, ...]
) -> PhasePortrait:
    array = np.asarray(series)
    states = frozen_array(array if array.ndim == 2 else array[:, None], "series", ndim=2)
    n_left = round(transient_s * rate)
    if states.shape[0] - n_left < 2:
        raise InputError(f"the series lasts {states.shape[0] / rate:.4g} s", allowed=f"more than {transient_s:g} s")
    d = states.shape[1]
    if len(names) < d or len(units) < d:
        raise InputError(f"{len(names)} axis names and {len(units)} units for {d} axes")
    return PhasePortrait(states[n_left:], rate, names[:d], units[:d], "states", "model", start_s=n_left / rate)


def _check_alike(first: PoincareSection, section: PoincareSection, axis: int) -> None:
    if not 0 <= axis < len(first.axis_names):
        raise InputError(f"axis is {axis}", allowed=f"0 to {len(first.axis_names) - 1}")
    if (section.axis_names, section.units) != (first.axis_names, first.units):
        raise InputError(
            f"sections differ in their axes: {section.axis_names} in {section.units}, "
            f"{first.axis_names} in {first.units}",
            remedy="take all of them from the same quantity in the same unit",
        )


# --------------------
# Where two branches of a bifurcation diagram hold different motions, as ranges of what is varied.
# --------------------


@dataclass(frozen=True)
class TwoMotions:
    """Neighbouring values at which two branches are apart.

    Parameters
    ----------
    first, last : float
        The lowest and the highest of them, out of the values tried.
    low, high : float
        Half way to the values where the branches agree, never more than half a step of the sweep.
    begins_with_sweep, ends_with_sweep : bool
        Whether it reaches an end of the values tried: it may go on beyond.
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
    """Return the ranges in which two motions coexist, ascending; see `values_apart` for when they do.

    Where a range begins and ends is known to half a step only, and how wide it is depends on the sweep: a jump back
    needs a sweep that goes far enough to lose each motion.

    Raises
    ------
    InputError
        As `values_apart`.
    """
    values = np.intersect1d(up.values, down.values)
    apart = np.isin(values, values_apart(up, down, differs=differs))
    steps = np.diff(np.concatenate([[False], apart, [False]]).astype(int))
    half = 0.5 * step_of(up, down)
    found = []
    for start, stop in zip(np.flatnonzero(steps == 1), np.flatnonzero(steps == -1) - 1, strict=True):
        first, last = float(values[start]), float(values[stop])
        at_start, at_end = bool(start == 0), bool(stop == len(values) - 1)
        low = first if at_start else first - min(half, 0.5 * (first - float(values[start - 1])))
        high = last if at_end else last + min(half, 0.5 * (float(values[stop + 1]) - last))
        found.append(TwoMotions(first, last, low, high, at_start, at_end))
    return tuple(found)


def step_of(up: BifurcationDiagram, down: BifurcationDiagram) -> float:
    """Return the step between the values that both branches have, the median one; 0 for a single value."""
    values = np.intersect1d(up.values, down.values)
    return float(np.median(np.diff(values))) if len(values) > 1 else 0.0
