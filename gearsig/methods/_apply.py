"""The table of all methods, and the application of one of them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from gearsig.checks import known_name, positive
from gearsig.diagnosis import MEMORY_BYTES, RecordBlocks, record_blocks
from gearsig.errors import InputError
from gearsig.formatting import file_label
from gearsig.methods._decompose import PARTS
from gearsig.methods._orders import ALONG
from gearsig.methods._phase import IN_PHASE
from gearsig.methods._spectra import MODULATIONS, WHOLE
from gearsig.methods._table import Method, MethodAnswer, part_of, usual_channel
from gearsig.methods._timefreq import MAPS
from gearsig.prepared import PreparedRecording, prepare
from gearsig.recording import Recording
from gearsig.rig import Rig, SpeedSource

METHODS: dict[str, Method] = {**WHOLE, **ALONG, **MODULATIONS, **MAPS, **PARTS, **IN_PHASE}
"""The methods by their names on the command line and in reports."""


def apply_method(
    name: str,
    recording: Recording | PreparedRecording,
    channel: str = "",
    *,
    start_s: float | None = None,
    end_s: float | None = None,
    **options: Any,
) -> MethodAnswer:
    """Apply a method to one channel of a recording in memory.

    Parameters
    ----------
    name : str
        One of `METHODS`.
    recording : Recording or PreparedRecording
    channel : str
        Empty: the first acceleration, else the first channel that is not a tachometer.
    start_s, end_s : float or None
        Part of the recording; None: all.
    **options
        Those of the method.

    Raises
    ------
    InputError
        If there is no such method or channel, or an option or its value is not allowed.
    RefusalError
        If the recording does not allow the method, e.g. because the speed is not known or it is too short.
    """
    method, settings = _method(name, options)
    prepared = prepare(recording)
    if start_s is not None or end_s is not None:
        end = prepared.recording.duration_s if end_s is None else end_s
        prepared = part_of(prepared, start_s or 0.0, end)
    answer = method.answer(prepared, usual_channel(prepared.recording, channel), **settings)
    return replace(answer, method=name)


def _method(name: str, options: Mapping[str, Any]) -> tuple[Method, dict[str, Any]]:
    """Return a method and all its options after checking them."""
    method = METHODS[known_name(name, METHODS, f"there is no method {name!r}")]
    defined = {option.name: option for option in method.options}
    for key, value in options.items():
        if key not in defined:
            fitting = [n for n, m in METHODS.items() if key in (o.name for o in m.options)]
            remedy = (
                f"it is an option of {', '.join(fitting)}" if fitting else f"it takes {', '.join(defined) or 'none'}"
            )
            raise InputError(f"{name} takes no {key.replace('_', ' ')}", remedy=remedy)
        defined[key].check(value)
    return method, {key: option.default for key, option in defined.items()} | dict(options)


# --------------------
# Recordings in files, which may be larger than memory.
# --------------------

PROGRAM_BYTES = 2e8
"""Memory that Python and its libraries take."""
READING_BYTES = 24.0
"""Memory per sample of each channel: as read, as a number, and during checks."""
ANGLE_BYTES = 220.0
"""Memory per sample to refine a stated speed by the vibration, if there is no tachometer."""


def apply_method_to_file(
    name: str,
    path: str | Path,
    rig: Rig | None = None,
    channel: str = "",
    *,
    start_s: float | None = None,
    end_s: float | None = None,
    memory_bytes: float = MEMORY_BYTES,
    sampling_rate_hz: float | None = None,
    speed: SpeedSource | None = None,
    **options: Any,
) -> MethodAnswer:
    """Apply a method to a file in bounded memory: to all of it if it fits, else in blocks if the method allows it.

    Parameters
    ----------
    name, channel, start_s, end_s, **options
        As in `apply_method`.
    path : str or Path
    rig : Rig or None
    memory_bytes : float
        Memory that may be used, at least 0.25 GB.
    sampling_rate_hz, speed
        As in `read_recording`.

    Raises
    ------
    InputError
        As in `apply_method` and `read_recording`; or if the part does not fit and the method does not work in blocks,
        or the format can only be read as a whole.
    """
    method, settings = _method(name, options)
    allowed = positive(memory_bytes - PROGRAM_BYTES, "memory less 0.2 GB", "bytes", remedy="allow more than 0.2 GB")
    how_to_read: dict[str, Any] = {"rig": rig, "sampling_rate_hz": sampling_rate_hz, "speed": speed}
    record = record_blocks(path, **how_to_read)
    n_samples, rate = record.n_samples, record.head.sampling_rate_hz
    first = min(n_samples - 1, max(0, round((start_s or 0.0) * rate)))
    last = n_samples if end_s is None else max(first + 1, min(n_samples, round(end_s * rate)))
    per_sample = method.bytes_per_sample(settings) if callable(method.bytes_per_sample) else method.bytes_per_sample
    reading, is_part = READING_BYTES * len(record.head.channels), last - first < n_samples
    whole_bytes = n_samples * (reading + (ANGLE_BYTES if is_part else 0.0)) + (last - first) * per_sample
    if whole_bytes <= allowed:
        return apply_method(name, record.whole(), channel, start_s=start_s, end_s=end_s, **options)
    part_bytes = (last - first) * (reading + per_sample)
    if record.is_parted and part_bytes <= allowed:
        return apply_method(name, record.read(slice(first, last)), channel, **options)
    if record.is_parted and method.in_blocks is not None:
        return _in_blocks(name, method, record_blocks(path, **how_to_read, part=slice(first, last)), channel, settings)
    longest_s = float(f"{0.9 * allowed / (reading + per_sample) / rate:.2g}")
    begin_s = start_s or 0.0
    remedy = f"look at a part, e.g. --from {begin_s:g}s --to {begin_s + longest_s:g}s, or give more with --memory"
    if not record.is_parted:
        remedy += ", or convert it to HDF5, Parquet, TDMS or WAV, which are read in parts"
    elif method.in_blocks is None:
        all_of_it = ", ".join(block_method for block_method, m in METHODS.items() if m.in_blocks is not None)
        remedy += f"; methods for the whole recording: {all_of_it}"
    needed = part_bytes if record.is_parted else whole_bytes
    raise InputError(
        f"{name} of {last - first} samples takes {needed / 1e9:.3g} GB",
        where=file_label(path),
        allowed=f"up to {memory_bytes / 1e9:.3g} GB",
        remedy=remedy,
    )


def _in_blocks(
    name: str, method: Method, blocks: RecordBlocks, channel: str, settings: Mapping[str, Any]
) -> MethodAnswer:
    """Apply a method that works in blocks; labels of its lines need only rig and angle of a prepared recording."""
    assert method.in_blocks is not None  # noqa: S101 - said to the type checker: looked at by the caller
    prepared = prepare(blocks.head)
    prepared.keep_angle(blocks.shaft_angle)
    answer = method.in_blocks(blocks, prepared, usual_channel(blocks.head, channel), **settings)
    duration_s = blocks.n_samples / blocks.head.sampling_rate_hz
    note = f"{duration_s:.5g} s exceed the memory and are analysed in blocks: the vibration does not refine the speed."
    return replace(answer, method=name, notes=(*answer.notes, note))
