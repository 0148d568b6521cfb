"""Wavelets: a signal without its noise, and its energy and parts by wavelet packets."""

from __future__ import annotations

import numpy as np
import streamlit as st

from app.dashboard.methods.frame import Columns, MethodPage, cached, show_table, signal_of, waveforms_of
from app.dashboard.theme import as_typed, palette
from app.dashboard.widgets.charts import show_chart, show_picture
from gearsig import timefreq
from gearsig.checks import FloatArray
from gearsig.decompose import DenoiseSettings, denoise
from gearsig.errors import InputError
from gearsig.formatting import readable
from gearsig.plot import time_frequency_figure, unit_text

N_FIRST, N_MAX = 200_000, 4_000_000
WAVELETS = ("sym8", "sym4", "db4", "db8", "coif3", "haar")
PACKET_WAVELETS = ("sym12", "sym8", "db4", "db10", "db20", "coif3", "dmey", "haar")
denoised_segment = cached(2, "Removing the noise …")(denoise)
packets_of = cached(2, "Splitting the signal …")(timefreq.wavelet_packets)
packet_map = cached(2, "Splitting the signal …")(timefreq.wavelet_packet_map)


def show_denoising(page: MethodPage) -> None:
    """Show one channel without its noise."""
    settings = _choose_denoising(page)
    left, right = st.columns(2)
    with left:
        segment = page.segment(n_first=N_FIRST, n_max=N_MAX)
    denoised = denoised_segment(segment.recording, segment.channel, settings)
    columns = {"signal": segment.values, "without noise": denoised.values, "removed": denoised.removed}
    step = f"{settings.threshold} {settings.rule} thresholds, {settings.wavelet}"
    waveforms = waveforms_of(segment, signal_of(segment), columns, step)
    shown = page.first_length(segment, over_angle=False)
    page.draw(waveforms, "without noise", "removed", shown=shown, place=right)
    unit = unit_text(segment.unit)
    st.markdown(
        f"Removed: **{100.0 * denoised.removed_share:.3g} %** of the energy. Estimated noise on the finest level: "
        f"**{readable(denoised.noise_rms)} {unit}** rms."
    )
    st.caption(
        "Look at what was removed: a rhythm in it is signal that should not have gone. Steady tones are better "
        "extracted by a spectrum or a synchronous average."
    )
    with st.expander(f"Levels of the wavelet transform ({len(denoised.levels)})"):
        show_table(
            {
                "level": [level.level for level in denoised.levels],
                "from (Hz)": [level.band_hz[0] for level in denoised.levels],
                "to (Hz)": [level.band_hz[1] for level in denoised.levels],
                f"noise ({unit or 1})": [level.noise for level in denoised.levels],
                f"threshold ({unit or 1})": [level.threshold for level in denoised.levels],
                "kept (%)": [100.0 * level.kept_share for level in denoised.levels],
            }
        )
    page.offer(waveforms)


def _choose_denoising(page: MethodPage) -> DenoiseSettings:
    one, two, three = st.columns(3)
    four, five, six = st.columns(3)
    about = "universal: next to no noise remains; sure: minimum estimated risk of each level; bayes: keeps most"
    threshold = page.choose(one, "Threshold", ("universal", "sure", "bayes"), about=about)
    about = "What is above the threshold is shrunk by it (soft), kept as it is (hard), or in between (garrote)."
    rule = page.choose(two, "Rule", ("soft", "hard", "garrote"), about=about)
    about = "White: one size of noise for all levels, from the finest. Coloured: each level has its own."
    noise = page.choose(three, "Noise", {"White": "finest level", "Coloured": "each level"}, about=about)
    wavelet = page.ask(four.selectbox, "Wavelet", WAVELETS)
    about = "Cycle spinning: the mean over shifts of the signal against the wavelet's grid. 1 is none."
    n_shifts = page.ask(five.slider, "Shifts", 1, 16, 8, about=about)
    about = "How often the signal is halved in frequency; what lies below the coarsest level is kept as it is."
    levels = page.ask(six.select_slider, "Levels", ("automatic", *map(str, range(1, 15))), about=about)
    n_levels = None if levels == "automatic" else int(levels)
    return DenoiseSettings(threshold, rule, wavelet=wavelet, n_levels=n_levels, noise=noise, n_shifts=n_shifts)


def show_packets(page: MethodPage) -> None:
    """Show energies of the nodes of one channel, their levels over time, and the waveform of chosen ones."""
    one, two, three, four = st.columns((2, 3, 4, 3))
    about = "Long wavelets separate bands better; nearly symmetric ones (sym, dmey) show an event when it was."
    wavelet = page.ask(one.selectbox, "Wavelet", PACKET_WAVELETS, about=about)
    about = "The signal is split so often into halves: 2 to the power of it nodes of equal width."
    level = page.ask(two.slider, "Level", 1, 8, 4, about=about)
    about = "Upwards in frequency; as the filter tree branches, low-pass (a) before high-pass (d); or by energy."
    ordering = page.choose(three, "Order of the nodes", ("frequency", "filter tree", "energy"), about=about)
    over_angle = page.choose_over_angle(four)
    segment = page.segment(n_first=N_FIRST, n_max=N_MAX)
    signal = signal_of(segment, over_angle=over_angle)
    packets = packets_of(signal, wavelet=wavelet, level=level)
    levels = packet_map(signal, wavelet=wavelet, level=level)

    _show_energies(page, packets, ordering)
    text = f"Levels of the wavelet packets of {segment.channel}: {levels.axis_label} over {levels.at_label}"
    show_picture(time_frequency_figure(levels, height_in=3.8), text)
    nodes = _choose_nodes(page, packets, ordering)
    paths = " + ".join(timefreq.node_path(band, packets.level) for band in nodes)
    name = f"node{'s' if len(nodes) > 1 else ''} {paths}"
    values = timefreq.packet_inverse(packets, nodes)
    columns = {"signal": signal.values, name: values, "residual": signal.values - values}
    waveforms = waveforms_of(segment, signal, columns, f"wavelet packets, {packets.wavelet}, {name}")
    page.draw(waveforms, name, shown=page.first_length(segment, over_angle=over_angle))
    st.caption(
        "Near the ends, within the wavelet's length, nodes mix both ends of the segment: it is taken as periodic."
    )
    bands, unit = range(packets.n_bands), _unit(packets)
    table: Columns = {
        "node": [timefreq.node_path(band, packets.level) for band in bands],
        f"from ({unit})": [packets.limits_of(band)[0] for band in bands],
        f"to ({unit})": [packets.limits_of(band)[1] for band in bands],
        "mean square": packets.energies / packets.n_samples,
        "share of the energy (%)": _shares_percent(packets),
    }
    page.offer(waveforms, {"Energy per node": table})


def _unit(packets: timefreq.WaveletPackets) -> str:
    return "Hz" if packets.axis == "frequency" else "orders"


def _shares_percent(packets: timefreq.WaveletPackets) -> FloatArray:
    return 100.0 * packets.energies / (float(packets.energies.sum()) or 1.0)


def _bands(packets: timefreq.WaveletPackets, ordering: str) -> list[int]:
    """Return the bands by frequency, in the order of the filter tree, or by energy."""
    if ordering == "filter tree":
        return [int(band) for band in timefreq.natural_order(packets.n_bands)]
    if ordering == "energy":
        return [int(band) for band in np.argsort(-packets.energies, kind="stable")]
    return list(range(packets.n_bands))


def _show_energies(page: MethodPage, packets: timefreq.WaveletPackets, ordering: str) -> None:
    """Show each node's share of the energy as a bar."""
    from plotly.graph_objects import Figure

    bands, unit = _bands(packets, ordering), _unit(packets)
    figure = Figure()
    figure.add_bar(
        x=[timefreq.node_path(band, packets.level) for band in bands],
        y=_shares_percent(packets)[bands],
        customdata=[f"{low:.5g} to {high:.5g} {unit}" for low, high in map(packets.limits_of, bands)],
        marker={"color": palette().measured},
        hovertemplate="%{x}, %{customdata}: %{y:.3g} %<extra></extra>",
    )
    axis: dict[str, object] = {"type": "category", "title": "node"}
    if ordering == "frequency":  # paths alone do not say where the bars lie
        labelled = bands[:: max(1, len(bands) // 16)]
        axis |= {
            "title": f"node, lower border in {unit}",
            "tickmode": "array",
            "tickvals": [timefreq.node_path(band, packets.level) for band in labelled],
            "ticktext": [f"{packets.limits_of(band)[0]:.4g}" for band in labelled],
        }
    figure.update_layout(
        height=260,
        margin={"l": 8, "r": 8, "t": 8, "b": 8},
        showlegend=False,
        bargap=0.15,
        xaxis=axis,
        yaxis={"title": "share of the energy (%)"},
    )
    show_chart(figure, page.key(f"energies {ordering}"), "Share of the energy in each node")
    rms = f"{np.sqrt(packets.energies.sum() / packets.n_samples):.4g} {unit_text(packets.unit)}".strip()
    st.caption(
        as_typed(
            f"{packets.n_bands} nodes, each {packets.band_width:.5g} {unit} wide. Together they hold the segment's "
            f"energy, rms {rms}; its mean is in the first. A path names the filters: a low-pass, d high-pass."
        )
    )


def _choose_nodes(page: MethodPage, packets: timefreq.WaveletPackets, ordering: str) -> list[int]:
    """Return the bands whose waveform is shown, the strongest at first."""
    strongest = int(np.argmax(packets.energies))
    names = {}
    for band in _bands(packets, ordering):
        low, high = packets.limits_of(band)
        names[band] = f"{timefreq.node_path(band, packets.level)}: {low:.5g} to {high:.5g} {_unit(packets)}"
    chosen = page.ask(
        st.multiselect,
        "Waveform of the nodes",
        list(names),
        default=[strongest],
        format_func=names.__getitem__,
        key=f"nodes {packets.n_bands} {packets.axis} {strongest} {ordering}",
        about="Several nodes are added up; all of them together make the signal.",
    )
    if not chosen:
        raise InputError("no node is chosen", where="Waveform of the nodes", remedy="choose one from the list")
    return sorted(chosen)
