"""A start–stop drive when it is sound and with something wrong, in one figure: what the motion of both tells."""

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

SOUND, FAULTY = style.MEASURED, style.FAULT
TOP_IN, ROW_IN, GAP_IN, LEFT_IN = 0.75, 2.3, 0.95, 0.85
N_ROWS = 3
MOST_POINTS = 20_000
MICRO = 1e6


def start_stop_pair_figure(
    sound: StartStop,
    faulty: StartStop,
    *,
    curves_um: tuple[FloatArray, FloatArray] | None = None,
    title: str = "",
) -> Figure:
    """Draw speeds, phase planes, loops of torque over twist, course over the mesh cycle, and teeth one by one.

    Parameters
    ----------
    sound, faulty : StartStop
    curves_um : (array, array) or None
        Course of the compression on the drive flank over equal parts of the mesh cycle, in µm, sound and faulty.
    title : str
    """
    figure = style.new_figure(TOP_IN + N_ROWS * ROW_IN + (N_ROWS - 1) * GAP_IN + 0.55)
    both = (sound, faulty)
    _draw_speeds(_panel(figure, 0, None), both, title)
    _draw_planes(_panel(figure, 1, 0), both)
    _draw_loops(_panel(figure, 1, 1), both)
    _draw_courses(_panel(figure, 2, 0), curves_um)
    _draw_teeth(_panel(figure, 2, 1), both)
    for axes in figure.axes:
        style.no_offset(axes)
    _draw_legend(figure)
    return figure


def _draw_legend(figure: Figure) -> None:
    """Say once which colour is which."""
    from matplotlib.lines import Line2D

    handles = [Line2D([], [], color=colour, label=name) for colour, name in ((SOUND, "sound"), (FAULTY, "faulty"))]
    figure.legend(
        handles=handles, loc="upper right", ncols=2, fontsize=style.SMALL_PT, frameon=False, labelcolor=style.INK,
        bbox_to_anchor=(1.0 - 0.15 / style.WIDTH_IN, 1.0 - 0.08 / float(figure.get_size_inches()[1])),
    )  # fmt: skip


def _panel(figure: Figure, row: int, column: int | None) -> Axes:
    """Add axes: a row of the page, its left or its right half (None: both)."""
    height = float(figure.get_size_inches()[1])
    half = (style.WIDTH_IN - 2.0 * LEFT_IN - 0.2) / 2.0
    top = TOP_IN + row * (ROW_IN + GAP_IN)
    left = LEFT_IN if column in (None, 0) else 2.0 * LEFT_IN + half
    right = style.WIDTH_IN - LEFT_IN - half if column == 0 else 0.2
    return style.panel(figure, left_in=left, right_in=right, top_in=top, bottom_in=height - top - ROW_IN)


def _draw_speeds(axes: Axes, both: tuple[StartStop, StartStop], title: str) -> None:
    for examined, colour in zip(both, (SOUND, FAULTY), strict=True):
        m = examined.motion
        axes.plot(*thin(m.time_s, m.driver_speed_rad_s * 30.0 / np.pi), color=colour, linewidth=0.9, alpha=0.8)
    axes.set_xlim(0.0, float(both[0].motion.time_s[-1]))
    style.label_axes(axes, "time (s)", "driver's speed (rpm)", title or "sound beside faulty")


def _draw_planes(axes: Axes, both: tuple[StartStop, StartStop]) -> None:
    style.label_axes(axes, "compression (µm)", "its rate (mm/s)", "phase plane of the teeth")
    if any(one.portrait is None for one in both):
        series.write(axes, 0.5, 0.5, "the middle of the play is not known")
        return
    for examined, colour in zip(both, (SOUND, FAULTY), strict=True):
        assert examined.portrait is not None  # noqa: S101  looked at above
        points = examined.portrait.points[-MOST_POINTS:]
        axes.plot(points[:, 0] * MICRO, points[:, 1] * 1e3, color=colour, linewidth=0.5, alpha=0.6)
    plays = [one.backlash.backlash_um for one in both if one.backlash is not None]
    if len(plays) == len(both):
        style.note(axes, f"play {plays[0]:.4g} and {plays[1]:.4g} µm")


def _draw_loops(axes: Axes, both: tuple[StartStop, StartStop]) -> None:
    style.label_axes(axes, "twist at the driver (mrad)", "torque (N m)", "torque over twist")
    for examined, colour in zip(both, (SOUND, FAULTY), strict=True):
        if examined.loop is None:
            series.write(axes, 0.5, 0.5, "no torque was measured")
            return
        twist, torque = examined.loop.twist_rad[-MOST_POINTS:], examined.loop.torque_nm[-MOST_POINTS:]
        axes.plot(twist * 1e3, torque, color=colour, linewidth=0.5, alpha=0.6)


def _draw_courses(axes: Axes, curves_um: tuple[FloatArray, FloatArray] | None) -> None:
    style.label_axes(axes, "part of the mesh cycle", "compression (µm)", "drive flank over the mesh cycle")
    if curves_um is None:
        axes.set_yticks([])
        series.write(axes, 0.5, 0.5, "no starts and stops to tell it from")
        return
    for curve, colour in zip(curves_um, (SOUND, FAULTY), strict=True):
        place = (np.arange(len(curve)) + 0.5) / len(curve)
        axes.plot(place, curve, color=colour, linewidth=1.2, marker=".", markersize=4)
    axes.set_xlim(0.0, 1.0)


def _draw_teeth(axes: Axes, both: tuple[StartStop, StartStop]) -> None:
    style.label_axes(axes, "tooth of the driver", "yields more by (µm)", "teeth one by one")
    for examined, colour, shift in zip(both, (SOUND, FAULTY), (-0.2, 0.2), strict=True):
        if examined.teeth is None:
            series.write(axes, 0.5, 0.5, "teeth cannot be told one by one")
            return
        extra = examined.teeth.extra_um
        axes.bar(np.arange(1, len(extra) + 1) + shift, np.nan_to_num(extra), width=0.4, color=colour)
    axes.locator_params(axis="x", integer=True)
    axes.axhline(0.0, color=style.RULE, linewidth=0.8)
