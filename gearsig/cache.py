"""Where a user's machine keeps what can be computed again, and how a file gets there whole."""

from __future__ import annotations

import os
import platform
import secrets
import shutil
import sys
import time
from collections.abc import Callable, Iterable
from contextlib import suppress
from hashlib import sha256
from importlib.util import find_spec
from pathlib import Path
from typing import IO, Any
from zipfile import ZipFile
from zlib import crc32

import numpy as np

from gearsig.errors import InputError

FRESH = "add --fresh to gearsig simulate, flexible, gear-body or gap, which clears such files away, or delete this one"
"""What makes a file again that another version of the code kept."""

FOLDERS = ("GEARSIG_CACHE", "XDG_CACHE_HOME", "LOCALAPPDATA")
"""Variables that say where; the first names the folder itself."""


class OtherVersionError(InputError):
    """A kept file was made by another version of the code."""


def cache_folder(room: str) -> Path:
    """Return this user's folder for one kind of kept results; the variable GEARSIG_CACHE names another place.

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
    """Return a hidden name beside a file's place for what is not complete; it says which process of which machine."""
    # Names have 255 bytes, and a letter up to four.
    begin = os.fsencode(path.name)[:120].decode("utf-8", "ignore")
    return path.with_name(f".{begin}.{_machine()}-{os.getpid()}-{secrets.token_hex(4)}.part")


def remove_parts(folder: Path) -> None:
    """Remove what processes have left that were killed: of this machine what runs no more, of others after an hour."""
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
    """Return whether a process runs; where the system cannot be asked without harm, it may."""
    if sys.platform == "win32":
        return True
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except OSError:  # it is another user's
        return True
    return True


def write_whole(path: Path, write: Callable[[IO[bytes]], object], *, remedy: str = "choose another folder") -> Path:
    """Write a file beside its place and move it there: whole or not at all; its folder is made where there is none.

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
        raise InputError(f"cannot be written ({error.strerror or error})", where=str(path), remedy=remedy) from None
    finally:  # also on Ctrl-C
        with suppress(OSError):
            part.unlink(missing_ok=True)
    return path


def made_folder(folder: Path, remedy: str = "choose another with -o") -> Path:
    """Make a folder where there is none, and return it.

    Raises
    ------
    InputError
        If it cannot be made: a file of that name, a place that may not be written.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(
            f"the folder cannot be made ({error.strerror or error})", where=str(folder), remedy=remedy
        ) from None
    return folder


def write_text(path: Path, text: str) -> Path:
    """Write a result as a text, whole or not at all; a failure leaves what was there before.

    Raises
    ------
    InputError
        If it cannot be written.
    """
    content = text.encode("utf-8", "replace")
    return write_whole(path, lambda file: file.write(content), remedy="choose another folder with -o")


def keep(path: Path, write: Callable[[IO[bytes]], object]) -> bool:
    """Write a file that can be made again; where its place cannot be written, the next process makes it again.

    Returns
    -------
    bool
        Whether it is kept. Work of minutes is never lost for it: results do not hang on a cache.
    """
    try:
        write_whole(path, write)
    except InputError:
        return False
    return True


def read_arrays(path: Path, most_bytes: int) -> dict[str, Any] | None:
    """Return a kept file's arrays; None where there is no such file, or it is damaged, or unpacks to more than that."""
    try:
        with ZipFile(path) as archive:
            if sum(entry.file_size for entry in archive.infolist()) > most_bytes:
                return None
        with np.load(path, allow_pickle=False) as data:
            return {name: data[name] for name in data.files}
    except Exception:  # noqa: BLE001 - damaged bytes make its readers raise anything: zlib.error, TokenError, RuntimeError
        return None


def modules_digest(modules: Iterable[str]) -> str:
    """Return a short hash of the code of modules, by which it shows that a kept file is of another state of it."""
    digest = sha256()
    for name in modules:
        spec = find_spec(name)
        if spec is None or spec.origin is None:
            raise ModuleNotFoundError(name)
        digest.update(name.encode() + b"\0" + Path(spec.origin).read_bytes())
    return digest.hexdigest()[:16]
