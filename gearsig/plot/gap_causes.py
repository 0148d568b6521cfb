"""The ranked causes with their probabilities."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from gearsig.errors import InputError
from gearsig.gap.types import NONE, UNKNOWN, GapCause
from gearsig.plot import style
from gearsig.plot.rows import BAR, row_panel

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MOST_CAUSES = 7
LEAST_PROBABILITY = 0.005


def gap_causes_figure(causes: Sequence[GapCause], *, title: str = "") -> Figure:
    """Draw the causes as bars, likeliest first, with place and severity below their names.

    Parameters
    ----------
    causes : sequence of GapCause
        Likeliest first. Drawn are seven at most; the others are added up in one bar.
    title : str

    Returns
    -------
    Figure
        Orange: the likeliest; blue: other effects; grey: "none", "unknown" and the measurement chain.

    Raises
    ------
    InputError
        Without causes.
    """
    if not causes:
        raise InputError("no causes to draw", allowed="one or more")
    shown = [cause for cause in causes[:MOST_CAUSES] if cause.probability >= LEAST_PROBABILITY] or [causes[0]]
    rest = sum(cause.probability for cause in causes[len(shown) :])
    n_rest = len(causes) - len(shown)
    panel = row_panel(len(shown) + bool(n_rest), left_in=3.6, right_in=0.8)
    for row, cause in enumerate(shown):
        is_effect = not (cause.is_nuisance or cause.name in (NONE, UNKNOWN))
        colour = style.FAULT if row == 0 and is_effect else style.MEASURED if is_effect else style.FLOOR
        panel.axes.barh(row, 100.0 * cause.probability, height=BAR, color=colour, alpha=0.85, linewidth=0)
        panel.name(row, _title(cause), below=_below(cause), bold=row == 0)
        panel.say(row, _percent(cause.probability))
    if n_rest:
        row = len(shown)
        panel.axes.barh(row, 100.0 * rest, height=BAR, color=style.RULE, linewidth=0)
        panel.name(row, f"{n_rest} other{'s' if n_rest > 1 else ''} together", colour=style.QUIET)
        panel.say(row, _percent(rest), colour=style.QUIET)
    panel.axes.set_xlim(0.0, 100.0)
    style.label_axes(panel.axes, "probability (%)", "", title)
    return panel.figure


def _title(cause: GapCause) -> str:
    if cause.name == UNKNOWN:
        return "unknown: nothing in the catalogue"
    return "none: no gap beyond the floor" if cause.name == NONE else cause.title


def _below(cause: GapCause) -> str:
    severity = cause.severity
    unit = cause.unit
    size = f"{severity.value:.2g} {unit} ({severity.low:.2g} to {severity.high:.2g})" if severity is not None else ""
    return ", ".join(text for text in (cause.place, size) if text)


def _percent(probability: float) -> str:
    return f"{100.0 * probability:.0f} %" if probability >= 0.01 else "< 1 %"
