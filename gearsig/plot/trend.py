"""Indicators of several recordings side by side."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import isfinite
from typing import TYPE_CHECKING

from gearsig.indicators.types import Indicator
from gearsig.plot import style
from gearsig.plot.display import plain, unit_text

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

N_COLUMNS = 3
ROW_IN = 0.22
NAMES_IN = 2.3
GAP_IN = 0.4


def trend_figure(
    recordings: Mapping[str, Sequence[Indicator]],
    *,
    names: Sequence[str] = (),
    highlighted: Sequence[str] = (),
    most: int = 6,
) -> Figure:
    """Draw one panel of dots per indicator, one row per recording.

    Where an indicator has several values in a recording (channels, gears), each is a dot.

    Parameters
    ----------
    recordings : mapping
        Name of the recording → its indicators. Undefined (nan) values are left out.
    names : sequence of str
        Indicators to draw; empty: the first `most` that occur. One without any value gets no panel.
    highlighted : sequence of str
        Recordings drawn in the colour of faults.

    Returns
    -------
    Figure
    """
    defined = dict.fromkeys(i.name for items in recordings.values() for i in items if isfinite(i.value))
    wanted = [name for name in names or defined if name in defined][:most]
    n_columns = max(1, min(N_COLUMNS, len(wanted)))
    n_rows = max(1, -(-len(wanted) // n_columns))
    panel_in = ROW_IN * max(len(recordings), 1) + 0.1
    height = n_rows * (panel_in + 0.75) + 0.05
    figure = style.new_figure(height)
    width_in = (style.WIDTH_IN - NAMES_IN - 0.2 - GAP_IN * (n_columns - 1)) / n_columns
    for number, name in enumerate(wanted):
        row, column = divmod(number, n_columns)
        left = NAMES_IN + column * (width_in + GAP_IN)
        bottom = height - (row + 1) * (panel_in + 0.75) + 0.4
        axes = style.panel(
            figure,
            left_in=left,
            right_in=style.WIDTH_IN - left - width_in,
            bottom_in=bottom,
            top_in=height - bottom - panel_in,
        )
        _draw(axes, recordings, name, highlighted, with_names=column == 0)
    return figure


def _draw(
    axes: Axes,
    recordings: Mapping[str, Sequence[Indicator]],
    name: str,
    highlighted: Sequence[str],
    *,
    with_names: bool,
) -> None:
    units = set()
    for row, (recording, indicators) in enumerate(recordings.items()):
        chosen = [i for i in indicators if i.name == name and isfinite(i.value)]
        units |= {i.unit for i in chosen}
        colour = style.FAULT if recording in highlighted else style.MEASURED
        axes.plot([i.value for i in chosen], [row] * len(chosen), "o", color=colour, markersize=5, alpha=0.75)
    axes.set_ylim(len(recordings) - 0.5, -0.5)
    labels = [plain(recording, 30) for recording in recordings] if with_names else [""] * len(recordings)
    axes.set_yticks(range(len(recordings)), labels, parse_math=False)
    axes.tick_params(axis="y", length=0)
    axes.spines["left"].set_visible(False)
    unit = f" ({unit_text(units.pop())})" if len(units) == 1 and "" not in units else ""
    style.label_axes(axes, title=f"{name}{unit}")
    axes.locator_params(axis="x", nbins=4)
    style.no_offset(axes)
