"""A flexible gear pair: maps over mesh angle and torque, sweeps over speed up and down, spectra over speed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from gearsig.checks import FloatArray, frozen_array
from gearsig.errors import InputError
from gearsig.plot import _series as series
from gearsig.plot import _style as style
from gearsig.plot._style import plain

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D


CYCLES = "mesh cycles (tooth passages)"
MAP_IN, SWEEP_IN = 3.9, 3.6
MOST_MAPS = 3
BAR_IN, GAP_IN = 0.12, 0.95
STEEP = 0.3
"""Step between neighbouring angles, of a map's range: beyond it lines of equal values would run into one another."""
N_LEVELS = 7
"""Lines of equal values in a map."""
SPAN = 1e-5
"""Range of a waterfall's levels below the greatest amplitude."""


def mesh_maps_figure(
    mesh_cycles: FloatArray, torque_nm: FloatArray, maps: Mapping[str, FloatArray], *, title: str = ""
) -> Figure:
    """Draw maps over mesh angle and torque beside each other, each with lines of equal values and a colour bar.

    Parameters
    ----------
    mesh_cycles : array, (n_c,)
    torque_nm : array, (n_t,)
    maps : mapping
        Name with unit, e.g. "mesh stiffness (10⁸ N/m)" → array, (n_c, n_t); up to 3.
    title : str

    Returns
    -------
    Figure

    Raises
    ------
    InputError
        On axes that do not ascend, a map of another shape, or more than three.
    """
    x, y = series.checked_axis(mesh_cycles, "mesh_cycles"), series.checked_axis(torque_nm, "torque_nm")
    if not 1 <= len(maps) <= MOST_MAPS:
        raise InputError(f"{len(maps)} maps", allowed=f"1 to {MOST_MAPS}")
    figure = style.new_figure(MAP_IN)
    width = (style.WIDTH_IN - 0.7 - GAP_IN * len(maps)) / len(maps)
    for i, (name, values) in enumerate(maps.items()):
        array = frozen_array(values, name, ndim=2)
        if array.shape != (len(x), len(y)):
            raise InputError(f"{name} has shape {array.shape}", allowed=f"{(len(x), len(y))}")
        left = 0.7 + i * (width + GAP_IN)
        right = style.WIDTH_IN - left - width
        axes = style.panel(figure, left_in=left, right_in=right, bottom_in=0.55, top_in=0.75)
        _draw_map(figure, axes, x, y, array, left + width)
        _name(figure, left, name)
        style.label_axes(axes, CYCLES if len(maps) < MOST_MAPS else "mesh cycles", "torque (N·m)" if i == 0 else "")
    series.headline(figure, title)
    return figure


def speed_sweep_figure(
    sweeps: Sequence[tuple[str, FloatArray, FloatArray, FloatArray]],
    *,
    natural_hz: float | None = None,
    jumps_hz: Mapping[str, float] | None = None,
    title: str = "",
) -> Figure:
    """Draw rms of the dynamic transmission error over the mesh frequency, sweeps up in full, sweeps down dashed.

    Parameters
    ----------
    sweeps : sequence of (name, mesh_hz up, rms_m, …)
        Name of the case, mesh frequency of the parts (n,), rms up (n,), rms down (n,) at the same frequencies, in m.
    natural_hz : float or None
        Marked with its half and third.
    jumps_hz : mapping or None
        Name, e.g. "jump up" → frequency.
    title : str

    Returns
    -------
    Figure
    """
    if not 1 <= len(sweeps) <= series.MOST_CURVES:
        raise InputError(f"{len(sweeps)} sweeps", allowed=f"1 to {series.MOST_CURVES}")
    figure = style.new_figure(SWEEP_IN)
    axes = style.panel(figure, bottom_in=0.55, top_in=0.85)
    lines = []
    for (name, mesh_hz, up, down), colour in zip(sweeps, series.series_colours(len(sweeps)), strict=True):
        x = series.checked_axis(mesh_hz, f"mesh_hz of {name}")
        rows = [series.checked_values(v, len(x), f"rms of {name}") * 1e6 for v in (up, down)]
        lines.append(axes.plot(x, rows[0], color=colour, linewidth=1.5, label=name)[0])
        axes.plot(x, rows[1], color=colour, linewidth=1.3, linestyle=(0, (4, 2)))
    axes.set_xlim(min(float(s[1][0]) for s in sweeps), max(float(s[1][-1]) for s in sweeps))
    axes.set_ylim(bottom=0.0)
    if natural_hz is not None:
        for part, word in ((1, "ωₙ"), (2, "ωₙ/2"), (3, "ωₙ/3")):
            _mark(axes, natural_hz / part, word)
    for word, hertz in (jumps_hz or {}).items():
        _mark(axes, hertz, word)
    style.label_axes(axes, "mesh frequency (Hz)", "rms of the DTE (µm)")
    series.legend_row(figure, lines, left_in=0.85, top_in=series.NAMES_AT_IN, heading="full: up, dashed: down")
    series.headline(figure, title)
    return figure


def speed_spectra_figure(
    frequency_hz: FloatArray,
    spectra_m: Mapping[str, FloatArray],
    *,
    mesh_hz: Sequence[float] = (),
    natural_hz: float | None = None,
    title: str = "",
) -> Figure:
    """Draw amplitude spectra of one quantity at several speeds below each other, on one logarithmic scale.

    Parameters
    ----------
    frequency_hz : array, (n,)
    spectra_m : mapping
        Name of the speed → peak amplitudes in m, (n,).
    mesh_hz : sequence of float
        Mesh frequency of each, marked in its panel.
    natural_hz : float or None
        Marked in all panels.
    title : str

    Returns
    -------
    Figure
    """
    x = series.checked_axis(frequency_hz, "frequency_hz")
    curves = series.checked_curves(spectra_m, len(x), "spectra_m")
    each, top, bottom = 1.05, 0.45, 0.55
    height = top + bottom + each * len(curves)
    figure = style.new_figure(height)
    most = max(float(c.max()) for c in curves.values()) * 1e6
    for i, (name, values) in enumerate(curves.items()):
        below = bottom + each * (len(curves) - 1 - i)
        axes = style.panel(figure, bottom_in=below + 0.08, top_in=height - below - each)
        level = np.maximum(values * 1e6, most * SPAN)
        axes.fill_between(x, most * SPAN, level, color=style.SIMULATED, alpha=0.25, linewidth=0)
        axes.plot(x, level, color=style.SIMULATED, linewidth=style.LINE_PT)
        axes.set_yscale("log")
        axes.set_ylim(most * SPAN, most * 2.0)
        axes.set_xlim(float(x[0]), float(x[-1]))
        if i < len(mesh_hz):
            for harmonic in range(1, int(x[-1] / mesh_hz[i]) + 1):
                axes.axvline(harmonic * mesh_hz[i], color=style.MESH, linewidth=0.6, alpha=0.5, zorder=1)
        if natural_hz is not None:
            axes.axvline(natural_hz, color=style.FAULT, linewidth=0.9, linestyle=(0, (3, 2)), zorder=1)
        axes.tick_params(labelbottom=i == len(curves) - 1)
        axes.text(
            0.995, 0.93, plain(name, 40), transform=axes.transAxes, ha="right", va="top", fontsize=style.SMALL_PT,
            color=style.INK, parse_math=False,
        )  # fmt: skip
        style.label_axes(axes, "frequency (Hz)" if i == len(curves) - 1 else "", "DTE (µm)")
    series.headline(figure, title)
    return figure


def frequency_curves_figure(
    mesh_cycles: FloatArray, frequencies_hz: FloatArray, uncoupled_hz: FloatArray | None = None, *, title: str = ""
) -> Figure:
    """Draw natural frequencies over the mesh angle, one curve each; those that hardly move are drawn quietly.

    Parameters
    ----------
    mesh_cycles : array, (n_c,)
    frequencies_hz : array, (n_c, n)
        Rising along the second axis.
    uncoupled_hz : array, (m,), or None
        Of the two sides without contact: they do not depend on the angle; drawn dashed.
    title : str
    """
    x = series.checked_axis(mesh_cycles, "mesh_cycles")
    curves = frozen_array(frequencies_hz, "frequencies_hz", ndim=2)
    if curves.shape[0] != len(x):
        raise InputError(f"frequencies_hz has {curves.shape[0]} rows, its axis {len(x)}", allowed="equal lengths")
    figure = style.new_figure(SWEEP_IN)
    axes = style.panel(figure, bottom_in=0.55, top_in=0.85 if uncoupled_hz is not None else 0.5)
    named: dict[str, Line2D] = {}
    for curve in curves.T:
        moves = float(np.ptp(curve)) > 0.01 * float(curve.mean())
        line = axes.plot(
            x, curve / 1e3, color=style.SIMULATED if moves else style.FLOOR, linewidth=1.5 if moves else 0.8
        )
        word = "coupled, moves with the angle" if moves else "coupled, hardly moves"
        line[0].set_label(word)
        named.setdefault(word, line[0])
    for hertz in () if uncoupled_hz is None else frozen_array(uncoupled_hz, "uncoupled_hz", ndim=1):
        line = axes.plot(x[[0, -1]], [hertz / 1e3] * 2, color=style.FAULT, linewidth=0.9, linestyle=(0, (4, 3)))
        line[0].set_label("without contact")
        named.setdefault("without contact", line[0])
    axes.set_xlim(float(x[0]), float(x[-1]))
    axes.set_ylim(bottom=0.0)
    style.label_axes(axes, CYCLES, "natural frequency (kHz)")
    if uncoupled_hz is not None:
        series.legend_row(figure, list(named.values()), left_in=0.85, top_in=series.NAMES_AT_IN)
    series.headline(figure, title)
    return figure


def contact_spreading_figure(
    mesh_cycles: FloatArray, frequency_hz: Mapping[str, FloatArray], *, title: str = ""
) -> Figure:
    """Draw one natural frequency over the mesh angle, by how contact forces reach the nodes of the mesh.

    Parameters
    ----------
    mesh_cycles : array, (n_c,)
    frequency_hz : mapping
        Name of the way, e.g. "line of nodes" → array, (n_c,).
    title : str
    """
    x = series.checked_axis(mesh_cycles, "mesh_cycles")
    curves = series.checked_curves(frequency_hz, len(x), "frequency_hz")
    figure = style.new_figure(SWEEP_IN)
    axes = style.panel(figure, bottom_in=0.55, top_in=0.85)
    colours = series.series_colours(len(curves))
    lines = [
        axes.plot(x, values, color=colour, linewidth=1.5, label=name)[0]
        for (name, values), colour in zip(curves.items(), colours, strict=True)
    ]
    axes.set_xlim(float(x[0]), float(x[-1]))
    style.label_axes(axes, CYCLES, "torsional mode (Hz)")
    series.legend_row(figure, lines, left_in=0.85, top_in=series.NAMES_AT_IN)
    series.headline(figure, title)
    return figure


def _draw_map(figure: Figure, axes: Axes, x: FloatArray, y: FloatArray, values: FloatArray, right_in: float) -> None:
    from gearsig.plot._maps import colours

    mesh = axes.pcolormesh(x, y, values.T, cmap=colours(), shading="gouraud", rasterized=True)
    lines = None
    if np.max(np.abs(np.diff(values, axis=0))) < STEEP * np.ptp(values):
        levels = np.linspace(float(values.min()), float(values.max()), N_LEVELS + 2)[1:-1]
        # Dark lines where the map is light, light ones where it is dark; the bar beside it has them with their values.
        inks = [style.INK if i < N_LEVELS / 2 else "white" for i in range(N_LEVELS)]
        lines = axes.contour(x, y, values.T, levels=levels, colors=inks, linewidths=0.7, alpha=0.8)
    axes.grid(visible=False)
    height = figure.get_size_inches()[1]
    place = ((right_in + 0.1) / style.WIDTH_IN, 0.55 / height, BAR_IN / style.WIDTH_IN, (height - 1.3) / height)
    bar = figure.colorbar(mesh, cax=figure.add_axes(place))
    bar.outline.set_visible(False)
    if lines is not None:
        bar.add_lines(lines)
        bar.set_ticks([float(f"{level:.3g}") for level in levels])
    bar.ax.tick_params(colors=style.QUIET, labelcolor=style.INK, labelsize=style.SMALL_PT)


def _name(figure: Figure, left_in: float, name: str) -> None:
    height = figure.get_size_inches()[1]
    figure.text(
        left_in / style.WIDTH_IN,
        1.0 - 0.62 / height,
        plain(name, 60),
        fontsize=style.TEXT_PT,
        color=style.INK,
        va="center",
        parse_math=False,
    )


def _mark(axes: Axes, hertz: float, word: str) -> None:
    axes.axvline(hertz, color=style.FLOOR, linewidth=0.8, linestyle=(0, (3, 2)), zorder=1)
    series.write(axes, hertz, 1.01, word)
