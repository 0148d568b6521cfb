"""The dashboard in a real browser: Debian's Chromium, driven by Playwright against the real server."""

from __future__ import annotations

from pathlib import Path

import pytest

from app.samples import samples
from gearsig.diagnosis import analyze
from gearsig.recording import read_recording
from gearsig.rig import read_rig
from tests.browser.conftest import CHROMIUM, settle

TABS = ("Speed", "Spectrum", "Order spectrum", "Order map", "Envelope", "Synchronous average", "Indicators", "Report")
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
    page.get_by_text("Own file", exact=True).click()
    page.get_by_text("Open a recording of your own").wait_for()
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


def test_a_sample_through_all_views(page: playwright.Page) -> None:
    page.get_by_role("tab", name="Report").wait_for()
    assert verdict(page).startswith("Fault: Local tooth damage")
    for name in TABS:
        page.get_by_role("tab", name=name, exact=True).click()
        settle(page)
        panel = page.get_by_role("tabpanel").filter(visible=True)
        panel.locator(".js-plotly-plot, img, [data-testid=stDataFrame], [data-testid=stAlert]").first.wait_for()
    with page.expect_download() as download:
        page.get_by_role("button", name="Download the report").click()
    html = Path(download.value.path()).read_text(encoding="utf-8")
    assert download.value.suggested_filename == "damaged_tooth.html"
    assert "Local tooth damage" in html
    assert "<script" not in html


def test_own_files(page: playwright.Page) -> None:
    open_files(page, SAMPLE.recording, SAMPLE.rig)
    page.get_by_role("tab", name="Report").wait_for()
    recording = read_recording(SAMPLE.recording, rig=read_rig(SAMPLE.rig))
    words = page.get_by_test_id("stMain").inner_text().replace("\u2060", "").split()
    assert " ".join(analyze(recording).verdict.split()) in " ".join(words)
    page.get_by_role("tab", name="Order spectrum", exact=True).click()
    page.locator(".js-plotly-plot").first.wait_for()
    assert page.get_by_text("1× mesh").count() > 0


def test_names_from_a_file_are_text(page: playwright.Page) -> None:
    rows = "\n".join(f"{i / 1000:g};{(i * 37) % 101};{(i * 53) % 97}" for i in range(3000))
    content = f"time (s);{HOSTILE[0]};{HOSTILE[1]}\n{rows}\n".encode()
    name = "<b>n</b> :smile: **r**.csv"
    open_files(page, {"name": name, "mimeType": "text/csv", "buffer": content})
    page.get_by_role("tab", name="Channels").wait_for()
    settle(page)  # the tab stands before what is in it
    text = page.locator("[data-testid=stMain]").inner_text().replace("\u2060", "")
    for shown in (name, *HOSTILE):
        assert shown in text
    assert page.title() == "gearsig"
    assert page.locator("[data-testid=stMain] a[href]").count() == 0


def test_a_broken_file_is_one_message(page: playwright.Page) -> None:
    open_files(page, {"name": "broken.mat", "mimeType": "", "buffer": b"\x80\x04\x95 pickle"})
    message = page.get_by_test_id("stAlert")
    message.wait_for()
    assert message.count() == 1
    assert "pickle" in message.inner_text()
