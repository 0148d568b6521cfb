"""Mesh stiffness, load sharing and static transmission error over the mesh."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from gearsig.checks import FloatArray
from gearsig.errors import InputError
from gearsig.formatting import counted
from gearsig.plot import _series as series
from gearsig.plot import _style as style
from gearsig.plot._series import thin
from gearsig.plot._style import plain

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


STIFFNESS_UNIT = 1e8
MICRO = 1e6


def mesh_stiffness_figure(
    mesh_cycles: FloatArray,
    stiffness_n_per_m: Mapping[str, FloatArray],
    *,
    single_pair: tuple[float, float] | None = None,
    heading: str = "",
    title: str = "",
) -> Figure:
    """Draw the stiffness of the whole mesh for several cases, with a close view of a single-pair region.

    Parameters
    ----------
    mesh_cycles : array, (n,)
        Ascending.
    stiffness_n_per_m : mapping
        Name of the case → array, (n,); in their order from dark to light.
    single_pair : (float, float) or None
        Mesh cycles of the region to enlarge; None: no second panel.
    heading : str
        Before the names, e.g. "crack depth".
    title : str

    Returns
    -------
    Figure

    Raises
    ------
    InputError
        On wrong lengths, or a region without two points of the axis.
    """
    x = series.checked_axis(mesh_cycles, "mesh_cycles")
    curves = series.checked_curves(stiffness_n_per_m, len(x), "stiffness_n_per_m")
    shown = {label: values / STIFFNESS_UNIT for label, values in curves.items()}
    label = "mesh stiffness (10⁸ N/m)"
    figure, (axes, *close) = style.panels((2.1,), (1.0,) if single_pair is None else (1.7, 1.0), top_in=0.65)
    lines = series.plot_curves(axes, x, shown, 1.4)
    style.label_axes(axes, series.CYCLES, label)
    if single_pair is not None:
        low, high = series.checked_limits(single_pair, "single_pair")
        inside = (x >= low) & (x <= high)
        if (n_inside := int(np.count_nonzero(inside))) < 2:
            raise InputError(
                f"single_pair, {low:g} to {high:g}, holds {counted(n_inside, 'point')} of mesh_cycles",
                allowed="at least 2",
                remedy="give a finer axis or a region on it",
            )
        zoom = close[0]
        series.plot_curves(zoom, x[inside], {label: values[inside] for label, values in shown.items()}, 1.4)
        zoom.set_xlim(low, high)
        zoom.locator_params(axis="x", nbins=4)
        series.shade(axes, (low, high))
        style.label_axes(zoom, "mesh cycles", label)
        series.write(zoom, (low + high) / 2, 1.01, "one pair in contact (shaded)")
    for panel in (axes, *close):
        style.no_offset(panel)
    series.head(figure, title, lines, heading)
    return figure


def load_sharing_figure(
    mesh_cycles: FloatArray,
    pair_forces_n: Mapping[str, FloatArray],
    transmission_error_m: Mapping[str, FloatArray],
    *,
    title: str = "",
) -> Figure:
    """Draw the force of each tooth pair, and below it the static transmission error.

    Parameters
    ----------
    mesh_cycles : array, (n,)
        Ascending.
    pair_forces_n : mapping
        Name of the pair → array, (n,); where it is 0 the pair does not touch and nothing is drawn.
    transmission_error_m : mapping
        Name of the case → array, (n,).
    title : str

    Returns
    -------
    Figure
    """
    x = series.checked_axis(mesh_cycles, "mesh_cycles")
    forces = series.checked_curves(pair_forces_n, len(x), "pair_forces_n")
    errors = series.checked_curves(transmission_error_m, len(x), "transmission_error_m")
    figure, (upper, lower) = style.panels((1.6, 1.5), top_in=0.55, share_x=True)
    highest = max(float(force.max()) for force in forces.values())
    for label, force, colour in series.coloured(forces):
        upper.plot(x, _touching(force), color=colour, linewidth=1.6, label=label)
        if force.max() > 0.95 * highest:
            plateau = x[force > 0.98 * force.max()]
            series.write(upper, float(plateau.mean()), 1.02, label, colour=colour)
    upper.set_ylim(0.0, 1.06 * highest or 1.0)
    cases = series.plot_curves(lower, x, {label: error * 1e6 for label, error in errors.items()}, 1.4)
    style.label_axes(upper, "", "force of a pair (N)")
    style.label_axes(lower, series.CYCLES, "transmission error (µm)")
    series.legend_row(figure, cases, top_in=2.46)
    series.headline(figure, title)
    return figure


def _touching(force: FloatArray) -> FloatArray:
    """Return the force with NaN where the pair is out of contact, the zero next to a contact kept."""
    idle = force == 0.0
    inside = idle.copy()
    inside[1:] &= idle[:-1]
    inside[:-1] &= idle[1:]
    return np.where(inside, np.nan, force)


def tooth_figure(
    x_mm: FloatArray,
    y_mm: FloatArray,
    *,
    cracks_mm: Mapping[str, tuple[FloatArray, FloatArray]] | None = None,
    limiting_lines: bool = True,
    title: str = "",
) -> Figure:
    """Draw a tooth, its loaded flank on the right, with cracks as lines from their mouth to their tip.

    Parameters
    ----------
    x_mm, y_mm : arrays, (n,)
        Half outline from the root circle to the tip: x along the tooth's centre line from the gear's centre, y across.
        The other half is its mirror image.
    cracks_mm : mapping or None
        Name → x and y of the crack's points, in the same axes.
    limiting_lines : bool
        Draws the line from each crack's tip to the corner of the tooth: what lies beyond it carries no load.
    title : str

    Returns
    -------
    Figure
        Drawn true to scale.
    """
    x = series.checked_axis(x_mm, "x_mm")
    y = series.checked_values(y_mm, len(x), "y_mm")
    figure, (axes,) = style.panels((4.0,), left_in=0.75, top_in=0.45, width_in=4.9)
    axes.grid(visible=False)
    deepest = min((float(np.min(points)) for points, _ in (cracks_mm or {}).values()), default=float(x[0]))
    _draw_tooth(axes, x, y, min(deepest, float(x[0])) - 0.2 * float(x[-1] - x[0]))
    axes.axvline(0.0, color=style.QUIET, linewidth=0.7, linestyle="-.", zorder=1)
    for number, (label, (crack_x, crack_y)) in enumerate((cracks_mm or {}).items()):
        points = series.checked_values(crack_x, len(crack_x), f"x of {label!r}")
        crack_across = series.checked_values(crack_y, len(points), f"y of {label!r}")
        _draw_crack(axes, crack_across, points, label, number)
        if limiting_lines:
            axes.plot([crack_across[-1], y[-1]], [points[-1], x[-1]], color=style.FAULT, linewidth=0.7, linestyle=":")
    axes.set_aspect("equal", adjustable="datalim")
    style.label_axes(axes, "across the tooth (mm)", "from the gear's centre (mm)", title)
    style.no_offset(axes)
    return figure


def _draw_tooth(axes: Axes, x: FloatArray, y: FloatArray, bottom: float) -> None:
    """Draw the outline with a piece of the root circle either side, and the body down to `bottom`."""
    radius, start = float(np.hypot(x[0], y[0])), float(np.arctan2(y[0], x[0]))
    root = np.linspace(1.25 * start, start, 20)[:-1]
    along, across = np.append(radius * np.cos(root), x), np.append(radius * np.sin(root), y)
    across, along = np.concatenate((across, -across[::-1])), np.concatenate((along, along[::-1]))
    axes.plot(across, along, color=style.INK, linewidth=1.3)
    across, along = np.append(across, [across[-1], across[0]]), np.append(along, [bottom, bottom])
    axes.fill(across, along, facecolor=style.FLOOR, alpha=0.16, linewidth=0)


def _draw_crack(axes: Axes, across: FloatArray, along: FloatArray, label: str, number: int) -> None:
    axes.plot(across, along, color=style.FAULT, linewidth=2.2, zorder=3, solid_capstyle="butt")
    axes.plot(across[-1:], along[-1:], "o", color=style.FAULT, markersize=4.5, zorder=3)
    axes.annotate(
        plain(label, 24),
        (float(across[-1]), float(along[-1])),
        xytext=(7, -1),  # cracks run up to the right: the lower right of a tip is free
        textcoords="offset points",
        ha="left",
        va="top",
        fontsize=style.SMALL_PT,
        color=style.FAULT,
        parse_math=False,
        zorder=4 + number,
    )


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
    figure, (axes,) = style.panels((2.0,), top_in=0.82)
    lines = series.plot_curves(axes, x, curves)
    signed = any(bool((values < 0.0).any()) for values in curves.values())
    if signed:
        axes.axhline(0.0, color=style.QUIET, linewidth=0.7, zorder=1)
    else:
        axes.set_ylim(bottom=0.0)
    name = "friction coefficient × direction (–)" if signed else "friction coefficient (–)"
    style.label_axes(axes, "mesh cycles since the pair's entry (tooth passages)", name)
    if single_pair is not None:
        series.shade(axes, series.checked_limits(single_pair, "single_pair"))
    if pitch_point is not None:
        axes.axvline(pitch_point, color=style.QUIET, linewidth=0.8, linestyle="--", zorder=1)
        series.write(axes, pitch_point, 1.01, "pitch point")
        series.write(axes, (float(x[0]) + pitch_point) / 2, 1.01, "approach")
        series.write(axes, (float(x[-1]) + pitch_point) / 2, 1.01, "recess")
    style.no_offset(axes)
    series.head(figure, title, lines, heading)
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
    if f[0] <= 0.0:
        raise InputError(f"frequency_hz begins at {f[0]:g} Hz", allowed="above 0: the axis is logarithmic")
    if list(curves) != list(spectra):
        raise InputError(
            f"amplitude_m names {', '.join(spectra)}; backlash_m names {', '.join(curves)}",
            allowed="the same names in the same order",
        )
    figure, (upper, lower) = style.panels((1.6, 1.55), top_in=0.7, row_gap_in=0.9)
    drawn = series.plot_curves(upper, t, {label: values * MICRO for label, values in curves.items()}, 1.0)
    style.label_axes(upper, "time (s)", "half backlash (µm)")
    for i, (_, values, colour) in enumerate(series.coloured(spectra)):
        if values.max() > 0.0:
            lower.plot(*thin(f, values * MICRO), color=colour, linewidth=1.1, zorder=3 - 0.01 * i)
    lower.set_xscale("log")
    style.number_decades(lower.xaxis)
    lower.set_xlim(float(f[0]), float(f[-1]))
    lower.set_ylim(0.0, 1.08 * MICRO * max(float(values.max()) for values in spectra.values()) or 1.0)
    for line in (line for line in lines_hz if f[0] <= line <= f[-1]):
        lower.axvline(line, color=style.QUIET, linewidth=0.7, linestyle=":", zorder=1)
        series.write(lower, line, 1.02, f"{line:.4g}")
    if mesh_frequency_hz is not None:
        lower.axvline(mesh_frequency_hz, color=style.MESH, linewidth=1.0, zorder=1)
        series.write(lower, 1.02 * mesh_frequency_hz, 0.9, "mesh", colour=style.MESH, ha="left")
    style.label_axes(lower, "frequency (Hz)", "amplitude (µm peak)")
    for axes in (upper, lower):
        style.no_offset(axes)
    series.head(figure, title, drawn, heading)
    return figure
