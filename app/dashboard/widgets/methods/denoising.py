"""Noise taken out by wavelet thresholds, with what was taken out beside it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import streamlit as st

from app.dashboard import state
from app.dashboard.widgets.line_chart import Axes
from app.dashboard.widgets.methods.choice import choose_one
from app.dashboard.widgets.methods.curves import Curve, show_curves
from app.dashboard.widgets.methods.stretch import Stretch, choose_stretch
from app.dashboard.widgets.range_slider import choose_range
from gearsig.diagnosis.types import Analysis, ChannelAnalysis
from gearsig.plot.display import unit_text, with_unit
from gearsig.plot.thin import thin
from gearsig.report.numbers import readable

if TYPE_CHECKING:
    from gearsig.decompose.wavelet_types import Denoised, DenoiseSettings

N_FIRST = 200_000
N_KEPT = 4
N_SHOWN = 3000
"""Samples of the waveforms at first."""
WAVELETS = ("sym8", "sym4", "db4", "db8", "coif3", "haar")
THRESHOLDS = {
    "universal": "next to no noise is left",
    "sure": "least estimated risk of each level",
    "bayes": "keeps most",
}


def show_denoising(analysis: Analysis, channel: ChannelAnalysis) -> None:
    """Show one channel without its noise."""
    settings = _choose_settings(analysis)
    left, right = st.columns(2)
    with left:
        stretch = choose_stretch(analysis, channel, "denoising", n_first=N_FIRST)
    with st.spinner("Removing the noise …", show_time=True):
        found = denoised(stretch.key, settings, stretch)
    with right:
        limits = _choose_window(analysis, stretch)
    _show_waveforms(analysis, stretch, found, limits)
    unit = unit_text(stretch.unit)
    st.markdown(
        f"Removed: **{100.0 * found.removed_share:.3g} %** of the energy. Estimated noise on the finest level: "
        f"**{readable(found.noise_rms)} {unit}** rms."
    )
    st.caption(
        "Look at what was removed: a rhythm in it is signal that should not have gone. Steady tones are better "
        "gathered by a spectrum or a synchronous average."
    )
    _show_levels(found, unit)


def _choose_settings(analysis: Analysis) -> DenoiseSettings:
    from gearsig.decompose.wavelet_types import DenoiseSettings

    one, two, three = st.columns(3)
    four, five, _ = st.columns(3)
    about = "; ".join(f"{name}: {text}" for name, text in THRESHOLDS.items())
    with one:
        threshold = choose_one("Threshold", list(THRESHOLDS), _key("threshold", analysis), about=about)
    with two:
        about = "What is above the threshold is shrunk by it (soft), kept as it is (hard), or in between (garrote)."
        rule = choose_one("Rule", ("soft", "hard", "garrote"), _key("rule", analysis), about=about)
    wavelet = four.selectbox("Wavelet", WAVELETS, key=_key("wavelet", analysis), persist_state="session")
    with three:
        about = "White: one size of noise for all levels, from the finest. Coloured: each level has its own."
        noise = choose_one("Noise", ("White", "Coloured"), _key("noise", analysis), about=about)
    about = "Cycle spinning: the mean over shifts of the signal against the wavelet's grid. 1 is none."
    n_shifts = five.slider("Shifts", 1, 16, 8, key=_key("shifts", analysis), help=about, persist_state="session")
    return DenoiseSettings(
        threshold,  # type: ignore[arg-type] # checked there
        rule,  # type: ignore[arg-type] # checked there
        wavelet=str(wavelet),
        noise="finest level" if noise == "White" else "each level",
        n_shifts=int(n_shifts),
    )


@st.cache_resource(max_entries=N_KEPT, show_spinner=False)
def denoised(key: str, settings: DenoiseSettings, _stretch: Stretch) -> Denoised:
    """Return the signal without noise; `key` stands for the stretch. It is frozen, so that sessions may share it."""
    from gearsig.decompose.wavelet_denoise import denoise_channel

    del key
    return denoise_channel(_stretch.recording, _stretch.channel, settings)


def _choose_window(analysis: Analysis, stretch: Stretch) -> tuple[float, float]:
    rate = stretch.recording.sampling_rate_hz
    shown = (stretch.start_s, min(stretch.end_s, stretch.start_s + N_SHOWN / rate))
    return choose_range(
        "Waveforms shown (s)", analysis, stretch.end_s, start=stretch.start_s, shown=shown, name="denoising"
    )


def _show_waveforms(analysis: Analysis, stretch: Stretch, found: Denoised, limits: tuple[float, float]) -> None:
    rate = found.sampling_rate_hz
    start = max(0, int((limits[0] - stretch.start_s) * rate))
    part = slice(start, start + max(2, int(np.ceil((limits[1] - limits[0]) * rate)) + 1))
    time = stretch.start_s + np.arange(len(found.values))[part] / rate
    signal = stretch.recording.values(stretch.channel)[part]
    curves = [
        Curve(*thin(time, signal), "signal", -1),
        Curve(*thin(time, found.values[part]), "without noise", 0),
    ]
    show_curves(curves, Axes("", with_unit("signal", stretch.unit), limits), _key("signal", analysis), height_px=240)
    removed = [Curve(*thin(time, found.removed[part]), "removed", 1)]
    axes = Axes("time (s)", with_unit("removed", stretch.unit), limits)
    show_curves(removed, axes, _key("removed", analysis), height_px=180)


def _show_levels(found: Denoised, unit: str) -> None:
    with st.expander(f"Levels of the wavelet transform ({len(found.levels)})"):
        columns = {
            "level": [v.level for v in found.levels],
            "from (Hz)": [v.band_hz[0] for v in found.levels],
            "to (Hz)": [v.band_hz[1] for v in found.levels],
            f"noise ({unit or 1})": [v.noise for v in found.levels],
            f"threshold ({unit or 1})": [v.threshold for v in found.levels],
            "kept (%)": [100.0 * v.kept_share for v in found.levels],
        }
        number = st.column_config.NumberColumn(format="%.4g")
        st.dataframe(columns, hide_index=True, width="stretch", column_config=dict.fromkeys(list(columns)[1:], number))


def _key(name: str, analysis: Analysis) -> str:
    return state.view_key(f"denoising {name}", analysis)
