"""Force between the teeth over time: measured, piecewise model, Hunt–Crossley, and their errors."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from gearsig.checks import FloatArray
from gearsig.errors import InputError
from gearsig.motion.force import AS_PRINTED, HUNT_CROSSLEY, KELVIN_VOIGT, PIECEWISE, TEETH, TOOTH_FORCE
from gearsig.motion.noise_study import NoiseStudy
from gearsig.motion.types import ForceEstimate
from gearsig.plot import series, style
from gearsig.plot.thin import thin

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

STYLES = {
    PIECEWISE: (style.FAULT, "--"),
    TEETH: (style.FAULT, "--"),
    AS_PRINTED: (style.SHAFT, "-."),
    HUNT_CROSSLEY: (style.BEARING, ":"),
    KELVIN_VOIGT: (style.MESH, "-."),
}
"""Colour and line of each model: the source's figures have solid, dashed and dotted lines."""
PANEL_IN, GAP_IN, LEFT_IN, TOP_IN, ZOOM_IN = 2.15, 0.75, 0.85, 0.75, 2.6
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
    figure = style.new_figure(TOP_IN + 2 * PANEL_IN + GAP_IN + 0.55)
    zoom = _blow(time, measured)
    columns = [((float(time[0]), float(time[-1])), LEFT_IN, ZOOM_IN + 0.95), (zoom, style.WIDTH_IN - ZOOM_IN, 0.2)]
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
            series.legend_row(figure, lines, left_in=LEFT_IN, top_in=0.5)
    errors = [f"{m}: {100.0 * estimate.error(m, name).relative_rms:.3g} % rms" for m in models]
    _title(figure, title or estimate.motion.source or "force between the teeth", ", ".join(errors))
    return figure


def noise_figure(study: NoiseStudy, *, title: str = "") -> Figure:
    """Draw the models' errors over the noise that was added to the compression."""
    figure = style.new_figure(3.6)
    axes = style.panel(figure, left_in=LEFT_IN, top_in=0.72)
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
    series.legend_row(figure, lines, left_in=LEFT_IN, top_in=0.5)
    return figure


def _column(figure: Figure, left_in: float, right_in: float) -> tuple[Axes, Axes]:
    height = float(figure.get_size_inches()[1])
    upper = style.panel(figure, left_in=left_in, right_in=right_in, top_in=TOP_IN, bottom_in=height - TOP_IN - PANEL_IN)
    lower = style.panel(
        figure, left_in=left_in, right_in=right_in, top_in=TOP_IN + PANEL_IN + GAP_IN - 0.35, sharex=upper
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
    from gearsig.plot.display import plain

    width, height = figure.get_size_inches()
    where = 1.0 - 0.2 / height
    figure.text(
        LEFT_IN / width, where, plain(title, 60), fontsize=style.TEXT_PT, fontweight="bold", color=style.INK,
        va="center", parse_math=False,
    )  # fmt: skip
    figure.text(
        1.0 - 0.2 / width, where, plain(note, 90), fontsize=style.SMALL_PT, color=style.QUIET, va="center", ha="right",
        parse_math=False,
    )  # fmt: skip
