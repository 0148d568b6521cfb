"""Reading and analysis, done once for equal requests and shared between sessions; the number kept is bounded."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import TYPE_CHECKING

import streamlit as st

from app.dashboard.state import Request
from app.dashboard.uploads import read_recording_bytes, read_recording_file, read_rig_text

if TYPE_CHECKING:
    from gearsig.diagnosis.types import Analysis
    from gearsig.recording.quality import ChannelProblem
    from gearsig.recording.types import Recording
    from gearsig.rig.types import Rig

Content = Path | memoryview

N_ANALYSES, N_LARGE_ANALYSES = 6, 2
"""Each holds its recording and several spectra: a few times the size of the file."""
LARGE_BYTES = 50_000_000
N_PAGES = 4
N_HASHES = N_QUALITIES = 64


def analysis_of(request: Request, content: Content, reference: Content | None = None) -> Analysis:
    """Return the analysis of a recording; it is frozen, so that sessions may share it.

    Raises
    ------
    InputError
        If the rig, the recording or the reference cannot be read, or not be analysed.
    """
    size = _size(content) + (0 if reference is None else _size(reference))
    return (_large if size > LARGE_BYTES else _small)(request, content, reference)


def _size(content: Content) -> int:
    return content.stat().st_size if isinstance(content, Path) else content.nbytes


@st.cache_resource(max_entries=N_ANALYSES, show_spinner=False)
def _small(request: Request, _content: Content, _reference: Content | None) -> Analysis:
    return read_and_analyze(request, _content, _reference)


@st.cache_resource(max_entries=N_LARGE_ANALYSES, show_spinner=False)
def _large(request: Request, _content: Content, _reference: Content | None) -> Analysis:
    return read_and_analyze(request, _content, _reference)


def read_and_analyze(request: Request, content: Content, reference: Content | None = None) -> Analysis:
    """Read rig, recording and reference, and analyse."""
    from gearsig.diagnosis.analyze import analyze

    rig = read_rig_text(request.rig_text, request.rig_name)
    recording = _read(request, request.name, content, rig)
    then = None if reference is None else _read(request, request.reference_name, reference, rig)
    return analyze(recording, reference=then, torque_nm=request.torque_nm)


def _read(request: Request, name: str, content: Content, rig: Rig | None) -> Recording:
    rate, speed = request.sampling_rate_hz, request.speed_rpm
    if isinstance(content, Path):
        return read_recording_file(content, rig=rig, sampling_rate_hz=rate, speed_rpm=speed)
    return read_recording_bytes(content, name, rig=rig, sampling_rate_hz=rate, speed_rpm=speed)


@st.cache_data(max_entries=N_PAGES, show_spinner=False)
def report_page(request: Request, _analysis: Analysis) -> bytes:
    """Return the self-contained report as HTML."""
    from gearsig.report.page import page_html

    return page_html(_analysis, command=command_of(request)).encode("utf-8")


@st.cache_data(max_entries=N_QUALITIES, show_spinner=False)
def channel_problems(key: str, _recording: Recording) -> tuple[ChannelProblem, ...]:
    """Return what is wrong with the channels; `key` stands for the recording."""
    from gearsig.recording.quality import find_problems

    del key
    return find_problems(_recording)


@st.cache_data(max_entries=N_HASHES, show_spinner=False)
def sha256_of_upload(file_id: str, _content: memoryview) -> str:
    """Hash an upload once; `file_id` is Streamlit's own, new for every upload."""
    del file_id  # it is the key of the cache
    return hashlib.sha256(_content).hexdigest()


def command_of(request: Request) -> str:
    """Return the command that gives the same diagnosis outside the dashboard."""
    import shlex

    words = ["gearsig", "analyze", request.name]
    if request.rig_text.strip():
        words += ["--rig", request.rig_name]
    if request.sampling_rate_hz is not None:
        words += ["--fs", f"{request.sampling_rate_hz:.15g}"]
    if request.speed_rpm is not None:
        words += ["--speed-rpm", f"{request.speed_rpm:.15g}"]
    if request.reference_name:
        words += ["--reference", request.reference_name]
    if request.torque_nm is not None:
        words += ["--torque", f"{request.torque_nm:.15g}Nm"]
    return shlex.join(words)
