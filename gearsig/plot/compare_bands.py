"""Band levels of a simulation beside those of a recording."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from gearsig.compare.types import BandLevel
from gearsig.errors import InputError
from gearsig.plot import series, style
from gearsig.plot.compare import SIDES, difference_bars
from gearsig.plot.display import plain, unit_text

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

LEFT_IN, RIGHT_IN, TOP_IN = 0.85, 0.2, 0.68
PANEL_IN, GAP_IN, LABELS_IN = 1.7, 0.3, 0.95
CHANCE_MAGNITUDE = np.pi**2 / 16
"""FRAC of the magnitudes of two noises (Rayleigh distributed): (E|x| E|y|)² / (E|x|² E|y|²)."""


def band_levels_figure(bands: Sequence[BandLevel], unit: str = "", *, title: str = "") -> Figure:
    """Draw the levels of bands side by side, their difference below, and below that how alike their lines are.

    Parameters
    ----------
    bands : sequence of BandLevel
        Of one axis, ascending.
    unit : str
        That levels are counted from; empty where it is not known.
    title : str

    Returns
    -------
    Figure
        The panel of FRAC only where bands have one.

    Raises
    ------
    InputError
        Without bands.
    """
    if not bands:
        raise InputError("there are no bands to draw", allowed="at least one")
    alike = any(band.agreement is not None for band in bands)
    n_panels = 3 if alike else 2
    height = TOP_IN + LABELS_IN + n_panels * PANEL_IN + (n_panels - 1) * GAP_IN
    figure = style.new_figure(height)
    panels = [_panel(figure, height, i, n_panels) for i in range(n_panels)]
    x = np.arange(len(bands), dtype=np.float64)
    curves = _draw_levels(panels[0], bands)
    style.label_axes(panels[0], "", f"level (dB re 1 {unit_text(unit)})" if unit else "level (dB)")
    difference_bars(panels[1], x, [band.level for band in bands], 0.7)
    style.label_axes(panels[1], "", "sim. − rec. (dB)")
    if alike:
        curves += _draw_agreement(panels[2], bands)
    for axes in panels:
        axes.set_xlim(-0.6, len(bands) - 0.4)
        axes.set_xticks(x, [plain(band.label, 22) for band in bands], rotation=45, ha="right", parse_math=False)
        axes.tick_params(labelbottom=axes is panels[-1])
    series.headline(figure, title)
    series.legend_row(figure, curves, left_in=LEFT_IN, top_in=series.NAMES_AT_IN)
    return figure


def _panel(figure: Figure, height: float, i: int, n: int) -> Axes:
    bottom = LABELS_IN + (n - 1 - i) * (PANEL_IN + GAP_IN)
    return style.panel(figure, left_in=LEFT_IN, right_in=RIGHT_IN, bottom_in=bottom, top_in=height - bottom - PANEL_IN)


def _draw_levels(axes: Axes, bands: Sequence[BandLevel]) -> list:  # type: ignore[type-arg]  # of Line2D, imported for checking only
    edges = np.arange(len(bands) + 1) - 0.5
    curves = []
    for (name, colour), key in zip(SIDES, ("recorded_db", "simulated_db"), strict=True):
        levels = np.array([float(getattr(band.level, key)) for band in bands])
        steps = (np.repeat(edges, 2)[1:-1], np.repeat(levels, 2))
        curves += axes.plot(*steps, color=colour, linewidth=1.4, label=name, zorder=2)
    style.no_offset(axes)
    return curves


def _draw_agreement(axes: Axes, bands: Sequence[BandLevel]) -> list:  # type: ignore[type-arg]  # of Line2D
    curves = []
    axes.axhline(CHANCE_MAGNITUDE, color=style.QUIET, linewidth=0.8, linestyle=":", zorder=1)
    for name, key, marker, colour in (
        ("FRAC, complex", "complex_frac", "o", style.INK),
        ("FRAC, magnitudes", "magnitude_frac", "s", style.QUIET),
    ):
        found = [(i, getattr(band.agreement, key)) for i, band in enumerate(bands) if band.agreement is not None]
        x, y = np.array([i for i, _ in found]), np.array([figure.value for _, figure in found])
        errors = 2.0 * np.array([figure.repeatability for _, figure in found])
        axes.vlines(x, np.maximum(y - errors, 0), np.minimum(y + errors, 1), color=colour, linewidth=1.0, zorder=2)
        looks = {"linestyle": "none", "markersize": 5.0, "zorder": 3, "label": name}
        looks |= {"markerfacecolor": "white"} if marker == "s" else {}
        curves += axes.plot(x, y, marker, color=colour, **looks)  # type: ignore[arg-type]
    chance = [(i, band.agreement.complex_by_chance) for i, band in enumerate(bands) if band.agreement is not None]
    looks = {"linestyle": "none", "markersize": 12, "markeredgewidth": 1.4, "color": style.FLOOR, "zorder": 1.5}
    curves += axes.plot(*np.array(chance).T, "_", label="complex, by chance", **looks)  # type: ignore[arg-type]
    axes.set_ylim(-0.04, 1.04)
    style.label_axes(axes, "", "FRAC (0 to 1)")
    style.no_offset(axes)
    return curves
