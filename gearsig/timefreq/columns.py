"""Power of coefficients per stretch of time or angle, gathered piece by piece."""

from __future__ import annotations

from dataclasses import dataclass
from typing import cast

import numpy as np

from gearsig.checks import FloatArray, count, one_of
from gearsig.spectra.blocks import scaled_unit
from gearsig.spectra.types import Scaling
from gearsig.timefreq.size import check_size
from gearsig.timefreq.types import Coefficients, ComplexArray, Reduction, Spacing, TimeFrequencyMap
from gearsig.timefreq.uniform import UniformSignal

SCALINGS = ("amplitude peak", "power")


@dataclass(frozen=True)
class Columns:
    """Stretches of `n_per_column` samples; the last may be shorter."""

    n_samples: int
    n_per_column: int

    @property
    def n_columns(self) -> int:
        """Number of stretches."""
        return -(-self.n_samples // self.n_per_column)

    @property
    def largest_step(self) -> int:
        """Largest power of two that leaves at least eight coefficients in every stretch, if it has as many samples."""
        return 1 << min(20, max(0, self.n_per_column.bit_length() - 4))

    def middles(self, signal: UniformSignal) -> FloatArray:
        """Return the middle of each stretch in seconds or revolutions."""
        first = np.arange(self.n_columns) * self.n_per_column
        last = np.minimum(first + self.n_per_column, self.n_samples) - 1
        result: FloatArray = signal.start + (first + last) / 2 / signal.rate
        return result


def plan_columns(signal: UniformSignal, n_columns: int) -> Columns:
    """Return at most `n_columns` stretches of equal length."""
    count(n_columns, "n_columns", minimum=2)
    return Columns(signal.n_samples, -(-signal.n_samples // n_columns))


@dataclass(frozen=True)
class Form:
    """What maps and coefficients say about their transform; fields as in `TimeFrequencyMap`."""

    lines: FloatArray
    spacing: Spacing
    method: str
    edge: FloatArray
    n_reach: int
    squeezed: bool = False

    def coefficients(self, values: ComplexArray, signal: UniformSignal, step: int, weights: FloatArray) -> Coefficients:
        """Return the complex values of every `step`-th sample; the weights give the signal back."""
        return Coefficients(
            values,
            self.lines,
            signal.instants(step),
            signal.axis,
            self.spacing,
            signal.unit,
            self.method,
            weights,
            self.n_reach,
            self.squeezed,
            signal.source,
            signal.shaft,
        )


def room_for(n_lines: int, signal: UniformSignal, step: int) -> ComplexArray:
    """Return zeros for the coefficients of every `step`-th sample.

    Raises
    ------
    InputError
        If the step is no count, or they would take more than 2 GB.
    """
    n_columns = -(-signal.n_samples // count(step, "step"))
    check_size(n_lines, n_columns)
    return np.zeros((n_lines, n_columns), dtype=np.complex64)


class ColumnPowers:
    """Gathers |W|² of pieces in any order.

    Parameters
    ----------
    columns : Columns
    n_lines : int
    reduction : str
        "mean" or "max".
    """

    def __init__(self, columns: Columns, n_lines: int, reduction: Reduction) -> None:
        one_of(reduction, "reduction", ("mean", "max"))
        self.columns, self.reduction = columns, reduction
        self._gathered = np.zeros((n_lines, columns.n_columns))
        self._n_read = np.zeros((n_lines, columns.n_columns), dtype=np.int64)

    def add(self, lines: np.ndarray[tuple[int], np.dtype[np.int64]], start: int, step: int, W: ComplexArray) -> None:
        """Add W[line, i] at samples start + i·step."""
        power = W.real**2 + W.imag**2
        n_per_column = self.columns.n_per_column
        column = (start + step * np.arange(W.shape[1])) // n_per_column
        first = np.flatnonzero(np.diff(column, prepend=-1))
        where = slice(int(column[0]), int(column[-1]) + 1)
        if self.reduction == "max":
            best = np.maximum.reduceat(power, first, axis=1)
            self._gathered[lines, where] = np.maximum(self._gathered[lines, where], best)
            self._n_read[lines, where] = 1
            return
        self._gathered[lines, where] += np.add.reduceat(power, first, axis=1, dtype=np.float64)
        self._n_read[lines, where] += np.diff(first, append=len(column))

    def finished(self, signal: UniformSignal, form: Form, scaling: str) -> TimeFrequencyMap:
        """Return the map; |W|² / 2 is the power of a sine of amplitude |W|."""
        one_of(scaling, "scaling", SCALINGS)
        power = (self._gathered / np.maximum(self._n_read, 1)).T
        kind = cast("Scaling", scaling)
        return TimeFrequencyMap(
            np.sqrt(power) if kind == "amplitude peak" else power / 2,
            form.lines,
            self.columns.middles(signal),
            signal.axis,
            form.spacing,
            kind,
            scaled_unit(signal.unit, kind),
            form.method,
            self.reduction,
            form.edge,
            form.n_reach,
            form.squeezed,
            signal.source,
            signal.shaft,
        )
