"""Ridges of a time–frequency map, and the waveforms of the components that run along them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import streamlit as st

from app.dashboard import state
from app.dashboard.widgets.line_chart import Axes
from app.dashboard.widgets.methods.curves import Curve, show_curves
from app.dashboard.widgets.methods.downloads import offer_downloads
from app.dashboard.widgets.methods.map_choice import MapChoice, MapSettings, choose_map
from app.dashboard.widgets.methods.ridge_components import show_components
from app.dashboard.widgets.picture import show_picture
from gearsig.diagnosis.types import Analysis, ChannelAnalysis
from gearsig.plot.display import with_unit
from gearsig.plot.thin import thin

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from gearsig.timefreq.types import Ridge, TimeFrequencyMap

VIEW = "ridges"
MOST_RIDGES = 6
HEIGHT_IN = 4.2
N_MOST = 1_000_000
"""Each component is as long as the stretch."""
N_KEPT = 8


@dataclass(frozen=True)
class Search:
    """What the search for ridges is told."""

    n_ridges: int
    stiffness: float
    steepest: float


def show_ridges(analysis: Analysis, channel: ChannelAnalysis) -> None:
    """Show ridges on their map, their course, and the waveform along one of them."""
    choice = choose_map(analysis, channel, VIEW, first="Squeezed wavelet", periods=5.0, n_most=N_MOST)
    search = _choose_search(analysis)
    levels = choice.levels()
    with st.spinner("Looking for ridges …", show_time=True):
        found = ridges_of(choice.stretch.key, choice.settings, search, levels)
    _show_map(choice, levels, found, search.n_ridges)
    _show_course(analysis, found)
    waveforms = show_components(analysis, choice, found)
    offer_downloads(analysis, VIEW, waveforms, tables={"Ridges": lambda: ridge_columns(found)})


def _choose_search(analysis: Analysis) -> Search:
    one, two, three = st.columns(3)
    n_ridges = one.slider("Ridges", 1, MOST_RIDGES, 2, key=_key("number", analysis), persist_state="session")
    about = "Price of changes of slope: raise it for sweeps in noise, lower it for fast modulation."
    stiffness = two.select_slider(
        "Penalty on bends",
        (0.0, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0),
        value=1.0,
        format_func="{:g}".format,
        key=_key("stiffness", analysis),
        help=about,
        persist_state="session",
    )
    steepest = three.select_slider(
        "Steepest (lines per column)",
        (0.25, 0.5, 1.0, 2.0, 4.0, 8.0),
        value=2.0,
        format_func="{:g}".format,
        key=_key("steepest", analysis),
        help="How many lines of the map a ridge may rise or fall from one of its thousand columns to the next.",
        persist_state="session",
    )
    return Search(int(n_ridges), float(stiffness), float(steepest))


@st.cache_data(max_entries=N_KEPT, show_spinner=False)
def ridges_of(key: str, settings: MapSettings, search: Search, _levels: TimeFrequencyMap) -> tuple[Ridge, ...]:
    """Return the ridges of a map; `key` and the settings stand for it."""
    from gearsig.timefreq.ridges import ridges

    del key, settings
    return ridges(_levels, search.n_ridges, stiffness=search.stiffness, steepest=search.steepest)


def _show_map(choice: MapChoice, levels: TimeFrequencyMap, found: Sequence[Ridge], n_asked: int) -> None:
    from gearsig.plot.time_frequency import time_frequency_figure

    words = f"Ridges of {choice.stretch.channel} on its levels: {levels.axis_label} over {levels.at_label}"
    figure = time_frequency_figure(levels, found, dynamic_range_db=choice.span_db, height_in=HEIGHT_IN, numbered=True)
    show_picture(figure, words)
    fewer = f"The map shows only {len(found)} of {n_asked} ridges. " if len(found) < n_asked else ""
    shared = any(bool(ridge.shared.any()) for ridge in found)
    dashed = "Dashed: another ridge is so near that both share their level. " if shared else ""
    st.caption(
        f"{fewer}{dashed}Ridge 1 has the largest rms of its amplitude. Each runs through the whole stretch, also where "
        "it fades. Only what stands out clearly on this map is looked for: the strongest line of the spectrum may lie "
        "above it, or be too unsteady."
    )


def _show_course(analysis: Analysis, found: Sequence[Ridge]) -> None:
    """Show momentary frequency or order, and amplitude, of each ridge."""
    first = found[0]
    from gearsig.timefreq.types import at_label, axis_label

    limits = float(first.at[0]), float(first.at[-1])
    below = at_label(first.axis, first.shaft)
    left, right = st.columns(2)
    for place, name, values in (
        (left, axis_label(first.axis, first.shaft), [ridge.positions for ridge in found]),
        (right, with_unit("amplitude peak", first.unit), [ridge.amplitude for ridge in found]),
    ):
        curves = [Curve(*thin(first.at, y), f"ridge {i + 1}", i) for i, y in enumerate(values)]
        with place:
            show_curves(curves, Axes(below, name, limits), _key(f"course {name}", analysis), height_px=220)


def ridge_columns(found: Sequence[Ridge]) -> Mapping[str, ArrayLike]:
    """Return time or angle, then frequency or order and amplitude of each ridge."""
    from gearsig.timefreq.types import at_label

    first = found[0]
    unit = "Hz" if first.axis == "frequency" else "orders"
    columns: dict[str, ArrayLike] = {at_label(first.axis, first.shaft): first.at}
    for i, ridge in enumerate(found, start=1):
        columns[f"ridge {i} ({unit})"] = ridge.positions
        columns[f"ridge {i} {with_unit('amplitude peak', ridge.unit)}"] = ridge.amplitude
    return columns


def _key(name: str, analysis: Analysis) -> str:
    return state.view_key(f"{VIEW} {name}", analysis)
