"""The gap by order: spectra measured and simulated, and their difference against both floors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from textwrap import wrap
from typing import TYPE_CHECKING

import numpy as np

from gearsig.checks import FloatArray
from gearsig.errors import InputError
from gearsig.gap import AngleCurves, AverageCurves, Evidence, GapStep, Interval, SpectrumCurves, gap_by_order, is_beyond
from gearsig.plot import _series as series
from gearsig.plot import _style as style
from gearsig.plot._average import ROOT, draw_degrees, draw_gear, draw_mark, write_corner
from gearsig.plot._cursors import AngleMark
from gearsig.plot._series import thin
from gearsig.plot._style import plain, unit_text, with_unit

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D
    from matplotlib.projections.polar import PolarAxes


TOP_IN, SPECTRA_IN, BETWEEN_IN, GAP_IN, BOTTOM_IN = 0.66, 2.3, 0.5, 1.5, 0.55
DECADES = 4.5
"""Below the largest line at most: what lies deeper is noise."""
N_POINTS = 2000
LEAST_GAP_DB = 12.0
"""Of the lower panel's half height: a smaller gap shall look small."""


def gap_orders_figure(
    curves: SpectrumCurves,
    *,
    limits: tuple[float, float] | None = None,
    title: str = "",
    beside: str = "simulated",
    marked: bool = True,
) -> Figure:
    """Draw the order spectra of a recording and of what it is compared with, and below them their difference in dB.

    Parameters
    ----------
    curves : SpectrumCurves
    limits : (float, float) or None
        Orders to show; None: all.
    title : str
        Default: the curves' label.
    beside : str
        What `curves.before` is of: "simulated", or "reference", see `gearsig.gap.against_reference`.
    marked : bool
        Whether lines beyond the structural floor are told from the others.

    Returns
    -------
    Figure
        Above: grey is the repeatability floor; lines below it say nothing. Below: lines above that floor, orange where
        the gap exceeds the structural floor (grey band) and lines are marked, quiet elsewhere; green dots: what is left
        with the likeliest effect, where the floor was exceeded.

    Raises
    ------
    InputError
        If the curves' lengths differ.
    """
    x = series.checked_axis(curves.orders, "orders")
    names = ("measured", "before", "floor", *(n for n in ("after", "structural_db") if len(getattr(curves, n))))
    for name in names:
        series.checked_values(getattr(curves, name), len(x), name)
    low, high = limits or (float(x[0]), float(x[-1]))
    if not np.any((x >= low) & (x <= high)):
        raise InputError(f"limits {low:g} to {high:g} hold no order", allowed=f"{x[0]:g} to {x[-1]:g}")
    figure = style.new_figure(TOP_IN + SPECTRA_IN + BETWEEN_IN + GAP_IN + BOTTOM_IN)
    above = style.panel(figure, bottom_in=BOTTOM_IN + GAP_IN + BETWEEN_IN, top_in=TOP_IN)
    below = style.panel(figure, bottom_in=BOTTOM_IN, top_in=TOP_IN + SPECTRA_IN + BETWEEN_IN, sharex=above)
    keys = _draw_spectra(above, x, curves, beside)
    _draw_gap(below, x, curves, marked=marked)
    above.set_xlim(low, high)
    above.tick_params(labelbottom=False)
    unit = f" ({unit_text(curves.unit)})" if curves.unit else ""
    style.label_axes(above, "", f"peak amplitude{unit}")
    style.label_axes(below, "order of the driver's shaft", "gap (dB)", f"measured over {beside}, against the floors")
    style.no_offset(below)
    series.legend_row(figure, keys, left_in=0.85, top_in=series.NAMES_AT_IN)
    series.headline(figure, title or curves.label)
    return figure


def _draw_spectra(axes: Axes, x: FloatArray, curves: SpectrumCurves, beside: str) -> list[Line2D]:
    top = max(float(curves.measured.max()), float(curves.before.max())) or 1.0
    bottom = max(top / 10.0**DECADES, 0.3 * float(np.median(curves.floor)))
    axes.set_yscale("log")
    axes.set_ylim(bottom, 2.0 * top)
    axes.fill_between(x, bottom, np.maximum(curves.floor, bottom), color=style.FLOOR, alpha=0.25, linewidth=0)
    # Where the effect changes little both simulations coincide: dashes over a wider line show either.
    drawn: list[tuple[FloatArray, str, float, str | tuple[float, tuple[float, float]], str]]
    drawn = [(curves.measured, style.MEASURED, 1.1, "-", "measured")]
    if len(curves.after):
        drawn.append((curves.after, style.MESH, 2.0, "-", f"{beside} with the effect"))
    name = f"{beside} before" if len(curves.after) else beside
    drawn.append((curves.before, style.INK, 0.9, (0.0, (3.0, 2.0)), name))
    lines = []
    for values, colour, width, dashes, label in drawn:
        points = thin(x, np.maximum(values, bottom), N_POINTS)
        lines += axes.plot(*points, color=colour, linewidth=width, linestyle=dashes, label=label, alpha=0.85)
    floor = axes.plot([], [], color=style.FLOOR, alpha=0.4, linewidth=7, label="repeatability floor")
    return [*lines, *floor]


def _draw_gap(axes: Axes, x: FloatArray, curves: SpectrumCurves, *, marked: bool) -> None:
    before = gap_by_order(curves, curves.before)
    structural = curves.structural_db if len(curves.structural_db) else np.zeros(len(x))
    beyond = is_beyond(curves, before)
    largest = 1.15 * max(LEAST_GAP_DB, float(np.max(np.abs(before), initial=0.0, where=np.isfinite(before))))
    if len(curves.structural_db):
        band = np.minimum(structural, largest)
        axes.fill_between(x, -band, band, step="mid", color=style.FLOOR, alpha=0.22, linewidth=0, zorder=1)
    strong = beyond & marked
    for chosen, colour, alpha in ((~strong, style.QUIET, 0.55), (strong, style.FAULT, 0.95)):
        here = chosen & np.isfinite(before)
        axes.vlines(x[here], 0.0, before[here], colors=colour, linewidth=1.0, alpha=alpha, zorder=2)
    if len(curves.after):
        left = gap_by_order(curves, curves.after)
        here = beyond & np.isfinite(left)
        axes.plot(x[here], left[here], ".", color=style.MESH, markersize=3.5, zorder=3)
    axes.axhline(0.0, color=style.QUIET, linewidth=0.8, zorder=1.5)
    axes.set_ylim(-largest, largest)


# --------------------
# Lines of a spectrum over its noise, where there is no simulation beside them.
# --------------------


GAP_LINES_TOP_IN, PANEL_IN, GAP_LINES_BOTTOM_IN = 0.66, 2.6, 0.55
N_MULTIPLES = 6


def gap_lines_figure(curves: SpectrumCurves, order: float | None = None, *, title: str = "") -> Figure:
    """Draw a measured spectrum over its noise floor, with the first six multiples of an order marked.

    Parameters
    ----------
    curves : SpectrumCurves
        Of which `before`, `after` and `structural_db` are not looked at.
    order : float or None
        Of the family that was found; None: nothing is marked.
    title : str
        Default: the curves' label.

    Returns
    -------
    Figure
        Grey is the noise floor; triangles stand above the multiples.

    Raises
    ------
    InputError
        If the curves' lengths differ.
    """
    x = series.checked_axis(curves.orders, "orders")
    measured = series.checked_values(curves.measured, len(x), "measured")
    floor = series.checked_values(curves.floor, len(x), "floor")
    figure = style.new_figure(GAP_LINES_TOP_IN + PANEL_IN + GAP_LINES_BOTTOM_IN)
    axes = style.panel(figure, bottom_in=GAP_LINES_BOTTOM_IN, top_in=GAP_LINES_TOP_IN)
    top = 1.15 * float(measured[x >= _least(order)].max(initial=0.0)) or 1.0
    axes.fill_between(x, 0.0, floor, color=style.FLOOR, alpha=0.3, linewidth=0)
    keys = axes.plot(x, measured, color=style.MEASURED, linewidth=1.1, label="measured")
    if order is not None:
        multiples = order * np.arange(1, N_MULTIPLES + 1)
        marked = multiples[multiples <= x[-1]]
        label = f"multiples of order {order:.4g}"
        keys += axes.plot(
            marked, np.full(len(marked), 0.96 * top), "v", color=style.FAULT, markersize=6, linewidth=0, label=label
        )
    keys += axes.plot([], [], color=style.FLOOR, alpha=0.4, linewidth=7, label="noise floor")
    axes.set_xlim(float(x[0]), float(x[-1]))
    axes.set_ylim(0.0, top)
    unit = f" ({unit_text(curves.unit)})" if curves.unit else ""
    style.label_axes(axes, "order", f"peak amplitude{unit}")
    style.no_offset(axes)
    series.legend_row(figure, keys, left_in=0.85, top_in=series.NAMES_AT_IN)
    series.headline(figure, title or curves.label)
    return figure


def _least(order: float | None) -> float:
    """Return where lines begin that set the height: the envelope's mean and its slow drift are not of interest."""
    return 0.0 if order is None else 0.1 * order


# --------------------
# Energy tooth by tooth around a shaft, measured against simulated.
# --------------------


LOWEST_DB, LEAST_TOP_DB = -9.0, 9.0
"""Re the measured middling tooth: the inner edge of the picture, and its outer edge at least."""
INNER, OUTER = 0.42, ROOT - 0.08
RINGS_DB = 6.0


def gap_teeth_figure(
    curves: AngleCurves, *, mark: AngleMark | None = None, top_db: float | None = None, size_in: float = 5.4
) -> Figure:
    """Draw the energy within one pitch around the circle, in dB over the measured middling tooth.

    Parameters
    ----------
    curves : AngleCurves
    mark : AngleMark or None
        The tooth that the gap names.
    top_db : float or None
        Outer edge, for pictures that are to be compared; None: this shaft's own.
    size_in : float

    Returns
    -------
    Figure
        Angle clockwise from the top. Teeth have numbers only where the shaft has a mark.
    """
    angle = series.checked_axis(curves.angle_deg, "angle_deg")
    drawn = [("simulated before", curves.before, style.QUIET, 1.0), ("with the effect", curves.after, style.MESH, 1.2)]
    drawn = [(*one[:1], _decibels(one[1], len(angle), one[0]), *one[2:]) for one in drawn if len(one[1])]
    measured = _decibels(curves.measured, len(angle), "measured")
    top = top_db or max(LEAST_TOP_DB, *(float(values.max()) for values in (measured, *(one[1] for one in drawn))))
    figure = style.new_figure(size_in, size_in)
    axes = style.polar_panel(figure)
    _rings(axes, top)
    turn = np.radians(np.append(angle, angle[0] + 360.0))
    _fill(axes, turn, measured, top)
    for _, values, colour, width in drawn:
        axes.plot(turn, _radius(np.append(values, values[0]), top), color=colour, linewidth=width, zorder=3)
    draw_gear(axes, curves.teeth, [mark.angle_deg] if mark else [], numbered=curves.has_mark)
    draw_degrees(axes, has_teeth=True)
    if mark:
        draw_mark(axes, mark, curves.teeth)
        write_corner(axes, mark.label, 0.985, style.FAULT, "bold")
    _keys(axes, [("measured", style.MEASURED), *((one[0], one[2]) for one in drawn)], size_in)
    axes.text(0, 0, plain(curves.shaft, 12), ha="center", va="center", fontsize=style.SMALL_PT, parse_math=False)
    axes.set_ylim(0, 2.36)
    return figure


def _decibels(energy: FloatArray, n: int, name: str) -> FloatArray:
    values = series.checked_values(energy, n, name)
    decibels: FloatArray = 10.0 * np.log10(np.maximum(values, 10.0 ** (LOWEST_DB / 10.0)))
    return decibels


def _radius(decibels: FloatArray, top: float) -> FloatArray:
    share = (np.clip(decibels, LOWEST_DB, top) - LOWEST_DB) / (top - LOWEST_DB)
    radius: FloatArray = INNER + share * (OUTER - INNER)
    return radius


def _fill(axes: PolarAxes, turn: FloatArray, measured: FloatArray, top: float) -> None:
    radius = _radius(np.append(measured, measured[0]), top)
    axes.fill_between(turn, INNER, radius, color=style.MEASURED, alpha=0.18, linewidth=0, zorder=2)
    axes.plot(turn, radius, color=style.MEASURED, linewidth=1.2, zorder=3.5)


def _rings(axes: PolarAxes, top: float) -> None:
    """Draw a ring for every 6 dB, that of the middling tooth in stronger ink."""
    ring = np.linspace(0, 2 * np.pi, 361)
    step = RINGS_DB * (1.0 if top < 20.0 else 2.0)
    for value in np.arange(np.ceil(LOWEST_DB / step) * step, top + 1e-9, step):
        radius = float(_radius(np.array([value]), top)[0])
        colour = style.QUIET if value == 0 else style.RULE
        axes.plot(ring, np.full_like(ring, radius), color=colour, linewidth=0.8, zorder=1)
        text = "0 dB" if value == 0 else f"{value:+.0f} dB".replace("-", "−")
        box = {"facecolor": "white", "edgecolor": "none", "pad": 0.8, "alpha": 0.8}
        axes.text(
            np.pi * 1.25, radius, text, ha="center", va="center", fontsize=style.SMALL_PT - 1, color=style.QUIET,
            zorder=4, bbox=box,
        )  # fmt: skip


def _keys(axes: PolarAxes, keys: list[tuple[str, str]], size_in: float) -> None:
    """Name the curves in the lower left corner."""
    for row, (name, colour) in enumerate(reversed(keys)):
        write_corner(axes, name, 0.05 + row * 0.2 / size_in, colour)


# --------------------
# The teeth's pattern of a recording over that of the healthy reference, and what has changed between them.
# --------------------


GAP_AVERAGES_TOP_IN, GAP_AVERAGES_PANEL_IN, GAP_AVERAGES_BETWEEN_IN, GAP_AVERAGES_BOTTOM_IN = 0.66, 1.35, 0.42, 0.55
EVERY_DEG = 45


def gap_averages_figure(curves: AverageCurves, *, mark: AngleMark | None = None, title: str = "") -> Figure:
    """Draw both patterns over one revolution, and below them their difference on the same scale.

    Parameters
    ----------
    curves : AverageCurves
    mark : AngleMark or None
        The tooth that the gap names.
    title : str
        Default: what it is, with shaft and channel.

    Returns
    -------
    Figure
        Small ticks stand at the teeth.

    Raises
    ------
    InputError
        If the curves' lengths differ.
    """
    angle = series.checked_axis(curves.angle_deg, "angle_deg")
    measured = series.checked_values(curves.measured, len(angle), "measured")
    reference = series.checked_values(curves.reference, len(angle), "reference")
    figure = style.new_figure(
        GAP_AVERAGES_TOP_IN + 2 * GAP_AVERAGES_PANEL_IN + GAP_AVERAGES_BETWEEN_IN + GAP_AVERAGES_BOTTOM_IN
    )
    above = style.panel(
        figure,
        bottom_in=GAP_AVERAGES_BOTTOM_IN + GAP_AVERAGES_PANEL_IN + GAP_AVERAGES_BETWEEN_IN,
        top_in=GAP_AVERAGES_TOP_IN,
    )
    below = style.panel(
        figure,
        bottom_in=GAP_AVERAGES_BOTTOM_IN,
        top_in=GAP_AVERAGES_TOP_IN + GAP_AVERAGES_PANEL_IN + GAP_AVERAGES_BETWEEN_IN,
        sharex=above,
    )
    (reference_line,) = above.plot(*thin(angle, reference), color=style.QUIET, linewidth=0.9, label="reference")
    (own,) = above.plot(*thin(angle, measured), color=style.MEASURED, linewidth=0.9, label="measured", alpha=0.8)
    keys = [own, reference_line]
    keys += below.plot(
        *thin(angle, measured - reference), color=style.SIMULATED, linewidth=1.0, label="measured less reference"
    )
    largest = 1.08 * max(float(np.max(np.abs([measured, reference, measured - reference]))), 1e-300)
    for axes in (above, below):
        axes.set_ylim(-largest, largest)  # one scale: a small change shall look small
        axes.axhline(0.0, color=style.QUIET, linewidth=0.6, zorder=1)
        if mark is not None:
            axes.axvline(mark.angle_deg, color=style.FAULT, linewidth=0.9, linestyle=":", zorder=1.5)
        style.label_axes(axes, "", with_unit("average", curves.unit))
        style.no_offset(axes)
    if mark is not None:
        left = mark.angle_deg > 270.0  # its name stays within the panel
        below.annotate(
            plain(mark.label, 24), (mark.angle_deg, 0.93), xycoords=("data", "axes fraction"), va="top",
            xytext=(-4 if left else 4, 0), textcoords="offset points", ha="right" if left else "left",
            color=style.FAULT, fontsize=style.SMALL_PT, parse_math=False,
        )  # fmt: skip
    above.set_xlim(0.0, 360.0)
    above.set_xticks(range(0, 361, EVERY_DEG))
    above.set_xticks(np.arange(curves.teeth + 1) * 360.0 / max(curves.teeth, 1), minor=True)
    above.tick_params(labelbottom=False)
    style.label_axes(below, f"angle of shaft {plain(curves.shaft, 24)} (deg)", with_unit("change", curves.unit))
    series.legend_row(figure, keys, left_in=0.85, top_in=series.NAMES_AT_IN)
    series.headline(figure, title or _title(curves))
    return figure


def _title(curves: AverageCurves) -> str:
    shaft, sensor = plain(curves.shaft, 24), plain(curves.channel, 24)
    return f"average over shaft {shaft} without mesh harmonics, sensor {sensor}: recording against reference"


# --------------------
# Figures of rows: a text, a horizontal bar, and figures beside it.
# --------------------


BAR = 0.56
"""Height of a bar, of its row."""
_LINE_IN = 0.155
_CHARACTERS_PER_IN, _BOLD_PER_IN = 15.5, 13.5


@dataclass(frozen=True)
class RowPanel:
    """Axes whose rows lie at y = 0, 1, … from the top.

    Parameters
    ----------
    figure : Figure
    axes : Axes
    n_rows : int
    left_in, right_in : float
        Room for texts.
    """

    figure: Figure
    axes: Axes
    n_rows: int
    left_in: float
    right_in: float

    def name(self, row: int, text: str, *, below: str = "", colour: str = style.INK, bold: bool = False) -> None:
        """Write left of a row, in two lines at most, and a quiet line below."""
        per_line = int((self.left_in - 0.25) * (_BOLD_PER_IN if bold else _CHARACTERS_PER_IN))
        lines = _broken(text, per_line, 1 if below else 2)
        top = (len(lines) + bool(below) - 1) / 2.0
        for i, line in enumerate([*lines, *([below] if below else [])]):
            quiet = below and i == len(lines)
            self._write(
                0.0,
                row,
                plain(line, int((self.left_in - 0.2) * _CHARACTERS_PER_IN) + 1),
                (-8.0, (top - i) * _LINE_IN * 72.0),
                "right",
                style.QUIET if quiet else colour,
                bold=bold and not quiet,
            )

    def say(self, row: int, text: str, *, below: str = "", colour: str = style.INK) -> None:
        """Write right of a row, beyond the panel."""
        texts = [text, *([below] if below else [])]
        for i, line in enumerate(texts):
            up = ((len(texts) - 1) / 2.0 - i) * _LINE_IN * 72.0
            n_max = int((self.right_in - 0.15) * _CHARACTERS_PER_IN) + 1
            self._write(1.0, row, plain(line, n_max), (8.0, up), "left", style.QUIET if i else colour, bold=not i)

    def _write(
        self, x: float, row: int, text: str, offset_pt: tuple[float, float], ha: str, colour: str, *, bold: bool = False
    ) -> None:
        self.axes.annotate(
            text,
            (x, row),
            xycoords=self.axes.get_yaxis_transform(),
            xytext=offset_pt,
            textcoords="offset points",
            ha=ha,
            va="center",
            fontsize=style.SMALL_PT,
            fontweight="bold" if bold else "normal",
            color=colour,
            parse_math=False,
            annotation_clip=False,
        )


def row_panel(
    n_rows: int,
    *,
    left_in: float,
    right_in: float,
    row_in: float = 0.46,
    top_in: float = 0.4,
    bottom_in: float = 0.55,
    width_in: float = style.WIDTH_IN,
) -> RowPanel:
    """Return an empty figure with `n_rows` rows."""
    figure = style.new_figure(top_in + bottom_in + row_in * n_rows, width_in)
    axes = style.panel(figure, left_in=left_in, right_in=right_in, bottom_in=bottom_in, top_in=top_in)
    axes.set_ylim(n_rows - 0.5, -0.5)
    axes.set_yticks([])
    axes.grid(visible=False, axis="y")
    axes.grid(visible=True, axis="x", which="major", color=style.RULE, linewidth=0.7)
    return RowPanel(figure, axes, n_rows, left_in, right_in)


def _broken(text: str, n_max: int, n_lines: int) -> list[str]:
    """Return the text in at most `n_lines` lines of `n_max` characters; a longer one is cut in its middle."""
    lines = wrap(plain(text, 400), n_max)
    return lines if len(lines) <= n_lines else wrap(plain(text, n_lines * n_max - 6), n_max)[:n_lines] or [""]


# --------------------
# The evidence for a cause: what it predicts beside what was observed.
# --------------------


MOST_ROWS = 10


def gap_evidence_figure(evidence: Sequence[Evidence], *, title: str = "") -> Figure:
    """Draw predicted and observed changes, feature by feature, with the floor about zero.

    Parameters
    ----------
    evidence : sequence of Evidence
        Strongest first; those past the tenth are left out.
    title : str

    Returns
    -------
    Figure
        Grey: within the floor, where a change says nothing.

    Raises
    ------
    InputError
        Without evidence.
    """
    if not evidence:
        raise InputError("no evidence to draw", allowed="one or more")
    shown = evidence[:MOST_ROWS]
    panel = row_panel(len(shown), left_in=3.6, right_in=1.15, row_in=0.44, top_in=0.66)
    for row, one in enumerate(shown):
        _draw_row(panel.axes, row, one)
        panel.name(row, one.feature)
        text, colour = _stance(one)
        panel.say(row, text, colour=colour)
    panel.axes.axvline(0.0, color=style.QUIET, linewidth=0.9, zorder=1)
    reach = max(max(abs(e.predicted_db), abs(e.observed_db), e.floor_db) for e in shown)
    lowest = min(min(e.predicted_db, e.observed_db, -e.floor_db) for e in shown)
    panel.axes.set_xlim(lowest - 0.06 * reach, reach * 1.08)
    style.label_axes(panel.axes, "change (dB)")
    style.no_offset(panel.axes)
    series.legend_row(panel.figure, _keys_gap_evidence(), left_in=3.6, top_in=0.46)
    series.headline(panel.figure, title)
    return panel.figure


def _stance(one: Evidence) -> tuple[str, str]:
    """Return what stands beside a row, and its colour."""
    if one.speaks_for:
        return "for", style.MESH
    return ("further", style.QUIET) if one.is_further else ("against", style.FAULT)


def _draw_row(axes: Axes, row: int, one: Evidence) -> None:
    axes.barh(
        row, 2.0 * one.floor_db, left=-one.floor_db, height=0.8, color=style.FLOOR, alpha=0.2, linewidth=0, zorder=1
    )
    axes.barh(row, one.observed_db, height=0.6 * BAR, color=style.MEASURED, alpha=0.85, linewidth=0, zorder=2)
    axes.plot(
        [one.predicted_db], [row], "D", markersize=7, markerfacecolor="white", markeredgecolor=style.MESH,
        markeredgewidth=1.8, zorder=3,
    )  # fmt: skip


def _keys_gap_evidence() -> list[Line2D]:
    from matplotlib.lines import Line2D

    return [
        Line2D([], [], color=style.MEASURED, linewidth=6, label="observed"),
        Line2D(
            [], [], linestyle="none", marker="D", markersize=7, markerfacecolor="white", markeredgecolor=style.MESH,
            markeredgewidth=1.8, label="predicted",
        ),
        Line2D([], [], color=style.FLOOR, alpha=0.35, linewidth=9, label="structural floor"),
    ]  # fmt: skip


# --------------------
# How far the gap shrinks: from before, through each added effect, to what is left.
# --------------------


LEFT_OVER = "what is left"


def gap_waterfall_figure(steps: Sequence[GapStep], *, held_out: str = "", title: str = "") -> Figure:
    """Draw the gap before, what each effect takes away, and what is left, with 90 % intervals.

    Parameters
    ----------
    steps : sequence of GapStep
        The first is the gap before anything is added.
    held_out : str
        What it was scored on; written below the axis.
    title : str

    Returns
    -------
    Figure
        The shaded stretch is the structural floor: healthy machines are in it.

    Raises
    ------
    InputError
        Without steps.
    """
    if not steps:
        raise InputError("no steps to draw", allowed="the gap before, and one for each effect")
    panel = row_panel(len(steps) + (len(steps) > 1), left_in=3.0, right_in=1.6)
    axes = panel.axes
    axes.axvspan(0.0, 1.0, facecolor=style.FLOOR, alpha=0.16, linewidth=0, zorder=0.5)
    axes.axvline(1.0, color=style.FLOOR, linewidth=0.9, zorder=1)
    _whole(panel, 0, steps[0], style.FAULT)
    for row, (before, step) in enumerate(pairwise(steps), start=1):
        _step(panel, row, before.left, step)
    if len(steps) > 1:
        _whole(panel, len(steps), GapStep(LEFT_OVER, steps[-1].left), style.MEASURED)
    axes.set_xlim(0.0, 1.06 * max(1.2, *(step.left.high for step in steps)))
    scored = f", on {held_out}" if held_out else ""
    style.label_axes(axes, f"gap (structural floors{scored}; 90 % intervals)", "", title)
    style.no_offset(axes)
    return panel.figure


def _whole(panel: RowPanel, row: int, step: GapStep, colour: str) -> None:
    panel.axes.barh(row, step.left.value, height=BAR, color=colour, alpha=0.85, linewidth=0, zorder=2)
    _interval(panel, row, step.left)
    panel.name(row, step.label, bold=True)
    panel.say(row, f"{step.left.value:.2g}", below=f"{step.left.low:.2g} to {step.left.high:.2g}")


def _step(panel: RowPanel, row: int, before: Interval, step: GapStep) -> None:
    """Draw what an effect takes away; what it adds, where it makes the gap larger, in the colour of faults."""
    left = step.left
    smaller = left.value <= before.value
    low, high = sorted((left.value, before.value))
    colour = style.MESH if smaller else style.FAULT
    panel.axes.barh(row, high - low, left=low, height=BAR, color=colour, alpha=0.75, linewidth=0, zorder=2)
    for x in (before.value, left.value):
        ends = (row - 1 + BAR / 2, row - BAR / 2) if x == before.value else (row + BAR / 2, row + 1 - BAR / 2)
        panel.axes.plot([x, x], ends, color=style.QUIET, linewidth=0.8, linestyle=":", zorder=1.5)
    _interval(panel, row, left)
    panel.name(row, f"with {step.label}")
    share = 100.0 * (1.0 - left.value / before.value) if before.value > 0 else 0.0
    sign = "−" if smaller else "+"
    panel.say(row, f"{sign}{high - low:.2g}", below=f"{sign}{abs(share):.0f} % of the gap", colour=colour)


def _interval(panel: RowPanel, row: int, left: Interval) -> None:
    panel.axes.errorbar(
        [left.value],
        [row],
        xerr=[[max(left.value - left.low, 0.0)], [max(left.high - left.value, 0.0)]],
        fmt="none",
        ecolor=style.INK,
        elinewidth=1.1,
        capsize=3.5,
        zorder=3,
    )
