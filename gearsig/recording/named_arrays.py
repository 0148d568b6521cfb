"""Sorts the named arrays of a MAT or HDF5 file into signals, sampling rate and the rest."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from gearsig.errors import InputError
from gearsig.recording.names import INTERVAL_NAMES, RATE_NAMES, SPEED_NAMES, plain_name
from gearsig.recording.raw_table import NumberArray, RawColumn, RawTable

SHORT_SHARE = 0.1
"""A vector shorter than this share of the longest is no signal beside it but a setting or a result."""


@dataclass(frozen=True)
class NamedArrays:
    """What a file holds, by path ("bearing.gs").

    Parameters
    ----------
    arrays : mapping of str to array
        Numbers of one or two dimensions.
    texts : mapping of str to str
    units : mapping of str to str
        Units of arrays where the file states them.
    rates_hz : mapping of str to float
        Sampling rates that are stated for an array.
    warnings : tuple of str
    """

    arrays: Mapping[str, NumberArray]
    texts: Mapping[str, str] = field(default_factory=dict)
    units: Mapping[str, str] = field(default_factory=dict)
    rates_hz: Mapping[str, float] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()


def table_from_arrays(found: NamedArrays, reader: str, where: str) -> RawTable:
    """Return the table of a file of named arrays.

    Arrays with one element are settings; among them the sampling rate is known by its name. Vectors are channels, and
    a matrix is one channel per column or row, whichever are fewer. Vectors much shorter than the longest are left out.

    Raises
    ------
    InputError
        If no array is a signal, or the file states two sampling rates.
    """
    scalars = {path: a for path, a in found.arrays.items() if a.size == 1}
    signals = {path: a for path, a in found.arrays.items() if a.size > 1 and a.ndim <= 2 and a.dtype.kind in "fiubc"}
    if not signals:
        names = ", ".join(list(found.arrays)[:8]) or "nothing"
        raise InputError(
            f"holds no signal, only {names}",
            where=where,
            allowed="vectors or matrices of numbers",
            remedy="save the signals as plain arrays (no tables or objects)",
        )
    rate_hz = _one_rate(scalars, found.rates_hz, where)
    longest = max(max(a.shape) for a in signals.values())
    short = [path for path, a in signals.items() if max(a.shape) < SHORT_SHARE * longest]
    columns = [c for path, a in signals.items() if path not in short for c in _columns(path, a, found, where)]
    warnings = [*found.warnings, *_speed_hints(scalars)]
    if short:
        warnings.append(f"shorter than a tenth of the longest signal and left out: {', '.join(short[:8])}")
    return RawTable(tuple(_with_short_names(columns)), reader, sampling_rate_hz=rate_hz, warnings=tuple(warnings))


def _columns(path: str, array: NumberArray, found: NamedArrays, where: str) -> list[RawColumn]:
    unit = found.units.get(path, "") or found.texts.get(f"{path.rpartition('.')[0]}.unit".lstrip("."), "")
    if 1 in array.shape or array.ndim == 1:
        return [RawColumn(path, array.reshape(-1), unit)]
    over_time = array if array.shape[0] < array.shape[1] else array.T
    if len(over_time) > 0.5 * over_time.shape[1]:
        raise InputError(
            f"{path!r} has shape {array.shape}: it is not clear which is time",
            where=where,
            allowed="a matrix with many more samples than channels",
            remedy="save each channel as a vector",
        )
    return [RawColumn(f"{path}_{i + 1}", row, unit) for i, row in enumerate(over_time)]


def _with_short_names(columns: list[RawColumn]) -> list[RawColumn]:
    """Call a channel by the last part of its path where that is unique."""
    from dataclasses import replace

    leaves = [c.name.rpartition(".")[2] for c in columns]
    return [
        replace(c, name=leaf if leaves.count(leaf) == 1 else c.name) for c, leaf in zip(columns, leaves, strict=True)
    ]


def _one_rate(scalars: Mapping[str, NumberArray], stated_hz: Mapping[str, float], where: str) -> float | None:
    """Return the sampling rate from the scalars whose name says so; rates go before intervals."""
    rates = {path: float(hz) for path, hz in stated_hz.items()}
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


def _speed_hints(scalars: Mapping[str, NumberArray]) -> list[str]:
    """Mention scalars that may be a shaft speed: which shaft, and how true, the file does not say."""
    hints = []
    for path, array in scalars.items():
        name = plain_name(path)
        if (name in SPEED_NAMES or name.endswith("rpm")) and array.dtype.kind in "fiu":
            unit = "rpm" if "rpm" in name else "Hz or rpm"
            hints.append(
                f"{path} = {float(array.reshape(-1)[0]):g} may be a nominal shaft speed ({unit}); it was not used"
            )
    return hints
