"""The chunks of a RIFF/WAVE file beside its samples."""

from __future__ import annotations

import math
import struct
from dataclasses import dataclass
from pathlib import Path

from gearsig.errors import InputError

MAX_CHUNK_BYTES = 1 << 26


@dataclass(frozen=True)
class LeaChannel:
    """Name, value of full scale and unit of one channel."""

    name: str
    scale: float
    unit: str


def find_chunks(path: Path) -> dict[bytes, bytes]:
    """Return the chunks other than "data" by name; refuse a file whose chunks are longer than the file.

    Raises
    ------
    InputError
        If the file is cut off or has no data chunk.
    """
    n_bytes = path.stat().st_size
    chunks: dict[bytes, bytes] = {}
    has_data = False
    with path.open("rb") as file:
        head = file.read(12)
        order = ">" if head[:4] == b"RIFX" else "<"
        if head[:4] == b"RF64":  # 64-bit lengths stand in a chunk of their own; scipy checks them
            return chunks
        while len(tag := file.read(8)) == 8:
            name, size = tag[:4], struct.unpack(order + "I", tag[4:])[0]
            end = file.tell() + size
            if end > n_bytes:
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
            file.seek(end + (size & 1))  # chunks begin at even bytes
    if not has_data or b"fmt " not in chunks:
        missing = "samples" if b"fmt " in chunks else "format description"
        raise InputError(
            f"holds no {missing}", where=path.name, allowed="a complete WAV file", remedy="export it again"
        )
    return chunks


def parse_lea(chunk: bytes) -> list[LeaChannel]:
    """Return names, scales and units from a LEA chunk, an empty list if it is not as inferred here.

    The layout is not published; it was inferred from one file whose scales are known. Per channel: four bytes "le"
    and the channel number in two digits, length (uint32), value of full scale (float32), name and unit, each with its
    length (uint16) before it, two float32 that are not used (in that file: 0, and a figure of at most 1). It is taken
    only if every length fits exactly.
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
