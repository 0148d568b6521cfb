"""The page that compares recordings: the worst first, with links to their pages."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime
from math import isfinite
from pathlib import Path
from urllib.parse import quote

from gearsig import __version__
from gearsig.diagnosis.types import Outcome
from gearsig.formatting import readable
from gearsig.indicators.types import Indicator
from gearsig.plot.display import unit_text
from gearsig.plot.embed import Picture, embed
from gearsig.report.entry import Entry, Failure, by_severity
from gearsig.report.files import write_text
from gearsig.report.render import render
from gearsig.report.sections import css_class

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
    from gearsig.plot.trend import trend_figure

    shown = entries[:MOST_IN_FIGURE]
    rest = f" The {len(shown)} most severe of {len(entries)} recordings." if len(shown) < len(entries) else ""
    faulty = [entry.name for entry in shown if entry.outcome is Outcome.FAULT]
    return embed(
        trend_figure({entry.name: entry.indicators for entry in shown}, names=names, highlighted=faulty),
        f"A recording that stands apart deserves a look; orange ones have a fault. One dot per channel and gear.{rest}",
        f"Dots of {', '.join(names)} for {len(shown)} recordings.",
        vector=len(shown) * len(names) <= 60,
    )
