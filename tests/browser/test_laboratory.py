"""The fault laboratory in a real browser: from a slider to the analysis of what it did."""

from __future__ import annotations

import zipfile
from pathlib import Path

import pytest

from tests.browser.conftest import CHROMIUM, settle, soon

pytestmark = [
    pytest.mark.browser,
    pytest.mark.skipif(CHROMIUM is None, reason="there is no Chromium on this machine"),
]
playwright = pytest.importorskip("playwright.sync_api")


@pytest.fixture
def laboratory(page: playwright.Page) -> playwright.Page:
    """Go from the analysis to the laboratory."""
    page.set_default_timeout(300_000)  # the simulator may have to be compiled first
    page.get_by_role("link", name="Fault laboratory").click()
    page.get_by_role("tab", name="Phase portrait").first.wait_for()
    settle(page)
    return page


def pull_the_crack(page: playwright.Page, n_steps: int, reached: str) -> None:
    page.get_by_role("slider", name="Crack in a tooth root").focus()
    for _ in range(n_steps):
        page.keyboard.press("ArrowRight")
    page.get_by_role("heading", name=f"Crack in a tooth root, {reached}", exact=True).first.wait_for()
    page.get_by_text("Preview of").wait_for(state="hidden")
    settle(page)


def test_from_the_slider_to_the_analysis_and_back(laboratory: playwright.Page) -> None:
    laboratory.get_by_role("heading", name="Healthy").first.wait_for()
    pull_the_crack(laboratory, 100, "2 mm")
    for name in ("Spectrum", "Envelope", "Phase portrait", "Mesh"):
        laboratory.get_by_role("tab", name=name, exact=True).click()
        settle(laboratory)
        laboratory.locator(".figure svg, .js-plotly-plot").first.wait_for()
    laboratory.get_by_role("button", name="Open in Analysis").click()
    laboratory.locator(".strip").first.wait_for()
    laboratory.get_by_text("published_55_75_root_crack_2.h5").first.wait_for()
    laboratory.get_by_text("5 s at 20480 Hz").first.wait_for()
    settle(laboratory)
    laboratory.get_by_role("link", name="Fault laboratory").click()
    laboratory.get_by_role("tab", name="Phase portrait").first.wait_for()
    laboratory.get_by_role("heading", name="Crack in a tooth root, 2 mm", exact=True).first.wait_for()


def test_results_fade_as_soon_as_a_slider_stands_elsewhere(laboratory: playwright.Page) -> None:
    """The server need not hear of it: here it never does."""
    slider = laboratory.get_by_role("slider", name="Crack in a tooth root")
    number = laboratory.locator(
        ".st-key-results [data-testid=stElementContainer]:has([data-testid=stMetricValue])"
    ).first
    opacity = "element => Number(getComputedStyle(element).opacity)"
    assert number.evaluate(opacity) == 1.0
    for depth, is_faded in (("0.02", True), ("0", False)):
        slider.evaluate("(slider, depth) => slider.setAttribute('aria-valuetext', depth)", depth)
        assert soon(laboratory, lambda is_faded=is_faded: (number.evaluate(opacity) < 0.5) == is_faded)


def test_the_finite_element_pair_follows_its_slider_to_the_end(laboratory: playwright.Page) -> None:
    laboratory.get_by_role("combobox", name="Machine").click()
    laboratory.get_by_role("option", name="Flexible 50/50").click()
    laboratory.get_by_text("Flexible spur pair 50/50").first.wait_for()
    settle(laboratory)
    laboratory.get_by_role("slider", name="Crack in a tooth root").focus()
    laboratory.keyboard.press("End")
    laboratory.get_by_role("heading", name="Crack in a tooth root, 8.15 mm").first.wait_for()
    settle(laboratory)
    for name in ("Spectrum", "Mesh"):
        laboratory.get_by_role("tab", name=name, exact=True).click()
        settle(laboratory)
        laboratory.locator(".figure svg, .js-plotly-plot").first.wait_for()
    assert laboratory.get_by_test_id("stAlert").count() == 0


@pytest.mark.study
def test_a_recording_is_saved_with_rig_and_truth(laboratory: playwright.Page) -> None:
    pull_the_crack(laboratory, 50, "1 mm")
    laboratory.get_by_role("button", name="Save as recording").click()
    with laboratory.expect_download() as download:
        laboratory.get_by_role("button", name="Download", exact=True).click()
    stem = "published_55_75_root_crack_1"
    assert download.value.suggested_filename == f"{stem}.zip"
    with zipfile.ZipFile(Path(download.value.path())) as archive:
        assert archive.namelist() == [f"{stem}.h5", f"{stem}.toml", f"{stem}.truth.json"]


def test_an_own_file_stays_open_while_the_laboratory_is_looked_at(page: playwright.Page) -> None:
    rows = "\n".join(f"{i / 1000:g};{(i * 37) % 101}" for i in range(3000))
    content = f"time (s);a1\n{rows}\n".encode()
    page.get_by_role("link", name="Analysis").click()
    page.get_by_text("Your file", exact=True).click()
    page.get_by_text("Choose a recording on the left").first.wait_for()
    uploader = page.locator("[data-testid=stFileUploader] input[type=file]").first
    uploader.set_input_files({"name": "mine.csv", "mimeType": "text/csv", "buffer": content})
    page.locator(".strip").first.wait_for()
    settle(page)
    page.set_default_timeout(300_000)
    page.get_by_role("link", name="Fault laboratory").click()
    page.get_by_role("tab", name="Phase portrait").first.wait_for()
    page.get_by_role("link", name="Analysis").click()
    page.get_by_text("Still open: mine.csv").first.wait_for()
    settle(page)
    page.get_by_test_id("stMain").get_by_text("mine.csv").first.wait_for()
    page.get_by_role("button", name="Close", exact=True).click()
    page.get_by_text("Choose a recording on the left").first.wait_for()
