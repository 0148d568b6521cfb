"""*Comparison* in a real browser: from two samples to a page to take away."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.browser.conftest import CHROMIUM, settle

pytestmark = [
    pytest.mark.browser,
    pytest.mark.skipif(CHROMIUM is None, reason="there is no Chromium on this machine"),
]
playwright = pytest.importorskip("playwright.sync_api")


def test_two_samples_are_compared_and_the_page_is_downloaded(page: playwright.Page) -> None:
    page.set_default_timeout(120_000)
    page.get_by_role("link", name="Comparison").click()
    page.get_by_role("heading", name="Comparison of a simulation").first.wait_for()
    settle(page)
    page.get_by_role("radiogroup", name="Simulation").get_by_text("Sample", exact=True).click()
    page.get_by_role("tab", name="Lines").first.wait_for()
    settle(page)
    page.get_by_text("healthy.h5 beside damaged_tooth.csv.gz").first.wait_for()
    for name, n_figures in (("Orders", 2), ("Angle", 4), ("Bands", 2), ("Lines", 0)):
        page.get_by_role("tab", name=name, exact=True).click()
        settle(page)
        playwright.expect(page.locator(".figure")).to_have_count(n_figures, timeout=60_000)
    with page.expect_download() as download:
        page.get_by_role("button", name="Report (HTML)").click()
    assert download.value.suggested_filename == "compare.html"
    assert "damaged_tooth.csv.gz" in Path(download.value.path()).read_text(encoding="utf-8")
