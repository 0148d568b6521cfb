"""Signals over time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from gearsig.checks import FloatArray
from gearsig.plot import style
from gearsig.plot.display import plain, unit_text
from gearsig.plot.thin import N_POINTS, thin
from gearsig.recording.types import Recording

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

PANEL_IN = 1.35
MARGINS_IN = 0.55


def time_figure(
    recording: Recording,
    channels: Sequence[str] = (),
    *,
    limits_s: tuple[float, float] | None = None,
    n_points: int = N_POINTS,
) -> Figure:
    """Draw channels one below the other over a common time axis, extremes kept.

    Parameters
    ----------
    recording : Recording
    channels : sequence of str
        Names; empty: all.
    limits_s : pair of float or None
        First and last time; None: the whole recording.
    n_points : int
        Points per line, see `thin`.

    Returns
    -------
    Figure
    """
    names = tuple(channels) or recording.channel_names
    height = MARGINS_IN + PANEL_IN * len(names)
    figure = style.new_figure(height)
    first: Axes | None = None
    for i, name in enumerate(names):
        bottom = 0.55 + PANEL_IN * (len(names) - 1 - i)
        axes = style.panel(figure, bottom_in=bottom, top_in=height - bottom - PANEL_IN + 0.33, sharex=first)
        first = first or axes
        channel = recording.channels[recording.index(name)]
        time, values = _stretch(recording, name, limits_s)
        axes.plot(*thin(time, values, n_points), color=style.MEASURED, linewidth=0.6)
        last = i == len(names) - 1
        axes.tick_params(labelbottom=last)
        quantity = "" if channel.quantity == "unknown" else ": " + channel.quantity.replace("_", " ")
        style.label_axes(axes, "time (s)" if last else "", unit_text(channel.unit), f"{plain(name)}{quantity}")
        style.no_offset(axes)
        axes.set_xlim(*_limits(time, recording.sampling_rate_hz))
    return figure


def _stretch(recording: Recording, name: str, limits_s: tuple[float, float] | None) -> tuple[FloatArray, FloatArray]:
    rate, values = recording.sampling_rate_hz, recording.values(name)
    low, high = limits_s if limits_s is not None else (0.0, recording.duration_s)
    start = int(np.clip(np.floor(low * rate), 0, len(values) - 1))
    stop = int(np.clip(np.ceil(high * rate) + 1, start + 1, len(values)))
    return np.arange(start, stop) / rate, values[start:stop]


def _limits(time: FloatArray, rate_hz: float) -> tuple[float, float]:
    """Return the ends of the time axis, a sample apart at least."""
    return float(time[0]), float(max(time[-1], time[0] + 1 / rate_hz))
