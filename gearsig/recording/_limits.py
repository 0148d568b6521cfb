"""Memory limits: a file that would not fit is refused before it is decoded."""

from __future__ import annotations

import gzip
import os
import re
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from math import inf, isfinite
from pathlib import Path

from gearsig.errors import GearsigError, InputError

CGROUPS = Path("/sys/fs/cgroup")
"""Where Linux exposes the memory limits of containers."""


def free_memory_bytes() -> float | None:
    """Return the memory still available, in the system and in its container; None if neither is known."""
    limits = [free for free in (_system_free_bytes(), container_free_bytes()) if free is not None]
    smallest = min(limits, default=inf)
    return smallest if isfinite(smallest) else None


def container_free_bytes(cgroup_file: Path = Path("/proc/self/cgroup"), mount: Path = CGROUPS) -> float | None:
    """Return the memory that this program's control groups, up to the outermost, still allow; None without a limit.

    Cached files do not count as used, because they can be dropped.

    Parameters
    ----------
    cgroup_file : Path
        Lines "id:controllers:path": no controllers in version 2, "memory" among them in version 1.
    mount : Path
        Where the groups are mounted; those of version 1 in a folder "memory".
    """
    limits: list[float | None] = []
    try:
        lines = cgroup_file.read_text(encoding="utf-8").splitlines()
    except OSError:
        return None
    for line in lines:
        _, _, fields = line.partition(":")
        controllers, _, path = fields.partition(":")
        if not controllers:
            root, names = mount, ("memory.max", "memory.current", "inactive_file")
        elif "memory" in controllers.split(","):
            root, names = mount / "memory", ("memory.limit_in_bytes", "memory.usage_in_bytes", "total_inactive_file")
        else:
            continue
        inner = root / path.strip("/")
        # A container may see its own group as the root, whatever its path is called outside.
        groups = (inner, *(parent for parent in inner.parents if parent == root or root in parent.parents))
        limits += [_group_free_bytes(group, *names) for group in groups]
    return min((free for free in limits if free is not None), default=None)


def _group_free_bytes(group: Path, limit_name: str, used_name: str, cached_name: str) -> float | None:
    try:
        limit = float((group / limit_name).read_text(encoding="ascii").replace("max", "inf"))
        used = float((group / used_name).read_text(encoding="ascii"))
        stat = dict(line.split() for line in (group / "memory.stat").read_text(encoding="ascii").splitlines())
        return max(limit - used + float(stat.get(cached_name, 0.0)), 0.0)
    except (OSError, ValueError):
        return None


def _system_free_bytes() -> float | None:
    try:
        with Path("/proc/meminfo").open(encoding="ascii") as file:
            for line in file:
                if line.startswith("MemAvailable:"):
                    return float(line.split()[1]) * 1024.0
    except (OSError, ValueError, IndexError):
        pass
    try:  # without such a file: half of the installed memory
        return 0.5 * os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    except (OSError, ValueError, AttributeError):
        return None


CHUNK_BYTES = 1 << 22
HEAD_BYTES = 1 << 16
MAX_RATIO = 200
"""Numbers compress by 2 to 20 in any format; anything far beyond carries no information."""
FREE_BYTES = 1 << 26
"""Below this decoded size the ratio is not checked: short files may be very regular."""
UNTOLD_BYTES = 4 << 30
"""Assumed to be free if the system does not say."""


def available_memory_bytes() -> int:
    """Return the memory available without swapping, assumed to be 4 GB if the system does not say."""
    free = free_memory_bytes()
    return UNTOLD_BYTES if free is None else int(free)


def check_memory(
    needed_bytes: float,
    where: str,
    free_bytes: float | None = None,
    *,
    part: float = 0.5,
    remedy: str = "split the file or export fewer channels",
) -> None:
    """Raise if something needs more than a given part of the available memory.

    Parameters
    ----------
    needed_bytes : float
    where : str
        File, or what is computed.
    free_bytes : float or None
        None: what is available without swapping.
    part : float
        Of the free memory. Default: half for decoding; the other half is for the analysis.
    remedy : str

    Raises
    ------
    InputError
        Stating what is needed and what is allowed.
    """
    allowed = part * (available_memory_bytes() if free_bytes is None else free_bytes)
    if needed_bytes > allowed:
        raise InputError(
            f"takes about {needed_bytes / 1e9:.3g} GB of memory",
            where=where,
            allowed=f"up to {allowed / 1e9:.3g} GB on this machine now",
            remedy=remedy,
        )


def check_decoded(decoded_bytes: int, path: Path, *, at_once_bytes: int | None = None) -> None:
    """Raise if a file is a decompression bomb, or if its decoded content does not fit into memory twice.

    Formats that state their sizes are checked before decoding, streams as they grow.

    Parameters
    ----------
    decoded_bytes : int
        Of the whole file.
    path : Path
    at_once_bytes : int or None
        What is decoded at once if the file is read in parts; None: all of it.

    Raises
    ------
    InputError
        If it exceeds `FREE_BYTES` and `MAX_RATIO` times the file's size, or does not fit into memory.
    """
    if decoded_bytes > max(FREE_BYTES, MAX_RATIO * path.stat().st_size):
        raise InputError(
            f"decompresses to more than {MAX_RATIO} times its size",
            where=path.name,
            allowed=f"a ratio up to {MAX_RATIO}",
            remedy="check that it is a recording; if so, unpack it first",
        )
    check_memory(2 * (decoded_bytes if at_once_bytes is None else at_once_bytes), path.name)


def read_gzip(path: Path) -> bytes:
    """Return the decompressed bytes of a text file.

    Raises
    ------
    InputError
        If the stream is damaged, truncated or empty; see also `check_decoded`.
    """
    chunks: list[bytes] = []
    size = 0
    try:
        with gzip.open(path, "rb") as file:
            while chunk := file.read(CHUNK_BYTES):
                size += len(chunk)
                check_decoded(size, path)
                refuse_nul(chunk, path.name)
                chunks.append(chunk)
    except (EOFError, zlib.error, gzip.BadGzipFile) as error:
        raise InputError(
            f"the gzip stream is damaged or cut off ({error})",
            where=path.name,
            allowed="a complete gzip file",
            remedy="copy the file again",
        ) from error
    if not size:
        raise InputError("is empty", where=path.name, allowed="a file with data", remedy="copy or export it again")
    return b"".join(chunks)


def read_text_bytes(path: Path) -> bytes:
    """Return the bytes of a text file, plain or gzip; refuse one that holds NUL bytes or does not fit into memory."""
    with path.open("rb") as file:
        head = file.read(4)
        if head[:2] == b"\x1f\x8b":
            return read_gzip(path)
        if head[:2] in (b"\xff\xfe", b"\xfe\xff"):
            check_memory(4 * path.stat().st_size, path.name)
            return _from_utf16(path)
        file.seek(0)
        # The first lines show how many numbers to expect: 8 bytes each as read, and again as samples.
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
    """Raise if text holds NUL bytes, like a file that was allocated but never written."""
    if b"\0" in chunk:
        zeros = "only zero bytes" if not chunk.strip(b"\0") else "zero bytes"
        raise InputError(
            f"holds {zeros} where text is expected",
            where=where,
            allowed="plain text (UTF-8)",
            remedy="the file was not written completely, or it is not a text file: export it again",
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


@contextmanager
def foreign_errors(where: str, file_format: str) -> Iterator[None]:
    """Raise `InputError` if reading fails inside the block; gearsig's own errors pass, with the file's name added.

    So do errors of the program: failed assertions, and modules that cannot be imported. Check the caller's other
    arguments before the block, or the file is blamed for them.
    """
    try:
        yield
    except InputError as error:
        if where in error.where:
            raise
        place = f"{where}: {error.where}" if error.where else where
        raise InputError(
            error.what.removeprefix(f"{where}: "),
            where=place,
            allowed=error.allowed,
            remedy=error.remedy or "export it again",
        ) from error
    except (GearsigError, AssertionError, ImportError):
        raise
    except MemoryError as error:
        raise InputError(
            f"does not fit into memory as {file_format}",
            where=where,
            allowed=f"up to {available_memory_bytes() / 1e9:.3g} GB on this machine now",
            remedy="split the file or export fewer channels; if it is small, it is damaged",
        ) from error
    except PermissionError as error:
        raise InputError(
            f"cannot be opened ({error.strerror or error})",
            where=where,
            allowed="a readable file",
            remedy="check the permissions of the file",
        ) from error
    except Exception as error:  # parsers raise anything on damaged bytes, one of them bare Exception
        reason = str(error)[:200] or type(error).__name__
        raise InputError(
            f"cannot be read as {file_format} ({reason})",
            where=where,
            allowed=f"a complete {file_format} file",
            remedy="the file is damaged or was cut off: copy or export it again",
        ) from error
