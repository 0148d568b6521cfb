"""The phase plane of one channel with the points of a Poincaré section, and what kind of motion they speak for."""

from __future__ import annotations

from typing import TYPE_CHECKING

import streamlit as st

from app.dashboard import state
from app.dashboard.as_typed import as_typed
from app.dashboard.widgets.methods.phase_motion import OF_DISPLACEMENT, show_verdict
from app.dashboard.widgets.methods.phase_settings import PhaseSettings, choose_band, choose_lock
from app.dashboard.widgets.methods.stretch import Stretch, choose_stretch
from app.dashboard.widgets.picture import show_picture
from gearsig.diagnosis.types import Analysis, ChannelAnalysis
from gearsig.errors import RefusalError

if TYPE_CHECKING:
    from gearsig.phase.kind import MotionKind
    from gearsig.phase.lock import CycleLock
    from gearsig.phase.types import PhasePortrait

N_FIRST = 100_000
N_KEPT = 4
DRAWN = (1, 2, 5, 10, 20, 50, 100)
"""Revolutions of the reference shaft that are drawn as a line; the points are of the whole stretch."""
N_DRAWN = 4000
"""Samples drawn where the speed is not known."""
MOST_DRAWN = 20_000


def show_phase_plane(analysis: Analysis, channel: ChannelAnalysis) -> None:
    """Show displacement and velocity of one channel."""
    left, right = st.columns(2)
    with left:
        stretch = choose_stretch(analysis, channel, "phase plane", n_first=N_FIRST)
    settings = choose_band(analysis, stretch)
    with right:
        lock = choose_lock(analysis, stretch)
    phase, n_drawn = _choose_view(analysis, stretch, lock)
    with st.spinner("Integrating …", show_time=True):
        portrait = portrait_of(stretch.key, settings, stretch)
    _show_portrait(portrait, lock, phase, n_drawn)
    if lock is not None:
        _show_kind(analysis, stretch, settings, portrait, lock)


def _choose_view(analysis: Analysis, stretch: Stretch, lock: CycleLock | None) -> tuple[float, int]:
    """Return where in the cycle the path is looked at, and how many samples of the path are drawn."""
    if lock is None or stretch.angle is None:
        return 0.0, N_DRAWN
    left, right = st.columns(2)
    about = "Another place shows the section from another side; it must not change what kind of motion it is."
    phase = left.slider(
        "Place in the cycle (0 to 1)",
        0.0,
        1.0,
        0.0,
        step=0.05,
        key=_key("phase", analysis),
        help=about,
        persist_state="session",
    )
    turns = right.select_slider(
        "Path drawn (revolutions)",
        DRAWN,
        value=DRAWN[1],
        key=_key("drawn", analysis),
        help="The points are of the whole stretch.",
        persist_state="session",
    )
    per_revolution = 60.0 * stretch.recording.sampling_rate_hz / max(stretch.angle.mean_speed_rpm, 1e-9)
    return float(phase), int(min(max(2.0, turns * per_revolution), MOST_DRAWN))


def _show_portrait(portrait: PhasePortrait, lock: CycleLock | None, phase: float, n_drawn: int) -> None:
    from gearsig.phase.section import locked_section
    from gearsig.plot.phase import phase_portrait_figure

    section = None
    if lock is not None:
        try:
            section = locked_section(portrait, lock, phase_cycles=phase)
        except RefusalError as error:
            st.info(as_typed(error), icon=":material/help:")
    picture = phase_portrait_figure(portrait, section, n_points=n_drawn)
    show_picture(picture, f"Velocity over displacement, {portrait.source}, with its Poincaré points")
    low, high = portrait.band_hz
    st.caption(
        f"From {portrait.start_s:.3g} to {portrait.end_s:.3g} s of the stretch, {low:.4g} to {high:.4g} Hz: near its "
        "ends an integral rests on what is not known. Motion that repeats with the lock falls onto one point; scatter "
        "is noise, modulation, or motion that does not repeat."
    )


def _show_kind(
    analysis: Analysis, stretch: Stretch, settings: PhaseSettings, portrait: PhasePortrait, lock: CycleLock
) -> None:
    """Say what kind of motion it is once that is asked for: it takes some seconds."""
    asked, question = _key("kind asked", analysis), (stretch.key, settings, lock.name, lock.cycles_per_revolution)
    if st.session_state.get(asked) != question:
        st.button(
            "What kind of motion is it?",
            icon=":material/psychology_alt:",
            key=f"{asked} button",
            on_click=_ask,
            args=(asked, question),
            help="Looks whether the section repeats, for the largest Lyapunov exponent, and the 0–1 test for chaos: "
            "some seconds.",
        )
        return
    with st.spinner("Looking at section, exponent and 0–1 test …", show_time=True):
        kind = kind_of(stretch.key, settings, lock.name, lock.cycles_per_revolution, portrait, lock)
    show_verdict(kind, OF_DISPLACEMENT.format(portrait.source))


def _ask(asked: str, question: tuple[object, ...]) -> None:
    st.session_state[asked] = question


@st.cache_resource(max_entries=N_KEPT, show_spinner=False)
def portrait_of(key: str, settings: PhaseSettings, _stretch: Stretch) -> PhasePortrait:
    """Return the portrait; `key` stands for the stretch. It is frozen, so that sessions may share it."""
    from gearsig.phase.plane import phase_plane

    del key
    return phase_plane(
        _stretch.recording,
        _stretch.channel,
        low_cut_hz=settings.low_cut_hz,
        high_cut_hz=settings.high_cut_hz,
        quantity=settings.quantity,
    )


@st.cache_resource(max_entries=N_KEPT, show_spinner=False)
def kind_of(
    key: str, settings: PhaseSettings, lock_name: str, cycles: float, _portrait: PhasePortrait, _lock: CycleLock
) -> MotionKind:
    """Return the kind of motion; the first four stand for portrait and lock."""
    from gearsig.phase.kind import kind_of_motion

    del key, settings, lock_name, cycles
    return kind_of_motion(_portrait, _lock)


def _key(name: str, analysis: Analysis) -> str:
    return state.view_key(f"phase plane {name}", analysis)
