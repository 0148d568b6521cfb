"""Indicators as tables: one per gear or shaft, channels side by side."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from gearsig.diagnosis.comparison import Change
from gearsig.formatting import named, readable
from gearsig.indicators.types import Indicator
from gearsig.plot.display import unit_text

Key = tuple[str, str, str, str]
Compared = tuple[Indicator, Change | None]


@dataclass(frozen=True)
class IndicatorRow:
    """One indicator on all channels."""

    name: str
    unit: str
    computed_on: str
    band: str
    values: tuple[str, ...]
    note: str
    references: tuple[str, ...] = ()


@dataclass(frozen=True)
class IndicatorTable:
    """The indicators of one place: a gear, a shaft, or the channels as a whole."""

    title: str
    channels: tuple[str, ...]
    rows: tuple[IndicatorRow, ...]


def indicator_tables(indicators: Sequence[Indicator], then: Sequence[Change | None] = ()) -> tuple[IndicatorTable, ...]:
    """Group indicators by what they belong to; each row then compares the channels, and these with the reference."""
    places: dict[str, list[Compared]] = {}
    for indicator, change in zip(indicators, then or [None] * len(indicators), strict=True):
        places.setdefault(_place(indicator), []).append((indicator, change))
    return tuple(_table(title, items) for title, items in places.items())


def _place(indicator: Indicator) -> str:
    if indicator.gear:
        return _capital(named("gear", indicator.gear))
    if indicator.bearing:
        return _capital(named("bearing", indicator.bearing))
    return _capital(named("shaft", indicator.shaft)) or "Channels as a whole"


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:] if text.startswith(("gear ", "bearing ", "shaft ")) else text


def _table(title: str, items: list[Compared]) -> IndicatorTable:
    channels = tuple(dict.fromkeys(item.channel for item, _ in items))
    rows: dict[Key, dict[str, Compared]] = {}
    for item, change in items:
        rows.setdefault((item.name, item.unit, item.computed_on, item.band), {})[item.channel] = item, change
    return IndicatorTable(title, channels, tuple(_row(key, row, channels) for key, row in rows.items()))


def _row(key: Key, row: dict[str, Compared], channels: tuple[str, ...]) -> IndicatorRow:
    values = tuple(readable(row[channel][0].value) if channel in row else "" for channel in channels)
    references = tuple(_reference_text(row[channel][1]) if channel in row else "" for channel in channels)
    notes: dict[str, list[str]] = {}
    for channel, (item, _) in row.items():
        if item.note:
            notes.setdefault(item.note, []).append(channel)
    texts = [note if len(named) == len(row) else f"{', '.join(named)}: {note}" for note, named in notes.items()]
    name, unit, computed_on, band = key
    return IndicatorRow(name, unit_text(unit), computed_on, band, values, "; ".join(texts), references)


def _reference_text(change: Change | None) -> str:
    if change is None:
        return ""
    text = f"was {readable(change.reference_value)}"
    if change.change_db is None:
        return text
    sign = "+" if change.change_db >= 0 else "−"
    return f"{text}, {sign}{abs(change.change_db):.1f} dB"
