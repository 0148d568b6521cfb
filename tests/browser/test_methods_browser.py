"""The further methods of the analysis page in a real browser."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from app.dashboard.widgets.views import OF_CHANNEL
from gearsig.decompose import denoise
from gearsig.methods import METHODS
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
    for method in METHODS.values():
        if not method.view:
            continue
        panel = open_method(page, method.title)
        panel.get_by_text("Analysed: 0 to ").first.wait_for()
        if method.title != "Lyapunov exponent":  # the sample is too noisy for it, which is said
            panel.locator(".figure svg, .js-plotly-plot, img").first.wait_for()
            assert panel.get_by_test_id("stAlert").count() == 0, method.title


def test_the_chosen_mode_goes_on_to_the_squeezed_transform(page: playwright.Page) -> None:
    open_analysis(page)
    panel = open_method(page, "Modes")
    panel.get_by_text("is the most impulsive").first.wait_for()
    panel.get_by_role("combobox", name="The chosen mode goes on to").click()
    page.get_by_role("option", name="Squeezed wavelet").click()
    settle(page)
    panel.locator(".figure svg image").first.wait_for()
    panel.get_by_text("Segment and further settings").click()
    panel.get_by_text("Colours span").first.wait_for()


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
    panel.locator(".figure").first.wait_for()
    assert "tooth 21" in panel.get_by_test_id("stAlert").filter(has_text="tooth").inner_text().replace("\u2060", "")
