"""Start–stop motion over time: speed, torque and compression, with the phases behind them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from gearsig.checks import FloatArray
from gearsig.motion.phases import AT_REST, RUN_DOWN, RUN_UP, RUNNING, find_phases, shaft_speed_rad_s
from gearsig.motion.start_stop import StartStop
from gearsig.plot import series, style
from gearsig.plot.thin import thin

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

PANEL_IN, GAP_IN, TOP_IN, BOTTOM_IN = 1.5, 0.4, 0.8, 0.55
COLOURS = {RUN_UP: style.SIMULATED, RUNNING: style.MESH, RUN_DOWN: style.BEARING, AT_REST: style.FLOOR}
ALPHA = 0.16
MICRO = 1e6


def course_figure(examined: StartStop, *, title: str = "") -> Figure:
    """Draw the driver's speed, the torque where it was measured, and the compression with the play.

    Behind all of them the phases are shaded: run-up, running, run-down, rest.

    Parameters
    ----------
    examined : StartStop
    title : str
    """
    motion = examined.motion
    rows: list[tuple[str, FloatArray]] = [("driver (rpm)", motion.driver_speed_rad_s * 30.0 / np.pi)]
    if motion.torque_nm is not None:
        rows.append(("torque (N m)", motion.torque_nm))
    if examined.portrait is not None:
        rows.append(("compression (µm)", examined.portrait.points[:, 0] * MICRO))
    height = TOP_IN + BOTTOM_IN + len(rows) * PANEL_IN + (len(rows) - 1) * GAP_IN
    figure = style.new_figure(height)
    all_axes: list[Axes] = []
    for i, (label, values) in enumerate(rows):
        top = TOP_IN + i * (PANEL_IN + GAP_IN)
        first = all_axes[0] if all_axes else None
        axes = style.panel(figure, top_in=top, bottom_in=height - top - PANEL_IN, sharex=first)
        axes.plot(*thin(motion.time_s, values), color=style.MEASURED, linewidth=0.8)
        is_last = i == len(rows) - 1
        axes.tick_params(labelbottom=is_last)
        style.label_axes(axes, "time (s)" if is_last else "", label)
        style.no_offset(axes)
        all_axes.append(axes)
    all_axes[0].set_xlim(0.0, float(motion.time_s[-1]))
    _shade_phases(figure, all_axes, examined)
    if examined.portrait is not None and examined.backlash is not None:
        _draw_play(all_axes[-1], examined.backlash.backlash_um)
    series.headline(figure, title or motion.source or "start–stop motion")
    return figure


def _shade_phases(figure: Figure, all_axes: list[Axes], examined: StartStop) -> None:
    from matplotlib.lines import Line2D

    motion = examined.motion
    speed = shaft_speed_rad_s(motion.driver_angle_rad, motion.sampling_rate_hz)
    phases = find_phases(examined.course, speed, motion.sampling_rate_hz)
    for phase in phases:
        for axes in all_axes:
            series.shade(axes, (phase.start_s, phase.end_s), COLOURS[phase.name], ALPHA)
    present = {phase.name for phase in phases}
    marks = [
        Line2D([], [], color=colour, alpha=2.0 * ALPHA, linewidth=7.0, label=name)
        for name, colour in COLOURS.items()
        if name in present
    ]
    series.legend_row(figure, marks, left_in=0.85, top_in=0.55)


def _draw_play(axes: Axes, play_um: float) -> None:
    for wall in (-0.5 * play_um, 0.5 * play_um):
        axes.axhline(wall, color=style.INK, linewidth=0.8, linestyle="--")
    style.note(axes, f"dashed: where the flanks touch, {play_um:.4g} µm apart")
