import csv
import json
import re
from dataclasses import replace

import pandas as pd
import pytest

from gearsig.diagnosis import Finding, Kind, Outcome
from gearsig.indicators import Indicator
from gearsig.report import Entry, Failure, entry_of, finding_card, write_index


def _entry(name, outcome, fm4=3.0, **more):
    return Entry(
        name, f"{name}.html", outcome, "", f"verdict of {name}", indicators=(Indicator("FM4", fm4, "", "a1"),), **more
    )


@pytest.fixture
def write(tmp_path):
    def write(*args, **keywords):
        return write_index(*args, path=tmp_path / "index.html", **keywords).read_text(encoding="utf-8")

    return write


def test_worst_comes_first_and_links_to_its_page(write):
    html = write(
        [_entry("quiet", Outcome.NO_FAULT), _entry("bad one", Outcome.FAULT), _entry("odd", Outcome.SUSPICION)]
    )
    order = [html.index(f"verdict of {name}") for name in ("bad one", "odd", "quiet")]
    assert order == sorted(order)
    assert 'href="bad%20one.html"' in html
    assert "3 recordings: 1 with a fault, 1 with a suspicion, 1 without a fault found" in html


def test_failures_are_listed_with_their_reason(write):
    html = write([], failures=[Failure("<b>x.csv</b>", "line 3 is <i>text</i>")])
    assert "&lt;b&gt;x.csv&lt;/b&gt;" in html
    assert "line 3 is &lt;i&gt;text&lt;/i&gt;" in html
    assert "1 recording: 1 not analysed" in html


def test_bars_compare_the_recordings(write):
    html = write(
        [
            _entry("a", Outcome.FAULT, 8.0),
            _entry("b", Outcome.NO_FAULT, 2.0),
            _entry("c", Outcome.NO_FAULT, float("nan")),
        ]
    )
    assert "width: 100.0%" in html
    assert "width: 25.0%" in html


def test_no_bars_across_units_or_signs(write):
    one = Entry("a", "", Outcome.NO_FAULT, "", indicators=(Indicator("rms", 2.0, "g", "a"),))
    other = Entry("b", "", Outcome.NO_FAULT, "", indicators=(Indicator("rms", 3.0, "m/s^2", "a"),))
    html = write([one, other])
    assert "width:" not in html.partition("</style>")[2]
    assert "3 m/s²" in html


def test_the_table_sorts_and_filters_without_scripts(write):
    """Each row carries its place in every order; style alone sorts and filters by it."""
    entries = [
        _entry("b", Outcome.FAULT, 2.0, machine="pump"),
        _entry("a", Outcome.NO_FAULT, 9.0, machine="fan"),
        _entry("c", Outcome.FAULT, float("nan"), machine="pump"),
    ]
    html = write(entries)
    rows = re.findall(r'<tr class="[^"]*" style="([^"]*)"', html)
    places = [[int(place) for place in re.findall(r": (\d+);", row)] for row in rows]
    worst, name, machine, fm4 = zip(*places, strict=True)  # of b, c, a: worst first
    assert worst == (0, 1, 2)
    assert name == (1, 2, 0)
    assert machine == (1, 2, 0)
    assert fm4 == (1, 2, 0)
    for order in range(4):
        assert f"main:has(#order{order}:checked) tbody tr {{ order: var(--place{order}); }}" in html
    assert html.count("<script") == 0
    assert "#outcome-no-fault:not(:checked)" in html


def test_a_table_and_json_of_all_recordings_stand_beside_it(write, tmp_path):
    write([_entry("=1+1", Outcome.FAULT, 8.0), _entry("b", Outcome.NO_FAULT)], failures=[Failure("c", "why")])
    found = json.loads((tmp_path / "batch.json").read_text(encoding="utf-8"))["recordings"]
    assert [row["recording"] for row in found] == ["=1+1", "b", "c"]
    assert found[0]["FM4"] == 8.0
    assert found[2]["reason"] == "why"
    with (tmp_path / "batch.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert [row["recording"] for row in rows] == ["'=1+1", "b", "c"]
    assert float(rows[0]["FM4"]) == 8.0


def test_indicators_of_the_table_end_in_their_unit(write, tmp_path):
    """Levels of channels that count in other units are not compared."""
    rms = (Indicator("rms", 3.0, "m/s^2", "a1"), Indicator("rms", 5.0, "m/s^2", "a2"), Indicator("rms", 9.0, "V", "u"))
    write([replace(_entry("a", Outcome.FAULT), indicators=rms), _entry("b", Outcome.NO_FAULT)])
    table = pd.read_csv(tmp_path / "batch.csv", index_col="recording")
    assert table.loc["a", ["rms (m/s²)", "rms (V)"]].tolist() == [5.0, 9.0]
    assert table["FM4"].isna().tolist() == [True, False]


def test_the_index_as_pdf(write, tmp_path):
    pytest.importorskip("typst")
    write([_entry("#[*evil*] $x$", Outcome.FAULT)], failures=[Failure("c", "why")], pdf=True)
    assert (tmp_path / "index.pdf").read_bytes().startswith(b"%PDF-")


def test_no_verdict_is_cut_in_print(write, tmp_path):
    """A longer verdict takes more room: of two lines a dozen fit a page, of ten lines they do not."""
    pytest.importorskip("typst")
    entry = _entry(45 * "w", Outcome.CANNOT_TELL)
    for n_sentences, n_pages in ((4, b"1"), (20, b"3")):
        write([replace(entry, conclusion="Nothing shows, but noise would hide it. " * n_sentences)] * 12, pdf=True)
        assert re.findall(rb"/Count (\d+)", (tmp_path / "index.pdf").read_bytes()) == [n_pages]


def test_an_entry_says_what_it_is_sure_of(write, tmp_path):
    """Impacts whose cause is not known are sure to be there; that is no sure fault."""
    of_impacts = finding_card(Finding("non-synchronous-impacts", Kind.SUSPICION, "Impacts at order 4.7."))
    of_race = finding_card(Finding("bearing-inner-race", Kind.FAULT, "Damage at the inner race."))
    assert (of_impacts.sure_of, of_race.sure_of) == ("impacts", "")
    html = write([replace(_entry("a", Outcome.SUSPICION), confidence=0.99, sure_of=of_impacts.sure_of)])
    assert re.search(r"99 % <span[^>]*>of impacts</span>", html)
    (row,) = json.loads((tmp_path / "batch.json").read_text(encoding="utf-8"))["recordings"]
    assert (row["confidence"], row["confidence_of"]) == (0.99, "impacts")


def test_dates_of_names_are_a_column_and_an_order(write, tmp_path):
    """The names state them; where none does, there is no column."""
    names = ("fan_2026-03-02", "fan_2026-03-01T0605", "fan")
    html = write([_entry(name, Outcome.NO_FAULT) for name in names], pdf=True)
    assert '<td class="small">2026-03-02</td>' in html
    assert '<td class="small">2026-03-01 06:05</td>' in html
    kept = json.loads((tmp_path / "batch.json").read_text(encoding="utf-8"))["recordings"]
    assert {row["recording"]: row["date"] for row in kept} == {
        "fan_2026-03-02": "2026-03-02 00:00:00",
        "fan_2026-03-01T0605": "2026-03-01 06:05:00",
        "fan": "",
    }
    order = re.findall(r'id="order(\d)"[^>]*> ([a-z ]+)', html)
    column = next(number for number, words in order if words.strip() == "latest first")
    places = re.findall(rf'--place{column}: (\d);[^>]*>\s*<th scope="row"><a href="([^"]+)"', html)
    assert [page for _, page in sorted(places)] == [f"{name}.html" for name in names]
    assert "latest first" not in write([_entry("fan", Outcome.NO_FAULT)])


def test_index_is_strict_html5_and_loads_nothing(write):
    html5lib = pytest.importorskip("html5lib")
    html = write(
        [_entry("a", Outcome.FAULT), _entry("b", Outcome.NO_FAULT)], failures=[Failure("c", "why")], command="gearsig"
    )
    html5lib.HTMLParser(strict=True).parse(html)
    assert "http" not in html.replace("http-equiv", "")


def test_entry_sums_up_the_most_important_finding(gearbox):
    shuffled = replace(gearbox, findings=gearbox.findings[::-1])
    entry = entry_of(shuffled, "n", "n.html")
    assert (entry.outcome, entry.confidence, entry.ratio_db) == (Outcome.FAULT, 0.93, 18.6)


def test_cracks_are_sorted_by_depth_and_the_reference_is_marked(write):
    html = write(
        [
            _entry("shallow", Outcome.FAULT, confidence=0.9, crack_mm=1.3),
            _entry("deep", Outcome.FAULT, confidence=0.8, crack_mm=3.3),
            _entry("healthy", Outcome.NO_FAULT, is_reference=True),
        ]
    )
    order = [html.index(f"verdict of {name}") for name in ("deep", "shallow", "healthy")]
    assert order == sorted(order)
    assert '<td class="number">3.3 mm</td>' in html
    assert '<td class="number">–</td>' in html
    assert html.count("(the reference)") == 1
    assert html.index("(the reference)") > html.index("verdict of shallow")
