"""The page that compares recordings: the worst first, with links to their pages."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime
from math import isfinite
from pathlib import Path
from urllib.parse import quote

from gearsig import __version__
from gearsig.diagnosis import Analysis, Kind, Outcome
from gearsig.formatting import readable
from gearsig.indicators import Indicator
from gearsig.plot import Picture, embed, unit_text, with_unit
from gearsig.report._files import render, write_text
from gearsig.report._sections import css_class
from gearsig.severity import CrackEstimate


@dataclass(frozen=True)
class Entry:
    """A recording that was analysed.

    Parameters
    ----------
    name : str
        As given by the user, e.g. the file's name.
    page : str
        Address of its page, relative to the index; empty: no page.
    outcome : Outcome
    verdict : str
    confidence : float or None
        Of the fault or suspicion in the verdict; None without one.
    ratio_db : float or None
        Of that finding over its floor.
    indicators : tuple of Indicator
    crack_mm : float or None
        Depth of the crack, where the verdict is about one.
    is_reference : bool
        Whether the other recordings were compared with this one.
    """

    name: str
    page: str
    outcome: Outcome
    verdict: str
    confidence: float | None = None
    ratio_db: float | None = None
    indicators: tuple[Indicator, ...] = ()
    crack_mm: float | None = None
    is_reference: bool = False


@dataclass(frozen=True)
class Failure:
    """A recording that could not be analysed, and why."""

    name: str
    reason: str


def entry_of(analysis: Analysis, name: str, page: str) -> Entry:
    """Sum up an analysis for the index page."""
    claims = (f for f in analysis.findings if f.kind in (Kind.FAULT, Kind.SUSPICION))
    top = min(claims, key=lambda finding: finding.kind is not Kind.FAULT, default=None)
    crack_mm, crack = None, analysis.crack
    if isinstance(crack, CrackEstimate) and not crack.likelier_other and top is not None:
        is_of_crack = (top.where.gear, top.where.angle_deg) == (crack.gear, crack.angle_deg)
        crack_mm = crack.depth_mm if is_of_crack else None
    return Entry(
        name,
        page,
        analysis.outcome,
        analysis.verdict,
        top.confidence if top is not None else None,
        top.strength.ratio_db if top is not None and top.strength is not None else None,
        analysis.indicators,
        crack_mm,
    )


def by_severity(entry: Entry) -> tuple[int, float, float, float, str]:
    """Key that sorts the most important first: outcome, then depth of a crack, then confidence, then strength."""
    place = list(Outcome).index(entry.outcome)
    return place, -(entry.crack_mm or 0.0), -(entry.confidence or 0.0), -(entry.ratio_db or 0.0), entry.name


KEY_INDICATORS = (
    "FM4",
    "kurtosis",
    "sideband index",
    "NA4",
    "sideband level",
    "FM0",
    "overall velocity",
    "rms",
    "crest factor",
)
"""Indicators the index compares, where they were computed: tooth-local first, then impulsive, modulation, level."""


OUTCOME_WORDS = {
    Outcome.FAULT: "with a fault",
    Outcome.SUSPICION: "with a suspicion",
    Outcome.CANNOT_TELL: "without an answer",
    Outcome.NO_FAULT: "without a fault found",
}


@dataclass(frozen=True)
class IndexCell:
    """An indicator of a recording: its largest value and its length as a bar."""

    text: str
    percent: float


@dataclass(frozen=True)
class IndexRow:
    """A recording in the table."""

    entry: Entry
    css_class: str
    href: str
    confidence: str
    ratio: str
    cells: tuple[IndexCell, ...]


def write_index(
    entries: Sequence[Entry],
    path: str | Path,
    *,
    failures: Sequence[Failure] = (),
    command: str = "",
    date: datetime | None = None,
    n_missing: int = 0,
) -> Path:
    """Write the index page: recordings by severity, key indicators side by side, and the files that failed.

    Parameters
    ----------
    entries : sequence of Entry
    path : str or Path
        The pages of the entries are looked for beside it.
    failures : sequence of Failure
        Listed with their reasons.
    command : str
        The command that makes the report again.
    date : datetime or None
        Of the report; None: now.
    n_missing : int
        Recordings that are still to be analysed: the page says so, and has no figure yet.

    Returns
    -------
    Path
        Of the page.
    """
    ordered = sorted(entries, key=by_severity)
    present = {i.name for entry in ordered for i in entry.indicators if isfinite(i.value)}
    names = [name for name in KEY_INDICATORS if name in present]
    columns = [_column(ordered, name) for name in names[:3]]
    rows = [
        IndexRow(
            entry,
            css_class(entry.outcome),
            quote(entry.page),
            f"{100 * entry.confidence:.0f} %" if entry.confidence is not None else "",
            _size_text(entry),
            tuple(cells[i] for _, cells in columns),
        )
        for i, entry in enumerate(ordered)
    ]
    counts = Counter(OUTCOME_WORDS[entry.outcome] for entry in ordered)
    parts = [f"{n} {words}" for words, n in counts.items()] + ([f"{len(failures)} not analysed"] if failures else [])
    n_files = len(ordered) + len(failures)
    html = render(
        "index.html.j2",
        rows=rows,
        columns=[heading for heading, _ in columns],
        summary=f"{n_files} recording{'s' * (n_files != 1)}: {', '.join(parts)}" if parts else "No recordings",
        failures=failures,
        picture=_picture(ordered, names[:6]) if not n_missing else None,
        n_missing=n_missing,
        command=command,
        version=__version__,
        date=(date or datetime.now().astimezone()).strftime("%Y-%m-%d %H:%M %Z").strip(),
    )
    return write_text(Path(path), html)


def _column(entries: Sequence[Entry], name: str) -> tuple[str, list[IndexCell]]:
    """Return an indicator's heading, and its largest value in each recording.

    Bars begin at zero: they stand where the column has one unit and no negative value.
    """
    known = [[i for i in entry.indicators if i.name == name and isfinite(i.value)] for entry in entries]
    units = {i.unit for items in known for i in items}
    largest = [max(items, key=lambda i: i.value, default=None) for items in known]
    values = [i.value for i in largest if i is not None]
    top = max(values)
    shown = {i.unit for i in largest if i is not None}
    has_bars = len(shown) == 1 and min(values) >= 0 and top > 0
    cells = [
        IndexCell("–", 0.0)
        if i is None
        else IndexCell(
            readable(i.value, 3) + ("" if len(shown) == 1 else f" {unit_text(i.unit)}"),
            round(100 * i.value / top, 1) if has_bars else 0.0,
        )
        for i in largest
    ]
    return with_unit(name, units.pop() if len(units) == 1 else ""), cells


def _size_text(entry: Entry) -> str:
    """Return the depth of a crack, or how far a finding is over its floor."""
    if entry.crack_mm is not None:
        return f"{entry.crack_mm:.1f} mm"
    return f"{readable(entry.ratio_db, 3)} dB" if entry.ratio_db is not None else "–"


def _picture(entries: Sequence[Entry], names: Sequence[str]) -> Picture | None:
    """Return the dots of the key indicators, where there are recordings to compare."""
    from gearsig.plot import trend_figure

    if len(entries) < 2 or not names:
        return None
    shown = entries[:40]
    rest = f" The {len(shown)} most severe of {len(entries)} recordings." if len(shown) < len(entries) else ""
    faulty = [entry.name for entry in shown if entry.outcome is Outcome.FAULT]
    return embed(
        trend_figure({entry.name: entry.indicators for entry in shown}, names=names, highlighted=faulty),
        f"A recording that stands apart deserves a look; orange ones have a fault. One dot per channel and gear.{rest}",
        f"Dots of {', '.join(names)} for {len(shown)} recordings.",
        vector=len(shown) * len(names) <= 60,
    )
