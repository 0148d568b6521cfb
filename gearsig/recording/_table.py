"""Columns as a file reader delivers them, and the rules that find time, rate, speed and runs among them."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import PurePath
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gearsig.checks import FloatArray
from gearsig.errors import InputError
from gearsig.formatting import counted
from gearsig.recording._types import (
    INTERVAL_NAMES,
    RATE_NAMES,
    SECONDS_PER_UNIT,
    SPEED_NAMES,
    plain_name,
    quantity_of,
)
from gearsig.rig import RPM_UNITS, ConstantSpeed, SpeedSource

NumberArray = NDArray[Any]


def sample_place(row: int) -> str:
    """Name a row of a file that has no lines."""
    return f"sample {row}"


@dataclass(frozen=True)
class RawColumn:
    """One column of a file.

    Parameters
    ----------
    name : str
    values : array, (n_samples,)
        Numbers in the file's own type.
    unit, quantity, position : str
        Empty if the file does not say.
    """

    name: str
    values: NumberArray
    unit: str = ""
    quantity: str = ""
    position: str = ""


@dataclass(frozen=True)
class RawTable:
    """The columns of one file and what the file says about them.

    Parameters
    ----------
    columns : tuple of RawColumn
    reader : str
        Name of the reader, for the provenance.
    sampling_rate_hz : float or None
        As the file states it.
    time : RawColumn or None
        The time column, if the reader already knows it.
    is_own_layout : bool
        Whether gearsig wrote the file: if so, nothing is guessed from names.
    warnings : tuple of str
    speed : SpeedSource or None
    speeds_rpm : mapping
        Speeds that the file states, by name; more than one if it holds several measurements.
    pulse_times_s : mapping
        Pulse times stored beside the signals, by name.
    truth : mapping or None
    history : tuple of str
        Processing steps done before the file was written.
    row_place : callable
        Turns a row number into its place in the file, e.g. "line 17".
    """

    columns: tuple[RawColumn, ...]
    reader: str
    sampling_rate_hz: float | None = None
    time: RawColumn | None = None
    is_own_layout: bool = False
    warnings: tuple[str, ...] = ()
    speed: SpeedSource | None = None
    speeds_rpm: Mapping[str, float] = field(default_factory=dict)
    pulse_times_s: Mapping[str, FloatArray] = field(default_factory=dict)
    truth: Mapping[str, Any] | None = None
    history: tuple[str, ...] = ()
    row_place: Callable[[int], str] = sample_place


TIME_NAMES = frozenset(
    (
        *("time", "t", "zeit", "temps", "tiempo", "tempo", "seconds", "sec", "timestamp", "elapsed_time"),
        *("time_s", "t_s", "zeit_s", "temps_s", "time_ms", "t_ms"),
    )
)


def seconds_per_unit(name: str, unit: str) -> float | None:
    """Return the factor to seconds if name and unit are those of a time column, else None.

    Examples
    --------
    >>> seconds_per_unit("Zeit", "ms"), seconds_per_unit("T", "°C"), seconds_per_unit("acc", "s")
    (0.001, None, None)
    """
    plain = re.sub(r"[\s\-]+", "_", name.strip().casefold())
    if plain not in TIME_NAMES or (name.strip() == "T" and not unit):  # a bare capital T is more likely a temperature
        return None
    suffix = plain.rpartition("_")[2] if "_" in plain else ""
    return SECONDS_PER_UNIT.get(unit.strip().casefold() or (suffix if suffix in SECONDS_PER_UNIT else ""))


def time_among(columns: Sequence[RawColumn]) -> RawColumn | None:
    """Return the column named like a time, or the first one if it rises and has a unit of time; else None."""
    named = next((c for c in columns if seconds_per_unit(c.name, c.unit) is not None), None)
    if named is not None or len(columns) < 2:
        return named
    in_time_unit = columns[0].unit.strip().casefold() in SECONDS_PER_UNIT.keys() - {""}
    return columns[0] if in_time_unit and rises(columns[0].values) else None


def seconds_per_value(time: RawColumn) -> float:
    """Return the factor from the unit of a time column to seconds."""
    return seconds_per_unit(time.name, time.unit) or SECONDS_PER_UNIT.get(time.unit.strip().casefold(), 1.0)


def rises(values: NumberArray) -> bool:
    """Whether three or more numbers never fall and end above the first."""
    is_long = values.dtype.kind in "fiu" and values.ndim == 1 and len(values) > 2
    return is_long and bool(values[-1] > values[0]) and bool(np.all(values[1:] >= values[:-1]))


_FREQUENCY_NAME = re.compile(r"(?:freq|fréq|frek|order|ordnung|ordre|band|cpm|k?hz)", re.IGNORECASE)
_FREQUENCY_UNITS = ("hz", "khz", "cpm", "kcpm", "order", "orders", "ord")


def refuse_spectrum(lines: Iterable[str] = (), where: str = "", columns: Sequence[RawColumn] = ()) -> None:
    """Raise if an axis is frequency or order, by the lines above a table or by a first column that rises.

    Raises
    ------
    InputError
    """
    axis = ""
    for line in lines:
        label, *words = (word.strip().casefold() for word in re.split(r"[:=;,\t]+", line.strip()))
        is_frequency = any(word in _FREQUENCY_UNITS or _FREQUENCY_NAME.match(word) for word in words)
        if plain_name(label) in ("xunit", "xaxisunit", "xdimension", "xunitlabel") and is_frequency:
            axis = " ".join(line.split())[:60]
    for column in columns[:1]:  # a later frequency column is more likely that of a drive
        named = _FREQUENCY_NAME.match(column.name) or column.unit.strip().casefold() in _FREQUENCY_UNITS
        if named and rises(column.values) and bool(np.all(np.diff(column.values) > 0)):
            axis = f"{column.name} ({column.unit})" if column.unit else column.name
    if axis:
        raise InputError(
            f"holds a spectrum, not a signal over time: its axis is {axis!r}",
            where=where,
            allowed="the waveform, sample by sample",
            remedy="export the time waveform that the spectrum was computed from",
        )


def counts_rows(name: str) -> bool:
    """Whether a column has no header, or one that is usual for a row count."""
    return plain_name(name) in ("", "index", "sample", "samples", "no", "nr", "#")


def without_clock(
    columns: list[RawColumn], *, is_named: bool = False
) -> tuple[list[RawColumn], RawColumn | None, list[str]]:
    """Separate leading columns that are a clock or a row count, but are not named so, from the channels.

    Parameters
    ----------
    columns : list of RawColumn
    is_named : bool
        Whether the first column has a name: if so, only a clock of hours, minutes, seconds and a fraction is sought.

    Returns
    -------
    tuple
        The other columns, the time or None, and notes for the user. A column that counts the rows from 0 or 1 is
        neither signal nor time; one that rises in equal steps (within 1 %) is the time in seconds.
    """
    if len(columns) < 2 or len(columns[0].values) < 3:
        return columns, None, []
    if (time := _clock_of_parts(columns)) is not None:
        return columns[4:], time, ["columns 1 to 4 are hour, minute, second and its fraction: taken as the time"]
    first = columns[0]
    if first.values.dtype.kind not in "fiu" or is_named:
        return columns, None, []
    steps = np.diff(first.values.astype(np.float64))
    if first.values[0] in (0, 1) and bool(np.all(steps == 1)):
        others, time, notes = without_clock(columns[1:])
        return others, time, [f"column 1 ({first.name!r}) only counts the rows and was left out", *notes]
    if steps.min() > 0 and np.ptp(steps) <= 0.02 * steps.mean():
        amplitudes = [bool(np.all(c.values >= 0)) and not rises(c.values) for c in columns[1:]]
        if steps.mean() > 0.05 and all(amplitudes):
            raise InputError(
                f"looks like a spectrum: {first.name!r} rises in steps of {steps.mean():.4g}, and no value is negative",
                allowed="the waveform, sample by sample",
                remedy="export the time waveform; if column 1 is the time, say so in a header: time [s]",
            )
        note = "the first column increases uniformly and was taken as the time in seconds"
        return columns[1:], RawColumn("time", first.values, "s"), [note]
    return columns, None, []


def _clock_of_parts(columns: Sequence[RawColumn]) -> RawColumn | None:
    """Return the time of day in seconds if the first columns are hour, minute, second and its fraction; else None.

    The unit of the fraction is the one in which the time rises evenly, within half a step: microseconds, milliseconds,
    hundredths or tenths. The time is returned as an even grid, since such clocks are rounded.
    """
    if len(columns) < 5 or any(c.values.dtype.kind not in "fiu" for c in columns[:4]):
        return None
    hour, minute, second, fraction = (c.values.astype(np.float64) for c in columns[:4])
    whole = all(np.array_equal(v, np.floor(v)) and v.min() >= 0 for v in (hour, minute, second, fraction))
    if not whole or hour.max() > 23 or minute.max() > 59 or second.max() > 59:
        return None
    k = np.arange(len(hour)) - (len(hour) - 1) / 2
    for per_second in (1e6, 1e3, 1e2, 1e1):
        t = 3600 * hour + 60 * minute + second + fraction / per_second
        step = float(k @ t) / float(k @ k)
        grid = t.mean() + k * step
        if fraction.max() < per_second and step > 0 and np.abs(t - grid).max() < 0.5 * step:
            return RawColumn("time", grid, "s")
    return None


def with_pulse_channels(table: RawTable) -> RawTable:
    """Return the table with pulse channels of no known quantity marked as tachometers."""
    if table.is_own_layout:
        return table
    columns = tuple(replace(c, quantity="tachometer") if _is_pulse_train(c) else c for c in table.columns)
    return replace(table, columns=columns)


def _is_pulse_train(column: RawColumn) -> bool:
    """Whether a channel of no known quantity rests at two levels and switches between them again and again.

    At most a tenth of the samples lie in between, and most of those that have left one level are at the other. This
    holds neither for impacts, which fade, nor for clipped vibration.
    """
    quantity = column.quantity or quantity_of(column.name, column.unit)
    if quantity not in ("unknown", "voltage") or column.values.dtype.kind not in "fiu" or column.values.ndim != 1:
        return False
    some = column.values[:: max(1, len(column.values) // 200_000)].astype(np.float64)
    if len(some) < 100 or not np.all(np.isfinite(some)):
        return False
    low, high = np.percentile(some, (0.05, 99.95))
    if not high > low:
        return False
    near = 0.25 * (high - low)
    lower, upper = int(np.count_nonzero(some < low + near)), int(np.count_nonzero(some > high - near))
    if min(lower, upper) < 3 or len(some) - lower - upper > min(0.1 * len(some), 0.7 * lower, 0.7 * upper):
        return False
    is_high = column.values > low + 0.5 * (high - low)
    return int(np.count_nonzero(is_high[1:] & ~is_high[:-1])) >= 3


N_COHERENCE_SEGMENTS = 64
N_COMPARED = 8
"""Columns compared in pairs; a matrix without a time that has more columns is more likely one of runs."""


def ask_whether_runs(columns: list[RawColumn], where: str) -> list[str]:
    r"""Return the question whether unnamed columns are separate runs, if they look like it; else nothing.

    Sensors on one machine share noise in much of the spectrum; runs at different times share at most steady tones.
    For n segments of independent noise the coherence exceeds c with the probability

    .. math:: P(\hat\gamma^2 > c) = (1 - c)^{n - 1}.

    Columns share no noise if, in every pair of the first eight, less than half of the spectrum is coherent at the 5 %
    level.

    Source: J. S. Bendat, A. G. Piersol, *Random Data*, 4th ed., ch. 9.
    """
    from scipy.signal import coherence

    n_samples = min(len(c.values) for c in columns)
    if len(columns) < 2 or n_samples < 32 * N_COHERENCE_SEGMENTS:
        return []
    chance = 1.0 - 0.05 ** (1.0 / (N_COHERENCE_SEGMENTS - 1))
    length = n_samples // N_COHERENCE_SEGMENTS
    for i, a in enumerate(columns[:N_COMPARED]):
        for b in columns[:i]:
            _, gamma2 = coherence(a.values[:n_samples], b.values[:n_samples], nperseg=length, noverlap=0)
            if not float(np.median(gamma2[2:-1])) < chance:
                return []
    question = f"{SEPARATE_RUNS} The {len(columns)} columns share no noise; channels of one machine would."
    return [f"{question} If they are runs, read one at a time: {where}#1 to {where}#{len(columns)}"]


def one_condition(table: RawTable, number: int, where: str) -> RawTable:
    """Return the table of one of several runs stored side by side as columns; its channel is named "vibration".

    As all runs have the same channel name, one can be the reference of another.

    Raises
    ------
    InputError
        If there is no such column.
    """
    if _measurements(table):
        return one_measurement(table, number, where)
    columns, times = _conditions(table)
    if not 1 <= number <= len(columns):
        raise InputError(
            f"condition {number} was requested; besides the time there are {counted(len(columns), 'column')}",
            where=where,
            allowed=", ".join(condition_numbers(table)),
            remedy="count the columns from 1, without the time",
        )
    chosen = replace(columns[number - 1], name=CONDITION_CHANNEL)
    kept = tuple(text for text in table.warnings if not text.startswith(SEPARATE_RUNS))
    return replace(table, columns=(*times, chosen), warnings=kept)


def condition_numbers(table: RawTable) -> list[str]:
    """Return the suffixes of a file's name that select one of its runs, e.g. "#1", "#2"."""
    numbers = sorted(_measurements(table)) or range(1, len(_conditions(table)[0]) + 1)
    shown = [f"#{number}" for number in numbers]
    return shown if len(shown) <= 8 else [*shown[:3], "…", shown[-1]]


def _conditions(table: RawTable) -> tuple[list[RawColumn], list[RawColumn]]:
    """Return (measured columns, time columns) of a table whose columns may be runs."""
    is_time = [seconds_per_unit(c.name, c.unit) is not None for c in table.columns]
    measured = [c for c, time in zip(table.columns, is_time, strict=True) if not time]
    return measured, [c for c, time in zip(table.columns, is_time, strict=True) if time]


def one_measurement(table: RawTable, number: int | None, where: str) -> RawTable:
    """Return the table of one measurement, if numbers in the column names show that there are several.

    "X098_DE_time", "X099_DE_time", "X099RPM" belong to two, 98 and 99. Without a number, the measurement in the file's
    name is chosen, or else the last: earlier ones were left over when it was saved. Its speed is kept with it.

    Raises
    ------
    InputError
        If there is no measurement of that number.
    """
    measurements = _measurements(table)
    if not measurements:
        return table
    numbers = ", ".join(condition_numbers(table))
    warnings = table.warnings
    if number is None:
        named = [int(n) for n in re.findall(r"\d+", where) if int(n) in measurements]
        number = named[0] if named else max(measurements)
        further = ", ".join(f"{where}#{n}" for n in sorted(measurements) if n != number)
        warnings = (
            *warnings,
            f"holds {len(measurements)} measurements: {number} was read; for another, give {further}",
        )
    if number not in measurements:
        raise InputError(f"there is no measurement {number}", where=where, allowed=numbers, remedy="choose one of them")
    speeds = {rpm for name, rpm in table.speeds_rpm.items() if number in map(int, re.findall(r"\d+", name))}
    warnings = tuple(w for w in warnings if not any(f"{name} = " in w for name in table.speeds_rpm))
    speed = ConstantSpeed(min(speeds)) if len(speeds) == 1 and 0 < min(speeds) < np.inf else None
    return replace(table, columns=tuple(measurements[number]), warnings=warnings, speed=speed)


def _measurements(table: RawTable) -> dict[int, list[RawColumn]]:
    """Return the columns by the measurement number in their names; empty unless there are several measurements.

    There are if the name of a speed has such a number too, or if lengths differ between the numbers. Neither is the
    case for channel numbers.
    """
    measurements: dict[int, list[RawColumn]] = {}
    for column in table.columns:
        match = re.match(r"[A-Za-z]{0,3}(\d{2,})_[A-Za-z]", column.name)
        if match is None or table.is_own_layout:
            return {}
        measurements.setdefault(int(match[1]), []).append(column)
    lengths = {tuple({len(c.values) for c in columns}) for columns in measurements.values()}
    of_speeds = {int(n) for name in table.speeds_rpm for n in re.findall(r"\d+", name)}
    is_several = len(measurements) > 1 and (len(lengths) > 1 or not of_speeds.isdisjoint(measurements))
    return measurements if is_several else {}


CONDITION_CHANNEL = "vibration"
SEPARATE_RUNS = "Are these separate runs?"
"""Beginning of the question whether columns are conditions."""


MAX_ROUNDING = 1e-4
"""Part of the whole time: stamps rounded more coarsely do not determine the rate."""


def rate_of_time(
    values: NumberArray, scale_s: float, where: str, row_place: Callable[[int], str]
) -> tuple[float, tuple[str, ...]]:
    r"""Return the sampling rate of a uniform time column, and warnings.

    .. math:: f_s = (N - 1) / (t_{N-1} - t_0)

    Parameters
    ----------
    values : array, (n_samples,)
        Times in the file's unit.
    scale_s : float
        Seconds per unit.
    where : str
        File and column, for the error.
    row_place : callable
        Row number to words.

    Returns
    -------
    float
        In Hz, from the mean step.
    tuple of str
        A warning if times are rounded to more than a step: missing samples would not show.

    Raises
    ------
    InputError
        If time does not increase, jumps, or deviates from the uniform grid by more than 1 % of a step and by more than
        the column's rounding.
    """
    t: FloatArray = np.asarray(values, dtype=np.float64)
    if len(t) < 2:
        raise InputError(
            f"the time column has {counted(len(t), 'value')}",
            where=where,
            allowed="at least two",
            remedy="the file was cut off; copy or export it again",
        )
    bad = np.flatnonzero(~np.isfinite(t))
    if len(bad):
        raise InputError(
            f"time is {t[bad[0]]} at {row_place(int(bad[0]))}",
            where=where,
            allowed="finite numbers",
            remedy="cut the file there or export it again",
        )
    span = float(t[-1] - t[0])
    step = span / (len(t) - 1)
    steps = np.diff(t)
    i = int(np.argmin(steps))
    stands_still = InputError(
        f"time does not increase at {row_place(i + 1)}: {t[i]:.9g} is followed by {t[i + 1]:.9g}",
        where=where,
        allowed="strictly increasing time",
        remedy="remove duplicate rows, export time with more digits, or drop the column and give --fs",
    )
    if steps[i] < 0:
        raise stands_still
    # Distance of the stamps from the straight line fitted to them; in place, as records are long.
    line, jitter = np.arange(len(t)) - (len(t) - 1) / 2, t - t.mean()
    line *= (line @ jitter) / (line @ line)
    jitter -= line
    np.abs(jitter, out=jitter)
    del line
    if jitter.max() < 0.01 * step:  # then stamps increase, and rounding hides no missing sample
        return float(1.0 / (step * scale_s)), ()
    jitters, roundings = _jitters_by_rounding(values, t, jitter)
    is_uniform = bool(np.all(jitters <= np.maximum(0.01 * step, 0.51 * roundings)))
    coarsest = float(roundings.max())
    # Rounded stamps are equal or one rounding step apart; next to duplicated rows the steps are larger.
    hides_none = is_uniform and coarsest <= MAX_ROUNDING * span and steps.max() < 1.5 * max(coarsest, step)
    if steps[i] == 0 and not hides_none:
        raise stands_still
    if is_uniform:
        rate_hz = float(1.0 / (step * scale_s))
        if coarsest < 1.5 * step:
            return rate_hz, ()
        missing = counted(int(coarsest / step), "missing sample")
        message = (
            f"time is rounded to as much as {coarsest * scale_s:.1g} s, more than a step of {step * scale_s:.3g} s: "
            f"the rate of {rate_hz:.7g} Hz is that of the whole record, and {missing} would not show"
        )
        return rate_hz, (message,)
    median = float(np.median(steps))
    i = int(np.argmax(np.abs(steps - median)))
    if steps[i] > 1.5 * median:
        raise InputError(
            f"a gap of {steps[i]:.6g} before {row_place(i + 1)} (time {t[i]:.9g} to {t[i + 1]:.9g}); "
            f"the usual step is {median:.6g}",
            where=where,
            allowed="time without gaps",
            remedy="cut the file at the gap and read the parts",
        )
    raise InputError(
        f"time is not uniform: the worst step, {steps[i]:.6g}, ends at {row_place(i + 1)}; "
        f"the usual step is {median:.6g}",
        where=where,
        allowed="time stamps within 1 % of a step of a uniform grid",
        remedy="resample to a uniform rate knowingly, or drop the time column and give --fs",
    )


def _jitters_by_rounding(values: NumberArray, t: FloatArray, jitter: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the largest jitter and the rounding step of the times, for each power of ten.

    Times printed with too few digits jitter by half a digit about a grid that was uniform when it was sampled. A fixed
    number of decimals rounds all times alike; a fixed number of digits (`%g`, spreadsheets) rounds each power of ten
    differently, as float32 does each power of two.
    """
    size = np.abs(t)
    power = np.floor(np.log10(size, out=np.full_like(t, -99.0), where=size > 0))
    is_single = np.asarray(values).dtype == np.float32
    jitters, roundings = [], []
    for decade in np.unique(power):
        inside = power == decade
        some, largest = t[inside], float(size[inside].max())
        jitters.append(float(jitter[inside].max()))
        roundings.append(float(np.spacing(np.float32(largest))) if is_single else _decimal_step(some))
    # A few times within a power of ten may all be round by chance: no power is rounded more coarsely than the next.
    return np.array(jitters), np.minimum.accumulate(np.array(roundings)[::-1])[::-1]


def _decimal_step(t: FloatArray) -> float:
    """Return the decimal step to which all of the times were rounded; 0 if there is none."""
    some = t
    if len(t) > 2000:  # drawn at random: evenly spaced times may all be round
        some = np.random.default_rng(0).choice(t, 2000)
    for digits in range(13):
        scaled = some * 10.0**digits
        if np.abs(scaled - np.round(scaled)).max() < 1e-5:
            return float(10.0**-digits)
    return 0.0


@dataclass(frozen=True)
class NamedArrays:
    """Contents of a file, by path ("bearing.gs").

    Parameters
    ----------
    arrays : mapping of str to array
        Numbers of one or two dimensions.
    texts : mapping of str to str
    units : mapping of str to str
        Units of arrays, if the file states them.
    rates_hz : mapping of str to float
        Sampling rates stated for an array, by its path; under "" for all.
    warnings : tuple of str
    """

    arrays: Mapping[str, NumberArray]
    texts: Mapping[str, str] = field(default_factory=dict)
    units: Mapping[str, str] = field(default_factory=dict)
    rates_hz: Mapping[str, float] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()


def table_from_arrays(arrays: NamedArrays, reader: str, where: str) -> RawTable:
    """Return the table of a file of named arrays.

    Arrays with one element are settings; the sampling rate among them is recognised by its name. Vectors are channels,
    and a matrix holds one channel per column or row, whichever are fewer. Vectors much shorter than the longest are
    left out, and so are signals below the highest sampling rate, except speeds in rpm, which are interpolated.
    Tachometer pulse times are kept for a rig file that names them.

    Raises
    ------
    InputError
        If no array is a signal, or the file states two sampling rates without saying for what.
    """
    scalars = {path: a for path, a in arrays.arrays.items() if a.size == 1}
    signals = {path: a for path, a in arrays.arrays.items() if a.size > 1 and a.ndim <= 2 and a.dtype.kind in "fiubc"}
    if not signals:
        names = ", ".join(list(arrays.arrays)[:8]) or "nothing"
        raise InputError(
            f"holds no signal, only {names}",
            where=where,
            allowed="vectors or matrices of numbers",
            remedy="save the signals as plain arrays (no tables or objects)",
        )
    rate_hz = _one_rate(scalars, arrays.rates_hz.get(""), where)
    rates_hz, clocks = _rates_of_clocks(signals)
    signals = {path: a for path, a in signals.items() if path not in clocks}
    signals, rate_hz, notes = _at_highest_rate(signals, rates_hz | dict(arrays.rates_hz), rate_hz, arrays)
    longest = max(max(a.shape) for a in signals.values())
    short = [path for path, a in signals.items() if max(a.shape) < 0.1 * longest]  # a setting or a result
    pulses = {
        path.rpartition(".")[2]: signals[path].reshape(-1) for path in short if _is_pulse_times(path, signals[path])
    }
    clocks += [path for path, a in signals.items() if path not in short and _is_clock(path, a)]
    time: RawColumn | None = None
    columns: list[RawColumn] = []
    warnings = [*arrays.warnings, *notes]
    for path, array in signals.items():
        if path in short or path in clocks:
            continue
        of_array = _columns(path, array, arrays, where)
        if array.ndim == 2 and 1 not in array.shape and time is None and not clocks:
            of_array, time, notes = without_clock(of_array)
            if notes:
                of_array = [replace(c, name=_column_name(path, i, where)) for i, c in enumerate(of_array, 1)]
                leaves = [c.name.rpartition(".")[2] for c in of_array]
                notes[-1] += f"; the others are {leaves[0]} to {leaves[-1]}" if len(leaves) > 1 else ""
            warnings += notes
            if time is not None or len(of_array) > N_COMPARED:
                warnings += ask_whether_runs(of_array, where)
        columns += of_array
    if clocks and rate_hz is None:
        time = RawColumn("time", signals[clocks[0]].reshape(-1), "s")
    if clocks:
        leaves = list(dict.fromkeys(path.rpartition(".")[2] for path in clocks))
        warnings.append(f"taken as times, not as channels: {', '.join(leaves[:8])}")
    # A channel is named by the last part of its path if that is unique.
    leaves = [c.name.rpartition(".")[2] for c in columns]
    columns = [replace(c, name=leaf) if leaves.count(leaf) == 1 else c for c, leaf in zip(columns, leaves, strict=True)]
    speeds_rpm, speed, hints = _stated_speed(scalars)
    warnings += hints
    if short := [path for path in short if path.rpartition(".")[2] not in pulses]:
        warnings.append(f"shorter than a tenth of the longest signal and left out: {', '.join(short[:8])}")
    return RawTable(
        tuple(columns),
        reader,
        sampling_rate_hz=rate_hz,
        time=time,
        warnings=tuple(warnings),
        speed=speed,
        speeds_rpm=speeds_rpm,
        pulse_times_s=pulses,
    )


def _rates_of_clocks(signals: Mapping[str, NumberArray]) -> tuple[dict[str, float], list[str]]:
    """Return the signals' rates by the time vectors of their length, and these; empty unless there are several."""
    times = [path for path, a in signals.items() if seconds_per_unit(path.rpartition(".")[2], "") is not None]
    rates: dict[int, float] = {}
    for path in times:
        t = signals[path].reshape(-1)
        if rises(t):
            rates[len(t)] = (len(t) - 1) / float(t[-1] - t[0])
    if len(rates) < 2:
        return {}, []
    of_length = {path: max(a.shape) for path, a in signals.items() if path not in times}
    return {path: rates[n] for path, n in of_length.items() if n in rates}, times


def _at_highest_rate(
    signals: dict[str, NumberArray], rates_hz: Mapping[str, float], rate_hz: float | None, arrays: NamedArrays
) -> tuple[dict[str, NumberArray], float | None, list[str]]:
    """Leave out signals sampled below the highest stated rate, but interpolate speeds in rpm."""
    if rates_hz.keys().isdisjoint(signals):
        return signals, rate_hz, []
    stated = {path: hz for path in signals if (hz := rates_hz.get(path, rate_hz)) is not None}
    highest = max(stated.values())
    slower = {path: hz for path, hz in stated.items() if hz < (1 - 1e-3) * highest}
    n = max(max(a.shape) for path, a in signals.items() if path not in slower)
    kept = {path: a for path, a in signals.items() if path not in slower}
    for path, hz in slower.items():
        values = signals[path].reshape(-1)
        if _unit(path, arrays).casefold() in RPM_UNITS and abs(len(values) / hz - n / highest) <= 2 / hz:
            kept[path] = np.interp(np.arange(n) / highest, np.arange(len(values)) / hz, values)
    names = {path: path.rpartition(".")[2] for path in slower}
    left_out = [name for path, name in names.items() if path not in kept]
    interpolated = [name for path, name in names.items() if path in kept]
    notes = [f"sampled slower than {highest:.6g} Hz and left out: {', '.join(left_out[:8])}"] if left_out else []
    notes += [f"sampled slower and interpolated to {highest:.6g} Hz: {', '.join(interpolated)}"] if interpolated else []
    return kept, highest, notes


def _is_pulse_times(path: str, array: NumberArray) -> bool:
    """Whether a vector is named like a tachometer and always increases: times, not samples."""
    is_vector = 1 in array.shape or array.ndim == 1
    named = re.match(r"tach|keyphas", path.rpartition(".")[2], re.IGNORECASE) is not None
    return named and is_vector and array.dtype.kind in "fiu" and bool(np.all(np.diff(array.reshape(-1)) > 0))


def _is_clock(path: str, array: NumberArray) -> bool:
    """Whether a vector is the time of other channels, e.g. Dewesoft's Data1_time_AI_1; plain "time" is a time column.

    "X097_DE_time" is a signal over time: only what increases is a clock.
    """
    leaf = path.rpartition(".")[2]
    if (1 not in array.shape and array.ndim > 1) or seconds_per_unit(leaf, "") is not None or array.dtype.kind == "c":
        return False
    named = re.search(r"(?:^|[_\W])time(?:[_\W]|$)", leaf, re.IGNORECASE) is not None
    return named and bool(np.all(np.diff(array.reshape(-1)) > 0))


def _unit(path: str, arrays: NamedArrays) -> str:
    return arrays.units.get(path, "") or arrays.texts.get(f"{path.rpartition('.')[0]}.unit".lstrip("."), "")


def _columns(path: str, array: NumberArray, arrays: NamedArrays, where: str) -> list[RawColumn]:
    unit = _unit(path, arrays)
    if 1 in array.shape or array.ndim == 1:
        name = path if path != PurePath(where).stem else _column_name(path, 1, where)
        return [RawColumn(name, array.reshape(-1), unit)]
    over_time = array if array.shape[0] < array.shape[1] else array.T
    if len(over_time) > 0.5 * over_time.shape[1]:
        raise InputError(
            f"{path!r} has shape {array.shape}: it is not clear which dimension is time",
            where=where,
            allowed="a matrix with many more samples than channels",
            remedy="save each channel as a vector",
        )
    return [RawColumn(_column_name(path, i, where), row, unit) for i, row in enumerate(over_time, 1)]


def _column_name(path: str, number: int, where: str) -> str:
    """Name a column of a matrix; the name of a matrix named after its file is not used, as it differs by recording."""
    return f"ch{number}" if path == PurePath(where).stem else f"{path}_{number}"


def _one_rate(scalars: Mapping[str, NumberArray], stated_hz: float | None, where: str) -> float | None:
    """Return the sampling rate as stated, or from scalars with such names; rates take precedence over intervals."""
    rates = {} if stated_hz is None else {"the file": stated_hz}
    intervals: dict[str, float] = {}
    for path, array in scalars.items():
        if array.dtype.kind not in "fiu":
            continue
        value = float(array.reshape(-1)[0])
        if plain_name(path) in RATE_NAMES:
            rates[path] = value
        elif plain_name(path) in INTERVAL_NAMES:
            intervals[path] = value
    if not rates and intervals:
        bad = [f"{path} = {dt:g}" for path, dt in intervals.items() if not 0 < dt < np.inf]
        if bad:
            raise InputError(
                f"the sampling interval {bad[0]} s is not positive", where=where, allowed="> 0 s", remedy="give --fs"
            )
        rates = {path: 1 / dt for path, dt in intervals.items()}
    values = list(rates.values())
    if values and max(values) - min(values) > 1e-3 * abs(max(values)):
        shown = ", ".join(f"{path} = {hz:g} Hz" for path, hz in list(rates.items())[:4])
        raise InputError(
            f"states several sampling rates: {shown}",
            where=where,
            allowed="one rate for all channels",
            remedy="split the file, or correct the one that is wrong",
        )
    return values[0] if values else None


def _stated_speed(scalars: Mapping[str, NumberArray]) -> tuple[dict[str, float], ConstantSpeed | None, list[str]]:
    """Return all scalars in rpm, the speed if they agree on one, and hints at possible speeds that were not used."""
    values = {path: float(a.reshape(-1)[0]) for path, a in scalars.items() if a.dtype.kind in "fiu"}
    in_rpm = {path: value for path, value in values.items() if plain_name(path).endswith("rpm")}
    possible = {path: value for path, value in values.items() if plain_name(path) in SPEED_NAMES or path in in_rpm}
    stated = set(in_rpm.values())
    if len(stated) == 1 and 0 < min(stated) < np.inf:
        return in_rpm, ConstantSpeed(min(stated)), []
    hints = [
        f"{path} = {value:g} may be a nominal shaft speed ({'rpm' if path in in_rpm else 'Hz or rpm'}); it was not used"
        for path, value in possible.items()
    ]
    return in_rpm, None, hints
