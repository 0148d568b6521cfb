"""Spectra over frequency, order or quefrency."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import isfinite
from string import ascii_uppercase
from typing import TYPE_CHECKING

import numpy as np

from gearsig.angle import ShaftAngle
from gearsig.checks import FloatArray, one_of
from gearsig.diagnosis import OrderLevel
from gearsig.errors import InputError
from gearsig.indicators import Indicator
from gearsig.plot import _series as series
from gearsig.plot import _style as style
from gearsig.plot._cursors import ROW_IN, Cursor, draw, n_rows, place
from gearsig.plot._series import N_POINTS, envelope, thin
from gearsig.plot._style import Scale, above_zero, decibels, plain, unit_text, with_unit
from gearsig.recording import Recording
from gearsig.spectra import Spectrum

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


LEFT_IN, RIGHT_IN, BOTTOM_IN = 0.85, 0.2, 0.55
TITLE_IN = 0.36
SPECTRUM_POINTS = N_POINTS // 2


def spectrum_figure(
    spectrum: Spectrum,
    cursors: Sequence[Cursor] = (),
    *,
    scale: Scale = "log",
    floor: FloatArray | None = None,
    limits: tuple[float, float] | None = None,
    marked: Sequence[float] = (),
    title: str = "",
    panel_height_in: float = 2.1,
) -> Figure:
    """Draw a spectrum with the lines that the machine's kinematics explain.

    Parameters
    ----------
    spectrum : Spectrum
    cursors : sequence of Cursor
        In the spectrum's axis, see `order_cursors`.
    scale : str
        "log", "decibel" (re one unit) or "linear".
    floor : array, (n_lines,), or None
        Drawn grey below the spectrum, in its unit.
    limits : (float, float) or None
        Of the axis; None: all of it.
    marked : sequence of float
        Positions of findings, drawn in the colour of faults.
    title : str
        Empty: the spectrum's source.

    Returns
    -------
    Figure
        Where there are more lines than pixels, the line joins the peaks, and a pale band reaches down to the lowest
        value in each pixel.

    Raises
    ------
    InputError
        If the floor's length is not the spectrum's, or the limits are not ascending.
    """
    one_of(scale, "scale", ("log", "decibel", "linear"))
    if floor is not None and len(floor) != len(spectrum.values):
        raise InputError(f"floor has {len(floor)} values, the spectrum {len(spectrum.values)}")
    low, high = limits if limits is not None else _whole(spectrum)
    if not low < high:
        raise InputError(f"limits are {low:g} to {high:g}", allowed="ascending")
    width = style.WIDTH_IN - LEFT_IN - RIGHT_IN
    placed = place(cursors, (low, high), width)
    labels_in = ROW_IN * n_rows(placed)
    top = TITLE_IN + labels_in
    figure = style.new_figure(BOTTOM_IN + panel_height_in + top)
    axes = style.panel(figure, left_in=LEFT_IN, right_in=RIGHT_IN, bottom_in=BOTTOM_IN, top_in=top)
    _draw_lines(axes, spectrum, floor, (low, high), scale, marked)
    draw(axes, placed, (width, panel_height_in))
    style.label_axes(axes, spectrum.axis_label, _value_label(spectrum, scale))
    _title(axes, title or spectrum.source, (0.1 + labels_in) / panel_height_in)
    return figure


def _draw_lines(
    axes: Axes,
    spectrum: Spectrum,
    floor: FloatArray | None,
    limits: tuple[float, float],
    scale: Scale,
    marked: Sequence[float],
) -> None:
    start, stop = spectrum.index_of(limits[0]), spectrum.index_of(limits[1]) + 1
    x, y = spectrum.positions[start:stop], spectrum.values[start:stop]
    # The zero line is an offset of the sensor, or the mean of an envelope, not vibration; with the window's leakage
    # around it, it must not squeeze the rest on the axis.
    n_zero = 1 + int(2 * spectrum.noise_bandwidth / spectrum.resolution) if spectrum.resolution > 0 else 1
    shown = y[n_zero:] if start == 0 and len(y) > 2 * n_zero else y
    logarithmic = scale == "log" and bool(np.any(shown > 0))

    def displayed(values: FloatArray) -> FloatArray:
        if scale == "decibel":
            return decibels(values, spectrum.scaling)
        return above_zero(values) if logarithmic else values

    if floor is not None:
        axes.plot(*thin(x, displayed(floor[start:stop]), SPECTRUM_POINTS), color=style.FLOOR, linewidth=1.2, zorder=2.5)
    at, low, high = envelope(x, displayed(y), SPECTRUM_POINTS // 2)
    if len(at) < len(x):
        axes.fill_between(at, low, high, color=style.MEASURED, alpha=0.22, linewidth=0, zorder=1.8)
    axes.plot(at, high, color=style.MEASURED, linewidth=0.9, zorder=2)
    for position in marked:
        if limits[0] <= position <= limits[1]:
            value = displayed(spectrum.values)[spectrum.index_of(position)]
            looks = {"marker": "o", "markersize": 9, "markeredgewidth": 1.8, "fillstyle": "none"}
            axes.plot([position], [value], color=style.FAULT, zorder=3, **looks)  # type: ignore[arg-type]
    axes.set_xlim(*limits)
    if logarithmic:
        axes.set_yscale("log")
    axes.set_ylim(*_value_limits(displayed(shown), "linear" if scale == "log" and not logarithmic else scale))
    if not logarithmic:
        style.no_offset(axes)


def _value_limits(values: FloatArray, scale: Scale) -> tuple[float, float]:
    """Return limits that show the peaks and the floor, without the bottomless notches between the lines."""
    high = float(values.max())
    if scale == "linear":
        low = min(float(values.min()), 0.0)
        return low, high + 0.05 * (high - low) if high > low else low + 1.0
    low = float(np.percentile(values, 5))
    if scale == "log":
        return max(low, high * 1e-8) / 2.0, high * 2.0
    return max(low, high - 160.0) - 6.0, high + 6.0


def _value_label(spectrum: Spectrum, scale: Scale) -> str:
    name = "" if spectrum.scaling == "dimensionless" else spectrum.scaling
    if scale == "decibel":
        return f"{name or 'value'} (dB re 1 {unit_text(spectrum.unit)})".replace("1 )", "1)")
    return with_unit(name or "value", spectrum.unit)


def _title(axes: Axes, title: str, above: float) -> None:
    axes.text(
        0.0,
        1.0 + above,
        plain(title, 110),
        transform=axes.transAxes,
        ha="left",
        va="bottom",
        fontsize=style.TEXT_PT,
        fontweight="bold",
        color=style.INK,
        parse_math=False,
    )


def _whole(spectrum: Spectrum) -> tuple[float, float]:
    low, high = float(spectrum.positions[0]), float(spectrum.positions[-1])
    return low, high if high > low else low + (spectrum.resolution or 1.0)


# --------------------
# Signals over time.
# --------------------


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


# --------------------
# Shaft speed over time.
# --------------------


METHODS = {
    "constant": "stated as constant",
    "pulses": "from tachometer pulses",
    "encoder": "from the encoder",
    "speed channel": "from a speed channel",
    "tachless": "found in the vibration, no tachometer",
}
LEAST_SPAN = 0.002
"""The speed axis spans at least this share of the mean: rounding at constant speed must not look like a fluctuation."""


def speed_figure(shaft_angle: ShaftAngle) -> Figure:
    """Draw the speed of a shaft over time, with how it was found.

    Parameters
    ----------
    shaft_angle : ShaftAngle

    Returns
    -------
    Figure
    """
    figure = style.new_figure(2.3)
    axes = style.panel(figure)
    time, speed = thin(shaft_angle.time_s, 60.0 * shaft_angle.speed_rev_per_s)
    axes.plot(time, speed, color=style.MEASURED, linewidth=1.2)
    low, high = float(speed.min()), float(speed.max())
    least = LEAST_SPAN * max(abs(shaft_angle.mean_speed_rpm), 1.0)
    margin = max(0.06 * (high - low), (least - (high - low)) / 2)
    axes.set_ylim(low - margin, high + margin)
    axes.set_xlim(shaft_angle.start_s, shaft_angle.end_s)
    name = f"speed of {shaft_angle.shaft}" if shaft_angle.shaft else "shaft speed"
    style.label_axes(axes, "time (s)", "speed (rpm)", name)
    uncertainty = shaft_angle.relative_speed_uncertainty
    known = f", mean ± {100 * uncertainty:.2g} %" if isfinite(uncertainty) else ""
    style.note(axes, METHODS[shaft_angle.method] + known)
    style.no_offset(axes)
    return figure


# --------------------
# Levels of orders over speed: a run-up or run-down, order by order.
# --------------------


DECADES = 3.5
"""Below the largest level at most: what lies deeper is noise."""


def order_levels_figure(
    levels: Sequence[OrderLevel], *, resonances_hz: Sequence[float] = (), title: str = "", height_in: float = 4.0
) -> Figure:
    """Draw amplitudes of orders over speed, the largest of each marked.

    Parameters
    ----------
    levels : sequence of OrderLevel
        1 to 8, of one channel.
    resonances_hz : sequence of float
        Each order is marked where it crosses them.
        By letters, which the title names.
    title : str
    height_in : float

    Returns
    -------
    Figure

    Raises
    ------
    InputError
        Without levels, or with more than a figure can tell apart.
    """
    if not 1 <= len(levels) <= series.MOST_CURVES:
        raise InputError(f"{len(levels)} levels", allowed=f"1 to {series.MOST_CURVES}")
    figure = style.new_figure(height_in)
    axes = style.panel(figure, top_in=0.85 if resonances_hz else 0.65)
    lines = []
    for level, colour in zip(levels, series.series_colours(len(levels)), strict=True):
        lines += axes.plot(level.speed_rpm, level.amplitude, color=colour, linewidth=1.2, label=level.name)
        amplitude, rpm, _ = level.largest
        axes.plot([rpm], [amplitude], "o", color=colour, markersize=5, zorder=4)
    _scale(axes, levels)
    for letter, hertz in zip(ascii_uppercase, resonances_hz, strict=False):
        _mark_crossings(axes, levels, hertz, letter)
    unit = f" ({unit_text(levels[0].unit)})" if levels[0].unit else ""
    style.label_axes(axes, "speed (rpm)", f"amplitude{unit}")
    style.no_offset(axes)
    series.legend_row(figure, lines, left_in=0.85, top_in=series.NAMES_AT_IN)
    named = [f"{letter} {hertz:.4g} Hz" for letter, hertz in zip(ascii_uppercase, resonances_hz, strict=False)]
    series.headline(figure, f"{title}; resonances: {', '.join(named)}" if named else title)
    return figure


def _scale(axes: Axes, levels: Sequence[OrderLevel]) -> None:
    top = max(float(level.amplitude.max()) for level in levels) or 1.0
    bottom = min(float(level.amplitude.min()) for level in levels)
    axes.set_yscale("log")
    axes.set_ylim(max(bottom / 1.5, top / 10**DECADES), 2.0 * top)
    axes.set_xlim(min(float(x.speed_rpm[0]) for x in levels), max(float(x.speed_rpm[-1]) for x in levels))


def _mark_crossings(axes: Axes, levels: Sequence[OrderLevel], hertz: float, letter: str) -> None:
    """Mark where each order passes a frequency, by its letter."""
    crossed = []
    for level in levels:
        rpm = 60.0 * hertz / level.order
        if level.speed_rpm[0] < rpm < level.speed_rpm[-1]:
            crossed.append((rpm, float(np.interp(rpm, level.speed_rpm, level.amplitude))))
    for rpm, amplitude in crossed:
        axes.plot([rpm, rpm], [axes.get_ylim()[0], amplitude], color=style.FAULT, linewidth=0.8, linestyle=":")
        axes.plot([rpm], [amplitude], "v", color=style.FAULT, markersize=6, zorder=5)
        series.write(axes, rpm, 1.02, letter, colour=style.FAULT)


# --------------------
# Indicators of several recordings side by side.
# --------------------


N_COLUMNS = 3
TREND_ROW_IN = 0.22
NAMES_IN = 2.3
GAP_IN = 0.4


def trend_figure(
    recordings: Mapping[str, Sequence[Indicator]],
    *,
    names: Sequence[str] = (),
    highlighted: Sequence[str] = (),
    most: int = 6,
) -> Figure:
    """Draw one panel of dots per indicator, one row per recording.

    Where an indicator has several values in a recording (channels, gears), each is a dot.

    Parameters
    ----------
    recordings : mapping
        Name of the recording → its indicators. Undefined (nan) values are left out.
    names : sequence of str
        Indicators to draw; empty: the first `most` that occur. One without any value gets no panel.
    highlighted : sequence of str
        Recordings drawn in the colour of faults.

    Returns
    -------
    Figure
    """
    defined = dict.fromkeys(i.name for items in recordings.values() for i in items if isfinite(i.value))
    wanted = [name for name in names or defined if name in defined][:most]
    n_columns = max(1, min(N_COLUMNS, len(wanted)))
    n_rows = max(1, -(-len(wanted) // n_columns))
    panel_in = TREND_ROW_IN * max(len(recordings), 1) + 0.1
    height = n_rows * (panel_in + 0.75) + 0.05
    figure = style.new_figure(height)
    width_in = (style.WIDTH_IN - NAMES_IN - 0.2 - GAP_IN * (n_columns - 1)) / n_columns
    for number, name in enumerate(wanted):
        row, column = divmod(number, n_columns)
        left = NAMES_IN + column * (width_in + GAP_IN)
        bottom = height - (row + 1) * (panel_in + 0.75) + 0.4
        axes = style.panel(
            figure,
            left_in=left,
            right_in=style.WIDTH_IN - left - width_in,
            bottom_in=bottom,
            top_in=height - bottom - panel_in,
        )
        _draw(axes, recordings, name, highlighted, with_names=column == 0)
    return figure


def _draw(
    axes: Axes,
    recordings: Mapping[str, Sequence[Indicator]],
    name: str,
    highlighted: Sequence[str],
    *,
    with_names: bool,
) -> None:
    units = set()
    for row, (recording, indicators) in enumerate(recordings.items()):
        chosen = [i for i in indicators if i.name == name and isfinite(i.value)]
        units |= {i.unit for i in chosen}
        colour = style.FAULT if recording in highlighted else style.MEASURED
        axes.plot([i.value for i in chosen], [row] * len(chosen), "o", color=colour, markersize=5, alpha=0.75)
    axes.set_ylim(len(recordings) - 0.5, -0.5)
    labels = [plain(recording, 30) for recording in recordings] if with_names else [""] * len(recordings)
    axes.set_yticks(range(len(recordings)), labels, parse_math=False)
    axes.tick_params(axis="y", length=0)
    axes.spines["left"].set_visible(False)
    unit = f" ({unit_text(units.pop())})" if len(units) == 1 and "" not in units else ""
    style.label_axes(axes, title=f"{name}{unit}")
    axes.locator_params(axis="x", nbins=4)
    style.no_offset(axes)
