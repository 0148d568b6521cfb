"""Mesh stiffness, load sharing and static transmission error over the mesh."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from gearsig.checks import FloatArray
from gearsig.errors import InputError
from gearsig.plot import series, style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

HEIGHT_IN = 3.3
ZOOM_IN = 2.55
GAP_IN = 0.85
STIFFNESS_UNIT = 1e8
CYCLES = "mesh cycles (tooth passages)"


def mesh_stiffness_figure(
    mesh_cycles: FloatArray,
    stiffness_n_per_m: Mapping[str, FloatArray],
    *,
    single_pair: tuple[float, float] | None = None,
    heading: str = "",
    title: str = "",
) -> Figure:
    """Draw the stiffness of the whole mesh for several cases, with a close view of a single-pair region.

    Parameters
    ----------
    mesh_cycles : array, (n,)
        Ascending.
    stiffness_n_per_m : mapping
        Name of the case → array, (n,); in their order from dark to light.
    single_pair : (float, float) or None
        Mesh cycles of the region to enlarge; None: no second panel.
    heading : str
        Before the names, e.g. "crack depth".
    title : str

    Returns
    -------
    Figure

    Raises
    ------
    InputError
        On wrong lengths, or a region without two points of the axis.
    """
    x = series.checked_axis(mesh_cycles, "mesh_cycles")
    curves = series.checked_curves(stiffness_n_per_m, len(x), "stiffness_n_per_m")
    figure = style.new_figure(HEIGHT_IN)
    top = 0.36 + series.LEGEND_IN
    right = 0.2 if single_pair is None else 0.2 + ZOOM_IN + GAP_IN
    axes = style.panel(figure, right_in=right, bottom_in=0.55, top_in=top)
    lines = _draw_stiffness(axes, x, curves)
    axes.set_xlim(float(x[0]), float(x[-1]))
    style.label_axes(axes, CYCLES, "mesh stiffness (10⁸ N/m)")
    if single_pair is not None:
        low, high = series.checked_limits(single_pair, "single_pair")
        zoom = style.panel(figure, left_in=style.WIDTH_IN - 0.2 - ZOOM_IN, bottom_in=0.55, top_in=top)
        _zoom(zoom, x, curves, (low, high))
        series.shade(axes, (low, high))
        style.label_axes(zoom, "mesh cycles", "mesh stiffness (10⁸ N/m)")
        series.write(zoom, (low + high) / 2, 1.01, "one pair in contact (shaded)")
    series.legend_row(figure, lines, left_in=0.85, top_in=series.NAMES_AT_IN, heading=heading)
    series.headline(figure, title)
    return figure


def load_sharing_figure(
    mesh_cycles: FloatArray,
    pair_forces_n: Mapping[str, FloatArray],
    transmission_error_m: Mapping[str, FloatArray],
    *,
    title: str = "",
) -> Figure:
    """Draw the force of each tooth pair, and below it the static transmission error.

    Parameters
    ----------
    mesh_cycles : array, (n,)
        Ascending.
    pair_forces_n : mapping
        Name of the pair → array, (n,); where it is 0 the pair does not touch and nothing is drawn.
    transmission_error_m : mapping
        Name of the case → array, (n,).
    title : str

    Returns
    -------
    Figure
    """
    x = series.checked_axis(mesh_cycles, "mesh_cycles")
    forces = series.checked_curves(pair_forces_n, len(x), "pair_forces_n")
    errors = series.checked_curves(transmission_error_m, len(x), "transmission_error_m")
    figure = style.new_figure(4.7)
    upper = style.panel(figure, bottom_in=2.55, top_in=0.55)
    lower = style.panel(figure, bottom_in=0.55, top_in=2.65, sharex=upper)
    highest = max(float(force.max()) for force in forces.values())
    for (label, force), colour in zip(forces.items(), series.series_colours(len(forces)), strict=True):
        upper.plot(x, _touching(force), color=colour, linewidth=1.6, label=label)
        if force.max() > 0.95 * highest:
            plateau = x[force > 0.98 * force.max()]
            series.write(upper, float(plateau.mean()), 1.02, label, colour=colour)
    upper.set_ylim(0.0, 1.06 * highest or 1.0)
    upper.tick_params(labelbottom=False)
    cases = [
        lower.plot(x, error * 1e6, color=colour, linewidth=1.4, label=label)[0]
        for (label, error), colour in zip(errors.items(), series.series_colours(len(errors)), strict=True)
    ]
    lower.set_xlim(float(x[0]), float(x[-1]))
    style.label_axes(upper, "", "force of a pair (N)")
    style.label_axes(lower, CYCLES, "transmission error (µm)")
    series.legend_row(figure, cases, left_in=0.85, top_in=2.46)
    series.headline(figure, title)
    return figure


def _draw_stiffness(axes: Axes, x: FloatArray, curves: Mapping[str, FloatArray]) -> list[Line2D]:
    colours = series.series_colours(len(curves))
    # The first case is the reference: it lies on top where all coincide.
    lines = [
        axes.plot(x, k / STIFFNESS_UNIT, color=colour, linewidth=1.4, label=label, zorder=3 - i * 0.01)[0]
        for i, ((label, k), colour) in enumerate(zip(curves.items(), colours, strict=True))
    ]
    style.no_offset(axes)
    return lines


def _zoom(axes: Axes, x: FloatArray, curves: Mapping[str, FloatArray], limits: tuple[float, float]) -> None:
    inside = (x >= limits[0]) & (x <= limits[1])
    if np.count_nonzero(inside) < 2:
        raise InputError(
            f"single_pair, {limits[0]:g} to {limits[1]:g}, holds {np.count_nonzero(inside)} point(s) of mesh_cycles",
            allowed="at least 2",
            remedy="give a finer axis or a region on it",
        )
    _draw_stiffness(axes, x[inside], {label: k[inside] for label, k in curves.items()})
    axes.set_xlim(*limits)
    axes.locator_params(axis="x", nbins=4)


def _touching(force: FloatArray) -> FloatArray:
    """Return the force with NaN where the pair is out of contact, the zero next to a contact kept."""
    idle = force == 0.0
    inside = idle.copy()
    inside[1:] &= idle[:-1]
    inside[:-1] &= idle[1:]
    return np.where(inside, np.nan, force)
