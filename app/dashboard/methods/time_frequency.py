"""Levels over time and frequency, or shaft angle and order; ridges on them, and the components along the ridges."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, get_args

import numpy as np
import streamlit as st

from app.dashboard.methods.frame import MethodPage, SignalSegment, Waveforms, cached, signal_of, waveforms_of
from app.dashboard.widgets.charts import Axes, ChartLine, show_lines, show_picture
from gearsig import timefreq
from gearsig.checks import FloatArray
from gearsig.plot import time_frequency_figure, with_unit
from gearsig.report import highest_order_of_interest

SQUEEZED_TEXT = (
    "Synchrosqueezed: each component is concentrated at its momentary frequency. Sharp for a few clear components, "
    "not for noise or impacts."
)


@dataclass(frozen=True)
class Transform:
    """A transform: its function, what it is good for, and the samples that take a few seconds."""

    map_of: Callable[..., timefreq.TimeFrequencyMap]
    about: str
    n_max: int
    of_wavelets: bool = False
    squeezed: bool = False


TRANSFORMS = {
    "Fourier": Transform(
        cached(6, "Computing the map …")(timefreq.stft_map),
        "Short-time Fourier transform: the same window for all lines. For steady lines and sidebands.",
        20_000_000,
    ),
    "Wavelet": Transform(
        cached(6, "Computing the map …")(timefreq.cwt_map),
        "Continuous wavelet transform: short in time at high, sharp at low frequencies. For impacts.",
        10_000_000,
        of_wavelets=True,
    ),
    "Squeezed Fourier": Transform(
        cached(6, "Computing the map …")(timefreq.squeezed_stft_map), SQUEEZED_TEXT, 4_000_000, squeezed=True
    ),
    "Squeezed wavelet": Transform(
        cached(6, "Computing the map …")(timefreq.squeezed_cwt_map),
        SQUEEZED_TEXT,
        2_000_000,
        of_wavelets=True,
        squeezed=True,
    ),
}
MAX_OF_SSQUEEZEPY = 100_000
"""Samples: it holds the whole matrix of lines and samples several times."""
OCTAVES_SHOWN = 8.0
"""Of wavelet maps at first; lower lines are mostly the ends' doing."""
ridges_of = cached(8, "Looking for ridges …")(timefreq.ridges)
component_of = cached(12, "Reconstructing the components …")(timefreq.component)


@dataclass(frozen=True)
class LevelMap:
    """The map that the user chose: of which segment, its signal over time or angle, the wavelet, the colours' span."""

    segment: SignalSegment
    signal: timefreq.UniformSignal
    levels: timefreq.TimeFrequencyMap
    wavelet: timefreq.Morse
    span_db: float


def _choose_map(page: MethodPage, *, first: str = "Wavelet", periods: float = 2.5, n_max: int = 20_000_000) -> LevelMap:
    """Let the user choose segment, transform and parameters.

    Parameters
    ----------
    page : MethodPage
    first : str
        Transform chosen at first.
    periods : float
        In the wavelet, at first.
    n_max : int
        Samples, where fewer than the transform allows.

    Raises
    ------
    GearsigError
        If the shaft's angle is not known in the segment; see the transforms.
    """
    left, right = st.columns((3, 2), vertical_alignment="bottom")
    transform: Transform = page.choose(left, "Transform", TRANSFORMS, default=first)
    over_angle = page.choose_over_angle(right)
    st.caption(transform.about)
    limit, more = min(transform.n_max, n_max), dict[str, Any]()
    if transform.squeezed:
        about = "ssqueezepy: another program, for comparison; single precision, and short segments only."
        engines = get_args(timefreq.SqueezeEngine)
        more["engine"] = page.choose(st, "Engine", engines, about=about, as_written=True)
        limit = limit if more["engine"] == "gearsig" else MAX_OF_SSQUEEZEPY
    left, right = st.columns(2)
    with left:
        segment = page.segment(n_first=200_000, n_max=limit)
    signal = signal_of(segment, over_angle=over_angle)
    low, high = _choose_limits(page, right, signal, of_wavelets=transform.of_wavelets)
    one, two, three = st.columns((2, 2, 1))
    wavelet = timefreq.Morse()
    if transform.of_wavelets:
        about = "More periods tell close frequencies apart, fewer show impacts sharper in time."
        n = page.ask(one.slider, "Periods in the wavelet", 1.5, 16.0, periods, step=0.5, about=about)
        wavelet = timefreq.Morse(beta=float(round((np.pi * n) ** 2 / 3.0)))  # √(3β)/π periods
        low, more["wavelet"] = max(low, timefreq.lowest_possible(signal, wavelet)), wavelet
    else:
        more["window_length"] = _choose_window(page, one, signal)
    span_db = page.ask(two.slider, "Colours span (dB)", 20, 120, 60, step=5)
    about = "A column holds many samples: their mean power, or the largest one, which keeps the height of impacts."
    more["reduction"] = page.choose(three, "Each column", {"Mean": "mean", "Largest": "max"}, about=about)
    levels = transform.map_of(signal, lowest=low or None, highest=high, **more)
    return LevelMap(segment, signal, levels, wavelet, float(span_db))


def _choose_limits(
    page: MethodPage, place: Any, signal: timefreq.UniformSignal, *, of_wavelets: bool
) -> tuple[float, float]:
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


def _choose_window(page: MethodPage, place: Any, signal: timefreq.UniformSignal) -> float:
    """Return the window's length, a power of two of samples, shown in ms or revolutions."""
    lengths = [2**k for k in range(5, 16) if 2**k <= signal.n_samples // 4] or [signal.n_samples // 4]
    scale, unit = (1e3, "ms") if signal.axis == "frequency" else (1.0, "revolutions")
    n = page.ask(
        place.select_slider,
        "Window",
        lengths,
        value=min(lengths, key=lambda n: abs(np.log2(n * 64.0 / signal.n_samples))),
        format_func=lambda n: f"{scale * n / signal.rate:.3g} {unit}",
        key=f"window {signal.axis} {signal.rate!r} {lengths[-1]}",
        about="Longer windows tell close lines apart, shorter ones show changes sooner.",
    )
    return float(n) / signal.rate


def show_time_frequency(page: MethodPage) -> None:
    """Show a map of one channel with the transform's parameters."""
    shown = _choose_map(page)
    levels = shown.levels
    text = f"Levels of {shown.segment.channel}: {levels.axis_label} over {levels.at_label}, {levels.method}"
    show_picture(time_frequency_figure(levels, dynamic_range_db=shown.span_db, height_in=4.6), text)
    st.caption("Between the dashed lines and the ends, a level depends on what is assumed outside of the segment.")
    lines = {f"{p:.7g} {_unit(levels.axis)}": levels.values[:, i] for i, p in enumerate(levels.positions)}
    page.offer(None, {"Levels": {levels.at_label: levels.at, **lines}})


def _unit(axis: str) -> str:
    return "Hz" if axis == "frequency" else "orders"


def show_ridges(page: MethodPage) -> None:
    """Show ridges on their map, their frequency and amplitude, and the waveform along one of them."""
    # each component is as long as the segment
    shown = _choose_map(page, first="Squeezed wavelet", periods=5.0, n_max=1_000_000)
    one, two, three = st.columns(3)
    n_wanted = page.ask(one.slider, "Ridges", 1, 6, 2)
    about = "Price of changes of slope: raise it for sweeps in noise, lower it for fast modulation."
    options: tuple[float, ...] = (0.0, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0)
    number = "{:g}".format
    stiffness = page.ask(two.select_slider, "Penalty on bends", options, value=1.0, format_func=number, about=about)
    about = "How many lines of the map a ridge may rise or fall from one of its thousand columns to the next."
    label, options = "Steepest (lines per column)", (0.25, 0.5, 1.0, 2.0, 4.0, 8.0)
    steepest = page.ask(three.select_slider, label, options, value=2.0, format_func=number, about=about)

    levels = shown.levels
    ridges = ridges_of(levels, n_wanted, stiffness=stiffness, steepest=steepest)
    text = f"Ridges of {shown.segment.channel} on its levels: {levels.axis_label} over {levels.at_label}"
    figure = time_frequency_figure(levels, ridges, dynamic_range_db=shown.span_db, height_in=4.2, numbered=True)
    show_picture(figure, text)
    n = len(ridges)
    fewer = f"The map shows only {n} of {n_wanted} ridges. " if n < n_wanted else ""
    shared = any(bool(ridge.shared.any()) for ridge in ridges)
    dashed = "Dashed: another ridge is so near that both share their level. " if shared else ""
    st.caption(
        f"{fewer}{dashed}Ridge 1 has the largest rms of its amplitude. Each runs through the whole segment, also where "
        "it fades. Only what stands out clearly on this map is looked for: the strongest line of the spectrum may lie "
        "above it, or be too unsteady."
    )
    first, table = ridges[0], dict[str, FloatArray]()
    at, peak = timefreq.at_label(first.axis, first.shaft), with_unit("amplitude peak", first.unit)
    left, right = st.columns(2)
    for place, name, values in (
        (left, timefreq.axis_label(first.axis, first.shaft), [ridge.positions for ridge in ridges]),
        (right, peak, [ridge.amplitude for ridge in ridges]),
    ):
        lines = [ChartLine(first.at, y, f"ridge {i + 1}", i) for i, y in enumerate(values)]
        axes = Axes(at, name, (float(first.at[0]), float(first.at[-1])))
        with place:
            show_lines(lines, axes, page.key(f"profile {name}"), height_px=220, legend=True)
    for i, ridge in enumerate(ridges, start=1):
        table |= {f"ridge {i} ({_unit(first.axis)})": ridge.positions, f"ridge {i} {peak}": ridge.amplitude}
    page.offer(_show_components(page, shown, ridges), {"Ridges": {at: first.at, **table}})


AS_WAVELET = "as the wavelet"
RESIDUAL = "residual without all of them"


def _show_components(page: MethodPage, shown: LevelMap, ridges: Sequence[timefreq.Ridge]) -> Waveforms:
    """Show the waveform along one of the ridges, and return those of all."""
    one, two, three = st.columns((3, 3, 4))
    names = [f"component {i + 1}" for i in range(len(ridges))]
    chosen = page.choose(one, "Waveform of", names, key=f"component of {len(names)}")
    about = "How far from the ridge, in percent of its frequency or order, the component reaches."
    widths = (AS_WAVELET, *(f"± {percent} %" for percent in (2, 5, 10, 15, 20, 30, 40, 50)))
    width = page.ask(two.select_slider, "Band around the ridge", widths, about=about)
    half_width = None if width == AS_WAVELET else float(width.split()[1]) / 100.0
    about = "By its momentary frequency: keeps more noise out, and fast modulation too. By its lines: smoother."
    assigned = {"By its momentary frequency": True, "By its lines": False}
    squeezed = page.choose(three, "Assigned", assigned, about=about)
    signal, wavelet = shown.signal, shown.wavelet
    columns: dict[str, FloatArray] = {"signal": signal.values}
    residual = signal.values.astype("float64")
    for name, ridge in zip(names, ridges, strict=True):
        part = component_of(signal, ridge, half_width=half_width, squeezed=squeezed, wavelet=wavelet)
        columns[name] = part.values
        residual -= part.values
    columns[RESIDUAL] = residual
    step = f"components along {len(ridges)} ridges, {wavelet.name}"
    waveforms = waveforms_of(shown.segment, signal, columns, step)
    length = page.first_length(shown.segment, over_angle=signal.axis == "order")
    page.draw(waveforms, chosen, RESIDUAL, shown=length, in_middle=True)
    st.caption(
        "A component is the sum of the wavelet coefficients in the band around its ridge. Where bands of two ridges "
        "overlap, both components hold what lies there."
    )
    return waveforms
