"""Uniformly sampled channels over time or angle, and results of transforms: maps, coefficients, ridges."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal, cast, get_args

import numpy as np
from numpy.typing import NDArray

from gearsig.angle import AngleSignal
from gearsig.checks import ComplexArray, FloatArray, count, freeze, frozen_array, one_of, positive, short
from gearsig.errors import InputError, RefusalError
from gearsig.formatting import axis_label, axis_unit
from gearsig.recording import Recording
from gearsig.results import Result
from gearsig.spectra import Scaling, array_rate_hz, check_signal, scaled_unit

Axis = Literal["frequency", "order"]
Spacing = Literal["linear", "logarithmic"]
Reduction = Literal["mean", "max"]


@dataclass(frozen=True)
class TimeFrequencyMap(Result, matrix=("values", "at", "positions")):
    """Levels over time and frequency, or shaft angle and order, small enough to plot.

    Parameters
    ----------
    values : array, (n_columns, n_lines)
        Mean or maximum power in each segment of the signal, in `scaling`.
    positions : array, (n_lines,)
        Frequencies in Hz or orders, increasing; see `axis`.
    at : array, (n_columns,)
        Middle of each segment: seconds from the start, or revolutions of the shaft.
    axis : str
        "frequency" over time, or "order" over shaft angle.
    spacing : str
        Spacing of the lines: "linear" or "logarithmic".
    scaling : str
        "amplitude peak": a unit sine reads 1 on its ridge; "power": it reads 1/2.
    unit : str
        Unit of the values, including the scaling.
    method : str
        Transform with its wavelet or window.
    reduction : str
        "mean" or "max" of the power in each segment.
    edge : array, (n_lines,)
        Distance from both ends, in the unit of `at`, over which the assumed continuation affects each line.
    n_reach : int
        Number of lines on either side of a ridge that one component covers.
    squeezed : bool
        Whether components are reassigned to their instantaneous frequency; each is then the sum over a few lines.
    source, shaft : str
        Channel; the shaft that orders and revolutions refer to, empty over time.
    unsqueezed : array, (n_columns, n_lines), or None
        For squeezed maps: the levels before squeezing. Noise scatters a squeezed component over lines, so that only
        these hold its level.
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
        """Label of `at`, with its unit."""
        return at_label(self.axis, self.shaft)

    @property
    def axis_label(self) -> str:
        """Label of `positions`, with its unit."""
        return axis_label(self.axis, self.shaft)


@dataclass(frozen=True)
class Coefficients(Result, matrix=("values.T", "at", "positions")):
    """Complex coefficients of a transform at equal steps of time or angle.

    Parameters
    ----------
    values : complex array, (n_lines, n_columns)
        Modulus: peak amplitude; a unit sine reads 1 on its ridge. Phase: that of the cosine at the column's instant.
    positions : array, (n_lines,)
        Frequencies in Hz or orders, increasing.
    at : array, (n_columns,)
        Instants: seconds from the start, or revolutions of the shaft.
    axis, spacing, unit, method, source, shaft
        As in `TimeFrequencyMap`; the unit is that of the signal.
    weights : array, (n_lines,)
        The real part of Σ weights · values over the lines is the signal at the columns.
    n_reach, squeezed
        As in `TimeFrequencyMap`.
    unsqueezed : array, (n_lines, n_columns), or None
        For squeezed transforms: peak amplitudes before squeezing; see `TimeFrequencyMap`.
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
    """Freeze the levels before squeezing; raise InputError unless squeezed transforms, and only they, have them."""
    if result.squeezed != (result.unsqueezed is not None):
        raise InputError(
            f"squeezed is {result.squeezed}, but levels before squeezing are "
            f"{'given' if result.unsqueezed is not None else 'missing'}",
            where="unsqueezed",
            allowed="an array if squeezed, otherwise None",
        )
    if result.unsqueezed is None:
        return
    freeze(result, "unsqueezed", ndim=None)
    if result.unsqueezed.shape != result.values.shape:
        raise InputError(f"unsqueezed has shape {result.unsqueezed.shape}", allowed=str(result.values.shape))


@dataclass(frozen=True)
class Ridge(Result, columns=("at", "positions", "amplitude", "shared")):
    """Frequency and amplitude of one component over time, or order and amplitude over shaft angle.

    Parameters
    ----------
    at : array, (n,)
        Seconds from the start, or revolutions.
    positions : array, (n,)
        Instantaneous frequency in Hz, or order.
    amplitude : array, (n,)
        Peak amplitude in `unit`, from the largest coefficient near the path, before squeezing.
    shared : boolean array, (n,)
        Where another ridge lies within reach: the amplitude there is that of both together.
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
        """Return the frequency or order at other instants, by linear interpolation; constant beyond the ends."""
        return np.interp(at, self.at, self.positions)


def at_label(axis: Axis, shaft: str) -> str:
    """Return the label of the signal's time or angle axis."""
    return "time (s)" if axis == "frequency" else f"angle (revolutions of {shaft or 'the shaft'})"


# --------------------
# Input of a transform, and its layout in lines and columns.
# --------------------

SMALLEST, LARGEST = 1e-12, 1e15
"""Range of a signal's largest value, in its unit, for which single precision holds squares of weak coefficients."""
MAX_COEFFICIENTS = 1 << 28
"""Maximum number of complex coefficients held in memory: 2 GB."""


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
        Highest valid frequency or order; None: half the rate.
    start : float
        Time or angle of the first sample.
    unit, source, shaft : str

    Raises
    ------
    InputError
        On non-finite values, a largest value outside 1e-12 to 1e15, or a wrong shape or rate.
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
        if len(self.values) < 16:
            raise RefusalError(f"the signal has {len(self.values)} samples, fewer than 16", remedy="record longer")
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
        """Length in seconds or revolutions."""
        return self.n_samples / self.rate

    @property
    def highest_valid(self) -> float:
        """Highest frequency or order that the samples can represent."""
        return self.rate / 2 if self.highest is None else min(self.highest, self.rate / 2)

    @property
    def position_unit(self) -> str:
        """Unit of frequencies or orders, for messages."""
        return axis_unit(self.axis)

    @property
    def length_unit(self) -> str:
        """Unit of time or angle, for messages."""
        return "s" if self.axis == "frequency" else "revolutions"

    def instants(self, step: int) -> FloatArray:
        """Return the instant of every `step`-th sample, in seconds or revolutions."""
        return self.start + np.arange(0, self.n_samples, step) / self.rate


Source = Recording | AngleSignal | UniformSignal | FloatArray


def uniform(signal: Source, channel: str | float | None = None) -> UniformSignal:
    """Return a channel of a recording (over time) or of an angle signal (over revolutions), or an array with its rate.

    Parameters
    ----------
    signal : Recording, AngleSignal, UniformSignal or array, (n_samples,)
        With an angle signal, transforms are over orders and revolutions.
    channel : str, float or None
        Name of a channel; None: the only one. For an array, its sampling rate in Hz.

    Raises
    ------
    InputError
        If the channel does not exist, if none is named although there are several, or if an array has no rate.
    """
    if isinstance(signal, UniformSignal):
        return signal
    if not isinstance(signal, (Recording, AngleSignal)):
        check_signal(signal, Recording | AngleSignal | UniformSignal)
        if channel is None or isinstance(channel, str):
            raise InputError(
                f"signal is {short(signal)}, and its sampling rate is {channel!r}",
                allowed="a Recording or AngleSignal and its channel, a UniformSignal, or an array and its rate in Hz",
            )
        return UniformSignal(signal, array_rate_hz(channel, "channel"))
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


Edges = Literal["reflect", "zero"]


def segment_of(values: FloatArray, start: int, n: int, edges: Edges) -> FloatArray:
    """Return n samples from `start` on, in double precision, continued beyond the ends as `edges` says."""
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


Piece = tuple[NDArray[np.int64], int, int, ComplexArray]
"""Lines, first sample, samples between columns, and the coefficients, (n_lines, n_columns).

For a squeezed transform (2, n_lines, n_columns): squeezed and unsqueezed."""


@dataclass(frozen=True)
class Columns:
    """Segments of `n_per_column` samples; the last may be shorter."""

    n_samples: int
    n_per_column: int

    @property
    def n_columns(self) -> int:
        """Number of segments."""
        return -(-self.n_samples // self.n_per_column)

    @property
    def largest_step(self) -> int:
        """Largest power of two that leaves at least eight coefficients per segment, if it has that many samples."""
        return 1 << min(20, max(0, self.n_per_column.bit_length() - 4))


def plan_columns(signal: UniformSignal, n_columns: int) -> Columns:
    """Return at most `n_columns` segments of equal length."""
    return Columns(signal.n_samples, -(-signal.n_samples // count(n_columns, "n_columns", minimum=2)))


@dataclass(frozen=True)
class LinePlan:
    """A signal and the lines of its transform; fields as in `TimeFrequencyMap`."""

    signal: UniformSignal
    lines: FloatArray
    spacing: Spacing
    method: str
    edge: FloatArray
    n_reach: int = 1
    squeezed: bool = False

    def room(self, step: int) -> ComplexArray:
        """Return zeros for the coefficients of every `step`-th sample; raise InputError beyond 2 GB."""
        n_lines, n_columns = len(self.lines), -(-self.signal.n_samples // count(step, "step"))
        if n_lines * n_columns > MAX_COEFFICIENTS:
            raise InputError(
                f"{n_lines} lines × {n_columns} columns make {8e-9 * n_lines * n_columns:.3g} GB of coefficients",
                where="step",
                allowed=f"at most {8e-9 * MAX_COEFFICIENTS:.2g} GB",
                remedy=f"set step to {-(-n_lines * n_columns // MAX_COEFFICIENTS)} times as much, or take the map",
            )
        return np.zeros((n_lines, n_columns), dtype=np.complex64)

    def coefficients(
        self, values: ComplexArray, step: int, weights: FloatArray, unsqueezed: FloatArray | None = None
    ) -> Coefficients:
        """Return the result for complex values at every `step`-th sample; the weights restore the signal."""
        x = self.signal
        return Coefficients(
            values,
            self.lines,
            x.instants(step),
            x.axis,
            self.spacing,
            x.unit,
            self.method,
            weights,
            self.n_reach,
            self.squeezed,
            x.source,
            x.shaft,
            unsqueezed,
        )

    def level_map(
        self, columns: Columns, reduction: Reduction, scaling: str, pieces: Iterable[Piece]
    ) -> TimeFrequencyMap:
        """Return the map of the mean or maximum of |W|² in each column, from pieces in any order.

        |W|² / 2 is the power of a sine of amplitude |W|.
        """
        one_of(reduction, "reduction", get_args(Reduction))
        kind = cast("Scaling", one_of(scaling, "scaling", ("amplitude peak", "power")))
        x, n_per_column = self.signal, columns.n_per_column
        level_sums = np.zeros((2 if self.squeezed else 1, len(self.lines), columns.n_columns))
        n_read = np.zeros(level_sums.shape[1:], dtype=np.int64)
        for lines, start, step, W in pieces:
            power = (W.real**2 + W.imag**2).reshape(len(level_sums), len(lines), -1)
            column = (start + step * np.arange(power.shape[2])) // n_per_column
            first = np.flatnonzero(np.diff(column, prepend=-1))
            at = slice(int(column[0]), int(column[-1]) + 1)
            if reduction == "max":
                largest = np.maximum.reduceat(power, first, axis=2)
                level_sums[:, lines, at] = np.maximum(level_sums[:, lines, at], largest)
                n_read[lines, at] = 1
            else:
                level_sums[:, lines, at] += np.add.reduceat(power, first, axis=2, dtype=np.float64)
                n_read[lines, at] += np.diff(first, append=len(column))
        power = level_sums / np.maximum(n_read, 1)
        levels = [(np.sqrt(p) if kind == "amplitude peak" else p / 2).T for p in power]
        begin = np.arange(columns.n_columns) * n_per_column
        last = np.minimum(begin + n_per_column, columns.n_samples) - 1
        return TimeFrequencyMap(
            levels[0],
            self.lines,
            x.start + (begin + last) / 2 / x.rate,
            x.axis,
            self.spacing,
            kind,
            scaled_unit(x.unit, kind),
            self.method,
            reduction,
            self.edge,
            self.n_reach,
            self.squeezed,
            x.source,
            x.shaft,
            levels[1] if self.squeezed else None,
        )
