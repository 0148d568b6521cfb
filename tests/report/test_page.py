"""The page says everything, escapes everything, and loads nothing."""

import re
from dataclasses import replace
from datetime import UTC, datetime
from html.parser import HTMLParser
from importlib.resources import files

import numpy as np
import pytest

from gearsig.diagnosis import SURER_WITH, Finding, Kind, LevelChange, OrderLevel, Outcome, Strength, Where, analyze
from gearsig.indicators import Indicator
from gearsig.plot import svg_ring
from gearsig.recording import read_recording
from gearsig.report import (
    analysis_text,
    bearing_cursors,
    change_rows,
    finding_card,
    finding_cards,
    headline_of,
    level_panel,
    marked_positions,
    page_html,
    page_pdf,
    verdict_picture,
    write_page,
    zero_text,
)
from gearsig.rig import PulseTimes, read_rig

EVIL = "<script>alert(1)</script>"
QUOTES = "\"rig\" onload='x' & <b>"
VOID = {"meta", "img", "br", "hr", "link", "input"}


class Structure(HTMLParser):
    """Collect elements and check that every one is closed in its order."""

    def __init__(self):
        super().__init__(convert_charrefs=True)
        self.open, self.elements, self.text = [], [], []

    def handle_starttag(self, tag, attrs):
        self.elements.append((tag, dict(attrs)))
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if self.open and self.open[-1] != "style":
            self.text.append(data)


def parsed(html):
    structure = Structure()
    structure.feed(html)
    structure.close()
    assert structure.open == []
    return structure


def test_text_of_rings_can_be_read_on_a4(html):
    rings = [svg for svg in re.findall(r"<svg.*?</svg>", html, re.DOTALL) if 'viewBox="0 0 400 400"' in svg]
    assert rings
    smallest = min(float(size) for svg in rings for size in re.findall(r'<text[^>]*font-size="([\d.]+)"', svg))
    template = files("gearsig.report").joinpath("templates", "page.typ").read_text(encoding="utf-8")
    beside_mm = float(re.findall(r"columns: \(1fr, (\d+)mm\), gutter", template)[0])
    [(columns, gutter_mm)] = re.findall(r"columns: \(([1fr, ]+)\), gutter: (\d+)mm, \.\.group\.small", template)
    n = columns.count("1fr")
    for width_mm in (beside_mm, (210 - 2 * 16 - (n - 1) * float(gutter_mm)) / n):
        assert smallest * width_mm / 25.4 * 72 / 400 >= 7.0  # pt


@pytest.fixture(scope="module")
def html(gearbox):
    date = datetime(2025, 3, 4, 5, 6, tzinfo=UTC)
    return page_html(gearbox, command="gearsig report 'monday run.mat'", index="index.html", date=date)


def test_everything_is_said(gearbox, html):
    text = " ".join(" ".join(parsed(html).text).split())
    for wanted in (
        gearbox.verdict,
        *(finding.title for finding in gearbox.findings),
        *gearbox.findings[0].evidence,
        "0.94 m/s² against a floor of 0.11 m/s² (2 standard errors of the residual): 18.6 dB",
        "93 %: agreement of two channels and of both halves of the recording",
        "tooth 17 at 258.3°",
        "order 5.415 of input",
        "23 teeth on input drive 46 on output",
        "the copy that is all zeros was left out",
        "pinion bearing, vertical",
        "found in the vibration, no tachometer",
        "ab" * 32,
        "false alarms of one test 0.1 %; surrogates of the test of teeth 1000; at least 16 revolutions",
        "gearsig report 'monday run.mat'",
        "2025-03-04 05:06 UTC",
        "needs a healthy run",
    ):
        assert wanted in text, wanted


def test_settings_are_said_in_words(html):
    text = " ".join(parsed(html).text)
    assert not re.findall(r"\b[a-z]+_[a-z_]+\b", text)


def test_the_picture_of_impacts_without_a_bearing_is_their_envelope(gearbox):
    """Their evidence lies there, in the channel that the finding names; three of their harmonics are named."""
    where = Where(("a2",), order=3.21, order_shaft="input", frequency_hz=107.0, band_hz=(2000.0, 4000.0))
    impacts = Finding("non-synchronous-impacts", Kind.SUSPICION, "Impacts.", where, confidence=0.9)
    analysis = replace(gearbox, findings=(impacts,))
    shown = verdict_picture(analysis)
    assert (shown.about, shown.channel.channel, shown.finding) == ("bearing", "a2", impacts)
    spectrum = shown.channel.envelope_spectrum
    named = {c.label: c.position for c in bearing_cursors(analysis, spectrum) if "impacts" in c.label}
    assert named == {"impacts": 3.21, "2× impacts": pytest.approx(6.42), "3× impacts": pytest.approx(9.63)}
    assert marked_positions(analysis, spectrum, "a2", of_bearings=True) == (3.21,)
    assert marked_positions(analysis, shown.channel.order_spectrum, "a2") == ()
    html = page_html(analysis)
    verdict = html[html.index('aria-label="verdict"') : html.index("<h2>Findings")]
    assert "Envelope spectrum of a2" in verdict
    assert "3× impacts" in verdict


def test_the_picture_is_of_the_channel_that_the_first_finding_names(gearbox):
    where = Where(("a2",), shaft="input", order=1.0, order_shaft="input", frequency_hz=33.3)
    shown = verdict_picture(replace(gearbox, findings=(Finding("line", Kind.SUSPICION, "A line.", where),)))
    assert (shown.about, shown.channel.channel) == ("lines", "a2")


def test_the_ring_of_a_crack_is_its_change_since_the_reference():
    """In the mean revolution itself the teeth's own pattern hides it."""
    rig = read_rig("sample_data/root_crack_2mm.toml")
    now, healthy = (read_recording(f"sample_data/root_crack_{depth}mm.h5", rig=rig) for depth in (2, 0))
    shown = verdict_picture(analyze(now, reference=healthy))
    assert (shown.about, shown.average.kind) == ("tooth", "change")
    largest = np.abs(shown.average.values).argmax() / len(shown.average.values)
    assert abs(largest - (shown.finding.where.tooth - 0.5) / 55) < 1.5 / 55
    others = np.abs(shown.average.values)
    assert others.max() > 5.0 * np.sqrt(np.mean(others**2))


def test_a_resonance_is_marked_where_each_order_crosses_it(gearbox):
    speeds = np.linspace(600.0, 3000.0, 200)
    levels = tuple(OrderLevel(f"{k}× mesh", 29.0 * k, speeds, speeds * k, "m/s^2", 0.5) for k in (1, 2))
    channel = replace(gearbox.channels[0], order_levels=levels)
    found = Finding("resonance", Kind.NOTICE, "A resonance.", Where((channel.channel,), frequency_hz=1160.0))
    panel, marked = level_panel(replace(gearbox, findings=(found,)), channel)
    assert marked == [pytest.approx((2400.0, 2400.0)), pytest.approx((1200.0, 2400.0))]
    assert panel.limits[0] > 0.0


def test_without_a_fault_the_picture_is_of_the_channel_beside_it_in_words(gearbox):
    notice = Finding("mesh-modulated", Kind.NOTICE, "Modulated.", Where(("a2",)))
    assert verdict_picture(replace(gearbox, findings=(notice,))).channel.channel == "a2"


def test_a_finding_of_sidebands_is_marked_beside_its_mesh_not_at_its_distance(gearbox):
    pair = gearbox.rig.pairs[0]
    ratio = gearbox.rig.ratio(pair.driven, to=gearbox.shaft_angle.shaft)
    channel = gearbox.channels[0]
    where = Where((channel.channel,), gear=f"{pair.name}/{pair.driven}", order=ratio, order_shaft="input")
    risen = replace(gearbox, findings=(Finding("sidebands-risen", Kind.SUSPICION, "Sidebands.", where),))
    below, above = marked_positions(risen, channel.order_spectrum, channel.channel)
    mesh = (below + above) / 2.0 / gearbox.rig.mesh_order(pair, gearbox.shaft_angle.shaft)
    assert mesh == pytest.approx(round(mesh), rel=1e-9)
    assert above - below == pytest.approx(2.0 * ratio)


def test_what_would_make_it_surer_is_said_once(gearbox):
    remedy = "A recording of the same gears when they were healthy. Or more revolutions."
    gaps = tuple(Finding(code, Kind.CANNOT_TELL, f"{code}.", surer=remedy) for code in ("One gear", "Another gear"))
    verdict = f"Cannot tell. {' '.join('Nothing shows at the teeth of this shaft.' for _ in range(4))} "
    analysis = replace(gearbox, findings=gaps, verdict=f"{verdict}{SURER_WITH}{remedy.partition('. ')[0]}.")
    assert [card.surer for card in finding_cards(gaps)] == [remedy, ""]
    assert SURER_WITH not in " ".join(headline_of(analysis))
    assert SURER_WITH in headline_of(analysis, with_remedy=True)[1]
    assert SURER_WITH in " ".join(headline_of(replace(analysis, findings=())))
    assert analysis_text(analysis).count("more certain with:") == 1


def test_levels_that_changed_are_told_apart_by_their_channels_with_a_minus_sign(gearbox):
    levels = tuple(
        LevelChange("noise 2 to 3 kHz", "noise", Where((name,)), 0.0, "", 0.0, -change, 0.2, 1e-9, True, True)
        for name, change in (("a1", 19.5), ("a2", -7.5))
    )
    rows = change_rows(replace(gearbox, level_changes=levels))
    assert [row.label for row in rows] == ["noise 2 to 3 kHz, a1", "noise 2 to 3 kHz, a2"]
    assert [row.change for row in rows] == ["+19.5 dB", "−7.5 dB"]
    assert [row.label for row in change_rows(replace(gearbox, level_changes=levels[:1]))] == ["noise 2 to 3 kHz"]


def test_how_sure_follows_a_lowered_confidence():
    finding = Finding("x", Kind.FAULT, "X.", confidence=0.95, confidence_basis="height")
    assert finding_card(finding).confidence_basis == "at most 95 %: height"
    assert finding_card(replace(finding, confidence=0.5)).confidence_basis == "at most 50 %: height"


def test_a_strength_without_unit_says_that_it_is_unknown():
    finding = Finding("x", Kind.NOTICE, "X.", strength=Strength(0.34, "", 0.0006, "noise floor", 55.1))
    assert finding_card(finding).strength == "0.34 (unit unknown) against a floor of 0.0006 (noise floor): 55.1\u00a0dB"
    known = replace(finding, strength=Strength(0.34, "m/s^2", 0.0006, "noise floor"))
    assert finding_card(known).strength == "0.34 m/s² against a floor of 0.0006 m/s² (noise floor)"


def test_the_average_of_a_shaft_without_a_name_is_of_the_shaft(gearbox):
    average = next(iter(gearbox.channels[0].averages.values()))
    assert "average of the shaft, a1" in svg_ring(replace(average, shaft="", kind="average", channel="a1"))


def test_a_ring_says_where_its_angle_begins(gearbox, html):
    """The quarters are marked where no numbers of teeth tell the angle; the words tell whether 0° is a mark."""
    average = next(iter(gearbox.channels[0].averages.values()))
    assert [f">{angle}°<" in svg_ring(average) for angle in (0, 90, 180, 270)] == [True] * 4
    assert ">90°<" in svg_ring(average, n_teeth=23, numbered=False)
    assert ">90°<" not in svg_ring(average, n_teeth=23)
    assert zero_text(gearbox, average.shaft) in html
    marked = replace(gearbox, recording=replace(gearbox.recording, speed=PulseTimes(np.arange(9.0))))
    assert zero_text(marked, average.shaft) != zero_text(gearbox, average.shaft)


def test_figures_have_titles_and_circles_are_explained(html):
    assert '<p class="title">Order spectrum of a1</p>' in html
    captions = re.findall(r'<circle cx[^>]*r="6".*?<figcaption>(.*?)</figcaption>', html, re.DOTALL)
    assert captions
    assert all("Circled:" in caption for caption in captions)


def test_most_important_finding_comes_first(html):
    assert html.index("meshes differently") < html.index("inner-race order of") < html.index("is clipped")


def test_page_is_strict_html5(html):
    html5lib = pytest.importorskip("html5lib")
    html5lib.HTMLParser(strict=True).parse(html)


def test_the_answer_comes_first_and_what_repeats_is_folded(html):
    """Verdict, findings, figures; tables of indicators and channels without a finding open on request."""
    places = [
        html.index(text)
        for text in ("verdict", "<h2>Findings", "<h2>Recording", "machine and recording", "indicators</h2>")
    ]
    assert places == sorted(places)
    structure = parsed(html)
    folds = [attributes for tag, attributes in structure.elements if tag == "details"]
    assert len(folds) >= 3
    assert not any("open" in attributes for attributes in folds)
    assert html.count("<summary>") == len(folds)
    open_part = re.sub(r"(?s)<details.*?</details>", "", html)
    assert "computed on" not in open_part
    assert 0 < open_part.count("<article") < html.count("<article")
    assert 4 < open_part.count("<svg") < html.count("<svg")


def test_page_loads_nothing(html):
    structure = parsed(html)
    tags = {tag for tag, _ in structure.elements}
    assert not tags & {"script", "link", "iframe", "object", "embed", "base", "form"}
    for _, attributes in structure.elements:
        assert attributes.get("src", "data:").startswith("data:")
        assert attributes.get("href", "index.html") == "index.html" or attributes["href"].startswith("data:image/png")
        assert not any(name.startswith("on") for name in attributes)
    without_data = re.sub(r'"data:[^"]+"', '""', html)
    assert not re.search(r"(?i)https?:|url\(|@import|//[a-z]", without_data)


def test_page_is_small_and_pictures_have_words(html):
    assert len(html.encode()) < 250_000
    pictures = [attributes for tag, attributes in parsed(html).elements if attributes.get("role") == "img"]
    assert len(pictures) == html.count("<svg")
    assert len(pictures) > 8
    assert all(len(picture["aria-label"]) > 20 for picture in pictures)


@pytest.fixture(scope="module")
def evil_html(gearbox_with):
    analysis = gearbox_with([EVIL, "b & c"], QUOTES)
    finding = Finding(EVIL, Kind.FAULT, EVIL, Where((EVIL,), shaft=EVIL), evidence=(EVIL,), surer=EVIL)
    return page_html(replace(analysis, verdict=EVIL, findings=(finding,)), command=EVIL)


def test_texts_from_files_are_never_markup(evil_html):
    assert "<script" not in evil_html
    assert "&lt;script&gt;alert(1)&lt;/script&gt;" in evil_html
    structure = parsed(evil_html)
    assert "script" not in {tag for tag, _ in structure.elements}
    assert not any(name.startswith("on") for _, attributes in structure.elements for name in attributes)
    assert QUOTES in " ".join(structure.text)


@pytest.mark.parametrize("kind", ["gearbox", "cannot_tell"])
def test_a_page_as_pdf(kind, request):
    """Names from files are text there, too: nothing in them can break the page."""
    pytest.importorskip("typst")
    analysis = request.getfixturevalue(kind)
    finding = Finding(EVIL, Kind.FAULT, "#panic() *x* $y$ \\", Where((EVIL,)), evidence=('#include "data.json"',))
    pdf = page_pdf(replace(analysis, verdict="#[", findings=(finding,)), command=EVIL)
    assert pdf.startswith(b"%PDF-")
    assert len(pdf) < 400_000


def test_a_recording_that_allows_no_answer_has_a_page(cannot_tell, tmp_path):
    path = write_page(cannot_tell, tmp_path / "new" / "page.html")
    structure = parsed(path.read_text(encoding="utf-8"))
    text = " ".join(" ".join(structure.text).split())
    assert "cannot tell" in text
    assert "not known: there is no speed source and no gear data" in text
    assert "Nothing is known of the machine" in text
    assert [p.name for p in path.parent.iterdir()] == ["page.html"]


def test_the_outcome_follows_from_the_findings(gearbox, cannot_tell):
    assert gearbox.outcome is Outcome.FAULT
    assert cannot_tell.outcome is Outcome.CANNOT_TELL
    assert replace(cannot_tell, findings=()).outcome is Outcome.CANNOT_TELL


def test_bearings_on_one_shaft_keep_their_indicators_apart(gearbox):
    twins = tuple(
        Indicator("BPFO level 1×", value, "g", "a1", "envelope", "input", bearing=name)
        for name, value in (("left", 1.25), ("right", 7.75))
    )
    html = page_html(replace(gearbox, channels=(), indicators=twins))
    assert "Bearing left" in html
    assert "Bearing right" in html
    assert "1.25" in html
    assert "7.75" in html
