"""The further methods of the analysis page in a real browser."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from app.dashboard.methods import METHODS
from gearsig.decompose import denoise
from gearsig.recording import read_recording
from tests.app.pages import SAMPLES
from tests.browser.conftest import CHROMIUM, settle

pytestmark = [
    pytest.mark.browser,
    pytest.mark.skipif(CHROMIUM is None, reason="there is no Chromium on this machine"),
]
playwright = pytest.importorskip("playwright.sync_api")


def open_methods(page: playwright.Page, sample: str = "") -> playwright.Locator:
    """Return the panel of the methods, of the first sample or a named one."""
    page.get_by_role("tab", name="Report").wait_for()
    settle(page)
    if sample:
        page.get_by_test_id("stSidebar").get_by_test_id("stSelectbox").locator("input").first.click()
        page.get_by_role("option", name=sample, exact=True).click()
        page.get_by_test_id("stMain").get_by_text(SAMPLES[sample.lower().replace(" ", "_")].recording.name).wait_for()
        settle(page)
    page.get_by_role("tab", name="More methods", exact=True).click()
    settle(page)
    return page.get_by_role("tabpanel").filter(visible=True)


def choose(page: playwright.Page, panel: playwright.Locator, name: str) -> None:
    panel.get_by_test_id("stButtonGroup").get_by_text(name, exact=True).first.click()
    settle(page)


def test_every_method_draws(page: playwright.Page) -> None:
    panel = open_methods(page)
    for method in METHODS:
        choose(page, panel, method)
        panel.get_by_text("Analysed: 0 to ").wait_for()
        if method != "Crack severity":  # the sample's tooth is damaged otherwise
            panel.locator(".js-plotly-plot, img").first.wait_for()
            assert panel.get_by_test_id("stAlert").count() == 0, method


def test_suggested_modes_are_taken_over(page: playwright.Page) -> None:
    panel = open_methods(page)
    choose(page, panel, "Modes")
    panel.get_by_role("button", name="Suggest K and penalty").click()
    panel.get_by_role("button", name="Use it").click()
    settle(page)
    suggested = panel.get_by_text("Suggested:").inner_text().split()[1]
    shown = panel.get_by_test_id("stSlider").filter(has_text="Modes K").get_by_test_id("stSliderThumbValue")
    playwright.expect(shown).to_have_text(suggested)


def test_the_denoised_signal_can_be_taken_along_whole(page: playwright.Page) -> None:
    panel = open_methods(page)
    choose(page, panel, "Denoising")
    panel.get_by_test_id("stPopover").get_by_role("button").click()
    with page.expect_download() as download:
        page.get_by_role("button", name="Waveforms: 3 × 64000 samples").click()
    assert download.value.suggested_filename == "damaged_tooth-denoising-waveforms.csv"
    path = Path(download.value.path())
    found = read_recording(path.rename(path.with_suffix(".csv")))
    sample = read_recording(SAMPLES["damaged_tooth"].recording, sampling_rate_hz=found.sampling_rate_hz)
    whole = denoise(sample, sample.channel_names[0])
    np.testing.assert_allclose(found.values("without noise"), whole.values, atol=1e-12)


def test_the_depth_of_a_crack_against_the_healthy_sample(page: playwright.Page) -> None:
    panel = open_methods(page, "Root crack 3mm")
    choose(page, panel, "Crack severity")
    choose(page, panel, "Sample")
    panel.locator("img").wait_for()
    assert "tooth 21" in panel.get_by_test_id("stAlert").inner_text().replace("\u2060", "")
