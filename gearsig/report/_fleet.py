"""The page that says what changed in a fleet since last time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Any

from gearsig import __version__
from gearsig.cache import write_text
from gearsig.errors import InputError
from gearsig.fleet import AlarmChange, Fleet, FleetChanges, Trend, change_text, counts_text, fleet_changes, trends_text
from gearsig.formatting import readable, unit_text
from gearsig.plot import Picture, svg_panel, trend_panel
from gearsig.report._files import compiled, date_text, put_picture, render, write_pdf

LEVEL_CLASSES = {"alarm": "fault", "warning": "suspicion", "unknown": "cannot-tell", "ok": "no-fault"}
MAX_ROWS, MAX_POINTS, MAX_PICTURES = 60, 200, 8


@dataclass(frozen=True)
class AlarmRow:
    """An alarm as the page shows it."""

    level: str
    css_class: str
    machine: str
    name: str
    of: str
    value: str
    expected: str
    limit: str
    change: str
    raised: str
    cleared: str
    basis: str


def fleet_page_html(fleet: Fleet, since: datetime | None = None, *, date: datetime | None = None) -> str:
    """Return the page that says what changed in a fleet.

    Parameters
    ----------
    fleet : Fleet
    since : datetime or None
        In UTC; None: since ever.
    date : datetime or None
        Of the page; None: now.
    """
    return render("fleet.html.j2", **_page_values(fleet, since, date))


def fleet_page_pdf(fleet: Fleet, since: datetime | None = None, *, date: datetime | None = None) -> bytes:
    """Return the page that `fleet_page_html` makes as PDF.

    Raises
    ------
    InputError
        If typst is not installed.
    """
    return _pdf(_page_values(fleet, since, date))


def _page_values(fleet: Fleet, since: datetime | None, date: datetime | None) -> dict[str, Any]:
    """Return what the page shows, by the names of its template."""
    changes = fleet_changes(fleet, since)
    status = changes.status.head(MAX_POINTS).to_dict("records")
    n_points = len(changes.status)
    return {
        "since": f"since {since:%Y-%m-%d %H:%M} UTC" if since is not None else "since the beginning",
        "date": date_text(date),
        "version": __version__,
        "summary": _summary(changes),
        "counts": f"{counts_text(changes.status)}." if n_points else "",
        "diagnoses": changes.diagnoses[:MAX_ROWS],
        "raised": [_row(change) for change in changes.raised[:MAX_ROWS]],
        "cleared": [_row(change) for change in changes.cleared[:MAX_ROWS]],
        "pictures": _pictures(fleet, changes.raised),
        "shifted": [_shift(row) for row in changes.shifted.head(MAX_ROWS).to_dict("records")],
        "failures": changes.failures,
        "status": [
            {str(key): value for key, value in row.items()}
            | {
                "css_class": LEVEL_CLASSES[row["level"]],
                "last": f"{row['last']:%Y-%m-%d %H:%M}",
                "outcome": row["outcome"] or "–",
                "trends": trends_text(row),
            }
            for row in status
        ],
        "n_more": n_points - len(status),
    }


def write_fleet_page(fleet: Fleet, path: str | Path, since: datetime | None = None, *, pdf: bool = False) -> Path:
    """Write the page that `fleet_page_html` makes, and beside it the same as PDF where that is asked for."""
    values = _page_values(fleet, since, None)
    if pdf:
        write_pdf(Path(path).with_suffix(".pdf"), _pdf(values))
    return write_text(Path(path), render("fleet.html.j2", **values))


def _pdf(values: dict[str, Any]) -> bytes:
    """Return the page's values as PDF."""
    pictures: dict[str, bytes] = {}
    alarm = ("", "machine", "indicator", "of", "now", "expected", "limit", "change", "raised", "cleared", "limits")
    of_alarm = ("level", "machine", "name", "of", "value", "expected", "limit", "change", "raised", "cleared", "basis")
    tables = [
        (
            "Other diagnoses than before",
            ("now", "machine", "point", "before", "verdict"),
            [
                (row.now.replace(" ", "-"), [row.now, row.machine, row.point, row.before or "new", row.verdict])
                for row in values["diagnoses"]
            ],
        ),
        *(
            (title, alarm, [(row.css_class, [getattr(row, name) for name in of_alarm]) for row in values[key]])
            for title, key in (("Alarms raised", "raised"), ("Alarms cleared", "cleared"))
        ),
        (
            "Levels that changed within their limits",
            ("machine", "indicator", "of", "since", "by"),
            [("", list(row.values())) for row in values["shifted"]],
        ),
        ("Not analysed", ("file", "reason"), [("", list(row)) for row in values["failures"]]),
        (
            "All measuring points, worst first",
            ("", "machine", "point", "last", "recordings", "diagnosis", "trends"),
            [
                (
                    row["css_class"],
                    [row[k] for k in ("level", "machine", "point", "last", "n_recordings", "outcome", "trends")],
                )
                for row in values["status"]
            ],
        ),
    ]
    data = {
        "title": f"Fleet: what changed {values['since']}",
        "made": f"{values['date']}, gearsig {values['version']}",
        "tables": [
            {
                "title": title,
                "columns": columns,
                "rows": [{"css_class": css_class, "cells": [str(cell) for cell in cells]} for css_class, cells in rows],
            }
            for title, columns, rows in tables
            if rows
        ],
        "pictures": [(heading, put_picture(picture, pictures)) for heading, picture in values["pictures"]],
    }
    return compiled("fleet.typ", data | {name: values[name] for name in ("summary", "counts", "n_more")}, pictures)


def _summary(changes: FleetChanges) -> str:
    n_alarms = sum(change.level == "alarm" and change.cleared is None for change in changes.raised)
    n_warnings = sum(change.level == "warning" and change.cleared is None for change in changes.raised)
    worse = sum(change.now in ("fault", "suspicion") for change in changes.diagnoses)
    parts = [
        f"{n} {name}{'s' * (n != 1)}"
        for n, name in ((n_alarms, "new alarm"), (n_warnings, "new warning"), (len(changes.cleared), "cleared alarm"))
        if n
    ]
    parts += [f"{worse} measuring point{'s' * (worse != 1)} with a new fault or suspicion"] if worse else []
    parts += [f"{changes.n_failed} recording{'s' * (changes.n_failed != 1)} not analysed"] if changes.n_failed else []
    n = changes.n_new
    head = f"{n} new recording{'s' * (n != 1)}"
    return f"{head}: {', '.join(parts)}." if parts else f"{head}; nothing changed."


def _row(change: AlarmChange) -> AlarmRow:
    unit = f" {unit_text(change.unit)}" if change.unit else ""
    return AlarmRow(
        change.level,
        LEVEL_CLASSES[change.level],
        " · ".join(part for part in (change.machine, change.point) if part),
        change.name,
        ", ".join(part for part in (change.place, change.channel, change.computed_on) if part),
        readable(change.value, 4) + unit,
        readable(change.expected, 4),
        readable(change.upper_limit, 4),
        change_text(change.change, in_db=change.in_db),
        f"{change.raised:%Y-%m-%d}",
        f"{change.cleared:%Y-%m-%d}" if change.cleared is not None else "",
        change.basis,
    )


def _shift(row: Mapping[Any, Any]) -> dict[str, str]:
    return {
        "machine": " · ".join(part for part in (row["machine"], row["point"]) if part),
        "name": row["name"],
        "of": ", ".join(part for part in (row["place"], row["channel"], row["computed_on"]) if part),
        "since": f"{row['changed']:%Y-%m-%d}",
        "by": change_text(row["changed_by"], in_db=bool(row["in_db"])),
    }


def _pictures(fleet: Fleet, raised: Sequence[AlarmChange]) -> list[tuple[str, Picture]]:
    """Return the trends of the largest alarms that stand, one of each measuring point first."""
    chosen: dict[tuple[str, str], AlarmChange] = {}
    for change in raised:
        chosen.setdefault((change.machine, change.point), change)
    result = []
    for change in list(chosen.values())[:MAX_PICTURES]:
        try:
            trends = fleet.trend(
                change.machine,
                change.name,
                point=change.point,
                channel=change.channel,
                place=change.place,
                computed_on=change.computed_on,
            )
        except InputError:  # a file was set aside meanwhile
            continue
        heading = " · ".join(part for part in (change.machine, change.point) if part)
        result.append((heading, _picture(trends[0])))
    return result


def _picture(trend: Trend) -> Picture:
    panel, marked = trend_panel(trend)
    of = ", ".join(part for part in (trend.place, trend.channel, trend.computed_on, trend.band) if part)
    first, last = (f"{date:%Y-%m-%d}" for date in (trend.table["date"].iloc[0], trend.table["date"].iloc[-1]))
    return Picture.of_svg(
        svg_panel(panel, marked=marked, width=900, height=154),
        f"{trend.name} ({of}). Pale band: within the limits ({trend.basis}); dotted: alarm; grey: baseline; circled: "
        "beyond the limits.",
        f"{trend.name} of {trend.machine} {trend.point} from {first} to {last}: {trend.level}.",
    )
