"""How the samples are written: plain files, as measuring systems leave them, without dates."""

from __future__ import annotations

import gzip
import io
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from gearsig.recording import Recording

STEP_V = 2.0**-8
"""Of the tachometer's converter."""
WAV_FULL_SCALE_V = 10.0

Writer = Callable[[Path, Recording], None]


@dataclass(frozen=True)
class Made:
    """A sample before it is written; its rig is what the rig file will say."""

    file: str
    recording: Recording
    truth: dict[str, Any]
    write: Writer


def write_hdf5(path: Path, recording: Recording) -> None:
    """One dataset per channel with a unit, the rate as an attribute."""
    import h5py

    with h5py.File(path, "w") as file:
        file.attrs["sampling_rate_hz"] = recording.sampling_rate_hz
        for channel, values in zip(recording.channels, columns(recording), strict=True):
            dataset = file.create_dataset(channel.name, data=values, compression="gzip", shuffle=True)
            dataset.attrs["unit"] = channel.unit


def write_csv_gz(path: Path, recording: Recording) -> None:
    """Time column and header with units."""
    text = csv_text(recording, with_time=True)
    path.write_bytes(gzip.compress(text.encode(), compresslevel=9, mtime=0))


def write_csv(path: Path, recording: Recording) -> None:
    """No time column; the sampling rate stands in a line above the header."""
    path.write_text(csv_text(recording, with_time=False), encoding="utf-8", newline="\n")


def csv_text(recording: Recording, *, with_time: bool) -> str:
    """Return header and rows."""
    rows = [*columns(recording)]
    formats, names = ["%.3f"] * len(rows), [f"{c.name} [{c.unit}]" for c in recording.channels]
    if with_time:
        rows, formats, names = [recording.time_s(), *rows], ["%.9f", *formats], ["time [s]", *names]
    buffer = io.StringIO()
    if not with_time:
        buffer.write(f"# sampling rate: {recording.sampling_rate_hz:g}\n")
    buffer.write(",".join(names) + "\n")
    np.savetxt(buffer, np.column_stack(rows), fmt=formats, delimiter=",")
    return buffer.getvalue()


def write_mat(path: Path, recording: Recording) -> None:
    """MAT v5 with one column vector per channel and `fs`."""
    from scipy.io import savemat

    variables: dict[str, Any] = {"fs": recording.sampling_rate_hz}
    variables |= dict(zip(recording.channel_names, columns(recording), strict=True))
    buffer = io.BytesIO()
    savemat(buffer, variables, do_compression=True, oned_as="column", format="5")  # type: ignore[arg-type]  # takes files
    # The first 116 bytes are free text, where scipy puts the date.
    path.write_bytes(b"MATLAB 5.0 MAT-file, gearsig sample".ljust(116) + buffer.getvalue()[116:])


def wav_writer(full_scale_mps2: float) -> Writer:
    """Float WAV: acceleration over its full scale, tachometer over 10 V; the rig file scales them back."""

    def write(path: Path, recording: Recording) -> None:
        from scipy.io import wavfile

        scales = [full_scale_mps2 if c.quantity == "acceleration" else WAV_FULL_SCALE_V for c in recording.channels]
        frames = (np.asarray(columns(recording)) / np.array(scales)[:, None]).T.astype(np.float32)
        wavfile.write(path, round(recording.sampling_rate_hz), frames)

    return write


def columns(recording: Recording) -> list[np.ndarray]:
    """Channels in float32; the tachometer in its converter's steps (accelerations are in theirs already)."""
    return [
        (np.round(row / STEP_V) * STEP_V if c.quantity == "tachometer" else row).astype(np.float32)
        for c, row in zip(recording.channels, recording.samples, strict=True)
    ]
