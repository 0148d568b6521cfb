"""Indicators as tables: one per gear or shaft, channels side by side."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from gearsig.indicators.types import Indicator
from gearsig.plot.display import unit_text
from gearsig.report.numbers import readable
from gearsig.report.sections import named

Key = tuple[str, str, str, str]


@dataclass(frozen=True)
class IndicatorRow:
    """One indicator on all channels."""

    name: str
    unit: str
    computed_on: str
    band: str
    values: tuple[str, ...]
    note: str


@dataclass(frozen=True)
class IndicatorTable:
    """The indicators of one place: a gear, a shaft, or the channels as a whole."""

    title: str
    channels: tuple[str, ...]
    rows: tuple[IndicatorRow, ...]


def indicator_tables(indicators: Iterable[Indicator]) -> tuple[IndicatorTable, ...]:
    """Group indicators by what they belong to; each row then compares the channels."""
    places: dict[str, list[Indicator]] = {}
    for indicator in indicators:
        places.setdefault(_place(indicator), []).append(indicator)
    return tuple(_table(title, items) for title, items in places.items())


def _place(indicator: Indicator) -> str:
    if indicator.gear:
        return _capital(named("gear", indicator.gear))
    if indicator.bearing:
        return _capital(named("bearing", indicator.bearing))
    return _capital(named("shaft", indicator.shaft)) or "Channels as a whole"


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:] if text.startswith(("gear ", "bearing ", "shaft ")) else text


def _table(title: str, items: list[Indicator]) -> IndicatorTable:
    channels = tuple(dict.fromkeys(item.channel for item in items))
    rows: dict[Key, dict[str, Indicator]] = {}
    for item in items:
        rows.setdefault((item.name, item.unit, item.computed_on, item.band), {})[item.channel] = item
    return IndicatorTable(title, channels, tuple(_row(key, row, channels) for key, row in rows.items()))


def _row(key: Key, row: dict[str, Indicator], channels: tuple[str, ...]) -> IndicatorRow:
    values = tuple(readable(row[channel].value) if channel in row else "" for channel in channels)
    notes: dict[str, list[str]] = {}
    for channel, item in row.items():
        if item.note:
            notes.setdefault(item.note, []).append(channel)
    texts = [note if len(named) == len(row) else f"{', '.join(named)}: {note}" for note, named in notes.items()]
    name, unit, computed_on, band = key
    return IndicatorRow(name, unit_text(unit), computed_on, band, values, "; ".join(texts))
