"""Energy tooth by tooth around a shaft, measured against simulated."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from gearsig.checks import FloatArray
from gearsig.gap.curve_types import AngleCurves
from gearsig.plot import series, style
from gearsig.plot.display import plain
from gearsig.plot.marks import AngleMark
from gearsig.plot.polar import ROOT, draw_degrees, draw_gear, draw_mark, write_corner

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from matplotlib.projections.polar import PolarAxes

LOWEST_DB, LEAST_TOP_DB = -9.0, 9.0
"""Re the measured middling tooth: the inner edge of the picture, and its outer edge at least."""
INNER, OUTER = 0.42, ROOT - 0.08
RINGS_DB = 6.0


def gap_teeth_figure(
    curves: AngleCurves, *, mark: AngleMark | None = None, top_db: float | None = None, size_in: float = 5.4
) -> Figure:
    """Draw the energy within one pitch around the circle, in dB over the measured middling tooth.

    Parameters
    ----------
    curves : AngleCurves
    mark : AngleMark or None
        The tooth that the gap names.
    top_db : float or None
        Outer edge, for pictures that are to be compared; None: this shaft's own.
    size_in : float

    Returns
    -------
    Figure
        Angle clockwise from the top. Teeth have numbers only where the shaft has a mark.
    """
    angle = series.checked_axis(curves.angle_deg, "angle_deg")
    drawn = [("simulated before", curves.before, style.QUIET, 1.0), ("with the effect", curves.after, style.MESH, 1.2)]
    drawn = [(*one[:1], _decibels(one[1], len(angle), one[0]), *one[2:]) for one in drawn if len(one[1])]
    measured = _decibels(curves.measured, len(angle), "measured")
    top = top_db or max(LEAST_TOP_DB, *(float(values.max()) for values in (measured, *(one[1] for one in drawn))))
    figure = style.new_figure(size_in, size_in)
    axes = style.polar_panel(figure)
    _rings(axes, top)
    turn = np.radians(np.append(angle, angle[0] + 360.0))
    _fill(axes, turn, measured, top)
    for _, values, colour, width in drawn:
        axes.plot(turn, _radius(np.append(values, values[0]), top), color=colour, linewidth=width, zorder=3)
    draw_gear(axes, curves.teeth, [mark.angle_deg] if mark else [], numbered=curves.has_mark)
    draw_degrees(axes, has_teeth=True)
    if mark:
        draw_mark(axes, mark, curves.teeth)
        write_corner(axes, mark.label, 0.985, style.FAULT, "bold")
    _keys(axes, [("measured", style.MEASURED), *((one[0], one[2]) for one in drawn)], size_in)
    axes.text(0, 0, plain(curves.shaft, 12), ha="center", va="center", fontsize=style.SMALL_PT, parse_math=False)
    axes.set_ylim(0, 2.36)
    return figure


def _decibels(energy: FloatArray, n: int, name: str) -> FloatArray:
    values = series.checked_values(energy, n, name)
    decibels: FloatArray = 10.0 * np.log10(np.maximum(values, 10.0 ** (LOWEST_DB / 10.0)))
    return decibels


def _radius(decibels: FloatArray, top: float) -> FloatArray:
    share = (np.clip(decibels, LOWEST_DB, top) - LOWEST_DB) / (top - LOWEST_DB)
    radius: FloatArray = INNER + share * (OUTER - INNER)
    return radius


def _fill(axes: PolarAxes, turn: FloatArray, measured: FloatArray, top: float) -> None:
    radius = _radius(np.append(measured, measured[0]), top)
    axes.fill_between(turn, INNER, radius, color=style.MEASURED, alpha=0.18, linewidth=0, zorder=2)
    axes.plot(turn, radius, color=style.MEASURED, linewidth=1.2, zorder=3.5)


def _rings(axes: PolarAxes, top: float) -> None:
    """Draw a ring for every 6 dB, that of the middling tooth in stronger ink."""
    ring = np.linspace(0, 2 * np.pi, 361)
    step = RINGS_DB * (1.0 if top < 20.0 else 2.0)
    for value in np.arange(np.ceil(LOWEST_DB / step) * step, top + 1e-9, step):
        radius = float(_radius(np.array([value]), top)[0])
        colour = style.QUIET if value == 0 else style.RULE
        axes.plot(ring, np.full_like(ring, radius), color=colour, linewidth=0.8, zorder=1)
        text = "0 dB" if value == 0 else f"{value:+.0f} dB".replace("-", "−")
        box = {"facecolor": "white", "edgecolor": "none", "pad": 0.8, "alpha": 0.8}
        axes.text(
            np.pi * 1.25, radius, text, ha="center", va="center", fontsize=style.SMALL_PT - 1, color=style.QUIET,
            zorder=4, bbox=box,
        )  # fmt: skip


def _keys(axes: PolarAxes, keys: list[tuple[str, str]], size_in: float) -> None:
    """Name the curves in the lower left corner."""
    for row, (name, colour) in enumerate(reversed(keys)):
        write_corner(axes, name, 0.05 + row * 0.2 / size_in, colour)
