"""Noise taken out by wavelet thresholds, with what was taken out beside it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
import streamlit as st

from app.dashboard import state
from app.dashboard.methods.signals import (
    SignalSegment,
    Waveforms,
    choose_one,
    choose_over_angle,
    choose_stretch,
    choose_window,
    length_shown,
    offer_downloads,
    show_waveforms,
    signal_of,
    waveforms_of,
    waveforms_over,
)
from app.dashboard.theme import as_typed, palette
from app.dashboard.widgets.charts import CONFIG, show_picture
from gearsig.diagnosis import Analysis, ChannelAnalysis
from gearsig.errors import InputError
from gearsig.formatting import readable
from gearsig.plot import unit_text

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from gearsig.decompose import Denoised, DenoiseSettings
    from gearsig.timefreq import TimeFrequencyMap, UniformSignal, WaveletPackets


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


def denoised_waveforms(stretch: SignalSegment, found: Denoised) -> Waveforms:
    """Return the signal, what is left of it, and what was removed."""
    told = found.settings
    columns = {
        "signal": stretch.recording.values(stretch.channel),
        "without noise": found.values,
        "removed": found.removed,
    }
    return waveforms_of(stretch, columns, f"{told.threshold} {told.rule} thresholds, {told.wavelet}")


def _choose_settings(analysis: Analysis) -> DenoiseSettings:
    from gearsig.decompose import DenoiseSettings

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
def denoised(key: str, settings: DenoiseSettings, _stretch: SignalSegment) -> Denoised:
    """Return the signal without noise; `key` stands for the stretch. It is frozen, so that sessions may share it."""
    from gearsig.decompose import denoise_channel

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


# --------------------
# Energy of each wavelet packet node as bars, in a chosen order of the nodes.
# --------------------


ORDERINGS = ("frequency", "filter tree", "energy")
HEIGHT_PX = 260


def node_order(found: WaveletPackets, ordering: str) -> list[int]:
    """Return the bands in one of `ORDERINGS`."""
    from gearsig.timefreq import natural_order

    if ordering == "filter tree":
        return [int(band) for band in natural_order(found.n_bands)]
    if ordering == "energy":
        return [int(band) for band in np.argsort(-found.energies, kind="stable")]
    return list(range(found.n_bands))


def show_energies(analysis: Analysis, found: WaveletPackets, ordering: str) -> None:
    """Show each node's share of the energy as a bar."""
    from plotly.graph_objects import Figure

    from gearsig.timefreq import node_path

    bands = node_order(found, ordering)
    shares = 100.0 * found.energies / (float(found.energies.sum()) or 1.0)
    unit = "Hz" if found.axis == "frequency" else "orders"
    names = [node_path(band, found.level) for band in bands]
    words = [f"{low:.5g} to {high:.5g} {unit}" for low, high in map(found.limits_of, bands)]
    figure = Figure()
    figure.add_bar(
        x=names,
        y=shares[bands],
        customdata=words,
        marker={"color": palette().measured},
        hovertemplate="%{x}, %{customdata}: %{y:.3g} %<extra></extra>",
    )
    by_frequency = ordering == "frequency"
    ticks = _ticks(found, bands) if by_frequency else {}
    figure.update_layout(
        height=HEIGHT_PX,
        margin={"l": 8, "r": 8, "t": 8, "b": 8},
        showlegend=False,
        bargap=0.15,
        xaxis={"type": "category", "title": f"node, lower border in {unit}" if by_frequency else "node", **ticks},
        yaxis={"title": "share of the energy (%)"},
    )
    key = state.view_key(f"packet energies {ordering}", analysis)
    st.plotly_chart(figure, width="stretch", key=key, config=CONFIG, alt="Share of the energy in each node")
    rms = f"{np.sqrt(found.energies.sum() / found.n_samples):.4g} {unit_text(found.unit)}".strip()
    st.caption(
        as_typed(
            f"{found.n_bands} nodes, each {found.band_width:.5g} {unit} wide. Together they hold the stretch's energy, "
            f"rms {rms}; its mean is in the first. A path names the filters: a low-pass, d high-pass."
        )
    )


def _ticks(found: WaveletPackets, bands: list[int]) -> dict[str, object]:
    """Label some bars by their lower border: paths alone do not say where they lie."""
    from gearsig.timefreq import node_path

    step = max(1, len(bands) // 16)
    shown = bands[::step]
    return {
        "tickmode": "array",
        "tickvals": [node_path(band, found.level) for band in shown],
        "ticktext": [f"{found.limits_of(band)[0]:.4g}" for band in shown],
    }


# --------------------
# Wavelet packets: energy of each node, and the signal that some nodes make.
# --------------------


VIEW = "wavelet packets"
PACKETS_WAVELETS = ("sym12", "sym8", "db4", "db10", "db20", "coif3", "dmey", "haar")
DEEPEST = 8
HEIGHT_IN = 3.8


def show_packets(analysis: Analysis, channel: ChannelAnalysis) -> None:
    """Show energies of the nodes of one channel, their levels over time, and the waveform of chosen ones."""
    wavelet, level, ordering, over_angle = _choose_settings_packets(analysis)
    stretch = choose_stretch(analysis, channel, VIEW, n_first=N_FIRST, n_most=N_MOST)
    signal = signal_of(stretch, over_angle=over_angle)
    with st.spinner("Splitting the signal …", show_time=True):
        found = packets_of(f"{stretch.key} {over_angle}", wavelet, level, signal)
        levels = packet_map(f"{stretch.key} {over_angle}", wavelet, level, signal)
    show_energies(analysis, found, ordering)
    from gearsig.plot import time_frequency_figure

    words = f"Levels of the wavelet packets of {stretch.channel}: {levels.axis_label} over {levels.at_label}"
    show_picture(time_frequency_figure(levels, height_in=HEIGHT_IN), words)
    nodes = _choose_nodes(analysis, found, ordering)
    _show_nodes(analysis, stretch, signal, found, nodes)


def _choose_settings_packets(analysis: Analysis) -> tuple[str, int, str, bool]:
    one, two, three, four = st.columns((2, 3, 4, 3))
    about = "Long wavelets separate bands better; nearly symmetric ones (sym, dmey) show an event when it was."
    wavelet = one.selectbox(
        "Wavelet", PACKETS_WAVELETS, key=_key_packets("wavelet", analysis), help=about, persist_state="session"
    )
    about = "The signal is split so often into halves: 2 to the power of it nodes of equal width."
    level = two.slider("Level", 1, DEEPEST, 4, key=_key_packets("level", analysis), help=about, persist_state="session")
    with three:
        about = "Upwards in frequency; as the filter tree branches, low-pass (a) before high-pass (d); or by energy."
        ordering = choose_one("Order of the nodes", ORDERINGS, _key_packets("ordering", analysis), about=about)
    with four:
        over_angle = choose_over_angle(analysis, VIEW)
    return str(wavelet), int(level), ordering, over_angle


@st.cache_resource(max_entries=N_KEPT, show_spinner=False)
def packets_of(key: str, wavelet: str, level: int, _signal: UniformSignal) -> WaveletPackets:
    """Return the packets; `key` stands for the signal. They are frozen, so that sessions may share them."""
    from gearsig.timefreq import wavelet_packets

    del key
    return wavelet_packets(_signal, wavelet=wavelet, level=level)


@st.cache_resource(max_entries=N_KEPT, show_spinner=False)
def packet_map(key: str, wavelet: str, level: int, _signal: UniformSignal) -> TimeFrequencyMap:
    """Return the levels over time or angle; `key` stands for the signal."""
    from gearsig.timefreq import wavelet_packet_map

    del key
    return wavelet_packet_map(_signal, wavelet=wavelet, level=level)


def _choose_nodes(analysis: Analysis, found: WaveletPackets, ordering: str) -> list[int]:
    """Return the bands whose waveform is shown, the strongest at first."""
    strongest = int(np.argmax(found.energies))
    names = {band: node_name(found, band) for band in node_order(found, ordering)}
    chosen = st.multiselect(
        "Waveform of the nodes",
        list(names),
        default=[strongest],
        format_func=names.__getitem__,
        key=_key_packets(f"nodes {found.n_bands} {found.axis} {strongest} {ordering}", analysis),
        persist_state="session",
        help="Several nodes are added up; all of them together make the signal.",
    )
    if not chosen:
        raise InputError("no node is chosen", where="Waveform of the nodes", remedy="choose one from the list")
    return sorted(int(band) for band in chosen)


def node_name(found: WaveletPackets, band: int) -> str:
    """Return path and band of a node."""
    from gearsig.timefreq import node_path

    low, high = found.limits_of(band)
    unit = "Hz" if found.axis == "frequency" else "orders"
    return f"{node_path(band, found.level)}: {low:.5g} to {high:.5g} {unit}"


def _show_nodes(
    analysis: Analysis, stretch: SignalSegment, signal: UniformSignal, found: WaveletPackets, nodes: list[int]
) -> None:
    from gearsig.timefreq import node_path, packet_inverse

    paths = " + ".join(node_path(band, found.level) for band in nodes)
    name = f"node{'s' if len(nodes) > 1 else ''} {paths}"
    values = packet_inverse(found, nodes)
    columns = {"signal": signal.values, name: values, "what is left": signal.values - values}
    waveforms = waveforms_over(signal, stretch, columns, f"wavelet packets, {found.wavelet}, {name}")
    shown = length_shown(analysis, stretch, over_angle=signal.axis == "order")
    limits = choose_window(analysis, waveforms, VIEW, shown=shown)
    show_waveforms(analysis, waveforms, limits, {"signal": -1, name: 0}, VIEW)
    st.caption(
        "Near the ends, within the wavelet's length, nodes mix both ends of the stretch: it is taken as periodic."
    )
    tables = {"Energy per node": lambda: energy_columns(found)}
    offer_downloads(analysis, VIEW, waveforms, tables=tables)


def energy_columns(found: WaveletPackets) -> Mapping[str, ArrayLike]:
    """Return path, borders, energy and share of each node, upwards in frequency."""
    from gearsig.timefreq import node_path

    bands = range(found.n_bands)
    unit = "Hz" if found.axis == "frequency" else "orders"
    energies = found.energies
    return {
        "node": [node_path(band, found.level) for band in bands],
        f"from ({unit})": [found.limits_of(band)[0] for band in bands],
        f"to ({unit})": [found.limits_of(band)[1] for band in bands],
        "mean square": energies / found.n_samples,
        "share of the energy (%)": 100.0 * energies / (float(energies.sum()) or 1.0),
    }


def _key_packets(name: str, analysis: Analysis) -> str:
    return state.view_key(f"{VIEW} {name}", analysis)
