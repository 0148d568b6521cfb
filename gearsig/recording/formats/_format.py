"""What one file format is to the rest of the program."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from gearsig.recording._table import RawTable
from gearsig.recording._types import Recording

OWN_NAME = "gearsig_recording"
"""Dataset, variable or key that holds the description of a recording that gearsig wrote."""


@dataclass(frozen=True)
class FileFormat:
    """A file format: how it is recognized, read and written.

    Libraries of formats are heavy: `read` and `write` import them when they are called.

    Parameters
    ----------
    name : str
        As users are told it.
    endings : tuple of str
        Of files that are read, lower case, with the dot.
    sniff : callable
        A file's first bytes → the kind of content, e.g. "MAT v5"; empty where it is of another format.
    read : callable
        Path → `RawTable`; raises `InputError` where the file is damaged.
    read_part : callable, optional
        Path and a slice of samples → `RawTable` of these alone; None: the format is only read whole.
    length : callable, optional
        Path → samples per channel, without decoding them; beside `read_part`.
    write : callable, optional
        Writes a recording as a whole file at a path, so that `read` returns the same.
    written_endings : tuple of str
        Endings under which recordings are written.
    """

    name: str
    endings: tuple[str, ...]
    sniff: Callable[[bytes], str]
    read: Callable[[Path], RawTable]
    write: Callable[[Recording, Path], None] | None = None
    written_endings: tuple[str, ...] = ()
    read_part: Callable[[Path, slice], RawTable] | None = None
    length: Callable[[Path], int] | None = None
