"""The chain of one analysis as a strip of small pictures, drawn of the recording that is open."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Sequence
from io import BytesIO

import numpy as np
import streamlit as st

from app.dashboard import address, state
from app.dashboard.components import component_of
from app.dashboard.theme import is_dark
from gearsig.checks import FloatArray
from gearsig.diagnosis import Analysis, CannotTell, ChannelAnalysis
from gearsig.plot import level_colours
from gearsig.report import highest_order_of_interest, verdict_picture
from gearsig.spectra import Spectrum

_strip = component_of("strip")
WIDTH, HEIGHT, N = 100.0, 44.0, 120
N_LOOKED_AT = 1 << 16
"""Samples that are enough for a small picture."""
ICONS = {
    "Machine": "M10 13H90M10 31H90M38 6V20M48 6V20M38 6H48M38 20H48M38 20V42H48V20M70 9V17M74 9V17M20 27V35M24 27V35",
    "Indicators": "M8 8H92M8 18H70M8 28H84M8 38H52",
    "Report": "M34 3H58L68 13V41H34ZM58 3V13H68M40 20H62M40 27H62M40 34H54",
}
FIRST_OF = {"tooth": "Average", "bearing": "Envelope", "resonance": "Map", "motion": "Starts and stops"}
"""View that is open at first, by what the verdict is about."""


def choose_view(analysis: Analysis, names: Sequence[str]) -> str:
    """Return the view that the user chose; it is in the address, too."""
    picture = verdict_picture(analysis)
    first = FIRST_OF.get(picture.about if picture is not None else "", "Order spectrum")
    if analysis.motion is not None:
        first = FIRST_OF["motion"]
    elif isinstance(analysis.shaft_angle, CannotTell):
        # The form asks for the speed, of a machine that is described too.
        first = "Machine" if analysis.rig is None or not analysis.rig.shafts else "Spectrum"
    chosen = address.chosen(state.TAB, "view", names, first if first in names else names[0])
    items = _tiles(state.view_key(f"tiles {is_dark()}", analysis), tuple(names), analysis)
    _strip(
        key="strip",
        data={"items": items, "chosen": chosen},
        on_view_change=_take_view,
    )
    return chosen


def _take_view() -> None:
    st.session_state[state.TAB] = st.session_state["strip"]["view"]


@st.cache_data(max_entries=16, show_spinner=False)
def _tiles(key: str, names: tuple[str, ...], _analysis: Analysis) -> list[dict[str, object]]:
    del key  # it stands for the analysis
    channel = next(iter(_analysis.channels), None)
    return [{"name": name, **_tile(name, _analysis, channel)} for name in names]


def _tile(name: str, analysis: Analysis, channel: ChannelAnalysis | None) -> dict[str, object]:
    if name in ICONS or channel is None:
        return {"path": ICONS.get(name, "")}
    if name == "Speed":
        angle = analysis.shaft_angle
        return {"path": "" if isinstance(angle, CannotTell) else _line(angle.speed_rev_per_s, least=0.02)}
    if name in ("Spectrum", "Order spectrum", "Envelope"):
        return {"path": _spectrum(name, analysis, channel), "fill": True}
    values = np.asarray(analysis.recording.values(channel.channel)[:N_LOOKED_AT], dtype=np.float64)
    if name in ("Map", "Time–frequency"):
        short = name == "Time–frequency"
        return {"picture": _map(channel, values[: N_LOOKED_AT // 8] if short else values, over_orders=not short)}
    draw = {"Average": _ring(channel), "Modes": _modes(values[: 4 * N]), "Phase": _phase(values[:2048])}
    return {"path": draw[name]} if name in draw else {"path": _waveform(values), "fill": True}


def _points(x: FloatArray, y: FloatArray) -> str:
    return "M" + "L".join(f"{a:.1f} {b:.1f}" for a, b in zip(x, y, strict=True))


def _scaled(values: FloatArray, *, least: float = 0.0) -> FloatArray:
    """Return heights of values in the picture; a span below `least` of their mean is not blown up."""
    low, high = float(np.min(values)), float(np.max(values))
    half = max((high - low) / 2, least * abs(low + high) / 2) or 1.0
    return HEIGHT / 2 - (values - (low + high) / 2) / half * (HEIGHT / 2 - 3)


def _line(values: FloatArray, *, least: float = 0.0) -> str:
    chosen = values[np.linspace(0, len(values) - 1, N).astype(int)]
    return _points(np.linspace(0, WIDTH, N), _scaled(chosen, least=least))


def _columns(values: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the lowest and the highest value of each column."""
    starts = np.linspace(0, len(values), min(N, len(values)) + 1).astype(int)[:-1]
    return np.minimum.reduceat(values, starts), np.maximum.reduceat(values, starts)


def _waveform(values: FloatArray) -> str:
    low, high = _columns(values)
    both = _scaled(np.concatenate([high, low[::-1]]))
    x = np.linspace(0, WIDTH, len(low))
    return _points(np.concatenate([x, x[::-1]]), both) + "Z"


def _spectrum(name: str, analysis: Analysis, channel: ChannelAnalysis) -> str:
    spectrum: Spectrum | None = {
        "Spectrum": channel.spectrum,
        "Order spectrum": channel.order_spectrum,
        "Envelope": channel.envelope_spectrum,
    }[name]
    if spectrum is None:
        return ""
    stop = len(spectrum.values)
    if name == "Order spectrum":
        stop = spectrum.index_of(highest_order_of_interest(analysis, spectrum)) + 1
    values = spectrum.values[min(3, stop - 1) : stop]
    _, high = _columns(values)
    if name != "Envelope":
        high = np.log(np.maximum(high, float(high.max()) * 1e-4 or 1.0))
    x = np.linspace(0, WIDTH, len(high))
    return f"M0 {HEIGHT}L" + _points(x, _scaled(high))[1:] + f"L{WIDTH} {HEIGHT}Z"


def _map(channel: ChannelAnalysis, values: FloatArray, *, over_orders: bool) -> str:
    from PIL import Image
    from scipy.signal import stft

    if over_orders and channel.order_map is not None:
        levels = channel.order_map.values[:, : channel.order_map.values.shape[1] // 3]
    else:
        n = 256 if not over_orders else 1024
        levels = np.abs(stft(values, nperseg=min(n, len(values)))[2]).T
        levels = levels[:, : levels.shape[1] // (2 if over_orders else 1)]
    if not over_orders:
        levels = levels.T  # time goes to the right
    for axis, most in ((0, 44), (1, 100)):
        starts = np.linspace(0, levels.shape[axis], min(most, levels.shape[axis]) + 1).astype(int)[:-1]
        levels = np.maximum.reduceat(levels, starts, axis=axis)
    decibels = 20 * np.log10(np.maximum(levels, float(levels.max()) * 1e-3 or 1.0))
    top = np.percentile(decibels, 99)
    shade = np.clip(255 * (decibels - top + 40) / 40, 0, 255).astype(np.uint8)
    buffer = BytesIO()
    Image.fromarray(level_colours(dark=is_dark())[shade[::-1]]).save(buffer, format="png")
    return "data:image/png;base64," + b64encode(buffer.getvalue()).decode("ascii")


def _ring(channel: ChannelAnalysis) -> str:
    averages = sorted(channel.averages.items(), key=lambda entry: entry[0][1] != "residual")
    if not averages:
        return ""
    low, high = _columns(averages[0][1].values)
    chosen = np.where(np.abs(low) > np.abs(high), low, high)
    radius = 14 + 8 * chosen / (float(np.abs(chosen).max()) or 1.0)
    turn = np.linspace(0, 2 * np.pi, len(chosen), endpoint=False)
    return _points(WIDTH / 2 + radius * np.sin(turn), HEIGHT / 2 - radius * np.cos(turn)) + "Z"


def _modes(values: FloatArray) -> str:
    """Three parts of the signal by frequency, of equal energy, below each other."""
    lines = np.fft.rfft(values - values.mean())
    shares = np.cumsum(np.abs(lines) ** 2)
    borders = [0, *np.searchsorted(shares, shares[-1] * np.array([1, 2]) / 3), len(lines)]
    parts = []
    for i in range(3):
        kept = np.zeros_like(lines)
        kept[borders[i] : borders[i + 1] or 1] = lines[borders[i] : borders[i + 1] or 1]
        part = np.fft.irfft(kept, len(values))[: 2 * N]
        y = 8 + 14 * i - 6 * part / (float(np.abs(part).max()) or 1.0)
        parts.append(_points(np.linspace(0, WIDTH, len(y)), y))
    return "".join(parts)


def _phase(values: FloatArray) -> str:
    """Velocity over displacement of the slow part of the signal."""
    lines = np.fft.rfft(values - values.mean())
    lines[max(3, len(lines) // 12) :] = 0
    x = np.fft.irfft(lines, len(values))[:500]
    v = np.gradient(x)
    scale = float(np.abs(x).max()) or 1.0, float(np.abs(v).max()) or 1.0
    return _points(WIDTH / 2 + 40 * x / scale[0], HEIGHT / 2 - 18 * v / scale[1])
