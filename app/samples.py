"""The sample recordings that come with gearsig."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import gearsig
from gearsig.errors import InputError
from gearsig.rig import recording_stem


@dataclass(frozen=True)
class SampleRecording:
    """A sample recording and its rig file."""

    recording: Path
    rig: Path


def sample_folder() -> Path:
    """Return the folder of the samples: inside the installed package, or beside it in a checkout."""
    package = Path(gearsig.__file__).parent
    for folder in (package / "sample_data", package.parent / "sample_data"):
        if folder.is_dir():
            return folder
    raise InputError("the sample recordings are missing", where=str(package), remedy="install gearsig again")


def samples() -> tuple[SampleRecording, ...]:
    """Return the samples by name; each recording stands beside a rig file of the same stem."""
    found = []
    for rig in sorted(sample_folder().glob("*.toml")):
        recordings = [p for p in rig.parent.iterdir() if recording_stem(p.name) == rig.stem and p.suffix != ".toml"]
        found += [SampleRecording(path, rig) for path in recordings]
    return tuple(found)
