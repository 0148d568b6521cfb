"""What a transform works on: one channel at equal steps of time or of shaft angle."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, cast

import numpy as np

from gearsig.angle import AngleSignal
from gearsig.checks import FloatArray, count, frozen_array, one_of, positive
from gearsig.errors import InputError, RefusalError
from gearsig.recording import Recording
from gearsig.spectra import Scaling, scaled_unit
from gearsig.timefreq._types import Axis, Coefficients, ComplexArray, Reduction, Spacing, TimeFrequencyMap, check_size

SMALLEST, LARGEST = 1e-12, 1e15
"""Largest values of a signal, in its unit, between which single precision holds its weak coefficients' squares."""
MIN_SAMPLES = 16
"""Samples below which there is nothing to lay out over time and frequency."""


@dataclass(frozen=True)
class UniformSignal:
    """One channel at equal steps of time or angle.

    Parameters
    ----------
    values : array, (n_samples,)
        Finite; float32 or float64.
    rate : float
        Samples per second, or per revolution.
    axis : str
        "frequency" for a signal over time, "order" for one over angle.
    highest : float or None
        Highest frequency or order that is valid; None: half the rate.
    start : float
        Time or angle of the first sample.
    unit, source, shaft : str

    Raises
    ------
    InputError
        On values that are not finite or beyond 1e-12 to 1e15, a wrong shape or rate.
    RefusalError
        If there are fewer than 16 samples.
    """

    values: FloatArray
    rate: float
    axis: Axis = "frequency"
    highest: float | None = None
    start: float = 0.0
    unit: str = ""
    source: str = ""
    shaft: str = ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "values", frozen_array(self.values, self.source or "signal", ndim=1))
        positive(self.rate, "rate")
        if len(self.values) < MIN_SAMPLES:
            raise RefusalError(
                f"the signal has {len(self.values)} samples, fewer than {MIN_SAMPLES}", remedy="record longer"
            )
        largest = float(max(abs(self.values.max()), abs(self.values.min())))
        if largest and not SMALLEST <= largest <= LARGEST:
            raise InputError(
                f"the largest value is {largest:.3g} {self.unit}".rstrip(),
                where=self.source or "signal",
                allowed=f"{SMALLEST:g} to {LARGEST:g}, or all zero",
                remedy="give the signal in another unit",
            )

    @property
    def n_samples(self) -> int:
        """Number of samples."""
        return len(self.values)

    @property
    def length(self) -> float:
        """Seconds or revolutions."""
        return self.n_samples / self.rate

    @property
    def highest_valid(self) -> float:
        """Highest frequency or order that the samples carry."""
        return self.rate / 2 if self.highest is None else min(self.highest, self.rate / 2)

    @property
    def position_unit(self) -> str:
        """Unit of frequencies or orders, for messages."""
        return "Hz" if self.axis == "frequency" else "orders"

    def instants(self, step: int) -> FloatArray:
        """Return the instant of every `step`-th sample."""
        return self.start + np.arange(0, self.n_samples, step) / self.rate


Source = Recording | AngleSignal | UniformSignal | FloatArray


def uniform(signal: Source, channel: str | float | None = None) -> UniformSignal:
    """Return a channel of a recording (over time) or of an angle signal (over revolutions), or an array with its rate.

    Parameters
    ----------
    signal : Recording, AngleSignal, UniformSignal or array, (n_samples,)
        An angle signal makes every transform one over orders and revolutions.
    channel : str, float or None
        Name of a channel; None: the only one there is. Of an array its sampling rate in Hz.

    Raises
    ------
    InputError
        If the channel is not there, or none is named and there are several; if an array comes without its rate.
    """
    if isinstance(signal, UniformSignal):
        return signal
    if not isinstance(signal, (Recording, AngleSignal)):
        if channel is None or isinstance(channel, str):
            raise InputError(
                f"signal is a {type(signal).__name__}, and its sampling rate is {channel!r}",
                allowed="a Recording or AngleSignal and its channel, a UniformSignal, or an array and its rate in Hz",
            )
        return UniformSignal(signal, positive(channel, "sampling_rate_hz", "Hz"))
    names = signal.channel_names
    if channel is None and len(names) != 1:
        raise InputError("no channel is named", where="channel", allowed=", ".join(names))
    name = names[0] if channel is None else str(channel)
    values = signal.values(name)
    if isinstance(signal, Recording):
        unit = signal.channels[signal.index(name)].unit
        return UniformSignal(values, signal.sampling_rate_hz, unit=unit, source=name)
    return UniformSignal(
        values,
        float(signal.samples_per_revolution),
        axis="order",
        highest=signal.highest_order,
        start=signal.start_revolution,
        unit=signal.units[names.index(name)],
        source=name,
        shaft=signal.shaft_angle.shaft,
    )


# --------------------
# What a signal is taken to be beyond its ends.
# --------------------


Edges = Literal["reflect", "zero"]
EDGES = ("reflect", "zero")


def stretch(values: FloatArray, start: int, n: int, edges: Edges) -> FloatArray:
    """Return n samples from `start` on, in double precision, with what is assumed beyond the ends."""
    n_samples = len(values)
    inside = values[max(0, start) : max(0, start + n)]
    if len(inside) == n:
        return inside.astype(np.float64)
    result: FloatArray = np.zeros(n)
    if edges == "zero":
        result[max(0, -start) : max(0, -start) + len(inside)] = inside
        return result
    index = np.abs(np.arange(start, start + n)) % (2 * n_samples - 2)
    result[:] = values[np.minimum(index, 2 * n_samples - 2 - index)]
    return result


# --------------------
# Power of coefficients per stretch of time or angle, gathered piece by piece.
# --------------------


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
