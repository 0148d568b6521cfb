"""Spectra over frequency, order or quefrency."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from gearsig.checks import FloatArray, one_of
from gearsig.errors import InputError
from gearsig.plot import style
from gearsig.plot.cursors import ROW_IN, Cursor, draw, n_rows, place
from gearsig.plot.display import Scale, above_zero, decibels, plain, unit_text, with_unit
from gearsig.plot.thin import N_POINTS, envelope, thin
from gearsig.spectra.types import Spectrum

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
