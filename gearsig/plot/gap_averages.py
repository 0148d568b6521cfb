"""The teeth's pattern of a recording over that of the healthy reference, and what has changed between them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from gearsig.gap.curve_types import AverageCurves
from gearsig.plot import series, style
from gearsig.plot.display import plain, with_unit
from gearsig.plot.marks import AngleMark
from gearsig.plot.thin import thin

if TYPE_CHECKING:
    from matplotlib.figure import Figure

TOP_IN, PANEL_IN, BETWEEN_IN, BOTTOM_IN = 0.66, 1.35, 0.42, 0.55
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
    figure = style.new_figure(TOP_IN + 2 * PANEL_IN + BETWEEN_IN + BOTTOM_IN)
    above = style.panel(figure, bottom_in=BOTTOM_IN + PANEL_IN + BETWEEN_IN, top_in=TOP_IN)
    below = style.panel(figure, bottom_in=BOTTOM_IN, top_in=TOP_IN + PANEL_IN + BETWEEN_IN, sharex=above)
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
