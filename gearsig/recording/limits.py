"""Bounds on memory: a file that would not fit is refused before it is decoded."""

from __future__ import annotations

import gzip
import re
import zlib
from pathlib import Path

from gearsig.errors import InputError
from gearsig.recording.free_memory import free_memory_bytes

CHUNK_BYTES = 1 << 22
HEAD_BYTES = 1 << 16
MAX_GZIP_RATIO = 200
"""Text of numbers shrinks by 2 to 20; anything far beyond carries no information."""
GZIP_FREE_BYTES = 1 << 26
"""Below this decoded size the ratio is not looked at: short files may be very regular."""
UNTOLD_BYTES = 4 << 30
"""Taken as free where the system does not tell."""


def available_memory_bytes() -> int:
    """Return the memory that can be had without swapping, a guess of 4 GB where the system does not tell."""
    free = free_memory_bytes()
    return UNTOLD_BYTES if free is None else int(free)


def check_memory(needed_bytes: int, where: str) -> None:
    """Raise if decoding needs more than half of the available memory; the other half is for the analysis."""
    allowed = available_memory_bytes() // 2
    if needed_bytes > allowed:
        raise InputError(
            f"decoded size is about {needed_bytes / 1e9:.3g} GB",
            where=where,
            allowed=f"up to {allowed / 1e9:.3g} GB on this machine now",
            remedy="split the file or export fewer channels",
        )


def read_gzip(path: Path) -> bytes:
    """Return the decompressed bytes, stopping at a decompression bomb.

    Raises
    ------
    InputError
        If the stream is damaged or cut off, shrinks by more than `MAX_GZIP_RATIO`, or would not fit into memory.
    """
    packed = path.stat().st_size
    largest = max(GZIP_FREE_BYTES, MAX_GZIP_RATIO * packed)
    chunks: list[bytes] = []
    size = 0
    try:
        with gzip.open(path, "rb") as file:
            while chunk := file.read(CHUNK_BYTES):
                size += len(chunk)
                if size > largest:
                    raise InputError(
                        f"decompresses to more than {MAX_GZIP_RATIO} times its size",
                        where=path.name,
                        allowed=f"a ratio up to {MAX_GZIP_RATIO}",
                        remedy="this is no recording; if it is, unpack it first",
                    )
                check_memory(2 * size, path.name)
                refuse_nul(chunk, path.name)
                chunks.append(chunk)
    except (EOFError, zlib.error, gzip.BadGzipFile) as error:
        raise InputError(
            f"the gzip stream is damaged or cut off ({error})",
            where=path.name,
            allowed="a complete gzip file",
            remedy="copy the file again",
        ) from error
    return b"".join(chunks)


def read_text_bytes(path: Path) -> bytes:
    """Return the bytes of a text file, plain or gzip; refuse one that holds NUL bytes or would not fit."""
    with path.open("rb") as file:
        head = file.read(4)
        if head[:2] == b"\x1f\x8b":
            return read_gzip(path)
        if head[:2] in (b"\xff\xfe", b"\xfe\xff"):
            check_memory(4 * path.stat().st_size, path.name)
            return _from_utf16(path)
        file.seek(0)
        # The numbers on the first lines tell how many there will be: 8 bytes each as read and again as samples.
        first = file.read(HEAD_BYTES)
        numbers_per_byte = len(re.findall(rb"[^\s,;]+", first)) / len(first)
        check_memory(int((2 + 16 * numbers_per_byte) * path.stat().st_size), path.name)
        file.seek(0)
        chunks = []
        while chunk := file.read(CHUNK_BYTES):
            refuse_nul(chunk, path.name)
            chunks.append(chunk)
    return b"".join(chunks)


def refuse_nul(chunk: bytes, where: str) -> None:
    """Raise if text holds NUL bytes, as a file that was allocated but never written does."""
    if b"\0" in chunk:
        zeros = "only zero bytes" if not chunk.strip(b"\0") else "zero bytes"
        raise InputError(
            f"holds {zeros} where text is expected",
            where=where,
            allowed="plain text (UTF-8)",
            remedy="the file was not written completely, or it is no text file: export it again",
        )


def _from_utf16(path: Path) -> bytes:
    try:
        return path.read_bytes().decode("utf-16").encode("utf-8")
    except UnicodeDecodeError as error:
        raise InputError(
            f"starts like UTF-16 text but is not ({error.reason})",
            where=path.name,
            allowed="plain text",
            remedy="export it as UTF-8",
        ) from None
