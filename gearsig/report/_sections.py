"""The texts and tables of a page: findings, machine and recording, indicators, provenance."""

from __future__ import annotations

import platform
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from importlib.metadata import version
from textwrap import fill

import numpy as np

from gearsig import __version__
from gearsig.angle import ShaftAngle
from gearsig.checks import instance_of
from gearsig.diagnosis import (
    CHANGED,
    SURER_WITH,
    WHAT_WOULD_HELP,
    Analysis,
    CannotTell,
    Finding,
    IndicatorChange,
    Kind,
    LevelChange,
    LongAnalysis,
    Outcome,
    Strength,
    Where,
    changes,
)
from gearsig.formatting import counted, named, percent, readable, signed, unit_text, with_minus
from gearsig.indicators import Indicator
from gearsig.report._files import date_text

Rows = tuple[tuple[str, str], ...]


@dataclass(frozen=True)
class FindingCard:
    """A finding, as shown on the page."""

    kind: str
    css_class: str
    title: str
    where: tuple[str, ...]
    strength: str
    floor_percent: float | None
    confidence_percent: int | None
    sure_of: str
    confidence_basis: str
    evidence: tuple[str, ...]
    surer: str
    code: str


def finding_card(finding: Finding) -> FindingCard:
    """Return a finding as texts."""
    return FindingCard(
        finding.kind.value,
        css_class(finding.kind),
        finding.title,
        where_texts(finding.where),
        strength_text(finding.strength),
        _floor_percent(finding.strength),
        round(100 * finding.confidence) if is_confidence_stated(finding) else None,
        sure_of(finding),
        sureness_text(finding),
        finding.evidence,
        finding.surer,
        finding.code,
    )


def finding_cards(findings: Sequence[Finding]) -> tuple[FindingCard, ...]:
    """Return findings as texts; a remedy common to several is given for the first only."""
    stated: set[str] = set()
    cards = []
    for finding in findings:
        card = finding_card(finding)
        cards.append(replace(card, surer="") if card.surer in stated else card)
        stated.add(card.surer)
    return tuple(cards)


def is_confidence_stated(finding: Finding) -> bool:
    """Whether a finding has a confidence, unlike a plain statement."""
    return finding.is_claim or finding.confidence < 1.0


def sureness_text(finding: Finding) -> str:
    """Return the maximum confidence of a finding, and its basis."""
    basis = finding.confidence_basis
    if not basis or not is_confidence_stated(finding):
        return basis
    return f"at most {percent(finding.confidence)}: {basis}"


def sure_of(finding: Finding) -> str:
    """Return what a claim's confidence refers to if that need not be a fault; empty if it names its cause."""
    return {"non-synchronous-impacts": "impacts", CHANGED: "a change"}.get(finding.code, "")


def css_class(kind: Kind | Outcome) -> str:
    """Return the CSS class of a kind or an outcome: its value with spaces replaced."""
    return str(kind.value).replace(" ", "-")


def where_texts(where: Where) -> tuple[str, ...]:
    """Return the parts of a finding's place, one text each."""
    texts = [
        ("channel " if len(where.channels) == 1 else "channels ") + ", ".join(where.channels) if where.channels else "",
        gear_text(where.gear) if where.gear else named("shaft", where.shaft),
        named("bearing", where.bearing),
        _tooth_text(where),
        _order_text(where),
        f"{readable(where.frequency_hz, 6)} Hz" if where.frequency_hz is not None else "",
        f"{readable(where.time_s[0])} to {readable(where.time_s[1])} s" if where.time_s is not None else "",
    ]
    return tuple(text for text in texts if text)


def gear_text(gear: str) -> str:
    """Return the name of a gear (a pair and a shaft), or of a pair of gears."""
    return named("gear" if "/" in gear else "gear pair", gear)


def _tooth_text(where: Where) -> str:
    angle = f"{readable(where.angle_deg)}°" if where.angle_deg is not None else ""
    if where.tooth is None:
        return f"at {angle}" if angle else ""
    return f"tooth {where.tooth}" + (f" at {angle}" if angle else "")


def _order_text(where: Where) -> str:
    if where.order is None:
        return ""
    return f"order {readable(where.order, 5)}" + (f" of {where.order_shaft}" if where.order_shaft else "")


def strength_text(strength: Strength | None) -> str:
    """Return the size of a finding and its floor as text; only the unit of a channel may be unknown."""
    if strength is None:
        return ""
    unit = f" {unit_text(strength.unit)}" if strength.unit else ""
    unknown = "" if strength.unit else " (unit unknown)"
    floor = f"{strength.against} {readable(strength.floor)}{unit}".strip()
    text = f"{readable(strength.value)}{unit}{unknown} against {floor} ({strength.floor_is})"
    return text if strength.ratio_db is None else f"{text}: {readable(strength.ratio_db, 3)}\u00a0dB"


def _floor_percent(strength: Strength | None) -> float | None:
    """Return the position of the floor on a bar as long as the larger of value and floor; None without a bar."""
    if strength is None or strength.ratio_db is None or not 0 < strength.floor < strength.value < float("inf"):
        return None
    return round(100 * strength.floor / strength.value, 1)


@dataclass(frozen=True)
class ChangeRow:
    """A level that changed since the reference, as a bar; the channel is named if several have changed."""

    label: str
    change_db: float
    change: str
    repeatability: str
    percent: float


def change_rows(analysis: Analysis) -> tuple[ChangeRow, ...]:
    """Return the levels that changed most since the reference, largest first; bars are relative to the first."""
    changed = sorted((c for c in analysis.level_changes if c.is_change), key=lambda c: -abs(c.change_db))[:8]
    return tuple(
        ChangeRow(
            _label_of(c, changed),
            c.change_db,
            f"{signed(c.change_db)} dB",
            f"± {c.repeatability_db:.1f}",
            100 * abs(c.change_db) / abs(changed[0].change_db),
        )
        for c in changed
    )


def _label_of(change: LevelChange, among: Sequence[LevelChange]) -> str:
    """Return the name of a level, with its channel if there are several."""
    several = len({c.where.channels for c in among}) > 1
    return f"{change.label}, {', '.join(change.where.channels)}" if several else change.label


LONGEST_HEADLINE = 120


def headline_of(analysis: Analysis, *, with_remedy: bool = False) -> tuple[str, str]:
    """Return the headline of the verdict, and the rest of it, without the changes that `change_rows` lists.

    Parameters
    ----------
    analysis : Analysis
    with_remedy : bool
        Whether to include the remedy even if the first finding's card below contains it.
    """
    changed = next((f.title for f in analysis.findings if f.code == CHANGED), "")
    verdict = analysis.verdict.removeprefix(changed).strip() or analysis.verdict
    first = next((f.surer.lower() for f in analysis.findings if f.kind is not Kind.INFORMATION), "")
    for opener in (SURER_WITH, WHAT_WOULD_HELP):
        rest, _, remedy = verdict.partition(f" {opener}")
        if not with_remedy and remedy and first.startswith(remedy.removesuffix(".").lower()):
            verdict = rest
    return split_verdict(verdict)


def split_verdict(verdict: str) -> tuple[str, str]:
    """Split a long verdict after its first sentence with confidence; a short one is not split.

    Examples
    --------
    >>> split_verdict("No fault shows. " + "No damage shows on any tooth or bearing that could be examined. " * 2)[0]
    'No fault shows.'
    >>> split_verdict("Fault: Damage at a tooth (at most 86 % sure). " + "Its depth cannot be told. " * 5)[0]
    'Fault: Damage at a tooth (at most 86 % sure).'
    """
    if len(verdict) <= LONGEST_HEADLINE:
        return verdict, ""
    match = re.match(r"(.+?\.) +(.+)", verdict)
    return (match[1], match[2].strip()) if match else (verdict, "")


def speed_rows(angle: ShaftAngle | CannotTell) -> Rows:
    """Return facts on the speed, or why it is not known."""
    if isinstance(angle, CannotTell):
        rows = [("speed", f"not known: {angle.reason}"), ("what would give it", angle.remedy)]
        return tuple((name, text) for name, text in rows if text)
    low, high = angle.speed_range_rpm
    uncertainty = angle.relative_speed_uncertainty
    known = f" ± {readable(100 * uncertainty, 2)} %" if uncertainty < float("inf") else ""
    span = f", {readable(low, 6)} to {readable(high, 6)} rpm" if high > low else ""
    from gearsig.plot import METHODS

    return (
        (
            "speed" + (f" of {angle.shaft}" if angle.shaft else ""),
            f"mean {readable(angle.mean_speed_rpm, 6)} rpm{known}{span}",
        ),
        ("how it was found", METHODS[angle.method] + f"; quality {readable(angle.quality, 2)} of 1"),
        ("revolutions", readable(angle.n_revolutions, 5)),
        *(("note on the speed", with_minus(f"{note[:1].upper()}{note[1:]}")) for note in angle.notes),
    )


def provenance_rows(analysis: Analysis, command: str, date: datetime | None = None) -> Rows:
    """Return all facts needed to reproduce the page."""
    recording = analysis.recording
    origin = recording.provenance
    rows = [
        ("file", origin.source),
        ("SHA-256", origin.sha256),
        ("reader", origin.reader),
        ("history", "; ".join(origin.history)),
        ("sampling rate", f"{recording.sampling_rate_hz:.10g} Hz"),
        ("parameters", "; ".join(setting_text(name, value) for name, value in analysis.settings.items())),
        *made_rows(command, date),
    ]
    return tuple((name, text) for name, text in rows if text)


def made_rows(command: str, date: datetime | None = None) -> Rows:
    """Return with what versions and when a page was made (None: now)."""
    versions = ", ".join(f"{name} {version(name)}" for name in ("numpy", "scipy"))
    return (
        ("versions", f"gearsig {__version__}, {versions}, Python {platform.python_version()}"),
        ("date", date_text(date)),
        ("command", command),
    )


_SETTINGS = {
    "false_alarm_probability": "false alarms of one test {:.10g} %",
    "n_surrogates": "surrogates of the test of teeth {:.10g}",
    "minimum_revolutions": "at least {:.10g} revolutions",
    "bearing_slip": "slip of bearings up to {:.10g} %",
    "highest_modulation_order": "modulations up to {:.10g} cycles per revolution of the fastest shaft",
    "seed": "seed of the random numbers {:.10g}",
}
"""Names of an analysis's settings; fractions are given in percent."""
_SHARES = ("false_alarm_probability", "bearing_slip")


def setting_text(name: str, value: str | float | int | None) -> str:
    """Return a setting of an analysis in words.

    Examples
    --------
    >>> setting_text("bearing_slip", 0.02), setting_text("n_surrogates", 1000)
    ('slip of bearings up to 2 %', 'surrogates of the test of teeth 1000')
    """
    if name in _SETTINGS and isinstance(value, int | float):
        return _SETTINGS[name].format(100 * value if name in _SHARES else value)
    text = f"{value:.10g}" if isinstance(value, float) else "none" if value is None else str(value)
    return f"{name.removeprefix('n_').replace('_', ' ')} {text}"


def reference_text(reference: Analysis | None) -> str:
    """Return the name of the reference, and any suspicion in it; empty without one.

    The verdict reports a fault of the reference.
    """
    if reference is None:
        return ""
    text = f"Compared with {reference.recording.provenance.source or 'a reference'}"
    if reference.outcome is Outcome.SUSPICION:
        return f"{text}, which gives a suspicion itself: {reference.verdict}"
    return f"{text}."


def truth_rows(truth: Mapping[str, object] | None) -> Rows:
    """Return the simulator's input, for simulated recordings."""
    return tuple((name, str(value)[:200]) for name, value in (truth or {}).items())


Key = tuple[str, str, str, str]
Compared = tuple[Indicator, IndicatorChange | None]


def indicator_tables(
    indicators: Sequence[Indicator], then: Sequence[IndicatorChange | None]
) -> list[dict[str, object]]:
    """Return a table of indicators for each gear, bearing and shaft, and for the channels as a whole.

    Each row compares channels with each other and with the reference.
    """
    places: dict[str, list[Compared]] = {}
    for indicator, change in zip(indicators, then, strict=True):
        places.setdefault(_place(indicator), []).append((indicator, change))
    return [_table(title, items) for title, items in places.items()]


def _place(indicator: Indicator) -> str:
    if indicator.gear:
        return _capital(gear_text(indicator.gear))
    if indicator.bearing:
        return _capital(named("bearing", indicator.bearing))
    return _capital(named("shaft", indicator.shaft)) or "Channels as a whole"


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:] if text.startswith(("gear ", "bearing ", "shaft ")) else text


def _table(title: str, items: list[Compared]) -> dict[str, object]:
    channels = tuple(dict.fromkeys(item.channel for item, _ in items))
    rows: dict[Key, dict[str, Compared]] = {}
    for item, change in items:
        rows.setdefault((item.name, item.unit, item.computed_on, item.band), {})[item.channel] = item, change
    return {"title": title, "channels": channels, "rows": [_row(key, row, channels) for key, row in rows.items()]}


def _row(key: Key, row: dict[str, Compared], channels: tuple[str, ...]) -> dict[str, object]:
    cells = [
        (readable(row[channel][0].value), _reference_text(row[channel][1])) if channel in row else ("", "")
        for channel in channels
    ]
    notes: dict[str, list[str]] = {}
    for channel, (item, _) in row.items():
        if item.note:
            notes.setdefault(item.note, []).append(channel)
    texts = [note if len(named) == len(row) else f"{', '.join(named)}: {note}" for note, named in notes.items()]
    name, unit, computed_on, band = key
    about = {"name": name, "unit": unit_text(unit), "computed_on": computed_on, "band": band, "note": "; ".join(texts)}
    return {**about, "cells": cells}


def _reference_text(change: IndicatorChange | None) -> str:
    if change is None:
        return ""
    text = f"was {readable(change.reference_value)}"
    if change.change_db is None:
        return text
    return f"{text}, {signed(change.change_db)} dB"


WIDTH = 100
_SHORT = (Kind.NOTICE, Kind.INFORMATION)
"""Kinds whose evidence is shown only in the report."""


def analysis_text(analysis: Analysis, *, with_indicators: bool = False) -> str:
    """Return the verdict and the findings, most important first, in plain text."""
    instance_of(analysis, Analysis, "analysis", remedy="gearsig.analyze(recording) makes one")
    recording = analysis.recording
    machine = (analysis.rig.name or "rig without a name") if analysis.rig is not None else "no rig file"
    n_channels = counted(len(recording.channels), "channel")
    size = f"{n_channels}, {recording.duration_s:.6g} s at {recording.sampling_rate_hz:.6g} Hz"
    lines = [
        f"{recording.name}: {size}, {machine}",
        *([_paragraph(compared, "", first="")] if (compared := reference_text(analysis.reference)) else []),
        "",
        fill(analysis.verdict, WIDTH),
        "",
    ]
    stated: set[str] = set()
    for number, finding in enumerate(analysis.findings, 1):
        lines += _finding_lines(number, finding, says_surer=finding.surer not in stated)
        stated.add(finding.surer)
    if with_indicators:
        lines += ["", *_indicator_lines(analysis)]
    return "\n".join(lines)


def _finding_lines(number: int, finding: Finding, *, says_surer: bool) -> list[str]:
    lines = [_paragraph(f"{number:2}. [{finding.kind.value}] {finding.title}", "    ", first="")]
    place = "; ".join(where_texts(finding.where))
    if finding.kind not in _SHORT and place:
        lines.append(_paragraph(f"where: {place}"))
    if finding.strength is not None:
        lines.append(_paragraph(f"how strong: {strength_text(finding.strength)}"))
    if finding.kind in _SHORT:
        # The source of the speed, and any repairs, get a separate line.
        return lines + [_paragraph(text) for text in finding.evidence if finding.code == "speed"]
    if finding.confidence_basis:
        lines.append(_paragraph(f"how sure: {sureness_text(finding)}"))
    lines += [_paragraph(f"evidence: {text}") for text in finding.evidence]
    if finding.surer and says_surer:
        lines.append(_paragraph(f"more certain with: {finding.surer}"))
    return [*lines, ""]


def _paragraph(text: str, indent: str = "      ", *, first: str | None = None) -> str:
    return fill(text, WIDTH, initial_indent="    " if first is None else first, subsequent_indent=indent)


def _indicator_lines(analysis: Analysis) -> list[str]:
    compared = analysis.reference is not None
    more = f" {'reference':>12} {'dB':>6}" if compared else ""
    lines = [f"{'indicator':<24} {'value':>12}{more} {'unit':<10} {'channel':<12} {'of':<20} computed on"]
    for i, change in zip(analysis.indicators, changes(analysis), strict=True):
        of = i.gear or i.bearing or i.shaft or i.band
        more = f" {_change_text(change):<19}" if compared else ""
        lines.append(f"{i.name:<24} {i.value:>12.5g}{more} {i.unit:<10} {i.channel:<12} {of:<20} {i.computed_on}")
    return lines


def _change_text(change: IndicatorChange | None) -> str:
    if change is None:
        return ""
    return f"{change.reference_value:>12.5g} " + (f"{change.change_db:>+6.1f}" if change.change_db is not None else "")


def long_analysis_text(analysis: LongAnalysis, *, with_indicators: bool = False) -> str:
    """Return the verdict, the levels over time, and the analysis of each part as plain text."""
    overview = analysis.overview
    lines = [analysis.verdict, "", f"{analysis.name}: {analysis.duration_s:.5g} s, in intervals of a second:"]
    for i, (name, unit) in enumerate(zip(overview.channel_names, overview.units, strict=True)):
        low, usual, high = np.percentile(overview.rms[i], (0, 50, 100))
        last = int(np.argmax(overview.rms[i]))
        lines.append(
            f"  {name}: rms {low:.4g} to {high:.4g} {unit}, usually {usual:.4g}; "
            f"highest at {overview.time_s[last]:.4g} s; kurtosis "
            f"{overview.kurtosis[i].min():.3g} to {overview.kurtosis[i].max():.3g}"
        )
    for part in analysis.parts:
        lines += ["", f"From {part.start_s:.5g} to {part.end_s:.5g} s, {part.reason}:", ""]
        lines.append(analysis_text(part.analysis, with_indicators=with_indicators))
    return "\n".join(lines)
