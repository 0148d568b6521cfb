"""The elements of a MAT v5 file, checked before a library sees them.

The C code behind `scipy.io.loadmat` trusts type codes: a damaged file can make it read beyond its tables and end the
whole program. Here every tag is looked at first. Source of the layout: MathWorks, MAT-File Format, "Level 5 MAT-File
Format".
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from math import prod
from pathlib import Path
from typing import NoReturn

from gearsig.errors import InputError
from gearsig.recording.limits import CHUNK_BYTES, check_memory

HEADER_BYTES = 128
MATRIX, COMPRESSED = 14, 15
PLAIN_TYPES = frozenset((1, 2, 3, 4, 5, 6, 7, 9, 12, 13, 16, 17, 18))
"""Codes of numbers and text: int8 to uint64, single, double, UTF-8 to UTF-32."""
CLASSES = range(1, 18)
"""Cell, struct, object, char, sparse, the numeric classes, function, opaque."""
CELL, OPAQUE = 1, 17
MAX_DEPTH = 32


def elements(path: Path) -> Iterator[bytes]:
    """Yield each variable of a file as a complete little file of its own: header and unpacked element.

    Raises
    ------
    InputError
        If an element is cut off, damaged or would not fit into memory; the byte is named.
    """
    n_bytes = path.stat().st_size
    total = 0
    with path.open("rb") as file:
        order = ">" if file.read(HEADER_BYTES)[126:128] == b"MI" else "<"
        header = b"MATLAB 5.0 MAT-file".ljust(116) + bytes(8) + struct.pack(order + "HH", 0x0100, 0x4D49)
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
            check_memory(2 * (total + size), path.name)
            body = tag + file.read(size)
            if kind == COMPRESSED:
                body = _unpacked(body[8:], path.name, at, total)
            total += len(body)
            _check_variable(memoryview(body), order, path.name, at)
            yield header + body
            at += 8 + size
    if total == 0:
        _fail(path.name, HEADER_BYTES, "there is no variable after the header")


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
            check_memory(2 * (before + size), where)
    except zlib.error as error:
        _fail(where, at, f"a compressed variable is damaged ({error})")
    if not stream.eof:
        _fail(where, at, "a compressed variable is cut off")
    return b"".join(chunks)


def _check_variable(body: memoryview, order: str, where: str, at: int) -> None:
    if len(body) < 8 or struct.unpack_from(order + "I", body)[0] != MATRIX:
        _fail(where, at, "no variable begins where one should")
    found = list(_tags(body, order, where, at))
    if len(found) != 1:
        _fail(where, at, "a variable is shorter than stated")
    _check_matrix(found[0][1], order, where, at, MAX_DEPTH)


def _check_matrix(body: memoryview, order: str, where: str, at: int, depth: int) -> None:
    """Check one array: flags, dimensions, name, then its parts, which may be arrays again."""
    if len(body) == 0:
        return
    if depth == 0:
        _fail(where, at, f"arrays are nested more than {MAX_DEPTH} deep")
    parts = list(_tags(body, order, where, at))
    if len(parts) < 3 or parts[0][0] != 6 or len(parts[0][1]) != 8:
        _fail(where, at, "an array has no description")
    kind = struct.unpack_from(order + "I", parts[0][1])[0] & 0xFF
    if kind not in CLASSES:
        _fail(where, at, f"an array is of the unknown class {kind}")
    if kind != OPAQUE:
        if parts[1][0] != 5 or len(parts[1][1]) % 4 or not 2 <= len(parts[1][1]) // 4 <= 32:
            _fail(where, at, "an array has no dimensions")
        shape = struct.unpack(f"{order}{len(parts[1][1]) // 4}i", parts[1][1])
        # A sparse array may be larger than what is stored of it, but is no signal.
        if min(shape) < 0 or prod(shape) > max(len(body), 1):
            _fail(where, at, f"an array of shape {shape} is stored in {len(body)} bytes")
        if kind == CELL and prod(shape) != sum(code == MATRIX for code, _ in parts):
            _fail(where, at, f"a cell of shape {shape} holds another number of arrays")
    for code, part in parts:
        if code == MATRIX:
            _check_matrix(part, order, where, at, depth - 1)


def _tags(body: memoryview, order: str, where: str, at: int) -> Iterator[tuple[int, memoryview]]:
    """Yield type and content of the elements that follow one another in an element."""
    position = 0
    while position < len(body):
        if position + 8 > len(body):
            _fail(where, at, "an element is cut off")
        code, size = struct.unpack_from(order + "II", body, position)
        if code >> 16:  # small element: length and type in one word, content in the next
            code, size, start = code & 0xFFFF, code >> 16, position + 4
            step = 8
        else:
            start = position + 8
            step = 8 + size + (-size % 8 if code != MATRIX else 0)
        if code != MATRIX and code not in PLAIN_TYPES:
            _fail(where, at, f"an element is of the unknown type {code}")
        if start + size > len(body) or (step == 8 and size > 4 and start == position + 4):
            _fail(where, at, "an element is longer than what holds it")
        yield code, body[start : start + size]
        position += step


def _fail(where: str, at: int, what: str) -> NoReturn:
    raise InputError(
        f"{what} (byte {at})",
        where=where,
        allowed="a complete MAT file",
        remedy="the file was damaged or not written completely: save it again",
    )
