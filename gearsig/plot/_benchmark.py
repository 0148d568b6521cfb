"""Figures of a benchmark: what was taken for what, and whether probabilities are worth what they say."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from gearsig.checks import FloatArray
from gearsig.errors import InputError
from gearsig.plot import _series as series
from gearsig.plot import _style as style

if TYPE_CHECKING:
    from matplotlib.figure import Figure


COLOURS = (style.MEASURED, style.FLOOR, style.SHAFT)


def confusion_figure(true: Sequence[str], said: Sequence[str], counts: np.ndarray, *, title: str = "") -> Figure:
    """Draw how often each cause was taken for which; shades are shares of a row, numbers are cases.

    Parameters
    ----------
    true, said : sequence of str
        Rows and columns; what both have in common should come first in both.
    counts : array, (n_true, n_said), whole numbers
    title : str

    Returns
    -------
    Figure

    Raises
    ------
    InputError
        If the table does not fit the names.
    """
    table = np.asarray(counts)
    if table.shape != (len(true), len(said)):
        raise InputError(f"counts are {table.shape}", allowed=f"({len(true)}, {len(said)}), as there are names")
    cells_in = 0.27 * len(said)
    width = max(style.WIDTH_IN, 1.75 + cells_in + 0.75)
    figure, (axes,) = style.panels(
        (0.27 * len(true),), left_in=1.75, right_in=width - 1.75 - cells_in, bottom_in=1.5, top_in=0.45, width_in=width
    )
    totals = np.maximum(table.sum(axis=1, keepdims=True), 1)
    axes.imshow(table / totals, cmap=style.colours(), vmin=0.0, vmax=1.3, aspect="auto")
    for (i, j), n in np.ndenumerate(table):
        if n:
            dark = n / totals[i, 0] > 0.55
            wrong = true[i] != said[j]
            colour = "white" if dark else style.FAULT if wrong else style.INK
            axes.text(j, i, str(n), ha="center", va="center", fontsize=style.SMALL_PT, color=colour)
    axes.set_xticks(range(len(said)), [_words(name) for name in said], rotation=90)
    axes.set_yticks(range(len(true)), [f"{_words(n)} ({t})" for n, t in zip(true, table.sum(axis=1), strict=True)])
    axes.tick_params(length=0)
    axes.grid(visible=False)
    style.label_axes(axes, "said")
    series.headline(figure, title)
    return figure


def calibration_figure(
    curves: Mapping[str, tuple[FloatArray, FloatArray, FloatArray, FloatArray]], *, title: str = ""
) -> Figure:
    """Draw how often answers were right over how sure they were; true probabilities lie on the diagonal.

    Parameters
    ----------
    curves : mapping
        Name → confidence, share right, low and high end of its 90 % interval, each (n_bins,), 0 to 1.
    title : str

    Returns
    -------
    Figure
    """
    figure, (axes,) = style.panels((3.4,), left_in=0.75, right_in=0.3, top_in=0.45)
    axes.plot((0, 100), (0, 100), color=style.QUIET, linewidth=0.9, linestyle="--")
    for i, (name, (confidence, right, low, high)) in enumerate(curves.items()):
        colour = COLOURS[i % len(COLOURS)]
        axes.vlines(100 * confidence, 100 * low, 100 * high, color=colour, linewidth=1.0, alpha=0.6)
        axes.plot(100 * confidence, 100 * right, color=colour, linewidth=0.9, marker="o", markersize=4.5, label=name)
    axes.set_xlim(0, 101)
    axes.set_ylim(-2, 102)
    style.label_axes(axes, "probability of the likeliest cause (%)", "right (%)")
    if curves:
        axes.legend(loc="upper left", frameon=False, fontsize=style.SMALL_PT)
    series.headline(figure, title)
    return figure


def _words(name: str) -> str:
    return name.replace("_", " ")
