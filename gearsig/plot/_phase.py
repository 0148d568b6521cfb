"""Motion in phase space: portraits with Poincaré points, recurrences, delays, dimensions, chaos."""

from __future__ import annotations

from math import floor, isfinite, log10
from typing import TYPE_CHECKING, Any

import numpy as np

from gearsig.angle import REACH
from gearsig.checks import FloatArray, count
from gearsig.errors import InputError
from gearsig.formatting import seconds_text
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
    points_between,
    step_of,
)
from gearsig.plot import _style as style
from gearsig.plot._style import with_unit

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D


def phase_portrait_figure(
    portrait: PhasePortrait,
    section: PoincareSection | None = None,
    *,
    axes: tuple[int, int] = (0, 1),
    n_points: int = 20_000,
    title: str = "",
) -> Figure:
    """Draw two axes of a path against each other; a section adds its points on the path and in a panel beside it.

    Parameters
    ----------
    portrait : PhasePortrait
    section : PoincareSection or None
        With the same axes.
    axes : (int, int)
        Axes to draw.
    n_points : int
        Number of last points of the path to draw, which the figure states; more would overlap too much.
    title : str

    Raises
    ------
    InputError
        If an axis is missing, or the section has other axes.
    """
    count(n_points, "n_points", minimum=2)
    if not all(0 <= axis < portrait.n_axes for axis in axes):
        raise InputError(f"axes is {axes}", allowed=f"two of 0 to {portrait.n_axes - 1}")
    if section is not None and section.axis_names != portrait.axis_names:
        raise InputError(f"the section's axes are {section.axis_names}", allowed=f"{portrait.axis_names}")
    # without a section, half the figure would be empty
    figure, panels = style.panels((3.5,), top_in=0.42, width_in=5.2) if section is None else _two_panels()
    path = panels[0]
    shown = [display_unit(portrait.units[axis], float(portrait.extent[axis])) for axis in axes]
    x, y = _path(portrait, axes, n_points).T * [[factor] for factor, _ in shown]
    path.plot(x, y, color=style.MEASURED, linewidth=0.5, alpha=0.6 if min(n_points, portrait.n_points) < 5000 else 0.3)
    names = [with_unit(portrait.axis_names[axis], unit) for axis, (_, unit) in zip(axes, shown, strict=True)]
    factors = (shown[0][0], shown[1][0])
    style.label_axes(path, names[0], names[1], title or portrait.source)
    if portrait.n_points > n_points:
        style.note(path, f"last {n_points / portrait.sampling_rate_hz:.4g} s")
    if section is not None:
        points = panels[1]
        dots = [section.points[:, axis] * factor for axis, factor in zip(axes, factors, strict=True)]
        for panel, size in ((path, 2.2), (points, 2.8)):
            panel.plot(*dots, "o", color=style.FAULT, markersize=size, markeredgewidth=0.0, zorder=3)
        style.label_axes(points, names[0], names[1], f"{section.n_points} points")
        style.note(points, f"once per {section.section}" if section.kind == "locked" else section.section)
        # At least a twentieth of the path's size, so that a single point is not enlarged to a cloud of rounding errors.
        limits = []
        for values, axis, factor in zip(dots, axes, factors, strict=True):
            middle, half = 0.5 * float(values.max() + values.min()), 0.58 * float(np.ptp(values))
            half = max(half, 0.05 * factor * float(section.extent[axis])) or 1.0
            limits.append((middle - half, middle + half))
        points.set(xlim=limits[0], ylim=limits[1])
    for panel in panels:
        style.no_offset(panel)
        panel.locator_params(nbins=5)
    return figure


_DRAWN_PER_PERIOD = 20.0


def _path(portrait: PhasePortrait, axes: tuple[int, int], n_points: int) -> FloatArray:
    """Return the last points of two axes, (n, 2), with band-limited interpolation between samples of a filtered path.

    With few samples in the shortest period, straight lines would cut the corners of a curve.
    """
    points = portrait.points[:, axes]
    part = portrait.band_hz[1] / portrait.sampling_rate_hz
    first, last = max(len(points) - n_points, REACH), len(points) - 1 - REACH
    if part >= 0.45 or _DRAWN_PER_PERIOD * part <= 1.0 or first >= last:
        return points[-n_points:]
    return points_between(points, np.arange(first, last, 1.0 / (_DRAWN_PER_PERIOD * part)))


def recurrence_figure(plot: RecurrencePlot, measures: RecurrenceMeasures | None = None, *, title: str = "") -> Figure:
    """Draw recurrent pairs as dots over both times, with the values of the measures beside them, if given."""
    from matplotlib.colors import ListedColormap

    side_in = 5.5  # a pixel for each of a thousand points per side
    figure, (axes,) = style.panels((side_in,), right_in=style.WIDTH_IN - 0.85 - side_in, top_in=0.42)
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
    rows = [f"radius {plot.radius:.3g} standard deviations", f"1 in {plot.stride} points" if plot.stride > 1 else ""]
    if measures is not None:
        rows += [
            f"recurrence rate {measures.recurrence_rate:.3f}",
            f"determinism {measures.determinism:.3f}",
            f"mean line {seconds_text(measures.mean_line_s)}",
            f"longest line {seconds_text(measures.longest_line_s)}",
            f"entropy {measures.entropy_nats:.3g} nats",
            f"laminarity {measures.laminarity:.3f}",
            f"trapping time {seconds_text(measures.trapping_time_s)}",
        ]
    for i, text in enumerate(rows):
        at = 1.0 + 0.35 / side_in, 1.0 - (0.2 + 0.24 * i) / side_in
        style.put_text(axes, *at, text, colour=style.INK, fontsize=style.TEXT_PT, transform=axes.transAxes, va="center")
    return figure


def embedding_figure(information: MutualInformation, dimension: EmbeddingDimension, *, title: str = "") -> Figure:
    """Draw mutual information over delay and false neighbours over dimension, with the values chosen from them."""
    figure, (left, right) = _two_panels()
    left.plot(1e3 * information.delays_s, information.information_nats, color=style.MEASURED, linewidth=1.2)
    left.axvline(1e3 * information.delay_s, color=style.FAULT, linewidth=1.0)
    left.set_ylim(0.0)
    left.set_xlim(0.0, 1e3 * float(information.delays_s[-1]))
    left.locator_params(axis="x", nbins=5)
    style.label_axes(left, "delay (ms)", "mutual information (nats)", title or information.source)
    style.note(left, f"{seconds_text(information.delay_s)}: {information.rule}")
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


def divergence_figure(exponent: LyapunovExponent, *, title: str = "") -> Figure:
    """Draw the divergence curve with its fitted segment and line, and the distance of unrelated points.

    Without a fit, as for the intermediate result of a `RefusalError`, draw only the curve and that distance.
    """
    figure, (axes,) = style.panels((2.43,), top_in=0.42)
    axes.plot(exponent.times_s, exponent.log_distance, color=style.MEASURED, linewidth=1.2, label="neighbours")
    unrelated = exponent.saturation_log_distance
    axes.axhline(unrelated, color=style.MESH, linewidth=0.8, linestyle="--", label="unrelated points")
    words = f"no exponent, {exponent.verdict}"
    if isfinite(exponent.exponent_per_s):
        style.shade(axes, exponent.fit_s)
        inside = (exponent.times_s >= exponent.fit_s[0]) & (exponent.times_s <= exponent.fit_s[1])
        t, s = exponent.times_s[inside], exponent.log_distance[inside]
        fitted = s.mean() + exponent.exponent_per_s * (t - t.mean())
        axes.plot(t, fitted, color=style.FAULT, linewidth=1.2, label="fit")
        words = f"λ = {exponent.exponent_per_s:.4g} ± {exponent.uncertainty_per_s:.2g} 1/s, {exponent.verdict}"
    style.label_axes(
        axes, "time (s)", "ln of the mean distance", title or exponent.source or "divergence of neighbours"
    )
    style.note(axes, words)
    style.no_offset(axes)
    return figure


def chaos_test_figure(test: ChaosTest, walk: FloatArray, c_rad: float, *, title: str = "") -> Figure:
    """Draw K over c with its median, and beside it the walk in the plane of p and q at one c, (n, 2)."""
    figure, (left, right) = _two_panels()
    order = np.argsort(test.c_rad)
    left.plot(test.c_rad[order], test.k_of_c[order], ".-", color=style.MEASURED, markersize=4, linewidth=0.7)
    left.axhline(test.k, color=style.FAULT, linewidth=1.0)
    left.axvline(c_rad, color=style.FLOOR, linewidth=0.8)
    left.set_ylim(-1.05, 1.05)
    style.label_axes(left, "c (rad)", "K", title or test.source or "0–1 test")
    words = f"K = {test.k:.2f}, {test.verdict}, {test.n_values} values"
    style.write(left, 0.5 * sum(left.get_xlim()), 0.05 if test.k > 0.0 else 0.95, words)
    right.plot(walk[:, 0], walk[:, 1], color=style.MEASURED, linewidth=0.6)
    right.set_aspect("equal", adjustable="datalim")
    style.label_axes(right, "p", "q")
    style.note(right, f"walk at c = {c_rad:.3f} rad")
    style.no_offset(left, right)
    return figure


def _two_panels() -> tuple[Figure, list[Axes]]:
    return style.panels((3.5,), (1.0, 1.0), top_in=0.42)


def display_unit(unit: str, size: float) -> tuple[float, str]:
    """Return the factor and unit in which values of that size have few digits; without a unit, a power of 1000.

    Examples
    --------
    >>> display_unit("m/s", 2e-4), display_unit("", 2e-4), display_unit("rad", 3.0)
    ((1000000.0, 'µm/s'), (1000000.0, '10^-6'), (1.0, 'rad'))
    """
    base, _, denominator = unit.partition("/")
    if not size or not isfinite(size) or (base != "m" and FEW_DIGITS[0] <= size < FEW_DIGITS[1]):
        return 1.0, unit
    if base != "m":
        exponent = 3 * floor(log10(size) / 3)
        return 10.0**-exponent, f"10^{exponent} {unit}".strip()
    if size >= 0.5:
        return 1.0, unit
    prefix, factor = ("m", 1e3) if size >= 5e-4 else ("µ", 1e6)
    return factor, prefix + "m" + (f"/{denominator}" if denominator else "")


FEW_DIGITS = 0.02, 1e5
"""Values between these are written in full."""


BRANCHES = (("rising", style.MEASURED, 2.6, True, 1.02), ("falling", style.FAULT, 5.0, False, 1.08))
"""Name, colour, point size, filled or hollow, height of period labels; both are visible where they coincide."""


def bifurcation_figure(
    diagram: BifurcationDiagram, down: BifurcationDiagram | None = None, *, title: str = ""
) -> Figure:
    """Draw all Poincaré points over the parameter, and the standard deviation of the motion below.

    Ranges with a periodic section are labelled above with their period in cycles, in the colour of their branch. If
    there are two branches, ranges with different motions are shaded; see `coexistence_ranges`.

    Parameters
    ----------
    diagram : BifurcationDiagram
        One branch; of two, the one with increasing parameter.
    down : BifurcationDiagram or None
        The other one, with decreasing parameter.
    title : str

    Raises
    ------
    InputError
        If the branches show different quantities.
    """
    from matplotlib.lines import Line2D

    branches = [diagram] if down is None else [diagram, down]
    if down is not None and (diagram.axis_name, diagram.unit) != (down.axis_name, down.unit):
        raise InputError(f"branches of {diagram.axis_name} and {down.axis_name}", allowed="two of the same quantity")
    with_size = all(len(branch.extents) for branch in branches)
    figure, panels = style.panels(
        (3.2, 1.25) if with_size else (3.2,), top_in=0.6 if down is None else 1.02, row_gap_in=0.3, share_x=True
    )
    factor, unit = display_unit(diagram.unit, max(float(np.abs(branch.points).max()) for branch in branches))
    lines = []
    for branch, (name, colour, size, filled, height) in zip(branches, BRANCHES, strict=False):
        lines.append(_draw_branch(panels[0], branch, factor, (name, colour, size, filled)))
        for start, stop, period in _runs_of_equal_period(branch):
            ink = style.QUIET if down is None else colour
            style.write(panels[0], 0.5 * (start + stop), height, f"period {period}", colour=ink)
    style.label_axes(panels[0], "", with_unit(diagram.axis_name, unit))
    if with_size:
        largest = max(float(branch.extents.max()) for branch in branches)
        factor, unit = display_unit(diagram.unit, largest)
        for branch, (_, colour, size, filled, _) in zip(branches, BRANCHES, strict=False):
            look: dict[str, Any] = {"color": colour, "markerfacecolor": colour if filled else "none"}
            look |= {"markersize": 1.2 * size, "markeredgewidth": 0.9, "linewidth": 0.9}
            panels[1].plot(branch.values, branch.extents * factor, "o-", **look)
        panels[1].set_ylim(0.0, 1.1 * factor * largest or 1.0)
        panels[1].locator_params(axis="y", nbins=4)
        style.label_axes(panels[1], "", with_unit("std", unit))
    style.label_axes(panels[-1], with_unit(diagram.parameter_name, diagram.parameter_unit), panels[-1].get_ylabel())
    if down is not None:
        ranges = coexistence_ranges(diagram, down) if with_size else ()
        for panel in panels if ranges else ():
            for apart in ranges:
                style.shade(panel, (apart.low, apart.high))
        if ranges:
            step = f"step {step_of(diagram, down):.4g} {diagram.parameter_unit}".strip()
            beyond = any(apart.begins_with_sweep or apart.ends_with_sweep for apart in ranges)
            more = "; they may go on beyond the sweep" if beyond else ""
            style.note(panels[-1], f"two motions at the values tried, {step}{more}")
            lines.append(Line2D([], [], color=style.FLOOR, alpha=0.3, linewidth=9.0, label="shaded: two motions"))
        style.legend_row(figure, lines, heading=diagram.parameter_name)
    style.head(figure, title or f"{diagram.axis_name} once per {diagram.section}, over {diagram.parameter_name}")
    style.no_offset(*panels)
    return figure


def _draw_branch(axes: Axes, branch: BifurcationDiagram, factor: float, looks: tuple[str, str, float, bool]) -> Line2D:
    """Draw one branch; return its legend entry."""
    from matplotlib.lines import Line2D

    name, colour, size, filled = looks
    many = len(branch.points) > 20_000  # draw them smaller, and as pixels in a vector file
    shown = 0.5 * size if many else size
    look: dict[str, Any] = {
        "linestyle": "none",
        "marker": "o",
        "color": colour,
        "markerfacecolor": colour if filled else "none",
        "markeredgewidth": 0.0 if filled else 0.16 * shown,
    }
    order = 2.2 if filled else 2.1
    values = branch.points * factor
    axes.plot(branch.parameter, values, markersize=shown, alpha=0.7, zorder=order, rasterized=many, **look)
    return Line2D([], [], markersize=max(size, 4.0), label=name, **look)


def _runs_of_equal_period(diagram: BifurcationDiagram) -> list[tuple[float, float, int]]:
    """Ranges of neighbouring values with one period that repeat and are wide enough for a label."""
    width = float(np.ptp(diagram.values))
    runs: list[tuple[float, float, int]] = []
    for value, period in zip(diagram.values, diagram.periods, strict=True):
        if runs and runs[-1][2] == period:
            runs[-1] = (runs[-1][0], float(value), period)
        else:
            runs.append((float(value), float(value), period))
    return [run for run in runs if run[2] and run[1] - run[0] >= 0.03 * width]
