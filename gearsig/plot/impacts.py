"""Impacts of the flanks: how hard over time, which tooth, and what they bounce back with."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from gearsig.errors import InputError
from gearsig.motion.impacts import Impact
from gearsig.plot import series, style
from gearsig.plot.start_stop import FLANKS

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MARKERS = {1: "o", -1: "s"}
PANEL_IN, GAP_IN, LEFT_IN, TOP_IN = 2.4, 0.95, 0.85, 0.8
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
    figure = style.new_figure(TOP_IN + 2 * PANEL_IN + GAP_IN + 0.55)
    lower = TOP_IN + PANEL_IN + GAP_IN
    half = (style.WIDTH_IN - 2 * LEFT_IN - 0.35) / 2
    over_time = style.panel(figure, left_in=LEFT_IN, top_in=TOP_IN, bottom_in=0.55 + PANEL_IN + GAP_IN)
    by_tooth = style.panel(figure, left_in=LEFT_IN, right_in=style.WIDTH_IN - LEFT_IN - half, top_in=lower)
    bounce = style.panel(figure, left_in=2 * LEFT_IN + half, right_in=0.2, top_in=lower)
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
    series.legend_row(figure, lines, left_in=LEFT_IN, top_in=0.5)
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
