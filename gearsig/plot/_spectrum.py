"""Signals, speed and modes over time, and spectra over frequency, order or quefrency."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import isfinite
from typing import TYPE_CHECKING, get_args

import numpy as np

from gearsig.angle import ShaftAngle
from gearsig.checks import FloatArray, one_of
from gearsig.decompose import Modes, mode_spectra
from gearsig.errors import InputError
from gearsig.formatting import axis_unit, unit_text
from gearsig.plot import _style as style
from gearsig.plot._cursors import ROW_IN, Cursor, draw, n_rows, place
from gearsig.plot._panels import UNDER_A_LINE, ChartLine, LinePanel, panels_figure
from gearsig.plot._style import N_POINTS, Scale, above_zero, decibel_text, decibels, envelope, plain, thin, with_unit
from gearsig.recording import Recording
from gearsig.spectra import Scaling, Spectrum

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def spectrum_figure(
    spectrum: Spectrum,
    cursors: Sequence[Cursor] = (),
    *,
    scale: Scale = "log",
    floor: FloatArray | None = None,
    limits: tuple[float, float] | None = None,
    marked: Sequence[float] = (),
    title: str = "",
) -> Figure:
    """Draw a spectrum with the lines that the machine's kinematics explain.

    Parameters
    ----------
    spectrum : Spectrum
    cursors : sequence of Cursor
        On the spectrum's axis; see `order_cursors`.
    scale : str
        "log", "decibel" (re one unit) or "linear".
    floor : array, (n_lines,), or None
        Drawn in grey below the spectrum, in its unit.
    limits : (float, float) or None
        Of the axis; None: all of it.
    marked : sequence of float
        Positions of findings, drawn in the fault colour.
    title : str
        Empty: the spectrum's source.

    Returns
    -------
    Figure
        If there are more lines than pixels, the curve joins the peaks, and a pale band reaches down to the minimum in
        each pixel.

    Raises
    ------
    InputError
        If the floor's length differs from the spectrum's, or the limits do not ascend.
    """
    one_of(scale, "scale", get_args(Scale))
    if floor is not None and len(floor) != len(spectrum.values):
        raise InputError(f"floor has {len(floor)} values, the spectrum {len(spectrum.values)}")
    low, high = limits or (float(spectrum.positions[0]), float(spectrum.positions[-1]))
    if limits is None and not low < high:  # one line
        high = low + (spectrum.resolution or 1.0)
    if not low < high:
        raise InputError(f"limits are {low:g} to {high:g}", allowed="ascending")
    placed = place(cursors, (low, high), style.WIDTH_IN - 0.85 - 0.2)
    figure, (axes,) = style.panels((2.1,), top_in=0.36 + ROW_IN * n_rows(placed))
    _draw_lines(axes, spectrum, floor, (low, high), scale, marked)
    draw(axes, placed)
    style.label_axes(axes, spectrum.axis_label, _value_label(spectrum, scale))
    style.head(figure, title or spectrum.source)
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
    # The line at zero is the sensor's offset, or the mean of an envelope, not vibration; together with its leakage it
    # must not compress the rest of the axis.
    n_zero = 1 + int(2 * spectrum.noise_bandwidth / spectrum.resolution) if spectrum.resolution > 0 else 1
    shown = y[n_zero:] if start == 0 and len(y) > 2 * n_zero else y
    logarithmic = scale == "log" and bool(np.any(shown > 0))

    drawn_as: Scale = "linear" if scale == "log" and not logarithmic else scale

    def displayed(values: FloatArray) -> FloatArray:
        return displayed_values(values, spectrum.scaling, drawn_as, spectrum.unit)

    if floor is not None:
        axes.plot(*thin(x, displayed(floor[start:stop]), N_POINTS // 2), color=style.FLOOR, linewidth=1.2, zorder=2.5)
    at, low, high = envelope(x, displayed(y), N_POINTS // 4)
    if len(at) < len(x):
        colour, name = style.MEASURED, UNDER_A_LINE
        axes.fill_between(at, low, high, color=colour, alpha=0.22, linewidth=0, zorder=1.8, label=name)
    axes.plot(at, high, color=style.MEASURED, linewidth=0.9, zorder=2)
    for position in marked:
        if limits[0] <= position <= limits[1]:
            value = displayed(spectrum.values)[spectrum.index_of(position)]
            axes.plot(
                [position],
                [value],
                "o",
                color=style.FAULT,
                markersize=9,
                markeredgewidth=1.8,
                fillstyle="none",
                zorder=3,
            )
    axes.set_xlim(*limits)
    if logarithmic:
        axes.set_yscale("log")
    axes.set_ylim(*value_limits(displayed(shown), drawn_as))
    if not logarithmic:
        style.no_offset(axes)


def displayed_values(values: FloatArray, scaling: Scaling, scale: Scale, unit: str) -> FloatArray:
    """Return values as a scale draws them: in decibels, limited to positive ones, or unchanged."""
    if scale == "decibel":
        return decibels(values, scaling, unit)
    return above_zero(values) if scale == "log" else values


def value_limits(values: FloatArray, scale: Scale) -> tuple[float, float]:
    """Return limits that show the peaks and the floor, but not the deep notches between the lines."""
    high = float(values.max())
    if scale == "linear":
        low = min(float(values.min()), 0.0)
        return 0.0, high + 0.05 * (high - low) if high > low else low + 1.0
    low = float(np.percentile(values, 5))
    if scale == "log":
        return max(low, high * 1e-8) / 2.0, high * 2.0
    return max(low, high - 160.0) - 6.0, high + 6.0


def _value_label(spectrum: Spectrum, scale: Scale) -> str:
    name = "" if spectrum.scaling == "dimensionless" else spectrum.scaling
    if scale == "decibel":
        return f"{style.level_name(name, spectrum.unit) or 'value'} ({decibel_text(spectrum.unit)})"
    return with_unit(name or "value", spectrum.unit)


def time_figure(
    recording: Recording, channels: Sequence[str] = (), *, limits_s: tuple[float, float] | None = None
) -> Figure:
    """Draw channels in rows over a common time axis; thinning keeps extremes.

    Parameters
    ----------
    recording : Recording
    channels : sequence of str
        Names; empty: all.
    limits_s : pair of float or None
        First and last time; None: the whole recording.

    Returns
    -------
    Figure
    """
    names = tuple(channels) or recording.channel_names
    rate = recording.sampling_rate_hz
    low, high = limits_s if limits_s is not None else (0.0, recording.duration_s)
    start = int(np.clip(np.floor(low * rate), 0, recording.n_samples - 1))
    stop = int(np.clip(np.ceil(high * rate) + 1, start + 1, recording.n_samples))
    time = np.arange(start, stop) / rate
    figure, panels = style.panels((1.02,) * len(names), top_in=0.33, row_gap_in=0.33, share_x=True)
    for axes, name in zip(panels, names, strict=True):
        channel = recording.channels[recording.index(name)]
        axes.plot(*thin(time, recording.values(name)[start:stop]), color=style.MEASURED, linewidth=0.6)
        quantity = "" if channel.quantity == "unknown" else ": " + channel.quantity.replace("_", " ")
        x = "time (s)" if axes is panels[-1] else ""
        style.label_axes(axes, x, unit_text(channel.unit), f"{plain(name)}{quantity}")
        style.no_offset(axes)
    panels[0].set_xlim(float(time[0]), float(max(time[-1], time[0] + 1 / rate)))
    return figure


METHODS = {
    "constant": "stated as constant",
    "pulses": "from tachometer pulses",
    "encoder": "from the encoder",
    "speed channel": "from a speed channel",
    "tachless": "found in the vibration, no tachometer",
}
MIN_SPEED_SPAN = 0.002
"""Minimum span of the speed axis relative to the mean: rounding at constant speed must not look like fluctuation."""


def speed_panel(shaft_angle: ShaftAngle) -> LinePanel:
    """Return the panel of a shaft's speed over time.

    Parameters
    ----------
    shaft_angle : ShaftAngle
    """
    low, high = shaft_angle.speed_range_rpm
    min_span = MIN_SPEED_SPAN * max(abs(shaft_angle.mean_speed_rpm), 1.0)
    margin = max(0.06 * (high - low), (min_span - (high - low)) / 2)
    line = ChartLine(shaft_angle.time_s, 60.0 * shaft_angle.speed_rev_per_s, "speed")
    limits = (low - margin, high + margin)
    return LinePanel([line], "time (s)", "speed (rpm)", limits, x_limits=(shaft_angle.start_s, shaft_angle.end_s))


def speed_figure(shaft_angle: ShaftAngle) -> Figure:
    """Draw the speed of a shaft over time, and say how it was found.

    Parameters
    ----------
    shaft_angle : ShaftAngle

    Returns
    -------
    Figure
    """
    name = f"speed of {shaft_angle.shaft}" if shaft_angle.shaft else "shaft speed"
    figure = panels_figure([replace(speed_panel(shaft_angle), title=name)], height_in=1.4)
    (axes,) = figure.axes
    uncertainty = shaft_angle.relative_speed_uncertainty
    known = f", mean ± {100 * uncertainty:.2g} %" if isfinite(uncertainty) else ""
    style.note(axes, METHODS[shaft_angle.method] + known)
    style.no_offset(axes)
    return figure


# --------------------
# Modes of a signal: waveform and spectrum of each, in order of centre frequency, then the residual.
# --------------------


def modes_figure(
    modes: Modes, *, limits: tuple[float, float] | None = None, spectrum_limits: tuple[float, float] | None = None
) -> Figure:
    """Draw each mode's waveform and amplitude spectrum in one row, and the residual in the last.

    Parameters
    ----------
    modes : Modes
        At most 12.
    limits : (float, float) or None
        Of the waveforms, in s or revolutions; None: all.
    spectrum_limits : (float, float) or None
        Of the spectra, in Hz or orders; None: all.

    Returns
    -------
    Figure
        All spectra share one logarithmic axis for comparison; each waveform has a separate axis. In each spectrum, a
        line marks the centre and a band the RMS width on each side.

    Raises
    ------
    InputError
        If there are too many modes, or the limits do not ascend or contain fewer than two samples.
    """
    if modes.n_modes > 12:
        raise InputError(f"there are {modes.n_modes} modes", allowed="up to 12 in a figure")
    spectra = mode_spectra(modes)
    rate = modes.sampling_rate
    shown = _limits_within(limits, float(modes.positions[-1]), 2.0 / rate, "limits")
    lines = _limits_within(spectrum_limits, rate / 2, 2.0 * spectra[0].resolution, "spectrum_limits")
    within = slice(max(0, int(np.floor(shown[0] * rate))), int(np.ceil(shown[1] * rate)) + 1)
    highest = max(float(above_zero(s.values[1:]).max()) for s in spectra)
    lowest = 1e-5 * highest  # lower limit of the axis that all spectra share
    rows = [*modes.by_centre(), modes.n_modes]
    figure, panels = style.panels(
        (0.82,) * len(rows), (0.55, 0.45), top_in=0.45, row_gap_in=0.33, column_gap_in=0.75, share_x=True
    )
    for i, k in enumerate(rows):
        waveform, axes = panels[2 * i : 2 * i + 2]
        is_mode = k < modes.n_modes
        colour = style.MEASURED if is_mode else style.FLOOR
        values = modes.waveforms[k] if is_mode else modes.residual
        waveform.plot(*thin(modes.positions[within], values[within], 1600), color=colour, linewidth=0.6)
        style.no_offset(waveform)
        spectrum = spectra[k]
        start, stop = spectrum.index_of(lines[0]), spectrum.index_of(lines[1]) + 1
        at, _, high = envelope(spectrum.positions[start:stop], np.maximum(spectrum.values[start:stop], lowest), 800)
        axes.plot(at, high, color=colour, linewidth=0.8)
        axes.set_yscale("log")
        axes.set_ylim(lowest, 3.0 * highest)
        if is_mode:
            centre, width = float(modes.centres[k]), float(modes.bandwidths[k])
            axes.axvspan(centre - width, centre + width, color=style.FAULT, alpha=0.15, linewidth=0, zorder=1.2)
            axes.axvline(centre, color=style.FAULT, linewidth=0.9, linestyle="--", zorder=1.5)
        style.label_axes(waveform, "", unit_text(modes.unit), _mode_title(modes, k))
    over = "time (s)" if modes.axis == "frequency" else f"angle of {modes.shaft or 'the shaft'} (revolutions)"
    style.label_axes(panels[-2], over, panels[-2].get_ylabel())
    style.label_axes(panels[-1], spectra[0].axis_label)
    panels[0].set_xlim(*shown)
    panels[1].set_xlim(*lines)
    style.note(panels[1], with_unit("amplitude peak", modes.unit))
    return figure


def _mode_title(modes: Modes, k: int) -> str:
    if k == modes.n_modes:
        return f"residual, {100 * modes.reconstruction_error:.2g} % of the rms"
    middle, width = _digits(modes.centres[k], 4), _digits(modes.bandwidths[k], 2)
    where = f"order {middle} ± {width}" if modes.axis == "order" else f"{middle} ± {width} {axis_unit(modes.axis)}"
    text = f"mode {k + 1}: {where}"
    return f"{text}, {plain(modes.source, 40)}" if modes.source else text


def _digits(value: float, n: int) -> str:
    """Format a number with `n` significant digits and no exponent."""
    return np.format_float_positional(value, precision=n, unique=False, fractional=False, trim="-")


def _limits_within(limits: tuple[float, float] | None, high: float, min_span: float, name: str) -> tuple[float, float]:
    """Return limits within the axis, at least wide enough for two points."""
    if limits is None:
        return 0.0, high
    cut = max(0.0, float(limits[0])), min(high, float(limits[1]))
    if not cut[1] - cut[0] >= min_span:
        raise InputError(
            f"{name} is {limits[0]:g} to {limits[1]:g}",
            allowed=f"ascending, between 0 and {high:g}, {min_span:g} apart",
        )
    return cut
