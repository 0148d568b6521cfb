"""The page of what changed in a fleet since last time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from datetime import datetime
from pathlib import Path
from typing import Any

from gearsig import __version__
from gearsig.cache import write_text
from gearsig.errors import InputError
from gearsig.fleet import (
    AlarmChange,
    Fleet,
    FleetChanges,
    Trend,
    change_text,
    counts_text,
    diagnosis_text,
    fleet_changes,
    trends_text,
)
from gearsig.formatting import moment_text, readable, unit_text
from gearsig.plot import Picture, svg_panel, trend_panel
from gearsig.report._files import compiled, date_text, render, write_pdf

LEVEL_CLASSES = {"alarm": "fault", "warning": "suspicion", "unknown": "cannot-tell", "ok": "no-fault"}
MAX_ROWS, MAX_POINTS, MAX_PICTURES = 60, 200, 8


def _page_values(fleet: Fleet, since: datetime | None) -> dict[str, Any]:
    """Return the values of the page's template."""
    changes = fleet_changes(fleet, since)
    status = changes.status.head(MAX_POINTS).to_dict("records")
    n_points = len(changes.status)
    return {
        "since": f"since {since:%Y-%m-%d %H:%M} UTC" if since is not None else "since the beginning",
        "date": date_text(),
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
            {
                **{name: row[name] for name in ("level", "machine", "point", "n_recordings")},
                "css_class": LEVEL_CLASSES[row["level"]],
                "last": f"{row['last']:%Y-%m-%d %H:%M}",
                "outcome": diagnosis_text(row),
                "trends": trends_text(row),
            }
            for row in status
        ],
        "n_more": n_points - len(status),
    }


def write_fleet_page(fleet: Fleet, path: str | Path, since: datetime | None = None, *, pdf: bool = False) -> Path:
    """Write the page of what changed in a fleet and, if requested, the same as PDF beside it.

    Parameters
    ----------
    fleet : Fleet
    path : str or Path
    since : datetime or None
        In UTC; None: since the beginning.
    pdf : bool

    Raises
    ------
    InputError
        If typst is not installed.
    """
    values = _page_values(fleet, since)
    if pdf:
        write_pdf(Path(path).with_suffix(".pdf"), compiled("fleet.typ", values))
    return write_text(Path(path), render("fleet.html.j2", **values))


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


def _series(of: Mapping[Any, Any]) -> dict[str, str]:
    """Return machine, name and location of a series."""
    return {
        "machine": " · ".join(filter(None, (of["machine"], of["point"]))),
        "name": of["name"],
        "of": ", ".join(filter(None, (of["place"], of["channel"], of["computed_on"]))),
    }


def _row(change: AlarmChange) -> dict[str, str]:
    unit = f" {unit_text(change.unit)}" if change.unit else ""
    return {
        "level": change.level,
        "css_class": LEVEL_CLASSES[change.level],
        **_series(vars(change)),
        "value": readable(change.value, 4) + unit,
        "expected": readable(change.expected, 4),
        "limit": readable(change.upper_limit, 4),
        "change": change_text(change.change, in_db=change.in_db),
        "raised": moment_text(change.raised),
        "cleared": moment_text(change.cleared) if change.cleared is not None else "",
        "basis": change.basis,
    }


def _shift(row: Mapping[Any, Any]) -> dict[str, str]:
    return {
        **_series(row),
        "since": moment_text(row["changed"]),
        "by": change_text(row["changed_by"], in_db=bool(row["in_db"])),
    }


def _pictures(fleet: Fleet, raised: Sequence[AlarmChange]) -> list[tuple[str, Picture]]:
    """Return the trends of the largest active alarms, starting with one for each measuring point."""
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
        except InputError:  # a file was removed in the meantime
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
