"""Order the findings and put the most important into one sentence."""

from __future__ import annotations

from collections.abc import Iterable

from gearsig.diagnosis._doubts import said_first
from gearsig.diagnosis._lines import SPEED_UNKNOWN
from gearsig.diagnosis._overall import VIBRATION_ZONE
from gearsig.diagnosis._sampling_rate import SAMPLING_RATE
from gearsig.diagnosis._types import (
    CHANGED,
    EXAMINED,
    HINDERING,
    REFERENCE_UNFIT,
    UNCHANGED,
    Finding,
    Kind,
    Outcome,
    Where,
    outcome_of,
)
from gearsig.formatting import percent, sentence
from gearsig.recording import Recording

DEPTH_UNKNOWN = "crack-depth-unknown"
"""Code of the finding that a given reference did not tell the depth of a crack."""

WITHOUT_REFERENCE = "Damage of many teeth would only show against an earlier recording."

NO_FAULT = "No fault shows."

SURER_WITH, WHAT_WOULD_HELP = "Surer with: ", "What would help: "
"""Open the last sentence of a verdict that cannot tell."""

_RANK = {kind: i for i, kind in enumerate(Kind)}


def ranked(findings: Iterable[Finding]) -> tuple[Finding, ...]:
    """Return the findings, most important first: what has changed, then by kind, by confidence, by strength."""

    def key(finding: Finding) -> tuple[bool, int, float, float]:
        ratio = finding.strength.ratio_db if finding.strength is not None else None
        return (finding.code != CHANGED, _RANK[finding.kind], -finding.confidence, -(ratio or 0.0))

    return tuple(sorted(findings, key=key))


def verdict_of(findings: tuple[Finding, ...], *, has_reference: bool = False) -> str:
    """Return the sentences a hurried reader takes away: a doubtful rate, what has changed, what it comes to.

    Why a given reference did not help is always part of it.
    """
    doubt = said_first(findings, claims=outcome_of(findings) in (Outcome.FAULT, Outcome.SUSPICION))
    unfit = next((f.title for f in findings if f.code == REFERENCE_UNFIT), "")
    zone = next((f.title for f in findings if f.code == VIBRATION_ZONE and f.kind is Kind.NOTICE), "")
    changed, unchanged = (next((f.title for f in findings if f.code == code), "") for code in (CHANGED, UNCHANGED))
    others = tuple(f for f in findings if f.code not in (CHANGED, UNCHANGED))
    claims = [f for f in others if f.is_claim]
    # A change that no pattern explains is a suspicion by itself, and said already.
    if not claims and outcome_of(findings) is Outcome.SUSPICION:
        return " ".join(filter(None, (doubt, changed, zone)))  # with a change, the reference was compared
    said = _said(others, has_reference=has_reference)
    if zone and said.startswith(NO_FAULT):
        said = f"{zone} What is wrong does not show.{said.removeprefix(NO_FAULT)}"
        zone = ""
    return " ".join(filter(None, (doubt, changed, said, zone, unchanged, unfit)))


def _said(findings: tuple[Finding, ...], *, has_reference: bool) -> str:
    outcome = outcome_of(findings)
    unused = [f for f in findings if f.code == DEPTH_UNKNOWN]
    if outcome in (Outcome.FAULT, Outcome.SUSPICION):
        kind = Kind.FAULT if outcome is Outcome.FAULT else Kind.SUSPICION
        first, *more = (f for f in findings if f.kind is kind)
        claim = first.title.removesuffix(".")
        claim += f" (at most {percent(first.confidence)} sure)" if kind is Kind.FAULT else ""
        claim += f", and {len(more)} more" if more else ""
        return " ".join([f"{kind.value.capitalize()}: {claim}.", *(f.title for f in unused)])
    said = [f.title for f in findings if f.code in EXAMINED]
    if outcome is Outcome.NO_FAULT:
        has_teeth = any(f.code == "no-tooth-local-damage" for f in findings)
        return " ".join([NO_FAULT, *said, *([WITHOUT_REFERENCE] if has_teeth and not has_reference else [])])
    others = [f for f in findings if f not in unused and (f.code in HINDERING or f.kind is Kind.CANNOT_TELL)]
    gaps = [*unused, *others]
    nothing = "Nothing was examined that would show a fault."
    if any(f.code == SAMPLING_RATE for f in findings):
        nothing = "Nothing is said of parts before it is right: all orders would be wrong."
    elif has_reference:
        nothing = "What shows, the reference shows as well."
    why = " ".join(f.title for f in gaps[:2]) or nothing
    return " ".join(["Cannot tell.", why, *said, *_remedy(gaps)])


def _remedy(gaps: list[Finding]) -> list[str]:
    """Return what would settle the most important of the open questions, in one sentence."""
    first = next((finding for finding in gaps if finding.surer), None)
    if first is None:
        return []
    surer = first.surer.partition(". ")[0].rstrip(".")
    if first.code in (DEPTH_UNKNOWN, SPEED_UNKNOWN):  # say what to do, not what to have
        return [f"{WHAT_WOULD_HELP}{surer[:1].lower()}{surer[1:]}."]
    return [f"{SURER_WITH}{surer}."]


_TITLES = {
    "wrapped": "Channel {} has overflowed: its values wrap around.",
    "stepped": "The level of channel {} steps: gain, mounting or load changed.",
    "reversed": "Channel {} seems to run backwards in time.",
    "hum": "Mains hum rules channel {}.",
}


def detect_data_problems(recording: Recording) -> tuple[list[Finding], frozenset[str]]:
    """Return findings about the data, and the names of dead channels, which are not analysed further."""
    from gearsig.recording import find_problems

    problems = find_problems(recording)
    findings = [
        Finding(
            f"channel-{p.kind}",
            Kind.DATA_PROBLEM,
            _TITLES.get(p.kind, "Channel {} is {}.").format(p.channel, p.kind),
            Where((p.channel,), frequency_hz=p.frequency_hz),
            confidence=0.95,
            confidence_basis="direct inspection of the samples",
            evidence=(p.evidence,),
            surer=p.remedy,
        )
        for p in problems
    ]
    findings += [
        Finding("reader-note", Kind.NOTICE, sentence(text), confidence_basis="stated by the reader of the file")
        for text in recording.warnings
    ]
    return findings, frozenset(p.channel for p in problems if p.kind == "dead")
