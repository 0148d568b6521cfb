"""Bifurcation diagrams: Poincaré points over a parameter, one branch or two, with the size of the motion below."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from gearsig.errors import InputError
from gearsig.phase.bifurcation import values_apart
from gearsig.phase.types import BifurcationDiagram
from gearsig.plot import series, style
from gearsig.plot.display import with_unit
from gearsig.plot.phase import display_unit

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

POINTS_IN, SIZE_IN, BOTTOM_IN, GAP_IN = 3.2, 1.25, 0.55, 0.3
TOP_IN, TOP_OF_TWO_IN = 0.6, 0.85
MANY = 20_000
"""So many points are drawn smaller, and as pixels in a vector file."""
NAMED = 0.03
"""Share of the axis that a stretch of one period takes at least to be named."""


BRANCHES = (("rising", style.MEASURED, 5.5), ("falling", style.FAULT, 2.8))
"""Names, colours, sizes of points: where both branches hold the same motion, either is seen."""


def bifurcation_figure(
    diagram: BifurcationDiagram, down: BifurcationDiagram | None = None, *, title: str = ""
) -> Figure:
    """Draw every Poincaré point over the parameter, and the standard deviation of the motion below.

    Stretches whose section repeats are named by their period in cycles above. With a second branch both are drawn;
    where they hold different motions is shaded.

    Parameters
    ----------
    diagram : BifurcationDiagram
        One branch; of two the one with the parameter rising.
    down : BifurcationDiagram or None
        The other one, with the parameter falling.
    title : str

    Raises
    ------
    InputError
        If the branches are of different things.
    """
    branches = [diagram] if down is None else [diagram, down]
    if down is not None and (diagram.axis_name, diagram.unit) != (down.axis_name, down.unit):
        raise InputError(f"branches of {diagram.axis_name} and {down.axis_name}", allowed="two of the same quantity")
    with_size = all(len(branch.extents) for branch in branches)
    below = SIZE_IN + GAP_IN if with_size else 0.0
    top = TOP_IN if down is None else TOP_OF_TWO_IN
    figure = style.new_figure(top + POINTS_IN + below + BOTTOM_IN)
    axes = style.panel(figure, top_in=top, bottom_in=BOTTOM_IN + below)
    factor, unit = display_unit(diagram.unit, max(float(np.abs(branch.points).max()) for branch in branches))
    lines = [
        _draw_points(axes, branch, factor, colour, name, size)
        for branch, (name, colour, size) in zip(branches, BRANCHES, strict=False)
    ]
    parameter = with_unit(diagram.parameter_name, diagram.parameter_unit)
    style.label_axes(axes, "" if with_size else parameter, with_unit(diagram.axis_name, unit))
    for start, stop, period in _runs_of_equal_period(diagram):
        series.write(axes, 0.5 * (start + stop), 1.02, f"period {period}", colour=style.QUIET)
    panels = [axes]
    if with_size:
        panels.append(_draw_sizes(figure, axes, branches, top))
        style.label_axes(panels[1], parameter, with_unit("std", panels[1].get_ylabel()))
    if down is not None:
        series.legend_row(figure, lines, left_in=0.85, top_in=series.NAMES_AT_IN, heading=diagram.parameter_name)
        for panel in panels:
            _shade_apart(panel, diagram, down)
    series.headline(figure, title or f"{diagram.axis_name} once per {diagram.section}, over {diagram.parameter_name}")
    for panel in panels:
        style.no_offset(panel)
    return figure


def _draw_points(axes: Axes, branch: BifurcationDiagram, factor: float, colour: str, name: str, size: float) -> Line2D:
    """Draw one branch; return what names it in the legend."""
    from matplotlib.lines import Line2D

    axes.plot(
        branch.parameter,
        branch.points * factor,
        linestyle="none",
        marker=".",
        markersize=size if len(branch.points) < MANY else 0.4 * size,
        markeredgewidth=0.0,
        color=colour,
        alpha=0.6,
        rasterized=len(branch.points) > MANY,
    )
    return Line2D([], [], linestyle="none", marker="o", markersize=5.0, markeredgewidth=0.0, color=colour, label=name)


def _draw_sizes(figure: Figure, above: Axes, branches: Sequence[BifurcationDiagram], top_in: float) -> Axes:
    """Draw the sizes on axes of their own; their unit is left as the label of y."""
    axes = style.panel(figure, top_in=top_in + POINTS_IN + GAP_IN, bottom_in=BOTTOM_IN, sharex=above)
    above.tick_params(labelbottom=False)
    largest = max(float(branch.extents.max()) for branch in branches)
    factor, unit = display_unit(branches[0].unit, largest)
    for branch, (_, colour, size) in zip(branches, BRANCHES, strict=False):
        axes.plot(branch.values, branch.extents * factor, ".-", color=colour, markersize=1.6 * size, linewidth=0.9)
    axes.set_ylim(0.0, 1.1 * factor * largest or 1.0)
    axes.set_ylabel(unit)
    axes.locator_params(axis="y", nbins=4)
    return axes


def _shade_apart(axes: Axes, up: BifurcationDiagram, down: BifurcationDiagram) -> None:
    """Shade around each value at which the branches differ, half way to its neighbours."""
    if not len(up.extents) or not len(down.extents) or len(up.values) < 2:
        return
    edges = np.concatenate([up.values[:1], 0.5 * (up.values[1:] + up.values[:-1]), up.values[-1:]])
    for place in np.flatnonzero(np.isin(up.values, values_apart(up, down))):
        series.shade(axes, (float(edges[place]), float(edges[place + 1])))


def _runs_of_equal_period(diagram: BifurcationDiagram) -> list[tuple[float, float, int]]:
    """Stretches of neighbouring values with one period, those that repeat and are wide enough to be named."""
    width = float(np.ptp(diagram.values))
    runs: list[tuple[float, float, int]] = []
    for value, period in zip(diagram.values, diagram.periods, strict=True):
        if runs and runs[-1][2] == period:
            runs[-1] = (runs[-1][0], float(value), period)
        else:
            runs.append((float(value), float(value), period))
    return [run for run in runs if run[2] and run[1] - run[0] >= NAMED * width]
