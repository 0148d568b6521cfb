"""The page that compares recordings, worst first, with links to their pages."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from math import inf, isfinite
from pathlib import Path
from typing import Any
from urllib.parse import quote

from gearsig import __version__
from gearsig.cache import write_text
from gearsig.diagnosis import Analysis, Outcome, verdict_of
from gearsig.fleet import date_in_name
from gearsig.formatting import csv_rows, moment_text, percent, readable, spreadsheet_cell, unit_text
from gearsig.indicators import Indicator
from gearsig.plot import with_unit
from gearsig.report._files import compiled, date_text, render, write_pdf
from gearsig.report._sections import css_class, sure_of
from gearsig.severity import CrackEstimate


@dataclass(frozen=True)
class Entry:
    """An analysed recording.

    Parameters
    ----------
    name : str
        As given by the user, e.g. the file's name.
    page : str
        Address of its page, relative to the index; empty: no page.
    outcome : Outcome
    verdict : str
    conclusion : str
        The brief verdict: the index shows the outcome beside it.
    confidence : float or None
        Of the fault or suspicion in the verdict; None if there is none.
    sure_of : str
        What the confidence refers to if that need not be a fault: "impacts" of unknown cause, "a change".
    ratio_db : float or None
        Ratio of that finding to its floor.
    indicators : tuple of Indicator
    crack_mm : float or None
        Depth of the crack, if the verdict is about one.
    is_reference : bool
        Whether the other recordings were compared with this one.
    machine : str
        Name of the rig.
    """

    name: str
    page: str
    outcome: Outcome
    verdict: str
    conclusion: str = ""
    confidence: float | None = None
    sure_of: str = ""
    ratio_db: float | None = None
    indicators: tuple[Indicator, ...] = ()
    crack_mm: float | None = None
    is_reference: bool = False
    machine: str = ""

    @property
    def date(self) -> datetime | None:
        """Date in the name; the file's modification time says little about when it was recorded."""
        return date_in_name(self.name)


@dataclass(frozen=True)
class Failure:
    """A recording that could not be analysed, and why."""

    name: str
    reason: str


def entry_of(analysis: Analysis, name: str, page: str) -> Entry:
    """Summarise an analysis for the index page."""
    top = analysis.top_claim
    crack_mm, crack = None, analysis.crack
    if isinstance(crack, CrackEstimate) and not crack.likelier_other and top is not None:
        is_of_crack = (top.where.gear, top.where.angle_deg) == (crack.gear, crack.angle_deg)
        crack_mm = crack.depth_mm if is_of_crack else None
    return Entry(
        name,
        page,
        analysis.outcome,
        analysis.verdict,
        verdict_of(analysis.findings, has_reference=analysis.reference is not None, brief=True),
        top.confidence if top is not None else None,
        sure_of(top) if top is not None else "",
        top.strength.ratio_db if top is not None and top.strength is not None else None,
        analysis.indicators,
        crack_mm,
        machine=analysis.rig.name if analysis.rig is not None else "",
    )


def by_severity(entry: Entry) -> tuple[int, float, float, float, str]:
    """Sort key, most important first: outcome, then crack depth, then confidence, then strength."""
    place = list(Outcome).index(entry.outcome)
    return place, -(entry.crack_mm or 0.0), -(entry.confidence or 0.0), -(entry.ratio_db or 0.0), entry.name


KEY_INDICATORS = (
    "overall velocity",
    "FM4",
    "kurtosis",
    "sideband index",
    "NA4",
    "sideband level",
    "FM0",
    "rms",
    "crest factor",
)
"""Indicators that the index compares, if computed: tooth-local ones first, then impulsive, modulation, level."""


OUTCOME_WORDS = {
    Outcome.FAULT: "with a fault",
    Outcome.SUSPICION: "with a suspicion",
    Outcome.CANNOT_TELL: "without an answer",
    Outcome.NO_FAULT: "without a fault found",
}


def index_of(ordered: Sequence[Entry], failures: Sequence[Failure] = ()) -> dict[str, Any]:
    """Return the content of the index for HTML and PDF: entries, worst first, with their key indicators compared.

    Each row has its position in each sort order of the table.
    """
    present = {i.name for entry in ordered for i in entry.indicators if isfinite(i.value)}
    names = [name for name in KEY_INDICATORS if name in present][:3]
    columns = [_column(ordered, name) for name in names]
    orders = {
        "worst first": list(range(len(ordered))),
        "name": _places([(entry.name.lower(), entry.name) for entry in ordered]),
        "machine": _places([(entry.machine.lower(), i) for i, entry in enumerate(ordered)]),
    }
    has_dates = any(entry.date is not None for entry in ordered)
    if has_dates:
        ages = [-entry.date.timestamp() if entry.date is not None else inf for entry in ordered]
        orders["latest first"] = _places([(age, i) for i, age in enumerate(ages)])
    for name in names:
        orders[name] = _places([(-_largest(entry, name), i) for i, entry in enumerate(ordered)])
    rows = [
        {
            "entry": replace(entry, indicators=(), ratio_db=None),  # these are shown as texts
            "css_class": css_class(entry.outcome),
            "href": quote(entry.page),
            "date": moment_text(entry.date) if entry.date is not None else "",
            "confidence": percent(entry.confidence) if entry.confidence is not None else "",
            "ratio": _size_text(entry),
            "cells": [cells[i] for _, cells in columns],
            "places": [place[i] for place in orders.values()],
        }
        for i, entry in enumerate(ordered)
    ]
    counts = Counter(entry.outcome for entry in ordered)
    parts = [f"{n} {OUTCOME_WORDS[outcome]}" for outcome, n in counts.items()]
    parts += [f"{len(failures)} not analysed"] if failures else []
    n_files = len(ordered) + len(failures)
    return {
        "rows": rows,
        "columns": [heading for heading, _ in columns],
        "orders": list(orders),
        "has_dates": has_dates,
        "summary": f"{n_files} recording{'s' * (n_files != 1)}: {', '.join(parts)}" if parts else "No recordings",
        "outcomes": [(css_class(outcome), outcome.value, n) for outcome, n in counts.items()],
        "machines": list(dict.fromkeys(entry.machine for entry in ordered if entry.machine)),
    }


def _places(keys: Sequence[Any]) -> list[int]:
    """Return the position of each key in sorted order."""
    result = [0] * len(keys)
    for place, number in enumerate(sorted(range(len(keys)), key=keys.__getitem__)):
        result[number] = place
    return result


def _largest(entry: Entry, name: str, unit: str | None = None) -> float:
    known = (i for i in entry.indicators if i.name == name and unit in (None, i.unit))
    return max((i.value for i in known if isfinite(i.value)), default=-inf)


def write_index(
    entries: Sequence[Entry],
    path: str | Path,
    *,
    failures: Sequence[Failure] = (),
    command: str = "",
    n_missing: int = 0,
    pdf: bool = False,
) -> Path:
    """Write the index page: recordings in one table that can be sorted and filtered, and the files that failed.

    It has no scripts: CSS alone sorts and filters. `batch.csv` and `batch.json`, with one row for each recording, are
    written beside it.

    Parameters
    ----------
    entries : sequence of Entry
    path : str or Path
        Path of the index; the pages of the entries are expected beside it.
    failures : sequence of Failure
        Listed with their reasons.
    command : str
        The command that reproduces the report.
    n_missing : int
        Recordings still to be analysed; if there are any, the page says so and is written without CSV and JSON.
    pdf : bool
        Also write the index as PDF.

    Returns
    -------
    Path
        Of the page.
    """
    path, ordered = Path(path), sorted(entries, key=by_severity)
    values = {"index": index_of(ordered, failures), "failures": failures, "date": date_text(), "legend": LEGEND}
    html = render("index.html.j2", **values, command=command, version=__version__, n_missing=n_missing)
    if not n_missing:
        write_batch(ordered, path.parent, failures=failures)
    if pdf and not n_missing:
        write_pdf(path.with_suffix(".pdf"), compiled("index.typ", values))
    return write_text(path, html)


def write_batch(ordered: Sequence[Entry], folder: Path, *, failures: Sequence[Failure] = ()) -> None:
    """Write `batch.csv` and `batch.json` with one row for each recording, worst first; failed ones have a reason.

    Indicators are named with their unit: "rms (m/s²)".
    """
    # Channels may have different units: there is a column for the maximum in each unit.
    columns_of = {(i.name, i.unit): with_unit(i.name, i.unit) for entry in ordered for i in entry.indicators}
    records: list[dict[str, Any]] = []
    for entry in ordered:
        values = {column: _largest(entry, *key) for key, column in columns_of.items()}
        records.append(
            {
                "recording": entry.name,
                "machine": entry.machine,
                "date": entry.date.isoformat(sep=" ") if entry.date is not None else "",
                "outcome": entry.outcome.value,
                "verdict": entry.verdict,
                "confidence": entry.confidence,
                "confidence_of": entry.sure_of or ("" if entry.confidence is None else "a fault"),
                "ratio_db": entry.ratio_db,
                "crack_mm": entry.crack_mm,
                "is_reference": entry.is_reference,
                "page": entry.page,
                "reason": "",
                **{name: value if isfinite(value) else None for name, value in values.items()},
            }
        )
    records += [{"recording": f.name, "outcome": "not analysed", "reason": f.reason} for f in failures]
    write_text(
        folder / "batch.json", json.dumps({"schema": "gearsig.batch", "version": 2, "recordings": records}, indent=1)
    )
    header = list(records[0]) if ordered else ["recording", "outcome", "reason"]
    cells = ([spreadsheet_cell(record.get(name, "")) for name in header] for record in records)
    write_text(folder / "batch.csv", csv_rows(header, cells))


LEGEND = (
    "Sure: maximum confidence that the finding is right; for impacts or a change, that they exist: their cause is not "
    "known and need not be a fault. Size: how far the finding is above its floor, in dB, or the depth of a crack, in "
    "mm. Indicators: the maximum over channels and gears."
)


def _column(entries: Sequence[Entry], name: str) -> tuple[str, list[dict[str, Any]]]:
    """Return an indicator's heading, and its maximum in each recording with the length of a bar.

    Bars start at zero; there are none if the column has several units or negative values.
    """
    known = [[i for i in entry.indicators if i.name == name and isfinite(i.value)] for entry in entries]
    units = {i.unit for items in known for i in items}
    largest = [max(items, key=lambda i: i.value, default=None) for items in known]
    values = [i.value for i in largest if i is not None]
    top = max(values)
    shown = {i.unit for i in largest if i is not None}
    has_bars = len(shown) == 1 and min(values) >= 0 and top > 0
    cells = [
        {"text": "–", "percent": 0.0}
        if i is None
        else {
            "text": readable(i.value, 3) + ("" if len(shown) == 1 else f" {unit_text(i.unit)}"),
            "percent": round(100 * i.value / top, 1) if has_bars else 0.0,
        }
        for i in largest
    ]
    return with_unit(name, units.pop() if len(units) == 1 else ""), cells


def _size_text(entry: Entry) -> str:
    """Return the depth of a crack, or how far a finding is above its floor."""
    if entry.crack_mm is not None:
        return f"{entry.crack_mm:.1f} mm"
    return f"{readable(entry.ratio_db, 3)} dB" if entry.ratio_db is not None else "–"
