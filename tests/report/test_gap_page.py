"""The page of a gap says everything for each outcome, escapes everything, and loads nothing."""

import re
from dataclasses import replace
from datetime import UTC, datetime
from math import inf, nan

import html5lib
import numpy as np
import pytest

from gearsig.gap import (
    ConditionFacts,
    Evidence,
    GapCause,
    GapOutcome,
    GapStep,
    Interval,
    OperatingCondition,
    lines_beyond,
)
from gearsig.report import (
    cause_rows,
    condition_advice,
    floors_text,
    gap_figures,
    gap_page_html,
    gap_text,
    n_conditions,
    write_gap_page,
)
from tests.gap.example_report import (
    all_reports,
    cannot_separate_report,
    effect_report,
    gearless_report,
    no_gap_report,
    shrinkage,
)

EVIL = "<script>alert(1)</script>"
QUOTES = "\"rig\" onload='x' & <b>"
REPORTS = all_reports()
DATE = datetime(2026, 3, 4, 5, 6, tzinfo=UTC)


def without_curves(report):
    """Drawing takes long; what is not of the figures needs none."""
    return replace(report, spectra=(), angles=(), averages=(), steps=())


def parsed(html):
    """Return the page's tree; strict: any fault of the markup raises."""
    return html5lib.HTMLParser(strict=True, tree=html5lib.getTreeBuilder("etree"), namespaceHTMLElements=False).parse(
        html
    )


def text_of(html):
    tree = parsed(html)
    for style in tree.iter("style"):
        style.text = ""
    return " ".join(" ".join(tree.itertext()).split())


@pytest.fixture(scope="module")
def pages():
    return {outcome: gap_page_html(report, command="gearsig gap", date=DATE) for outcome, report in REPORTS.items()}


@pytest.mark.parametrize("outcome", list(REPORTS))
def test_the_four_answers_stand_on_top(pages, outcome):
    text = text_of(pages[outcome])
    report = REPORTS[outcome]
    for line in report.verdict:
        answer = line.partition(": ")[2]
        place = text.find(answer[:1].upper() + answer[1:])
        assert 0 <= place < 900, answer
    for cause in report.causes:
        assert cause.title in text
    for notice in report.notes:
        assert notice in text


def test_everything_about_an_effect_is_said(pages):
    text = text_of(pages["effect"])
    for wanted in (
        "A burst once per revolution at tooth 21 of the input shaft",
        "+14.2 dB · 8.7 × structural floor · 61 × repeatability floor",
        "tooth 21 of the driver, 2.3 mm (1.9 to 2.8)",
        "It removes 72 % (64 % to 79 %) of what exceeds the floor, checked on another operating condition.",
        "In a wrong place (placebo) it removes at most 6 %.",
        "kurtosis of the input shaft's residual average ✓ speaks for it +11.8 +12.4 1.1",
        "level of the mesh harmonics ✗ speaks against it",
        "centroid of the spectrum ↗ further than predicted +2.0 +7.0 1.3",
        "+ crack in a tooth root 3.9 3.2 to 4.7 −4.0",
        "900 rpm and 120 N·m crack in a tooth root / spall on a tooth flank 5.4 1.6",
        "condition_2.h5 1998.7 60 199.9 6 20000",
        "healthy_1.h5, healthy_2.h5",
        "14 µm (6 to 25)",
        "2026-03-04 05:06 UTC",
        "twin.toml",
    ):
        assert wanted in text, wanted


def test_what_cannot_be_told_apart_is_said_with_what_would(pages):
    text = text_of(pages["cannot separate"])
    assert "cannot tell crack in a tooth root (48 %) and spall on a tooth flank (41 %) apart" in text
    assert "One operating condition:" in text
    assert "5.4 structural floors apart, against 1.6 now" in text
    assert "twin.toml" not in text


def test_no_gap_claims_nothing(pages):
    text = text_of(pages["no gap"])
    assert "No place stands out of the floor" in text
    assert "What to record next" not in text
    assert "speaks for it" not in text


def test_only_three_causes_have_their_evidence_shown():
    evidence = (Evidence("some feature", 1.0, 1.0, 1.0, speaks_for=True),)
    many = tuple(
        GapCause(f"e{i}", "flank", f"effect {i}", "mm", 0.2, shrinkage=shrinkage(0.5, 0.4, 0.6), evidence=evidence)
        for i in range(5)
    )
    assert gap_page_html(replace(without_curves(effect_report()), causes=many)).count("some feature") == 3


@pytest.mark.parametrize("outcome", list(REPORTS))
def test_pages_load_nothing(pages, outcome):
    html = pages[outcome]
    tags = {element.tag for element in parsed(html).iter()}
    assert not tags & {"script", "link", "iframe", "object", "embed", "base", "form"}
    for element in parsed(html).iter():
        assert element.get("src", "data:").startswith("data:")
        assert element.get("href") is None
        assert not any(str(name).startswith("on") for name in element.keys())  # noqa: SIM118 - an element is no dict
    assert not re.search(r"(?i)https?:|url\(|@import|//[a-z]", re.sub(r'"data:[^"]+"', '""', html))
    assert len(html) < 3_000_000


def evil_report(text):
    """Return a report whose every text is `text`."""
    report = effect_report(rig=text, simulator=text)
    causes = tuple(
        replace(c, name=f"{text}{i}", title=text, group=text, unit=text, place=text,
                shrinkage=c.shrinkage and replace(c.shrinkage, held_out=text),
                evidence=tuple(replace(e, feature=text) for e in c.evidence))
        for i, c in enumerate(report.causes)
    )  # fmt: skip
    return replace(
        report,
        outcome=GapOutcome.CANNOT_SEPARATE,
        inseparable=(causes[0].name, causes[1].name),
        causes=causes,
        places=tuple(replace(p, title=text, shaft=text, channel=text) for p in report.places),
        groups={text: 0.5},
        conditions=(ConditionFacts(text, OperatingCondition(1500.0, 60.0), 1.0, 1.0, 1.0),),
        references=(text,),
        steps=tuple(GapStep(text, step.remaining) for step in report.steps),
        next_recordings=tuple(replace(n, text=text, separates=(text, text)) for n in report.next_recordings),
        spectra=tuple(replace(s, label=text, unit=text) for s in report.spectra),
        angles=tuple(replace(a, shaft=text, unit=text) for a in report.angles),
        notes=(text,),
    )


@pytest.mark.slow
@pytest.mark.parametrize("text", [EVIL, QUOTES, "{{ 7 * 7 }}", "$\\frac{1}$ \x07"])
def test_texts_from_files_are_never_markup(text):
    report = evil_report(text)
    html = gap_page_html(report if "$" in text else without_curves(report), command=text)
    tree = html5lib.parse(html, namespaceHTMLElements=False)
    assert "<script" not in html
    assert not {element.tag for element in tree.iter()} & {"script", "b" if text == QUOTES else "script"}
    assert not any(str(name).startswith("on") for element in tree.iter() for name in element.keys())  # noqa: SIM118
    if text == "{{ 7 * 7 }}":
        assert text in html


@pytest.mark.slow
def test_very_long_names_do_not_blow_the_page_up():
    html = gap_page_html(evil_report("x" * 20_000))
    parsed(html)
    assert len(html) < 6_000_000


@pytest.mark.parametrize("bad", [nan, inf, -inf])
def test_what_is_not_finite_is_a_dash(bad):
    report = effect_report()
    strange = Interval(bad, bad, bad)
    cause = replace(report.causes[0], severity=strange, shrinkage=replace(shrinkage(bad, bad, bad), slope=bad),
                    evidence=(Evidence("feature", bad, bad, bad, speaks_for=False),), probability=bad)  # fmt: skip
    place = replace(report.places[0], change_db=bad, share=bad, structural=bad, repeatability=bad, angle_deg=bad)
    spectra = (replace(report.spectra[0], measured=np.full_like(report.spectra[0].measured, bad)),)
    angles = tuple(replace(a, measured=np.full_like(a.measured, bad)) for a in report.angles)
    html = gap_page_html(
        replace(report, size=strange, causes=(cause,), places=(place,), steps=(GapStep("s", strange),),
                groups={"flank": bad}, spectra=spectra, angles=angles, averages=())
    )  # fmt: skip
    body = html[html.index("<h2>Where") :]
    assert not re.search(r"\b(nan|inf)\b", re.sub(r'"data:[^"]+"', "", body))
    assert "width: 0.0%" in body


def test_the_page_appears_whole(tmp_path):
    path = write_gap_page(without_curves(effect_report()), tmp_path / "new" / "gap.html")
    assert path.read_text(encoding="utf-8").rstrip().endswith("</html>")
    assert [p.name for p in path.parent.iterdir()] == ["gap.html"]


def test_recordings_of_one_operating_point_are_one_condition():
    report = effect_report()
    assert n_conditions(report) == 2
    first = report.conditions[0]
    near = replace(first, name="again", point=OperatingCondition(1.01 * first.point.speed_rpm, first.point.torque_nm))
    loaded = replace(first, name="loaded", point=OperatingCondition(first.point.speed_rpm, 2 * first.point.torque_nm))
    assert n_conditions(replace(report, conditions=(first, near))) == 1
    assert n_conditions(replace(report, conditions=(first, near, loaded))) == 2


def test_advice_for_one_condition_only():
    assert condition_advice(effect_report()) == ""
    assert len(gap_text(effect_report()).splitlines()) == 4
    advice = condition_advice(cannot_separate_report())
    assert advice.startswith("One operating condition: ")
    assert "900 rpm and 120 N·m" in advice
    one = replace(no_gap_report(), conditions=no_gap_report().conditions[:1])
    assert "was not checked" in condition_advice(one)


def test_what_takes_nothing_away_is_not_said_to_take_a_negative_part():
    report = effect_report()
    worse = replace(
        report.causes[0], shrinkage=replace(report.causes[0].shrinkage, shrink=Interval(-1, -1, -1), placebo=-1.0)
    )
    statements = cause_rows(replace(report, causes=(worse, *report.causes[1:])))[0].statements
    assert "It removes nothing: with it the gap grows, checked on another operating condition." in statements
    assert "In a wrong place (placebo) it removes nothing." in statements


def test_it_says_what_is_compared_with():
    with_reference, without = effect_report(), cannot_separate_report()
    assert "healthy_1.h5" in floors_text(with_reference)
    assert "from one recording to another" in floors_text(with_reference)
    assert "what the simulation of the healthy machine predicts" in floors_text(without)
    assert floors_text(gearless_report()) == ""
    first, *others = with_reference.conditions
    partly = replace(with_reference, conditions=(replace(first, reference="healthy_1.h5"), *others))
    assert (
        f"Without a reference at its operating point, with the simulated prediction: {others[0].name}"
        in floors_text(partly)
    )


def captions(report):
    return [one.look for one in gap_figures(report)]


def test_rings_are_of_the_shafts_that_the_gap_names():
    report = effect_report()
    drawn = [
        [f.data.shaft for f in gap_figures(replace(report, places=places), curves=False) if f.is_small]
        for places in ((replace(report.places[0], shaft="input"),), (replace(report.places[0], shaft=""),), ())
    ]
    assert drawn == [["input"], ["input", "output"], ["input", "output"]]


def test_recording_and_reference_are_drawn_where_there_is_one(pages):
    text = text_of(pages["effect"])
    assert "the change of each line since the reference" in text
    assert text.count("One mean revolution of shaft") == 2
    assert text.count("No line is marked: with a reference, only what has changed since it is scored.") == 2
    without = text_of(pages["cannot separate"])
    assert "each line since the reference" not in without
    assert "only what has changed since it is scored" not in without


def test_no_line_is_marked_where_the_whole_gap_is_within_a_floor():
    report = cannot_separate_report()
    n, n_all = lines_beyond(report.spectra[0])
    assert n > 0
    assert any(f"Orange: {n} of {n_all} lines, which exceed" in text for text in captions(report))
    small = replace(report, outcome=GapOutcome.UNDECIDED, size=Interval(0.8, 0.7, 0.9))
    assert not small.is_beyond
    (first, *_) = captions(small)
    assert f"so that no line is marked. {n} of {n_all} lines alone exceed it" in first
    assert replace(small, outcome=GapOutcome.EFFECT).is_beyond
    assert gearless_report().is_beyond


def test_warnings_stand_right_under_the_verdict(pages):
    doubt = "now: the teeth <do not> fit."
    report = replace(without_curves(effect_report()), warnings=(doubt,))
    text = text_of(gap_page_html(report))
    last = report.verdict[-1].partition(": ")[2]
    assert text.index(last[1:]) < text.index(f"Check first {doubt}") < text.index(report.notes[0])
    assert gap_text(report).splitlines()[4] == f"Check first: {doubt}"
    assert "Check first" not in text_of(pages["effect"])
