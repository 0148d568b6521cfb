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

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    Row = tuple[Axes, Axes, Axes, Axes]


MICRO, MILLI = 1e6, 1e3
ROW_IN, TOP_IN, BOTTOM_IN = 1.62, 0.62, 0.52
LEFTS_IN, WIDTHS_IN = (0.7, 3.12, 5.72, 7.68), (1.75, 1.9, 1.2, 1.17)
COLUMNS = ("time (s)", "frequency (Hz)", "displacement (µm)", "displacement (µm)")
PANEL_IN = 1.22
MOST_CASES = 8


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
                found = ", ".join(f"{field} {n}" for field, n in lengths.items())
                raise InputError(f"lengths of {self.name!r} differ: {found}", allowed="equal lengths")
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
    if not 1 <= len(cases) <= MOST_CASES:
        raise InputError(f"{len(cases)} cases", allowed=f"1 to {MOST_CASES}")
    mesh_hz = positive(mesh_frequency_hz, "mesh_frequency_hz", "Hz")
    count(n_periods, "n_periods")
    low_high = series.checked_limits(limits_hz, "limits_hz")
    height = TOP_IN + BOTTOM_IN + ROW_IN * len(cases) - (ROW_IN - PANEL_IN)
    figure = style.new_figure(height)
    rows = [_row(figure, height - TOP_IN - PANEL_IN - i * ROW_IN) for i in range(len(cases))]
    for case, (time, spectrum, phase, section) in zip(cases, rows, strict=True):
        _draw_time(time, case, n_periods / mesh_hz)
        _draw_spectrum(spectrum, case, low_high, mesh_hz)
        _mark_lines(spectrum, [line for line in lines_hz if low_high[0] <= line <= low_high[1]])
        _draw_phase(phase, case)
        style.label_axes(time, "", "displacement (µm)", case.name)
        style.label_axes(spectrum, "", "amplitude (µm)")
        _draw_section(section, case, 2.0)
        style.label_axes(phase, "", "velocity (mm/s)")
    _align(rows, cases, low_high)
    for axes, name in zip(rows[-1], COLUMNS, strict=True):
        style.label_axes(axes, name, axes.get_ylabel(), axes.get_title(loc="left"))
    _name_columns(rows[0], mesh_hz, low_high)
    series.headline(figure, title)
    return figure


def _row(figure: Figure, bottom_in: float) -> Row:
    height = figure.get_size_inches()[1]
    time, spectrum, phase, section = (
        style.panel(
            figure,
            left_in=left,
            right_in=style.WIDTH_IN - left - width,
            bottom_in=bottom_in,
            top_in=height - bottom_in - PANEL_IN,
        )
        for left, width in zip(LEFTS_IN, WIDTHS_IN, strict=True)
    )
    return time, spectrum, phase, section


def _draw_time(axes: Axes, case: ResponseCase, duration_s: float) -> None:
    shown = case.time_s <= case.time_s[0] + duration_s
    axes.plot(*thin(case.time_s[shown], case.displacement_m[shown] * MICRO, 2000), color=style.MEASURED, linewidth=0.9)
    axes.set_xlim(float(case.time_s[0]), float(case.time_s[0]) + duration_s)
    axes.locator_params(axis="x", nbins=4)


def _draw_spectrum(axes: Axes, case: ResponseCase, limits: tuple[float, float], mesh_hz: float) -> None:
    inside = _inside(case, limits)
    for harmonic in np.arange(1, int(limits[1] / mesh_hz) + 1):
        axes.axvline(harmonic * mesh_hz, color=style.MESH, linewidth=0.9, alpha=0.45, zorder=1)
    amplitude = np.maximum(case.amplitude_m[inside] * MICRO, 1e-12)
    axes.plot(*thin(case.frequency_hz[inside], amplitude, 2000), color=style.MEASURED, linewidth=0.8)
    axes.set_yscale("log")
    axes.set_xlim(*limits)


def _mark_lines(axes: Axes, lines_hz: Sequence[float]) -> None:
    looks = {"color": style.SHAFT, "markersize": 3.5, "linestyle": "none", "markeredgewidth": 0.0}
    transform = axes.get_xaxis_transform()
    axes.plot(lines_hz, np.full(len(lines_hz), 0.97), "v", transform=transform, **looks)  # type: ignore[arg-type]


def _draw_phase(axes: Axes, case: ResponseCase) -> None:
    looks = {"color": style.MEASURED, "linewidth": 0.5, "alpha": 0.35}
    axes.plot(case.displacement_m * MICRO, case.velocity_mps * MILLI, **looks)  # type: ignore[arg-type]
    _draw_section(axes, case, 2.4)


def _draw_section(axes: Axes, case: ResponseCase, size: float) -> None:
    looks = {"color": style.FAULT, "markersize": size, "markeredgewidth": 0.0, "zorder": 3}
    points = (case.poincare_displacement_m * MICRO, case.poincare_velocity_mps * MILLI)
    axes.plot(*points, "o", **looks)  # type: ignore[arg-type]


def _inside(case: ResponseCase, limits: tuple[float, float]) -> np.ndarray[tuple[int, ...], np.dtype[np.bool_]]:
    inside = (case.frequency_hz >= limits[0]) & (case.frequency_hz <= limits[1]) & (case.frequency_hz > 0.0)
    if not inside.any():
        raise InputError(f"no line of {case.name!r} lies within {limits[0]:g} to {limits[1]:g} Hz", where="limits_hz")
    return np.asarray(inside)


def _align(rows: Sequence[Row], cases: Sequence[ResponseCase], limits: tuple[float, float]) -> None:
    """Give every column one scale, and numbers below the last row only."""
    y = np.concatenate([case.displacement_m for case in cases]) * MICRO
    v = np.concatenate([case.velocity_mps for case in cases]) * MILLI
    peaks = np.concatenate([case.amplitude_m[_inside(case, limits)] for case in cases]) * MICRO
    top = float(peaks.max()) or 1.0
    # The floor: what most lines of the richest case lie above, at most six decades down.
    richest = max(float(np.median(case.amplitude_m[_inside(case, limits)])) for case in cases) * MICRO
    bottom = min(max(richest / 30.0, top * 1e-6), top / 10.0)
    dots_y = np.concatenate([case.poincare_displacement_m for case in cases]) * MICRO
    dots_v = np.concatenate([case.poincare_velocity_mps for case in cases]) * MILLI
    for time, spectrum, phase, section in rows:
        time.set_ylim(*_padded(y))
        spectrum.set_ylim(bottom, 2.0 * top)
        phase.set_xlim(*_padded(y))
        phase.set_ylim(*_padded(v))
        if dots_y.size:
            section.set_xlim(*_padded(dots_y))
            section.set_ylim(*_padded(dots_v))
        phase.locator_params(nbins=4)
        section.locator_params(nbins=4)
        last = time is rows[-1][0]
        for axes in (time, spectrum, phase, section):
            axes.tick_params(labelbottom=last)
            style.no_offset(axes)


def _padded(values: FloatArray) -> tuple[float, float]:
    low, high = float(values.min()), float(values.max())
    margin = 0.06 * (high - low) or 1.0
    return low - margin, high + margin


def _name_columns(first: Row, mesh_hz: float, limits: tuple[float, float]) -> None:
    _, spectrum, phase, section = first
    for harmonic in range(1, int(limits[1] / mesh_hz) + 1):
        if harmonic * mesh_hz > limits[0]:
            name = "mesh" if harmonic == 1 else f"{harmonic}×"
            series.write(spectrum, harmonic * mesh_hz, 1.02, name, colour=style.MESH)
    for axes, name in ((phase, "once per period"), (section, "these, enlarged")):
        axes.set_title(name, loc="right", color=style.FAULT, fontsize=style.SMALL_PT)


# --------------------
# Acceleration at several crack depths: the impact once per revolution, and how far it reaches.
# --------------------


CRACK_ROW_IN, CRACK_PANEL_IN, CRACK_TOP_IN, CRACK_BOTTOM_IN = 1.4, 1.08, 0.62, 0.52
CRACK_LEFTS_IN, CRACK_WIDTHS_IN = (0.75, 5.55), (3.95, 3.25)
LEAST_MPS2 = 1e-12
"""A change of nothing is drawn here, below every axis: a logarithm needs a bottom."""
N_POINTS = 1600
"""Four per pixel column."""
DECADES = 10.0**-3.5


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

    The first case is the one to compare with: the sound gear.

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
    marked = _marked(impacts_rev, x)
    reach, change = dict(reach_cycles or {}), dict(change_mps2 or {})
    _check_names(change, cases, "change_mps2")
    shown = series.checked_curves(change, len(x), "change_mps2") if change else {}
    _check_names(reach, cases, "reach_cycles")
    cycles = (x - marked[len(marked) // 2]) * z
    near = (cycles >= limits[0]) & (cycles <= limits[1])
    if np.count_nonzero(near) < 2:
        raise InputError("zoom_cycles holds fewer than two points", remedy="give a wider view or a finer axis")
    height = CRACK_TOP_IN + CRACK_BOTTOM_IN + CRACK_ROW_IN * len(cases) - (CRACK_ROW_IN - CRACK_PANEL_IN)
    figure = style.new_figure(height)
    rows = [_row_crack(figure, height - CRACK_TOP_IN - CRACK_PANEL_IN - i * CRACK_ROW_IN) for i in range(len(cases))]
    for (name, values), (whole, close) in zip(cases.items(), rows, strict=True):
        _draw_whole(whole, x, values, marked)
        style.label_axes(whole, "", "a (m/s²)", name)
        if shown:
            _draw_magnitude(close, cycles[near], shown.get(name, values)[near], changed=name in shown)
        else:
            close.plot(cycles[near], values[near], color=style.MEASURED, linewidth=0.9)
        _mark_reach(close, reach.get(name, 0.0), limits)
    _finish(rows, cases, near, logarithmic=bool(shown))
    series.write(rows[0][0], marked[len(marked) // 2], 1.02, "cracked tooth enters", colour=style.FAULT)
    series.headline(figure, title)
    return figure


def _marked(impacts_rev: Sequence[float], x: FloatArray) -> list[float]:
    marked = [float(at) for at in impacts_rev if x[0] <= at <= x[-1]]
    if not marked:
        raise InputError(
            f"no impact lies on the axis, {x[0]:g} to {x[-1]:g} revolutions",
            where="impacts_rev",
            remedy="give at least one revolution of signal with the cracked tooth in it",
        )
    return marked


def _check_names(given: Mapping[str, object], cases: Mapping[str, FloatArray], parameter: str) -> None:
    for name in given:
        if name not in cases:
            raise InputError(f"{parameter} names {name!r}", allowed=", ".join(cases))


def _row_crack(figure: Figure, bottom_in: float) -> tuple[Axes, Axes]:
    height = figure.get_size_inches()[1]
    whole, close = (
        style.panel(
            figure,
            left_in=left,
            right_in=style.WIDTH_IN - left - width,
            bottom_in=bottom_in,
            top_in=height - bottom_in - CRACK_PANEL_IN,
        )
        for left, width in zip(CRACK_LEFTS_IN, CRACK_WIDTHS_IN, strict=True)
    )
    return whole, close


def _draw_whole(axes: Axes, x: FloatArray, values: FloatArray, marked: Sequence[float]) -> None:
    for at in marked:
        axes.axvline(at, color=style.FAULT, linewidth=0.9, linestyle="--", zorder=1)
    axes.plot(*thin(x, values, N_POINTS), color=style.MEASURED, linewidth=0.6)
    axes.set_xlim(float(x[0]), float(x[-1]))


def _mark_reach(axes: Axes, reach: float, limits: tuple[float, float]) -> None:
    axes.axvline(0.0, color=style.FAULT, linewidth=0.9, linestyle="--", zorder=1)
    axes.set_xlim(*limits)
    if reach > 0.0:
        series.shade(axes, (0.0, reach), style.FAULT, 0.12)
        series.write(axes, limits[1], 1.02, f"felt for {reach:.1f} cycles", colour=style.FAULT, ha="right")


def _draw_magnitude(axes: Axes, cycles: FloatArray, values: FloatArray, *, changed: bool) -> None:
    colour = style.FAULT if changed else style.MEASURED
    axes.plot(cycles, np.maximum(np.abs(values), LEAST_MPS2), color=colour, linewidth=0.9)
    style.label_axes(axes, "", "|change| (m/s²)" if changed else "|a| (m/s²)")


def _finish(
    rows: Sequence[tuple[Axes, Axes]],
    cases: Mapping[str, FloatArray],
    near: np.ndarray[tuple[int, ...], np.dtype[np.bool_]],
    *,
    logarithmic: bool,
) -> None:
    """Give each column one scale, and name the axes below the last row."""
    largest = max(float(np.max(np.abs(values))) for values in cases.values()) or 1.0
    closest = max(float(np.max(np.abs(values[near]))) for values in cases.values()) or 1.0
    for whole, close in rows:
        whole.set_ylim(-1.08 * largest, 1.08 * largest)
        if logarithmic:
            close.set_yscale("log")
        close.set_ylim(*((closest * DECADES, 2.0 * closest) if logarithmic else (-1.08 * closest, 1.08 * closest)))
        for axes in (whole, close):
            axes.tick_params(labelbottom=whole is rows[-1][0])
            style.no_offset(axes)
    whole, close = rows[-1]
    whole.set_xlabel("revolutions of the cracked gear", color=style.INK, fontsize=style.TEXT_PT)
    close.set_xlabel("mesh cycles since the cracked tooth's entry", color=style.INK, fontsize=style.TEXT_PT)
