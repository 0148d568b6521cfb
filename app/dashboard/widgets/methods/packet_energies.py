"""Energy of each wavelet packet node as bars, in a chosen order of the nodes."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import streamlit as st

from app.dashboard import state
from app.dashboard.as_typed import as_typed
from app.dashboard.look import palette
from app.dashboard.widgets.line_chart import CONFIG
from gearsig.diagnosis.types import Analysis
from gearsig.plot.display import unit_text

if TYPE_CHECKING:
    from gearsig.timefreq.packets import WaveletPackets

ORDERINGS = ("frequency", "filter tree", "energy")
HEIGHT_PX = 260


def node_order(found: WaveletPackets, ordering: str) -> list[int]:
    """Return the bands in one of `ORDERINGS`."""
    from gearsig.timefreq.packets import natural_order

    if ordering == "filter tree":
        return [int(band) for band in natural_order(found.n_bands)]
    if ordering == "energy":
        return [int(band) for band in np.argsort(-found.energies, kind="stable")]
    return list(range(found.n_bands))


def show_energies(analysis: Analysis, found: WaveletPackets, ordering: str) -> None:
    """Show each node's share of the energy as a bar."""
    from plotly.graph_objects import Figure

    from gearsig.timefreq.packets import node_path

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
    from gearsig.timefreq.packets import node_path

    step = max(1, len(bands) // 16)
    shown = bands[::step]
    return {
        "tickmode": "array",
        "tickvals": [node_path(band, found.level) for band in shown],
        "ticktext": [f"{found.limits_of(band)[0]:.4g}" for band in shown],
    }
