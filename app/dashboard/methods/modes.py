"""Variational modes of a channel, of its envelope or over the shaft's angle, with a suggestion of their number."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, cast

import streamlit as st

from app.dashboard import state
from app.dashboard.methods.signals import (
    SignalSegment,
    Waveforms,
    choose_one,
    choose_stretch,
    length_shown,
    offer_downloads,
    show_notes,
    signal_of,
)
from app.dashboard.theme import as_typed
from app.dashboard.widgets.charts import choose_range, show_picture
from gearsig.checks import FloatArray
from gearsig.diagnosis import Analysis, ChannelAnalysis

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from gearsig.decompose import ModeAxis, Modes, ModeSuggestion, ModeTrial, StartName, VmdSettings


# --------------------
# What is taken apart into modes: the signal over time, over the shaft's angle, or the envelope of a band.
# --------------------


KINDS = ("Signal", "Envelope", "Over angle")
USUAL_BAND = (0.5, 0.9)
"""Of half the sampling rate, where the analysis found no band that carries impacts."""


@dataclass(frozen=True)
class ModeSignal:
    """Samples at equal steps of time or angle, the first at `start`; `key` stands for all of it."""

    values: FloatArray
    rate: float
    axis: ModeAxis
    unit: str
    source: str
    key: str
    shaft: str = ""
    offset: float = 0.0
    start: float = 0.0
    quantity: str = "unknown"


def choose_signal(analysis: Analysis, channel: ChannelAnalysis, stretch: SignalSegment) -> ModeSignal:
    """Let the user choose what of the stretch is taken apart."""
    kinds = KINDS if stretch.angle is not None else KINDS[:2]
    about = "The envelope of a band shows what modulates it. Over the shaft's angle, centres are orders."
    kind = choose_one("Modes of", kinds, state.view_key(f"modes of {kinds}", analysis), about=about)
    if kind == "Envelope":
        return _envelope(analysis, channel, stretch)
    if kind == "Over angle" and stretch.angle is not None:
        return _over_angle(stretch)
    recording = stretch.recording
    return ModeSignal(
        recording.values(stretch.channel),
        recording.sampling_rate_hz,
        "frequency",
        stretch.unit,
        stretch.channel,
        stretch.key,
        start=stretch.start_s,
        quantity=recording.channels[0].quantity,
    )


def _envelope(analysis: Analysis, channel: ChannelAnalysis, stretch: SignalSegment) -> ModeSignal:
    from gearsig.spectra import band_envelope

    rate = stretch.recording.sampling_rate_hz
    usual = channel.envelope_band_hz or (USUAL_BAND[0] * rate / 2.0, USUAL_BAND[1] * rate / 2.0)
    band = choose_range("Band of the envelope (Hz)", analysis, rate / 2.0, shown=usual, name=f"modes {channel.channel}")
    envelope = band_envelope(
        stretch.recording.values(stretch.channel),
        rate,
        band,
        kind="magnitude",
        unit=stretch.unit,
    )
    # Its mean would be a mode of its own that outweighs the others.
    mean = float(envelope.values.mean())
    key = f"{stretch.key} envelope {band!r}"
    values = envelope.values - mean
    return ModeSignal(
        values,
        envelope.sampling_rate_hz,
        "frequency",
        envelope.unit,
        envelope.source,
        key,
        offset=mean,
        start=stretch.start_s,
    )


def _over_angle(stretch: SignalSegment) -> ModeSignal:
    signal = signal_of(stretch, over_angle=True)
    return ModeSignal(
        signal.values,
        signal.rate,
        "order",
        stretch.unit,
        stretch.channel,
        f"{stretch.key} angle",
        signal.shaft,
        start=signal.start,
        quantity=stretch.recording.channels[0].quantity,
    )


# --------------------
# How many modes a signal supports: the suggestion with its reasons, everything tried, and a button to take it over.
# --------------------


MODE_SUGGESTION_N_KEPT = 16


def show_suggestion(analysis: Analysis, signal: ModeSignal, names: tuple[str, str, str]) -> None:
    """Show the suggestion for a signal once it is asked for.

    Parameters
    ----------
    analysis : Analysis
    signal : ModeSignal
    names : (str, str, str)
        Keys of the widgets of number, penalty and start, which "Use it" sets.
    """
    asked = state.view_key("modes suggested", analysis)
    if st.session_state.get(asked) != signal.key:
        st.button(
            "Suggest K and penalty",
            icon=":material/lightbulb:",
            key=f"{asked} button",
            on_click=_ask,
            args=(asked, signal.key),
            help="Tries up to 8 modes at 6 penalties on up to 16 384 samples: a few seconds.",
        )
        return
    with st.spinner("Trying numbers of modes and penalties …", show_time=True):
        found = suggestion(signal.key, signal)
    with st.container(border=True):
        _show(found, names)


def _ask(asked: str, key: str) -> None:
    st.session_state[asked] = key


def _show(found: ModeSuggestion, names: tuple[str, str, str]) -> None:
    told = found.settings
    head, button = st.columns((4, 1), vertical_alignment="center")
    plural = "mode" if told.n_modes == 1 else "modes"
    head.markdown(f"Suggested: **{told.n_modes} {plural}** at penalty **{told.penalty:g}**, start **{told.start}**")
    values = (told.n_modes, int(told.penalty), told.start)
    button.button(
        "Use it", type="primary", key=f"{names[0]} use it", on_click=_use, args=(names, values), width="stretch"
    )
    st.markdown("\n".join(f"- {as_typed(reason)}" for reason in found.reasons))
    with st.expander(f"Everything that was tried ({len(found.trials)})"):
        number = st.column_config.NumberColumn(format="%.3g")
        numbers = ("residual (% of rms)", "separation", "widest", "weakest (% of energy)")
        st.dataframe(
            [_row(trial, chosen=trial is found.chosen) for trial in found.trials],
            hide_index=True,
            width="stretch",
            column_config=dict.fromkeys(numbers, number),
        )
        st.caption(
            "Separation: closest centres over the distance at which a mode's gain is one half; below 1, modes share "
            "lines. Widest: largest bandwidth over that of white noise; near 1 it is noise."
        )


def _use(names: tuple[str, str, str], values: tuple[object, ...]) -> None:
    for name, value in zip(names, values, strict=True):
        st.session_state[name] = value


def _row(trial: ModeTrial, *, chosen: bool) -> dict[str, object]:
    return {
        "": "➤" if chosen else "",
        "penalty": int(trial.penalty),
        "modes": trial.n_modes,
        "start": str(trial.settings.start),
        "residual (% of rms)": 100.0 * trial.reconstruction_error,
        "separation": trial.separation if trial.n_modes > 1 else None,
        "widest": trial.widest,
        "weakest (% of energy)": 100.0 * trial.smallest_share,
        "objection": trial.objection or "none",
    }


@st.cache_data(max_entries=MODE_SUGGESTION_N_KEPT, show_spinner=False)
def suggestion(key: str, _signal: ModeSignal) -> ModeSuggestion:
    """Return the suggestion; `key` stands for the signal."""
    from gearsig.decompose import suggest_modes

    del key
    return suggest_modes(_signal.values, _signal.rate, axis=_signal.axis, source=_signal.source)


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
    from gearsig.decompose import VmdSettings

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

    from gearsig.decompose import long_modes

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


def _length_shown(analysis: Analysis, stretch: SignalSegment, signal: ModeSignal) -> float:
    """Return how much of the waveforms is drawn at first, in s or revolutions; an envelope's rhythms are slow."""
    is_envelope = signal.axis == "frequency" and signal.source != stretch.channel
    shown = length_shown(analysis, stretch, over_angle=signal.axis == "order", of_mesh=not is_envelope)
    return SHOWN / signal.rate if shown is None else shown


def _show_figure(analysis: Analysis, modes: Modes, length: float) -> None:
    from gearsig.plot import modes_figure

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
