"""Simulated gear pairs: stiffness, load and friction over the mesh; responses; maps and sweeps of flexible ones."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from gearsig.checks import FloatArray, count, frozen_array, positive
from gearsig.errors import InputError
from gearsig.formatting import counted
from gearsig.plot import _style as style
from gearsig.plot._panels import UNDER_A_LINE
from gearsig.plot._style import MICRO, MILLI, thin

if TYPE_CHECKING:
    from matplotlib.axes import Axes
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
        Name of the case → array, (n,); coloured in order from dark to light.
    single_pair : (float, float) or None
        Mesh cycles of the region to enlarge; None: no second panel.
    heading : str
        Text before the names, e.g. "crack depth".
    title : str

    Returns
    -------
    Figure

    Raises
    ------
    InputError
        If lengths differ, or the region has fewer than two points of the axis.
    """
    x = style.checked_axis(mesh_cycles, "mesh_cycles")
    curves = style.checked_curves(stiffness_n_per_m, len(x), "stiffness_n_per_m")
    shown = {label: values / STIFFNESS_UNIT for label, values in curves.items()}
    label = "mesh stiffness (10⁸ N/m)"
    figure, (axes, *close) = style.panels((2.1,), (1.0,) if single_pair is None else (1.7, 1.0), top_in=0.65)
    lines = style.plot_curves(axes, x, shown, 1.4)
    style.label_axes(axes, style.CYCLES, label)
    if single_pair is not None:
        low, high = style.checked_limits(single_pair, "single_pair")
        inside = (x >= low) & (x <= high)
        if (n_inside := int(np.count_nonzero(inside))) < 2:
            raise InputError(
                f"single_pair, {low:g} to {high:g}, holds {counted(n_inside, 'point')} of mesh_cycles",
                allowed="at least 2",
                remedy="give a finer axis or a region on it",
            )
        zoom = close[0]
        style.plot_curves(zoom, x[inside], {label: values[inside] for label, values in shown.items()}, 1.4)
        zoom.set_xlim(low, high)
        zoom.locator_params(axis="x", nbins=4)
        style.shade(axes, (low, high))
        style.label_axes(zoom, "mesh cycles", label)
        style.write(zoom, (low + high) / 2, 1.01, "one pair in contact (shaded)")
    style.no_offset(axes, *close)
    style.head(figure, title, lines, heading)
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
        Name of the pair → array, (n,); where it is 0 the pair is not in contact and nothing is drawn.
    transmission_error_m : mapping
        Name of the case → array, (n,).
    title : str

    Returns
    -------
    Figure
    """
    x = style.checked_axis(mesh_cycles, "mesh_cycles")
    forces = style.checked_curves(pair_forces_n, len(x), "pair_forces_n")
    errors = style.checked_curves(transmission_error_m, len(x), "transmission_error_m")
    figure, (upper, lower) = style.panels((1.6, 1.5), top_in=0.55, share_x=True)
    highest = max(float(force.max()) for force in forces.values())
    for label, force, colour in style.coloured(forces):
        upper.plot(x, _touching(force), color=colour, linewidth=1.6, label=label)
        if force.max() > 0.95 * highest:
            plateau = x[force > 0.98 * force.max()]
            style.write(upper, float(plateau.mean()), 1.02, label, colour=colour)
    upper.set_ylim(0.0, 1.06 * highest or 1.0)
    cases = style.plot_curves(lower, x, {label: error * MICRO for label, error in errors.items()}, 1.4)
    style.label_axes(upper, "", "force of a pair (N)")
    style.label_axes(lower, style.CYCLES, "transmission error (µm)")
    style.legend_row(figure, cases, top_in=2.46)
    style.head(figure, title)
    return figure


def _touching(force: FloatArray) -> FloatArray:
    """Return the force with NaN where the pair is out of contact, but with the zero next to a contact."""
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
    """Draw the friction coefficient of one tooth pair from entry to exit.

    Parameters
    ----------
    mesh_cycles : array, (n,)
        Since the pair's entry, ascending.
    coefficients : mapping
        Name of the case → array, (n,). A sign is the direction of sliding: positive in approach, negative in recess.
        NaN: no contact.
    pitch_point : float or None
        Mesh cycles at which sliding reverses.
    single_pair : (float, float) or None
        Region of single contact; shaded.
    heading, title : str
        As in `mesh_stiffness_figure`.

    Returns
    -------
    Figure

    Raises
    ------
    InputError
        If a case contains no number, or lengths differ.
    """
    x = style.checked_axis(mesh_cycles, "mesh_cycles")
    curves = style.checked_curves(coefficients, len(x), "coefficients", gaps=True)
    for label, values in curves.items():
        if np.isnan(values).all():
            raise InputError(f"coefficients[{label!r}] holds no number", remedy="leave the case out")
    figure, (axes,) = style.panels((2.0,), top_in=0.82)
    lines = style.plot_curves(axes, x, curves)
    signed = any(bool((values < 0.0).any()) for values in curves.values())
    if signed:
        axes.axhline(0.0, color=style.QUIET, linewidth=0.7, zorder=1)
    else:
        axes.set_ylim(bottom=0.0)
    name = "friction coefficient × direction (–)" if signed else "friction coefficient (–)"
    style.label_axes(axes, "mesh cycles since the pair's entry (tooth passages)", name)
    if single_pair is not None:
        style.shade(axes, style.checked_limits(single_pair, "single_pair"))
    if pitch_point is not None:
        axes.axvline(pitch_point, color=style.QUIET, linewidth=0.8, linestyle="--", zorder=1)
        style.write(axes, pitch_point, 1.01, "pitch point")
        style.write(axes, (float(x[0]) + pitch_point) / 2, 1.01, "approach")
        style.write(axes, (float(x[-1]) + pitch_point) / 2, 1.01, "recess")
    style.no_offset(axes)
    style.head(figure, title, lines, heading)
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
    """Draw the backlash over time, and below it the spectrum of its variation.

    Parameters
    ----------
    time_s : array, (n,)
        Ascending.
    backlash_m : mapping
        Name of the case → b(t) = b₀ + Δb(t), (n,).
    frequency_hz : array, (m,)
        Ascending, above 0. The axis is logarithmic, as the lines of a fractal profile have a constant ratio.
    amplitude_m : mapping
        Same names → peak amplitude of each line, (m,); a case whose amplitudes are all 0 is left out.
    lines_hz : sequence of float
        Expected lines, marked with their frequencies.
    mesh_frequency_hz : float or None
    heading, title : str
        As in `mesh_stiffness_figure`.

    Returns
    -------
    Figure

    Raises
    ------
    InputError
        If the names differ, or the frequencies begin at 0.
    """
    t = style.checked_axis(time_s, "time_s")
    f = style.checked_axis(frequency_hz, "frequency_hz")
    curves = style.checked_curves(backlash_m, len(t), "backlash_m")
    spectra = style.checked_curves(amplitude_m, len(f), "amplitude_m")
    if f[0] <= 0.0:
        raise InputError(f"frequency_hz begins at {f[0]:g} Hz", allowed="above 0: the axis is logarithmic")
    if list(curves) != list(spectra):
        raise InputError(
            f"amplitude_m names {', '.join(spectra)}; backlash_m names {', '.join(curves)}",
            allowed="the same names in the same order",
        )
    figure, (upper, lower) = style.panels((1.6, 1.55), top_in=0.7, row_gap_in=0.9)
    drawn = style.plot_curves(upper, t, {label: values * MICRO for label, values in curves.items()}, 1.0)
    style.label_axes(upper, "time (s)", "half backlash (µm)")
    for i, (_, values, colour) in enumerate(style.coloured(spectra)):
        if values.max() > 0.0:
            lower.plot(*thin(f, values * MICRO), color=colour, linewidth=1.1, zorder=3 - 0.01 * i)
    lower.set_xscale("log")
    style.number_decades(lower.xaxis)
    lower.set_xlim(float(f[0]), float(f[-1]))
    lower.set_ylim(0.0, 1.08 * MICRO * max(float(values.max()) for values in spectra.values()) or 1.0)
    for line in (line for line in lines_hz if f[0] <= line <= f[-1]):
        lower.axvline(line, color=style.QUIET, linewidth=0.7, linestyle=":", zorder=1)
        style.write(lower, line, 1.02, f"{line:.4g}")
    if mesh_frequency_hz is not None:
        lower.axvline(mesh_frequency_hz, color=style.MESH, linewidth=1.0, zorder=1)
        style.write(lower, 1.02 * mesh_frequency_hz, 0.9, "mesh", colour=style.MESH, ha="left")
    style.label_axes(lower, "frequency (Hz)", "amplitude (µm peak)")
    style.no_offset(upper, lower)
    style.head(figure, title, drawn, heading)
    return figure


# --------------------
# A flexible gear pair: maps over mesh angle and torque, speed sweeps up and down, spectra over speed.
# --------------------


N_LEVELS = 7  # contour lines in a map


def mesh_maps_figure(
    mesh_cycles: FloatArray, torque_nm: FloatArray, maps: Mapping[str, FloatArray], *, title: str = ""
) -> Figure:
    """Draw maps over mesh angle and torque side by side, each with contour lines and a colour bar.

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
        If an axis does not ascend, a map has another shape, or there are more than three.
    """
    x, y = style.checked_axis(mesh_cycles, "mesh_cycles"), style.checked_axis(torque_nm, "torque_nm")
    n = len(maps)
    style.check_number(n, f"{n} maps", 3)
    figure, panels = style.panels((2.6,), (1.0,) * n, left_in=0.7, right_in=0.95, top_in=0.75)
    for axes, (name, values) in zip(panels, maps.items(), strict=True):
        array = frozen_array(values, name, ndim=2)
        if array.shape != (len(x), len(y)):
            raise InputError(f"{name} has shape {array.shape}", allowed=f"{(len(x), len(y))}")
        mesh = axes.pcolormesh(x, y, array.T, cmap=style.colours(), shading="gouraud", rasterized=True)
        axes.grid(visible=False)
        bar = style.colour_bar(axes, mesh, gap_in=0.1)
        # If neighbouring angles are further apart, contour lines would run into one another.
        if np.max(np.abs(np.diff(array, axis=0))) < 0.3 * np.ptp(array):
            levels = np.linspace(float(array.min()), float(array.max()), N_LEVELS + 2)[1:-1]
            # Dark lines where the map is light, light ones where it is dark; the colour bar shows their values.
            inks = [style.INK if i < N_LEVELS / 2 else "white" for i in range(N_LEVELS)]
            axes.contour(x, y, array.T, levels=levels, colors=inks, linewidths=0.7, alpha=0.8)
            bar.hlines(levels, 0.0, 1.0, colors=inks, linewidths=0.7, transform=bar.get_yaxis_transform())
            bar.set_yticks([float(f"{level:.3g}") for level in levels])
        style.put_text(axes, 0.0, 1.03, name, colour=style.INK, fontsize=style.TEXT_PT, transform=axes.transAxes)
        style.label_axes(axes, style.CYCLES if n < 3 else "mesh cycles", "torque (N·m)" if axes is panels[0] else "")
    style.head(figure, title)
    return figure


def speed_sweep_figure(
    sweeps: Sequence[tuple[str, FloatArray, FloatArray, FloatArray]],
    *,
    natural_hz: float | None = None,
    jumps_hz: Mapping[str, float] | None = None,
    title: str = "",
) -> Figure:
    """Draw the rms of the dynamic transmission error over the mesh frequency; upward sweeps solid, downward dashed.

    Parameters
    ----------
    sweeps : sequence of (name, mesh_hz up, rms_m, …)
        Name of the case, mesh frequencies (n,), rms up (n,), rms down (n,) at the same frequencies, in m.
    natural_hz : float or None
        Marked together with its half and third.
    jumps_hz : mapping or None
        Name, e.g. "jump up" → frequency.
    title : str

    Returns
    -------
    Figure
    """
    style.check_number(len(sweeps), f"{len(sweeps)} sweeps")
    figure, (axes,) = style.panels((2.2,), top_in=0.85)
    lines = []
    for (name, mesh_hz, up, down), colour in zip(sweeps, style.series_colours(len(sweeps)), strict=True):
        x = style.checked_axis(mesh_hz, f"mesh_hz of {name}")
        rows = [style.checked_values(v, len(x), f"rms of {name}") * MICRO for v in (up, down)]
        lines += axes.plot(x, rows[0], color=colour, linewidth=1.5, label=name if len(sweeps) > 1 else "sweep up")
        falling = axes.plot(x, rows[1], color=colour, linewidth=1.3, linestyle=(0, (4, 2)), label="sweep down")
        lines += falling if len(sweeps) == 1 else []
    axes.set_xlim(min(float(s[1][0]) for s in sweeps), max(float(s[1][-1]) for s in sweeps))
    axes.set_ylim(bottom=0.0)
    natural = {} if natural_hz is None else {"ωₙ": natural_hz, "ωₙ/2": natural_hz / 2, "ωₙ/3": natural_hz / 3}
    for word, hertz in {**natural, **(jumps_hz or {})}.items():
        axes.axvline(hertz, color=style.FLOOR, linewidth=0.8, linestyle=(0, (3, 2)), zorder=1)
        style.write(axes, hertz, 1.01, word)
    style.label_axes(axes, "mesh frequency (Hz)", "dynamic transmission error, rms (µm)")
    style.head(figure, title, lines, "solid: up, dashed: down" if len(sweeps) > 1 else "")
    return figure


def speed_spectra_figure(
    frequency_hz: FloatArray,
    spectra_m: Mapping[str, FloatArray],
    *,
    mesh_hz: Sequence[float] = (),
    natural_hz: float | None = None,
    title: str = "",
) -> Figure:
    """Draw amplitude spectra of one quantity at several speeds in rows, on one logarithmic scale.

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
    x = style.checked_axis(frequency_hz, "frequency_hz")
    curves = style.checked_curves(spectra_m, len(x), "spectra_m")
    figure, panels = style.panels((0.97,) * len(curves), top_in=0.45, row_gap_in=0.08, share_x=True)
    largest_um = max(float(c.max()) for c in curves.values()) * MICRO
    floor = 1e-5 * largest_um  # five decades below the maximum amplitude
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
    style.head(figure, title)
    return figure


def frequency_curves_figure(
    mesh_cycles: FloatArray, frequencies_hz: FloatArray, uncoupled_hz: FloatArray | None = None, *, title: str = ""
) -> Figure:
    """Draw natural frequencies over the mesh angle, one curve each; those that hardly vary are pale.

    Parameters
    ----------
    mesh_cycles : array, (n_c,)
    frequencies_hz : array, (n_c, n)
        Ascending along the second axis.
    uncoupled_hz : array, (m,), or None
        Of the two sides without contact, which do not depend on the angle; drawn dashed.
    title : str

    Raises
    ------
    InputError
        If the number of rows differs from that of the mesh angles.
    """
    x = style.checked_axis(mesh_cycles, "mesh_cycles")
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
        word = "coupled, varies with the angle" if moves else "coupled, hardly varies"
        line[0].set_label(word)
        named.setdefault(word, line[0])
    for hertz in () if uncoupled_hz is None else frozen_array(uncoupled_hz, "uncoupled_hz", ndim=1):
        line = axes.plot(x[[0, -1]], [hertz / 1e3] * 2, color=style.FAULT, linewidth=0.9, linestyle=(0, (4, 3)))
        line[0].set_label("without contact")
        named.setdefault("without contact", line[0])
    axes.set_xlim(float(x[0]), float(x[-1]))
    axes.set_ylim(bottom=0.0)
    style.label_axes(axes, style.CYCLES, "natural frequency (kHz)")
    style.head(figure, title, () if uncoupled_hz is None else list(named.values()))
    return figure


# --------------------
# Response of a gear: time signal, spectrum, phase portrait and Poincaré section of several cases in rows.
# --------------------


@dataclass(frozen=True)
class ResponseCase:
    """One row of a response figure.

    Parameters
    ----------
    name : str
        E.g. "Rq 0.45 µm".
    time_s, displacement_m, velocity_mps : arrays, (n,)
        In steady state, with ascending time.
    frequency_hz, amplitude_m : arrays, (m,)
        Spectrum of the displacement, peak amplitudes.
    poincare_displacement_m, poincare_velocity_mps : arrays, (k,)
        State once per period (stroboscopic); may be empty.
    """

    name: str
    time_s: FloatArray
    displacement_m: FloatArray
    velocity_mps: FloatArray
    frequency_hz: FloatArray
    amplitude_m: FloatArray
    poincare_displacement_m: FloatArray
    poincare_velocity_mps: FloatArray

    def __post_init__(self) -> None:
        groups = (
            ("time_s", "displacement_m", "velocity_mps"),
            ("frequency_hz", "amplitude_m"),
            ("poincare_displacement_m", "poincare_velocity_mps"),
        )
        for group in groups:
            for field in group:
                object.__setattr__(self, field, frozen_array(getattr(self, field), f"{field} of {self.name!r}", ndim=1))
            lengths = {field: len(getattr(self, field)) for field in group}
            if len(set(lengths.values())) > 1:
                field_lengths = ", ".join(f"{field} {n}" for field, n in lengths.items())
                raise InputError(f"lengths of {self.name!r} differ: {field_lengths}", allowed="equal lengths")
        style.checked_axis(self.time_s, f"time_s of {self.name!r}")
        style.checked_axis(self.frequency_hz, f"frequency_hz of {self.name!r}")


def response_figure(
    cases: Sequence[ResponseCase],
    *,
    mesh_frequency_hz: float,
    limits_hz: tuple[float, float] = (0.0, 2000.0),
    n_periods: int = 20,
    lines_hz: Sequence[float] = (),
    title: str = "",
) -> Figure:
    """Draw one row per case: signal over time, spectrum, phase portrait with Poincaré points, and these enlarged.

    The axes of a column are the same in all rows, for comparison.

    Parameters
    ----------
    cases : sequence of ResponseCase
        1 to 8.
    mesh_frequency_hz : float
        Its harmonics are marked in the spectra.
    limits_hz : (float, float)
        Of the spectra.
    n_periods : int
        Mesh periods of the time signal to draw; the phase portrait shows all of them.
    lines_hz : sequence of float
        Other expected lines, e.g. of a fractal profile, as small marks along the top of the spectra.
    title : str
        Should say what moves, and in which direction.

    Returns
    -------
    Figure

    Raises
    ------
    InputError
        If there are no cases, or no line of a spectrum lies within the limits.
    """
    style.check_number(len(cases), f"{len(cases)} cases")
    mesh_hz = positive(mesh_frequency_hz, "mesh_frequency_hz", "Hz")
    count(n_periods, "n_periods")
    limits = style.checked_limits(limits_hz, "limits_hz")
    figure, panels = style.panels(
        (1.22,) * len(cases), (1.75, 1.9, 1.2, 1.17), left_in=0.7, top_in=0.62, row_gap_in=0.4, column_gap_in=0.71
    )
    rows = [panels[i : i + 4] for i in range(0, len(panels), 4)]
    for case, (time, spectrum, phase, section) in zip(cases, rows, strict=True):
        shown = case.time_s <= case.time_s[0] + n_periods / mesh_hz
        line = thin(case.time_s[shown], case.displacement_m[shown] * MICRO, 2000)
        time.plot(*line, color=style.MEASURED, linewidth=0.9)
        time.set_xlim(float(case.time_s[0]), float(case.time_s[0]) + n_periods / mesh_hz)
        style.label_axes(time, "", "displacement (µm)", case.name)

        inside = _inside(case, limits)
        for harmonic in range(1, int(limits[1] / mesh_hz) + 1):
            spectrum.axvline(harmonic * mesh_hz, color=style.MESH, linewidth=0.9, alpha=0.45, zorder=1)
        line = thin(case.frequency_hz[inside], np.maximum(case.amplitude_m[inside] * MICRO, 1e-12), 2000)
        spectrum.plot(*line, color=style.MEASURED, linewidth=0.8)
        spectrum.set_yscale("log")
        spectrum.set_xlim(*limits)
        expected = [hertz for hertz in lines_hz if limits[0] <= hertz <= limits[1]]
        marks = {"color": style.SHAFT, "markersize": 3.5, "linestyle": "none", "markeredgewidth": 0.0}
        heights = np.full(len(expected), 0.97)
        spectrum.plot(expected, heights, "v", transform=spectrum.get_xaxis_transform(), **marks)  # type: ignore[arg-type]
        style.label_axes(spectrum, "", "amplitude (µm)")

        path = (case.displacement_m * MICRO, case.velocity_mps * MILLI)
        phase.plot(*path, color=style.MEASURED, linewidth=0.5, alpha=0.35)
        for axes in (phase, section):
            style.label_axes(axes, "", "velocity (mm/s)")
        dots = (case.poincare_displacement_m * MICRO, case.poincare_velocity_mps * MILLI)
        for axes, size in ((phase, 2.4), (section, 2.0)):
            axes.plot(*dots, "o", color=style.FAULT, markersize=size, markeredgewidth=0.0, zorder=3)
    _give_columns_one_scale(rows, cases, limits)
    names = ("time (s)", "frequency (Hz)", "displacement (µm)", "displacement (µm)")
    for axes, name in zip(rows[-1], names, strict=True):
        style.label_axes(axes, name, axes.get_ylabel(), axes.get_title(loc="left"))
    _, spectrum, phase, section = rows[0]
    for harmonic in range(1, int(limits[1] / mesh_hz) + 1):
        if harmonic * mesh_hz > limits[0]:
            name = "mesh" if harmonic == 1 else f"{harmonic}×"
            style.write(spectrum, harmonic * mesh_hz, 1.02, name, colour=style.MESH)
    for axes, name in ((phase, "once per period"), (section, "these, enlarged")):
        axes.set_title(name, loc="right", color=style.FAULT, fontsize=style.SMALL_PT)
    style.head(figure, title)
    return figure


def _give_columns_one_scale(
    rows: Sequence[Sequence[Axes]], cases: Sequence[ResponseCase], limits: tuple[float, float]
) -> None:
    y, v = (np.concatenate(parts) for parts in ([c.displacement_m for c in cases], [c.velocity_mps for c in cases]))
    dots_y = np.concatenate([case.poincare_displacement_m for case in cases]) * MICRO
    dots_v = np.concatenate([case.poincare_velocity_mps for case in cases]) * MILLI
    lines = [case.amplitude_m[_inside(case, limits)] * MICRO for case in cases]
    top = max(float(amplitude.max()) for amplitude in lines) or 1.0
    # The floor: below most lines of the case with most lines, but at most six decades down.
    richest = max(float(np.median(amplitude)) for amplitude in lines)
    bottom = min(max(richest / 30.0, top * 1e-6), top / 10.0)
    for time, spectrum, phase, section in rows:
        time.set_ylim(*style.padded(y * MICRO))
        time.locator_params(axis="x", nbins=4)
        spectrum.set_ylim(bottom, 2.0 * top)
        phase.set_xlim(*style.padded(y * MICRO))
        phase.set_ylim(*style.padded(v * MILLI))
        if dots_y.size:
            section.set_xlim(*style.padded(dots_y))
            section.set_ylim(*style.padded(dots_v))
        for axes in (phase, section):
            axes.locator_params(nbins=4)
        for axes in (time, spectrum, phase, section):
            axes.tick_params(labelbottom=time is rows[-1][0])
            style.no_offset(axes)


def _inside(case: ResponseCase, limits: tuple[float, float]) -> np.ndarray[tuple[int, ...], np.dtype[np.bool_]]:
    inside = (case.frequency_hz >= limits[0]) & (case.frequency_hz <= limits[1]) & (case.frequency_hz > 0.0)
    if not inside.any():
        raise InputError(f"no line of {case.name!r} lies within {limits[0]:g} to {limits[1]:g} Hz", where="limits_hz")
    return np.asarray(inside)


def crack_comparison_figure(
    revolutions: FloatArray,
    acceleration_mps2: Mapping[str, FloatArray],
    *,
    impacts_rev: Sequence[float],
    n_teeth: int,
    change_mps2: Mapping[str, FloatArray] | None = None,
    reach_cycles: Mapping[str, float] | None = None,
    zoom_cycles: tuple[float, float] = (-3.0, 12.0),
    title: str = "",
) -> Figure:
    """Draw the acceleration over some revolutions, one row per crack depth, and a close view of one impact.

    The first case, the healthy gear, is the baseline.

    Parameters
    ----------
    revolutions : array, (n,)
        Of the cracked gear, ascending.
    acceleration_mps2 : mapping
        Name of the case → array, (n,).
    impacts_rev : sequence of float
        Where the cracked tooth enters the mesh; those on the axis are marked and the middle one is enlarged.
    n_teeth : int
        Of the cracked gear: mesh cycles per revolution.
    change_mps2 : mapping or None
        Name of the case → its acceleration minus that of the first case at the same angle, (n,), for all but the first.
        If given, close views show its magnitude on a logarithmic axis, and the magnitude of the first case's
        acceleration. None: they show the acceleration.
    reach_cycles : mapping or None
        Name of the case → mesh cycles from the entry over which the impact is noticeable; shaded.
    zoom_cycles : (float, float)
        Range of the close view, relative to the entry.
    title : str

    Returns
    -------
    Figure

    Raises
    ------
    InputError
        If no impact lies on the axis, or a change or reach names an unknown case.
    """
    x = style.checked_axis(revolutions, "revolutions")
    cases = style.checked_curves(acceleration_mps2, len(x), "acceleration_mps2")
    z = count(n_teeth, "n_teeth", minimum=3)
    limits = style.checked_limits(zoom_cycles, "zoom_cycles")
    marked = [float(at) for at in impacts_rev if x[0] <= at <= x[-1]]
    if not marked:
        raise InputError(
            f"no impact lies on the axis, {x[0]:g} to {x[-1]:g} revolutions",
            where="impacts_rev",
            remedy="give at least one revolution of signal with the cracked tooth in it",
        )
    for parameter, value in (("change_mps2", change_mps2), ("reach_cycles", reach_cycles)):
        if unknown := set(value or ()) - set(cases):
            raise InputError(f"{parameter} names {min(unknown)!r}", allowed=", ".join(cases))
    changes = style.checked_curves(change_mps2, len(x), "change_mps2") if change_mps2 else {}
    cycles = (x - marked[len(marked) // 2]) * z
    near = (cycles >= limits[0]) & (cycles <= limits[1])
    if np.count_nonzero(near) < 2:
        raise InputError("zoom_cycles holds fewer than two points", remedy="give a wider view or a finer axis")
    largest = max(float(np.max(np.abs(values))) for values in cases.values()) or 1.0
    closest = max(float(np.max(np.abs(values[near]))) for values in cases.values()) or 1.0
    figure, panels = style.panels((1.08,) * len(cases), (3.95, 3.25), top_in=0.62, row_gap_in=0.32, column_gap_in=0.85)
    for i, (name, values) in enumerate(cases.items()):
        whole, close = panels[2 * i : 2 * i + 2]
        for at in marked:
            whole.axvline(at, color=style.FAULT, linewidth=0.9, linestyle="--", zorder=1)
        whole.plot(*thin(x, values, 1600), color=style.MEASURED, linewidth=0.6)
        whole.set_xlim(float(x[0]), float(x[-1]))
        whole.set_ylim(-1.08 * largest, 1.08 * largest)
        style.label_axes(whole, "", "a (m/s²)", name)
        close.axvline(0.0, color=style.FAULT, linewidth=0.9, linestyle="--", zorder=1)
        close.set_xlim(*limits)
        if changes:
            # A change of zero is drawn below any axis: a logarithm needs a lower bound.
            size = np.maximum(np.abs(changes.get(name, values)[near]), 1e-12)
            close.plot(cycles[near], size, color=style.FAULT if name in changes else style.MEASURED, linewidth=0.9)
            style.label_axes(close, "", "|change| (m/s²)" if name in changes else "|a| (m/s²)")
            close.set_yscale("log")
            close.set_ylim(closest * 10.0**-3.5, 2.0 * closest)
        else:
            close.plot(cycles[near], values[near], color=style.MEASURED, linewidth=0.9)
            close.set_ylim(-1.08 * closest, 1.08 * closest)
        if (reach := (reach_cycles or {}).get(name, 0.0)) > 0.0:
            style.shade(close, (0.0, reach), style.FAULT, 0.12)
            style.write(close, limits[1], 1.02, f"noticeable for {reach:.1f} cycles", colour=style.FAULT, ha="right")
        for axes in (whole, close):
            axes.tick_params(labelbottom=i == len(cases) - 1)
            style.no_offset(axes)
    for axes, label in zip(
        panels[-2:], ("revolutions of the cracked gear", "mesh cycles since the cracked tooth's entry"), strict=True
    ):
        axes.set_xlabel(label, color=style.INK, fontsize=style.TEXT_PT)
    style.write(panels[0], marked[len(marked) // 2], 1.02, "cracked tooth enters", colour=style.FAULT)
    style.head(figure, title)
    return figure
