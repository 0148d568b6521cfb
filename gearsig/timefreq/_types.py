"""Maps for display, complex coefficients and ridges over time–frequency or angle–order."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from gearsig.checks import FloatArray, freeze
from gearsig.errors import InputError
from gearsig.formatting import axis_label
from gearsig.results import Result
from gearsig.spectra import Scaling

Axis = Literal["frequency", "order"]
Spacing = Literal["linear", "logarithmic"]
Reduction = Literal["mean", "max"]
ComplexArray = NDArray[np.complexfloating[Any, Any]]


@dataclass(frozen=True)
class TimeFrequencyMap(Result, matrix=("values", "at", "positions")):
    """Levels over time and frequency, or shaft angle and order, small enough to draw.

    Parameters
    ----------
    values : array, (n_columns, n_lines)
        Each is the mean or the maximum of the power in a segment of the signal, in `scaling`.
    positions : array, (n_lines,)
        Frequencies in Hz or orders, increasing; see `axis`.
    at : array, (n_columns,)
        Middle of each segment: seconds from the start, or revolutions of the shaft.
    axis : str
        "frequency" over time, or "order" over shaft angle.
    spacing : str
        Of the lines: "linear" or "logarithmic".
    scaling : str
        "amplitude peak": a unit sine reads 1 on its ridge; "power": it reads 1/2.
    unit : str
        Of the values, written out with the scaling.
    method : str
        Transform with its wavelet or window.
    reduction : str
        "mean" or "max" of the power in each segment.
    edge : array, (n_lines,)
        How far from both ends, in the unit of `at`, a line is touched by what was assumed beyond them.
    n_reach : int
        Lines on either side of a ridge that one component covers.
    squeezed : bool
        Whether a component's share is moved to its momentary frequency: it is then the sum over a few lines.
    source, shaft : str
        Channel; the shaft that orders and revolutions are counted on, empty over time.
    unsqueezed : array, (n_columns, n_lines), or None
        Of squeezed maps: the levels before squeezing. Noise scatters a component's squeezed share over lines, so that
        only these hold its level.
    """

    values: FloatArray
    positions: FloatArray
    at: FloatArray
    axis: Axis
    spacing: Spacing
    scaling: Scaling
    unit: str
    method: str
    reduction: Reduction
    edge: FloatArray
    n_reach: int = 1
    squeezed: bool = False
    source: str = ""
    shaft: str = ""
    unsqueezed: FloatArray | None = None

    def __post_init__(self) -> None:
        freeze(self, "values", ndim=2)
        freeze(self, "positions", "at", "edge")
        _freeze_unsqueezed(self)
        if self.values.shape != (len(self.at), len(self.positions)) or len(self.edge) != len(self.positions):
            raise InputError(
                f"values of shape {self.values.shape} and {len(self.edge)} edges for {len(self.at)} columns × "
                f"{len(self.positions)} lines"
            )

    @property
    def at_label(self) -> str:
        """What `at` counts, with unit."""
        return at_label(self.axis, self.shaft)

    @property
    def axis_label(self) -> str:
        """What `positions` count, with unit."""
        return axis_label(self.axis, self.shaft)


@dataclass(frozen=True)
class Coefficients(Result, matrix=("values.T", "at", "positions")):
    """Complex coefficients of a transform at equal steps of time or angle.

    Parameters
    ----------
    values : complex array, (n_lines, n_columns)
        Modulus: peak amplitude; a unit sine reads 1 on its ridge. Phase: of the cosine, at the column's instant.
    positions : array, (n_lines,)
        Frequencies in Hz or orders, increasing.
    at : array, (n_columns,)
        Instants: seconds from the start, or revolutions of the shaft.
    axis, spacing, unit, method, source, shaft
        As in `TimeFrequencyMap`; the unit is the signal's own.
    weights : array, (n_lines,)
        Real part of Σ weights · values over the lines: the signal at the columns.
    n_reach, squeezed
        As in `TimeFrequencyMap`.
    unsqueezed : array, (n_lines, n_columns), or None
        Of squeezed transforms: peak amplitudes before squeezing; see `TimeFrequencyMap`.
    """

    values: ComplexArray
    positions: FloatArray
    at: FloatArray
    axis: Axis
    spacing: Spacing
    unit: str
    method: str
    weights: FloatArray
    n_reach: int = 1
    squeezed: bool = False
    source: str = ""
    shaft: str = ""
    unsqueezed: FloatArray | None = None

    def __post_init__(self) -> None:
        freeze(self, "values", ndim=None)
        freeze(self, "positions", "at", "weights")
        _freeze_unsqueezed(self)
        if self.values.shape != (len(self.positions), len(self.at)):
            raise InputError(
                f"values of shape {self.values.shape} for {len(self.positions)} lines × {len(self.at)} columns"
            )


def _freeze_unsqueezed(result: TimeFrequencyMap | Coefficients) -> None:
    """Raise InputError unless a squeezed transform carries its levels before squeezing, and no other one does."""
    if result.squeezed != (result.unsqueezed is not None):
        raise InputError(
            f"squeezed is {result.squeezed}, and levels before squeezing are "
            f"{'given' if result.unsqueezed is not None else 'missing'}",
            where="unsqueezed",
            allowed="an array where squeezed, None where not",
        )
    if result.unsqueezed is None:
        return
    freeze(result, "unsqueezed", ndim=None)
    if result.unsqueezed.shape != result.values.shape:
        raise InputError(f"unsqueezed has shape {result.unsqueezed.shape}", allowed=str(result.values.shape))


@dataclass(frozen=True)
class Ridge(Result, columns=("at", "positions", "amplitude", "shared")):
    """Frequency and amplitude of one component along time, or order along shaft angle.

    Parameters
    ----------
    at : array, (n,)
        Seconds from the start, or revolutions.
    positions : array, (n,)
        Momentary frequency in Hz, or order.
    amplitude : array, (n,)
        Peak amplitude in `unit`, from the largest coefficient near the path, before squeezing.
    shared : boolean array, (n,)
        Where another ridge lies within reach: the amplitude there is of both together.
    axis, unit, source, shaft
        As in `Coefficients`.
    """

    at: FloatArray
    positions: FloatArray
    amplitude: FloatArray
    shared: NDArray[np.bool_]
    axis: Axis
    unit: str
    source: str = ""
    shaft: str = ""

    def __post_init__(self) -> None:
        freeze(self, "at", "positions", "amplitude")
        freeze(self, "shared", ndim=None)
        if not len(self.at) == len(self.positions) == len(self.amplitude) == len(self.shared):
            raise InputError("at, positions, amplitude and shared of a ridge differ in length")

    def position_at(self, at: FloatArray) -> FloatArray:
        """Return the frequency or order at other instants, by straight lines; constant beyond the ends."""
        return np.interp(at, self.at, self.positions)


def at_label(axis: Axis, shaft: str) -> str:
    """Name the direction in which the signal runs."""
    return "time (s)" if axis == "frequency" else f"angle (revolutions of {shaft or 'the shaft'})"
