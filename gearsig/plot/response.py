"""How a gear answers: time signal, spectrum, phase portrait and Poincaré section of several cases below each other."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from gearsig.checks import FloatArray, count, frozen_array, positive
from gearsig.errors import InputError
from gearsig.plot import series, style
from gearsig.plot.thin import thin

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
