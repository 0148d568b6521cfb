"""Start–stop motion in one figure: speed with impacts, phase plane of the teeth, torque over twist."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from gearsig.checks import FloatArray
from gearsig.motion.start_stop import StartStop
from gearsig.plot import series, style
from gearsig.plot.thin import thin

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

UPPER_IN, LOWER_IN, LEFT_IN, GAP_IN, TOP_IN = 2.0, 3.0, 0.85, 0.95, 0.75
FLANKS = {1: (style.FAULT, "drive flank"), -1: (style.BEARING, "back flank")}
MOST_POINTS = 40_000
MICRO = 1e6


def start_stop_figure(examined: StartStop, *, title: str = "") -> Figure:
    """Draw the driver's speed with rests shaded and impacts marked; below, the phase plane and torque over twist.

    Parameters
    ----------
    examined : StartStop
    title : str
    """
    figure = style.new_figure(TOP_IN + UPPER_IN + GAP_IN + LOWER_IN + 0.55)
    height = float(figure.get_size_inches()[1])
    over = style.panel(figure, left_in=LEFT_IN, right_in=0.85, top_in=TOP_IN, bottom_in=height - TOP_IN - UPPER_IN)
    half = (style.WIDTH_IN - 2 * LEFT_IN - 0.35) / 2
    left = style.panel(
        figure, left_in=LEFT_IN, right_in=style.WIDTH_IN - LEFT_IN - half, top_in=TOP_IN + UPPER_IN + GAP_IN
    )
    right = style.panel(figure, left_in=2 * LEFT_IN + half, right_in=0.2, top_in=TOP_IN + UPPER_IN + GAP_IN)
    _draw_speed(figure, over, examined)
    _draw_plane(left, examined)
    _draw_loop(right, examined)
    for axes in (over, left, right):
        style.no_offset(axes)
    style.label_axes(over, "time (s)", "driver's speed (rpm)", title or examined.motion.source or "start–stop motion")
    return figure


def _draw_speed(figure: Figure, axes: Axes, examined: StartStop) -> None:
    motion = examined.motion
    axes.plot(*thin(motion.time_s, motion.driver_speed_rad_s * 30.0 / np.pi), color=style.MEASURED, linewidth=0.9)
    for stretch in examined.course.stretches:
        if not stretch.direction:
            series.shade(axes, (stretch.start_s, stretch.end_s))
    axes.set_xlim(0.0, float(motion.time_s[-1]))
    if not examined.impacts:
        return
    speeds = axes.twinx()
    for flank, (colour, name) in FLANKS.items():
        chosen = [i for i in examined.impacts if i.flank == flank]
        if chosen:
            speeds.vlines(
                [i.time_s for i in chosen], 0.0, [i.speed_mps for i in chosen], color=colour, linewidth=1.0,
                label=f"impact, {name}",
            )  # fmt: skip
    speeds.set_ylim(0.0, 1.6 * max(i.speed_mps for i in examined.impacts))
    speeds.tick_params(colors=style.QUIET, labelcolor=style.INK, labelsize=style.SMALL_PT)
    speeds.spines["top"].set_visible(False)
    style.label_axes(speeds, "", "speed of impact (m/s)")
    style.no_offset(speeds)
    figure.legend(
        loc="upper right", bbox_to_anchor=(1.0 - 0.75 / style.WIDTH_IN, 1.0 - 0.08 / figure.get_size_inches()[1]),
        ncols=2, fontsize=style.SMALL_PT, frameon=False, labelcolor=style.INK,
    )  # fmt: skip


def _draw_plane(axes: Axes, examined: StartStop) -> None:
    style.label_axes(axes, "compression (µm)", "its rate (mm/s)", "phase plane of the teeth")
    portrait = examined.portrait
    if portrait is None:
        series.write(axes, 0.5, 0.5, "the middle of the play is not known")
        return
    points = _few(portrait.points)
    axes.plot(points[:, 0] * MICRO, points[:, 1] * 1e3, color=style.MEASURED, linewidth=0.5, alpha=0.7)
    if examined.backlash is not None:
        play = examined.backlash.backlash_um
        for wall in (-0.5 * play, 0.5 * play):
            axes.axvline(wall, color=style.FLOOR, linewidth=0.9, linestyle="--")
        style.note(axes, f"play {play:.4g} µm")


def _draw_loop(axes: Axes, examined: StartStop) -> None:
    style.label_axes(axes, "twist at the driver (mrad)", "torque (N m)", "torque over twist")
    loop = examined.loop
    if loop is None:
        series.write(axes, 0.5, 0.5, "no torque was measured")
        return
    points = _few(np.stack([loop.twist_rad, loop.torque_nm], axis=1))
    axes.plot(points[:, 0] * 1e3, points[:, 1], color=style.MEASURED, linewidth=0.5, alpha=0.7)
    if loop.n_cycles:
        style.note(axes, f"{loop.loss_per_cycle_j:.3g} J lost of {loop.work_per_cycle_j:.4g} J per cycle")


def _few(points: FloatArray) -> FloatArray:
    """Return the last so many points: a longer path is a blot."""
    return points[-MOST_POINTS:]
