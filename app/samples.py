"""The sample recordings that come with gearsig."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import date, timedelta
from functools import cache
from pathlib import Path
from shutil import copyfile

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


_CRACK = "Compared with the healthy pair, the average over a revolution changes at one tooth."
_SHOWN: dict[str, tuple[str, str, str]] = {
    "damaged_tooth": (
        "Damaged tooth",
        "A spall on one tooth of the pinion stands out from the other teeth.",
        "healthy.h5",
    ),
    "root_crack_2mm": (
        "Root crack, 2 mm",
        f"{_CRACK} Its depth is given, with an interval.",
        "root_crack_0mm.h5",
    ),
    "outer_race": (
        "Bearing, outer race",
        "Impacts at the pass rate of the balls: the envelope spectrum names the race.",
        "healthy.h5",
    ),
    "two_stage": ("Two-stage gearbox", "An inner race on the middle shaft, seen by three sensors.", ""),
    "run_up": ("Run-up", "Mesh harmonics cross a resonance between 600 and 3000 rpm.", ""),
    "no_tachometer": ("Without tachometer", "The speed is found in the vibration itself.", ""),
    "eccentric_wheel": (
        "Eccentric wheel",
        "Sidebands one shaft order apart have grown: a suspicion only, since sidebands alone prove no fault.",
        "healthy.h5",
    ),
    "healthy": (
        "Healthy gearbox",
        "What a healthy machine looks like, and what its recording cannot rule out.",
        "",
    ),
    "root_crack_0mm": ("No crack", "The reference of the four cracks.", ""),
    **{f"root_crack_{k}mm": (f"Root crack, {k} mm", _CRACK, "root_crack_0mm.h5") for k in (1, 3, 4)},
}
"""Title, content and healthy reference of each sample; the most informative come first."""


def sample_folder() -> Path:
    """Return the folder of the samples: inside the installed package, or next to it in a checkout."""
    package = Path(gearsig.__file__).parent
    for folder in (package / "sample_data", package.parent / "sample_data"):
        if folder.is_dir():
            return folder
    raise InputError("the sample recordings are missing", where=str(package), remedy="reinstall gearsig")


@cache
def samples() -> tuple[SampleRecording, ...]:
    """Return the samples, the most informative first; the rig file of each has the same stem as the recording."""
    listed = []
    for rig in sorted(sample_folder().glob("*.toml")):
        recordings = [p for p in rig.parent.iterdir() if recording_stem(p.name) == rig.stem and p.suffix != ".toml"]
        title, about, reference = _SHOWN.get(rig.stem, (rig.stem.replace("_", " ").capitalize(), "", ""))
        healthy = rig.parent / reference if reference else None
        listed += [SampleRecording(path, rig, title, about, healthy) for path in recordings]
    order = list(_SHOWN)
    return tuple(sorted(listed, key=lambda s: order.index(s.rig.stem) if s.rig.stem in order else len(order)))


_MACHINES = {"Mixer 1": "damaged_tooth", "Mixer 2": "outer_race", "Mixer 3": "healthy"}
"""Machines of the example fleet → the sample that each comes to resemble."""
N_HEALTHY, N_LATER, PIECE_S = 10, 3, 2.0
EXAMPLE_PATTERN = "{machine}/{point}_{date:%Y%m%d}.h5"


def write_example_fleet(folder: Path) -> None:
    """Write recordings of three gearboxes over half a year into one folder per machine, named by `EXAMPLE_PATTERN`.

    They are overlapping pieces of the samples with invented dates: all machines are healthy at first.
    """
    from gearsig.recording import read_recording, write_recording

    known = {sample.rig.stem: sample for sample in samples()}
    for k, (machine, later) in enumerate(_MACHINES.items()):
        (folder / machine).mkdir(parents=True)
        for stem, n, first in (("healthy", N_HEALTHY, 0), (later, N_LATER, N_HEALTHY)):
            whole = read_recording(known[stem].recording)
            for i in range(n):
                start_s = 0.02 * (k + first / N_HEALTHY) + (whole.duration_s - PIECE_S - 0.1) * i / n
                day = date(2026, 1, 5) + timedelta(weeks=2 * (first + i))
                path = folder / machine / f"gearbox_{day:%Y%m%d}.h5"
                write_recording(whole.between(start_s, start_s + PIECE_S), path)
                copyfile(known[stem].rig, path.with_suffix(".toml"))
