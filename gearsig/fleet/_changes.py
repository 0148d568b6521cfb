"""Changes of a fleet since a date: new recordings, alarms raised and cleared, changed diagnoses and levels."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any

from gearsig.cache import write_whole
from gearsig.fleet._fleet import DiagnosisChange, Fleet
from gearsig.fleet._trends import LEVEL_NAMES, STATUS_LEVELS, events_of, level_name
from gearsig.formatting import counted, moment_text, readable, signed

if TYPE_CHECKING:
    from pandas import DataFrame

LAST_REPORT = "last_report.json"


@dataclass(frozen=True)
class AlarmChange:
    """An alarm that was raised or cleared.

    Parameters
    ----------
    machine, point, name, channel, place, computed_on, basis : str
        Of the series.
    level : str
        "warning" or "alarm".
    raised, cleared : datetime
        Dates of the recordings; `cleared` is None while the alarm stands.
    value, expected, upper_limit, change : float
        Of the last recording; the change is in dB if `in_db`.
    unit : str
    in_db : bool
    """

    machine: str
    point: str
    name: str
    channel: str
    place: str
    computed_on: str
    basis: str
    level: str
    raised: datetime
    cleared: datetime | None
    value: float
    expected: float
    upper_limit: float
    change: float
    unit: str
    in_db: bool


@dataclass(frozen=True)
class FleetChanges:
    """What changed since a date.

    Parameters
    ----------
    since : datetime or None
        In UTC, by when results were added to the store; None: since the beginning.
    n_new, n_failed : int
        Recordings added since, and how many of them have no result.
    failures : tuple of (str, str)
        File and reason of the last hundred without a result.
    raised, cleared : tuple of AlarmChange
        Alarms, the most severe first.
    diagnoses : tuple of DiagnosisChange
        The worst first.
    shifted : DataFrame
        Series without an alarm whose level has changed; rows as in `Fleet.series`.
    status : DataFrame
        See `Fleet.status`.
    """

    since: datetime | None
    n_new: int
    n_failed: int
    failures: tuple[tuple[str, str], ...]
    raised: tuple[AlarmChange, ...]
    cleared: tuple[AlarmChange, ...]
    diagnoses: tuple[DiagnosisChange, ...]
    shifted: DataFrame
    status: DataFrame


def fleet_changes(fleet: Fleet, since: datetime | None = None) -> FleetChanges:
    """Return what changed since a date (UTC), by when results were added; None: since the beginning."""
    moment = since or datetime(1900, 1, 1)  # noqa: DTZ001 - the store's times are UTC without a zone
    status = fleet.status()
    series = fleet.series()
    n_new, n_failed, failures, diagnoses = fleet.news(moment)
    raised, cleared = [], []
    for row in series[series["events"] != "[]"].to_dict("records"):
        for event in events_of(str(row["events"])):
            change = _alarm(row, LEVEL_NAMES[event.level], event.raised, event.cleared)
            if event.added > moment:
                raised.append(change)
            elif event.cleared_added is not None and event.cleared_added > moment:
                cleared.append(change)
    alarmed = series["level"] > 0
    shifted = series[~alarmed & (series["changed_added"] > moment)]
    return FleetChanges(since, n_new, n_failed, failures, _sorted(raised), _sorted(cleared), diagnoses, shifted, status)


def last_report(fleet: Fleet) -> datetime | None:
    """Return when the last report of a fleet was made (UTC); None if there was none."""
    try:
        return datetime.fromisoformat(json.loads((fleet.folder / LAST_REPORT).read_text(encoding="utf-8"))["until"])
    except (OSError, ValueError, KeyError, TypeError):
        return None


def mark_reported(fleet: Fleet, until: datetime | None = None) -> None:
    """Record that everything up to `until` (UTC; None: now) has been reported."""
    now = until or datetime.now(UTC).replace(tzinfo=None)
    text = json.dumps({"until": now.isoformat()}) + "\n"
    write_whole(fleet.folder / LAST_REPORT, lambda file: file.write(text.encode()))


def _alarm(row: dict[Any, Any], level: str, raised: datetime, cleared: datetime | None) -> AlarmChange:
    texts = {name: str(row[name]) for name in ("machine", "point", "name", "channel", "place", "computed_on", "basis")}
    numbers = {name: float(row[name]) for name in ("value", "expected", "upper_limit", "change")}
    facts: dict[str, Any] = {**texts, **numbers, "unit": str(row["unit"]), "in_db": bool(row["in_db"])}
    return AlarmChange(level=level, raised=raised, cleared=cleared, **facts)


def _sorted(changes: list[AlarmChange]) -> tuple[AlarmChange, ...]:
    return tuple(sorted(changes, key=lambda c: (c.cleared is not None, c.level != "alarm", -abs(c.change), c.machine)))


def level_counts(status: DataFrame) -> dict[str, str]:
    """Return the number of measuring points at each level that occurs in a table of `Fleet.status`, as text.

    Examples
    --------
    >>> from pandas import DataFrame
    >>> level_counts(DataFrame({"level": ["ok", "alarm", "alarm", "unknown"]}))
    {'alarm': '2 alarms', 'unknown': '1 unknown', 'ok': '1 ok'}
    """
    counts = {name: int((status["level"] == name).sum()) for name in STATUS_LEVELS}
    nouns = ("alarm", "warning")
    return {name: counted(n, name) if name in nouns else f"{n} {name}" for name, n in counts.items() if n}


def counts_text(status: DataFrame) -> str:
    """Return `level_counts` in one sentence."""
    return f"{counted(len(status), 'measuring point')}: {', '.join(level_counts(status).values())}"


def series_level(row: Mapping[Any, Any]) -> str:
    """Return the name of the level of a row of `Fleet.series`; "unknown" if there are no limits."""
    return level_name(int(row["level"]), str(row["basis"]))


def diagnosis_text(row: Mapping[Any, Any]) -> str:
    """Return what a measuring point's last conclusive recording shows, from a row of `Fleet.status`."""
    if row["outcome"] in ("fault", "suspicion"):
        return str(row["verdict"])
    return row["outcome"] if isinstance(row["outcome"], str) else "–"  # missing where none could be analysed


def trends_text(row: Mapping[Any, Any]) -> str:
    """Return a summary of a measuring point's trends, from a row of `Fleet.status`."""
    from pandas import isna

    counts = [
        f"{row[key]:.0f} {name}{'s' * (row[key] != 1)}"
        for key, name in (("n_alarms", "alarm"), ("n_warnings", "warning"))
        if not isna(row[key]) and row[key]
    ]
    if not counts:
        n = row["n_baseline"]
        return "" if isna(n) or n else "baseline not complete"
    since = "" if isna(row["since"]) else f" since {moment_text(row['since'])}"
    change = change_text(row["change"], in_db=bool(row["change_in_db"]))
    of = f" of {row['worst_place']}" if row["worst_place"] else ""
    return f"{', '.join(counts)}{since}; worst: {row['worst']}{of}{f' {change}' if change else ''}"


def change_text(change: float, *, in_db: bool) -> str:
    """Return the deviation of a value from the expected one as text; empty without an expected value."""
    if change != change:  # noqa: PLR0124 - nan: there is no baseline
        return ""
    return f"{signed(change)} dB" if in_db else f"{'+' if change > 0 else ''}{readable(change, 3)}"
