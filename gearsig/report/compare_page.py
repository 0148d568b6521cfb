"""A comparison's page: one self-contained HTML file."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime

from gearsig import __version__
from gearsig.compare.types import (
    ChannelComparison,
    Comparison,
    LevelPair,
    LineLevel,
    RecordFacts,
    Repeated,
    ShaftComparison,
)
from gearsig.compare.verdict import LEAST_REPEATED, missing_words
from gearsig.formatting import readable
from gearsig.plot.display import unit_text
from gearsig.plot.embed import Picture
from gearsig.report.compare_pictures import channel_pictures
from gearsig.report.compare_text import alignment_texts
from gearsig.report.render import render

Rows = tuple[tuple[str, str], ...]
N_SIDEBANDS_SHOWN = 40
MOST_ILLUSTRATED = 4
"""Channels with pictures: a page of more is too large to send."""


@dataclass(frozen=True)
class LevelRow:
    """A level as the page shows it."""

    label: str
    order: str
    recorded: str
    simulated: str
    difference: str
    scatter: str
    remark: str
    is_beyond: bool


@dataclass(frozen=True)
class ChannelSection:
    """One channel of the page."""

    title: str
    unit: str
    figures: Rows
    pictures: tuple[Picture, ...]
    main: tuple[LevelRow, ...]
    sidebands: tuple[LevelRow, ...]


def comparison_page(comparison: Comparison, *, command: str = "", date: datetime | None = None) -> str:
    """Return the page of a comparison: verdict, what was compared, and each channel with figures and tables.

    It is one file without scripts that loads nothing.

    Parameters
    ----------
    comparison : Comparison
    command : str
        The command that makes it again.
    date : datetime or None
        Of the page; None: now.
    """
    return render(
        "compare.html.j2",
        title=f"{comparison.simulated.source} beside {comparison.recorded.source}",
        machine_name=comparison.machine,
        verdict=comparison.verdict,
        findings=comparison.findings,
        notes=comparison.notes,
        simulated=_record_rows(comparison.simulated),
        recorded=_record_rows(comparison.recorded),
        alignment=tuple(alignment_texts(comparison)),
        channels=[_section(comparison, channel, i) for i, channel in enumerate(comparison.channels)],
        provenance=_provenance(comparison, command, date or datetime.now().astimezone()),
    )


def _section(comparison: Comparison, channel: ChannelComparison, i: int) -> ChannelSection:
    main = [line for line in (*channel.lines, *channel.other_lines) if line.kind != "sideband" and line.is_seen]
    sidebands = [line for line in channel.lines if line.kind == "sideband" and line.is_seen]
    sidebands.sort(key=lambda line: -abs(line.level.difference_db))
    return ChannelSection(
        channel.name,
        f"dB re 1 {unit_text(channel.unit)}, rms" if channel.unit else "dB, unit not known",
        channel_rows(channel),
        tuple(channel_pictures(comparison, channel)) if i < MOST_ILLUSTRATED else (),
        tuple(_line_row(line) for line in main),
        tuple(_line_row(line) for line in sidebands[:N_SIDEBANDS_SHOWN]),
    )


def channel_rows(channel: ChannelComparison) -> Rows:
    """Return the agreement figures of a channel as name and text."""
    rows = [("overall level, simulated less recorded", _difference(channel.overall))]
    for shaft in channel.shafts:
        name = f" of {shaft.shaft}" if shaft.shaft else ""
        frac = (
            f"complex {_repeated(shaft.agreement.complex_frac)} ({shaft.agreement.complex_by_chance:.3f} by chance), "
            f"magnitudes {_repeated(shaft.agreement.magnitude_frac)}; {shaft.agreement.n_lines} orders"
        )
        rows += [
            (
                f"correlation, average{name}",
                f"{_repeated(shaft.correlation)}; {_possible(shaft)}",
            ),
            (f"FRAC, average{name}", frac),
        ]
    locked = channel.locked
    rows.append(
        (
            "energy that repeats with the shafts' turns",
            f"recording {_percent(locked.recorded)}, simulation {_percent(locked.simulated)}",
        )
    )
    return tuple(rows)


def _possible(shaft: ShaftComparison) -> str:
    """Return the correlation that two such averages of one motion reach, or that it means nothing."""
    if shaft.best_correlation < LEAST_REPEATED:
        return "says nothing, as one record's halves do not repeat"
    return f"two such averages reach {shaft.best_correlation:.3f}"


def _line_row(line: LineLevel) -> LevelRow:
    level = line.level
    return LevelRow(
        line.label,
        readable(line.order, 6),
        _number(level.recorded_db),
        _number(level.simulated_db),
        _signed(level.difference_db),
        f"{2 * level.repeatability_db:.1f}",
        missing_words(line),
        level.is_beyond,
    )


def _record_rows(facts: RecordFacts) -> Rows:
    low, high = (readable(rpm, 6) for rpm in facts.speed_range_rpm)
    return (
        ("file", facts.source),
        ("length", f"{readable(facts.duration_s, 5)} s at {readable(facts.sampling_rate_hz, 7)} Hz"),
        ("speed", f"{readable(facts.mean_speed_rpm, 6)} rpm, {low} to {high} ({facts.speed_method})"),
        ("revolutions", readable(facts.n_revolutions, 4)),
        *(("remark", note) for note in facts.notes),
    )


def _provenance(comparison: Comparison, command: str, date: datetime) -> Rows:
    rows = (
        ("SHA-256, simulation", comparison.simulated.sha256),
        ("SHA-256, recording", comparison.recorded.sha256),
        ("version", f"gearsig {__version__}"),
        ("date", date.strftime("%Y-%m-%d %H:%M %Z").strip()),
        ("command", command),
    )
    return tuple((name, text) for name, text in rows if text)


def _difference(level: LevelPair) -> str:
    return f"{_signed(level.difference_db)} ± {2 * level.repeatability_db:.1f} dB"


def _repeated(figure: Repeated) -> str:
    return f"{_number(figure.value, 3)} ± {2 * figure.repeatability:.2g}"


def _percent(figure: Repeated) -> str:
    return f"{100 * figure.value:.1f} ± {200 * figure.repeatability:.1f} %"


def _number(value: float, n_decimals: int = 1) -> str:
    return f"{value:.{n_decimals}f}".replace("-", "−")


def _signed(value: float) -> str:
    return f"{value:+.1f}".replace("-", "−")
