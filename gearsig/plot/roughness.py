"""What rough flanks do: friction over the mesh, and a backlash that changes with time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from gearsig.checks import FloatArray
from gearsig.errors import InputError
from gearsig.plot import series, style
from gearsig.plot.thin import thin

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

MICRO = 1e6


def friction_figure(
    mesh_cycles: FloatArray,
    coefficients: Mapping[str, FloatArray],
    *,
    pitch_point: float | None = None,
    single_pair: tuple[float, float] | None = None,
    heading: str = "",
    title: str = "",
) -> Figure:
    """Draw the friction coefficient of one tooth pair from its entry to its exit.

    Parameters
    ----------
    mesh_cycles : array, (n,)
        Since the pair's entry, ascending.
    coefficients : mapping
        Name of the case → array, (n,). Given with a sign it counts as the direction of sliding: positive in approach,
        negative in recess. NaN: no contact.
    pitch_point : float or None
        Mesh cycles where sliding changes its direction.
    single_pair : (float, float) or None
        Where this pair carries alone; shaded.
    heading, title : str
        As in `mesh_stiffness_figure`.

    Returns
    -------
    Figure
    """
    x = series.checked_axis(mesh_cycles, "mesh_cycles")
    curves = series.checked_curves(coefficients, len(x), "coefficients", gaps=True)
    for label, values in curves.items():
        if np.isnan(values).all():
            raise InputError(f"coefficients[{label!r}] holds no number", remedy="leave the case out")
    figure = style.new_figure(3.4)
    axes = style.panel(figure, top_in=0.82)
    lines = _plot_all(axes, x, curves)
    signed = any(bool((values < 0.0).any()) for values in curves.values())
    if signed:
        axes.axhline(0.0, color=style.QUIET, linewidth=0.7, zorder=1)
    else:
        axes.set_ylim(bottom=0.0)
    axes.set_xlim(float(x[0]), float(x[-1]))
    name = "friction coefficient × direction (–)" if signed else "friction coefficient (–)"
    style.label_axes(axes, "mesh cycles since the pair's entry (tooth passages)", name)
    if single_pair is not None:
        low, high = series.checked_limits(single_pair, "single_pair")
        series.shade(axes, (low, high))
    if pitch_point is not None:
        axes.axvline(pitch_point, color=style.QUIET, linewidth=0.8, linestyle="--", zorder=1)
        series.write(axes, pitch_point, 1.01, "pitch point")
        series.write(axes, (float(x[0]) + pitch_point) / 2, 1.01, "approach")
        series.write(axes, (float(x[-1]) + pitch_point) / 2, 1.01, "recess")
    style.no_offset(axes)
    series.legend_row(figure, lines, left_in=0.85, top_in=series.NAMES_AT_IN, heading=heading)
    series.headline(figure, title)
    return figure


def backlash_figure(
    time_s: FloatArray,
    backlash_m: Mapping[str, FloatArray],
    frequency_hz: FloatArray,
    amplitude_m: Mapping[str, FloatArray],
    *,
    lines_hz: Sequence[float] = (),
    mesh_frequency_hz: float | None = None,
    heading: str = "",
    title: str = "",
) -> Figure:
    """Draw the backlash over time, and below it the spectrum of its change.

    Parameters
    ----------
    time_s : array, (n,)
        Ascending.
    backlash_m : mapping
        Name of the case → b(t) = b₀ + Δb(t), (n,).
    frequency_hz : array, (m,)
        Ascending, above 0: drawn on a logarithmic axis, as the lines of a fractal profile are a constant ratio apart.
    amplitude_m : mapping
        Same names → peak amplitude of each line, (m,); one whose amplitudes are all 0 is left out.
    lines_hz : sequence of float
        Expected lines, marked and numbered with their frequencies.
    mesh_frequency_hz : float or None
    heading, title : str
        As in `mesh_stiffness_figure`.

    Returns
    -------
    Figure
    """
    t = series.checked_axis(time_s, "time_s")
    f = series.checked_axis(frequency_hz, "frequency_hz")
    curves = series.checked_curves(backlash_m, len(t), "backlash_m")
    spectra = series.checked_curves(amplitude_m, len(f), "amplitude_m")
    _check_spectra(f, curves, spectra)
    figure = style.new_figure(5.3)
    upper = style.panel(figure, bottom_in=3.0, top_in=0.7)
    drawn = _plot_all(upper, t, {label: values * MICRO for label, values in curves.items()}, 1.0)
    upper.set_xlim(float(t[0]), float(t[-1]))
    style.label_axes(upper, "time (s)", "half backlash (µm)")
    style.no_offset(upper)
    lower = style.panel(figure, bottom_in=0.55, top_in=5.3 - 0.55 - 1.55)
    _draw_spectra(lower, f, spectra)
    _name_lines(lower, [line for line in lines_hz if f[0] <= line <= f[-1]])
    if mesh_frequency_hz is not None:
        lower.axvline(mesh_frequency_hz, color=style.MESH, linewidth=1.0, zorder=1)
        at = mesh_frequency_hz * 1.02
        series.write(lower, at, 0.9, "mesh", colour=style.MESH, ha="left")
    style.label_axes(lower, "frequency (Hz)", "amplitude (µm peak)")
    series.legend_row(figure, drawn, left_in=0.85, top_in=series.NAMES_AT_IN, heading=heading)
    series.headline(figure, title)
    return figure


def _check_spectra(f: FloatArray, curves: Mapping[str, FloatArray], spectra: Mapping[str, FloatArray]) -> None:
    if f[0] <= 0.0:
        raise InputError(f"frequency_hz begins at {f[0]:g} Hz", allowed="above 0: the axis is logarithmic")
    if list(curves) != list(spectra):
        raise InputError(
            f"amplitude_m names {', '.join(spectra)}; backlash_m names {', '.join(curves)}",
            allowed="the same names in the same order",
        )


def _plot_all(axes: Axes, x: FloatArray, curves: Mapping[str, FloatArray], width: float = 1.5) -> list[Line2D]:
    colours = series.series_colours(len(curves))
    # Later cases are the greater ones: drawn first, they do not hide the others.
    return [
        axes.plot(x, values, color=colour, linewidth=width, label=label, zorder=3 - 0.01 * i)[0]
        for i, ((label, values), colour) in enumerate(zip(curves.items(), colours, strict=True))
    ]


def _draw_spectra(axes: Axes, f: FloatArray, spectra: Mapping[str, FloatArray]) -> None:
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    colours = series.series_colours(len(spectra))
    highest = max(float(values.max()) for values in spectra.values()) * MICRO
    for i, (values, colour) in enumerate(zip(spectra.values(), colours, strict=True)):
        if values.max() > 0.0:
            axes.plot(*thin(f, values * MICRO), color=colour, linewidth=1.1, zorder=3 - 0.01 * i)
    axes.set_xscale("log")
    axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.set_xlim(float(f[0]), float(f[-1]))
    axes.set_ylim(0.0, 1.08 * highest or 1.0)
    style.no_offset(axes)


def _name_lines(axes: Axes, lines_hz: Sequence[float]) -> None:
    for line in lines_hz:
        axes.axvline(line, color=style.QUIET, linewidth=0.7, linestyle=":", zorder=1)
        series.write(axes, line, 1.02, f"{line:.4g}")
