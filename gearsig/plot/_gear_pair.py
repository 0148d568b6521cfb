"""Simulated gear pairs: stiffness, load and friction over the mesh; of flexible ones maps, sweeps and spectra."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from gearsig.checks import FloatArray, frozen_array
from gearsig.errors import InputError
from gearsig.formatting import counted
from gearsig.plot import _series as series
from gearsig.plot import _style as style
from gearsig.plot._panels import UNDER_A_LINE
from gearsig.plot._series import thin
from gearsig.plot._style import MICRO

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D


STIFFNESS_UNIT = 1e8


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
    style.no_offset(axes, *close)
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
    cases = series.plot_curves(lower, x, {label: error * MICRO for label, error in errors.items()}, 1.4)
    style.label_axes(upper, "", "force of a pair (N)")
    style.label_axes(lower, series.CYCLES, "transmission error (µm)")
    series.legend_row(figure, cases, top_in=2.46)
    series.head(figure, title)
    return figure


def _touching(force: FloatArray) -> FloatArray:
    """Return the force with NaN where the pair is out of contact, the zero next to a contact kept."""
    idle = force == 0.0
    inside = idle.copy()
    inside[1:] &= idle[:-1]
    inside[:-1] &= idle[1:]
    return np.where(inside, np.nan, force)


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

    Raises
    ------
    InputError
        If a case holds no number, or lengths differ.
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

    Raises
    ------
    InputError
        On names that differ, or frequencies that begin at 0.
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
    style.no_offset(upper, lower)
    series.head(figure, title, drawn, heading)
    return figure


# --------------------
# A flexible gear pair: maps over mesh angle and torque, sweeps over speed up and down, spectra over speed.
# --------------------


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
    series.head(figure, title)
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
        rows = [series.checked_values(v, len(x), f"rms of {name}") * MICRO for v in (up, down)]
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
    largest_um = max(float(c.max()) for c in curves.values()) * MICRO
    floor = 1e-5 * largest_um  # five decades below the greatest amplitude
    for i, (axes, (name, values)) in enumerate(zip(panels, curves.items(), strict=True)):
        level = np.maximum(values * MICRO, floor)
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
    series.head(figure, title)
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

    Raises
    ------
    InputError
        If the rows are not as many as mesh angles.
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
