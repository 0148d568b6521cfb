"""The sample recordings that come with gearsig."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from pathlib import Path

import gearsig
from gearsig.errors import InputError
from gearsig.rig import recording_stem


@dataclass(frozen=True)
class SampleRecording:
    """A sample recording and its rig file, what it shows, and the same machine when it was healthy."""

    recording: Path
    rig: Path
    title: str = ""
    about: str = ""
    reference: Path | None = None


_CRACK = "Beside the healthy pair the average over a revolution changes at one tooth."
_SHOWN: dict[str, tuple[str, str, str]] = {
    "damaged_tooth": (
        "Damaged tooth",
        "A spall on one tooth of the pinion stands out of the ring.",
        "healthy.h5",
    ),
    "root_crack_2mm": (
        "Root crack, 2 mm",
        f"{_CRACK} Its depth is given, with an interval.",
        "root_crack_0mm.h5",
    ),
    "outer_race": (
        "Bearing, outer race",
        "A rattle at the rhythm of the balls: the envelope names the race.",
        "healthy.h5",
    ),
    "two_stage": ("Two-stage gearbox", "An inner race on the middle shaft, seen by three sensors.", ""),
    "run_up": ("Run-up", "Mesh harmonics cross a resonance on the way from 600 to 3000 rpm.", ""),
    "no_tachometer": ("Without tachometer", "The speed is found in the vibration itself.", ""),
    "eccentric_wheel": ("Eccentric wheel", "Sidebands a shaft order apart; no fault is claimed from them alone.", ""),
    "healthy": ("Healthy gearbox", "What a machine in good order looks like, and what cannot be told of it.", ""),
    "root_crack_0mm": ("No crack", "The reference of the four cracks.", ""),
    **{f"root_crack_{k}mm": (f"Root crack, {k} mm", _CRACK, "root_crack_0mm.h5") for k in (1, 3, 4)},
}
"""Of each sample: title, what it shows, and its healthy reference; those that show most come first."""


def sample_folder() -> Path:
    """Return the folder of the samples: inside the installed package, or beside it in a checkout."""
    package = Path(gearsig.__file__).parent
    for folder in (package / "sample_data", package.parent / "sample_data"):
        if folder.is_dir():
            return folder
    raise InputError("the sample recordings are missing", where=str(package), remedy="install gearsig again")


@cache
def samples() -> tuple[SampleRecording, ...]:
    """Return the samples, the most telling first; each recording stands beside a rig file of the same stem."""
    found = []
    for rig in sorted(sample_folder().glob("*.toml")):
        recordings = [p for p in rig.parent.iterdir() if recording_stem(p.name) == rig.stem and p.suffix != ".toml"]
        title, about, reference = _SHOWN.get(rig.stem, (rig.stem.replace("_", " ").capitalize(), "", ""))
        healthy = rig.parent / reference if reference else None
        found += [SampleRecording(path, rig, title, about, healthy) for path in recordings]
    order = list(_SHOWN)
    return tuple(sorted(found, key=lambda s: order.index(s.rig.stem) if s.rig.stem in order else len(order)))
