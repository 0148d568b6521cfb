"""Reads WAV files, with channel scales from a LEA chunk where there is one."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np

from gearsig.errors import InputError
from gearsig.recording.foreign_errors import foreign_errors
from gearsig.recording.formats.wav_chunks import LeaChannel, find_chunks, parse_lea
from gearsig.recording.formats.writers import WAV_CHUNK
from gearsig.recording.limits import check_memory
from gearsig.recording.metadata import table_from_metadata
from gearsig.recording.raw_table import NumberArray, RawColumn, RawTable

READER = "gearsig WAV reader"

# Zero and full scale of the integer types as scipy returns them; it left-justifies 24 bit in 32.
_SCALES = {"uint8": (128.0, 128.0), "int16": (0.0, 2.0**15), "int32": (0.0, 2.0**31), "int64": (0.0, 2.0**63)}


def read_wav(path: Path) -> RawTable:
    """Return the channels of a WAV file, scaled to ±1 full scale.

    Integers of 8 to 32 bit are divided by their full scale, floats are kept. Channels are called "ch1", "ch2", … with
    the unit "FS" (full scale), unless a LEA chunk states names, scales and units; a rig's sensors give scales else.

    Raises
    ------
    InputError
        If the file is cut off or its coding is not PCM or float.
    """
    from scipy.io import wavfile

    where = path.name
    chunks = find_chunks(path)
    check_memory(6 * path.stat().st_size, where)
    with foreign_errors(where, "WAV"), warnings.catch_warnings():
        warnings.simplefilter("error")  # a warning means a damaged file, and becomes an error
        # Chunks that scipy does not know are none of its business; find_chunks has checked the lengths.
        warnings.filterwarnings("ignore", message="Chunk .*not understood")
        rate_hz, frames = wavfile.read(path)
    rows = [frames] if frames.ndim == 1 else list(frames.T)
    if WAV_CHUNK in chunks:
        return table_from_metadata(chunks[WAV_CHUNK].decode("utf-8", errors="replace"), rows, READER, where)
    described = parse_lea(chunks.get(b"LEA ", b""))
    columns = [_column(i, row, described if len(described) == len(rows) else []) for i, row in enumerate(rows)]
    return RawTable(tuple(columns), READER, sampling_rate_hz=float(rate_hz))


def _column(i: int, values: NumberArray, described: list[LeaChannel]) -> RawColumn:
    scaled = _to_full_scale(values)
    if not described:
        return RawColumn(f"ch{i + 1}", scaled, "FS")
    channel = described[i]
    return RawColumn(channel.name, scaled * scaled.dtype.type(channel.scale), channel.unit)


def _to_full_scale(values: NumberArray) -> NumberArray:
    """Return ±1 full scale: float32 for up to 24 bit, which it holds exactly, float64 beyond."""
    if values.dtype.kind == "f":
        return values
    if values.dtype.name not in _SCALES:
        raise InputError(f"coding {values.dtype} is not known", allowed="8, 16, 24, 32 bit integer, 32, 64 bit float")
    zero, full = _SCALES[values.dtype.name]
    narrow = values.dtype.itemsize <= 2 or (values.dtype == np.int32 and not np.any(values & 0xFF))
    scaled: NumberArray = values.astype(np.float32 if narrow else np.float64)
    scaled -= zero
    scaled /= full
    return scaled
