"""Which figures show a gap, under which question, and what to look at in each: of the page and of the dashboard."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

from gearsig.gap.types import GapReport
from gearsig.plot.embed import Picture, embed

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Question = Literal["where", "which", "how far"]


@dataclass(frozen=True)
class GapFigure:
    """A figure and its words.

    Parameters
    ----------
    question : str
        "where", "which" or "how far": under which heading it stands.
    figure : Figure
    look : str
        One sentence on what to look at.
    shows : str
        What it shows, for those who do not see it.
    is_small : bool
        Whether it stands beside others.
    vector : bool
        Whether it has few lines.
    """

    question: Question
    figure: Figure
    look: str
    shows: str
    is_small: bool = False
    vector: bool = False


@dataclass(frozen=True)
class GapGallery:
    """The pictures of one question."""

    wide: tuple[Picture, ...]
    small: tuple[Picture, ...]


def gap_figures(report: GapReport) -> Iterator[GapFigure]:
    """Draw every figure that the report has numbers for, in the order of the page."""
    yield from ()


def gap_galleries(report: GapReport) -> dict[str, GapGallery]:
    """Return the pictures of a page by question."""
    drawn = list(gap_figures(report))
    return {
        question: GapGallery(
            tuple(_embedded(one) for one in drawn if one.question == question and not one.is_small),
            tuple(_embedded(one) for one in drawn if one.question == question and one.is_small),
        )
        for question in ("where", "which", "how far")
    }


def _embedded(one: GapFigure) -> Picture:
    return embed(one.figure, one.look, one.shows, vector=one.vector)
