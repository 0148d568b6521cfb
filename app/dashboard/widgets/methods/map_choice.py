"""Choice of a transform over time and frequency, or angle and order, with its parameters, and its map."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import streamlit as st

from app.dashboard import state
from app.dashboard.widgets.methods.choice import choose_one
from app.dashboard.widgets.methods.stretch import Stretch, choose_stretch
from app.dashboard.widgets.methods.uniform_signal import choose_over_angle, signal_of
from gearsig.diagnosis.types import Analysis, ChannelAnalysis
from gearsig.report.lines import highest_order_of_interest

if TYPE_CHECKING:
    from gearsig.timefreq.types import Reduction, TimeFrequencyMap
    from gearsig.timefreq.uniform import UniformSignal
    from gearsig.timefreq.wavelets import Morse

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
        from gearsig.timefreq.wavelets import Morse

        if self.transform not in OF_WAVELETS:
            return Morse()
        return Morse(beta=float(round((np.pi * self.length) ** 2 / 3.0)))  # √(3β)/π periods


@dataclass(frozen=True)
class MapChoice:
    """What the user chose: the stretch, its signal over time or angle, the settings, the colours' span in dB."""

    stretch: Stretch
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
    from gearsig.timefreq.squeezed_stft import squeezed_stft_map
    from gearsig.timefreq.stft import stft_map

    transform = squeezed_stft_map if settings.is_squeezed else stft_map
    low, high = settings.limits
    return transform(
        _signal, window_length=settings.length, lowest=low or None, highest=high, reduction=settings.reduction
    )


def _wavelet_map(signal: UniformSignal, settings: MapSettings) -> TimeFrequencyMap:
    from gearsig.timefreq.cwt import cwt_map
    from gearsig.timefreq.lines import lowest_possible
    from gearsig.timefreq.squeezed_cwt import squeezed_cwt_map

    wavelet = settings.wavelet()
    transform = squeezed_cwt_map if settings.is_squeezed else cwt_map
    low = max(settings.limits[0], lowest_possible(signal, wavelet))
    return transform(signal, wavelet=wavelet, lowest=low, highest=settings.limits[1], reduction=settings.reduction)


def _key(view: str, name: str, analysis: Analysis) -> str:
    return state.view_key(f"{view} {name}", analysis)
