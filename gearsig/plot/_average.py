"""Synchronous averages over the angle, in straight and polar figures."""

from __future__ import annotations

from collections.abc import Sequence
from math import floor, log10
from typing import TYPE_CHECKING, Any

import numpy as np

from gearsig.checks import FloatArray, count, listed
from gearsig.formatting import unit_text
from gearsig.orders import SynchronousAverage, check_average
from gearsig.plot import _style as style
from gearsig.plot._cursors import AngleMark
from gearsig.plot._style import plain, thin, with_unit

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.projections.polar import PolarAxes


def average_figure(
    averages: Sequence[SynchronousAverage], *, n_teeth: int | None = None, marks: Sequence[AngleMark] = ()
) -> Figure:
    """Draw averages of one shaft in rows over the angle, with bands of ± 2 standard errors.

    Parameters
    ----------
    averages : sequence of SynchronousAverage
        E.g. average and residual; at least one.
    n_teeth : int or None
        Draw a tick per tooth.
    marks : sequence of AngleMark

    Returns
    -------
    Figure
    """
    for number, average in enumerate(listed(averages, "averages", object)):
        check_average(average, f"averages[{number}]")
    n = len(averages)
    figure, panels = style.panels((1.37,) * n, top_in=0.43, row_gap_in=0.38, share_x=True)
    for axes, average in zip(panels, averages, strict=True):
        _draw(axes, average)
        for mark in marks:
            axes.axvline(mark.angle_deg, color=style.FAULT, linewidth=0.9, linestyle="--", zorder=1.5)
        shaft = f", shaft {average.shaft}" if average.shaft else ""
        title = f"{average.kind}{shaft}, channel {average.channel}, {average.n_revolutions} revolutions"
        x = f"angle of {average.shaft or 'the shaft'} (deg)" if axes is panels[-1] else ""
        style.label_axes(axes, x, with_unit("amplitude", average.unit), title)
        style.no_offset(axes)
    first = panels[0]
    first.set_xlim(0, 360)
    first.set_xticks(range(0, 361, 45))
    if n_teeth:
        first.set_xticks(np.arange(n_teeth + 1) * 360.0 / n_teeth, minor=True)
    for mark in marks:
        _name(first, mark)
    return figure


def _draw(axes: Axes, average: SynchronousAverage) -> None:
    n = len(average.values)
    angle = np.arange(n) * 360.0 / n
    axes.axhline(0, color=style.QUIET, linewidth=0.6, zorder=1)
    step = max(1, n // 1500)
    low, high = average.values - 2 * average.standard_error, average.values + 2 * average.standard_error
    axes.fill_between(angle[::step], low[::step], high[::step], color=style.FLOOR, alpha=0.4, linewidth=0, zorder=2)
    axes.plot(*thin(angle, average.values), color=style.MEASURED, linewidth=0.9, zorder=3)


def _name(axes: Axes, mark: AngleMark) -> None:
    axes.annotate(
        plain(mark.label, 24),
        (mark.angle_deg, 1.0),
        xycoords=("data", "axes fraction"),
        xytext=(4 if mark.angle_deg < 300 else -4, -1),
        textcoords="offset points",
        ha="left" if mark.angle_deg < 300 else "right",
        va="top",
        fontsize=style.SMALL_PT,
        fontweight="bold",
        color=style.FAULT,
        zorder=5,
        bbox={"facecolor": "white", "edgecolor": "none", "pad": 1.0, "alpha": 0.85},
        parse_math=False,
    )


# Radii of the picture, in its own units: zero of the signal, its maximum swing, and the gear outside.
ZERO, SWING, ROOT, TIP, NUMBERS, LABELS, EDGE = 1.0, 0.55, 1.66, 1.81, 1.93, 2.22, 2.36


def polar_figure(
    average: SynchronousAverage,
    *,
    n_teeth: int | None = None,
    marks: Sequence[AngleMark] = (),
    largest: float | None = None,
    numbered: bool = True,
) -> Figure:
    """Draw one mean revolution around the circle with its band of ± 2 standard errors.

    The angle runs clockwise from the top, where the average and tooth 1 start. Outwards is positive.

    Parameters
    ----------
    average : SynchronousAverage
        Usually the residual or difference signal, in which a single tooth stands out.
    n_teeth : int or None
        Draw the teeth.
    marks : sequence of AngleMark
        Drawn in the fault colour, with their tooth.
    largest : float or None
        Value drawn at full swing, for pictures to be compared; None: the maximum of this average.
    numbered : bool
        Whether to number the teeth; a shaft without a reference mark has no tooth numbers.

    Returns
    -------
    Figure
    """
    check_average(average)
    if n_teeth is not None:
        count(n_teeth, "n_teeth", minimum=3)
    size_in = 5.4
    figure = style.new_figure(size_in, size_in)
    axes = style.polar_panel(figure)
    full = largest or float(np.max(np.abs(average.values) + 2 * average.standard_error, initial=0.0)) or 1.0
    _rings(axes, full, average.unit)
    _draw_signal(axes, average, SWING / full)
    if n_teeth:
        draw_gear(axes, n_teeth, [mark.angle_deg for mark in marks], numbered=numbered)
    draw_degrees(axes, n_teeth is not None)
    for number, mark in enumerate(marks):
        draw_mark(axes, mark, n_teeth)
        write_corner(axes, mark.label, 0.985 - number * 0.2 / size_in, style.FAULT, "bold")
    write_corner(axes, f"{average.n_revolutions} revolutions", 0.05, style.QUIET)
    write_corner(axes, average.channel, 0.05 + 0.2 / size_in, style.QUIET)
    _middle(axes, average)
    axes.set_ylim(0, EDGE)
    return figure


def _draw_signal(axes: PolarAxes, average: SynchronousAverage, scale: float) -> None:
    turn = np.arange(len(average.values) + 1) * 2 * np.pi / len(average.values)
    values = np.append(average.values, average.values[0])
    band = 2 * np.append(average.standard_error, average.standard_error[0])
    step = max(1, len(turn) // 1500)
    chosen = np.unique(np.append(np.arange(0, len(turn), step), len(turn) - 1))
    low, high = np.maximum(ZERO + scale * (values - band), 0.0), np.maximum(ZERO + scale * (values + band), 0.0)
    axes.fill_between(turn[chosen], low[chosen], high[chosen], color=style.FLOOR, alpha=0.35, linewidth=0, zorder=2)
    angle, radius = thin(turn, np.maximum(ZERO + scale * values, 0.0), 3000)
    axes.plot(angle, radius, color=style.MEASURED, linewidth=1.0, zorder=3)


def _rings(axes: PolarAxes, full: float, unit: str) -> None:
    """Draw rings at zero and at one round value on each side of it."""
    ring = np.linspace(0, 2 * np.pi, 361)
    axes.plot(ring, np.full_like(ring, ZERO), color=style.QUIET, linewidth=0.7, zorder=1)
    value = _round_below(full)
    for sign in (1, -1):
        radius = ZERO + sign * SWING * value / full
        axes.plot(ring, np.full_like(ring, radius), color=style.RULE, linewidth=0.9, zorder=1)
        text = f"{'+' if sign > 0 else '−'}{value:g} {unit_text(unit)}".strip()
        box = {"facecolor": "white", "edgecolor": "none", "pad": 0.8, "alpha": 0.8}
        looks: dict[str, Any] = {"fontsize": style.SMALL_PT - 1, "ha": "center", "va": "center", "bbox": box}
        style.put_text(axes, np.pi * 1.25, radius, text, n_max=24, zorder=4, **looks)


def _round_below(value: float) -> float:
    """Return the largest number 1, 2 or 5 × 10ⁿ that does not exceed `value`."""
    power = 10.0 ** floor(log10(value))
    return max(step * power for step in (1, 2, 5) if step * power <= value * (1 + 1e-12))


def draw_gear(axes: PolarAxes, n_teeth: int, marked_deg: Sequence[float], *, numbered: bool = True) -> None:
    """Draw the toothed rim, with marked teeth in the fault colour; `numbered` needs a reference mark on the shaft."""
    damaged = {int(angle % 360.0 * n_teeth / 360.0) for angle in marked_deg}
    every = next(step for step in (1, 2, 5, 10, 20, 50, 100, 10_000) if n_teeth / step <= 45)
    ring = np.linspace(0, 2 * np.pi, 361)
    axes.plot(ring, np.full_like(ring, ROOT), color=style.FLOOR, linewidth=0.8, zorder=1)
    for tooth in range(n_teeth):
        # A tooth is half a pitch wide at the root and centred in its pitch.
        corners = (tooth + np.array([0.22, 0.36, 0.64, 0.78])) * 2 * np.pi / n_teeth
        radii: FloatArray = np.array([ROOT, TIP, TIP, ROOT])
        hit = tooth in damaged
        colour = style.FAULT if hit else style.FLOOR
        axes.fill(corners, radii, facecolor=colour, alpha=1.0 if hit else 0.35, edgecolor=colour, linewidth=0.6)
        if numbered and ((tooth + 1) % every == 0 or tooth == 0 or hit):
            axes.text(
                (tooth + 0.5) * 2 * np.pi / n_teeth,
                NUMBERS,
                str(tooth + 1),
                ha="center",
                va="center",
                fontsize=style.SMALL_PT - (0 if n_teeth <= 45 else 1),
                color=style.FAULT if hit else style.QUIET,
                fontweight="bold" if hit else "normal",
            )


def draw_degrees(axes: PolarAxes, has_teeth: bool) -> None:
    """Draw and label rays at each quarter of a revolution."""
    inner, outer, at = (0.32, ROOT, LABELS) if has_teeth else (0.32, ROOT, 1.8)
    for degrees in range(0, 360, 90):
        axes.plot([np.radians(degrees)] * 2, [inner, outer], color=style.RULE, linewidth=0.7, zorder=0)
        axes.text(
            np.radians(degrees), at, f"{degrees}°", ha="center", va="center", fontsize=style.SMALL_PT, color=style.INK
        )


def draw_mark(axes: PolarAxes, mark: AngleMark, n_teeth: int | None) -> None:
    """Shade the marked tooth's sector and draw a ray at its angle."""
    angle = np.radians(mark.angle_deg)
    half = np.pi / n_teeth if n_teeth else np.radians(4.0)
    middle = (floor(mark.angle_deg % 360.0 * n_teeth / 360.0) + 0.5) * 2 * np.pi / n_teeth if n_teeth else angle
    sector = np.linspace(middle - half, middle + half, 20)
    axes.fill_between(sector, 0.32, ROOT, color=style.FAULT, alpha=0.14, linewidth=0, zorder=0.5)
    axes.plot([angle, angle], [0.32, ROOT], color=style.FAULT, linewidth=0.9, linestyle="--", zorder=1.5)


def write_corner(axes: PolarAxes, text: str, height: float, colour: str, weight: str = "normal") -> None:
    """Write into the left corners, outside the teeth."""
    looks: dict[str, Any] = {"fontsize": style.TEXT_PT, "fontweight": weight, "ha": "left", "va": "top"}
    style.put_text(axes, 0.0, height, text, colour=colour, n_max=24, transform=axes.transAxes, **looks)


def _middle(axes: PolarAxes, average: SynchronousAverage) -> None:
    """Write in the middle what is drawn."""
    text = f"{average.kind}\n{plain(average.shaft, 12)}"
    axes.text(0, 0, text, ha="center", va="center", fontsize=style.SMALL_PT, color=style.INK, parse_math=False)
