"""WAV files, with channel scales from a LEA chunk if there is one."""

from __future__ import annotations

import io
import math
import struct
import warnings
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from gearsig.errors import InputError
from gearsig.recording._limits import check_memory
from gearsig.recording._table import NumberArray, RawColumn, RawTable
from gearsig.recording._types import Recording
from gearsig.recording.formats._format import FileFormat, metadata_json, table_from_metadata

# --------------------
# The chunks of a RIFF/WAVE file other than its samples.
# --------------------


MAX_CHUNK_BYTES = 1 << 26
OWN_CHUNK = b"gsig"


@dataclass(frozen=True)
class LeaChannel:
    """Name, value of full scale and unit of one channel."""

    name: str
    scale: float
    unit: str


def find_chunks(path: Path) -> tuple[dict[bytes, bytes], int]:
    """Return the chunks other than "data" by name, and the position after the last.

    Bytes after the audio that are not a chunk, as some vendors append, are left out.

    Raises
    ------
    InputError
        If the audio, or a chunk with units or scales, is truncated, or if samples or their format are missing.
    """
    n_bytes = path.stat().st_size
    chunks: dict[bytes, bytes] = {}
    has_data = False
    with path.open("rb") as file:
        head = file.read(12)
        order = ">" if head[:4] == b"RIFX" else "<"
        if head[:4] == b"RF64":  # 64-bit lengths are in a separate chunk; scipy checks them
            return chunks, n_bytes
        last = file.tell()
        while len(tag := file.read(8)) == 8:
            name, size = tag[:4], struct.unpack(order + "I", tag[4:])[0]
            end = file.tell() + size
            if end > n_bytes:
                if has_data and name not in (OWN_CHUNK, b"LEA "):  # those carry units and scales
                    break
                raise InputError(
                    f"chunk {name.decode('latin-1')!r} is stated with {size} bytes, {end - n_bytes} are missing",
                    where=path.name,
                    allowed="a complete WAV file",
                    remedy="the file was cut off: copy or record it again",
                )
            if name == b"data":
                has_data = size > 0
            elif size <= MAX_CHUNK_BYTES:
                chunks[name] = file.read(size)
            last = min(end + (size & 1), n_bytes)  # chunks begin at even bytes
            file.seek(last)
    if not has_data or b"fmt " not in chunks:
        missing = "samples" if b"fmt " in chunks else "format description"
        raise InputError(
            f"holds no {missing}", where=path.name, allowed="a complete WAV file", remedy="export it again"
        )
    return chunks, last


def parse_lea(chunk: bytes) -> list[LeaChannel]:
    """Return names, scales and units from a LEA chunk; empty if it does not have the layout inferred here.

    The layout is not published; it was inferred from one file whose scales are known. Per channel: four bytes, "le"
    and the channel number in two digits; length (uint32); value of full scale (float32); name and unit, each preceded
    by its length (uint16); two unused float32 (in that file: 0, and a number of at most 1). The chunk is used only if
    every length fits exactly.
    """
    channels: list[LeaChannel] = []
    try:
        while chunk:
            if chunk[:4] != b"le%02d" % len(channels):
                return []
            (size,) = struct.unpack_from("<I", chunk, 4)
            body, chunk = chunk[8 : 8 + size], chunk[8 + size :]
            (scale,) = struct.unpack_from("<f", body, 0)
            name, at = _counted_text(body, 4)
            unit, at = _counted_text(body, at)
            if len(body) != size or at + 8 != size or not math.isfinite(scale) or scale <= 0 or not name:
                return []
            channels.append(LeaChannel(name, scale, unit))
    except (struct.error, UnicodeDecodeError):
        return []
    return channels


def _counted_text(body: bytes, at: int) -> tuple[str, int]:
    (length,) = struct.unpack_from("<H", body, at)
    return body[at + 2 : at + 2 + length].decode("utf-8"), at + 2 + length


READER = "gearsig WAV reader"

# Zero and full scale of the integer types as scipy returns them; 24-bit samples are left-justified in 32.
_SCALES = {"uint8": (128.0, 128.0), "int16": (0.0, 2.0**15), "int32": (0.0, 2.0**31), "int64": (0.0, 2.0**63)}


def read_wav(path: Path, part: slice | None = None) -> RawTable:
    """Return the channels of a WAV file, scaled to ±1 full scale.

    Integers of 8 to 64 bit are divided by their full scale, floats are kept. Channels are named "ch1", "ch2", … with
    the unit "FS" (full scale), unless a LEA chunk states names, scales and units; otherwise a rig's sensors give
    scales.

    Raises
    ------
    InputError
        If the file is truncated or its coding is not PCM or float.
    """
    from scipy.io import wavfile

    where = path.name
    chunks, end = find_chunks(path)
    n_bytes = path.stat().st_size
    if part is None:
        check_memory(6 * n_bytes, where)
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # a warning means a damaged file, and becomes an error
        # Chunks unknown to scipy are harmless: find_chunks has checked the lengths.
        warnings.filterwarnings("ignore", message="Chunk .*not understood")
        if part is None:
            rate_hz, frames = wavfile.read(path if end == n_bytes else _up_to(path, end))
        else:
            rate_hz, frames = wavfile.read(path, mmap=True)
            frames = np.array(frames[part])
    rows = [frames] if frames.ndim == 1 else list(frames.T)
    if OWN_CHUNK in chunks:
        return table_from_metadata(chunks[OWN_CHUNK].decode("utf-8", errors="replace"), rows, READER, where)
    described = parse_lea(chunks.get(b"LEA ", b""))
    columns = [_column(i, row, described if len(described) == len(rows) else []) for i, row in enumerate(rows)]
    notes = (f"{n_bytes - end} bytes after the audio are not a WAV chunk and were left out",) if end < n_bytes else ()
    return RawTable(tuple(columns), READER, sampling_rate_hz=float(rate_hz), warnings=notes)


def wav_length(path: Path) -> int:
    """Return the number of samples per channel; 24-bit samples, which cannot be mapped, are refused."""
    from scipy.io import wavfile

    find_chunks(path)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return len(wavfile.read(path, mmap=True)[1])


def _up_to(path: Path, end: int) -> io.BytesIO:
    """Return the file without the bytes after its last chunk, and with that length in its header."""
    with path.open("rb") as file:
        whole = bytearray(file.read(end))
    whole[4:8] = struct.pack(">I" if whole[:4] == b"RIFX" else "<I", end - 8)
    return io.BytesIO(whole)


def _column(i: int, values: NumberArray, described: list[LeaChannel]) -> RawColumn:
    scaled = _to_full_scale(values)
    if not described:
        return RawColumn(f"ch{i + 1}", scaled, "FS")
    channel = described[i]
    return RawColumn(channel.name, scaled * scaled.dtype.type(channel.scale), channel.unit)


def _to_full_scale(values: NumberArray) -> NumberArray:
    """Return values scaled to ±1: float32 for up to 24 bit, which it holds exactly, else float64."""
    if values.dtype.kind == "f":
        return values
    if values.dtype.name not in _SCALES:
        raise InputError(
            f"coding {values.dtype} is not known", allowed="8, 16, 24, 32, 64 bit integer, 32, 64 bit float"
        )
    zero, full = _SCALES[values.dtype.name]
    narrow = values.dtype.itemsize <= 2 or (values.dtype == np.int32 and not np.any(values & 0xFF))
    scaled: NumberArray = values.astype(np.float32 if narrow else np.float64)
    scaled -= zero
    scaled /= full
    return scaled


def write_wav(recording: Recording, path: Path) -> None:
    """Write float32 samples in the channels' units, and the JSON in a chunk "gsig"."""
    from scipy.io import wavfile

    rate_hz = round(recording.sampling_rate_hz)
    n_bytes = 4 * recording.samples.size
    # The header holds the bytes per second in 32 bits, and those per frame in 16.
    if (
        rate_hz < 1
        or 4 * rate_hz * len(recording.channels) >= 2**32
        or len(recording.channels) >= 2**14
        or n_bytes > 0xF000_0000
    ):
        raise InputError(
            f"{rate_hz} Hz × {len(recording.channels)} channels × {n_bytes / 1e9:.3g} GB does not fit",
            where="WAV",
            allowed="from 1 Hz, below 4 GB/s, 16384 channels and 4 GB",
            remedy="write .h5",
        )
    largest = float(np.abs(recording.samples).max())
    if largest > float(np.finfo(np.float32).max):
        raise InputError(f"a sample is {largest:g}", where="WAV", allowed="what fits float32", remedy="write .h5")
    wavfile.write(path, rate_hz, np.ascontiguousarray(recording.samples.T, dtype=np.float32))
    text = metadata_json(recording).encode()
    text += b" " * (len(text) % 2)  # chunks begin at even bytes
    with path.open("r+b") as file:
        file.seek(0, io.SEEK_END)
        file.write(OWN_CHUNK + struct.pack("<I", len(text)) + text)
        n_riff = file.tell() - 8
        file.seek(4)
        file.write(struct.pack("<I", n_riff))


def _sniff(head: bytes) -> str:
    return "WAV" if head[:4] in (b"RIFF", b"RIFX", b"RF64") and head[8:12] == b"WAVE" else ""


WAV = FileFormat("WAV", (".wav", ".wave"), _sniff, read_wav, write_wav, (".wav",), read_wav, wav_length)
