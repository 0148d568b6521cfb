"""Variational modes of a channel, of its envelope or over the shaft's angle, with a suggestion of their number."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, cast

import streamlit as st

from app.dashboard import state
from app.dashboard.widgets.methods.choice import choose_one
from app.dashboard.widgets.methods.downloads import offer_downloads
from app.dashboard.widgets.methods.mesh_cycles import length_shown
from app.dashboard.widgets.methods.mode_signal import ModeSignal, choose_signal
from app.dashboard.widgets.methods.mode_suggestion import show_suggestion
from app.dashboard.widgets.methods.notes import show_notes
from app.dashboard.widgets.methods.stretch import Stretch, choose_stretch
from app.dashboard.widgets.methods.waveforms import Waveforms
from app.dashboard.widgets.picture import show_picture
from app.dashboard.widgets.range_slider import choose_range
from gearsig.diagnosis.types import Analysis, ChannelAnalysis

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from gearsig.decompose.types import Modes, StartName, VmdSettings

N_FIRST, N_MOST = 2**16, 2**21
N_PER_BLOCK = 2**18
"""Longer stretches are taken block by block."""
MOST_MODES = 10
PENALTIES = (50, 100, 200, 500, 1000, 2000, 5000, 10_000, 20_000, 50_000, 100_000, 200_000)
"""A logarithmic scale that holds whatever is suggested."""
ITERATIONS = (499, 1000, 2000, 5000)
STARTS = ("uniform", "peaks", "zero")
N_KEPT = 2
"""Answers are several times as long as the stretch."""
SHOWN = 2000
"""Samples of the waveforms at first."""


def show_modes(analysis: Analysis, channel: ChannelAnalysis) -> None:
    """Show the modes of one channel."""
    left, right = st.columns(2)
    with right:
        stretch = choose_stretch(analysis, channel, "modes", n_first=N_FIRST, n_most=N_MOST)
    with left:
        signal = choose_signal(analysis, channel, stretch)
    settings = _choose_settings(analysis)
    show_suggestion(analysis, signal, names=(_key("K", analysis), _key("penalty", analysis), _key("start", analysis)))
    with st.spinner("Finding the modes …", show_time=True):
        modes = modes_of(signal.key, settings, signal)
    show_notes(modes.notes)
    _show_figure(analysis, modes, _length_shown(analysis, stretch, signal))
    end = "Converged" if modes.converged else "Stopped"
    n_blocks = len(modes.centre_history) - 1
    blocks = f" in {n_blocks} overlapping blocks" if len(modes.residual) > N_PER_BLOCK else ""
    st.caption(
        f"{end} after {modes.n_iterations} iterations{blocks}. Marked in each spectrum: the mode's centre, and its "
        "width to both sides. Grey: what is left."
    )
    offer_downloads(analysis, "modes", mode_waveforms(signal, modes), tables={"Modes": lambda: mode_columns(modes)})


def mode_waveforms(signal: ModeSignal, modes: Modes) -> Waveforms:
    """Return the modes by rising centre, and the residual."""
    unit = "Hz" if modes.axis == "frequency" else "orders"
    columns = {f"mode {k + 1}, {modes.centres[k]:.5g} {unit}": modes.waveforms[k] for k in modes.by_centre()} | {
        "residual": modes.residual
    }
    told = modes.settings
    step = f"{modes.n_modes} variational modes, penalty {told.penalty:g}, of {modes.source} less {modes.offset:g}"
    return Waveforms(
        columns, modes.sampling_rate, signal.start, modes.unit, signal.quantity, step, modes.axis, modes.shaft
    )


def mode_columns(modes: Modes) -> Mapping[str, ArrayLike]:
    """Return number, centre, bandwidth and rms of each mode, by rising centre."""
    order = list(modes.by_centre())
    unit = "Hz" if modes.axis == "frequency" else "orders"
    return {
        "mode": [k + 1 for k in order],
        f"centre ({unit})": modes.centres[order],
        f"bandwidth ({unit})": modes.bandwidths[order],
        f"rms ({modes.unit or 1})": modes.rms[order],
    }


def _choose_settings(analysis: Analysis) -> VmdSettings:
    from gearsig.decompose.types import VmdSettings

    one, two, three, four, five = st.columns((2.6, 4, 4.8, 3, 3.2))
    # others set the values of both: see `show_suggestion`
    for name, value in (("K", 4), ("penalty", 2000)):
        st.session_state.setdefault(_key(name, analysis), value)
    n_modes = one.slider("Modes K", 1, MOST_MODES, key=_key("K", analysis), persist_state="session")
    about = "Weight of the modes' bandwidth, α: large for narrow modes. 2000 is usual."
    key = _key("penalty", analysis)
    penalty = two.select_slider("Penalty α", PENALTIES, help=about, key=key, persist_state="session")
    with three:
        about = "First centre frequencies: evenly spread, at the peaks of the spectrum, or all at zero."
        start = choose_one("Start", STARTS, _key("start", analysis), about=about)
    zero_mode = five.toggle(
        "Mode at zero",
        key=_key("zero", analysis),
        help="Keep the first mode's centre at zero, so that it takes mean and drift.",
        persist_state="session",
    )
    most = four.select_slider("Iterations", ITERATIONS, key=_key("iterations", analysis), persist_state="session")
    with st.expander("More settings"):
        dual_step = st.columns(3)[0].number_input(
            "Dual step τ",
            min_value=0.0,
            value=0.0,
            step=0.1,
            format="%g",
            key=_key("dual step", analysis),
            help="Above 0 the modes must sum to the signal, noise included; 0 leaves noise in the residual.",
            persist_state="session",
        )
    return VmdSettings(
        int(n_modes),
        float(penalty),
        dual_step=float(dual_step),
        zero_mode=bool(zero_mode),
        start=cast("StartName", start),
        max_iterations=int(most),
    )


@st.cache_resource(max_entries=N_KEPT, show_spinner=False)
def modes_of(key: str, settings: VmdSettings, _signal: ModeSignal) -> Modes:
    """Return the modes; `key` stands for the signal. They are frozen, so that sessions may share them."""
    from dataclasses import replace

    from gearsig.decompose.long_signal import long_modes

    del key
    modes = long_modes(
        _signal.values,
        _signal.rate,
        settings,
        axis=_signal.axis,
        unit=_signal.unit,
        source=_signal.source,
        shaft=_signal.shaft,
        n_per_block=N_PER_BLOCK,
    )
    order = list(modes.by_centre())  # the first mode shown is number 1
    return replace(
        modes,
        waveforms=modes.waveforms[order],
        centres=modes.centres[order],
        bandwidths=modes.bandwidths[order],
        centre_history=modes.centre_history[:, order],
        offset=_signal.offset,
    )


def _length_shown(analysis: Analysis, stretch: Stretch, signal: ModeSignal) -> float:
    """Return how much of the waveforms is drawn at first, in s or revolutions; an envelope's rhythms are slow."""
    is_envelope = signal.axis == "frequency" and signal.source != stretch.channel
    shown = length_shown(analysis, stretch, over_angle=signal.axis == "order", of_mesh=not is_envelope)
    return SHOWN / signal.rate if shown is None else shown


def _show_figure(analysis: Analysis, modes: Modes, length: float) -> None:
    from gearsig.plot.modes import modes_figure

    left, right = st.columns(2)
    end = float(modes.positions[-1])
    unit = "s from the stretch's start" if modes.axis == "frequency" else "revolutions"
    with left:
        shown = (0.0, min(end, length))
        limits = choose_range(f"Waveforms shown ({unit})", analysis, end, shown=shown, name="modes")
    top = modes.sampling_rate / 2.0
    with right:
        label = "Frequencies shown (Hz)" if modes.axis == "frequency" else "Orders shown"
        lines = choose_range(label, analysis, top, name="modes")
    figure = modes_figure(modes, limits=limits, spectrum_limits=lines)
    show_picture(figure, f"Waveforms and spectra of {modes.n_modes} modes of {modes.source}")


def _key(name: str, analysis: Analysis) -> str:
    return state.view_key(f"modes {name}", analysis)
