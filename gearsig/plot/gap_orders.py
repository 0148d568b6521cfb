"""The gap by order: spectra measured and simulated, and their difference against both floors."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from gearsig.checks import FloatArray
from gearsig.errors import InputError
from gearsig.gap.curve_types import SpectrumCurves
from gearsig.gap.curves import gap_by_order, is_beyond
from gearsig.plot import series, style
from gearsig.plot.display import unit_text
from gearsig.plot.thin import thin

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

TOP_IN, SPECTRA_IN, BETWEEN_IN, GAP_IN, BOTTOM_IN = 0.66, 2.3, 0.5, 1.5, 0.55
DECADES = 4.5
"""Below the largest line at most: what lies deeper is noise."""
N_POINTS = 2000
LEAST_GAP_DB = 12.0
"""Of the lower panel's half height: a smaller gap shall look small."""


def gap_orders_figure(
    curves: SpectrumCurves,
    *,
    limits: tuple[float, float] | None = None,
    title: str = "",
    beside: str = "simulated",
    marked: bool = True,
) -> Figure:
    """Draw the order spectra of a recording and of what it is compared with, and below them their difference in dB.

    Parameters
    ----------
    curves : SpectrumCurves
    limits : (float, float) or None
        Orders to show; None: all.
    title : str
        Default: the curves' label.
    beside : str
        What `curves.before` is of: "simulated", or "reference", see `gearsig.gap.curves.against_reference`.
    marked : bool
        Whether lines beyond the structural floor are told from the others.

    Returns
    -------
    Figure
        Above: grey is the repeatability floor; lines below it say nothing. Below: lines above that floor, orange where
        the gap exceeds the structural floor (grey band) and lines are marked, quiet elsewhere; green dots: what is left
        with the likeliest effect, where the floor was exceeded.

    Raises
    ------
    InputError
        If the curves' lengths differ.
    """
    x = series.checked_axis(curves.orders, "orders")
    names = ("measured", "before", "floor", *(n for n in ("after", "structural_db") if len(getattr(curves, n))))
    for name in names:
        series.checked_values(getattr(curves, name), len(x), name)
    low, high = limits or (float(x[0]), float(x[-1]))
    if not np.any((x >= low) & (x <= high)):
        raise InputError(f"limits {low:g} to {high:g} hold no order", allowed=f"{x[0]:g} to {x[-1]:g}")
    figure = style.new_figure(TOP_IN + SPECTRA_IN + BETWEEN_IN + GAP_IN + BOTTOM_IN)
    above = style.panel(figure, bottom_in=BOTTOM_IN + GAP_IN + BETWEEN_IN, top_in=TOP_IN)
    below = style.panel(figure, bottom_in=BOTTOM_IN, top_in=TOP_IN + SPECTRA_IN + BETWEEN_IN, sharex=above)
    keys = _draw_spectra(above, x, curves, beside)
    _draw_gap(below, x, curves, marked=marked)
    above.set_xlim(low, high)
    above.tick_params(labelbottom=False)
    unit = f" ({unit_text(curves.unit)})" if curves.unit else ""
    style.label_axes(above, "", f"peak amplitude{unit}")
    style.label_axes(below, "order of the driver's shaft", "gap (dB)", f"measured over {beside}, against the floors")
    style.no_offset(below)
    series.legend_row(figure, keys, left_in=0.85, top_in=series.NAMES_AT_IN)
    series.headline(figure, title or curves.label)
    return figure


def _draw_spectra(axes: Axes, x: FloatArray, curves: SpectrumCurves, beside: str) -> list[Line2D]:
    top = max(float(curves.measured.max()), float(curves.before.max())) or 1.0
    bottom = max(top / 10.0**DECADES, 0.3 * float(np.median(curves.floor)))
    axes.set_yscale("log")
    axes.set_ylim(bottom, 2.0 * top)
    axes.fill_between(x, bottom, np.maximum(curves.floor, bottom), color=style.FLOOR, alpha=0.25, linewidth=0)
    # Where the effect changes little both simulations coincide: dashes over a wider line show either.
    drawn: list[tuple[FloatArray, str, float, str | tuple[float, tuple[float, float]], str]]
    drawn = [(curves.measured, style.MEASURED, 1.1, "-", "measured")]
    if len(curves.after):
        drawn.append((curves.after, style.MESH, 2.0, "-", f"{beside} with the effect"))
    name = f"{beside} before" if len(curves.after) else beside
    drawn.append((curves.before, style.INK, 0.9, (0.0, (3.0, 2.0)), name))
    lines = []
    for values, colour, width, dashes, label in drawn:
        points = thin(x, np.maximum(values, bottom), N_POINTS)
        lines += axes.plot(*points, color=colour, linewidth=width, linestyle=dashes, label=label, alpha=0.85)
    floor = axes.plot([], [], color=style.FLOOR, alpha=0.4, linewidth=7, label="repeatability floor")
    return [*lines, *floor]


def _draw_gap(axes: Axes, x: FloatArray, curves: SpectrumCurves, *, marked: bool) -> None:
    before = gap_by_order(curves, curves.before)
    structural = curves.structural_db if len(curves.structural_db) else np.zeros(len(x))
    beyond = is_beyond(curves, before)
    largest = 1.15 * max(LEAST_GAP_DB, float(np.max(np.abs(before), initial=0.0, where=np.isfinite(before))))
    if len(curves.structural_db):
        band = np.minimum(structural, largest)
        axes.fill_between(x, -band, band, step="mid", color=style.FLOOR, alpha=0.22, linewidth=0, zorder=1)
    strong = beyond & marked
    for chosen, colour, alpha in ((~strong, style.QUIET, 0.55), (strong, style.FAULT, 0.95)):
        here = chosen & np.isfinite(before)
        axes.vlines(x[here], 0.0, before[here], colors=colour, linewidth=1.0, alpha=alpha, zorder=2)
    if len(curves.after):
        left = gap_by_order(curves, curves.after)
        here = beyond & np.isfinite(left)
        axes.plot(x[here], left[here], ".", color=style.MESH, markersize=3.5, zorder=3)
    axes.axhline(0.0, color=style.QUIET, linewidth=0.8, zorder=1.5)
    axes.set_ylim(-largest, largest)
