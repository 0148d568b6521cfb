"""The dashboard in a real browser: Debian's Chromium, driven by Playwright against the real server."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from app.samples import samples
from gearsig.diagnosis import analyze
from gearsig.recording import read_recording
from gearsig.rig import read_rig
from tests.browser.conftest import CHROMIUM, open_view, settle, soon

VIEWS = ("Machine", "Waveform", "Speed", "Spectrum", "Order spectrum", "Map", "Average", "Envelope", "Indicators")
SAMPLE = next(sample for sample in samples() if sample.rig.stem == "no_tachometer")
HOSTILE = (
    "<img src=x onerror=document.title=1>",
    "**x** $y$ :material/delete: :smile: -> www.a.b http://c.d e@f.gh [l](http://m.n) `o` ~~p~~",
)

pytestmark = [
    pytest.mark.browser,
    pytest.mark.skipif(CHROMIUM is None, reason="there is no Chromium on this machine"),
]
playwright = pytest.importorskip("playwright.sync_api")


def open_files(page: playwright.Page, recording: Path | dict[str, object], rig: Path | None = None) -> None:
    page.get_by_role("link", name="Analysis").click()
    page.get_by_text("Your file", exact=True).click()
    page.get_by_text("Choose a recording on the left").first.wait_for()
    settle(page)
    inputs = page.locator("[data-testid=stFileUploader] input[type=file]")
    if rig is not None:
        inputs.nth(1).set_input_files(rig)
        settle(page)
    inputs.nth(0).set_input_files(recording)
    settle(page)


def verdict(page: playwright.Page) -> str:
    text = page.get_by_role("heading", level=3).first.inner_text()
    assert isinstance(text, str)
    return text


def open_sample(page: playwright.Page) -> None:
    page.get_by_role("button", name="Open the recording").click()
    page.locator(".strip").first.wait_for()
    settle(page)


def test_one_click_from_the_start_to_the_damaged_tooth_and_through_all_views(page: playwright.Page) -> None:
    open_sample(page)
    assert verdict(page).startswith("Fault: Local tooth damage")
    assert "sample=damaged_tooth" in page.url
    for name in VIEWS:
        view = open_view(page, name)
        view.locator(".figure svg, img, [data-testid=stDataFrame]").first.wait_for()
    open_view(page, "Report")
    with page.expect_download() as download:
        page.get_by_role("button", name="Download the report").click()
    html = Path(download.value.path()).read_text(encoding="utf-8")
    assert download.value.suggested_filename == "damaged_tooth.html"
    assert "Local tooth damage" in html
    assert "<script" not in html


def test_zooming_refines_and_cursors_are_dragged(page: playwright.Page) -> None:
    open_sample(page)
    view = open_view(page, "Order spectrum")
    svg = view.locator(".figure svg")
    box = svg.bounding_box()
    path = svg.locator("path").last
    before = path.get_attribute("d")
    middle = box["y"] + box["height"] / 2
    page.mouse.move(box["x"] + 0.4 * box["width"], middle)
    page.mouse.down()
    page.mouse.move(box["x"] + 0.5 * box["width"], middle, steps=4)
    page.mouse.up()
    # a tenth of the axis, in as many points as the whole had: the server sends its detail
    assert soon(page, lambda: path.get_attribute("d").count("L") > 0.5 * before.count("L"))
    near = path.get_attribute("d")
    assert near != before
    view.get_by_role("button", name="Harmonics").click()
    words = view.locator(".figure .words")
    first = words.inner_text()
    svg.focus()
    page.keyboard.press("ArrowRight")
    assert words.inner_text() != first
    view.get_by_role("button", name="Peaks").click()
    assert view.locator(".figure .peaks tr").count() > 5
    for kind in ("PNG", "SVG", "CSV"):
        with page.expect_download() as download:
            view.get_by_role("button", name=kind, exact=True).click()
        assert download.value.suggested_filename.endswith(kind.lower())
        assert Path(download.value.path()).stat().st_size > 1000
    page.keyboard.press("Escape")
    svg.dblclick(position={"x": box["width"] / 2, "y": box["height"] / 2})
    assert soon(page, lambda: near != path.get_attribute("d") and path.get_attribute("d").count("L") > 1000)


def test_sidebands_are_pulled_apart_and_stay_so(page: playwright.Page) -> None:
    """The nearest line is taken; pulled through its carrier it stays apart, and no letters lie over each other."""
    open_sample(page)
    view = open_view(page, "Order spectrum")
    view.get_by_role("button", name="Sidebands", exact=True).click()
    own, words = view.locator(".figure svg line.own"), view.locator(".figure .words")

    def pull(number: int, pixels: float) -> float:
        """Pull a line of the family sideways, numbered from the carrier as they are drawn; return the spacing."""
        box = own.nth(number).bounding_box()
        page.mouse.move(box["x"], box["y"] + 0.5 * box["height"])
        page.mouse.down()
        page.mouse.move(box["x"] + pixels, box["y"] + 0.5 * box["height"], steps=8)
        page.mouse.up()
        return float(words.inner_text().partition("every ")[2].split()[0])

    carrier, spacing = words.inner_text().partition(" orders")[0], pull(0, -200.0)
    assert words.inner_text().partition(" orders")[0] != carrier  # the carrier moved, though sidebands lie close to it
    box = own.first.bounding_box()
    right = 1 if own.nth(1).bounding_box()["x"] > box["x"] else 2
    assert pull(right, 60.0) > 5 * spacing
    right = 1 if own.nth(1).bounding_box()["x"] > own.first.bounding_box()["x"] else 2
    assert pull(right, -300.0) > 0.1
    letters = view.locator(".figure svg text").filter(has_text=re.compile("^(C|[+−][1-5])$"))
    places = sorted(text.bounding_box()["x"] for text in letters.all())
    assert places
    assert min(np.diff(places), default=99.0) > 15.0


def test_a_view_can_be_sent_as_its_address_and_an_own_file_survives_a_reload(page: playwright.Page) -> None:
    open_files(page, SAMPLE.recording, SAMPLE.rig)
    page.locator(".strip").first.wait_for()
    open_view(page, "Speed")
    said = verdict(page)
    assert "file=" in page.url
    page.reload()
    page.locator(".strip button[aria-pressed=true]").filter(has_text="Speed").first.wait_for()
    settle(page)
    assert verdict(page) == said


@pytest.mark.study
def test_what_is_chosen_in_a_view_is_in_its_address_and_leaves_it_with_the_view(page: playwright.Page) -> None:
    open_sample(page)
    view = open_view(page, "Envelope")
    for name in ("Kurtogram", "Tones removed"):
        view.get_by_text(name, exact=True).first.click()
        settle(page)
    assert soon(page, lambda: "show=Kurtogram" in page.url and "preparation=tones" in page.url)
    sent = page.url
    page.reload()
    page.locator(".strip button[aria-pressed=true]").filter(has_text="Envelope").first.wait_for()
    settle(page)
    view.get_by_text("Tones removed", exact=True).first.wait_for()
    assert page.url == sent
    open_view(page, "Spectrum")
    assert soon(page, lambda: "show=" not in page.url and "preparation=" not in page.url)
    page.get_by_role("link", name="Fault laboratory").click()
    assert soon(page, lambda: "laboratory" in page.url and "sample=" not in page.url)


def test_back_and_forward_restore_view_scale_zoom_and_recording(page: playwright.Page) -> None:
    open_sample(page)
    opened = page.url
    view = open_view(page, "Spectrum")
    n_entries = page.evaluate("history.length")
    view.get_by_text("dB", exact=True).click()
    assert soon(page, lambda: "amplitude=dB" in page.url)
    settle(page)
    box = view.locator(".figure svg").bounding_box()
    middle = box["y"] + box["height"] / 2
    page.mouse.move(box["x"] + 0.4 * box["width"], middle)
    page.mouse.down()
    page.mouse.move(box["x"] + 0.5 * box["width"], middle, steps=4)
    page.mouse.up()
    assert soon(page, lambda: "zoom=" in page.url)
    settle(page)
    zoomed = page.url
    curve = view.locator(".figure svg path").last.get_attribute("d")
    open_view(page, "Envelope")
    assert soon(page, lambda: "view=Envelope" in page.url)
    assert page.evaluate("history.length") == n_entries + 3  # one for each thing that was done
    page.get_by_text("Your file", exact=True).click()
    page.get_by_text("Choose a recording on the left").first.wait_for()
    settle(page)
    page.go_back()
    page.locator(".strip button[aria-pressed=true]").filter(has_text="Envelope").first.wait_for()
    settle(page)
    page.go_back()
    page.locator(".strip button[aria-pressed=true]").filter(has_text="Spectrum").first.wait_for()
    settle(page)
    assert page.url == zoomed
    assert view.locator(".figure svg path").last.get_attribute("d") == curve
    for _ in range(3):
        page.go_back()
        settle(page)
    assert page.url == opened
    page.locator(".strip button[aria-pressed=true]").filter(has_text="Average").first.wait_for()
    for _ in range(3):
        page.go_forward()
        settle(page)
    assert page.url == zoomed
    assert view.locator(".figure svg path").last.get_attribute("d") == curve
    open_view(page, "Average")  # which was the first, and is a choice again
    assert soon(page, lambda: "view=Average" in page.url)


def test_a_report_is_looked_at_in_a_frame_that_runs_nothing(page: playwright.Page) -> None:
    open_sample(page)
    view = open_view(page, "Report")
    assert page.locator(".document").count() == 0
    view.get_by_text("Preview").click()
    frame = page.locator(".document iframe")
    frame.wait_for()
    assert frame.get_attribute("sandbox") == ""
    assert frame.bounding_box()["height"] <= 700
    frame.content_frame.get_by_role("heading").filter(has_text="Local tooth damage").first.wait_for()


def test_recording_and_rig_file_are_given_at_once(page: playwright.Page) -> None:
    page.locator("[data-testid=stFileUploader] input[type=file]").first.set_input_files([SAMPLE.recording, SAMPLE.rig])
    page.locator(".strip").first.wait_for()
    settle(page)
    assert "file=" in page.url
    view = open_view(page, "Order spectrum")
    assert view.get_by_text("1× mesh", exact=True).count() > 0


def test_a_described_machine_is_analysed_at_once_and_survives_a_reload(page: playwright.Page, address: str) -> None:
    sample = next(sample for sample in samples() if sample.rig.stem == "outer_race")
    page.goto(address)
    settle(page)
    open_files(page, sample.recording)
    assert "outer race" not in verdict(page)
    open_view(page, "Machine")
    page.get_by_text("As a rig file (TOML)").click()
    text = page.get_by_role("textbox", name="Text", exact=True)
    text.fill(sample.rig.read_text(encoding="utf-8"))
    text.press("Control+Enter")
    settle(page)
    page.get_by_role("button", name="Use this text").click()
    page.get_by_role("heading", level=3).filter(has_text="outer race").first.wait_for()
    settle(page)
    page.reload()
    page.get_by_role("heading", level=3).filter(has_text="outer race").first.wait_for()


def test_another_user_sees_nothing_of_the_first(page: playwright.Page, address: str) -> None:
    name = "confidential.csv"
    rows = "\n".join(f"{i / 1000:g},{(i * 37) % 101}" for i in range(3000))
    open_files(page, {"name": name, "mimeType": "text/csv", "buffer": f"time (s),a\n{rows}\n".encode()})
    page.locator(".strip").first.wait_for()
    token = page.url.partition("file=")[2]
    assert len(token) > 20
    other = page.context.browser.new_context().new_page()
    other.set_default_timeout(90_000)
    other.goto(address)
    other.get_by_role("button", name="Open the recording").first.wait_for()
    assert name not in other.locator("body").inner_text()
    for query in ("?file=", f"?file={token[:8]}"):
        other.goto(f"{address}analysis{query}")
        other.locator(".strip").first.wait_for()  # a sample's, which is open where nothing else is
        assert name not in other.locator("body").inner_text()
    other.context.close()


def test_a_small_window_shows_the_verdict_above_its_picture(page: playwright.Page) -> None:
    page.set_viewport_size({"width": 800, "height": 900})
    open_sample(page)
    words, picture = page.locator(".st-key-verdict h3"), page.locator(".st-key-verdict img")
    assert words.bounding_box()["y"] < picture.bounding_box()["y"]
    assert page.evaluate("document.documentElement.scrollWidth") <= 800
    brief = page.locator(".st-key-verdict-brief")
    for measure in ("28.3 dB over its floor", "≤ 86 % sure"):
        assert measure in brief.inner_text().replace("\u00a0", " ")
    page.set_viewport_size({"width": 1280, "height": 900})
    brief.wait_for(state="hidden")
    assert page.locator(".st-key-verdict-measures").get_by_text("how strong:").is_visible()


@pytest.mark.parametrize("query", ["analysis?sample=two_stage&view=Modes", "compare?sample=root_crack_3mm", "gap"])
def test_what_is_chosen_can_be_read_in_a_small_window(page: playwright.Page, address: str, query: str) -> None:
    page.set_viewport_size({"width": 800, "height": 1000})
    page.goto(address + query)
    page.locator("[data-testid=stSidebar] [role=combobox]").first.wait_for()
    settle(page)
    cut = page.evaluate(
        """() => [...document.querySelectorAll('[data-testid=stSelectbox] input, [data-testid=stMultiSelect] span')]
            .filter((part) => part.clientWidth > 1 && part.scrollWidth > part.clientWidth + 1)
            .map((part) => part.value || part.textContent)"""
    )
    assert not cut
    how = "fields => fields.map(field => getComputedStyle(field).textOverflow)"
    assert set(page.locator("input").evaluate_all(how)) <= {"ellipsis"}  # of what must be shortened


def test_own_files(page: playwright.Page) -> None:
    open_files(page, SAMPLE.recording, SAMPLE.rig)
    page.locator(".strip").first.wait_for()
    settle(page)
    recording = read_recording(SAMPLE.recording, rig=read_rig(SAMPLE.rig))
    words = page.get_by_test_id("stMain").inner_text().replace("\u2060", "").split()
    assert " ".join(analyze(recording).verdict.split()[:12]) in " ".join(words)
    view = open_view(page, "Order spectrum")
    assert view.get_by_text("1× mesh", exact=True).count() > 0


def test_names_from_a_file_are_text(page: playwright.Page) -> None:
    rows = "\n".join(f"{i / 1000:g};{(i * 37) % 101};{(i * 53) % 97}" for i in range(3000))
    content = f"time (s);{HOSTILE[0]};{HOSTILE[1]}\n{rows}\n".encode()
    name = "<b>n</b> :smile: **r**.csv"
    open_files(page, {"name": name, "mimeType": "text/csv", "buffer": content})
    page.locator(".strip").first.wait_for()
    open_view(page, "Waveform")
    text = page.locator("[data-testid=stMain]").inner_text().replace("\u2060", "")
    for shown in (name, *HOSTILE):
        assert shown in text
    assert page.title() == "gearsig"
    assert page.locator("[data-testid=stMain] a[href]").count() == 0


def test_a_broken_file_is_one_message(page: playwright.Page) -> None:
    open_files(page, {"name": "broken.mat", "mimeType": "", "buffer": b"\x80\x04\x95 pickle"})
    message = page.get_by_test_id("stAlert")
    message.first.wait_for()
    settle(page)
    assert message.count() == 1
    assert page.get_by_text("As a rig file (TOML)").count() == 0  # no machine mends it
    assert "pickle" in message.inner_text()
