"""Levels over time and frequency, or shaft angle and order: short-time Fourier, wavelets, both synchrosqueezed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import streamlit as st

from app.dashboard import state
from app.dashboard.widgets.methods.choice import choose_one
from app.dashboard.widgets.methods.stretch import Stretch, choose_stretch
from app.dashboard.widgets.picture import show_picture
from gearsig.diagnosis.types import Analysis, ChannelAnalysis
from gearsig.report.lines import highest_order_of_interest

if TYPE_CHECKING:
    from gearsig.timefreq.types import Reduction, TimeFrequencyMap
    from gearsig.timefreq.uniform import UniformSignal

TRANSFORMS = {
    "Fourier": "Short-time Fourier transform: the same window for all lines. For steady lines and sidebands.",
    "Wavelet": "Continuous wavelet transform: short in time at high, sharp at low frequencies. For impacts.",
    "Squeezed Fourier": "Synchrosqueezed: each component is gathered at its momentary frequency. Sharp for a few clear "
    "components, not for noise or impacts.",
    "Squeezed wavelet": "Synchrosqueezed: each component is gathered at its momentary frequency. Sharp for a few clear "
    "components, not for noise or impacts.",
}
OF_WAVELETS = ("Wavelet", "Squeezed wavelet")
REDUCTIONS: dict[str, Reduction] = {"Mean": "mean", "Largest": "max"}
N_FIRST = 200_000
N_MAPS = 8
HEIGHT_IN = 4.6
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


def show_time_frequency(analysis: Analysis, channel: ChannelAnalysis) -> None:
    """Show a map of one channel with the transform's parameters."""
    transform, over_angle = _choose_transform(analysis)
    left, right = st.columns(2)
    with left:
        stretch = choose_stretch(analysis, channel, "time–frequency", n_first=N_FIRST)
    if over_angle and stretch.angle is None:
        st.info("The shaft's angle is not known in this stretch.")
        return
    signal = signal_of(stretch, over_angle=over_angle)
    with right:
        limits = _choose_limits(analysis, channel, signal, of_wavelet=transform in OF_WAVELETS)
    settings, span_db = _choose_settings(analysis, signal, transform, limits)
    with st.spinner("Computing the map …", show_time=True):
        levels = level_map(stretch.key, settings, signal)
    from gearsig.plot.time_frequency import time_frequency_figure

    words = f"Levels of {stretch.channel}: {levels.axis_label} over {levels.at_label}, {levels.method}"
    show_picture(time_frequency_figure(levels, dynamic_range_db=span_db, height_in=HEIGHT_IN), words)
    st.caption("Between the dashed lines and the ends, a level depends on what is assumed outside of the stretch.")


def _choose_transform(analysis: Analysis) -> tuple[str, bool]:
    from gearsig.angle.types import ShaftAngle

    left, right = st.columns((3, 2), vertical_alignment="bottom")
    with left:
        transform = choose_one("Transform", list(TRANSFORMS), _key("transform", analysis), default="Wavelet")
    with right:
        if isinstance(analysis.shaft_angle, ShaftAngle):
            about = "Over the shaft's angle, lines are orders: a change of speed does not smear them."
            over = choose_one("Over", ("Time", "Shaft angle"), _key("over", analysis), about=about)
        else:
            over = "Time"
            st.caption("Over time: there is no shaft angle, as the speed is not known.")
    st.caption(TRANSFORMS[transform])
    return transform, over == "Shaft angle"


def _choose_settings(
    analysis: Analysis, signal: UniformSignal, transform: str, limits: tuple[float, float]
) -> tuple[MapSettings, float]:
    """Return the settings, and the span of the colours in dB."""
    left, middle, right = st.columns((2, 2, 1))
    with left:
        length = _choose_periods(analysis) if transform in OF_WAVELETS else _choose_window(analysis, signal)
    span_db = middle.slider(
        "Colours span (dB)", 20, 120, 60, step=5, key=_key("span", analysis), persist_state="session"
    )
    with right:
        about = "A column holds many samples: their mean power, or the largest one, which keeps the height of impacts."
        each = choose_one("Each column", list(REDUCTIONS), _key("reduction", analysis), about=about)
    return MapSettings(transform, signal.axis, limits, REDUCTIONS[each], length), float(span_db)


def _choose_limits(
    analysis: Analysis, channel: ChannelAnalysis, signal: UniformSignal, *, of_wavelet: bool
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
    key = _key(f"limits {signal.axis} {of_wavelet} {end!r}", analysis)
    chosen = st.select_slider(label, texts, value=first, key=key, persist_state="session")
    i, j = (texts.index(text) for text in chosen)
    if i == j:
        i, j = max(0, i - 1), min(len(texts) - 1, max(i, 1))
    return float(options[i]), float(options[j])


def _choose_periods(analysis: Analysis) -> float:
    return float(
        st.slider(
            "Periods in the wavelet",
            1.5,
            16.0,
            2.5,
            step=0.5,
            key=_key("periods", analysis),
            help="More periods tell close frequencies apart, fewer show impacts sharper in time.",
            persist_state="session",
        )
    )


def _choose_window(analysis: Analysis, signal: UniformSignal) -> float:
    """Return the window's length, a power of two of samples, shown in ms or revolutions."""
    lengths = [2**k for k in range(5, 16) if 2**k <= signal.n_samples // 4] or [signal.n_samples // 4]
    texts = {n: _length_text(n / signal.rate, signal.axis) for n in lengths}
    usual = min(lengths, key=lambda n: abs(np.log2(n * 64.0 / signal.n_samples)))
    n = st.select_slider(
        "Window",
        lengths,
        value=usual,
        format_func=texts.__getitem__,
        key=_key(f"window {signal.axis} {signal.rate!r} {lengths[-1]}", analysis),
        help="Longer windows tell close lines apart, shorter ones show changes sooner.",
        persist_state="session",
    )
    return float(n) / signal.rate


def _length_text(length: float, axis: str) -> str:
    return f"{1e3 * length:.3g} ms" if axis == "frequency" else f"{length:.3g} revolutions"


def signal_of(stretch: Stretch, *, over_angle: bool) -> UniformSignal:
    """Return the samples over time, or resampled over the shaft's angle."""
    from gearsig.timefreq.uniform import UniformSignal, uniform

    if not over_angle or stretch.angle is None:
        recording = stretch.recording
        return UniformSignal(
            recording.values(stretch.channel),
            recording.sampling_rate_hz,
            start=stretch.start_s,
            unit=stretch.unit,
            source=stretch.channel,
        )
    from gearsig.angle.resample import resample_to_angle

    return uniform(resample_to_angle(stretch.recording, stretch.angle, channels=[stretch.channel]), stretch.channel)


@st.cache_data(max_entries=N_MAPS, show_spinner=False)
def level_map(key: str, settings: MapSettings, _signal: UniformSignal) -> TimeFrequencyMap:
    """Return the map; `key` and the settings' axis stand for the signal.

    Raises
    ------
    GearsigError
        See the transforms.
    """
    del key
    if settings.transform in OF_WAVELETS:
        return _wavelet_map(_signal, settings)
    from gearsig.timefreq.squeezed_stft import squeezed_stft_map
    from gearsig.timefreq.stft import stft_map

    transform = stft_map if settings.transform == "Fourier" else squeezed_stft_map
    low, high = settings.limits
    return transform(
        _signal, window_length=settings.length, lowest=low or None, highest=high, reduction=settings.reduction
    )


def _wavelet_map(signal: UniformSignal, settings: MapSettings) -> TimeFrequencyMap:
    from gearsig.timefreq.cwt import cwt_map
    from gearsig.timefreq.lines import lowest_possible
    from gearsig.timefreq.squeezed_cwt import squeezed_cwt_map
    from gearsig.timefreq.wavelets import Morse

    wavelet = Morse(beta=float(round((np.pi * settings.length) ** 2 / 3.0)))  # √(3β)/π periods
    transform = cwt_map if settings.transform == "Wavelet" else squeezed_cwt_map
    low = max(settings.limits[0], lowest_possible(signal, wavelet))
    return transform(signal, wavelet=wavelet, lowest=low, highest=settings.limits[1], reduction=settings.reduction)


def _key(name: str, analysis: Analysis) -> str:
    return state.view_key(f"time–frequency {name}", analysis)
