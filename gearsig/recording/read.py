"""Reads a recording from a file of any known format."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from pathlib import Path

from gearsig.recording.assemble import assemble
from gearsig.recording.identify import identify
from gearsig.recording.limits import CHUNK_BYTES
from gearsig.recording.raw_table import RawTable
from gearsig.recording.types import Recording
from gearsig.rig.speed import SpeedSource
from gearsig.rig.types import Rig


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
            from gearsig.recording.formats.csv import read_csv

            return read_csv
        case "MAT v5":
            from gearsig.recording.formats.mat5 import read_mat5

            return read_mat5
        case "MAT v7.3":
            from gearsig.recording.formats.mat73 import read_mat73

            return read_mat73
        case "WAV":
            from gearsig.recording.formats.wav import read_wav

            return read_wav
        case "HDF5":
            from gearsig.recording.formats.hdf5 import read_hdf5

            return read_hdf5
        case "Parquet":
            from gearsig.recording.formats.parquet import read_parquet

            return read_parquet
        case "TDMS":
            from gearsig.recording.formats.tdms import read_tdms

            return read_tdms
        case _:
            from gearsig.recording.formats.uff58 import read_uff58

            return read_uff58
