"""A flexible gear pair: maps over mesh angle and torque, sweeps over speed up and down, spectra over speed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from gearsig.checks import FloatArray, frozen_array
from gearsig.errors import InputError
from gearsig.plot import _series as series
from gearsig.plot import _style as style
from gearsig.plot._panels import UNDER_A_LINE

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D


N_LEVELS = 7  # lines of equal values in a map


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
    n = len(maps)
    series.check_number(n, f"{n} maps", 3)
    figure, panels = style.panels((2.6,), (1.0,) * n, left_in=0.7, right_in=0.95, top_in=0.75)
    for axes, (name, values) in zip(panels, maps.items(), strict=True):
        array = frozen_array(values, name, ndim=2)
        if array.shape != (len(x), len(y)):
            raise InputError(f"{name} has shape {array.shape}", allowed=f"{(len(x), len(y))}")
        mesh = axes.pcolormesh(x, y, array.T, cmap=style.colours(), shading="gouraud", rasterized=True)
        axes.grid(visible=False)
        bar = style.colour_bar(axes, mesh, gap_in=0.1)
        # Where neighbouring angles are further apart, lines of equal values would run into one another.
        if np.max(np.abs(np.diff(array, axis=0))) < 0.3 * np.ptp(array):
            levels = np.linspace(float(array.min()), float(array.max()), N_LEVELS + 2)[1:-1]
            # Dark lines where the map is light, light ones where it is dark; the bar has them with their values.
            inks = [style.INK if i < N_LEVELS / 2 else "white" for i in range(N_LEVELS)]
            axes.contour(x, y, array.T, levels=levels, colors=inks, linewidths=0.7, alpha=0.8)
            bar.hlines(levels, 0.0, 1.0, colors=inks, linewidths=0.7, transform=bar.get_yaxis_transform())
            bar.set_yticks([float(f"{level:.3g}") for level in levels])
        style.put_text(axes, 0.0, 1.03, name, colour=style.INK, fontsize=style.TEXT_PT, transform=axes.transAxes)
        style.label_axes(axes, series.CYCLES if n < 3 else "mesh cycles", "torque (N·m)" if axes is panels[0] else "")
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
    series.check_number(len(sweeps), f"{len(sweeps)} sweeps")
    figure, (axes,) = style.panels((2.2,), top_in=0.85)
    lines = []
    for (name, mesh_hz, up, down), colour in zip(sweeps, series.series_colours(len(sweeps)), strict=True):
        x = series.checked_axis(mesh_hz, f"mesh_hz of {name}")
        rows = [series.checked_values(v, len(x), f"rms of {name}") * 1e6 for v in (up, down)]
        lines += axes.plot(x, rows[0], color=colour, linewidth=1.5, label=name if len(sweeps) > 1 else "sweep up")
        falling = axes.plot(x, rows[1], color=colour, linewidth=1.3, linestyle=(0, (4, 2)), label="sweep down")
        lines += falling if len(sweeps) == 1 else []
    axes.set_xlim(min(float(s[1][0]) for s in sweeps), max(float(s[1][-1]) for s in sweeps))
    axes.set_ylim(bottom=0.0)
    natural = {} if natural_hz is None else {"ωₙ": natural_hz, "ωₙ/2": natural_hz / 2, "ωₙ/3": natural_hz / 3}
    for word, hertz in {**natural, **(jumps_hz or {})}.items():
        axes.axvline(hertz, color=style.FLOOR, linewidth=0.8, linestyle=(0, (3, 2)), zorder=1)
        series.write(axes, hertz, 1.01, word)
    style.label_axes(axes, "mesh frequency (Hz)", "dynamic transmission error, rms (µm)")
    series.head(figure, title, lines, "full: up, dashed: down" if len(sweeps) > 1 else "")
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
    figure, panels = style.panels((0.97,) * len(curves), top_in=0.45, row_gap_in=0.08, share_x=True)
    largest_um = max(float(c.max()) for c in curves.values()) * 1e6
    floor = 1e-5 * largest_um  # five decades below the greatest amplitude
    for i, (axes, (name, values)) in enumerate(zip(panels, curves.items(), strict=True)):
        level = np.maximum(values * 1e6, floor)
        axes.fill_between(x, floor, level, color=style.SIMULATED, alpha=0.25, linewidth=0, label=UNDER_A_LINE)
        axes.plot(x, level, color=style.SIMULATED, linewidth=style.LINE_PT)
        axes.set_yscale("log")
        axes.set_ylim(floor, largest_um * 2.0)
        axes.set_xlim(float(x[0]), float(x[-1]))
        if i < len(mesh_hz):
            for harmonic in range(1, int(x[-1] / mesh_hz[i]) + 1):
                axes.axvline(harmonic * mesh_hz[i], color=style.MESH, linewidth=0.6, alpha=0.5, zorder=1)
        if natural_hz is not None:
            axes.axvline(natural_hz, color=style.FAULT, linewidth=0.9, linestyle=(0, (3, 2)), zorder=1)
        style.put_text(axes, 0.995, 0.93, name, colour=style.INK, transform=axes.transAxes, ha="right", va="top")
        style.label_axes(axes, "frequency (Hz)" if axes is panels[-1] else "", "transmission error (µm)")
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
    figure, (axes,) = style.panels((2.3,), top_in=0.85 if uncoupled_hz is not None else 0.5)
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
    style.label_axes(axes, series.CYCLES, "natural frequency (kHz)")
    series.head(figure, title, () if uncoupled_hz is None else list(named.values()))
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
    figure, (axes,) = style.panels((2.2,), top_in=0.85)
    lines = series.plot_curves(axes, x, curves)
    style.label_axes(axes, series.CYCLES, "torsional mode (Hz)")
    series.head(figure, title, lines)
    return figure
