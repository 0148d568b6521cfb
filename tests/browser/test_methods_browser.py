"""The further methods of the analysis page in a real browser."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from app.dashboard.methods import METHODS
from app.dashboard.widgets.views import OF_CHANNEL
from gearsig.decompose import denoise
from gearsig.recording import read_recording
from tests.app.pages import SAMPLES
from tests.browser.conftest import CHROMIUM, open_view, settle

pytestmark = [
    pytest.mark.browser,
    pytest.mark.skipif(CHROMIUM is None, reason="there is no Chromium on this machine"),
]
playwright = pytest.importorskip("playwright.sync_api")


def open_analysis(page: playwright.Page, sample: str = "damaged_tooth") -> None:
    page.goto(f"{page.url.partition('?')[0]}analysis?sample={sample}")
    page.locator(".strip").first.wait_for()
    settle(page)


def open_method(page: playwright.Page, name: str) -> playwright.Locator:
    """Go to a method within its view."""
    name_of_view = next(view for view, methods in OF_CHANNEL.items() if name in methods)
    view = open_view(page, name_of_view)
    choose(page, view, name)
    return view


def choose(page: playwright.Page, panel: playwright.Locator, name: str) -> None:
    panel.get_by_test_id("stButtonGroup").get_by_text(name, exact=True).first.click()
    settle(page)


def test_every_method_draws(page: playwright.Page) -> None:
    open_analysis(page)
    for method in METHODS:
        panel = open_method(page, method)
        panel.get_by_text("Analysed: 0 to ").first.wait_for()
        if method != "Crack severity":  # the sample's tooth is damaged otherwise
            panel.locator(".figure svg, .js-plotly-plot, img").first.wait_for()
            assert panel.get_by_test_id("stAlert").count() == 0, method


def test_suggested_modes_are_taken_over(page: playwright.Page) -> None:
    open_analysis(page)
    panel = open_method(page, "Modes")
    panel.get_by_role("button", name="Suggest K and penalty").click()
    panel.get_by_role("button", name="Use it").click()
    settle(page)
    suggested = panel.get_by_text("Suggested:").inner_text().split()[1]
    shown = panel.get_by_test_id("stSlider").filter(has_text="Modes K").get_by_test_id("stSliderThumbValue")
    playwright.expect(shown).to_have_text(suggested)


def test_the_denoised_signal_can_be_taken_along_whole(page: playwright.Page) -> None:
    open_analysis(page)
    panel = open_method(page, "Denoising")
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
    open_analysis(page, "root_crack_3mm")
    panel = open_method(page, "Crack severity")
    panel.locator("img").first.wait_for()
    assert "tooth 21" in panel.get_by_test_id("stAlert").filter(has_text="tooth").inner_text().replace("\u2060", "")
