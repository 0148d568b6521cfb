"""Lines of a spectrum over its noise, where there is no simulation beside them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from gearsig.gap.curve_types import SpectrumCurves
from gearsig.plot import series, style
from gearsig.plot.display import unit_text

if TYPE_CHECKING:
    from matplotlib.figure import Figure

TOP_IN, PANEL_IN, BOTTOM_IN = 0.66, 2.6, 0.55
N_MULTIPLES = 6


def gap_lines_figure(curves: SpectrumCurves, order: float | None = None, *, title: str = "") -> Figure:
    """Draw a measured spectrum over its noise floor, with the first six multiples of an order marked.

    Parameters
    ----------
    curves : SpectrumCurves
        Of which `before`, `after` and `structural_db` are not looked at.
    order : float or None
        Of the family that was found; None: nothing is marked.
    title : str
        Default: the curves' label.

    Returns
    -------
    Figure
        Grey is the noise floor; triangles stand above the multiples.

    Raises
    ------
    InputError
        If the curves' lengths differ.
    """
    x = series.checked_axis(curves.orders, "orders")
    measured = series.checked_values(curves.measured, len(x), "measured")
    floor = series.checked_values(curves.floor, len(x), "floor")
    figure = style.new_figure(TOP_IN + PANEL_IN + BOTTOM_IN)
    axes = style.panel(figure, bottom_in=BOTTOM_IN, top_in=TOP_IN)
    top = 1.15 * float(measured[x >= _least(order)].max(initial=0.0)) or 1.0
    axes.fill_between(x, 0.0, floor, color=style.FLOOR, alpha=0.3, linewidth=0)
    keys = axes.plot(x, measured, color=style.MEASURED, linewidth=1.1, label="measured")
    if order is not None:
        multiples = order * np.arange(1, N_MULTIPLES + 1)
        marked = multiples[multiples <= x[-1]]
        label = f"multiples of order {order:.4g}"
        keys += axes.plot(
            marked, np.full(len(marked), 0.96 * top), "v", color=style.FAULT, markersize=6, linewidth=0, label=label
        )
    keys += axes.plot([], [], color=style.FLOOR, alpha=0.4, linewidth=7, label="noise floor")
    axes.set_xlim(float(x[0]), float(x[-1]))
    axes.set_ylim(0.0, top)
    unit = f" ({unit_text(curves.unit)})" if curves.unit else ""
    style.label_axes(axes, "order", f"peak amplitude{unit}")
    style.no_offset(axes)
    series.legend_row(figure, keys, left_in=0.85, top_in=series.NAMES_AT_IN)
    series.headline(figure, title or curves.label)
    return figure


def _least(order: float | None) -> float:
    """Return where lines begin that set the height: the envelope's mean and its slow drift are not of interest."""
    return 0.0 if order is None else 0.1 * order
