"""National Instruments' TDMS files."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from gearsig.errors import InputError
from gearsig.recording._limits import check_decoded, check_memory
from gearsig.recording._table import NamedArrays, RawTable, table_from_arrays
from gearsig.recording._types import RATE_NAMES, plain_name
from gearsig.recording.formats._format import FileFormat, begins

READER = "gearsig TDMS reader"


def read_tdms(path: Path, part: slice | None = None) -> RawTable:
    """Return the channels of a TDMS file, scaled as its properties say.

    The rate is one over the waveform property "wf_increment", or a property of the channel, its group or the file that
    is named like a sampling rate; the unit is "unit_string". Channels of text or time stamps, and channels sampled
    slower than others, are left out.

    Raises
    ------
    InputError
        If the file is damaged or does not fit into memory.
    """
    from nptdms import TdmsFile

    where = path.name
    if part is None:
        check_memory(3 * path.stat().st_size, where)
    # The open file is passed, not its name: the index file beside it may belong to another recording and is not read.
    with _quiet(), path.open("rb") as stream, TdmsFile.open(stream) as file:
        _check_complete(file, where)
        channels = {}
        units = {}
        rates_hz: dict[str, float] = {}
        left_out = []
        if part is None:
            check_decoded(sum(8 * len(channel) for group in file.groups() for channel in group.channels()), path)
        for group in file.groups():
            for channel in group.channels():
                # A dot separates the levels of names; within a name it would split it.
                name = f"{group.name}.{channel.name.replace('.', '_')}"
                if channel.dtype.kind not in "fiub":
                    left_out.append(channel.name)
                    continue
                channels[name] = np.asarray(channel[part or slice(None)])
                units[name] = str(channel.properties.get("unit_string", ""))
                stated_hz = _waveform_rate(channel, name, where) or next(
                    filter(None, (_stated_rate(owner.properties) for owner in (channel, group, file))), None
                )
                rates_hz |= {} if stated_hz is None else {name: stated_hz}
    notes = (f"channels that hold no numbers were left out: {', '.join(left_out[:8])}",) if left_out else ()
    return table_from_arrays(NamedArrays(channels, {}, units, rates_hz, notes), READER, where)


def tdms_length(path: Path) -> int:
    """Return the number of samples of the longest numeric channel."""
    from nptdms import TdmsFile

    with _quiet(), path.open("rb") as stream, TdmsFile.open(stream) as file:
        channels = (c for group in file.groups() for c in group.channels() if c.dtype.kind in "fiub")
        return max((len(channel) for channel in channels), default=0)


@contextmanager
def _quiet() -> Iterator[None]:
    """Keep the library from also printing what is raised here as an error."""
    from nptdms.log import log_manager

    before = log_manager.log_level
    log_manager.set_level(logging.CRITICAL)
    try:
        yield
    finally:
        log_manager.set_level(before)


def _check_complete(file: Any, where: str) -> None:
    """Raise if the last segment is truncated: the library would return what is there."""
    if file.file_status.incomplete_final_segment:
        raise InputError(
            "the last segment is cut off",
            where=where,
            allowed="a complete TDMS file",
            remedy="the file was not closed or copied completely: copy or export it again",
        )


def _waveform_rate(channel: Any, name: str, where: str) -> float | None:
    increment_s = channel.properties.get("wf_increment")
    if increment_s is None:
        return None
    if not isinstance(increment_s, (int, float)) or not increment_s > 0:
        raise InputError(
            f"wf_increment of channel {name!r} is {increment_s!r}",
            where=where,
            allowed="> 0 s",
            remedy="give --fs or correct it in the file",
        )
    return 1.0 / float(increment_s)


def _stated_rate(properties: Any) -> float | None:
    stated = (value for name, value in properties.items() if plain_name(name) in RATE_NAMES)
    return next((float(v) for v in stated if isinstance(v, (int, float)) and not isinstance(v, bool)), None)


TDMS = FileFormat("TDMS", (".tdms",), begins("TDMS", b"TDSm"), read_tdms, read_part=read_tdms, length=tdms_length)
