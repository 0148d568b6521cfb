"""Writes a recording to CSV, HDF5, Parquet, WAV or MAT."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable
from pathlib import Path

from gearsig.errors import InputError
from gearsig.recording.formats import writers
from gearsig.recording.types import Recording

Writer = Callable[[Recording, Path], None]
WRITERS: dict[str, Writer] = {
    ".csv": writers.write_csv,
    ".h5": writers.write_hdf5,
    ".hdf5": writers.write_hdf5,
    ".parquet": writers.write_parquet,
    ".wav": writers.write_wav,
    ".mat": writers.write_mat,
}


def write_recording(recording: Recording, path: str | Path) -> Path:
    """Write a recording in the format of the extension, so that `read_recording` returns the same.

    Every format keeps sampling rate, names, quantities, units, positions, the recording's own speed source, truth,
    warnings and history. What is lost:

    - all: the rig, which is a file of its own, and with it a speed source that only the rig has; the hash and reader
      of the file that the recording came from. Sensor scales that were applied stay applied.
    - WAV: float64 becomes float32, and other software sees the rate rounded to whole hertz.
    - Other software sees samples, names and rate, but quantities, positions, speed source and truth only as JSON.

    Parameters
    ----------
    recording : Recording
    path : str or Path
        .csv, .h5, .hdf5, .parquet, .wav or .mat (version 5); an existing file is replaced.

    Returns
    -------
    Path
        The file written.

    Raises
    ------
    InputError
        If the extension is not known, the folder is missing, or the format cannot hold the recording. Nothing is
        written then: the file is written beside its place and moved there when complete.
    """
    target = Path(path)
    writer = WRITERS.get(target.suffix.lower())
    if writer is None:
        raise InputError(
            f"extension {target.suffix or '(none)'!r} cannot be written",
            where=target.name,
            allowed=" ".join(WRITERS),
            remedy="choose one of these",
        )
    if not target.parent.is_dir():
        raise InputError(
            f"folder {str(target.parent)!r} does not exist", where=target.name, remedy="make the folder first"
        )
    try:
        handle, name = tempfile.mkstemp(dir=target.parent, prefix=f".{target.stem[:32]}-", suffix=target.suffix)
    except OSError as error:
        raise InputError(
            f"cannot be written ({error.strerror})", where=target.name, remedy="choose a folder that can be written to"
        ) from error
    os.close(handle)
    unfinished = Path(name)
    try:
        writer(recording, unfinished)
        unfinished.chmod(0o666 & ~_umask())
        unfinished.replace(target)
    except OSError as error:
        raise InputError(f"cannot be written ({error})", where=target.name, remedy="check the disk") from error
    finally:
        unfinished.unlink(missing_ok=True)
    return target


def _umask() -> int:
    """Return the process's file mode mask, which temporary files do not follow."""
    mask = os.umask(0)
    os.umask(mask)
    return mask
