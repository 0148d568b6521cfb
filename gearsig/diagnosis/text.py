"""An analysis as text for the terminal."""

from __future__ import annotations

from textwrap import fill

from gearsig.diagnosis.types import Analysis, Finding, Kind, Strength, Where
from gearsig.indicators.types import Indicator

WIDTH = 100
_SHORT = (Kind.NOTICE, Kind.INFORMATION)
"""Kinds that get their evidence only in the report."""


def analysis_text(analysis: Analysis, *, with_indicators: bool = False) -> str:
    """Return the verdict and the findings, most important first, in plain text."""
    recording = analysis.recording
    machine = analysis.rig.name if analysis.rig is not None and analysis.rig.name else "no rig file"
    size = f"{len(recording.channels)} channel(s), {recording.duration_s:.6g} s at {recording.sampling_rate_hz:.6g} Hz"
    lines = [
        f"{recording.provenance.source or 'recording'}: {size}, {machine}",
        "",
        fill(analysis.verdict, WIDTH),
        "",
    ]
    for number, finding in enumerate(analysis.findings, 1):
        lines += _finding_lines(number, finding)
    if with_indicators:
        lines += ["", *_indicator_lines(analysis.indicators)]
    return "\n".join(lines)


def where_text(where: Where) -> str:
    """Return the place of a finding in words, empty if it has none."""
    parts = []
    if where.gear:
        parts.append(f"gear {where.gear}")
    elif where.bearing:
        parts.append(f"bearing {where.bearing}")
    elif where.shaft:
        parts.append(f"shaft {where.shaft}")
    if where.order is not None:
        parts.append(f"order {where.order:.5g}" + (f" of {where.order_shaft}" if where.order_shaft else ""))
    if where.frequency_hz is not None:
        parts.append(f"{where.frequency_hz:.6g} Hz")
    if where.angle_deg is not None:
        parts.append(f"{where.angle_deg:.0f}°")
    if where.tooth is not None:
        parts.append(f"tooth {where.tooth}")
    if where.channels:
        parts.append("channel " + ", ".join(where.channels))
    return "; ".join(parts)


def strength_text(strength: Strength) -> str:
    """Return the strength and what it is measured against."""
    ratio = f" ({strength.ratio_db:+.1f} dB)" if strength.ratio_db is not None else ""
    return (
        f"{strength.value:.4g} {strength.unit} against {strength.floor:.4g}{ratio}; floor: {strength.floor_is}".replace(
            "  ", " "
        )
    )


def _finding_lines(number: int, finding: Finding) -> list[str]:
    lines = [_paragraph(f"{number:2}. [{finding.kind.value}] {finding.title}", "    ", first="")]
    place = where_text(finding.where)
    if finding.kind not in _SHORT and place:
        lines.append(_paragraph(f"where: {place}"))
    if finding.strength is not None:
        lines.append(_paragraph(f"how strong: {strength_text(finding.strength)}"))
    if finding.kind in _SHORT:
        return lines
    if finding.confidence_basis:
        lines.append(_paragraph(f"how sure: {100 * finding.confidence:.0f} %; {finding.confidence_basis}"))
    lines += [_paragraph(f"evidence: {text}") for text in finding.evidence]
    if finding.surer:
        lines.append(_paragraph(f"surer with: {finding.surer}"))
    return [*lines, ""]


def _paragraph(text: str, indent: str = "      ", *, first: str | None = None) -> str:
    return fill(text, WIDTH, initial_indent="    " if first is None else first, subsequent_indent=indent)


def _indicator_lines(indicators: tuple[Indicator, ...]) -> list[str]:
    lines = [f"{'indicator':<24} {'value':>12} {'unit':<10} {'channel':<12} {'of':<20} computed on"]
    for i in indicators:
        of = i.gear or i.bearing or i.shaft or i.band
        lines.append(f"{i.name:<24} {i.value:>12.5g} {i.unit:<10} {i.channel:<12} {of:<20} {i.computed_on}")
    return lines
