"""An analysis as text for the terminal."""

from __future__ import annotations

from textwrap import fill

from gearsig.diagnosis.comparison import Change, changes
from gearsig.diagnosis.types import Analysis, Finding, Kind
from gearsig.report.sections import reference_text, strength_text, where_texts

WIDTH = 100
_SHORT = (Kind.NOTICE, Kind.INFORMATION)
"""Kinds that get their evidence only in the report."""


_CLAIMS = (Kind.FAULT, Kind.SUSPICION)


def analysis_text(analysis: Analysis, *, with_indicators: bool = False) -> str:
    """Return the verdict and the findings, most important first, in plain text."""
    recording = analysis.recording
    machine = (analysis.rig.name or "rig without a name") if analysis.rig is not None else "no rig file"
    size = f"{len(recording.channels)} channel(s), {recording.duration_s:.6g} s at {recording.sampling_rate_hz:.6g} Hz"
    lines = [
        f"{recording.provenance.source or 'recording'}: {size}, {machine}",
        *([_paragraph(compared, "", first="")] if (compared := reference_text(analysis.reference)) else []),
        "",
        fill(analysis.verdict, WIDTH),
        "",
    ]
    for number, finding in enumerate(analysis.findings, 1):
        lines += _finding_lines(number, finding)
    if with_indicators:
        lines += ["", *_indicator_lines(analysis)]
    return "\n".join(lines)


def _finding_lines(number: int, finding: Finding) -> list[str]:
    lines = [_paragraph(f"{number:2}. [{finding.kind.value}] {finding.title}", "    ", first="")]
    place = "; ".join(where_texts(finding.where))
    if finding.kind not in _SHORT and place:
        lines.append(_paragraph(f"where: {place}"))
    if finding.strength is not None:
        lines.append(_paragraph(f"how strong: {strength_text(finding.strength)}"))
    if finding.kind in _SHORT:
        # How the speed was found, and what was repaired on the way, is worth a line of its own.
        return lines + [_paragraph(text) for text in finding.evidence if finding.code == "speed"]
    if finding.confidence_basis:
        stated = finding.kind not in _CLAIMS or finding.confidence_basis.startswith("at most")
        sure = "" if stated else f"at most {100 * finding.confidence:.0f} %; "
        lines.append(_paragraph(f"how sure: {sure}{finding.confidence_basis}"))
    lines += [_paragraph(f"evidence: {text}") for text in finding.evidence]
    if finding.surer:
        lines.append(_paragraph(f"surer with: {finding.surer}"))
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


def _change_text(change: Change | None) -> str:
    if change is None:
        return ""
    return f"{change.reference_value:>12.5g} " + (f"{change.change_db:>+6.1f}" if change.change_db is not None else "")
