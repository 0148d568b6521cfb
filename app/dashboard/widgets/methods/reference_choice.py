"""A recording of the sound machine to compare with: a file of the user's, or one of the samples."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import streamlit as st

from app.dashboard import state
from app.dashboard.cached import sha256_of_upload
from app.dashboard.uploads import read_recording_bytes, read_recording_file
from app.dashboard.widgets.methods.choice import choose_one
from app.samples import samples
from gearsig.diagnosis.types import Analysis

if TYPE_CHECKING:
    from gearsig.recording.types import Recording
    from gearsig.rig.types import Rig

NONE, OWN, SAMPLE, SIDEBAR = "None", "Own file", "Sample", "As in the sidebar"
N_KEPT = 2


@dataclass(frozen=True)
class Reference:
    """A recording, None where there is none; `key` stands for it in caches."""

    recording: Recording | None
    key: str


def choose_reference(analysis: Analysis) -> Reference:
    """Let the user give a reference; it is read with the rig of the recording that is analysed.

    Raises
    ------
    InputError
        If the file cannot be read.
    """
    left, right = st.columns(2, vertical_alignment="bottom")
    with left:
        about = "The same gears, sensors, speed and load when they were sound. Without it only deep cracks show."
        given = () if analysis.reference is None else (SIDEBAR,)
        origin = choose_one(
            "Reference", (*given, NONE, OWN, SAMPLE), state.view_key("reference origin", analysis), about=about
        )
    if origin == SIDEBAR and analysis.reference is not None:
        recording = analysis.reference.recording
        return Reference(recording, f"{recording.provenance.sha256} {recording.sampling_rate_hz!r} {analysis.rig!r}")
    with right:
        if origin == OWN:
            return _own(analysis)
        if origin == SAMPLE:
            return _sample(analysis)
    return Reference(None, "")


def _own(analysis: Analysis) -> Reference:
    from gearsig.recording.identify import FORMAT_OF_EXTENSION

    file = st.file_uploader(
        "Recording of the sound gears",
        type=[*FORMAT_OF_EXTENSION, ".gz"],
        key=state.view_key("reference file", analysis),
        help="Read with the rig, and the sampling rate and speed, of the recording that is analysed.",
    )
    if file is None:
        st.caption("Without a reference until a file is given.")
        return Reference(None, "")
    content = file.getbuffer()
    digest = sha256_of_upload(file.file_id, content)
    return _read(analysis, file.name, digest, content)


def _sample(analysis: Analysis) -> Reference:
    from gearsig.recording.read import sha256_of

    names = {sample.recording: sample.rig.stem.replace("_", " ").capitalize() for sample in samples()}
    open_now = analysis.recording.provenance.source
    paths = [path for path in names if path.name != open_now]
    first = next((i for i, path in enumerate(paths) if path.name.startswith("root_crack_0")), 0)
    key = state.view_key("reference sample", analysis)
    path = st.selectbox("Sample of the sound gears", paths, index=first, format_func=names.__getitem__, key=key)
    return _read(analysis, path.name, sha256_of(path), path)


def _read(analysis: Analysis, name: str, digest: str, content: Path | memoryview) -> Reference:
    chosen = state.chosen()
    rate, speed = (None, None)
    if chosen is not None:
        rate, speed = chosen.request.sampling_rate_hz, chosen.request.speed_rpm
    key = f"{digest} {rate!r} {speed!r} {analysis.rig!r}"
    return Reference(_recording(key, name, content, analysis.rig, rate, speed), key)


@st.cache_resource(max_entries=N_KEPT, show_spinner="Reading the reference …")
def _recording(
    key: str, _name: str, _content: Path | memoryview, _rig: Rig | None, _rate: float | None, _speed: float | None
) -> Recording:
    """Read once; `key` stands for content, rig and what was stated. The recording is frozen, and may be shared."""
    del key
    if isinstance(_content, Path):
        return read_recording_file(_content, rig=_rig, sampling_rate_hz=_rate, speed_rpm=_speed)
    return read_recording_bytes(_content, _name, rig=_rig, sampling_rate_hz=_rate, speed_rpm=_speed)
