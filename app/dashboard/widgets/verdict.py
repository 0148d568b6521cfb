"""The verdict at the top of the page: in words, with the picture it rests on."""

from __future__ import annotations

from dataclasses import replace
from html import escape
from typing import Literal

import streamlit as st

from app.dashboard import state
from app.dashboard.widgets.charts import show_lines
from app.dashboard.widgets.spectrum import offer_ring, show_ring, show_spectrum
from app.dashboard.widgets.texts import as_typed, in_page_text, one_line
from gearsig.diagnosis import BEARING_PARTS, CHANGED, Analysis, Finding, Kind, Outcome
from gearsig.formatting import counted, enumerated, readable
from gearsig.plot import marks_of
from gearsig.report import (
    FindingCard,
    bearing_cursors,
    change_rows,
    finding_card,
    headline_of,
    highest_order_of_interest,
    is_of_sidebands,
    level_panel,
    line_cursors,
    marked_positions,
    reference_text,
    sidebands_of,
    verdict_picture,
    zero_text,
)
from gearsig.spectra import LARGEST_SLIP

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


def show_verdict(analysis: Analysis) -> None:
    """Show the verdict beside the picture that it rests on; below, collapsed, all findings with their evidence."""
    with st.container(key="verdict"):
        words, picture = st.columns((6, 5), gap="medium")
        with words:
            _show_words(analysis)
        with picture:
            show_verdict_picture(analysis)
    findings = [f for f in analysis.findings if f.kind is not Kind.INFORMATION]
    if analysis.findings:
        with st.expander(f"Findings and their evidence ({len(analysis.findings)})", icon=":material/fact_check:"):
            for finding in (*findings, *(f for f in analysis.findings if f.kind is Kind.INFORMATION)):
                _show_card(finding)


def _show_words(analysis: Analysis) -> None:
    recording = analysis.recording
    rig = analysis.rig
    is_described = rig is not None and bool(rig.shafts or rig.pairs or rig.bearings)
    machine = rig.name if rig is not None else ""
    n = len(recording.channels)
    headline, rest = headline_of(analysis)
    facts = [
        f"**{as_typed(recording.provenance.source)}**",
        as_typed(machine) or ("unnamed machine" if is_described else "machine not described"),
        f"{counted(n, 'channel')}",
        as_typed(f"{recording.duration_s:.4g} s at {recording.sampling_rate_hz:.6g} Hz"),
    ]
    with st.container(key="verdict-head"):
        with st.container(horizontal=True, vertical_alignment="center"):
            show_kind(analysis.outcome)
            st.caption(" · ".join(facts), width="content")
        st.subheader(as_typed(in_page_text(headline)), anchor=False)
        if rest:
            st.caption(as_typed(in_page_text(rest)))
    with st.container(key="verdict-grounds"):
        _show_grounds(analysis)


def _show_grounds(analysis: Analysis) -> None:
    """Show what changed since the reference, and how strong and how sure the first finding is."""
    if analysis.reference is not None:
        _show_changes(analysis, analysis.reference)
    claims = [f for f in analysis.findings if f.is_claim and f.code != CHANGED]
    for finding in claims[:1] or [f for f in analysis.findings if f.kind is not Kind.INFORMATION][:1]:
        card = finding_card(finding)
        if card.title.rstrip(".") not in analysis.verdict:
            st.markdown(f"**{as_typed(card.title)}**")
        places = _places(card)
        with st.container(key="verdict-measures"):
            if places:
                st.caption(places)
            _show_measures(card)
        ratio_db = finding.strength.ratio_db if finding.strength is not None else None
        strong = f"**{readable(ratio_db, 3)} dB** over its floor" if ratio_db is not None else ""
        with st.container(key="verdict-brief"):  # the same in one or two lines, for a small window
            st.caption(" · ".join(filter(None, (places, strong, _sureness(card)))))


def _show_changes(analysis: Analysis, reference: Analysis) -> None:
    """Show the levels that changed most since the reference, largest first."""
    shown = change_rows(analysis)
    if not shown:
        st.caption(as_typed(reference_text(reference)))
        return
    st.markdown(f"**Changed since the reference** :gray[{as_typed(reference.recording.provenance.source)}]")
    rows = "".join(
        f'<tr><td>{escape(one_line(row.label))}</td><td class="bar"><i class="{"up" if row.change_db > 0 else "down"}" '
        f'style="width:{row.percent:.0f}%"></i></td><td>{row.change}</td><td>{row.repeatability}</td></tr>'
        for row in shown
    )
    st.html(f'<table class="changes">{rows}</table>')


def show_verdict_picture(analysis: Analysis) -> None:
    """Show what the verdict rests on: the ring of teeth, the bearing's family, the resonance, or the order spectrum."""
    picture = verdict_picture(analysis)
    if picture is None or picture.about == "motion":
        return
    channel, place = picture.channel, f"verdict {picture.about}"
    if picture.about == "tooth":
        teeth = analysis.teeth_on(picture.shaft)
        marks = marks_of(analysis.findings, picture.shaft, teeth)
        stand_out = f"{enumerated([mark.label for mark in marks])} {'stand' if len(marks) > 1 else 'stands'} out"
        words = f"Mean revolution of {picture.shaft}: {stand_out if marks else 'no tooth stands out'}"
        average = picture.average
        numbered = analysis.has_mark(picture.shaft)
        ring = show_ring(average, teeth, marks, words, state.view_key(place, analysis), numbered=numbered)
        with st.container(key="verdict-files"):
            offer_ring(ring, average, teeth, marks, numbered=numbered)
        if not numbered:
            st.caption(as_typed(zero_text(analysis, picture.shaft)))
        return
    if picture.about == "resonance":
        panel, marked_points = level_panel(analysis, channel)
        lines = [replace(line, colour=i) for i, line in enumerate(panel.lines)]
        panel = replace(panel, lines=lines)
        show_lines(panel, state.view_key(place, analysis), marked=marked_points, legend=True, height_px=260)
        if picture.finding is not None:
            st.markdown(f"**{as_typed(picture.finding.title)}**")
            st.caption("Circled: where an order crosses it.")
        return
    if picture.about == "bearing":
        spectrum = channel.envelope_spectrum
        cursors = bearing_cursors(analysis, spectrum) if spectrum is not None else ()
        code = picture.finding.code if picture.finding is not None else ""
        named = next((part for part, (words, _) in BEARING_PARTS.items() if words.replace(" ", "-") in code), "")
        bearing = picture.finding.where.bearing if picture.finding is not None else None
        # the verdict says which bearing, and of others with the same orders
        short = (replace(cursor, label=cursor.label.removesuffix(f" {bearing}")) for cursor in cursors)
        cursors = tuple(cursor for cursor in short if cursor.label.endswith(named))
    else:
        spectrum = channel.order_spectrum or channel.spectrum
        cursors = line_cursors(analysis, spectrum, n_sidebands=1)
    if spectrum is None:
        return
    where = picture.finding.where if picture.finding is not None else None
    sides = sidebands_of(analysis, spectrum, where) if where is not None and is_of_sidebands(where) else ()
    if sides:
        middle, reach = sum(sides) / 2.0, 4.5 * (sides[1] - sides[0]) / 2.0
        shown = max(middle - reach, 0.0), min(middle + reach, float(spectrum.positions[-1]))
        near = line_cursors(analysis, spectrum, n_sidebands=2)
        show_spectrum(analysis, spectrum, near, place, marked=sides, shown=shown, plain=True)
        return
    is_bearing = picture.about == "bearing"
    families = [c.position for c in cursors if is_bearing and c.kind == "bearing"]
    end = 1.08 * max(families) if families else highest_order_of_interest(analysis, spectrum)
    marked = marked_positions(analysis, spectrum, channel.channel, of_bearings=is_bearing)[:1]
    show_spectrum(
        analysis,
        spectrum,
        [cursor for cursor in cursors if not marked or _is_multiple(cursor.position, marked[0])] or cursors,
        place,
        marked=marked,
        shown=(0.0, min(end, float(spectrum.positions[-1]))),
        scale="Linear" if families else "Logarithmic",
        plain=True,
    )


def _is_multiple(position: float, fundamental: float) -> bool:
    """Whether a line is a multiple of a finding's order, within a bearing's slip."""
    return abs(position / (max(round(position / fundamental), 1) * fundamental) - 1.0) <= LARGEST_SLIP


def show_kind(kind: Kind | Outcome) -> None:
    """Show a kind of finding, or an outcome, as a badge."""
    st.badge(kind.value, icon=ICONS[kind], color=COLOURS[kind])


def _show_card(finding: Finding) -> None:
    card = finding_card(finding)
    with st.container(border=True):
        with st.container(horizontal=True, vertical_alignment="center"):
            show_kind(finding.kind)
            if sureness := _sureness(card):
                st.markdown(sureness, width="content")
            if card.where:
                st.caption(_places(card), width="content")
        st.markdown(f"**{as_typed(in_page_text(card.title))}**")
        _show_measures(card)
        if card.evidence:
            st.caption("\n".join(f"- {as_typed(in_page_text(sentence))}" for sentence in card.evidence))


def _sureness(card: FindingCard) -> str:
    of = f" of {card.sure_of}" if card.sure_of else ""
    return "" if card.confidence_percent is None else f"≤ **{card.confidence_percent} %** sure{of}"


def _places(card: FindingCard) -> str:
    return " · ".join(as_typed(text) for text in card.where)


def _show_measures(card: FindingCard) -> None:
    lines = [
        ("how strong", card.strength),
        ("how sure", card.confidence_basis),
        ("more certain with", card.surer),
    ]
    text = "  \n".join(f":small[:gray[{name}:] {as_typed(in_page_text(value))}]" for name, value in lines if value)
    if text:
        st.markdown(text)
