"""The page that compares recordings: the worst first, with links to their pages."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime
from math import isfinite
from pathlib import Path
from urllib.parse import quote

from gearsig import __version__
from gearsig.diagnosis import Analysis, Finding, Kind, Outcome
from gearsig.formatting import readable
from gearsig.indicators import Indicator
from gearsig.plot import Picture, embed, unit_text
from gearsig.report._files import render, write_text
from gearsig.report._sections import css_class
from gearsig.severity import CrackEstimate

# --------------------
# What the index page needs to know of each recording; small, so that it travels between processes.
# --------------------


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
    return Entry(
        name,
        page,
        analysis.outcome,
        analysis.verdict,
        top.confidence if top is not None else None,
        top.strength.ratio_db if top is not None and top.strength is not None else None,
        analysis.indicators,
        _crack_mm(analysis, top),
    )


def _crack_mm(analysis: Analysis, top: Finding | None) -> float | None:
    """Return the depth of a crack, where it is what the verdict is about."""
    crack = analysis.crack
    if not isinstance(crack, CrackEstimate) or crack.likelier_other or top is None:
        return None
    return crack.depth_mm if top.where.gear == crack.gear and top.where.angle_deg == crack.angle_deg else None


def by_severity(entry: Entry) -> tuple[int, float, float, float, str]:
    """Key that sorts the most important first: outcome, then depth of a crack, then confidence, then strength."""
    place = list(Outcome).index(entry.outcome)
    return place, -(entry.crack_mm or 0.0), -(entry.confidence or 0.0), -(entry.ratio_db or 0.0), entry.name


KEY_INDICATORS = ("FM4", "kurtosis", "sideband index", "NA4", "sideband level", "FM0", "rms", "crest factor")
"""Indicators the index compares, where they were computed: tooth-local first, then impulsive, modulation, level."""
_SUMMARY = {
    Outcome.FAULT: "with a fault",
    Outcome.SUSPICION: "with a suspicion",
    Outcome.CANNOT_TELL: "without an answer",
    Outcome.NO_FAULT: "without a fault found",
}
N_COLUMNS = 3
N_PANELS = 6
MOST_IN_FIGURE = 40


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

    Returns
    -------
    Path
        Of the page.
    """
    ordered = sorted(entries, key=by_severity)
    names = _key_names(ordered)
    columns = names[:N_COLUMNS]
    html = render(
        "index.html.j2",
        rows=_rows(ordered, columns),
        columns=[_heading(ordered, name) for name in columns],
        summary=_summary(ordered, failures),
        failures=failures,
        picture=_picture(ordered, names[:N_PANELS]),
        command=command,
        version=__version__,
        date=(date or datetime.now().astimezone()).strftime("%Y-%m-%d %H:%M %Z").strip(),
    )
    return write_text(Path(path), html)


def _key_names(entries: Sequence[Entry]) -> list[str]:
    """Return the key indicators that have a value somewhere."""
    present = {i.name for entry in entries for i in entry.indicators if isfinite(i.value)}
    return [name for name in KEY_INDICATORS if name in present]


def _rows(entries: Sequence[Entry], columns: Sequence[str]) -> list[IndexRow]:
    largest = {name: [_largest(entry, name) for entry in entries] for name in columns}
    return [
        IndexRow(
            entry,
            css_class(entry.outcome),
            quote(entry.page),
            f"{100 * entry.confidence:.0f} %" if entry.confidence is not None else "",
            _size(entry),
            tuple(_cell(values[i], values) for values in largest.values()),
        )
        for i, entry in enumerate(entries)
    ]


def _size(entry: Entry) -> str:
    """Return the depth of a crack, or how far a finding is over its floor."""
    if entry.crack_mm is not None:
        return f"{entry.crack_mm:.1f} mm"
    return f"{readable(entry.ratio_db, 3)} dB" if entry.ratio_db is not None else "–"


def _largest(entry: Entry, name: str) -> Indicator | None:
    found = [i for i in entry.indicators if i.name == name and isfinite(i.value)]
    return max(found, key=lambda i: i.value, default=None)


def _cell(own: Indicator | None, column: Sequence[Indicator | None]) -> IndexCell:
    """Return an indicator with a bar from zero, where the column has one unit and no negative value."""
    if own is None:
        return IndexCell("–", 0.0)
    known = [i for i in column if i is not None]
    comparable = len({i.unit for i in known}) == 1 and all(i.value >= 0 for i in known)
    top = max(i.value for i in known)
    unit = "" if len({i.unit for i in known}) == 1 else f" {unit_text(own.unit)}"
    return IndexCell(readable(own.value, 3) + unit, round(100 * own.value / top, 1) if comparable and top > 0 else 0.0)


def _heading(entries: Sequence[Entry], name: str) -> str:
    units = {i.unit for entry in entries for i in entry.indicators if i.name == name and isfinite(i.value)}
    unit = units.pop() if len(units) == 1 else ""
    return f"{name} ({unit_text(unit)})" if unit else name


def _summary(entries: Sequence[Entry], failures: Sequence[Failure]) -> str:
    counts: dict[str, int] = {}
    for entry in entries:
        counts[_SUMMARY[entry.outcome]] = counts.get(_SUMMARY[entry.outcome], 0) + 1
    parts = [f"{n} {words}" for words, n in counts.items()] + ([f"{len(failures)} not analysed"] if failures else [])
    n_files = len(entries) + len(failures)
    return f"{n_files} recording{'s' if n_files != 1 else ''}: {', '.join(parts)}" if parts else "No recordings"


def _picture(entries: Sequence[Entry], names: Sequence[str]) -> Picture | None:
    """Return the dots of the key indicators, where there are recordings to compare."""
    if len(entries) < 2 or not names:
        return None
    from gearsig.plot import trend_figure

    shown = entries[:MOST_IN_FIGURE]
    rest = f" The {len(shown)} most severe of {len(entries)} recordings." if len(shown) < len(entries) else ""
    faulty = [entry.name for entry in shown if entry.outcome is Outcome.FAULT]
    return embed(
        trend_figure({entry.name: entry.indicators for entry in shown}, names=names, highlighted=faulty),
        f"A recording that stands apart deserves a look; orange ones have a fault. One dot per channel and gear.{rest}",
        f"Dots of {', '.join(names)} for {len(shown)} recordings.",
        vector=len(shown) * len(names) <= 60,
    )
