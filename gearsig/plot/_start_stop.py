"""Start–stop motion in one figure: speed with impacts, phase plane of the teeth, torque over twist."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from gearsig.checks import FloatArray
from gearsig.errors import InputError
from gearsig.motion import (
    AS_PRINTED,
    AT_REST,
    HUNT_CROSSLEY,
    KELVIN_VOIGT,
    PIECEWISE,
    RUN_DOWN,
    RUN_UP,
    RUNNING,
    TEETH,
    TOOTH_FORCE,
    ForceEstimate,
    Impact,
    NoiseStudy,
    StartStop,
    find_phases,
    shaft_speed_rad_s,
)
from gearsig.plot import _series as series
from gearsig.plot import _style as style
from gearsig.plot._series import thin

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
    for stretch in examined.segments.segments:
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


# --------------------
# Start–stop motion over time: speed, torque and compression, with the phases behind them.
# --------------------


PANEL_IN, START_STOP_COURSE_GAP_IN, START_STOP_COURSE_TOP_IN, BOTTOM_IN = 1.5, 0.4, 0.8, 0.55
COLOURS = {RUN_UP: style.SIMULATED, RUNNING: style.MESH, RUN_DOWN: style.BEARING, AT_REST: style.FLOOR}
ALPHA = 0.16


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
    height = START_STOP_COURSE_TOP_IN + BOTTOM_IN + len(rows) * PANEL_IN + (len(rows) - 1) * START_STOP_COURSE_GAP_IN
    figure = style.new_figure(height)
    all_axes: list[Axes] = []
    for i, (label, values) in enumerate(rows):
        top = START_STOP_COURSE_TOP_IN + i * (PANEL_IN + START_STOP_COURSE_GAP_IN)
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
    phases = find_phases(examined.segments, speed, motion.sampling_rate_hz)
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


# --------------------
# A start–stop drive when it is sound and with something wrong, in one figure: what the motion of both tells.
# --------------------


SOUND, FAULTY = style.MEASURED, style.FAULT
START_STOP_PAIR_TOP_IN, ROW_IN, START_STOP_PAIR_GAP_IN, START_STOP_PAIR_LEFT_IN = 0.75, 2.3, 0.95, 0.85
N_ROWS = 3
START_STOP_PAIR_MOST_POINTS = 20_000


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
    figure = style.new_figure(START_STOP_PAIR_TOP_IN + N_ROWS * ROW_IN + (N_ROWS - 1) * START_STOP_PAIR_GAP_IN + 0.55)
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
    half = (style.WIDTH_IN - 2.0 * START_STOP_PAIR_LEFT_IN - 0.2) / 2.0
    top = START_STOP_PAIR_TOP_IN + row * (ROW_IN + START_STOP_PAIR_GAP_IN)
    left = START_STOP_PAIR_LEFT_IN if column in (None, 0) else 2.0 * START_STOP_PAIR_LEFT_IN + half
    right = style.WIDTH_IN - START_STOP_PAIR_LEFT_IN - half if column == 0 else 0.2
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
        points = examined.portrait.points[-START_STOP_PAIR_MOST_POINTS:]
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
        twist, torque = (
            examined.loop.twist_rad[-START_STOP_PAIR_MOST_POINTS:],
            examined.loop.torque_nm[-START_STOP_PAIR_MOST_POINTS:],
        )
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


# --------------------
# Impacts of the flanks: how hard over time, which tooth, and what they bounce back with.
# --------------------


MARKERS = {1: "o", -1: "s"}
IMPACTS_PANEL_IN, IMPACTS_GAP_IN, IMPACTS_LEFT_IN, IMPACTS_TOP_IN = 2.4, 0.95, 0.85, 0.8
MARK_PT = 4.0


def impacts_figure(
    impacts: Sequence[Impact], n_teeth: int, *, restitution: float | None = None, title: str = ""
) -> Figure:
    """Draw energy over time above; below, energy over the driver's tooth, and restitution over speed of approach.

    Parameters
    ----------
    impacts : sequence of Impact
    n_teeth : int
        Of the driver.
    restitution : float or None
        The rig's, as a line to compare with.
    title : str

    Raises
    ------
    InputError
        If there are no impacts.

    Notes
    -----
    Where an inertia is not known, speed stands for energy.
    """
    if not impacts:
        raise InputError("there are no impacts to draw", allowed="at least one")
    figure = style.new_figure(IMPACTS_TOP_IN + 2 * IMPACTS_PANEL_IN + IMPACTS_GAP_IN + 0.55)
    lower = IMPACTS_TOP_IN + IMPACTS_PANEL_IN + IMPACTS_GAP_IN
    half = (style.WIDTH_IN - 2 * IMPACTS_LEFT_IN - 0.35) / 2
    over_time = style.panel(
        figure, left_in=IMPACTS_LEFT_IN, top_in=IMPACTS_TOP_IN, bottom_in=0.55 + IMPACTS_PANEL_IN + IMPACTS_GAP_IN
    )
    by_tooth = style.panel(
        figure, left_in=IMPACTS_LEFT_IN, right_in=style.WIDTH_IN - IMPACTS_LEFT_IN - half, top_in=lower
    )
    bounce = style.panel(figure, left_in=2 * IMPACTS_LEFT_IN + half, right_in=0.2, top_in=lower)
    has_energy = bool(np.isfinite([i.energy_j for i in impacts]).all())
    label = "energy (J)" if has_energy else "speed (m/s)"
    lines = []
    for flank, (colour, name) in FLANKS.items():
        chosen = [i for i in impacts if i.flank == flank]
        if not chosen:
            continue
        size = [i.energy_j if has_energy else i.speed_mps for i in chosen]
        look = {"color": colour, "marker": MARKERS[flank], "markersize": MARK_PT, "linestyle": "none", "alpha": 0.75}
        lines += over_time.plot([i.time_s for i in chosen], size, label=f"{name}: {len(chosen)}", **look)  # type: ignore[arg-type]  # as named
        by_tooth.plot([i.driver_tooth for i in chosen], size, **look)  # type: ignore[arg-type]  # as named
        bounce.plot([i.speed_mps for i in chosen], [i.restitution for i in chosen], **look)  # type: ignore[arg-type]  # as named
    _finish(over_time, by_tooth, bounce, label, n_teeth)
    if restitution is not None:
        bounce.axhline(restitution, color=style.FLOOR, linewidth=0.9, linestyle="--")
        style.note(bounce, f"dashed: the rig's, {restitution:g}")
    series.legend_row(figure, lines, left_in=IMPACTS_LEFT_IN, top_in=0.5)
    series.headline(figure, title or f"{len(impacts)} impacts of the flanks")
    return figure


def _finish(over_time: Axes, by_tooth: Axes, bounce: Axes, size: str, n_teeth: int) -> None:
    for axes in (over_time, by_tooth):
        axes.set_yscale("log")
    by_tooth.set_xlim(0.5, n_teeth + 0.5)
    by_tooth.locator_params(axis="x", integer=True)
    bounce.set_ylim(0.0, max(1.1, 1.05 * bounce.dataLim.y1))
    bounce.set_xlim(left=0.0)
    style.label_axes(over_time, "time (s)", size)
    style.label_axes(by_tooth, "tooth of the driver", size, "which teeth meet")
    style.label_axes(bounce, "speed of approach (m/s)", "speed after over before", "restitution")
    for axes in (over_time, by_tooth, bounce):
        style.no_offset(axes)


# --------------------
# Force between the teeth over time: measured, piecewise model, Hunt–Crossley, and their errors.
# --------------------


STYLES = {
    PIECEWISE: (style.FAULT, "--"),
    TEETH: (style.FAULT, "--"),
    AS_PRINTED: (style.SHAFT, "-."),
    HUNT_CROSSLEY: (style.BEARING, ":"),
    KELVIN_VOIGT: (style.MESH, "-."),
}
"""Colour and line of each model: the source's figures have solid, dashed and dotted lines."""
FORCE_PANEL_IN, FORCE_GAP_IN, FORCE_LEFT_IN, FORCE_TOP_IN, ZOOM_IN = 2.15, 0.75, 0.85, 0.75, 2.6
AROUND_S = (0.03, 0.09)
"""Shown before and after the blow on the back flank, beside the whole record."""
KILO = 1e-3


def force_figure(estimate: ForceEstimate, reference: str = "", *, title: str = "") -> Figure:
    """Draw forces above and their errors below; beside them the strongest blow on the back flank at a larger scale.

    Parameters
    ----------
    estimate : ForceEstimate
    reference : str
        Of `estimate.references_n`; empty: the first.
    title : str

    Raises
    ------
    InputError
        If nothing was measured to compare with.
    """
    if not estimate.references_n:
        raise InputError("there is no reference force", remedy="draw a recording with a torque channel")
    name = reference or next(iter(estimate.references_n))
    measured = estimate.references_n[name]
    models = [PIECEWISE if name != TOOTH_FORCE else TEETH, HUNT_CROSSLEY]
    time = estimate.motion.time_s
    figure = style.new_figure(FORCE_TOP_IN + 2 * FORCE_PANEL_IN + FORCE_GAP_IN + 0.55)
    zoom = _blow(time, measured)
    columns = [
        ((float(time[0]), float(time[-1])), FORCE_LEFT_IN, ZOOM_IN + 0.95),
        (zoom, style.WIDTH_IN - ZOOM_IN, 0.2),
    ]
    for limits, left, right in columns:
        upper, lower = _column(figure, left, right)
        inside = (time >= limits[0]) & (time <= limits[1])
        lines = _draw(upper, time[inside], {name: measured[inside]} | {m: estimate.forces_n[m][inside] for m in models})
        _draw(lower, time[inside], {m: (estimate.forces_n[m] - measured)[inside] for m in models})
        for axes in (upper, lower):
            axes.set_xlim(*limits)
            axes.locator_params(axis="x", nbins=4 if limits is zoom else 7)
            style.no_offset(axes)
        whole = limits is not zoom
        style.label_axes(upper, "", "force (kN)" if whole else "", "" if whole else "around the lowest force")
        style.label_axes(lower, "time (s)", "error (kN)" if whole else "")
        if whole:
            series.legend_row(figure, lines, left_in=FORCE_LEFT_IN, top_in=0.5)
    errors = [f"{m}: {100.0 * estimate.error(m, name).relative_rms:.3g} % rms" for m in models]
    _title(figure, title or estimate.motion.source or "force between the teeth", ", ".join(errors))
    return figure


def noise_figure(study: NoiseStudy, *, title: str = "") -> Figure:
    """Draw the models' errors over the noise that was added to the compression."""
    figure = style.new_figure(3.6)
    axes = style.panel(figure, left_in=FORCE_LEFT_IN, top_in=0.72)
    lines = []
    for model, rms in study.rms_n.items():
        colour, line = STYLES[model]
        lines += axes.plot(study.levels_um, rms * KILO, line, marker="o", markersize=3.5, color=colour, label=model)
    smallest = float(study.levels_um[1])
    axes.set_xscale("symlog", linthresh=smallest)
    axes.set_yscale("log")
    axes.set_xlim(-0.05 * smallest, 1.05 * float(study.levels_um[-1]))
    axes.set_xticks(study.levels_um, [f"{level:g}" for level in study.levels_um])
    if study.crossover_um is not None:
        axes.axvline(study.crossover_um, color=style.FLOOR, linewidth=0.9)
        style.note(axes, f"grey line: no longer nearer from {study.crossover_um:.3g} µm on")
    style.label_axes(axes, "noise added to the compression (µm rms)", f"error against {study.reference} (kN rms)")
    _title(figure, title or "error over noise", "")
    series.legend_row(figure, lines, left_in=FORCE_LEFT_IN, top_in=0.5)
    return figure


def _column(figure: Figure, left_in: float, right_in: float) -> tuple[Axes, Axes]:
    height = float(figure.get_size_inches()[1])
    upper = style.panel(
        figure,
        left_in=left_in,
        right_in=right_in,
        top_in=FORCE_TOP_IN,
        bottom_in=height - FORCE_TOP_IN - FORCE_PANEL_IN,
    )
    lower = style.panel(
        figure,
        left_in=left_in,
        right_in=right_in,
        top_in=FORCE_TOP_IN + FORCE_PANEL_IN + FORCE_GAP_IN - 0.35,
        sharex=upper,
    )
    return upper, lower


def _draw(axes: Axes, time_s: FloatArray, forces_n: dict[str, FloatArray]) -> list:  # type: ignore[type-arg]  # of Line2D
    lines = []
    for name, force in forces_n.items():
        colour, line = STYLES.get(name, (style.MEASURED, "-"))
        lines += axes.plot(*thin(time_s, force * KILO), line, color=colour, linewidth=1.0, label=name)
    return lines


def _blow(time_s: FloatArray, force_n: FloatArray) -> tuple[float, float]:
    """Time around the lowest force, within the record."""
    at = float(time_s[int(np.argmin(force_n))])
    low = max(float(time_s[0]), at - AROUND_S[0])
    return low, min(float(time_s[-1]), low + sum(AROUND_S))


def _title(figure: Figure, title: str, note: str) -> None:
    from gearsig.plot._style import plain

    width, height = figure.get_size_inches()
    where = 1.0 - 0.2 / height
    figure.text(
        FORCE_LEFT_IN / width, where, plain(title, 60), fontsize=style.TEXT_PT, fontweight="bold", color=style.INK,
        va="center", parse_math=False,
    )  # fmt: skip
    figure.text(
        1.0 - 0.2 / width, where, plain(note, 90), fontsize=style.SMALL_PT, color=style.QUIET, va="center", ha="right",
        parse_math=False,
    )  # fmt: skip
