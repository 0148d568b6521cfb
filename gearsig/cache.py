"""The user's cache of results that can be recomputed, and atomic writing of files."""

from __future__ import annotations

import os
import platform
import secrets
import shutil
import sys
import time
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from hashlib import sha256
from importlib.util import find_spec
from pathlib import Path
from typing import IO, Any
from zipfile import ZIP_DEFLATED, ZipFile
from zlib import crc32

import numpy as np
from numpy.typing import NDArray

from gearsig.errors import InputError, not_written

FRESH = "add --fresh to gearsig simulate, flexible, gear-body or gap, which clears such files away, or delete this one"
"""Remedy for a cached file from another version of the code."""

FOLDERS = ("GEARSIG_CACHE", "XDG_CACHE_HOME", "LOCALAPPDATA")
"""Environment variables for the cache; the first names the folder itself, the others its parent."""


class OtherVersionError(InputError):
    """A cached file was made by another version of the code."""


def cache_folder(room: str) -> Path:
    """Return the user's cache folder for one kind of results; the variable GEARSIG_CACHE names another place.

    Parameters
    ----------
    room : str
        Name of the kind, e.g. "gap" or "gears".
    """
    if os.environ.get("GEARSIG_CACHE"):
        return Path(os.environ["GEARSIG_CACHE"]) / room
    if sys.platform == "win32":
        base = Path(os.environ.get("LOCALAPPDATA") or Path.home() / "AppData" / "Local")
    else:
        base = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    return base / "gearsig" / room


def part_beside(path: Path) -> Path:
    """Return a hidden temporary name beside a file's path; it contains the process and machine that write it."""
    # File names have at most 255 bytes, and a character up to four.
    begin = os.fsencode(path.name)[:120].decode("utf-8", "ignore")
    return path.with_name(f".{begin}.{_machine()}-{os.getpid()}-{secrets.token_hex(4)}.part")


def remove_parts(folder: Path) -> None:
    """Remove temporary files of killed processes: on this machine at once, from other machines after an hour."""
    for part in folder.glob(".*.part"):
        machine, _, process = part.name.split(".")[-2].rpartition("-")[0].partition("-")
        with suppress(OSError):
            if machine == _machine() and process.isdigit():
                is_left = int(process) == os.getpid() or not _runs(int(process))
            else:
                is_left = time.time() - part.stat().st_mtime > 3600.0
            if is_left and part.is_dir():
                shutil.rmtree(part)
            elif is_left:
                part.unlink()


def _machine() -> str:
    return f"{crc32(platform.node().encode()):08x}"


def _runs(process: int) -> bool:
    """Whether a process is running; assumed so where the system offers no harmless check."""
    if sys.platform == "win32":
        return True
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except OSError:  # it belongs to another user
        return True
    return True


def write_whole(path: Path, write: Callable[[IO[bytes]], object], *, remedy: str = "choose another folder") -> Path:
    """Write a file atomically, under a temporary name that is then renamed; its folder is created if missing.

    Raises
    ------
    InputError
        If the folder cannot be written.
    """
    part = part_beside(path)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with part.open("xb") as file:
            write(file)
        part.replace(path)
    except OSError as error:
        raise not_written(error, path, remedy) from None
    finally:  # also on Ctrl-C
        with suppress(OSError):
            part.unlink(missing_ok=True)
    return path


def made_folder(folder: Path, remedy: str = "choose another with -o") -> Path:
    """Create a folder if it does not exist, and return it.

    Raises
    ------
    InputError
        If it cannot be created: a file has that name, or the place is not writable.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(
            f"the folder cannot be made ({error.strerror or error})", where=str(folder), remedy=remedy
        ) from None
    return folder


def write_text(path: Path, text: str) -> Path:
    """Write a result as a text file atomically; a failure leaves any earlier file untouched.

    Raises
    ------
    InputError
        If it cannot be written.
    """
    content = text.encode("utf-8", "replace")
    return write_whole(path, lambda file: file.write(content), remedy="choose another folder with -o")


def keep(path: Path, write: Callable[[IO[bytes]], object]) -> bool:
    """Write a file to the cache; if that fails, the next process computes it again.

    Returns
    -------
    bool
        Whether it was written. A failure does not raise: no result depends on the cache.
    """
    try:
        write_whole(path, write)
    except InputError:
        return False
    return True


def write_arrays(path: Path, arrays: Mapping[str, NDArray[Any]]) -> None:
    """Write arrays that `read_arrays` reads: an .npz file, as small as deflation makes it, column by column.

    It is 7 % smaller than one of `numpy.savez_compressed`, whose level is fixed.
    """

    def write(file: IO[bytes]) -> None:
        with ZipFile(file, "w", ZIP_DEFLATED, compresslevel=9) as archive:
            for name, values in arrays.items():
                with archive.open(f"{name}.npy", "w") as entry:
                    np.lib.format.write_array(entry, np.asarray(values, order="F"), allow_pickle=False)

    write_whole(path, write)


def read_arrays(path: Path, most_bytes: int) -> dict[str, Any] | None:
    """Return the arrays of a cached file; None if missing, damaged or larger than `most_bytes` when unpacked."""
    try:
        with ZipFile(path) as archive:
            if sum(entry.file_size for entry in archive.infolist()) > most_bytes:
                return None
        with np.load(path, allow_pickle=False) as data:
            return {name: np.asarray(data[name], order="C") for name in data.files}
    except Exception:  # noqa: BLE001 - damaged files raise anything: zlib.error, TokenError, RuntimeError
        return None


def modules_digest(modules: Iterable[str]) -> str:
    """Return a short hash of the code of modules, to detect cached files from another version of it."""
    digest = sha256()
    for name in modules:
        spec = find_spec(name)
        if spec is None or spec.origin is None:
            raise ModuleNotFoundError(name)
        digest.update(name.encode() + b"\0" + Path(spec.origin).read_bytes())
    return digest.hexdigest()[:16]
