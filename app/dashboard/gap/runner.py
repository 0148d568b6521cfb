"""Run a diagnosis beside the page, with progress and a stop; keep its result for the session."""

from __future__ import annotations

import shutil
from dataclasses import dataclass, field

import streamlit as st

from app.dashboard.as_typed import as_typed
from app.dashboard.gap.choice import Choice, files_of
from app.dashboard.widgets.picture import picture_bytes
from app.gap.job import Job, private_folder
from app.gap.results import JSON, PAGE, TWIN
from gearsig.cache import cache_folder
from gearsig.errors import GearsigError
from gearsig.gap.types import GapReport
from gearsig.report.gap_pictures import GapFigure, gap_figures

_JOB, _FINISHED, _STOPPED, _REFUSED = "gap job", "gap result", "gap stopped", "gap refused"
EVERY_S = 0.5


@dataclass(frozen=True)
class Finished:
    """A result: of which choice, in words, in figures and as files."""

    key: str
    report: GapReport
    figures: tuple[GapFigure, ...]
    page: bytes
    json: bytes
    twin: bytes | None
    _drawn: dict[tuple[int, bool], bytes] = field(default_factory=dict, repr=False, compare=False)

    def picture(self, one: GapFigure, *, dark: bool) -> bytes:
        """Return one of the figures as PNG, drawn once for light and once for dark pages."""
        key = (self.figures.index(one), dark)
        if key not in self._drawn:
            self._drawn[key] = picture_bytes(one.figure, dark=dark)
        return self._drawn[key]


@dataclass
class _Running:
    """A job, and what it was asked."""

    key: str
    job: Job


def show_running(choice: Choice) -> Finished | None:
    """Show the buttons and what goes on; return the last result of this session, if there is one.

    Raises
    ------
    GearsigError
        Why the job that has just ended has no result, or why none could be started.
    """
    running: _Running | None = st.session_state.get(_JOB)
    failed: GearsigError | None = st.session_state.pop(_REFUSED, None)
    if running is not None and not running.job.is_running:
        try:
            _take(running)
        except GearsigError as error:
            failed = error
        running = None
    with st.container(horizontal=True, vertical_alignment="center"):
        st.button(
            "Diagnose",
            type="primary",
            icon=":material/play_arrow:",
            disabled=running is not None or not choice.recordings,
            on_click=_start,
            args=(choice,),
        )
        st.button("Stop", icon=":material/stop:", disabled=running is None, on_click=_stop)
    if failed is not None:
        raise failed
    if running is not None:
        _show_progress(running)
    elif st.session_state.pop(_STOPPED, False):
        st.info("Stopped. Nothing was kept but what had been prepared for this rig.", icon=":material/stop_circle:")
    found: Finished | None = st.session_state.get(_FINISHED)
    return found


def forget() -> None:
    """Stop what runs and forget the result."""
    _stop()
    for key in (_FINISHED, _STOPPED):
        st.session_state.pop(key, None)


def _start(choice: Choice) -> None:
    """Start a job; why none can be started is kept for the page, which runs only afterwards."""
    forget()
    folder = private_folder()
    try:
        asked = files_of(choice, folder)
        job = Job(folder, asked, choice.model, cache=cache_folder("gap"), command=choice.command)
    except BaseException as error:
        shutil.rmtree(folder, ignore_errors=True)
        if not isinstance(error, GearsigError):
            raise
        st.session_state[_REFUSED] = error
        return
    st.session_state[_JOB] = _Running(choice.key, job)


def _stop() -> None:
    running: _Running | None = st.session_state.pop(_JOB, None)
    if running is not None:
        running.job.close()
        st.session_state[_STOPPED] = True


@st.fragment(run_every=EVERY_S)
def _show_progress(running: _Running) -> None:
    """Show how far the job is; the whole page runs again when it has ended."""
    if not running.job.is_running:
        st.rerun()
    stage, done = running.job.progress
    st.progress(done, f"{as_typed(stage[:1].upper() + stage[1:])} …")


def _take(running: _Running) -> None:
    """Take over the result of a job that has ended."""
    job = running.job
    del st.session_state[_JOB]
    try:
        report = job.report()
        page, found = job.result(PAGE) or b"", job.result(JSON) or b""
        figures = tuple(gap_figures(report))
        st.session_state[_FINISHED] = Finished(running.key, report, figures, page, found, job.result(TWIN))
    finally:
        job.close()
