"""Reading and analysis, done once for equal requests and shared between sessions; the number kept is bounded."""

from __future__ import annotations

import hashlib
import re
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

import streamlit as st

from app.dashboard.state import AnalysisRequest
from app.dashboard.theme import one_line

if TYPE_CHECKING:
    from gearsig.diagnosis import Analysis
    from gearsig.recording import ChannelProblem, Recording
    from gearsig.rig import Rig


# --------------------
# Bytes from the browser to a recording, by way of a private folder that is gone afterwards.
# --------------------


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
    from gearsig.rig import read_rig

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
        As `gearsig.recording.read_recording`.
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
    from gearsig.recording import read_recording
    from gearsig.rig import ConstantSpeed

    speed = None if speed_rpm is None else ConstantSpeed(speed_rpm)
    return read_recording(path, rig=rig, sampling_rate_hz=sampling_rate_hz, speed=speed)


Content = Path | memoryview

N_ANALYSES, N_LARGE_ANALYSES = 6, 2
"""Each holds its recording and several spectra: a few times the size of the file."""
LARGE_BYTES = 50_000_000
N_PAGES = 4
N_HASHES = N_QUALITIES = 64


def analysis_of(request: AnalysisRequest, content: Content, reference: Content | None = None) -> Analysis:
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
def _small(request: AnalysisRequest, _content: Content, _reference: Content | None) -> Analysis:
    return read_and_analyze(request, _content, _reference)


@st.cache_resource(max_entries=N_LARGE_ANALYSES, show_spinner=False)
def _large(request: AnalysisRequest, _content: Content, _reference: Content | None) -> Analysis:
    return read_and_analyze(request, _content, _reference)


def read_and_analyze(request: AnalysisRequest, content: Content, reference: Content | None = None) -> Analysis:
    """Read rig, recording and reference, and analyse."""
    from gearsig.diagnosis import analyze

    rig = read_rig_text(request.rig_text, request.rig_name)
    recording = _read(request, request.name, content, rig)
    then = None if reference is None else _read(request, request.reference_name, reference, rig)
    return analyze(recording, reference=then, torque_nm=request.torque_nm)


def _read(request: AnalysisRequest, name: str, content: Content, rig: Rig | None) -> Recording:
    rate, speed = request.sampling_rate_hz, request.speed_rpm
    if isinstance(content, Path):
        return read_recording_file(content, rig=rig, sampling_rate_hz=rate, speed_rpm=speed)
    return read_recording_bytes(content, name, rig=rig, sampling_rate_hz=rate, speed_rpm=speed)


@st.cache_data(max_entries=N_PAGES, show_spinner=False)
def report_page(request: AnalysisRequest, _analysis: Analysis) -> bytes:
    """Return the self-contained report as HTML."""
    from gearsig.report import page_html

    return page_html(_analysis, command=command_of(request)).encode("utf-8")


@st.cache_data(max_entries=N_QUALITIES, show_spinner=False)
def channel_problems(key: str, _recording: Recording) -> tuple[ChannelProblem, ...]:
    """Return what is wrong with the channels; `key` stands for the recording."""
    from gearsig.recording import find_problems

    del key
    return find_problems(_recording)


@st.cache_data(max_entries=N_HASHES, show_spinner=False)
def sha256_of_upload(file_id: str, _content: memoryview) -> str:
    """Hash an upload once; `file_id` is Streamlit's own, new for every upload."""
    del file_id  # it is the key of the cache
    return hashlib.sha256(_content).hexdigest()


def command_of(request: AnalysisRequest) -> str:
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
