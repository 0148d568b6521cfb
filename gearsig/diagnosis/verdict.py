"""Order the findings and put the most important into one sentence."""

from __future__ import annotations

from collections.abc import Iterable

from gearsig.diagnosis.types import EXAMINED, HINDERING, Finding, Kind, Outcome, outcome_of

_RANK = {kind: i for i, kind in enumerate(Kind)}


def ranked(findings: Iterable[Finding]) -> tuple[Finding, ...]:
    """Return the findings, most important first: by kind, then by confidence, then by strength."""

    def key(finding: Finding) -> tuple[int, float, float]:
        ratio = finding.strength.ratio_db if finding.strength is not None else None
        return (_RANK[finding.kind], -finding.confidence, -(ratio or 0.0))

    return tuple(sorted(findings, key=key))


def verdict_of(findings: tuple[Finding, ...]) -> str:
    """Return the sentence a hurried reader takes away."""
    outcome = outcome_of(findings)
    gaps = [f for f in findings if f.code in HINDERING or f.kind is Kind.CANNOT_TELL]
    if outcome is Outcome.FAULT:
        return "Fault: " + _first_and_number([f for f in findings if f.kind is Kind.FAULT])
    if outcome is Outcome.SUSPICION:
        return "Suspicion: " + _first_and_number([f for f in findings if f.kind is Kind.SUSPICION])
    said = [f.title for f in findings if f.code in EXAMINED]
    if outcome is Outcome.CANNOT_TELL:
        why = " ".join(f.title for f in gaps[:2]) or "Nothing was examined that would show a fault."
        return " ".join(["Cannot tell.", why, *said, *_remedy(gaps)])
    return " ".join(["No fault shows.", *said, "Damage of many teeth would only show against an earlier recording."])


def _remedy(gaps: list[Finding]) -> list[str]:
    """Return what would settle the most important of the open questions, in one sentence."""
    surer = next((finding.surer for finding in gaps if finding.surer), "")
    return [f"Surer with: {surer.partition('. ')[0].rstrip('.')}."] if surer else []


def _first_and_number(findings: list[Finding]) -> str:
    more = len(findings) - 1
    sure = f" (at most {100 * findings[0].confidence:.0f} % sure)" if findings[0].kind is Kind.FAULT else ""
    first = findings[0].title + sure
    return first + (f", and {more} more." if more else "")
