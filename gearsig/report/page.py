"""One recording's page: a self-contained HTML file."""

from __future__ import annotations

from datetime import datetime
from pathlib import Path

from gearsig.diagnosis.comparison import changes
from gearsig.diagnosis.types import Analysis
from gearsig.report.files import write_text
from gearsig.report.indicator_table import indicator_tables
from gearsig.report.pictures import gallery
from gearsig.report.render import render
from gearsig.report.sections import (
    css_class,
    finding_card,
    machine_rows,
    provenance_rows,
    reference_text,
    speed_rows,
    truth_rows,
)


def write_page(
    analysis: Analysis,
    path: str | Path,
    *,
    command: str = "",
    index: str = "",
    date: datetime | None = None,
) -> Path:
    """Write the report of one recording: verdict, findings, machine, figures, indicators, provenance.

    The page is one file without scripts; it loads nothing, from nowhere. It appears only when it is complete.

    Parameters
    ----------
    analysis : Analysis
    path : str or Path
        Folders on the way are made.
    command : str
        The command that makes the page again.
    index : str
        Address of the index page, relative to this one; empty: no link.
    date : datetime or None
        Of the report; None: now.

    Returns
    -------
    Path
        Of the page.
    """
    return write_text(Path(path), page_html(analysis, command=command, index=index, date=date))


def page_html(analysis: Analysis, *, command: str = "", index: str = "", date: datetime | None = None) -> str:
    """Return the page that `write_page` writes."""
    recording = analysis.recording
    return render(
        "page.html.j2",
        title=recording.provenance.source or "recording made in memory",
        machine_name=analysis.rig.name if analysis.rig is not None else "",
        verdict=analysis.verdict,
        outcome_class=css_class(analysis.outcome),
        outcome=analysis.outcome.value,
        findings=[finding_card(finding) for finding in analysis.findings],
        machine=machine_rows(analysis.rig),
        recording=recording,
        warnings=[text for text in recording.warnings if text not in {f.title for f in analysis.findings}],
        speed=speed_rows(analysis.shaft_angle),
        gallery=gallery(analysis),
        tables=indicator_tables(analysis.indicators, changes(analysis)),
        reference=reference_text(analysis.reference),
        truth=truth_rows(recording.truth),
        provenance=provenance_rows(analysis, command, date or datetime.now().astimezone()),
        index=index,
    )
