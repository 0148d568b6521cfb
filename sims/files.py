"""A simulated recording on disk: the recording, its rig file and its truth, all or none written."""

from __future__ import annotations

import json
import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

from gearsig.cache import part_beside
from gearsig.errors import GearsigError, InputError, not_written
from gearsig.recording import Recording, n_samples_of, read_recording, recording_target, write_recording
from gearsig.rig import read_rig, write_rig


class FileSet(NamedTuple):
    """The files that belong to one recording."""

    recording: Path
    rig: Path
    truth: Path


def file_set(path: str | Path, *, replace: bool = False) -> FileSet:
    """Return the file names that belong to a recording, after checking that they can be written.

    Raises
    ------
    InputError
        If the format is unknown, the folder is missing, the name has a dot besides that of its extension (its rig file
        could not be found), or one of the files exists and `replace` is false.
    """
    target = recording_target(path)
    if "." in target.stem:
        raise InputError(
            "the name has more than one dot",
            where=target.name,
            remedy=f"take {target.stem.replace('.', '_')}{target.suffix}",
        )
    names = _names(target)
    for name in names:
        if name.is_dir():
            raise InputError("is a folder", where=str(name), remedy="choose another name with -o")
        if name.exists() and not replace:
            raise InputError(
                "exists already", where=str(name), remedy="choose another name, or replace it with --force"
            )
    return names


def _names(target: Path) -> FileSet:
    return FileSet(target, target.with_suffix(".toml"), target.with_name(f"{target.stem}.truth.json"))


def is_whole(path: Path) -> bool:
    """Say whether a recording's files are all there, readable and consistent.

    Where the format can be read in parts, only the first sample is read.

    Parameters
    ----------
    path : Path
        Of the recording.
    """
    names = _names(path)
    try:
        part = None if n_samples_of(names.recording) is None else slice(0, 1)
        recording = read_recording(names.recording, rig=read_rig(names.rig), part=part)
        truth = json.loads(names.truth.read_text(encoding="utf-8"))
    except (GearsigError, OSError, ValueError):
        return False
    return bool(truth == json.loads(_truth_json(recording)))


def _truth_json(recording: Recording) -> str:
    return json.dumps(dict(recording.truth or {}), indent=2, ensure_ascii=False, default=_plain)


def write_set(recording: Recording, names: FileSet) -> None:
    """Write a recording that has rig and truth, with its rig file and its truth file.

    The files are written to a temporary folder and moved into place when all are complete, the recording last: if it
    is there, so are the others.
    """
    if recording.rig is None or recording.truth is None:
        raise InputError("the recording has no rig or no truth", where=names.recording.name)
    unfinished = part_beside(names.recording)
    try:
        unfinished.mkdir()
    except OSError as error:
        raise not_written(error, names.recording, "choose another folder") from None
    parts = FileSet(*(unfinished / name.name for name in names))
    try:
        write_recording(recording, parts.recording)
        write_rig(recording.rig, parts.rig)
        parts.truth.write_text(_truth_json(recording) + "\n", encoding="utf-8")
        _move(parts, names)
    except OSError as error:
        raise not_written(error, names.recording, "make room on the disk, or choose another folder") from error
    finally:
        shutil.rmtree(unfinished, ignore_errors=True)


def _move(parts: FileSet, names: FileSet) -> None:
    """Move all parts into place; if one cannot be moved, remove those that replaced nothing."""
    moved: list[Path] = []
    try:
        for part, name in reversed(list(zip(parts, names, strict=True))):
            new = not name.exists()
            part.replace(name)
            if new:
                moved.append(name)
    except OSError:
        for name in moved:
            name.unlink(missing_ok=True)
        raise


def _plain(value: Any) -> Any:
    """Convert NumPy values and other mappings to JSON types."""
    if isinstance(value, Mapping):
        return dict(value)
    return value.tolist()  # NumPy arrays and scalars
