"""The one place where the columns of a file become a Recording: rate, time, names, lengths, gaps."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace

import numpy as np

from gearsig.checks import FloatArray, positive
from gearsig.errors import InputError
from gearsig.formatting import counted
from gearsig.recording._limits import check_memory
from gearsig.recording._table import RawColumn, RawTable, rate_of_time, seconds_per_unit
from gearsig.recording._types import RPM_UNITS, Channel, Provenance, Recording, quantity_of
from gearsig.rig import ConstantSpeed, Rig, SpeedChannel, SpeedSource

PULSE_TIMES = (
    "times of tachometer pulses go with the recording that they belong to: gearsig analyze RECORDING --tach-times FILE "
    "(in Python speed=gearsig.recording.read_pulse_times(path))"
)


def assemble(
    table: RawTable,
    source: str,
    sha256: str,
    *,
    rig: Rig | None = None,
    sampling_rate_hz: float | None = None,
    speed: SpeedSource | None = None,
) -> Recording:
    """Return the recording that a file's table stands for.

    Parameters
    ----------
    table : RawTable
    source : str
        File name.
    sha256 : str
    rig, sampling_rate_hz, speed
        As in `read_recording`.

    Raises
    ------
    InputError
        On columns of unequal length, names that occur twice, text, complex numbers, NaN, a time column that is not
        uniform, or if no sampling rate is known.
    """
    table = _checked(table, source)
    rate_hz, rate_warnings = _sampling_rate(table, source, rig, sampling_rate_hz)
    channels = tuple(
        Channel(c.name, c.quantity or quantity_of(c.name, c.unit), c.unit, c.position) for c in table.columns
    )
    speed, speed_warnings = _speed(table, channels, rig, speed)
    recording = Recording(
        _stack(table, source),
        rate_hz,
        channels,
        speed=speed,
        provenance=Provenance(source, sha256, table.reader, table.history),
        truth=table.truth,
        warnings=(*table.warnings, *rate_warnings, *speed_warnings),
    )
    return recording if rig is None else recording.with_rig(rig)


def _checked(table: RawTable, source: str) -> RawTable:
    """Return the table with a column that is named like a time moved out of the channels; refuse what is no signal."""
    counts = Counter(c.name for c in (*table.columns, *([table.time] if table.time else [])))
    doubled = [name for name, n in counts.items() if n > 1]
    if doubled:
        raise InputError(
            f"column names occur more than once: {', '.join(map(repr, doubled))}",
            where=source,
            allowed="names that differ",
            remedy="rename the columns",
        )
    if table.time is None and not table.is_own_layout:
        time = next((c for c in table.columns if seconds_per_unit(c.name, c.unit) is not None), None)
        if time is not None and len(table.columns) == 1:
            raise InputError(
                f"the only column, {time.name!r}, is a time",
                where=source,
                allowed="at least one channel",
                remedy=PULSE_TIMES,
            )
        if time is not None:
            table = replace(table, columns=tuple(c for c in table.columns if c is not time), time=time)
    if not 0 < len(table.columns) <= 4096:
        raise InputError(
            f"{len(table.columns)} channels were found",
            where=source,
            allowed="1 to 4096",
            remedy="check that the file holds signals over time",
        )
    columns = table.columns if table.time is None else (table.time, *table.columns)
    for column in columns:
        if column.values.dtype.kind not in "fiub" or column.values.ndim != 1:
            dimensions = counted(column.values.ndim, "dimension")
            raise InputError(
                f"channel {column.name!r} holds {column.values.dtype} values of {dimensions}",
                where=source,
                allowed="real numbers over time",
                remedy="export the time signal",
            )
    lengths = {c.name: len(c.values) for c in columns}
    if len(set(lengths.values())) > 1:
        shown = ", ".join(f"{name!r} {n}" for name, n in list(lengths.items())[:8])
        raise InputError(
            f"the channels differ in length: {shown}",
            where=source,
            allowed="channels of equal length and rate",
            remedy="split the file into one for each length",
        )
    if not len(columns[0].values):
        raise InputError(
            "there are no samples",
            where=source,
            allowed="at least one",
            remedy="check that it was written completely",
        )
    return table


def _sampling_rate(
    table: RawTable, source: str, rig: Rig | None, explicit_hz: float | None
) -> tuple[float, tuple[str, ...]]:
    """Return the rate by precedence (argument, file, rig) and what contradicts it."""

    def differ(a: float, b: float) -> bool:
        return abs(a - b) > 1e-3 * abs(b)

    file_hz, timed_hz = table.sampling_rate_hz, None
    rig_hz = None if rig is None else rig.sampling_rate_hz
    if table.time is not None:
        scale_s = seconds_per_unit(table.time.name, table.time.unit) or 1.0
        timed_hz = rate_of_time(table.time.values, scale_s, f"{source}, column {table.time.name!r}", table.row_place)
    if file_hz is None:
        file_hz = timed_hz
    else:
        positive(file_hz, f"{source}: sampling rate in the file", "Hz", remedy="correct it there")
    if file_hz is None and len(table.columns) == 1 and _looks_like_times(table.columns[0]):
        raise InputError(
            f"the only column, {table.columns[0].name!r}, rises from each value to the next, as times of pulses do and "
            "no vibration",
            where=source,
            allowed="a signal over time",
            remedy=f"{PULSE_TIMES}; if it is a signal, name its unit in a header, as angle [rad], and give --fs",
        )
    if explicit_hz is not None:
        chosen_hz = positive(explicit_hz, f"{source}: sampling rate given", "Hz", remedy="give --fs above zero")
        if file_hz is not None and differ(chosen_hz, file_hz):
            return chosen_hz, (f"the sampling rate {chosen_hz:g} Hz was given; the file states {file_hz:.9g} Hz",)
        return chosen_hz, ()
    if file_hz is not None and timed_hz is not None and differ(file_hz, timed_hz):
        raise InputError(
            f"a rate of {file_hz:g} Hz is stated, the time column gives {timed_hz:.9g} Hz",
            where=source,
            allowed="statements that agree within 0.1 %",
            remedy="give the true one as --fs",
        )
    if file_hz is None and rig_hz is None:
        remedy = "give --fs or sampling_rate_hz in the rig file"
        raise InputError("states no sampling rate", where=source, allowed="above 0 Hz", remedy=remedy)
    if file_hz is not None and rig_hz is not None and differ(file_hz, rig_hz):
        text = f"the rig states a sampling rate of {rig_hz:g} Hz, the file {file_hz:.9g} Hz: the file's was taken"
        return file_hz, (text,)
    return file_hz or rig_hz or 0.0, ()


def _looks_like_times(column: RawColumn) -> bool:
    """Whether numbers of no known quantity increase from each to the next, from zero or later on.

    As times of pulses do and no vibration: of n noise values one order in n! increases, of ten one in 3.6 million.
    """
    values = column.values.astype(np.float64)
    unknown = (column.quantity or quantity_of(column.name, column.unit)) == "unknown"
    return unknown and len(values) >= 10 and bool(values[0] >= 0) and bool(np.all(np.diff(values) > 0))


def _stack(table: RawTable, source: str) -> FloatArray:
    """Return (channel, time) in float32 where that loses nothing, else in float64."""
    kinds = {c.values.dtype for c in table.columns}
    dtype = np.float32 if all(np.can_cast(kind, np.float32, "safe") for kind in kinds) else np.float64
    n_samples = len(table.columns[0].values)
    check_memory(n_samples * len(table.columns) * np.dtype(dtype).itemsize, source)
    samples = np.empty((len(table.columns), n_samples), dtype)
    for row, column in zip(samples, table.columns, strict=True):
        with np.errstate(invalid="ignore"):  # a signalling NaN, which is found in the next line
            row[:] = column.values
        bad = np.flatnonzero(~np.isfinite(row))
        if len(bad):
            place = table.row_place(int(bad[0]))
            raise InputError(
                f"channel {column.name!r} holds {counted(len(bad), 'NaN or infinite value')}, the first at {place}",
                where=source,
                allowed="finite numbers",
                remedy="cut out the gap or interpolate it before the analysis, knowingly",
            )
    return samples


def _speed(
    table: RawTable, channels: tuple[Channel, ...], rig: Rig | None, speed: SpeedSource | None
) -> tuple[SpeedSource | None, tuple[str, ...]]:
    """Return the speed source: the argument's, what measures it, what the file states, what the rig states."""
    if speed is not None or table.is_own_layout:
        return (table.speed, ()) if speed is None else (speed, _contradicted(speed, table, rig))
    known = None if rig is None else rig.speed
    measured = known is not None and not isinstance(known, ConstantSpeed)
    if table.speed is not None and not isinstance(table.speed, ConstantSpeed):
        return table.speed, ()
    in_rpm = [c for c in channels if c.quantity == "rotational_speed" and c.unit.casefold() in RPM_UNITS]
    if known is None and len(in_rpm) == 1:
        name = in_rpm[0].name
        return SpeedChannel(name), (f"channel {name!r} is in {in_rpm[0].unit} and was taken as the shaft speed",)
    if table.speed is None or measured:
        return None, ()
    of_file = table.speed.speed_rpm
    text = f"the file states {of_file:g} rpm, which was taken as the speed of the reference shaft"
    if isinstance(known, ConstantSpeed):
        if abs(of_file - known.speed_rpm) <= 1e-3 * of_file:
            return None, ()
        text = f"the rig states a speed of {known.speed_rpm:g} rpm, the file {of_file:g} rpm: the file's was taken"
    return ConstantSpeed(of_file, known.shaft if known is not None else ""), (text,)


def _contradicted(given: SpeedSource, table: RawTable, rig: Rig | None) -> tuple[str, ...]:
    """Say what else states a constant speed, where it differs from the one that was given and taken."""
    if not isinstance(given, ConstantSpeed):
        return ()
    stated = {"file": table.speed, "rig": None if rig is None else rig.speed}
    others = [
        f"the {name} states {source.speed_rpm:g} rpm"
        for name, source in stated.items()
        if isinstance(source, ConstantSpeed)
        and (source.shaft == given.shaft or "" in (source.shaft, given.shaft))
        and abs(source.speed_rpm - given.speed_rpm) > 1e-3 * source.speed_rpm
    ]
    return (f"the speed {given.speed_rpm:g} rpm was given and taken; {' and '.join(others)}",) if others else ()
