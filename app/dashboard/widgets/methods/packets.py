"""Wavelet packets: energy of each node, and the signal that some nodes make."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
import streamlit as st

from app.dashboard import state
from app.dashboard.widgets.methods.choice import choose_one
from app.dashboard.widgets.methods.downloads import offer_downloads
from app.dashboard.widgets.methods.mesh_cycles import length_shown
from app.dashboard.widgets.methods.packet_energies import ORDERINGS, node_order, show_energies
from app.dashboard.widgets.methods.stretch import Stretch, choose_stretch
from app.dashboard.widgets.methods.uniform_signal import choose_over_angle, signal_of, waveforms_over
from app.dashboard.widgets.methods.waveforms import choose_window, show_waveforms
from app.dashboard.widgets.picture import show_picture
from gearsig.diagnosis.types import Analysis, ChannelAnalysis
from gearsig.errors import InputError

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from gearsig.timefreq.packets import WaveletPackets
    from gearsig.timefreq.types import TimeFrequencyMap
    from gearsig.timefreq.uniform import UniformSignal

VIEW = "wavelet packets"
N_FIRST, N_MOST = 200_000, 4_000_000
WAVELETS = ("sym12", "sym8", "db4", "db10", "db20", "coif3", "dmey", "haar")
DEEPEST = 8
N_KEPT = 2
HEIGHT_IN = 3.8


def show_packets(analysis: Analysis, channel: ChannelAnalysis) -> None:
    """Show energies of the nodes of one channel, their levels over time, and the waveform of chosen ones."""
    wavelet, level, ordering, over_angle = _choose_settings(analysis)
    stretch = choose_stretch(analysis, channel, VIEW, n_first=N_FIRST, n_most=N_MOST)
    signal = signal_of(stretch, over_angle=over_angle)
    with st.spinner("Splitting the signal …", show_time=True):
        found = packets_of(f"{stretch.key} {over_angle}", wavelet, level, signal)
        levels = packet_map(f"{stretch.key} {over_angle}", wavelet, level, signal)
    show_energies(analysis, found, ordering)
    from gearsig.plot.time_frequency import time_frequency_figure

    words = f"Levels of the wavelet packets of {stretch.channel}: {levels.axis_label} over {levels.at_label}"
    show_picture(time_frequency_figure(levels, height_in=HEIGHT_IN), words)
    nodes = _choose_nodes(analysis, found, ordering)
    _show_nodes(analysis, stretch, signal, found, nodes)


def _choose_settings(analysis: Analysis) -> tuple[str, int, str, bool]:
    one, two, three, four = st.columns((2, 3, 4, 3))
    about = "Long wavelets separate bands better; nearly symmetric ones (sym, dmey) show an event when it was."
    wavelet = one.selectbox("Wavelet", WAVELETS, key=_key("wavelet", analysis), help=about, persist_state="session")
    about = "The signal is split so often into halves: 2 to the power of it nodes of equal width."
    level = two.slider("Level", 1, DEEPEST, 4, key=_key("level", analysis), help=about, persist_state="session")
    with three:
        about = "Upwards in frequency; as the filter tree branches, low-pass (a) before high-pass (d); or by energy."
        ordering = choose_one("Order of the nodes", ORDERINGS, _key("ordering", analysis), about=about)
    with four:
        over_angle = choose_over_angle(analysis, VIEW)
    return str(wavelet), int(level), ordering, over_angle


@st.cache_resource(max_entries=N_KEPT, show_spinner=False)
def packets_of(key: str, wavelet: str, level: int, _signal: UniformSignal) -> WaveletPackets:
    """Return the packets; `key` stands for the signal. They are frozen, so that sessions may share them."""
    from gearsig.timefreq.packets import wavelet_packets

    del key
    return wavelet_packets(_signal, wavelet=wavelet, level=level)


@st.cache_resource(max_entries=N_KEPT, show_spinner=False)
def packet_map(key: str, wavelet: str, level: int, _signal: UniformSignal) -> TimeFrequencyMap:
    """Return the levels over time or angle; `key` stands for the signal."""
    from gearsig.timefreq.packets import wavelet_packet_map

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
        key=_key(f"nodes {found.n_bands} {found.axis} {strongest} {ordering}", analysis),
        persist_state="session",
        help="Several nodes are added up; all of them together make the signal.",
    )
    if not chosen:
        raise InputError("no node is chosen", where="Waveform of the nodes", remedy="choose one from the list")
    return sorted(int(band) for band in chosen)


def node_name(found: WaveletPackets, band: int) -> str:
    """Return path and band of a node."""
    from gearsig.timefreq.packets import node_path

    low, high = found.limits_of(band)
    unit = "Hz" if found.axis == "frequency" else "orders"
    return f"{node_path(band, found.level)}: {low:.5g} to {high:.5g} {unit}"


def _show_nodes(
    analysis: Analysis, stretch: Stretch, signal: UniformSignal, found: WaveletPackets, nodes: list[int]
) -> None:
    from gearsig.timefreq.packets import node_path, packet_inverse

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
    from gearsig.timefreq.packets import node_path

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


def _key(name: str, analysis: Analysis) -> str:
    return state.view_key(f"{VIEW} {name}", analysis)
