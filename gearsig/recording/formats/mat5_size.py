"""Size of a MAT v5 file when decoded, found before anything is decoded."""

from __future__ import annotations

import struct
import zlib
from pathlib import Path

from gearsig.errors import InputError
from gearsig.recording.limits import CHUNK_BYTES, available_memory_bytes, check_memory

HEADER_BYTES = 128
COMPRESSED = 15  # miCOMPRESSED in the MAT-File Format document
MAX_DEFLATE_RATIO = 1032


def check_mat5_size(path: Path) -> None:
    """Walk over the elements of the file; refuse one that is cut off or would not fit into memory.

    Compressed elements are decompressed in chunks only to count them, and only where the file could be a bomb.
    """
    n_bytes = path.stat().st_size
    count_packed = MAX_DEFLATE_RATIO * n_bytes > available_memory_bytes() // 2
    total = 0
    with path.open("rb") as file:
        order = ">" if file.read(HEADER_BYTES)[126:128] == b"MI" else "<"
        at = HEADER_BYTES
        while at < n_bytes:
            file.seek(at)
            tag = file.read(8)
            if not tag.strip(b"\0"):
                _raise_cut(path, at, "zero bytes where a variable should begin")
            if len(tag) < 8:
                _raise_cut(path, at, "the last variable is cut off")
            kind, size = struct.unpack(order + "II", tag)
            if at + 8 + size > n_bytes:
                _raise_cut(path, at, f"a variable of {size} bytes is cut off")
            total += _unpacked_size(file.read(size), path, total) if kind == COMPRESSED and count_packed else size
            check_memory(2 * total, path.name)
            at += 8 + size
    if total == 0:
        _raise_cut(path, HEADER_BYTES, "there is no variable after the header")


def _unpacked_size(packed: bytes, path: Path, before: int) -> int:
    stream = zlib.decompressobj()
    size = 0
    while packed and not stream.eof:
        size += len(stream.decompress(packed, CHUNK_BYTES))
        packed = stream.unconsumed_tail
        check_memory(2 * (before + size), path.name)
    return size


def _raise_cut(path: Path, at: int, what: str) -> None:
    raise InputError(
        f"{what} (byte {at})",
        where=path.name,
        allowed="a complete MAT file",
        remedy="the file was not written or copied completely: save it again",
    )
