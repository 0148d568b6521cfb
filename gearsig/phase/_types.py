"""Motion in phase space and its sections, with axes and units."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from math import ceil, floor
from typing import Literal

import numpy as np

from gearsig.checks import FloatArray, freeze, positive
from gearsig.errors import InputError

PortraitKind = Literal["phase plane", "delay embedding", "states"]


@dataclass(frozen=True)
class PhasePortrait:
    """A path through phase space, sampled at a constant rate.

    Parameters
    ----------
    points : array, (n_points, n_axes)
        Sample i lies at `start_s` + i / `sampling_rate_hz` of the recording's time.
    sampling_rate_hz : float
    axis_names, units : tuples of str
        One per axis.
    kind : str
        "phase plane": displacement and velocity; "delay embedding": x(t), x(t + τ), …; "states": as a model gave them.
    source : str
        Channel, and what was done to it.
    start_s : float
    band_hz : (float, float)
        Frequencies that the axes hold in full; (0, half the sampling rate) where nothing was filtered.
    delay_samples : int
        Of a delay embedding; 0 otherwise.
    """

    points: FloatArray
    sampling_rate_hz: float
    axis_names: tuple[str, ...]
    units: tuple[str, ...]
    kind: PortraitKind
    source: str
    start_s: float = 0.0
    band_hz: tuple[float, float] = (0.0, float("inf"))
    delay_samples: int = 0

    def __post_init__(self) -> None:
        freeze(self, "points", ndim=2)
        positive(self.sampling_rate_hz, "sampling_rate_hz", "Hz")
        if not self.points.shape[1] == len(self.axis_names) == len(self.units):
            raise InputError(
                f"{len(self.axis_names)} axis names and {len(self.units)} units for {self.points.shape[1]} axes"
            )

    @property
    def n_points(self) -> int:
        """Samples of the path."""
        return int(self.points.shape[0])

    @property
    def n_axes(self) -> int:
        """Dimension of the space."""
        return int(self.points.shape[1])

    @property
    def end_s(self) -> float:
        """Time of the last sample."""
        return self.start_s + (self.n_points - 1) / self.sampling_rate_hz

    @property
    def extent(self) -> FloatArray:
        """Standard deviation along each axis, (n_axes,): the size that distances are compared with."""
        deviation: FloatArray = np.std(self.points, axis=0, dtype=np.float64)
        return deviation

    def between(self, start_s: float, end_s: float) -> PhasePortrait:
        """Return the samples from `start_s` to `end_s`, both included.

        Raises
        ------
        InputError
            If fewer than two lie there.
        """
        first = max(0, ceil((start_s - self.start_s) * self.sampling_rate_hz - 1e-6))
        last = min(self.n_points - 1, floor((end_s - self.start_s) * self.sampling_rate_hz + 1e-6))
        if last <= first:
            raise InputError(
                f"there are no samples from {start_s:g} to {end_s:g} s", allowed=f"{self.start_s:g} to {self.end_s:g} s"
            )
        start = self.start_s + first / self.sampling_rate_hz
        return replace(self, points=self.points[first : last + 1], start_s=start)


@dataclass(frozen=True)
class PoincareSection:
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
class BifurcationDiagram:
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
