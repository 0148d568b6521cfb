"""Levels over time and frequency, or shaft angle and order: short-time Fourier, wavelets, both synchrosqueezed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import streamlit as st

from app.dashboard import state
from app.dashboard.methods.signals import (
    Curve,
    SignalSegment,
    Waveforms,
    choose_one,
    choose_over_angle,
    choose_stretch,
    choose_window,
    length_shown,
    offer_downloads,
    show_curves,
    show_waveforms,
    signal_of,
    waveforms_over,
)
from app.dashboard.widgets.charts import Axes, show_picture
from gearsig.diagnosis import Analysis, ChannelAnalysis
from gearsig.plot import thin, with_unit
from gearsig.report import highest_order_of_interest

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from gearsig.checks import FloatArray
    from gearsig.timefreq import Morse, Reduction, Ridge, TimeFrequencyMap, UniformSignal


# --------------------
# Choice of a transform over time and frequency, or angle and order, with its parameters, and its map.
# --------------------


TRANSFORMS = {
    "Fourier": "Short-time Fourier transform: the same window for all lines. For steady lines and sidebands.",
    "Wavelet": "Continuous wavelet transform: short in time at high, sharp at low frequencies. For impacts.",
    "Squeezed Fourier": "Synchrosqueezed: each component is gathered at its momentary frequency. Sharp for a few clear "
    "components, not for noise or impacts.",
    "Squeezed wavelet": "Synchrosqueezed: each component is gathered at its momentary frequency. Sharp for a few clear "
    "components, not for noise or impacts.",
}
N_MOST = {"Fourier": 20_000_000, "Wavelet": 10_000_000, "Squeezed Fourier": 4_000_000, "Squeezed wavelet": 2_000_000}
"""Samples that take a few seconds; memory does not grow with the number of lines times samples."""
OF_WAVELETS = ("Wavelet", "Squeezed wavelet")
REDUCTIONS: dict[str, Reduction] = {"Mean": "mean", "Largest": "max"}
N_FIRST = 200_000
N_MAPS = 6
OCTAVES_SHOWN = 8.0
"""Of wavelet maps at first; lower lines are mostly the ends' doing."""


@dataclass(frozen=True)
class MapSettings:
    """What a map is told; `length` of the window in s or revolutions, of a wavelet in its periods."""

    transform: str
    axis: str
    limits: tuple[float, float]
    reduction: Reduction
    length: float

    @property
    def is_squeezed(self) -> bool:
        """Whether components are gathered at their momentary frequency."""
        return self.transform.startswith("Squeezed")

    def wavelet(self) -> Morse:
        """Return the wavelet, of usual length where the transform has none."""
        from gearsig.timefreq import Morse

        if self.transform not in OF_WAVELETS:
            return Morse()
        return Morse(beta=float(round((np.pi * self.length) ** 2 / 3.0)))  # √(3β)/π periods


@dataclass(frozen=True)
class MapChoice:
    """What the user chose: the stretch, its signal over time or angle, the settings, the colours' span in dB."""

    stretch: SignalSegment
    signal: UniformSignal
    settings: MapSettings
    span_db: float

    def levels(self) -> TimeFrequencyMap:
        """Return the map, computed once."""
        with st.spinner("Computing the map …", show_time=True):
            return level_map(self.stretch.key, self.settings, self.signal)


def choose_map(
    analysis: Analysis,
    channel: ChannelAnalysis,
    view: str,
    *,
    first: str = "Wavelet",
    periods: float = 2.5,
    n_most: int | None = None,
) -> MapChoice:
    """Let the user choose stretch, transform and parameters.

    Parameters
    ----------
    analysis : Analysis
    channel : ChannelAnalysis
    view : str
        For the keys.
    first : str
        Transform chosen at first.
    periods : float
        In the wavelet, at first.
    n_most : int or None
        Most samples, where fewer than the transform allows.

    Raises
    ------
    RefusalError
        If the shaft's angle is not known in the stretch.
    """
    left, right = st.columns((3, 2), vertical_alignment="bottom")
    with left:
        transform = choose_one("Transform", list(TRANSFORMS), _key(view, "transform", analysis), default=first)
    with right:
        over_angle = choose_over_angle(analysis, view)
    st.caption(TRANSFORMS[transform])
    left, right = st.columns(2)
    with left:
        n_most = min(N_MOST[transform], n_most or N_MOST[transform])
        stretch = choose_stretch(analysis, channel, view, n_first=N_FIRST, n_most=n_most)
    signal = signal_of(stretch, over_angle=over_angle)
    with right:
        limits = _choose_limits(analysis, channel, signal, view, of_wavelet=transform in OF_WAVELETS)
    one, two, three = st.columns((2, 2, 1))
    with one:
        of_wavelet = transform in OF_WAVELETS
        length = _choose_periods(analysis, view, periods) if of_wavelet else _choose_window(analysis, signal, view)
    with two:
        key = _key(view, "span", analysis)
        span_db = st.slider("Colours span (dB)", 20, 120, 60, step=5, key=key, persist_state="session")
    with three:
        about = "A column holds many samples: their mean power, or the largest one, which keeps the height of impacts."
        each = choose_one("Each column", list(REDUCTIONS), _key(view, "reduction", analysis), about=about)
    settings = MapSettings(transform, signal.axis, limits, REDUCTIONS[each], length)
    return MapChoice(stretch, signal, settings, float(span_db))


def _choose_limits(
    analysis: Analysis, channel: ChannelAnalysis, signal: UniformSignal, view: str, *, of_wavelet: bool
) -> tuple[float, float]:
    """Return the lines that are shown; wavelets have no line at zero, and their limits go in octaves."""
    end = float(signal.highest_valid)
    low, top = (end / 2**OCTAVES_SHOWN if of_wavelet else 0.0), end
    if signal.axis == "order" and channel.order_spectrum is not None:
        top = min(end, highest_order_of_interest(analysis, channel.order_spectrum))
    octaves = np.linspace(OCTAVES_SHOWN + 4.0, 0.0, 193)
    options = end / 2**octaves if of_wavelet else np.linspace(0.0, end, 401)
    texts = [f"{value:.4g}" for value in options]
    first = texts[int(np.argmin(np.abs(options - low)))], texts[int(np.argmin(np.abs(options - top)))]
    label = "Orders" if signal.axis == "order" else "Frequencies (Hz)"
    key = _key(view, f"limits {signal.axis} {of_wavelet} {end!r}", analysis)
    chosen = st.select_slider(label, texts, value=first, key=key, persist_state="session")
    i, j = (texts.index(text) for text in chosen)
    if i == j:
        i, j = max(0, i - 1), min(len(texts) - 1, max(i, 1))
    return float(options[i]), float(options[j])


def _choose_periods(analysis: Analysis, view: str, first: float) -> float:
    about = "More periods tell close frequencies apart, fewer show impacts sharper in time."
    key = _key(view, "periods", analysis)
    chosen = st.slider(
        "Periods in the wavelet", 1.5, 16.0, first, step=0.5, key=key, help=about, persist_state="session"
    )
    return float(chosen)


def _choose_window(analysis: Analysis, signal: UniformSignal, view: str) -> float:
    """Return the window's length, a power of two of samples, shown in ms or revolutions."""
    lengths = [2**k for k in range(5, 16) if 2**k <= signal.n_samples // 4] or [signal.n_samples // 4]
    texts = {n: _length_text(n / signal.rate, signal.axis) for n in lengths}
    usual = min(lengths, key=lambda n: abs(np.log2(n * 64.0 / signal.n_samples)))
    n = st.select_slider(
        "Window",
        lengths,
        value=usual,
        format_func=texts.__getitem__,
        key=_key(view, f"window {signal.axis} {signal.rate!r} {lengths[-1]}", analysis),
        help="Longer windows tell close lines apart, shorter ones show changes sooner.",
        persist_state="session",
    )
    return float(n) / signal.rate


def _length_text(length: float, axis: str) -> str:
    return f"{1e3 * length:.3g} ms" if axis == "frequency" else f"{length:.3g} revolutions"


@st.cache_resource(max_entries=N_MAPS, show_spinner=False)
def level_map(key: str, settings: MapSettings, _signal: UniformSignal) -> TimeFrequencyMap:
    """Return the map; `key` and the settings' axis stand for the signal. It is frozen: sessions may share it.

    Raises
    ------
    GearsigError
        See the transforms.
    """
    del key
    if settings.transform in OF_WAVELETS:
        return _wavelet_map(_signal, settings)
    from gearsig.timefreq import squeezed_stft_map, stft_map

    transform = squeezed_stft_map if settings.is_squeezed else stft_map
    low, high = settings.limits
    return transform(
        _signal, window_length=settings.length, lowest=low or None, highest=high, reduction=settings.reduction
    )


def _wavelet_map(signal: UniformSignal, settings: MapSettings) -> TimeFrequencyMap:
    from gearsig.timefreq import cwt_map, lowest_possible, squeezed_cwt_map

    wavelet = settings.wavelet()
    transform = squeezed_cwt_map if settings.is_squeezed else cwt_map
    low = max(settings.limits[0], lowest_possible(signal, wavelet))
    return transform(signal, wavelet=wavelet, lowest=low, highest=settings.limits[1], reduction=settings.reduction)


def _key(view: str, name: str, analysis: Analysis) -> str:
    return state.view_key(f"{view} {name}", analysis)


HEIGHT_IN = 4.6


def show_time_frequency(analysis: Analysis, channel: ChannelAnalysis) -> None:
    """Show a map of one channel with the transform's parameters."""
    choice = choose_map(analysis, channel, "time–frequency")
    levels = choice.levels()
    from gearsig.plot import time_frequency_figure

    words = f"Levels of {choice.stretch.channel}: {levels.axis_label} over {levels.at_label}, {levels.method}"
    show_picture(time_frequency_figure(levels, dynamic_range_db=choice.span_db, height_in=HEIGHT_IN), words)
    st.caption("Between the dashed lines and the ends, a level depends on what is assumed outside of the stretch.")
    offer_downloads(analysis, "time–frequency", tables={"Levels": lambda: map_columns(levels)})


def map_columns(levels: TimeFrequencyMap) -> Mapping[str, ArrayLike]:
    """Return a map as columns: time or angle first, then the levels of each line."""
    unit = "Hz" if levels.axis == "frequency" else "orders"
    lines = {f"{p:.7g} {unit}": levels.values[:, i] for i, p in enumerate(levels.positions)}
    return {levels.at_label: levels.at, **lines}


# --------------------
# Waveforms of the components that run along ridges.
# --------------------


RIDGE_COMPONENTS_VIEW = "components"
USUAL = "as the wavelet"
WIDTHS = (USUAL, *(f"± {percent} %" for percent in (2, 5, 10, 15, 20, 30, 40, 50)))
GATHERED = ("By its momentary frequency", "By its lines")
RIDGE_COMPONENTS_N_KEPT = 12
REST = "what is left without all of them"


def show_components(analysis: Analysis, choice: MapChoice, ridges: Sequence[Ridge]) -> Waveforms:
    """Show the waveform along one of the ridges, and return those of all."""
    one, two, three = st.columns((3, 3, 4))
    names = [f"component {i + 1}" for i in range(len(ridges))]
    with one:
        chosen = choose_one("Waveform of", names, _key_ridge_components(f"of {len(names)}", analysis))
    about = "How far from the ridge, in percent of its frequency or order, the component reaches."
    key = _key_ridge_components("width", analysis)
    width = two.select_slider("Band around the ridge", WIDTHS, help=about, key=key, persist_state="session")
    with three:
        about = "By its momentary frequency: keeps more noise out, and fast modulation too. By its lines: smoother."
        gathered = choose_one("Gathered", GATHERED, _key_ridge_components("gathered", analysis), about=about)
    half_width = None if width == USUAL else float(str(width).split()[1]) / 100.0
    waveforms = _waveforms(choice, ridges, half_width, squeezed=gathered == GATHERED[0])
    shown = length_shown(analysis, choice.stretch, over_angle=choice.signal.axis == "order")
    limits = choose_window(analysis, waveforms, RIDGE_COMPONENTS_VIEW, shown=shown, in_middle=True)
    show_waveforms(
        analysis, waveforms, limits, {"signal": -1, chosen: 0}, f"{RIDGE_COMPONENTS_VIEW} signal", last=False
    )
    show_waveforms(
        analysis, waveforms, limits, {REST: 1}, f"{RIDGE_COMPONENTS_VIEW} rest", label="what is left", height_px=180
    )
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


@st.cache_data(max_entries=RIDGE_COMPONENTS_N_KEPT, show_spinner=False)
def component_of(
    key: str, half_width: float | None, squeezed: bool, wavelet: Morse, _signal: UniformSignal, _ridge: Ridge
) -> FloatArray:
    """Return the waveform along a ridge; `key` stands for the signal and the ridge."""
    from gearsig.timefreq import component

    del key
    return component(_signal, _ridge, half_width=half_width, squeezed=squeezed, wavelet=wavelet).values


def _key_ridge_components(name: str, analysis: Analysis) -> str:
    return state.view_key(f"{RIDGE_COMPONENTS_VIEW} {name}", analysis)


# --------------------
# Ridges of a time–frequency map, and the waveforms of the components that run along them.
# --------------------


VIEW = "ridges"
MOST_RIDGES = 6
RIDGES_HEIGHT_IN = 4.2
RIDGES_N_MOST = 1_000_000
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
    choice = choose_map(analysis, channel, VIEW, first="Squeezed wavelet", periods=5.0, n_most=RIDGES_N_MOST)
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
    n_ridges = one.slider("Ridges", 1, MOST_RIDGES, 2, key=_key_ridges("number", analysis), persist_state="session")
    about = "Price of changes of slope: raise it for sweeps in noise, lower it for fast modulation."
    stiffness = two.select_slider(
        "Penalty on bends",
        (0.0, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0),
        value=1.0,
        format_func="{:g}".format,
        key=_key_ridges("stiffness", analysis),
        help=about,
        persist_state="session",
    )
    steepest = three.select_slider(
        "Steepest (lines per column)",
        (0.25, 0.5, 1.0, 2.0, 4.0, 8.0),
        value=2.0,
        format_func="{:g}".format,
        key=_key_ridges("steepest", analysis),
        help="How many lines of the map a ridge may rise or fall from one of its thousand columns to the next.",
        persist_state="session",
    )
    return Search(int(n_ridges), float(stiffness), float(steepest))


@st.cache_data(max_entries=N_KEPT, show_spinner=False)
def ridges_of(key: str, settings: MapSettings, search: Search, _levels: TimeFrequencyMap) -> tuple[Ridge, ...]:
    """Return the ridges of a map; `key` and the settings stand for it."""
    from gearsig.timefreq import ridges

    del key, settings
    return ridges(_levels, search.n_ridges, stiffness=search.stiffness, steepest=search.steepest)


def _show_map(choice: MapChoice, levels: TimeFrequencyMap, found: Sequence[Ridge], n_asked: int) -> None:
    from gearsig.plot import time_frequency_figure

    words = f"Ridges of {choice.stretch.channel} on its levels: {levels.axis_label} over {levels.at_label}"
    figure = time_frequency_figure(
        levels, found, dynamic_range_db=choice.span_db, height_in=RIDGES_HEIGHT_IN, numbered=True
    )
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
    from gearsig.timefreq import at_label, axis_label

    limits = float(first.at[0]), float(first.at[-1])
    below = at_label(first.axis, first.shaft)
    left, right = st.columns(2)
    for place, name, values in (
        (left, axis_label(first.axis, first.shaft), [ridge.positions for ridge in found]),
        (right, with_unit("amplitude peak", first.unit), [ridge.amplitude for ridge in found]),
    ):
        curves = [Curve(*thin(first.at, y), f"ridge {i + 1}", i) for i, y in enumerate(values)]
        with place:
            show_curves(curves, Axes(below, name, limits), _key_ridges(f"course {name}", analysis), height_px=220)


def ridge_columns(found: Sequence[Ridge]) -> Mapping[str, ArrayLike]:
    """Return time or angle, then frequency or order and amplitude of each ridge."""
    from gearsig.timefreq import at_label

    first = found[0]
    unit = "Hz" if first.axis == "frequency" else "orders"
    columns: dict[str, ArrayLike] = {at_label(first.axis, first.shaft): first.at}
    for i, ridge in enumerate(found, start=1):
        columns[f"ridge {i} ({unit})"] = ridge.positions
        columns[f"ridge {i} {with_unit('amplitude peak', ridge.unit)}"] = ridge.amplitude
    return columns


def _key_ridges(name: str, analysis: Analysis) -> str:
    return state.view_key(f"{VIEW} {name}", analysis)
