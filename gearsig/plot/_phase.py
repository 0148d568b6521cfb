"""Motion in phase space: portraits with their Poincaré points, recurrences, delays, dimensions, chaos."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from gearsig.checks import FloatArray, count
from gearsig.errors import InputError
from gearsig.phase import (
    BifurcationDiagram,
    ChaosTest,
    EmbeddingDimension,
    LyapunovExponent,
    MutualInformation,
    PhasePortrait,
    PoincareSection,
    RecurrenceMeasures,
    RecurrencePlot,
    coexistence_ranges,
    step_of,
)
from gearsig.plot import _series as series
from gearsig.plot import _style as style
from gearsig.plot._style import with_unit

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D


MOST_PATH_POINTS = 20_000
"""A path of more points is a blot; the last so many are drawn, and the figure says so."""
SIDE_IN, LEFT_IN, BOTTOM_IN, TOP_IN, GAP_IN = 3.55, 0.85, 0.55, 0.42, 0.95

RECURRENCE_IN = 5.5
"""Side of a recurrence plot: a thousand points a side get a pixel each on the page."""


def phase_portrait_figure(
    portrait: PhasePortrait,
    section: PoincareSection | None = None,
    *,
    axes: tuple[int, int] = (0, 1),
    n_points: int = MOST_PATH_POINTS,
    title: str = "",
) -> Figure:
    """Draw two axes of a path against each other; with a section, its points on the path and alone beside it.

    Parameters
    ----------
    portrait : PhasePortrait
    section : PoincareSection or None
        Of the same axes.
    axes : (int, int)
        Which are drawn.
    n_points : int
        The last so many of the path are drawn.
    title : str

    Raises
    ------
    InputError
        If an axis is missing, or the section's axes are others.
    """
    count(n_points, "n_points", minimum=2)
    if not all(0 <= axis < portrait.n_axes for axis in axes):
        raise InputError(f"axes is {axes}", allowed=f"two of 0 to {portrait.n_axes - 1}")
    if section is not None and section.axis_names != portrait.axis_names:
        raise InputError(f"the section's axes are {section.axis_names}", allowed=f"{portrait.axis_names}")
    figure = style.new_figure(TOP_IN + SIDE_IN + BOTTOM_IN)
    path, points = _two_panels(figure)
    shown = [display_unit(portrait.units[axis], float(portrait.extent[axis])) for axis in axes]
    x, y = (portrait.points[-n_points:, axis] * factor for axis, (factor, _) in zip(axes, shown, strict=True))
    path.plot(x, y, color=style.MEASURED, linewidth=0.5, alpha=0.6 if len(x) < 5000 else 0.3)
    names = [with_unit(portrait.axis_names[axis], unit) for axis, (_, unit) in zip(axes, shown, strict=True)]
    factors = (shown[0][0], shown[1][0])
    style.label_axes(path, names[0], names[1], title or portrait.source)
    if portrait.n_points > n_points:
        style.note(path, f"last {n_points / portrait.sampling_rate_hz:.4g} s")
    if section is None:
        points.set_axis_off()
    else:
        _draw_points(path, section, axes, factors, 2.2)
        _draw_points(points, section, axes, factors, 2.8)
        style.label_axes(points, names[0], names[1], f"{section.n_points} points")
        style.note(points, f"once per {section.section}" if section.kind == "locked" else section.section)
        _keep_apart(points, section, axes, factors)
    for panel in (path, points):
        style.no_offset(panel)
        panel.locator_params(nbins=5)
    return figure


def recurrence_figure(plot: RecurrencePlot, measures: RecurrenceMeasures | None = None, *, title: str = "") -> Figure:
    """Draw recurrent pairs as dots over both times; with measures, their values beside."""
    from matplotlib.colors import ListedColormap

    figure = style.new_figure(TOP_IN + RECURRENCE_IN + BOTTOM_IN)
    axes = style.panel(figure, left_in=LEFT_IN, right_in=style.WIDTH_IN - LEFT_IN - RECURRENCE_IN, top_in=TOP_IN)
    axes.grid(visible=False)
    limits = (float(plot.times_s[0]), float(plot.times_s[-1]))
    axes.imshow(
        plot.recurrent,
        origin="lower",
        extent=(*limits, *limits),
        cmap=ListedColormap(["white", style.INK]),
        interpolation="nearest",
        aspect="equal",
    )
    style.label_axes(axes, "time (s)", "time (s)", title or plot.source or "recurrence plot")
    style.no_offset(axes)
    rows = [f"radius {plot.radius:.3g} standard deviations"]
    if plot.stride > 1:
        rows.append(f"every {plot.stride}. point")
    for i, text in enumerate(rows + (_measure_texts(measures) if measures is not None else [])):
        figure.text(
            (LEFT_IN + RECURRENCE_IN + 0.35) / style.WIDTH_IN,
            1.0 - (TOP_IN + 0.2 + 0.24 * i) / float(figure.get_size_inches()[1]),
            text,
            fontsize=style.TEXT_PT,
            color=style.INK,
            va="center",
            parse_math=False,
        )
    return figure


def embedding_figure(information: MutualInformation, dimension: EmbeddingDimension, *, title: str = "") -> Figure:
    """Draw mutual information over delay and false neighbours over dimension, with what was chosen from them."""
    figure = style.new_figure(TOP_IN + SIDE_IN + BOTTOM_IN)
    left, right = _two_panels(figure)
    left.plot(information.delays_s, information.information_nats, color=style.MEASURED, linewidth=1.2)
    left.axvline(information.delay_s, color=style.FAULT, linewidth=1.0)
    left.set_ylim(0.0)
    left.set_xlim(0.0, float(information.delays_s[-1]))
    left.locator_params(axis="x", nbins=5)
    style.label_axes(left, "delay (s)", "mutual information (nats)", title or information.source)
    style.note(left, f"{information.delay_s:.4g} s: {information.rule}")
    d = np.asarray(dimension.dimensions)
    lines = [
        *right.plot(d, dimension.false_fraction, "o-", color=style.MEASURED, markersize=4, label="false neighbours"),
        *right.plot(d[:-1], dimension.growth, "s--", color=style.MESH, markersize=3.5, linewidth=0.9, label="Cao E1"),
        *right.plot(d[:-1], dimension.determinism, "^:", color=style.SHAFT, markersize=3.5, linewidth=0.9, label="E2"),
    ]
    right.axhline(dimension.threshold, color=style.FLOOR, linewidth=0.8)
    if dimension.dimension:
        right.axvline(dimension.dimension, color=style.FAULT, linewidth=1.0)
    right.set_ylim(-0.03, float(np.clip(1.1 * dimension.determinism.max(), 1.1, 3.0)))
    style.label_axes(right, "dimension", "share, ratio")
    style.note(right, f"dimension {dimension.dimension}" if dimension.dimension else "no dimension: stochastic")
    legend = right.legend(handles=lines, fontsize=style.SMALL_PT, frameon=False, labelcolor=style.INK)
    legend.set_zorder(3)
    return figure


def divergence_figure(exponent: LyapunovExponent, *, title: str = "", height_in: float = 3.4) -> Figure:
    """Draw the divergence curve with its fitted stretch, line and saturation."""
    figure = style.new_figure(height_in)
    axes = style.panel(figure, top_in=TOP_IN)
    axes.plot(exponent.times_s, exponent.log_distance, color=style.MEASURED, linewidth=1.2)
    axes.axhline(exponent.saturation_log_distance, color=style.FLOOR, linewidth=0.8, linestyle="--")
    series.shade(axes, exponent.fit_s)
    inside = (exponent.times_s >= exponent.fit_s[0]) & (exponent.times_s <= exponent.fit_s[1])
    t, s = exponent.times_s[inside], exponent.log_distance[inside]
    axes.plot(t, s.mean() + exponent.exponent_per_s * (t - t.mean()), color=style.FAULT, linewidth=1.2)
    style.label_axes(axes, "time (s)", "mean ln distance", title or exponent.source or "divergence of neighbours")
    style.note(axes, f"λ = {exponent.exponent_per_s:.4g} ± {exponent.uncertainty_per_s:.2g} 1/s, {exponent.verdict}")
    style.no_offset(axes)
    return figure


def chaos_test_figure(test: ChaosTest, walk: FloatArray, c_rad: float, *, title: str = "") -> Figure:
    """Draw K over c with its median, and beside it the walk in the plane of p and q at one c, (n, 2)."""
    figure = style.new_figure(TOP_IN + SIDE_IN + BOTTOM_IN)
    left, right = _two_panels(figure)
    order = np.argsort(test.c_rad)
    left.plot(test.c_rad[order], test.k_of_c[order], ".-", color=style.MEASURED, markersize=4, linewidth=0.7)
    left.axhline(test.k, color=style.FAULT, linewidth=1.0)
    left.axvline(c_rad, color=style.FLOOR, linewidth=0.8)
    left.set_ylim(-1.05, 1.05)
    style.label_axes(left, "c (rad)", "K", title or test.source or "0–1 test")
    words = f"K = {test.k:.2f}, {test.verdict}, {test.n_values} values"
    series.write(left, 0.5 * sum(left.get_xlim()), 0.05 if test.k > 0.0 else 0.95, words)
    right.plot(walk[:, 0], walk[:, 1], color=style.MEASURED, linewidth=0.6)
    right.set_aspect("equal", adjustable="datalim")
    style.label_axes(right, "p", "q")
    style.note(right, f"walk at c = {c_rad:.3f} rad")
    for panel in (left, right):
        style.no_offset(panel)
    return figure


def _two_panels(figure: Figure) -> tuple[Axes, Axes]:
    second = LEFT_IN + SIDE_IN + GAP_IN
    left = style.panel(figure, left_in=LEFT_IN, right_in=style.WIDTH_IN - LEFT_IN - SIDE_IN, top_in=TOP_IN)
    right = style.panel(figure, left_in=second, right_in=style.WIDTH_IN - second - SIDE_IN + 0.1, top_in=TOP_IN)
    return left, right


def display_unit(unit: str, size: float) -> tuple[float, str]:
    """Return the factor and unit in which a length or velocity of that size is read without powers of ten."""
    base, _, rest = unit.partition("/")
    if base != "m" or size >= 0.5:
        return 1.0, unit
    prefix, factor = ("m", 1e3) if size >= 5e-4 else ("µ", 1e6)
    return factor, prefix + "m" + (f"/{rest}" if rest else "")


def _draw_points(
    axes: Axes, section: PoincareSection, which: tuple[int, int], factors: tuple[float, float], size: float
) -> None:
    x, y = (section.points[:, axis] * factor for axis, factor in zip(which, factors, strict=True))
    axes.plot(x, y, "o", color=style.FAULT, markersize=size, markeredgewidth=0.0, zorder=3)


def _keep_apart(axes: Axes, section: PoincareSection, which: tuple[int, int], factors: tuple[float, float]) -> None:
    """Show at least a twentieth of the path's size: one point must not be blown up to a cloud of rounding."""
    limits = []
    for axis, factor in zip(which, factors, strict=True):
        values = section.points[:, axis] * factor
        middle, half = 0.5 * float(values.max() + values.min()), 0.58 * float(np.ptp(values))
        half = max(half, 0.05 * factor * float(section.extent[axis])) or 1.0
        limits.append((middle - half, middle + half))
    axes.set_xlim(limits[0])
    axes.set_ylim(limits[1])


def _measure_texts(measures: RecurrenceMeasures) -> list[str]:
    return [
        "",
        f"recurrence rate {measures.recurrence_rate:.3f}",
        f"determinism {measures.determinism:.3f}",
        f"mean line {measures.mean_line_s:.4g} s",
        f"longest line {measures.longest_line_s:.4g} s",
        f"entropy {measures.entropy_nats:.3g} nats",
        f"laminarity {measures.laminarity:.3f}",
        f"trapping time {measures.trapping_time_s:.4g} s",
    ]


# --------------------
# Bifurcation diagrams: Poincaré points over a parameter, one branch or two, with the size of the motion below.
# --------------------


POINTS_IN, SIZE_IN, BIFURCATION_BOTTOM_IN, BIFURCATION_GAP_IN = 3.2, 1.25, 0.55, 0.3
BIFURCATION_TOP_IN, TOP_OF_TWO_IN = 0.6, 1.02
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
    below = SIZE_IN + BIFURCATION_GAP_IN if with_size else 0.0
    top = BIFURCATION_TOP_IN if down is None else TOP_OF_TWO_IN
    figure = style.new_figure(top + POINTS_IN + below + BIFURCATION_BOTTOM_IN)
    axes = style.panel(figure, top_in=top, bottom_in=BIFURCATION_BOTTOM_IN + below)
    factor, unit = display_unit(diagram.unit, max(float(np.abs(branch.points).max()) for branch in branches))
    lines = [
        _draw_points_bifurcation(axes, branch, factor, *look) for branch, look in zip(branches, BRANCHES, strict=False)
    ]
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


def _draw_points_bifurcation(
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
    axes = style.panel(
        figure, top_in=top_in + POINTS_IN + BIFURCATION_GAP_IN, bottom_in=BIFURCATION_BOTTOM_IN, sharex=above
    )
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
