"""The page of a benchmark: tables and figures, one section each."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime

from gearsig import __version__
from gearsig.plot import Picture
from gearsig.report._files import render


@dataclass(frozen=True)
class Section:
    """A heading with a table, with pictures, or with both.

    Parameters
    ----------
    title, note : str
    header : tuple of str
    rows : tuple of tuple of str
        The first cell of a row names it.
    pictures : tuple of Picture
    is_prose : bool
        Whether the cells are sentences, which wrap in columns of one width; else numbers, which do not.
    """

    title: str
    note: str = ""
    header: tuple[str, ...] = ()
    rows: tuple[tuple[str, ...], ...] = ()
    pictures: tuple[Picture, ...] = ()
    is_prose: bool = False


def benchmark_html(
    title: str, summary: str, sections: Sequence[Section], provenance: Sequence[tuple[str, str]], date: datetime
) -> str:
    """Return the page, one file without scripts that loads nothing."""
    return render(
        "benchmark.html.j2",
        title=title,
        summary=summary,
        sections=sections,
        provenance=provenance,
        date=f"{date:%Y-%m-%d %H:%M %Z}".strip(),
        version=__version__,
    )
