"""The one place that knows what a session remembers, and under which keys."""

from __future__ import annotations

import secrets
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import streamlit as st

from gearsig.diagnosis import Analysis

if TYPE_CHECKING:
    from streamlit.navigation.page import StreamlitPage

ORIGIN, SAMPLE, RECORDING_FILE, RIG_FILE = "origin", "sample", "recording file", "recording file rig"
TAB, CHANNEL, ZOOMS = "tab", "channel", "zooms"
OF_LABORATORY = "Laboratory"
"""Origin of a recording that the laboratory made."""
_CHOSEN, _SIMULATED, _FILES, _OPENED, _TOKENS = "chosen", "simulated", "kept files", "opened files", "tokens"
_GAP_STARTS, _PAGES = "gap starts", "pages"
Content = Path | memoryview
"""Content of a file: a path on this computer, or bytes in memory."""


@dataclass(frozen=True)
class PulseFile:
    """Times of tachometer pulses that the user gives with a recording.

    Parameters
    ----------
    name, sha256 : str
    content : bytes
        Of the file, which `gearsig.recording.read_pulse_times` reads.
    pulses_per_revolution : int
    """

    name: str
    sha256: str
    content: bytes = field(repr=False, compare=False)
    pulses_per_revolution: int = 1


@dataclass(frozen=True)
class AnalysisRequest:
    """A recording and everything else that determines its analysis: equal requests give equal answers.

    Parameters
    ----------
    name : str
        Of the file, as the user knows it; never a path to open.
    sha256 : str
        Of the file's bytes.
    rig_name, rig_text : str
        Name and text of the rig file; an empty text for none.
    sampling_rate_hz, speed_rpm : float or None
        Stated by the user for a file that does not state it.
    reference_name, reference_sha256 : str
        Of the recording it is compared with; empty for none.
    torque_nm : float or None
        Stated by the user in place of the rig's.
    reference_rate_hz : float or None
        Sampling rate that the user states for the reference, if it differs from the recording's.
    pulses : PulseFile or None
        Source of the speed, in place of what the rig or the file states.
    """

    name: str
    sha256: str
    rig_name: str = "rig.toml"
    rig_text: str = ""
    sampling_rate_hz: float | None = None
    speed_rpm: float | None = None
    reference_name: str = ""
    reference_sha256: str = ""
    torque_nm: float | None = None
    reference_rate_hz: float | None = None
    pulses: PulseFile | None = None


@dataclass(frozen=True)
class Chosen:
    """A request and its content: files on this computer (samples), or bytes in memory (uploads)."""

    request: AnalysisRequest
    content: Content
    reference: Content | None = None


@dataclass(frozen=True)
class ChosenFile:
    """A recording that the user chose, a sample or their own file, with the text of its rig file; or a rig file.

    Parameters
    ----------
    name, sha256 : str
    content : Path or memoryview
    rig_name, rig_text : str
    pulses : PulseFile or None
    """

    name: str
    sha256: str
    content: Content
    rig_name: str = "rig.toml"
    rig_text: str = ""
    pulses: PulseFile | None = None

    def request(self, *, sampling_rate_hz: float | None = None, speed_rpm: float | None = None) -> AnalysisRequest:
        """Return the request to read it, with the values that the file does not state."""
        known = self.name, self.sha256, self.rig_name, self.rig_text
        return AnalysisRequest(*known, sampling_rate_hz, speed_rpm, pulses=self.pulses)


def pages() -> dict[str, StreamlitPage]:
    """Return the pages of the dashboard by module name, as this run of `main` lists them."""
    kept: dict[str, StreamlitPage] = st.session_state.setdefault(_PAGES, {})
    return kept


def go_to(page: str) -> None:
    """Switch to the page of a module."""
    st.switch_page(pages()[page])


def token_of(kind: str, sha256: str, known: str = "") -> str:
    """Return the token that names a user's file in the addresses of this session; nobody else can guess it.

    Parameters
    ----------
    kind : str
        The file's purpose: the same file may be kept with a machine for one and without one for another.
    sha256 : str
    known : str
        The token that already names the file in the page's address, if the session starts from that address.
    """
    token: str = _tokens().setdefault((kind, sha256), known or secrets.token_urlsafe(16))
    return token


def tokens(kind: str) -> tuple[str, ...]:
    """Return the tokens of this session's files of one kind, the latest first."""
    return tuple(token for (of, _), token in reversed(_tokens().items()) if of == kind)


def _tokens() -> dict[tuple[str, str], str]:
    kept: dict[tuple[str, str], str] = st.session_state.setdefault(_TOKENS, {})
    return kept


def remember(chosen: Chosen | None) -> None:
    """Keep the choice for other pages of this session."""
    st.session_state[_CHOSEN] = chosen


def chosen() -> Chosen | None:
    """Return what was chosen last in this session, on any page."""
    result: Chosen | None = st.session_state.get(_CHOSEN)
    return result


def open_simulated(made: Chosen) -> None:
    """Let the analysis page open a recording of the laboratory."""
    st.session_state[_SIMULATED] = made
    st.session_state[ORIGIN] = OF_LABORATORY


def simulated() -> Chosen | None:
    """Return the recording that the laboratory made last in this session."""
    result: Chosen | None = st.session_state.get(_SIMULATED)
    return result


def start_gap() -> None:
    """Have the gap page diagnose what is chosen there as soon as it opens."""
    st.session_state[_GAP_STARTS] = True


def take_start_of_gap() -> bool:
    """Return, once, whether the gap page should start automatically."""
    return bool(st.session_state.pop(_GAP_STARTS, False))


def carry_over(key: str, default: object = None) -> None:
    """Let a widget that several pages share keep its value from one page to the next.

    When a page is first shown, Streamlit gives a widget its default, whatever the session holds.
    """
    if key in st.session_state or default is not None:
        st.session_state[key] = st.session_state.get(key, default)


def keep_files(kind: str, files: tuple[ChosenFile, ...]) -> None:
    """Keep uploads of one kind while another page is shown: Streamlit forgets what its uploaders held."""
    st.session_state[source_key(_FILES, kind)] = files


def open_files(kind: str, files: tuple[ChosenFile, ...]) -> None:
    """Open files in place of what the uploaders of one kind hold."""
    keep_files(kind, files)
    st.session_state[source_key(_OPENED, kind)] = st.session_state.get(source_key(_OPENED, kind), 0) + 1


def uploader_key(kind: str) -> str:
    """Return the key of an uploader of one kind, which changes whenever files are opened in place of its own."""
    n_opened = st.session_state.get(source_key(_OPENED, kind), 0)
    return f"{kind} {n_opened}" if n_opened else kind


def kept_files(kind: str) -> tuple[ChosenFile, ...]:
    """Return the uploads of one kind that this session keeps."""
    files: tuple[ChosenFile, ...] = st.session_state.get(source_key(_FILES, kind), ())
    return files


def zooms() -> dict[str, list[float]]:
    """Return the zoomed ranges of this session's figures, by their keys."""
    kept: dict[str, list[float]] = st.session_state.setdefault(ZOOMS, {})
    return kept


def source_key(name: str, source: str) -> str:
    """Key of a widget that belongs to one file: another file starts with the widget's own default."""
    return f"{name} of {source}"


def view_key(name: str, source: Analysis | str) -> str:
    """Key of a widget that shows one recording, so that its choices end with that recording, or one named view."""
    if isinstance(source, str):
        return source_key(name, source)
    recording = source.recording
    return f"{name} of {recording.provenance.sha256 or id(recording)} at {recording.sampling_rate_hz!r}"
