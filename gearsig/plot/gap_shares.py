"""Shares of the places in the whole gap."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from gearsig.errors import InputError
from gearsig.gap.types import GapPlace
from gearsig.plot import style
from gearsig.plot.rows import BAR, row_panel

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MOST_PLACES = 8


def gap_shares_figure(places: Sequence[GapPlace], *, title: str = "") -> Figure:
    """Draw each place's share as a bar, with its size in both floors beside it.

    Parameters
    ----------
    places : sequence of GapPlace
        Largest share first; those past the eighth are left out.
    title : str

    Returns
    -------
    Figure

    Raises
    ------
    InputError
        Without places.
    """
    if not places:
        raise InputError(
            "no places to draw", allowed="one or more", remedy="leave the figure out where there is no gap"
        )
    shown = places[:MOST_PLACES]
    panel = row_panel(len(shown), left_in=4.1, right_in=1.95, row_in=0.48)
    axes = panel.axes
    for row, place in enumerate(shown):
        colour = style.FAULT if row == 0 else style.MEASURED
        axes.barh(row, 100.0 * place.share, height=BAR, color=colour, alpha=0.85, linewidth=0)
        panel.name(row, place.title, bold=row == 0)
        floors = f"{_times(place.structural)} × structural, {_times(place.repeatability)} × rep."
        panel.say(row, f"{100.0 * place.share:.0f} %", below=floors)
    axes.set_xlim(0.0, max(100.0 * shown[0].share * 1.02, 10.0))
    style.label_axes(axes, "share of the gap (%)", "", title)
    style.no_offset(axes)
    return panel.figure


def _times(size: float) -> str:
    return f"{size:.0f}" if size >= 9.95 else f"{size:.1f}"
