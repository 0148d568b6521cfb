"""The page of a gap diagnosis: where, which, how far, what to record next."""

from __future__ import annotations

from datetime import datetime
from pathlib import Path

from gearsig.gap.types import GapReport
from gearsig.report.files import write_text
from gearsig.report.gap_pictures import gap_galleries
from gearsig.report.gap_sections import (
    OUTCOME_CLASSES,
    cause_rows,
    condition_rows,
    fact_rows,
    floors_text,
    group_texts,
    inseparable_text,
    next_rows,
    others_text,
    place_rows,
    size_text,
    step_rows,
    verdict_rows,
)
from gearsig.report.gap_text import CHECK_FIRST, condition_advice
from gearsig.report.render import render


def write_gap_page(report: GapReport, path: str | Path, *, command: str = "", date: datetime | None = None) -> Path:
    """Write the page of a gap diagnosis.

    The page is one file without scripts; it loads nothing, from nowhere. It appears only when it is complete.

    Parameters
    ----------
    report : GapReport
    path : str or Path
        Folders on the way are made.
    command : str
        The command that makes the page again.
    date : datetime or None
        Of the page; None: now.

    Returns
    -------
    Path
        Of the page.
    """
    return write_text(Path(path), gap_page_html(report, command=command, date=date))


def gap_page_html(report: GapReport, *, command: str = "", date: datetime | None = None) -> str:
    """Return the page that `write_gap_page` writes."""
    return render(
        "gap.html.j2",
        report=report,
        outcome=report.outcome.value,
        outcome_class=OUTCOME_CLASSES[report.outcome.value],
        verdict=verdict_rows(report),
        check_first=CHECK_FIRST,
        advice=condition_advice(report),
        size=size_text(report),
        floors=floors_text(report),
        has_after=any(len(curves.after) for curves in report.spectra),
        places=place_rows(report),
        causes=cause_rows(report),
        others=others_text(report),
        groups=group_texts(report),
        inseparable=inseparable_text(report),
        steps=step_rows(report),
        next_recordings=next_rows(report),
        conditions=condition_rows(report),
        facts_rows=fact_rows(report, command, date or datetime.now().astimezone()),
        galleries=gap_galleries(report),
    )
