"""Acceleration at several crack depths: the impact once per revolution, and how far it reaches."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from gearsig.checks import FloatArray, count
from gearsig.errors import InputError
from gearsig.plot import series, style
from gearsig.plot.thin import thin

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

ROW_IN, PANEL_IN, TOP_IN, BOTTOM_IN = 1.4, 1.08, 0.62, 0.52
LEFTS_IN, WIDTHS_IN = (0.75, 5.55), (3.95, 3.25)
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
    height = TOP_IN + BOTTOM_IN + ROW_IN * len(cases) - (ROW_IN - PANEL_IN)
    figure = style.new_figure(height)
    rows = [_row(figure, height - TOP_IN - PANEL_IN - i * ROW_IN) for i in range(len(cases))]
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


def _row(figure: Figure, bottom_in: float) -> tuple[Axes, Axes]:
    height = figure.get_size_inches()[1]
    whole, close = (
        style.panel(
            figure,
            left_in=left,
            right_in=style.WIDTH_IN - left - width,
            bottom_in=bottom_in,
            top_in=height - bottom_in - PANEL_IN,
        )
        for left, width in zip(LEFTS_IN, WIDTHS_IN, strict=True)
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
