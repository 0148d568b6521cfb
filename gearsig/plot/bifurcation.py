"""Bifurcation diagrams: Poincaré points over a parameter, one branch or two, with the size of the motion below."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from gearsig.errors import InputError
from gearsig.phase.coexistence import coexistence_ranges, step_of
from gearsig.phase.types import BifurcationDiagram
from gearsig.plot import series, style
from gearsig.plot.display import with_unit
from gearsig.plot.phase import display_unit

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

POINTS_IN, SIZE_IN, BOTTOM_IN, GAP_IN = 3.2, 1.25, 0.55, 0.3
TOP_IN, TOP_OF_TWO_IN = 0.6, 1.02
MANY = 20_000
"""So many points are drawn smaller, and as pixels in a vector file."""
NAMED = 0.03
"""Share of the axis that a stretch of one period takes at least to be named."""

BRANCHES = (("rising", style.MEASURED, 2.6, True), ("falling", style.FAULT, 5.0, False))
"""Names, colours, sizes of points, filled or hollow: where both branches hold the same motion, either is seen."""
PERIODS_AT = (1.02, 1.08)
"""Where the periods of each branch stand, as a share of the panel's height."""
SHADED, BEYOND = "shaded: two motions", "; they may go on beyond the sweep"


def bifurcation_figure(
    diagram: BifurcationDiagram, down: BifurcationDiagram | None = None, *, title: str = ""
) -> Figure:
    """Draw every Poincaré point over the parameter, and the standard deviation of the motion below.

    Stretches whose section repeats are named by their period in cycles above, those of each branch in its colour. With
    a second branch both are drawn; where they hold different motions is shaded, see `coexistence_ranges`.

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
    lines = [_draw_points(axes, branch, factor, *look) for branch, look in zip(branches, BRANCHES, strict=False)]
    parameter = with_unit(diagram.parameter_name, diagram.parameter_unit)
    style.label_axes(axes, "" if with_size else parameter, with_unit(diagram.axis_name, unit))
    for branch, at, (_, colour, _, _) in zip(branches, PERIODS_AT, BRANCHES, strict=False):
        for start, stop, period in _runs_of_equal_period(branch):
            words = f"period {period}"
            series.write(axes, 0.5 * (start + stop), at, words, colour=style.QUIET if down is None else colour)
    panels = [axes]
    if with_size:
        panels.append(_draw_sizes(figure, axes, branches, top))
        style.label_axes(panels[1], parameter, with_unit("std", panels[1].get_ylabel()))
    if down is not None:
        shaded = _shade_apart(panels, diagram, down)
        series.legend_row(
            figure, [*lines, *shaded], left_in=0.85, top_in=series.NAMES_AT_IN, heading=diagram.parameter_name
        )
    series.headline(figure, title or f"{diagram.axis_name} once per {diagram.section}, over {diagram.parameter_name}")
    for panel in panels:
        style.no_offset(panel)
    return figure


def _draw_points(
    axes: Axes, branch: BifurcationDiagram, factor: float, name: str, colour: str, size: float, filled: bool
) -> Line2D:
    """Draw one branch; return what names it in the legend."""
    from matplotlib.lines import Line2D

    shown = size if len(branch.points) < MANY else 0.5 * size
    look: dict[str, Any] = {
        "linestyle": "none",
        "marker": "o",
        "color": colour,
        "markerfacecolor": colour if filled else "none",
        "markeredgewidth": 0.0 if filled else 0.16 * shown,
    }
    axes.plot(
        branch.parameter,
        branch.points * factor,
        markersize=shown,
        alpha=0.7,
        zorder=2.2 if filled else 2.1,
        rasterized=len(branch.points) > MANY,
        **look,
    )
    return Line2D([], [], markersize=max(size, 4.0), label=name, **look)


def _draw_sizes(figure: Figure, above: Axes, branches: Sequence[BifurcationDiagram], top_in: float) -> Axes:
    """Draw the sizes on axes of their own; their unit is left as the label of y."""
    axes = style.panel(figure, top_in=top_in + POINTS_IN + GAP_IN, bottom_in=BOTTOM_IN, sharex=above)
    above.tick_params(labelbottom=False)
    largest = max(float(branch.extents.max()) for branch in branches)
    factor, unit = display_unit(branches[0].unit, largest)
    for branch, (_, colour, size, filled) in zip(branches, BRANCHES, strict=False):
        axes.plot(
            branch.values,
            branch.extents * factor,
            "o-",
            color=colour,
            markerfacecolor=colour if filled else "none",
            markersize=1.2 * size,
            markeredgewidth=0.9,
            linewidth=0.9,
        )
    axes.set_ylim(0.0, 1.1 * factor * largest or 1.0)
    axes.set_ylabel(unit)
    axes.locator_params(axis="y", nbins=4)
    return axes


def _shade_apart(panels: Sequence[Axes], up: BifurcationDiagram, down: BifurcationDiagram) -> list[Line2D]:
    """Shade where the branches differ, and say how well that is known; return what names it in the legend."""
    from matplotlib.lines import Line2D

    ranges = coexistence_ranges(up, down) if len(up.extents) and len(down.extents) else ()
    if not ranges:
        return []
    for panel in panels:
        for one in ranges:
            series.shade(panel, (one.low, one.high))
    step = f"step {step_of(up, down):.4g} {up.parameter_unit}".strip()
    beyond = any(one.begins_with_sweep or one.ends_with_sweep for one in ranges)
    style.note(panels[-1], f"two motions at the values tried, {step}" + BEYOND * beyond)
    return [Line2D([], [], color=style.FLOOR, alpha=0.3, linewidth=9.0, label=SHADED)]


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
