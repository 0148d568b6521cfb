"""Reads a recording from a file of any known format."""

from __future__ import annotations

import hashlib
import os
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np

from gearsig.checks import FloatArray, count
from gearsig.errors import InputError
from gearsig.recording._assemble import assemble
from gearsig.recording._identify import identify
from gearsig.recording._limits import CHUNK_BYTES, read_text_bytes
from gearsig.recording._table import SECONDS_PER_UNIT, RawTable
from gearsig.recording._types import Recording, split_unit
from gearsig.recording.formats import _writers as writers
from gearsig.recording.formats._csv import find_layout, line_of_row, parse_rows
from gearsig.rig import PulseTimes, Rig, SpeedSource


def read_recording(
    path: str | Path,
    *,
    rig: Rig | None = None,
    sampling_rate_hz: float | None = None,
    speed: SpeedSource | None = None,
) -> Recording:
    """Read a recording from CSV, MAT v5 or v7.3, WAV, HDF5, Parquet, TDMS or UFF58.

    The extension and the content must agree. Nothing in a file is ever executed: pickles are refused, external links
    in HDF5 are not followed.

    Parameters
    ----------
    path : str or Path
    rig : Rig, optional
        Its sensors give the channels quantity, unit, scale and position; its speed and sampling rate are used where
        the file has none.
    sampling_rate_hz : float, optional
        Overrides the file's. A contradiction of more than 0.1 % is told in `Recording.warnings`.
    speed : SpeedSource, optional
        Overrides the file's and the rig's.

    Returns
    -------
    Recording
        Samples in float32 where the file's numbers fit it exactly, else in float64; what the reader noticed in
        `warnings`; file name (without its folder) and SHA-256 in `provenance`.

    Raises
    ------
    InputError
        If the file is missing, empty, damaged, too large for the memory, of another kind than its extension says, or
        holds columns that make no recording; if no sampling rate is known.
    """
    file = Path(path)
    table = _reader_of(identify(file))(file)
    return assemble(table, file.name, sha256_of(file), rig=rig, sampling_rate_hz=sampling_rate_hz, speed=speed)


def sha256_of(path: Path) -> str:
    """Return the hash of a file's bytes, read in chunks."""
    digest = hashlib.sha256()
    with path.open("rb") as file:
        while chunk := file.read(CHUNK_BYTES):
            digest.update(chunk)
    return digest.hexdigest()


def _reader_of(file_format: str) -> Callable[[Path], RawTable]:  # noqa: PLR0911  one line per format
    """Import a format's reader when it is needed: the libraries behind them are heavy."""
    match file_format:
        case "CSV text":
            from gearsig.recording.formats._csv import read_csv

            return read_csv
        case "MAT v5":
            from gearsig.recording.formats._mat import read_mat5

            return read_mat5
        case "MAT v7.3":
            from gearsig.recording.formats._mat import read_mat73

            return read_mat73
        case "WAV":
            from gearsig.recording.formats._wav import read_wav

            return read_wav
        case "HDF5":
            from gearsig.recording.formats._hdf5 import read_hdf5

            return read_hdf5
        case "Parquet":
            from gearsig.recording.formats._parquet import read_parquet

            return read_parquet
        case "TDMS":
            from gearsig.recording.formats._tdms import read_tdms

            return read_tdms
        case _:
            from gearsig.recording.formats._uff58 import read_uff58

            return read_uff58


# --------------------
# Writes a recording to CSV, HDF5, Parquet, WAV or MAT.
# --------------------


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


# --------------------
# Reads tachometer pulse times from a text file.
# --------------------


def read_pulse_times(path: str | Path, pulses_per_revolution: int = 1, shaft: str = "") -> PulseTimes:
    """Read pulse times from a text file with one column, in seconds unless its header states another unit.

    Parameters
    ----------
    path : str or Path
        Text with one time per line, with or without a header ("time [ms]").
    pulses_per_revolution : int
    shaft : str
        The shaft that carries the pulse wheel.

    Returns
    -------
    PulseTimes
        On the time axis of the recording that it belongs to.

    Raises
    ------
    InputError
        If there are fewer than two pulses, more than one column, or a time is not after the one before it; the line
        is named.
    """
    file = Path(path)
    where = file.name
    count(pulses_per_revolution, "pulses_per_revolution")
    kind = identify(file)
    if kind != "CSV text":
        raise InputError(
            f"is {kind}", where=where, allowed="text with one pulse time per line", remedy="export as text"
        )
    data = read_text_bytes(file)
    if not any(c in b"0123456789" for c in data[: 1 << 20]):
        raise InputError(
            "holds no pulses",
            where=where,
            allowed="at least two pulse times",
            remedy="check the sensor and the trigger",
        )
    layout = find_layout(data, where)
    if layout.n_columns != 1:
        raise InputError(
            f"has {layout.n_columns} columns", where=where, allowed="one column of times", remedy="keep the times alone"
        )
    (times,) = parse_rows(data, layout, ("time",), where)
    _check_times(times, where, lambda row: line_of_row(data, layout, row))
    unit = split_unit(layout.header[0])[1].casefold() if layout.header else ""
    if unit not in SECONDS_PER_UNIT:
        raise InputError(
            f"the unit of the times is {unit!r}",
            where=where,
            allowed="s, ms, us, min",
            remedy="convert them to seconds",
        )
    return PulseTimes(times * SECONDS_PER_UNIT[unit], pulses_per_revolution, shaft)


def _check_times(times: FloatArray, where: str, line_of: Callable[[int], int]) -> None:
    bad = np.flatnonzero(~np.isfinite(times))
    if len(bad):
        raise InputError(
            f"line {line_of(int(bad[0]))}: the time is {times[bad[0]]}",
            where=where,
            allowed="finite numbers",
            remedy="remove the line knowingly",
        )
    if len(times) < 2:
        raise InputError(
            "holds only one pulse",
            where=where,
            allowed="at least two pulse times",
            remedy="one pulse gives no speed: check the sensor and the trigger",
        )
    back = np.flatnonzero(np.diff(times) <= 0)
    if len(back):
        i = int(back[0])
        verb = "runs backwards" if times[i + 1] < times[i] else "stands still"
        raise InputError(
            f"line {line_of(i + 1)}: time {verb}, {times[i]:.9g} is followed by {times[i + 1]:.9g}",
            where=where,
            allowed="strictly increasing times",
            remedy="sort out where the counter restarted, or cut the file there",
        )
