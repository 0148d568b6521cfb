"""Bifurcation diagrams: Poincaré points over speed, load, roughness, backlash, or anything else that is varied."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np

from gearsig.checks import FloatArray, count, freeze
from gearsig.errors import InputError
from gearsig.phase._section import PoincareSection, section_period
from gearsig.results import Result


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
        Cycles after which the section repeats at each value; 0 where it does not repeat within the longest looked for.
    section : str
    extents : array, (n_values,)
        Standard deviation of the whole path along the drawn axis at each value; empty where it is not known.
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
    values, i_up, i_down = np.intersect1d(up.values, down.values, return_indices=True)
    a, b = up.extents[i_up], down.extents[i_down]
    apart: FloatArray = values[np.abs(a - b) > differs * np.maximum(a, b)]
    return apart


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
    ranges = []
    for start, stop in zip(np.flatnonzero(steps == 1), np.flatnonzero(steps == -1) - 1, strict=True):
        first, last = float(values[start]), float(values[stop])
        at_start, at_end = bool(start == 0), bool(stop == len(values) - 1)
        low = first if at_start else first - min(half, 0.5 * (first - float(values[start - 1])))
        high = last if at_end else last + min(half, 0.5 * (float(values[stop + 1]) - last))
        ranges.append(TwoMotions(first, last, low, high, at_start, at_end))
    return tuple(ranges)


def step_of(up: BifurcationDiagram, down: BifurcationDiagram) -> float:
    """Return the step between the values that both branches have, the median one; 0 for a single value."""
    values = np.intersect1d(up.values, down.values)
    return float(np.median(np.diff(values))) if len(values) > 1 else 0.0
