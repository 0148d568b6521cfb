"""Findings as cards, most important first."""

from __future__ import annotations

from collections.abc import Sequence

import streamlit as st

from app.dashboard.as_typed import as_typed
from app.dashboard.widgets.verdict import show_kind
from gearsig.diagnosis.types import Analysis, Finding, Kind
from gearsig.report.sections import FindingCard, finding_card

N_OPEN = 3
"""Cards shown at once; the rest is a click away."""


def show_findings(analysis: Analysis) -> None:
    """Show the first findings in full, the others folded up; notices come first only where nothing weighs more."""
    findings = [f for f in analysis.findings if f.kind is not Kind.INFORMATION]
    weighty = [f for f in findings if f.kind is not Kind.NOTICE] or findings
    for i, finding in enumerate(weighty[:N_OPEN]):
        _show_card(finding, with_evidence=i == 0)
    _show_folded("More findings", [f for f in findings if f not in weighty[:N_OPEN]])
    _show_folded("Remarks", [f for f in analysis.findings if f.kind is Kind.INFORMATION])


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
