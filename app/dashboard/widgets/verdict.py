"""The answer on top of the page, in words."""

from __future__ import annotations

from typing import Literal

import streamlit as st

from app.dashboard.as_typed import as_typed
from gearsig.diagnosis.types import Analysis, Kind, Outcome
from gearsig.report.sections import reference_text

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
