"""Waveforms of the components that run along ridges."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import streamlit as st

from app.dashboard import state
from app.dashboard.widgets.methods.choice import choose_one
from app.dashboard.widgets.methods.map_choice import MapChoice
from app.dashboard.widgets.methods.mesh_cycles import length_shown
from app.dashboard.widgets.methods.uniform_signal import waveforms_over
from app.dashboard.widgets.methods.waveforms import Waveforms, choose_window, show_waveforms
from gearsig.diagnosis.types import Analysis

if TYPE_CHECKING:
    from gearsig.checks import FloatArray
    from gearsig.timefreq.types import Ridge
    from gearsig.timefreq.uniform import UniformSignal
    from gearsig.timefreq.wavelets import Morse

VIEW = "components"
USUAL = "as the wavelet"
WIDTHS = (USUAL, *(f"± {percent} %" for percent in (2, 5, 10, 15, 20, 30, 40, 50)))
GATHERED = ("By its momentary frequency", "By its lines")
N_KEPT = 12
REST = "what is left without all of them"


def show_components(analysis: Analysis, choice: MapChoice, ridges: Sequence[Ridge]) -> Waveforms:
    """Show the waveform along one of the ridges, and return those of all."""
    one, two, three = st.columns((3, 3, 4))
    names = [f"component {i + 1}" for i in range(len(ridges))]
    with one:
        chosen = choose_one("Waveform of", names, _key(f"of {len(names)}", analysis))
    about = "How far from the ridge, in percent of its frequency or order, the component reaches."
    key = _key("width", analysis)
    width = two.select_slider("Band around the ridge", WIDTHS, help=about, key=key, persist_state="session")
    with three:
        about = "By its momentary frequency: keeps more noise out, and fast modulation too. By its lines: smoother."
        gathered = choose_one("Gathered", GATHERED, _key("gathered", analysis), about=about)
    half_width = None if width == USUAL else float(str(width).split()[1]) / 100.0
    waveforms = _waveforms(choice, ridges, half_width, squeezed=gathered == GATHERED[0])
    shown = length_shown(analysis, choice.stretch, over_angle=choice.signal.axis == "order")
    limits = choose_window(analysis, waveforms, VIEW, shown=shown, in_middle=True)
    show_waveforms(analysis, waveforms, limits, {"signal": -1, chosen: 0}, f"{VIEW} signal", last=False)
    show_waveforms(analysis, waveforms, limits, {REST: 1}, f"{VIEW} rest", label="what is left", height_px=180)
    st.caption(
        "A component is the sum of the wavelet coefficients in the band around its ridge. Where bands of two ridges "
        "overlap, both components hold what lies there."
    )
    return waveforms


def _waveforms(choice: MapChoice, ridges: Sequence[Ridge], half_width: float | None, *, squeezed: bool) -> Waveforms:
    signal, wavelet = choice.signal, choice.settings.wavelet()
    columns: dict[str, FloatArray] = {"signal": signal.values}
    rest = signal.values.astype("float64")
    with st.spinner("Gathering the components …", show_time=True):
        for i, ridge in enumerate(ridges):
            key = f"{choice.stretch.key} {ridge_key(ridge)}"
            values = component_of(key, half_width, squeezed, wavelet, signal, ridge)
            columns[f"component {i + 1}"] = values
            rest -= values
    columns[REST] = rest
    return waveforms_over(signal, choice.stretch, columns, f"components along {len(ridges)} ridges, {wavelet.name}")


def ridge_key(ridge: Ridge) -> str:
    """Return a text that stands for a ridge."""
    from hashlib import blake2b

    return blake2b(ridge.positions.tobytes() + ridge.at.tobytes(), digest_size=16).hexdigest()


@st.cache_data(max_entries=N_KEPT, show_spinner=False)
def component_of(
    key: str, half_width: float | None, squeezed: bool, wavelet: Morse, _signal: UniformSignal, _ridge: Ridge
) -> FloatArray:
    """Return the waveform along a ridge; `key` stands for the signal and the ridge."""
    from gearsig.timefreq.component import component

    del key
    return component(_signal, _ridge, half_width=half_width, squeezed=squeezed, wavelet=wavelet).values


def _key(name: str, analysis: Analysis) -> str:
    return state.view_key(f"{VIEW} {name}", analysis)
