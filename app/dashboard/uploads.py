"""Bytes from the browser to a recording, by way of a private folder that is gone afterwards."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

from app.dashboard.as_typed import one_line

if TYPE_CHECKING:
    from gearsig.recording.types import Recording
    from gearsig.rig.types import Rig

LONGEST_STEM, LONGEST_ENDING, N_ENDINGS = 60, 15, 2


def safe_file_name(name: str) -> str:
    r"""Return a name that stays inside its folder: the last part of a path, plain letters, digits, ".", "-", "_".

    Examples
    --------
    >>> safe_file_name("../../etc/run 1.csv"), safe_file_name(r"C:\data\a.MAT"), safe_file_name("..")
    ('run-1.csv', 'a.MAT', 'recording')
    """
    stem, *endings = re.split(r"[/\\]", name)[-1].split(".")
    kept = [plain for ending in endings[-N_ENDINGS:] if (plain := _plain(ending)[:LONGEST_ENDING])]
    return ".".join([_plain(stem)[:LONGEST_STEM] or "recording", *kept])


def _plain(text: str) -> str:
    return re.sub(r"[^\w-]+", "-", text, flags=re.ASCII).strip("-")


def read_rig_text(text: str, name: str = "rig.toml") -> Rig | None:
    """Return the rig that the text of a rig file describes, None for an empty text."""
    from gearsig.rig.toml import read_rig

    if not text.strip():
        return None
    with TemporaryDirectory(prefix="gearsig-") as folder:
        path = Path(folder) / safe_file_name(name)
        path.write_text(text, encoding="utf-8")
        return read_rig(path)


def read_recording_bytes(
    content: bytes | memoryview, name: str, *, rig: Rig | None, sampling_rate_hz: float | None, speed_rpm: float | None
) -> Recording:
    """Read a recording from the bytes of a file called `name`.

    Parameters
    ----------
    content : bytes-like
    name : str
        As the browser gave it; never trusted as a path.
    rig : Rig or None
    sampling_rate_hz, speed_rpm : float or None
        Of files that do not state them.

    Raises
    ------
    InputError
        As `gearsig.recording.read.read_recording`.
    """
    with TemporaryDirectory(prefix="gearsig-") as folder:
        path = Path(folder) / safe_file_name(name)
        path.write_bytes(content)
        recording = read_recording_file(path, rig=rig, sampling_rate_hz=sampling_rate_hz, speed_rpm=speed_rpm)
    return replace(recording, provenance=replace(recording.provenance, source=one_line(name)))


def read_recording_file(
    path: Path, *, rig: Rig | None, sampling_rate_hz: float | None, speed_rpm: float | None
) -> Recording:
    """Read a recording from a file of this machine, e.g. a sample."""
    from gearsig.recording.read import read_recording
    from gearsig.rig.speed import ConstantSpeed

    speed = None if speed_rpm is None else ConstantSpeed(speed_rpm)
    return read_recording(path, rig=rig, sampling_rate_hz=sampling_rate_hz, speed=speed)
