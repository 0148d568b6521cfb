"""Reading and analysis, done once for equal requests and shared between sessions; the number kept is bounded."""

from __future__ import annotations

import hashlib
import re
import shlex
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

import streamlit as st

from app.dashboard.state import AnalysisRequest, ChosenFile, Content
from app.dashboard.widgets.texts import one_line
from app.dashboard.work import kept
from gearsig.errors import options_named

if TYPE_CHECKING:
    from gearsig.diagnosis import Analysis
    from gearsig.recording import ChannelProblem, Recording
    from gearsig.rig import ConstantSpeed, Rig, SpeedSource


# --------------------
# From the browser's bytes to a recording, through a private folder that is deleted afterwards.
# --------------------


def safe_file_name(name: str) -> str:
    r"""Return a name that stays inside its folder: the last part of a path, plain letters, digits, ".", "-", "_".

    Examples
    --------
    >>> safe_file_name("../../etc/run 1.csv"), safe_file_name(r"C:\data\a.MAT"), safe_file_name("2003.10.22.12.06")
    ('run-1.csv', 'a.MAT', '2003.10.22.12.06')
    """
    stem, *endings = re.split(r"[/\\]", name)[-1].rsplit(".", 2)
    kept = [plain for ending in endings if (plain := _plain(ending)[:15])]
    return ".".join([_plain(stem)[:60].strip("-.") or "recording", *kept])


def _plain(text: str) -> str:
    return re.sub(r"[^\w.-]+", "-", text, flags=re.ASCII).strip("-.")


def read_rig_text(text: str, name: str = "rig.toml") -> Rig | None:
    """Return the rig that the text of a rig file describes, None for an empty text."""
    from gearsig.rig import read_rig

    if not text.strip():
        return None
    with TemporaryDirectory(prefix="gearsig-") as folder:
        path = Path(folder) / safe_file_name(name)
        path.write_text(text, encoding="utf-8")
        return read_rig(path)


def read_content(
    content: bytes | Content, name: str, *, rig: Rig | None, sampling_rate_hz: float | None, speed: SpeedSource | None
) -> Recording:
    """Read a recording from a file on this computer, e.g. a sample, or from the bytes of a file called `name`.

    Parameters
    ----------
    content : Path or bytes-like
    name : str
        As the browser gave it; never trusted as a path.
    rig : Rig or None
    sampling_rate_hz : float or None
    speed : SpeedSource or None
        For files that do not state them.

    Raises
    ------
    InputError
        As `gearsig.recording.read_recording`.
    """
    from gearsig.diagnosis import read_whole

    with _as_file(content, name) as path:
        recording = read_whole(path, rig, sampling_rate_hz=sampling_rate_hz, speed=speed)
    return recording if isinstance(content, Path) else _named(recording, name)


@contextmanager
def _as_file(content: bytes | Content, name: str) -> Iterator[Path]:
    """Yield a file of this computer, or the bytes of one called `name` as a file that is deleted afterwards."""
    if isinstance(content, Path):
        yield content
        return
    with TemporaryDirectory(prefix="gearsig-") as folder:
        path = Path(folder) / safe_file_name(name)
        path.write_bytes(content)
        yield path


def _named(recording: Recording, name: str, sha256: str = "") -> Recording:
    known = recording.provenance
    return replace(recording, provenance=replace(known, source=one_line(name), sha256=known.sha256 or sha256))


def _constant(speed_rpm: float | None) -> ConstantSpeed | None:
    from gearsig.rig import ConstantSpeed

    return None if speed_rpm is None else ConstantSpeed(speed_rpm)


def _stated_speed(request: AnalysisRequest) -> SpeedSource | None:
    """Return the speed source that the user states: times of pulses, or else a constant speed."""
    from gearsig.recording import read_pulse_times

    pulses = request.pulses
    if pulses is None:
        return _constant(request.speed_rpm)
    with _as_file(pulses.content, pulses.name) as path:
        return read_pulse_times(path, pulses.pulses_per_revolution)


@kept(6, "Reading …", key=lambda request, _, rig=None: (request, rig and rig.key()))
def recorded(request: AnalysisRequest, content: Content, rig: Rig | None = None) -> Recording:
    """Return a recording as requested; `rig` is for files without their own rig file.

    Raises
    ------
    InputError
        If the rig or the recording cannot be read.
    """
    own_rig = read_rig_text(request.rig_text, request.rig_name)
    rig, rate_hz = own_rig if own_rig is not None else rig, request.sampling_rate_hz
    return read_content(content, request.name, rig=rig, sampling_rate_hz=rate_hz, speed=_stated_speed(request))


def analysis_of(request: AnalysisRequest, content: Content, reference: Content | None = None) -> Analysis:
    """Return the analysis of a recording; it is immutable, so that sessions may share it.

    Raises
    ------
    InputError
        If the rig, the recording or the reference cannot be read or analysed.
    """
    size = _size(content) + (0 if reference is None else _size(reference))
    return (_large if size > 50_000_000 else _small)(request, content, reference)


# Each analysis holds its recording and several spectra, a few times the file's size: fewer large ones are kept.
def _size(content: bytes | Content) -> int:
    return content.stat().st_size if isinstance(content, Path) else len(content)


def read_and_analyze(request: AnalysisRequest, content: Content, reference: Content | None = None) -> Analysis:
    """Read rig, recording and reference, and analyse; of recordings too long for memory, the most telling parts."""
    from gearsig.diagnosis import (
        REFERENCE_OPTIONS,
        LongAnalysis,
        analyze_file,
        read_typical_part,
        rig_and_rate_of_reference,
    )

    rig = read_rig_text(request.rig_text, request.rig_name)
    rate_hz, speed = request.sampling_rate_hz, _stated_speed(request)
    then = None
    if reference is not None:
        with _as_file(reference, request.reference_name) as path, options_named(REFERENCE_OPTIONS):
            # A sample's machine may have been corrected in the form.
            its_rig, its_rate_hz = rig_and_rate_of_reference(
                path, rig, rate_hz, request.reference_rate_hz, is_same_machine=True
            )
            # pulse times belong to the other recording
            read = read_typical_part(path, its_rig, sampling_rate_hz=its_rate_hz, speed=_constant(request.speed_rpm))
            then = _named(read, request.reference_name)
    with _as_file(content, request.name) as path:
        result = analyze_file(
            path, rig, reference=then, torque_nm=request.torque_nm, sampling_rate_hz=rate_hz, speed=speed
        )
    analysis = result.as_one() if isinstance(result, LongAnalysis) else result
    return replace(analysis, recording=_named(analysis.recording, request.name, request.sha256))


_small, _large = (kept(n, "Reading and analysing …", key=lambda request, *_: request)(read_and_analyze) for n in (6, 2))


@st.cache_data(max_entries=4, show_spinner=False)
def report_page(request: AnalysisRequest, _analysis: Analysis) -> bytes:
    """Return the self-contained report as HTML."""
    from gearsig.report import page_html

    return page_html(_analysis, command=command_of(request)).encode("utf-8")


@st.cache_data(max_entries=64, show_spinner=False)
def channel_problems(key: str, _recording: Recording) -> tuple[ChannelProblem, ...]:
    """Return what is wrong with the channels; `key` stands for the recording."""
    from gearsig.recording import find_problems

    del key
    return find_problems(_recording)


@st.cache_data(max_entries=64, show_spinner=False)
def sha256_of_upload(file_id: str, _content: memoryview) -> str:
    """Hash an upload once; `file_id` is Streamlit's own, new for every upload."""
    del file_id  # it is the key of the cache
    return hashlib.sha256(_content).hexdigest()


N_RECENT, RECENT_BYTES = 32, 400_000_000


@st.cache_resource(show_spinner=False)
def _recent() -> dict[str, ChosenFile]:
    return {}


def remember_file(token: str, file: ChosenFile) -> None:
    """Keep a file for a reload of its page; the oldest files are dropped if there are too many or too large ones.

    All sessions share the store, so it is bounded; a token that one session alone knows opens only its own files.
    """
    files = _recent()
    files.pop(token, None)
    files[token] = file
    while len(files) > 1 and (len(files) > N_RECENT or sum(map(_kept_size, files.values())) > RECENT_BYTES):
        del files[next(iter(files))]


def _kept_size(file: ChosenFile) -> int:
    return _size(file.content) + (0 if file.pulses is None else _size(file.pulses.content))


def kept_file(token: str) -> ChosenFile | None:
    """Return the file of a token, None if it was dropped or never kept."""
    return _recent().get(token)


def command_of(request: AnalysisRequest) -> str:
    """Return the command that gives the same diagnosis outside the dashboard."""
    words = ["gearsig", "analyze", request.name, *stated_options(request)]
    words += ["--reference", request.reference_name] if request.reference_name else []
    rate_hz = request.reference_rate_hz
    words += ["--reference-fs", f"{rate_hz:.15g}"] if rate_hz is not None else []
    words += ["--torque", f"{request.torque_nm:.15g}Nm"] if request.torque_nm is not None else []
    return shlex.join(words)


def stated_options(request: AnalysisRequest) -> list[str]:
    """Return the options of the command line for the rig file, and for what the recording does not state."""
    words = ["--rig", request.rig_name] if request.rig_text.strip() else []
    words += ["--fs", f"{request.sampling_rate_hz:.15g}"] if request.sampling_rate_hz is not None else []
    words += ["--speed-rpm", f"{request.speed_rpm:.15g}"] if request.speed_rpm is not None else []
    if (pulses := request.pulses) is not None:
        words += ["--tach-times", pulses.name, "--pulses-per-revolution", str(pulses.pulses_per_revolution)]
    return words
