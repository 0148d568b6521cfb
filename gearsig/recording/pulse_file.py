"""Reads tachometer pulse times from a text file."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from gearsig.checks import FloatArray, count
from gearsig.errors import InputError
from gearsig.recording.formats.csv_layout import find_layout
from gearsig.recording.formats.csv_rows import line_of_row, parse_rows
from gearsig.recording.identify import identify
from gearsig.recording.limits import read_text_bytes
from gearsig.recording.names import split_unit
from gearsig.recording.time_axis import SECONDS_PER_UNIT
from gearsig.rig.speed import PulseTimes


def read_pulse_times(path: str | Path, pulses_per_revolution: int = 1, shaft: str = "") -> PulseTimes:
    """Read pulse times from a text file with one column, in seconds unless its header states another unit.

    Parameters
    ----------
    path : str or Path
        Text with one time per line, with or without a header ("time [ms]").
    pulses_per_revolution : int
    shaft : str
        The shaft that carries the pulse wheel.

    Returns
    -------
    PulseTimes
        On the time axis of the recording that it belongs to.

    Raises
    ------
    InputError
        If there are fewer than two pulses, more than one column, or a time is not after the one before it; the line
        is named.
    """
    file = Path(path)
    where = file.name
    count(pulses_per_revolution, "pulses_per_revolution")
    kind = identify(file)
    if kind != "CSV text":
        raise InputError(
            f"is {kind}", where=where, allowed="text with one pulse time per line", remedy="export as text"
        )
    data = read_text_bytes(file)
    if not any(c in b"0123456789" for c in data[: 1 << 20]):
        raise InputError(
            "holds no pulses",
            where=where,
            allowed="at least two pulse times",
            remedy="check the sensor and the trigger",
        )
    layout = find_layout(data, where)
    if layout.n_columns != 1:
        raise InputError(
            f"has {layout.n_columns} columns", where=where, allowed="one column of times", remedy="keep the times alone"
        )
    (times,) = parse_rows(data, layout, ("time",), where)
    _check_times(times, where, lambda row: line_of_row(data, layout, row))
    unit = split_unit(layout.header[0])[1].casefold() if layout.header else ""
    if unit not in SECONDS_PER_UNIT:
        raise InputError(
            f"the unit of the times is {unit!r}",
            where=where,
            allowed="s, ms, us, min",
            remedy="convert them to seconds",
        )
    return PulseTimes(times * SECONDS_PER_UNIT[unit], pulses_per_revolution, shaft)


def _check_times(times: FloatArray, where: str, line_of: Callable[[int], int]) -> None:
    bad = np.flatnonzero(~np.isfinite(times))
    if len(bad):
        raise InputError(
            f"line {line_of(int(bad[0]))}: the time is {times[bad[0]]}",
            where=where,
            allowed="finite numbers",
            remedy="remove the line knowingly",
        )
    if len(times) < 2:
        raise InputError(
            "holds only one pulse",
            where=where,
            allowed="at least two pulse times",
            remedy="one pulse gives no speed: check the sensor and the trigger",
        )
    back = np.flatnonzero(np.diff(times) <= 0)
    if len(back):
        i = int(back[0])
        verb = "runs backwards" if times[i + 1] < times[i] else "stands still"
        raise InputError(
            f"line {line_of(i + 1)}: time {verb}, {times[i]:.9g} is followed by {times[i + 1]:.9g}",
            where=where,
            allowed="strictly increasing times",
            remedy="sort out where the counter restarted, or cut the file there",
        )
