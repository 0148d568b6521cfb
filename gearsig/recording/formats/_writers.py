"""One writer per file format; each writes a whole file at the path it is given."""

from __future__ import annotations

import csv
import io
import struct
from pathlib import Path

import numpy as np

from gearsig.errors import InputError
from gearsig.recording._metadata import OWN_TEXT_MARK, metadata_json
from gearsig.recording._types import Recording

# Names that the readers look for; they stand here in one place so that importing the writers stays light.
HDF5_SAMPLES = "samples"
OWN_NAME = "gearsig_recording"
WAV_CHUNK = b"gsig"


def write_csv(recording: Recording, path: Path) -> None:
    """Write a line of JSON, a header line and one line per sample, numbers with all their digits."""
    import pyarrow as pa
    from pyarrow import csv as arrow_csv

    header = io.StringIO()
    titles = [f"{c.name} [{c.unit}]" if c.unit else c.name for c in recording.channels]
    csv.writer(header, lineterminator="\n").writerow(
        ["".join(c if c.isprintable() else " " for c in title) for title in titles]
    )
    table = pa.table({f"column {i}": np.asarray(row) for i, row in enumerate(recording.samples)})
    with path.open("wb") as file:
        file.write(f"{OWN_TEXT_MARK}{metadata_json(recording)}\n".encode())
        file.write(header.getvalue().encode("utf-8", errors="replace"))
        arrow_csv.write_csv(table, file, arrow_csv.WriteOptions(include_header=False))


def write_hdf5(recording: Recording, path: Path) -> None:
    """Write the datasets /samples (channel, time) and /gearsig_recording (JSON).

    /samples carries the attributes sampling_rate_hz, channel_names and units for other software.
    """
    import h5py

    with h5py.File(path, "w") as file:
        samples = file.create_dataset(HDF5_SAMPLES, data=recording.samples)
        samples.attrs["sampling_rate_hz"] = recording.sampling_rate_hz
        # HDF5 texts end at a NUL.
        samples.attrs["channel_names"] = [c.name.replace("\0", " ") for c in recording.channels]
        samples.attrs["units"] = [c.unit.replace("\0", " ") for c in recording.channels]
        file.create_dataset(OWN_NAME, data=metadata_json(recording))


def write_parquet(recording: Recording, path: Path) -> None:
    """Write one column per channel; the JSON stands in the schema's metadata, units in the columns'."""
    import pyarrow as pa
    from pyarrow import parquet

    arrays = [pa.array(row) for row in recording.samples]
    fields = [
        pa.field(c.name, array.type, metadata={"unit": c.unit})
        for c, array in zip(recording.channels, arrays, strict=True)
    ]
    facts = {OWN_NAME: metadata_json(recording), "sampling_rate_hz": repr(float(recording.sampling_rate_hz))}
    parquet.write_table(pa.Table.from_arrays(arrays, schema=pa.schema(fields, metadata=facts)), path)


def write_wav(recording: Recording, path: Path) -> None:
    """Write float32 samples in the channels' units and a chunk "gsig" with the JSON."""
    from scipy.io import wavfile

    rate_hz = round(recording.sampling_rate_hz)
    n_bytes = 4 * recording.samples.size
    # The header holds the bytes per second in 32 bits, and per frame in 16.
    if (
        rate_hz < 1
        or 4 * rate_hz * len(recording.channels) >= 2**32
        or len(recording.channels) >= 2**14
        or n_bytes > 0xF000_0000
    ):
        raise InputError(
            f"{rate_hz} Hz × {len(recording.channels)} channels × {n_bytes / 1e9:.3g} GB does not fit",
            where="WAV",
            allowed="from 1 Hz, below 4 GB/s, 16384 channels and 4 GB",
            remedy="write .h5",
        )
    largest = float(np.abs(recording.samples).max())
    if largest > float(np.finfo(np.float32).max):
        raise InputError(f"a sample is {largest:g}", where="WAV", allowed="what fits float32", remedy="write .h5")
    wavfile.write(path, rate_hz, np.ascontiguousarray(recording.samples.T, dtype=np.float32))
    text = metadata_json(recording).encode()
    text += b" " * (len(text) % 2)  # chunks begin at even bytes
    with path.open("r+b") as file:
        file.seek(0, io.SEEK_END)
        file.write(WAV_CHUNK + struct.pack("<I", len(text)) + text)
        n_riff = file.tell() - 8
        file.seek(4)
        file.write(struct.pack("<I", n_riff))


def write_mat(recording: Recording, path: Path) -> None:
    """Write the variables samples (time, channel), fs, channel_names and gearsig_recording (JSON)."""
    from scipy.io import savemat

    if recording.samples.nbytes >= 2**31:
        raise InputError(
            f"{recording.samples.nbytes / 1e9:.3g} GB do not fit", where="MAT", allowed="below 2 GB", remedy="write .h5"
        )
    variables = {
        "samples": recording.samples.T,
        "fs": float(recording.sampling_rate_hz),
        "channel_names": np.array([c.name for c in recording.channels], dtype=object),
        OWN_NAME: metadata_json(recording),
    }
    savemat(path, variables)
