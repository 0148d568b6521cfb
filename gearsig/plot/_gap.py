"""Figures of a gap: measured and simulated spectra, teeth, averages, evidence and reduction; of its benchmark."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from textwrap import wrap
from typing import TYPE_CHECKING, Any

import numpy as np

from gearsig.checks import FloatArray
from gearsig.errors import InputError
from gearsig.formatting import with_minus
from gearsig.gap import AngleCurves, AverageCurves, Evidence, GapStep, Interval, SpectrumCurves, gap_by_order, is_beyond
from gearsig.plot import _style as style
from gearsig.plot._average import ROOT, draw_degrees, draw_gear, draw_mark, write_corner
from gearsig.plot._cursors import AngleMark
from gearsig.plot._panels import ChartRow, RowPanel, line_colour
from gearsig.plot._style import plain, thin, with_unit

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D
    from matplotlib.projections.polar import PolarAxes


def gap_orders_figure(
    curves: SpectrumCurves, *, title: str = "", compared_with: str = "simulated", marked: bool = True
) -> Figure:
    """Draw the order spectra of a recording and of its baseline, and below them their difference in dB.

    Parameters
    ----------
    curves : SpectrumCurves
    title : str
        Default: the curves' label.
    compared_with : str
        What `curves.before` shows: "simulated", or "reference", see `gearsig.gap.against_reference`.
    marked : bool
        Whether to highlight lines that exceed the structural floor.

    Returns
    -------
    Figure
        Above: the repeatability floor in grey; lines below it are not significant. Below: lines above that floor, in
        orange where the gap exceeds the structural floor (grey band) and lines are marked, otherwise pale; green dots:
        the residual gap with the most likely effect, where the floor was exceeded.

    Raises
    ------
    InputError
        If the curves' lengths differ.
    """
    x = style.checked_axis(curves.orders, "orders")
    names = ("measured", "before", "floor", *(n for n in ("after", "structural_db") if len(getattr(curves, n))))
    for name in names:
        style.checked_values(getattr(curves, name), len(x), name)
    figure, (above, below) = style.panels((2.3, 1.5), top_in=0.66, share_x=True)
    keys = _draw_spectra(above, x, curves, compared_with)
    _draw_gap(below, x, curves, marked=marked)
    above.set_xlim(float(x[0]), float(x[-1]))
    style.label_axes(above, "", with_unit("peak amplitude", curves.unit))
    style.label_axes(
        below, "order of the driver's shaft", "gap (dB)", f"measured over {compared_with}, against the floors"
    )
    style.no_offset(below)
    style.head(figure, title or curves.label, keys)
    return figure


def _draw_spectra(axes: Axes, x: FloatArray, curves: SpectrumCurves, compared_with: str) -> list[Line2D]:
    top = max(float(curves.measured.max()), float(curves.before.max())) or 1.0
    bottom = max(top / 10.0**4.5, 0.3 * float(np.median(curves.floor)))  # anything lower is noise
    axes.set_yscale("log")
    axes.set_ylim(bottom, 2.0 * top)
    axes.fill_between(x, bottom, np.maximum(curves.floor, bottom), color=style.FLOOR, alpha=0.25, linewidth=0)
    # Where the effect changes little, both simulations coincide: dashes over a wider line show both.
    name = f"{compared_with} before" if len(curves.after) else compared_with
    lines = []
    for values, colour, width, dashes, label in (
        (curves.measured, style.MEASURED, 1.1, "-", "measured"),
        (curves.after, style.MESH, 2.0, "-", f"{compared_with} with the effect"),
        (curves.before, style.INK, 0.9, (0.0, (3.0, 2.0)), name),
    ):
        if len(values):
            points = thin(x, np.maximum(values, bottom), 2000)
            lines += axes.plot(*points, color=colour, linewidth=width, linestyle=dashes, label=label, alpha=0.85)
    return [*lines, *_floor_key(axes, "repeatability floor")]


def _floor_key(axes: Axes, label: str) -> list[Line2D]:
    return axes.plot([], [], color=style.FLOOR, alpha=0.4, linewidth=7, label=label)


def _draw_gap(axes: Axes, x: FloatArray, curves: SpectrumCurves, *, marked: bool) -> None:
    before = gap_by_order(curves, curves.before)
    beyond = is_beyond(curves, before)
    # A gap below 12 dB should look small.
    largest = 1.15 * max(12.0, float(np.max(np.abs(before), initial=0.0, where=np.isfinite(before))))
    if len(curves.structural_db):
        band = np.minimum(curves.structural_db, largest)
        axes.fill_between(x, -band, band, step="mid", color=style.FLOOR, alpha=0.22, linewidth=0, zorder=1)
    strong = beyond & marked
    for chosen, colour, alpha in ((~strong, style.QUIET, 0.55), (strong, style.FAULT, 0.95)):
        is_drawn = chosen & np.isfinite(before)
        axes.vlines(x[is_drawn], 0.0, before[is_drawn], colors=colour, linewidth=1.0, alpha=alpha, zorder=2)
    if len(curves.after):
        residual = gap_by_order(curves, curves.after)
        is_drawn = beyond & np.isfinite(residual)
        axes.plot(x[is_drawn], residual[is_drawn], ".", color=style.MESH, markersize=3.5, zorder=3)
    axes.axhline(0.0, color=style.QUIET, linewidth=0.8, zorder=1.5)
    axes.set_ylim(-largest, largest)


def gap_lines_figure(curves: SpectrumCurves, order: float | None = None, *, title: str = "") -> Figure:
    """Draw a measured spectrum over its noise floor, with the first six multiples of an order marked.

    Parameters
    ----------
    curves : SpectrumCurves
        `before`, `after` and `structural_db` are ignored.
    order : float or None
        Fundamental order of the family that stands out; None: nothing is marked.
    title : str
        Default: the curves' label.

    Returns
    -------
    Figure
        The noise floor is grey; triangles mark the multiples.

    Raises
    ------
    InputError
        If the curves' lengths differ.
    """
    x = style.checked_axis(curves.orders, "orders")
    measured = style.checked_values(curves.measured, len(x), "measured")
    floor = style.checked_values(curves.floor, len(x), "floor")
    figure, (axes,) = style.panels((2.6,), top_in=0.66)
    # The envelope's mean and its slow drift must not set the height.
    top = 1.15 * float(measured[x >= 0.1 * (order or 0.0)].max(initial=0.0)) or 1.0
    axes.fill_between(x, 0.0, floor, color=style.FLOOR, alpha=0.3, linewidth=0)
    keys = axes.plot(x, measured, color=style.MEASURED, linewidth=1.1, label="measured")
    if order is not None:
        marked = order * np.arange(1, 7)
        marked = marked[marked <= x[-1]]
        height, label = np.full(len(marked), 0.96 * top), f"multiples of order {order:.4g}"
        keys += axes.plot(marked, height, "v", color=style.FAULT, markersize=6, linewidth=0, label=label)
    keys += _floor_key(axes, "noise floor")
    axes.set_xlim(float(x[0]), float(x[-1]))
    axes.set_ylim(0.0, top)
    style.label_axes(axes, "order of the reference shaft", with_unit("peak amplitude", curves.unit))
    style.no_offset(axes)
    style.head(figure, title or curves.label, keys)
    return figure


LOWEST_DB = -9.0
"""Level of the picture's inner edge, re the measured median tooth."""
INNER, OUTER = 0.42, ROOT - 0.08


def gap_teeth_figure(curves: AngleCurves, *, mark: AngleMark | None = None) -> Figure:
    """Draw the energy of each pitch around the circle, in dB re the measured median tooth.

    Parameters
    ----------
    curves : AngleCurves
    mark : AngleMark or None
        The tooth to which the gap points.

    Returns
    -------
    Figure
        Angle clockwise from the top. Teeth are numbered only if the shaft has a reference mark.
    """
    angle = style.checked_axis(curves.angle_deg, "angle_deg")
    every = [
        (name, style.checked_values(energy, len(angle), name), colour, width)
        for name, energy, colour, width in (
            ("measured", curves.measured, style.MEASURED, 1.2),
            ("simulated before", curves.before, style.QUIET, 1.0),
            ("with the effect", curves.after, style.MESH, 1.2),
        )
        if len(energy) or name == "measured"
    ]
    drawn = [(n, 10.0 * np.log10(np.maximum(e, 10.0 ** (LOWEST_DB / 10.0))), *looks) for n, e, *looks in every]
    top = max(-LOWEST_DB, *(float(decibels.max()) for _, decibels, *_ in drawn))
    size_in = 5.4
    figure = style.new_figure(size_in, size_in)
    axes = style.polar_panel(figure)
    _rings(axes, top)
    turn = np.radians(np.append(angle, angle[0] + 360.0))
    for i, (name, decibels, colour, width) in enumerate(drawn):
        radius = _radius(np.append(decibels, decibels[0]), top)
        if not i:
            axes.fill_between(turn, INNER, radius, color=colour, alpha=0.18, linewidth=0, zorder=2)
        axes.plot(turn, radius, color=colour, linewidth=width, zorder=3 if i else 3.5)
        write_corner(axes, name, 0.05 + (len(drawn) - 1 - i) * 0.2 / size_in, str(colour))
    draw_gear(axes, curves.teeth, [mark.angle_deg] if mark else [], numbered=curves.has_mark)
    draw_degrees(axes, has_teeth=True)
    if mark:
        draw_mark(axes, mark, curves.teeth)
        write_corner(axes, mark.label, 0.985, style.FAULT, "bold")
    axes.text(0, 0, plain(curves.shaft, 12), ha="center", va="center", fontsize=style.SMALL_PT, parse_math=False)
    axes.set_ylim(0, 2.36)
    return figure


def _radius(decibels: FloatArray, top: float) -> FloatArray:
    radius: FloatArray = INNER + (np.clip(decibels, LOWEST_DB, top) - LOWEST_DB) / (top - LOWEST_DB) * (OUTER - INNER)
    return radius


def _rings(axes: PolarAxes, top: float) -> None:
    """Draw a ring for every 6 dB, with that of the median tooth darker."""
    ring = np.linspace(0, 2 * np.pi, 361)
    step = 6.0 if top < 20.0 else 12.0
    for value in np.arange(np.ceil(LOWEST_DB / step) * step, top + 1e-9, step):
        radius = float(_radius(np.array([value]), top)[0])
        colour = style.QUIET if value == 0 else style.RULE
        axes.plot(ring, np.full_like(ring, radius), color=colour, linewidth=0.8, zorder=1)
        text = "0 dB" if value == 0 else with_minus(f"{value:+.0f} dB")
        box = {"facecolor": "white", "edgecolor": "none", "pad": 0.8, "alpha": 0.8}
        axes.text(
            np.pi * 1.25, radius, text, ha="center", va="center", fontsize=style.SMALL_PT - 1, color=style.QUIET,
            zorder=4, bbox=box,
        )  # fmt: skip


def gap_averages_figure(curves: AverageCurves, *, mark: AngleMark | None = None, title: str = "") -> Figure:
    """Draw the tooth patterns of recording and reference over one revolution, and below them their difference.

    Parameters
    ----------
    curves : AverageCurves
    mark : AngleMark or None
        The tooth to which the gap points.
    title : str
        Default: a description with shaft and channel.

    Returns
    -------
    Figure
        Both panels have the same scale; small ticks mark the teeth.

    Raises
    ------
    InputError
        If the curves' lengths differ.
    """
    angle = style.checked_axis(curves.angle_deg, "angle_deg")
    measured = style.checked_values(curves.measured, len(angle), "measured")
    reference = style.checked_values(curves.reference, len(angle), "reference")
    change = measured - reference
    shaft, sensor = plain(curves.shaft, 24), plain(curves.channel, 24)
    figure, (above, below) = style.panels((1.35, 1.35), top_in=0.66, row_gap_in=0.42, share_x=True)
    (old,) = above.plot(*thin(angle, reference), color=style.QUIET, linewidth=0.9, label="reference")
    (new,) = above.plot(*thin(angle, measured), color=style.MEASURED, linewidth=0.9, label="measured", alpha=0.8)
    changed = below.plot(*thin(angle, change), color=style.SIMULATED, linewidth=1.0, label="measured less reference")
    largest = 1.08 * max(float(np.max(np.abs([measured, reference, change]))), 1e-300)
    for axes in (above, below):
        axes.set_ylim(-largest, largest)  # the same scale: a small change should look small
        axes.axhline(0.0, color=style.QUIET, linewidth=0.6, zorder=1)
        if mark is not None:
            axes.axvline(mark.angle_deg, color=style.FAULT, linewidth=0.9, linestyle=":", zorder=1.5)
        style.no_offset(axes)
    if mark is not None:
        is_left = mark.angle_deg > 270.0  # keep its name within the panel
        below.annotate(
            plain(mark.label, 24), (mark.angle_deg, 0.93), xycoords=("data", "axes fraction"), va="top",
            xytext=(-4 if is_left else 4, 0), textcoords="offset points", ha="right" if is_left else "left",
            color=style.FAULT, fontsize=style.SMALL_PT, parse_math=False,
        )  # fmt: skip
    above.set_xlim(0.0, 360.0)
    above.set_xticks(range(0, 361, 45))
    above.set_xticks(np.arange(curves.teeth + 1) * 360.0 / max(curves.teeth, 1), minor=True)
    style.label_axes(above, "", with_unit("average", curves.unit))
    style.label_axes(below, f"angle of shaft {shaft} (deg)", with_unit("change", curves.unit))
    heading = f"average over shaft {shaft} without mesh harmonics, sensor {sensor}: recording against reference"
    style.head(figure, title or heading, [new, old, *changed])
    return figure


# --------------------
# Figures of rows: a name, a horizontal bar, and its value beside it.
# --------------------

BAR = 0.56
"""Height of a bar, as a share of its row."""


def rows_figure(panel: RowPanel) -> Figure:
    """Draw horizontal bars in rows, with their intervals and the values they are compared with.

    Parameters
    ----------
    panel : RowPanel
        If some of its rows are totals, the others are the steps between these.
    """
    marked, names = any(row.mark is not None for row in panel.rows), [row.name for row in panel.rows]
    left_in = 3.6 if marked else 3.0
    right_in = 1.6 if any(row.below for row in panel.rows) else 1.15
    figure, (axes,) = style.panels(
        (0.45 * len(names),), left_in=left_in, right_in=right_in, top_in=0.66 if marked else 0.4
    )
    _name_rows(axes, names, int((left_in - 0.25) * 13.5))
    if panel.span is not None:
        axes.axvspan(*panel.span, facecolor=style.FLOOR, alpha=0.16, linewidth=0, zorder=0.5)
        axes.axvline(panel.span[1], color=style.FLOOR, linewidth=0.9, zorder=1)
    keys = axes.plot([], [], color=line_colour(panel.rows[0].colour), linewidth=6, label=panel.bar)
    if marked:
        looks: dict[str, Any] = {"marker": "D", "linestyle": "none", "markersize": 7, "zorder": 3}
        looks |= {"markerfacecolor": "white", "markeredgecolor": style.MESH, "markeredgewidth": 1.8}
        known = [(row.mark, i) for i, row in enumerate(panel.rows) if row.mark is not None]
        keys += axes.plot(*zip(*known, strict=True), **looks, label=panel.mark)
        keys += axes.plot([], [], color=style.FLOOR, alpha=0.35, linewidth=9, label=panel.band)
        axes.axvline(0.0, color=style.QUIET, linewidth=0.9, zorder=1)
        style.legend_row(figure, keys, left_in=left_in)
    has_totals = any(row.is_total for row in panel.rows)
    for i, row in enumerate(panel.rows):
        if row.band is not None:
            axes.barh(i, 2 * row.band, left=-row.band, height=0.8, color=style.FLOOR, alpha=0.2, linewidth=0, zorder=1)
        low, high = sorted((row.start, row.end))
        looks = {"height": BAR if row.mark is None else 0.6 * BAR, "alpha": 0.8, "linewidth": 0, "zorder": 2}
        axes.barh(i, high - low, left=low, color=line_colour(row.colour), **looks)
        if row.interval is not None:
            wide = [[max(row.end - row.interval[0], 0.0)], [max(row.interval[1] - row.end, 0.0)]]
            axes.errorbar(
                [row.end], [i], xerr=wide, fmt="none", ecolor=style.INK, elinewidth=1.1, capsize=3.5, zorder=3
            )
        _write_beyond(axes, i, row.beside, row.below, style.INK if row.verdict is None else line_colour(row.verdict))
        if row.is_total:
            axes.get_yticklabels()[i].set_fontweight("bold")
        for x, y in ((row.start, i - 0.5), (row.end, i + 0.5)) if has_totals and not row.is_total else ():
            ends = [y - 0.5 + BAR / 2, y + 0.5 - BAR / 2]
            axes.plot([x, x], ends, color=style.QUIET, linewidth=0.8, linestyle=":", zorder=1.5)
    axes.set_xlim(panel.limits)
    style.label_axes(axes, panel.x)
    style.no_offset(axes)
    return figure


def _name_rows(axes: Axes, names: Sequence[str], n_max: int) -> None:
    """Name the rows y = 0, 1, … from the top, in up to two lines of `n_max` characters."""
    texts = []
    for name in names:  # longer names are cut in the middle
        lines = wrap(plain(name, 400), n_max)
        texts.append("\n".join(lines if len(lines) <= 2 else wrap(plain(name, 2 * n_max - 6), n_max)[:2]))
    axes.set_yticks(range(len(names)), texts)
    for label in axes.get_yticklabels():
        label.set_parse_math(False)
    axes.tick_params(axis="y", length=0, pad=8)
    axes.set_ylim(len(names) - 0.5, -0.5)
    axes.grid(visible=False, axis="y")
    axes.grid(visible=True, axis="x", which="major", color=style.RULE, linewidth=0.7)


def _write_beyond(axes: Axes, row: int, text: str, below: str = "", colour: str = style.INK) -> None:
    """Write to the right of a row, outside the panel, with a paler line below."""
    place, up = axes.get_yaxis_transform(), 0.17 if below else 0.0
    style.put_text(axes, 1.02, row - up, text, colour=colour, n_max=24, fontweight="bold", va="center", transform=place)
    if below:
        style.put_text(axes, 1.02, row + up, below, n_max=24, va="center", transform=place)


def gap_evidence_panel(evidence: Sequence[Evidence]) -> RowPanel:
    """Return predicted and observed changes for each feature, with the floor around zero.

    Parameters
    ----------
    evidence : sequence of Evidence
        Strongest first; only ten are shown.

    Raises
    ------
    InputError
        If there is no evidence.
    """
    if not evidence:
        raise InputError("no evidence to draw", allowed="one or more")
    rows = []
    for item in evidence[:10]:
        stance, verdict = ("further", -1) if item.is_further else ("against", 1)
        stance, verdict = ("for", 2) if item.speaks_for else (stance, verdict)
        rows.append(
            ChartRow(
                item.feature, 0.0, item.observed_db, beside=stance, verdict=verdict, mark=item.predicted_db,
                band=item.floor_db,
            )
        )  # fmt: skip
    ends = np.array([(e.floor_db, e.observed_db, e.predicted_db, -e.floor_db) for e in evidence[:10]])
    reach = float(np.max(np.abs(ends)))
    limits = float(ends.min()) - 0.06 * reach, 1.08 * reach
    return RowPanel(rows, "change (dB)", "observed", "predicted", "structural floor", limits)


def gap_waterfall_panel(steps: Sequence[GapStep], *, held_out: str = "") -> RowPanel:
    """Return the initial gap, its reduction by each effect, and the residual, with 90 % intervals.

    Parameters
    ----------
    steps : sequence of GapStep
        The first is the gap before any effect is added.
    held_out : str
        Data it was scored on; named with the axis.

    Returns
    -------
    RowPanel
        Its span is the structural floor, within which healthy machines lie.

    Raises
    ------
    InputError
        If there are no steps.
    """
    if not steps:
        raise InputError("no steps to draw", allowed="the gap before, and one for each effect")
    rows = [_total(steps[0].label, steps[0].remaining, 1)]
    for last, step in pairwise(steps):
        before, after = last.remaining.value, step.remaining.value
        sign, colour = ("−", 2) if after <= before else ("+", 1)  # a larger gap has the fault colour
        share = abs(100.0 * (1.0 - after / before)) if before > 0 else 0.0
        size, part = f"{sign}{abs(after - before):.2g}", f"{sign}{share:.0f} % of the gap"
        ends = (step.remaining.low, step.remaining.high)
        rows.append(ChartRow(f"+ {step.label}", before, after, colour, size, part, colour, ends))
    if len(steps) > 1:
        rows.append(_total("what is left", steps[-1].remaining, 0))
    scored = f", on {held_out}" if held_out else ""
    limits = 0.0, 1.06 * max(1.2, *(step.remaining.high for step in steps))
    name = f"gap (structural floors{scored}; 90 % intervals)"
    return RowPanel(rows, name, "gap", band="structural floor", limits=limits, span=(0.0, 1.0))


def _total(name: str, residual: Interval, colour: int) -> ChartRow:
    ends = (residual.low, residual.high)
    return ChartRow(name, 0.0, residual.value, colour, residual.text, residual.words(), interval=ends, is_total=True)


# --------------------
# Benchmark of gap diagnoses: confusions between causes, and calibration of probabilities.
# --------------------


COLOURS = (style.MEASURED, style.FLOOR, style.SHAFT)


def confusion_figure(true: Sequence[str], answers: Sequence[str], counts: np.ndarray, *, title: str = "") -> Figure:
    """Draw the confusion matrix of causes: shades are shares of a row, numbers are cases.

    Parameters
    ----------
    true, answers : sequence of str
        Names of rows and columns; common names should come first in both.
    counts : array, (n_true, n_said), whole numbers
    title : str

    Returns
    -------
    Figure

    Raises
    ------
    InputError
        If the table does not match the names.
    """
    table = np.asarray(counts)
    if table.shape != (len(true), len(answers)):
        raise InputError(f"counts are {table.shape}", allowed=f"({len(true)}, {len(answers)}), to match the names")
    cells_in = 0.27 * len(answers)
    width = max(style.WIDTH_IN, 1.75 + cells_in + 0.75)
    figure, (axes,) = style.panels(
        (0.27 * len(true),), left_in=1.75, right_in=width - 1.75 - cells_in, bottom_in=1.5, top_in=0.45, width_in=width
    )
    totals = np.maximum(table.sum(axis=1, keepdims=True), 1)
    axes.imshow(table / totals, cmap=style.colours(), vmin=0.0, vmax=1.3, aspect="auto")
    for (i, j), n in np.ndenumerate(table):
        if n:
            dark = n / totals[i, 0] > 0.55
            wrong = true[i] != answers[j]
            colour = "white" if dark else style.FAULT if wrong else style.INK
            axes.text(j, i, str(n), ha="center", va="center", fontsize=style.SMALL_PT, color=colour)
    axes.set_xticks(range(len(answers)), [_words(name) for name in answers], rotation=90)
    axes.set_yticks(range(len(true)), [f"{_words(n)} ({t})" for n, t in zip(true, table.sum(axis=1), strict=True)])
    axes.tick_params(length=0)
    axes.grid(visible=False)
    style.label_axes(axes, "said")
    style.head(figure, title)
    return figure


def calibration_figure(
    curves: Mapping[str, tuple[FloatArray, FloatArray, FloatArray, FloatArray]], *, title: str = ""
) -> Figure:
    """Draw the share of correct answers over their stated probability; calibrated ones lie on the diagonal.

    Parameters
    ----------
    curves : mapping
        Name → confidence, share correct, lower and upper end of its 90 % interval, each (n_bins,), 0 to 1.
    title : str

    Returns
    -------
    Figure
    """
    figure, (axes,) = style.panels((3.4,), left_in=0.75, right_in=0.3, top_in=0.45)
    axes.plot((0, 100), (0, 100), color=style.QUIET, linewidth=0.9, linestyle="--")
    for i, (name, (confidence, right, low, high)) in enumerate(curves.items()):
        colour = COLOURS[i % len(COLOURS)]
        axes.vlines(100 * confidence, 100 * low, 100 * high, color=colour, linewidth=1.0, alpha=0.6)
        axes.plot(100 * confidence, 100 * right, color=colour, linewidth=0.9, marker="o", markersize=4.5, label=name)
    axes.set_xlim(0, 101)
    axes.set_ylim(-2, 102)
    style.label_axes(axes, "probability of the likeliest cause (%)", "right (%)")
    if curves:
        axes.legend(loc="upper left", frameon=False, fontsize=style.SMALL_PT)
    style.head(figure, title)
    return figure


def _words(name: str) -> str:
    return name.replace("_", " ")
