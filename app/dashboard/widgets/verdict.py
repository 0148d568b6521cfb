"""The answer on top of the page, in words."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import streamlit as st

from app.dashboard.theme import as_typed
from gearsig.diagnosis import Analysis, Finding, Kind, Outcome
from gearsig.recording import FORMAT_NAMES
from gearsig.report import FindingCard, finding_card, reference_text

Colour = Literal["red", "orange", "violet", "gray", "blue", "green"]
COLOURS: dict[Kind | Outcome, Colour] = {
    Kind.FAULT: "red",
    Kind.SUSPICION: "orange",
    Kind.DATA_PROBLEM: "violet",
    Kind.CANNOT_TELL: "gray",
    Kind.NOTICE: "blue",
    Kind.INFORMATION: "blue",
    Outcome.FAULT: "red",
    Outcome.SUSPICION: "orange",
    Outcome.CANNOT_TELL: "gray",
    Outcome.NO_FAULT: "green",
}
ICONS: dict[Kind | Outcome, str] = {
    Kind.FAULT: ":material/error:",
    Kind.SUSPICION: ":material/warning:",
    Kind.DATA_PROBLEM: ":material/database:",
    Kind.CANNOT_TELL: ":material/help:",
    Kind.NOTICE: ":material/info:",
    Kind.INFORMATION: ":material/info:",
    Outcome.FAULT: ":material/error:",
    Outcome.SUSPICION: ":material/warning:",
    Outcome.CANNOT_TELL: ":material/help:",
    Outcome.NO_FAULT: ":material/check_circle:",
}


LONGEST_HEADLINE = 120


def show_verdict(analysis: Analysis) -> None:
    """Show the verdict, the outcome in one word, and what was examined."""
    recording = analysis.recording
    machine = analysis.rig.name if analysis.rig is not None else ""
    n = len(recording.channels)
    headline, rest = headline_of(analysis.verdict)
    st.subheader(as_typed(headline), anchor=False)
    if rest:
        st.markdown(as_typed(rest))
    facts = [
        f"**{as_typed(recording.provenance.source)}**",
        as_typed(machine) or "machine not described",
        f"{n} channel{'s' if n != 1 else ''}",
        f"{recording.duration_s:.4g} s at {recording.sampling_rate_hz:.6g} Hz",
    ]
    with st.container(horizontal=True, vertical_alignment="center"):
        show_kind(analysis.outcome)
        st.markdown(" · ".join(facts), width="content")
    if analysis.reference is not None:
        st.caption(as_typed(reference_text(analysis.reference)))


def headline_of(verdict: str) -> tuple[str, str]:
    """Split a long verdict after its first sentence; a short one stays whole.

    Examples
    --------
    >>> headline_of("No fault shows. " + "No damage shows on any tooth or bearing that could be examined. " * 2)[0]
    'No fault shows.'
    """
    first, stop, rest = verdict.partition(". ")
    return (first + ".", rest.strip()) if stop and len(verdict) > LONGEST_HEADLINE else (verdict, "")


def show_kind(kind: Kind | Outcome) -> None:
    """Show a kind of finding, or an outcome, as a badge."""
    st.badge(kind.value, icon=ICONS[kind], color=COLOURS[kind])


# --------------------
# Findings as cards, most important first.
# --------------------


N_OPEN = 3
"""Cards shown at once; the rest is a click away."""


def show_findings(analysis: Analysis) -> None:
    """Show the first findings in full, the others folded up; notices come first only where nothing weighs more."""
    findings = [f for f in analysis.findings if f.kind is not Kind.INFORMATION]
    weighty = [f for f in findings if f.kind is not Kind.NOTICE] or findings
    for i, finding in enumerate(weighty[:N_OPEN]):
        _show_card(finding, with_evidence=i == 0)
    _show_folded("More findings", [f for f in findings if f not in weighty[:N_OPEN]])
    _show_folded("Further information", [f for f in analysis.findings if f.kind is Kind.INFORMATION])


def _show_folded(title: str, findings: Sequence[Finding]) -> None:
    if findings:
        with st.expander(f"{title} ({len(findings)})"):
            for finding in findings:
                _show_card(finding, with_evidence=True)


def _show_card(finding: Finding, *, with_evidence: bool = False) -> None:
    card = finding_card(finding)
    with st.container(border=True):
        kind, body = st.columns((1, 7))
        with kind:
            show_kind(finding.kind)
            if card.confidence_percent is not None:
                st.markdown(f"≤ **{card.confidence_percent} %** sure")
        with body:
            st.markdown(f"**{as_typed(card.title)}**")
            if card.where:
                st.caption(" · ".join(as_typed(text) for text in card.where))
            _show_measures(card)
            _show_evidence(card, folded=not with_evidence)


def _show_measures(card: FindingCard) -> None:
    lines = [
        ("how strong", card.strength),
        ("how sure", card.confidence_basis),
        ("surer with", card.surer),
    ]
    text = "  \n".join(f":gray[{name}:] {as_typed(value)}" for name, value in lines if value)
    if text:
        st.markdown(text)


def _show_evidence(card: FindingCard, *, folded: bool) -> None:
    text = "\n".join(f"- {as_typed(sentence)}" for sentence in card.evidence)
    if text and folded:
        with st.expander(f"Evidence ({len(card.evidence)})"):
            st.caption(text)
    elif text:
        st.caption(text)


# --------------------
# What to do while nothing is open.
# --------------------


TEXT = f"""
### Open a recording of your own

1. Drop the **recording** in the sidebar: {FORMAT_NAMES}.
2. Drop its **rig file**, or write one under *Rig*, which opens with the recording. Only what is known need be given:
   teeth add mesh orders, sidebands and tooth pictures; bearings add their orders; a speed source makes orders out of
   frequencies.
3. If the file does not state its **sampling rate** or the **speed**, give them under *Not in the file?*

No recording at hand? The *fault laboratory* makes one, with the faults you choose.

Files stay on this machine. They are read in a private folder that is removed at once.
"""


def show_welcome() -> None:
    """Say how a recording is opened."""
    st.markdown(TEXT)
