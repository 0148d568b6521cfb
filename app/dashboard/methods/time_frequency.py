"""Levels over time and frequency, or shaft angle and order; ridges on them, and the components along the ridges."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, get_args

import numpy as np
import streamlit as st

from app.dashboard.methods.frame import (
    Curve,
    MethodPage,
    SignalSegment,
    Waveforms,
    cached,
    show_curves,
    signal_of,
    waveforms_of,
)
from app.dashboard.widgets.charts import Axes, show_picture
from gearsig.checks import FloatArray
from gearsig.plot import thin, time_frequency_figure, with_unit
from gearsig.report import highest_order_of_interest
from gearsig.timefreq import (
    Morse,
    Reduction,
    Ridge,
    SqueezeEngine,
    TimeFrequencyMap,
    UniformSignal,
    at_label,
    axis_label,
    component,
    cwt_map,
    lowest_possible,
    ridges,
    squeezed_cwt_map,
    squeezed_stft_map,
    stft_map,
)

if TYPE_CHECKING:
    from numpy.typing import ArrayLike


# --------------------
# Choice of a transform over time and frequency, or angle and order, with its parameters, and its map.
# --------------------

SQUEEZED_TEXT = (
    "Synchrosqueezed: each component is concentrated at its momentary frequency. Sharp for a few clear components, "
    "not for noise or impacts."
)


@dataclass(frozen=True)
class Transform:
    """A transform: its function, what it is good for, and the samples that take a few seconds."""

    map_of: Callable[..., TimeFrequencyMap]
    about: str
    n_max: int
    of_wavelets: bool = False
    squeezed: bool = False


TRANSFORMS = {
    "Fourier": Transform(
        stft_map,
        "Short-time Fourier transform: the same window for all lines. For steady lines and sidebands.",
        20_000_000,
    ),
    "Wavelet": Transform(
        cwt_map,
        "Continuous wavelet transform: short in time at high, sharp at low frequencies. For impacts.",
        10_000_000,
        of_wavelets=True,
    ),
    "Squeezed Fourier": Transform(squeezed_stft_map, SQUEEZED_TEXT, 4_000_000, squeezed=True),
    "Squeezed wavelet": Transform(squeezed_cwt_map, SQUEEZED_TEXT, 2_000_000, of_wavelets=True, squeezed=True),
}
REDUCTIONS: dict[str, Reduction] = {"Mean": "mean", "Largest": "max"}
MAX_OF_SSQUEEZEPY = 100_000
"""Samples: it holds the whole matrix of lines and samples several times."""
OCTAVES_SHOWN = 8.0
"""Of wavelet maps at first; lower lines are mostly the ends' doing."""


@dataclass(frozen=True)
class MapSettings:
    """Settings of a map; `length` of the window in s or revolutions, of a wavelet in its periods."""

    transform: str
    limits: tuple[float, float]
    reduction: Reduction
    length: float
    engine: str = "gearsig"

    def wavelet(self) -> Morse:
        """Return the wavelet, of usual length where the transform has none."""
        if not TRANSFORMS[self.transform].of_wavelets:
            return Morse()
        return Morse(beta=float(round((np.pi * self.length) ** 2 / 3.0)))  # √(3β)/π periods


@dataclass(frozen=True)
class MapChoice:
    """What the user chose: the segment, its signal over time or angle, the settings, the span of the colours in dB."""

    segment: SignalSegment
    signal: UniformSignal
    settings: MapSettings
    span_db: float


def choose_map(
    page: MethodPage, *, first: str = "Wavelet", periods: float = 2.5, n_max: int | None = None
) -> MapChoice:
    """Let the user choose segment, transform and parameters.

    Parameters
    ----------
    page : MethodPage
    first : str
        Transform chosen at first.
    periods : float
        In the wavelet, at first.
    n_max : int or None
        Samples, where fewer than the transform allows.

    Raises
    ------
    RefusalError
        If the shaft's angle is not known in the segment.
    """
    left, right = st.columns((3, 2), vertical_alignment="bottom")
    name = page.choose(left, "Transform", list(TRANSFORMS), default=first)
    transform = TRANSFORMS[name]
    over_angle = page.choose_over_angle(right)
    st.caption(transform.about)
    engine, limit = "gearsig", min(transform.n_max, n_max or transform.n_max)
    if transform.squeezed:
        about = "ssqueezepy: another program, for comparison; single precision, and short segments only."
        engine = page.choose(st, "Engine", get_args(SqueezeEngine), about=about, as_written=True)
        limit = limit if engine == "gearsig" else MAX_OF_SSQUEEZEPY
    left, right = st.columns(2)
    with left:
        segment = page.segment(n_first=200_000, n_max=limit)
    signal = signal_of(segment, over_angle=over_angle)
    limits = _choose_limits(page, right, signal, of_wavelets=transform.of_wavelets)
    one, two, three = st.columns((2, 2, 1))
    if transform.of_wavelets:
        about = "More periods tell close frequencies apart, fewer show impacts sharper in time."
        length = page.ask(one.slider, "Periods in the wavelet", 1.5, 16.0, periods, step=0.5, about=about)
    else:
        length = _choose_window(page, one, signal)
    span_db = page.ask(two.slider, "Colours span (dB)", 20, 120, 60, step=5)
    about = "A column holds many samples: their mean power, or the largest one, which keeps the height of impacts."
    reduction = REDUCTIONS[page.choose(three, "Each column", list(REDUCTIONS), about=about)]
    return MapChoice(segment, signal, MapSettings(name, limits, reduction, length, engine), float(span_db))


def _choose_limits(page: MethodPage, place: Any, signal: UniformSignal, *, of_wavelets: bool) -> tuple[float, float]:
    """Return the lines that are shown; wavelets have no line at zero, and their limits go in octaves."""
    end = float(signal.highest_valid)
    low, top = (end / 2**OCTAVES_SHOWN if of_wavelets else 0.0), end
    if signal.axis == "order" and page.channel.order_spectrum is not None:
        top = min(end, highest_order_of_interest(page.analysis, page.channel.order_spectrum))
    octaves = np.linspace(OCTAVES_SHOWN + 4.0, 0.0, 193)
    options = end / 2**octaves if of_wavelets else np.linspace(0.0, end, 401)
    texts = [f"{value:.4g}" for value in options]
    first = texts[int(np.argmin(np.abs(options - low)))], texts[int(np.argmin(np.abs(options - top)))]
    label = "Orders" if signal.axis == "order" else "Frequencies (Hz)"
    key = f"limits {signal.axis} {of_wavelets} {end!r}"
    chosen = page.ask(place.select_slider, label, texts, value=first, key=key)
    i, j = (texts.index(text) for text in chosen)
    if i == j:
        i, j = max(0, i - 1), min(len(texts) - 1, max(i, 1))
    return float(options[i]), float(options[j])


def _choose_window(page: MethodPage, place: Any, signal: UniformSignal) -> float:
    """Return the window's length, a power of two of samples, shown in ms or revolutions."""
    lengths = [2**k for k in range(5, 16) if 2**k <= signal.n_samples // 4] or [signal.n_samples // 4]

    def text(n: int) -> str:
        length = n / signal.rate
        return f"{1e3 * length:.3g} ms" if signal.axis == "frequency" else f"{length:.3g} revolutions"

    n = page.ask(
        place.select_slider,
        "Window",
        lengths,
        value=min(lengths, key=lambda n: abs(np.log2(n * 64.0 / signal.n_samples))),
        format_func=text,
        key=f"window {signal.axis} {signal.rate!r} {lengths[-1]}",
        about="Longer windows tell close lines apart, shorter ones show changes sooner.",
    )
    return float(n) / signal.rate


@cached(6, "Computing the map …")
def level_map(signal: UniformSignal, settings: MapSettings) -> TimeFrequencyMap:
    """Return the map.

    Raises
    ------
    GearsigError
        See the transforms.
    """
    transform, (low, high) = TRANSFORMS[settings.transform], settings.limits
    more: dict[str, Any] = {"engine": settings.engine} if transform.squeezed else {}
    if transform.of_wavelets:
        more["wavelet"] = settings.wavelet()
        low = max(low, lowest_possible(signal, settings.wavelet()))
    else:
        more["window_length"] = settings.length
    return transform.map_of(signal, lowest=low or None, highest=high, reduction=settings.reduction, **more)


def show_time_frequency(page: MethodPage) -> None:
    """Show a map of one channel with the transform's parameters."""
    choice = choose_map(page)
    levels = level_map(choice.signal, choice.settings)
    text = f"Levels of {choice.segment.channel}: {levels.axis_label} over {levels.at_label}, {levels.method}"
    show_picture(time_frequency_figure(levels, dynamic_range_db=choice.span_db, height_in=4.6), text)
    st.caption("Between the dashed lines and the ends, a level depends on what is assumed outside of the segment.")
    page.offer(None, {"Levels": lambda: _map_columns(levels)})


def _map_columns(levels: TimeFrequencyMap) -> Mapping[str, ArrayLike]:
    """Return a map as columns: time or angle first, then the levels of each line."""
    unit = "Hz" if levels.axis == "frequency" else "orders"
    lines = {f"{p:.7g} {unit}": levels.values[:, i] for i, p in enumerate(levels.positions)}
    return {levels.at_label: levels.at, **lines}


# --------------------
# Ridges of a map.
# --------------------


@dataclass(frozen=True)
class RidgeSearch:
    """Settings of the search for ridges."""

    n_ridges: int
    stiffness: float
    steepest: float


def show_ridges(page: MethodPage) -> None:
    """Show ridges on their map, their frequency and amplitude, and the waveform along one of them."""
    # each component is as long as the segment
    choice = choose_map(page, first="Squeezed wavelet", periods=5.0, n_max=1_000_000)
    search = _choose_search(page)
    levels = level_map(choice.signal, choice.settings)
    ridges_found = ridges_of(levels, search)
    text = f"Ridges of {choice.segment.channel} on its levels: {levels.axis_label} over {levels.at_label}"
    figure = time_frequency_figure(levels, ridges_found, dynamic_range_db=choice.span_db, height_in=4.2, numbered=True)
    show_picture(figure, text)
    n = len(ridges_found)
    fewer = f"The map shows only {n} of {search.n_ridges} ridges. " if n < search.n_ridges else ""
    shared = any(bool(ridge.shared.any()) for ridge in ridges_found)
    dashed = "Dashed: another ridge is so near that both share their level. " if shared else ""
    st.caption(
        f"{fewer}{dashed}Ridge 1 has the largest rms of its amplitude. Each runs through the whole segment, also where "
        "it fades. Only what stands out clearly on this map is looked for: the strongest line of the spectrum may lie "
        "above it, or be too unsteady."
    )
    _show_profiles(page, ridges_found)
    waveforms = _show_components(page, choice, ridges_found)
    page.offer(waveforms, {"Ridges": lambda: _ridge_columns(ridges_found)})


def _choose_search(page: MethodPage) -> RidgeSearch:
    one, two, three = st.columns(3)
    n_ridges = page.ask(one.slider, "Ridges", 1, 6, 2)
    about = "Price of changes of slope: raise it for sweeps in noise, lower it for fast modulation."
    options: tuple[float, ...] = (0.0, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0)
    stiffness = page.ask(
        two.select_slider, "Penalty on bends", options, value=1.0, format_func="{:g}".format, about=about
    )
    about = "How many lines of the map a ridge may rise or fall from one of its thousand columns to the next."
    options = (0.25, 0.5, 1.0, 2.0, 4.0, 8.0)
    steepest = page.ask(
        three.select_slider, "Steepest (lines per column)", options, value=2.0, format_func="{:g}".format, about=about
    )
    return RidgeSearch(n_ridges, stiffness, steepest)


@cached(8, "Looking for ridges …")
def ridges_of(levels: TimeFrequencyMap, search: RidgeSearch) -> tuple[Ridge, ...]:
    """Return the ridges of a map."""
    return ridges(levels, search.n_ridges, stiffness=search.stiffness, steepest=search.steepest)


def _show_profiles(page: MethodPage, ridges_found: Sequence[Ridge]) -> None:
    """Show momentary frequency or order, and amplitude, of each ridge."""
    first = ridges_found[0]
    limits = float(first.at[0]), float(first.at[-1])
    below = at_label(first.axis, first.shaft)
    left, right = st.columns(2)
    for place, name, values in (
        (left, axis_label(first.axis, first.shaft), [ridge.positions for ridge in ridges_found]),
        (right, with_unit("amplitude peak", first.unit), [ridge.amplitude for ridge in ridges_found]),
    ):
        curves = [Curve(*thin(first.at, y), f"ridge {i + 1}", i) for i, y in enumerate(values)]
        with place:
            show_curves(curves, Axes(below, name, limits), page.key(f"profile {name}"), height_px=220)


def _ridge_columns(ridges_found: Sequence[Ridge]) -> Mapping[str, ArrayLike]:
    """Return time or angle, then frequency or order and amplitude of each ridge."""
    first = ridges_found[0]
    unit = "Hz" if first.axis == "frequency" else "orders"
    columns: dict[str, ArrayLike] = {at_label(first.axis, first.shaft): first.at}
    for i, ridge in enumerate(ridges_found, start=1):
        columns[f"ridge {i} ({unit})"] = ridge.positions
        columns[f"ridge {i} {with_unit('amplitude peak', ridge.unit)}"] = ridge.amplitude
    return columns


# --------------------
# Waveforms of the components that run along ridges.
# --------------------

AS_WAVELET = "as the wavelet"
RESIDUAL = "residual without all of them"


def _show_components(page: MethodPage, choice: MapChoice, ridges_found: Sequence[Ridge]) -> Waveforms:
    """Show the waveform along one of the ridges, and return those of all."""
    one, two, three = st.columns((3, 3, 4))
    names = [f"component {i + 1}" for i in range(len(ridges_found))]
    chosen = page.choose(one, "Waveform of", names, key=f"component of {len(names)}")
    about = "How far from the ridge, in percent of its frequency or order, the component reaches."
    widths = (AS_WAVELET, *(f"± {percent} %" for percent in (2, 5, 10, 15, 20, 30, 40, 50)))
    width = page.ask(two.select_slider, "Band around the ridge", widths, about=about)
    half_width = None if width == AS_WAVELET else float(width.split()[1]) / 100.0
    about = "By its momentary frequency: keeps more noise out, and fast modulation too. By its lines: smoother."
    assigned = ("By its momentary frequency", "By its lines")
    squeezed = page.choose(three, "Assigned", assigned, about=about) == assigned[0]
    signal, wavelet = choice.signal, choice.settings.wavelet()
    columns: dict[str, FloatArray] = {"signal": signal.values}
    residual = signal.values.astype("float64")
    for name, ridge in zip(names, ridges_found, strict=True):
        columns[name] = component_of(signal, ridge, wavelet, half_width, squeezed)
        residual -= columns[name]
    columns[RESIDUAL] = residual
    step = f"components along {len(ridges_found)} ridges, {wavelet.name}"
    waveforms = waveforms_of(choice.segment, signal, columns, step)
    shown = page.first_length(choice.segment, over_angle=signal.axis == "order")
    limits = page.window(waveforms, shown=shown, in_middle=True)
    page.draw(waveforms, limits, {"signal": -1, chosen: 0}, last=False)
    page.draw(waveforms, limits, {RESIDUAL: 1}, label="residual", height_px=180)
    st.caption(
        "A component is the sum of the wavelet coefficients in the band around its ridge. Where bands of two ridges "
        "overlap, both components hold what lies there."
    )
    return waveforms


@cached(12, "Reconstructing the components …")
def component_of(
    signal: UniformSignal, ridge: Ridge, wavelet: Morse, half_width: float | None, squeezed: bool
) -> FloatArray:
    """Return the waveform along a ridge."""
    return component(signal, ridge, half_width=half_width, squeezed=squeezed, wavelet=wavelet).values
