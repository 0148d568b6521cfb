"""Figures of start–stop motion: speed and impacts, phase plane of the teeth, torque over twist, tooth forces."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from gearsig import motion as motions
from gearsig.checks import FloatArray
from gearsig.errors import InputError
from gearsig.plot import _style as style
from gearsig.plot._style import KILO, MICRO, MILLI, thin

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

HEALTHY, FAULTY = style.MEASURED, style.FAULT
FLANKS = {1: (style.FAULT, "drive flank", "o"), -1: (style.BEARING, "back flank", "s")}
PHASES = {
    motions.RUN_UP: style.SIMULATED,
    motions.RUNNING: style.MESH,
    motions.RUN_DOWN: style.BEARING,
    motions.AT_REST: style.FLOOR,
}
MODELS = {
    motions.PIECEWISE: (style.FAULT, "--"),
    motions.TEETH: (style.FAULT, "--"),
    motions.AS_PRINTED: (style.SHAFT, "-."),
    motions.HUNT_CROSSLEY: (style.BEARING, ":"),
    motions.KELVIN_VOIGT: (style.MESH, "-."),
}
"""Colour and line style of each model: the source's figures have solid, dashed and dotted lines."""

Drawn = Sequence[tuple[motions.StartStop, str]]
"""Motions with their colours."""


def start_stop_figure(examined: motions.StartStop, *, title: str = "") -> Figure:
    """Draw the driver's speed with rests shaded and impacts marked, and below it the phase plane and torque over twist.

    Parameters
    ----------
    examined : StartStop
    title : str
    """
    figure, (over, plane, loop) = _panels_below_a_wide_one((2.0, 3.0), right_in=0.85)
    drawn = [(examined, style.MEASURED)]
    _draw_speeds(over, drawn, title or examined.motion.source or "start–stop motion")
    for segment in examined.segments.segments:
        if not segment.direction:
            style.shade(over, (segment.start_s, segment.end_s))
    if examined.impacts:
        _draw_impact_speeds(figure, over, examined.impacts)
    _draw_planes(plane, drawn)
    if examined.portrait is not None and examined.backlash is not None:
        for wall in (-0.5, 0.5):
            plane.axvline(wall * examined.backlash.backlash_um, color=style.FLOOR, linewidth=0.9, linestyle="--")
    _draw_loops(loop, drawn)
    if examined.loop is not None and examined.loop.n_cycles:
        lost, work = examined.loop.loss_per_cycle_j, examined.loop.work_per_cycle_j
        uncertain = examined.loop.loss_uncertainty_j
        loss = f"{lost:.3g}" if lost > uncertain else f"at most {max(abs(lost), uncertain):.2g}"
        style.note(loop, f"{loss} of {work:.3g} J lost per cycle")
    return figure


def start_stop_pair_figure(
    healthy: motions.StartStop,
    faulty: motions.StartStop,
    *,
    curves_um: tuple[FloatArray, FloatArray] | None = None,
    title: str = "",
) -> Figure:
    """Draw speeds, phase planes, torque–twist loops, the profile over the mesh cycle, and individual teeth.

    Parameters
    ----------
    healthy, faulty : StartStop
    curves_um : (array, array) or None
        Compression on the drive flank in µm over equal parts of the mesh cycle, healthy and faulty.
    title : str
    """
    figure, (over, plane, loop, profile, teeth) = _panels_below_a_wide_one((2.3, 2.3, 2.3))
    drawn = [(healthy, HEALTHY), (faulty, FAULTY)]
    _draw_speeds(over, drawn, title or "healthy beside faulty")
    _draw_planes(plane, drawn)
    _draw_loops(loop, drawn)
    style.label_axes(profile, "part of the mesh cycle", "compression (µm)", "drive flank over the mesh cycle")
    if curves_um is None:
        profile.set_yticks([])
        style.write(profile, 0.5, 0.5, "no starts and stops to estimate it from")
    for curve, (_, colour) in zip(curves_um or (), drawn, strict=False):
        place = (np.arange(len(curve)) + 0.5) / len(curve)
        profile.plot(place, curve, color=colour, linewidth=1.2, marker=".", markersize=4)
        profile.set_xlim(0.0, 1.0)
    style.label_axes(teeth, "tooth of the driver", "extra deflection (µm)", "individual teeth")
    for (examined, colour), shift in zip(drawn, (-0.2, 0.2), strict=True):
        if examined.teeth is None:
            style.write(teeth, 0.5, 0.5, "individual teeth cannot be distinguished")
            break
        extra = examined.teeth.extra_um
        teeth.bar(np.arange(1, len(extra) + 1) + shift, np.nan_to_num(extra), width=0.4, color=colour)
    else:
        teeth.locator_params(axis="x", integer=True)
        teeth.axhline(0.0, color=style.RULE, linewidth=0.8)
    _legend(figure, [_key(colour, label=name) for name, colour in (("healthy", HEALTHY), ("faulty", FAULTY))])
    return figure


def _panels_below_a_wide_one(heights_in: Sequence[float], *, right_in: float = 0.2) -> tuple[Figure, list[Axes]]:
    """Return two columns of panels whose first row is a single panel."""
    figure, axes = style.panels(heights_in, (1.0, 1.0), right_in=right_in, top_in=0.75, row_gap_in=0.95)
    axes.pop(1).remove()
    place = axes[0].get_subplotspec()
    assert place is not None  # noqa: S101 - it is in a grid
    axes[0].set_subplotspec(place.get_gridspec()[0, :])
    style.no_offset(*axes)
    return figure, axes


def _draw_speeds(axes: Axes, drawn: Drawn, title: str) -> None:
    for examined, colour in drawn:
        speed_rpm = examined.motion.driver_speed_rad_s * 30.0 / np.pi
        axes.plot(*thin(examined.motion.time_s, speed_rpm), color=colour, linewidth=0.9, alpha=0.8)
    axes.set_xlim(0.0, float(drawn[0][0].motion.time_s[-1]))
    style.label_axes(axes, "time (s)", "driver's speed (rpm)", title)


def _draw_impact_speeds(figure: Figure, over: Axes, impacts: Sequence[motions.Impact]) -> None:
    axes = over.twinx()
    for flank, (colour, name, _) in FLANKS.items():
        chosen = [impact for impact in impacts if impact.flank == flank]
        if chosen:
            times, speeds = [impact.time_s for impact in chosen], [impact.speed_mps for impact in chosen]
            axes.vlines(times, 0.0, speeds, color=colour, linewidth=1.0, label=f"impact, {name}")
    axes.set_ylim(0.0, 1.6 * max(i.speed_mps for i in impacts))
    axes.tick_params(colors=style.QUIET, labelcolor=style.INK, labelsize=style.SMALL_PT)
    axes.spines["top"].set_visible(False)
    style.label_axes(axes, "", "impact speed (m/s)")
    style.no_offset(axes)
    _legend(figure, axes.get_legend_handles_labels()[0])


def _legend(figure: Figure, handles: Sequence[object]) -> None:
    """Name the colours in the upper right corner."""
    looks: dict[str, Any] = {"fontsize": style.SMALL_PT, "frameon": False, "labelcolor": style.INK}
    figure.legend(handles=handles, loc="upper right", bbox_to_anchor=style.upper_right(figure), ncols=2, **looks)


def _key(colour: str, **looks: object) -> Line2D:
    from matplotlib.lines import Line2D

    return Line2D([], [], color=colour, **looks)  # type: ignore[arg-type]  # as named


def _draw_planes(axes: Axes, drawn: Drawn) -> None:
    style.label_axes(axes, "compression (µm)", "its rate (mm/s)", "phase plane of the teeth")
    for examined, colour in drawn:
        if examined.portrait is None:
            style.write(axes, 0.5, 0.5, "the middle of the backlash is not known")
            return
        _draw_path(axes, examined.portrait.points * (MICRO, MILLI), colour)
    plays = [f"{examined.backlash.backlash_um:.4g}" for examined, _ in drawn if examined.backlash is not None]
    if len(plays) == len(drawn):
        style.note(axes, f"backlash {' and '.join(plays)} µm")


def _draw_loops(axes: Axes, drawn: Drawn) -> None:
    style.label_axes(axes, "twist at the driver (mrad)", "torque (N·m)", "torque over twist")
    for examined, colour in drawn:
        if examined.loop is None:
            style.write(axes, 0.5, 0.5, "no torque was measured")
            return
        _draw_path(axes, np.stack([examined.loop.twist_rad * MILLI, examined.loop.torque_nm], axis=1), colour)


def _draw_path(axes: Axes, points: FloatArray, colour: str) -> None:
    """Draw the last points; a longer path would overlap too much."""
    axes.plot(*points[-40_000:].T, color=colour, linewidth=0.5, alpha=0.65)


def motion_profile_figure(examined: motions.StartStop, *, title: str = "") -> Figure:
    """Draw the driver's speed, the torque if it was measured, and the compression with the backlash.

    The phases are shaded behind them: run-up, running, run-down, rest.

    Parameters
    ----------
    examined : StartStop
    title : str
    """
    motion = examined.motion
    rows: dict[str, FloatArray] = {"driver (rpm)": motion.driver_speed_rad_s * 30.0 / np.pi}
    if motion.torque_nm is not None:
        rows["torque (N·m)"] = motion.torque_nm
    if examined.portrait is not None:
        rows["compression (µm)"] = examined.portrait.points[:, 0] * MICRO
    figure, every = style.panels([1.5] * len(rows), top_in=0.8, row_gap_in=0.4, share_x=True)
    speed = motions.shaft_speed_rad_s(motion.driver_angle_rad, motion.sampling_rate_hz)
    phases = motions.find_phases(examined.segments, speed, motion.sampling_rate_hz)
    alpha = 0.16
    for axes, (label, values) in zip(every, rows.items(), strict=True):
        axes.plot(*thin(motion.time_s, values), color=style.MEASURED, linewidth=0.8)
        style.label_axes(axes, "time (s)" if axes is every[-1] else "", label)
        style.no_offset(axes)
        for phase in phases:
            style.shade(axes, (phase.start_s, phase.end_s), PHASES[phase.name], alpha)
    every[0].set_xlim(0.0, float(motion.time_s[-1]))
    if examined.portrait is not None and examined.backlash is not None:
        play_um = examined.backlash.backlash_um
        for wall in (-0.5, 0.5):
            every[-1].axhline(wall * play_um, color=style.INK, linewidth=0.8, linestyle="--")
        style.note(every[-1], f"dashed: where the flanks touch, {play_um:.4g} µm apart")
    present = {phase.name for phase in phases}
    keys = [_key(colour, alpha=2 * alpha, linewidth=7.0, label=n) for n, colour in PHASES.items() if n in present]
    style.head(figure, title or motion.source or "start–stop motion", keys)
    return figure


def impacts_figure(
    impacts: Sequence[motions.Impact], n_teeth: int, *, restitution: float | None = None, title: str = ""
) -> Figure:
    """Draw impact energy over time and over the driver's tooth, and restitution over approach speed.

    Parameters
    ----------
    impacts : sequence of Impact
    n_teeth : int
        Of the driver.
    restitution : float or None
        The rig's, drawn as a line for comparison.
    title : str

    Raises
    ------
    InputError
        If there are no impacts.

    Notes
    -----
    If an inertia is not known, speed is drawn instead of energy.
    """
    if not impacts:
        raise InputError("there are no impacts to draw", allowed="at least one")
    figure, (over_time, by_tooth, bounce) = _panels_below_a_wide_one((2.4, 2.4))
    has_energy = bool(np.isfinite([i.energy_j for i in impacts]).all())
    lines = []
    for flank, (colour, name, marker) in FLANKS.items():
        chosen = [i for i in impacts if i.flank == flank]
        if not chosen:
            continue
        size, speeds = [i.energy_j if has_energy else i.speed_mps for i in chosen], [i.speed_mps for i in chosen]
        panels = (
            (over_time, [i.time_s for i in chosen], size),
            (by_tooth, [i.driver_tooth for i in chosen], size),
            (bounce, speeds, [i.restitution for i in chosen]),
        )
        label = f"{name}: {len(chosen)}"
        for axes, x, y in panels:
            drawn = axes.plot(x, y, marker, color=colour, markersize=4.0, alpha=0.75, label=label)
            lines += drawn if axes is over_time else []
    over_time.set_yscale("log")
    by_tooth.set_yscale("log")
    by_tooth.set_xlim(0.5, n_teeth + 0.5)
    by_tooth.locator_params(axis="x", integer=True)
    bounce.set_ylim(0.0, max(1.1, 1.05 * bounce.dataLim.y1))
    bounce.set_xlim(left=0.0)
    quantity = "energy (J)" if has_energy else "speed (m/s)"
    style.label_axes(over_time, "time (s)", quantity)
    style.label_axes(by_tooth, "tooth of the driver", quantity, "teeth in contact")
    style.label_axes(bounce, "approach speed (m/s)", "speed after / before", "restitution")
    if restitution is not None:
        bounce.axhline(restitution, color=style.FLOOR, linewidth=0.9, linestyle="--")
        style.note(bounce, f"dashed: the rig's, {restitution:g}")
    style.head(figure, title or f"{len(impacts)} impacts of the flanks", lines)
    return figure


def force_figure(estimate: motions.ForceEstimate, reference: str = "", *, title: str = "") -> Figure:
    """Draw forces above and their errors below, and beside them the strongest impact on the back flank, enlarged.

    Parameters
    ----------
    estimate : ForceEstimate
    reference : str
        Of `estimate.references_n`; empty: the first.
    title : str

    Raises
    ------
    InputError
        If there is no measured reference.
    """
    if not estimate.references_n:
        raise InputError("there is no reference force", remedy="draw a recording with a torque channel")
    name = reference or next(iter(estimate.references_n))
    measured, time = estimate.references_n[name], estimate.motion.time_s
    models = [motions.PIECEWISE if name != motions.TOOTH_FORCE else motions.TEETH, motions.HUNT_CROSSLEY]
    figure, axes = style.panels(
        (2.15, 2.15), (1.25, 1.0), top_in=0.75, row_gap_in=0.4, column_gap_in=0.75, share_x=True
    )
    # Beside the whole record: 120 ms around the minimum force.
    start = max(float(time[0]), float(time[int(np.argmin(measured))]) - 0.03)
    at_impact = (start, min(float(time[-1]), start + 0.12))
    lines = []
    for column, limits in enumerate(((float(time[0]), float(time[-1])), at_impact)):
        upper, lower = axes[column::2]
        inside = (time >= limits[0]) & (time <= limits[1])
        forces = {name: measured} | {model: estimate.forces_n[model] for model in models}
        errors = {model: estimate.forces_n[model] - measured for model in models}
        for panel, curves in ((upper, forces), (lower, errors)):
            for label, force in curves.items():
                colour, line = MODELS.get(label, (style.MEASURED, "-"))
                points = thin(time[inside], force[inside] * KILO)
                drawn = panel.plot(*points, line, color=colour, linewidth=1.0, label=label)
                lines += drawn if panel is axes[0] else []
            panel.set_xlim(*limits)
            panel.locator_params(axis="x", nbins=4 if column else 7)
            style.no_offset(panel)
        style.label_axes(upper, "", "" if column else "force (kN)", "around the lowest force" if column else "")
        style.label_axes(lower, "time (s)", "" if column else "error (kN)")
    style.head(figure, title or estimate.motion.source or "force between the teeth", lines)
    rms = ", ".join(f"{m}: {100.0 * estimate.error(m, name).relative_rms:.3g} % rms" for m in models)
    style.put_text(figure, *style.upper_right(figure), rms, ha="right", va="top")
    return figure


def noise_figure(study: motions.NoiseStudy, *, title: str = "") -> Figure:
    """Draw the models' errors over the noise added to the compression."""
    figure, (axes,) = style.panels((2.3,))
    lines = []
    for model, rms in study.rms_n.items():
        colour, line = MODELS[model]
        lines += axes.plot(study.levels_um, rms * KILO, line, marker="o", markersize=3.5, color=colour, label=model)
    smallest = float(study.levels_um[1])
    axes.set_xscale("symlog", linthresh=smallest)
    axes.set_yscale("log")
    axes.set_xlim(-0.05 * smallest, 1.05 * float(study.levels_um[-1]))
    axes.set_xticks(study.levels_um, [f"{level:g}" for level in study.levels_um])
    if study.crossover_um is not None:
        axes.axvline(study.crossover_um, color=style.FLOOR, linewidth=0.9)
        style.note(axes, f"grey line: no longer closer from {study.crossover_um:.3g} µm")
    style.label_axes(axes, "noise added to the compression (µm rms)", f"rms error against {study.reference} (kN)")
    style.head(figure, title or "error over noise", lines)
    return figure
