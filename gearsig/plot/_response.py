"""How a gear answers: time signal, spectrum, phase portrait and Poincaré section of several cases below each other."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from gearsig.checks import FloatArray, count, frozen_array, positive
from gearsig.errors import InputError
from gearsig.plot import _series as series
from gearsig.plot import _style as style
from gearsig.plot._series import thin
from gearsig.plot._style import MICRO, MILLI

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class ResponseCase:
    """One row of a response figure.

    Parameters
    ----------
    name : str
        E.g. "Rq 0.45 µm".
    time_s, displacement_m, velocity_mps : arrays, (n,)
        In the steady state; time ascending.
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
        series.checked_axis(self.time_s, f"time_s of {self.name!r}")
        series.checked_axis(self.frequency_hz, f"frequency_hz of {self.name!r}")


def response_figure(
    cases: Sequence[ResponseCase],
    *,
    mesh_frequency_hz: float,
    limits_hz: tuple[float, float] = (0.0, 2000.0),
    n_periods: int = 20,
    lines_hz: Sequence[float] = (),
    title: str = "",
) -> Figure:
    """Draw one row per case: signal over time, spectrum, phase portrait with the Poincaré points, and these enlarged.

    Axes of a column are alike in all rows, so that rows compare.

    Parameters
    ----------
    cases : sequence of ResponseCase
        1 to 8.
    mesh_frequency_hz : float
        Its harmonics are marked in the spectra.
    limits_hz : (float, float)
        Of the spectra.
    n_periods : int
        Mesh periods of the time signal that are drawn; the phase portrait has all of it.
    lines_hz : sequence of float
        Other expected lines, e.g. of a fractal profile: small marks along the top of the spectra.
    title : str
        Says what moves, and which way.

    Returns
    -------
    Figure

    Raises
    ------
    InputError
        Without cases, or if no line of a spectrum lies inside the limits.
    """
    series.check_number(len(cases), f"{len(cases)} cases")
    mesh_hz = positive(mesh_frequency_hz, "mesh_frequency_hz", "Hz")
    count(n_periods, "n_periods")
    limits = series.checked_limits(limits_hz, "limits_hz")
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
            series.write(spectrum, harmonic * mesh_hz, 1.02, name, colour=style.MESH)
    for axes, name in ((phase, "once per period"), (section, "these, enlarged")):
        axes.set_title(name, loc="right", color=style.FAULT, fontsize=style.SMALL_PT)
    series.head(figure, title)
    return figure


def _give_columns_one_scale(
    rows: Sequence[Sequence[Axes]], cases: Sequence[ResponseCase], limits: tuple[float, float]
) -> None:
    y, v = (np.concatenate(parts) for parts in ([c.displacement_m for c in cases], [c.velocity_mps for c in cases]))
    dots_y = np.concatenate([case.poincare_displacement_m for case in cases]) * MICRO
    dots_v = np.concatenate([case.poincare_velocity_mps for case in cases]) * MILLI
    lines = [case.amplitude_m[_inside(case, limits)] * MICRO for case in cases]
    top = max(float(amplitude.max()) for amplitude in lines) or 1.0
    # The floor: what most lines of the richest case lie above, at most six decades down.
    richest = max(float(np.median(amplitude)) for amplitude in lines)
    bottom = min(max(richest / 30.0, top * 1e-6), top / 10.0)
    for time, spectrum, phase, section in rows:
        time.set_ylim(*series.padded(y * MICRO))
        time.locator_params(axis="x", nbins=4)
        spectrum.set_ylim(bottom, 2.0 * top)
        phase.set_xlim(*series.padded(y * MICRO))
        phase.set_ylim(*series.padded(v * MILLI))
        if dots_y.size:
            section.set_xlim(*series.padded(dots_y))
            section.set_ylim(*series.padded(dots_v))
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

    The first case is the one to compare with: the healthy gear.

    Parameters
    ----------
    revolutions : array, (n,)
        Of the cracked gear, ascending.
    acceleration_mps2 : mapping
        Name of the case → array, (n,).
    impacts_rev : sequence of float
        Where the cracked tooth enters the mesh; those on the axis are marked, the middle one is enlarged.
    n_teeth : int
        Of the cracked gear: mesh cycles per revolution.
    change_mps2 : mapping or None
        Name of the case → its acceleration less that of the first case at the same angle, (n,), for all but the first.
        Given: close views show its magnitude on a logarithmic axis, and that of the first case's acceleration itself.
        None: they show the acceleration.
    reach_cycles : mapping or None
        Name of the case → mesh cycles from the entry over which the impact is felt; shaded.
    zoom_cycles : (float, float)
        Close view, from the entry.
    title : str

    Returns
    -------
    Figure

    Raises
    ------
    InputError
        If no impact lies on the axis, or a change or reach names a case that is not there.
    """
    x = series.checked_axis(revolutions, "revolutions")
    cases = series.checked_curves(acceleration_mps2, len(x), "acceleration_mps2")
    z = count(n_teeth, "n_teeth", minimum=3)
    limits = series.checked_limits(zoom_cycles, "zoom_cycles")
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
    changes = series.checked_curves(change_mps2, len(x), "change_mps2") if change_mps2 else {}
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
            # A change of nothing is drawn below every axis: a logarithm needs a bottom.
            size = np.maximum(np.abs(changes.get(name, values)[near]), 1e-12)
            close.plot(cycles[near], size, color=style.FAULT if name in changes else style.MEASURED, linewidth=0.9)
            style.label_axes(close, "", "|change| (m/s²)" if name in changes else "|a| (m/s²)")
            close.set_yscale("log")
            close.set_ylim(closest * 10.0**-3.5, 2.0 * closest)
        else:
            close.plot(cycles[near], values[near], color=style.MEASURED, linewidth=0.9)
            close.set_ylim(-1.08 * closest, 1.08 * closest)
        if (reach := (reach_cycles or {}).get(name, 0.0)) > 0.0:
            series.shade(close, (0.0, reach), style.FAULT, 0.12)
            series.write(close, limits[1], 1.02, f"felt for {reach:.1f} cycles", colour=style.FAULT, ha="right")
        for axes in (whole, close):
            axes.tick_params(labelbottom=i == len(cases) - 1)
            style.no_offset(axes)
    for axes, label in zip(
        panels[-2:], ("revolutions of the cracked gear", "mesh cycles since the cracked tooth's entry"), strict=True
    ):
        axes.set_xlabel(label, color=style.INK, fontsize=style.TEXT_PT)
    series.write(panels[0], marked[len(marked) // 2], 1.02, "cracked tooth enters", colour=style.FAULT)
    series.head(figure, title)
    return figure
