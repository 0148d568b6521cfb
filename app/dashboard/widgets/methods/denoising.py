"""Noise taken out by wavelet thresholds, with what was taken out beside it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import streamlit as st

from app.dashboard import state
from app.dashboard.widgets.methods.choice import choose_one
from app.dashboard.widgets.methods.downloads import offer_downloads
from app.dashboard.widgets.methods.mesh_cycles import length_shown
from app.dashboard.widgets.methods.stretch import Stretch, choose_stretch
from app.dashboard.widgets.methods.waveforms import Waveforms, choose_window, show_waveforms, waveforms_of
from gearsig.diagnosis.types import Analysis, ChannelAnalysis
from gearsig.formatting import readable
from gearsig.plot.display import unit_text

if TYPE_CHECKING:
    from gearsig.decompose.wavelet_types import Denoised, DenoiseSettings

N_FIRST, N_MOST = 200_000, 4_000_000
N_KEPT = 2
"""Answers are several times as long as the stretch."""
WAVELETS = ("sym8", "sym4", "db4", "db8", "coif3", "haar")
LEVELS = ("automatic", *(str(n) for n in range(1, 15)))
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
        stretch = choose_stretch(analysis, channel, "denoising", n_first=N_FIRST, n_most=N_MOST)
    with st.spinner("Removing the noise …", show_time=True):
        found = denoised(stretch.key, settings, stretch)
    waveforms = denoised_waveforms(stretch, found)
    with right:
        shown = length_shown(analysis, stretch, over_angle=False)
        limits = choose_window(analysis, waveforms, "denoising", shown=shown)
    looks = {"signal": -1, "without noise": 0}
    show_waveforms(analysis, waveforms, limits, looks, "denoising", last=False)
    show_waveforms(analysis, waveforms, limits, {"removed": 1}, "denoising removed", label="removed", height_px=180)
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
    offer_downloads(analysis, "denoising", waveforms)


def denoised_waveforms(stretch: Stretch, found: Denoised) -> Waveforms:
    """Return the signal, what is left of it, and what was removed."""
    told = found.settings
    columns = {
        "signal": stretch.recording.values(stretch.channel),
        "without noise": found.values,
        "removed": found.removed,
    }
    return waveforms_of(stretch, columns, f"{told.threshold} {told.rule} thresholds, {told.wavelet}")


def _choose_settings(analysis: Analysis) -> DenoiseSettings:
    from gearsig.decompose.wavelet_types import DenoiseSettings

    one, two, three = st.columns(3)
    four, five, six = st.columns(3)
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
    about = "How often the signal is halved in frequency; what lies below the coarsest level is kept as it is."
    key = _key("levels", analysis)
    levels = six.select_slider("Levels", LEVELS, key=key, help=about, persist_state="session")
    return DenoiseSettings(
        threshold,  # type: ignore[arg-type] # checked there
        rule,  # type: ignore[arg-type] # checked there
        wavelet=str(wavelet),
        n_levels=None if levels == LEVELS[0] else int(levels),
        noise="finest level" if noise == "White" else "each level",
        n_shifts=int(n_shifts),
    )


@st.cache_resource(max_entries=N_KEPT, show_spinner=False)
def denoised(key: str, settings: DenoiseSettings, _stretch: Stretch) -> Denoised:
    """Return the signal without noise; `key` stands for the stretch. It is frozen, so that sessions may share it."""
    from gearsig.decompose.wavelet_denoise import denoise_channel

    del key
    return denoise_channel(_stretch.recording, _stretch.channel, settings)


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
