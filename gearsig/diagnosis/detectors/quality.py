"""What is wrong with the recording itself."""

from __future__ import annotations

from gearsig.diagnosis.types import Finding, Kind, Where
from gearsig.recording.types import Recording


def detect_data_problems(recording: Recording) -> tuple[list[Finding], frozenset[str]]:
    """Return findings about the data, and the names of dead channels, which are not analysed further."""
    from gearsig.recording.quality import find_problems

    problems = find_problems(recording)
    findings = [
        Finding(
            f"channel-{p.kind}",
            Kind.DATA_PROBLEM,
            f"Channel {p.channel} is {p.kind}.",
            Where((p.channel,)),
            confidence=0.95,
            confidence_basis="direct inspection of the samples",
            evidence=(p.evidence,),
            surer=p.remedy,
        )
        for p in problems
    ]
    findings += [
        Finding("reader-note", Kind.NOTICE, text, confidence_basis="stated by the reader of the file")
        for text in recording.warnings
    ]
    return findings, frozenset(p.channel for p in problems if p.kind == "dead")
