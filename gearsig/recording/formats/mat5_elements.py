"""The variables of a MAT v5 file, one after another, unpacked."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NoReturn

from gearsig.errors import InputError
from gearsig.recording.formats.mat5_values import MATRIX, decode_variable, tags
from gearsig.recording.limits import CHUNK_BYTES, check_memory

HEADER_BYTES = 128
COMPRESSED = 15


def variables(path: Path) -> Iterator[tuple[str, Any]]:
    """Yield name and value of each variable, as `decode_variable` returns them.

    Raises
    ------
    InputError
        If the file is cut off, damaged or would not fit into memory; the byte is named where the variable begins.
    """
    n_bytes = path.stat().st_size
    total = 0
    with path.open("rb") as file:
        order = ">" if file.read(HEADER_BYTES)[126:128] == b"MI" else "<"
        at = HEADER_BYTES
        while at < n_bytes:
            file.seek(at)
            tag = file.read(8)
            if not tag.strip(b"\0"):
                _fail(path.name, at, "zero bytes where a variable should begin")
            if len(tag) < 8:
                _fail(path.name, at, "the last variable is cut off")
            kind, size = struct.unpack(order + "II", tag)
            if at + 8 + size > n_bytes:
                _fail(path.name, at, f"a variable of {size} bytes is cut off")
            check_memory(3 * (total + size), path.name)
            body = tag + file.read(size)
            if kind == COMPRESSED:
                body = _unpacked(body[8:], path.name, at, total)
            total += len(body)
            yield _decoded(memoryview(body), order, path.name, at)
            at += 8 + size
    if total == 0:
        _fail(path.name, HEADER_BYTES, "there is no variable after the header")


def _decoded(body: memoryview, order: str, where: str, at: int) -> tuple[str, Any]:
    try:
        found = list(tags(body, order))
        if len(found) != 1 or found[0][0] != MATRIX:
            _fail(where, at, "no variable begins where one should")
        return decode_variable(found[0][1], order)
    except InputError as error:
        if error.where:
            raise
        _fail(where, at, error.what)


def _unpacked(packed: bytes, where: str, at: int, before: int) -> bytes:
    """Decompress in chunks, so that a bomb is noticed early."""
    stream = zlib.decompressobj()
    chunks: list[bytes] = []
    size = 0
    try:
        while packed and not stream.eof:
            chunks.append(stream.decompress(packed, CHUNK_BYTES))
            packed = stream.unconsumed_tail
            size += len(chunks[-1])
            check_memory(3 * (before + size), where)
    except zlib.error as error:
        _fail(where, at, f"a compressed variable is damaged ({error})")
    if not stream.eof:
        _fail(where, at, "a compressed variable is cut off")
    return b"".join(chunks)


def _fail(where: str, at: int, what: str) -> NoReturn:
    raise InputError(
        f"{what} (byte {at})",
        where=where,
        allowed="a complete MAT file",
        remedy="the file was damaged or not written completely: save it again",
    )
