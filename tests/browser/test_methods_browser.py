"""The further methods of the analysis page in a real browser."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from app.dashboard.analysis import OF_CHANNEL
from gearsig.decompose import denoise
from gearsig.methods import METHODS
from gearsig.recording import read_recording
from tests.app.pages import SAMPLES
from tests.browser.conftest import CHROMIUM, open_view, settle
from tests.marks import further

pytestmark = [
    pytest.mark.browser,
    pytest.mark.skipif(CHROMIUM is None, reason="there is no Chromium on this machine"),
]
playwright = pytest.importorskip("playwright.sync_api")
HYPHEN_AS_MINUS = re.compile(r"-\d")


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
        panel.locator(".figure svg, .js-plotly-plot, img").first.wait_for()
        is_refused = method.title == "Lyapunov exponent"  # the sample is too noisy for it; its curve is shown
        # The method shown before, and what was said of it, goes when this one's results are there.
        playwright.expect(panel.get_by_test_id("stAlert"), method.title).to_have_count(int(is_refused), timeout=60_000)
        assert_figures_are_well_lettered(panel, method.title)


def assert_figures_are_well_lettered(panel: playwright.Locator, name: str) -> None:
    """Numbers have true minus signs, no name is twice in a legend, no choice is cut off."""
    for figure in panel.locator(".figure").all():
        texts = figure.locator("svg text").all_text_contents()
        assert not [text for text in texts if HYPHEN_AS_MINUS.match(text)], name
        names = figure.locator(".key").all_text_contents()
        assert len(names) == len(set(names)), name
    cut = "groups => groups.filter(g => g.scrollWidth > g.clientWidth + 1).map(g => g.innerText)"
    assert not panel.locator("[data-testid=stButtonGroup], [data-testid=stButtonGroup] *").evaluate_all(cut), name


@pytest.mark.parametrize("width", [800, further(1440)])
def test_no_choice_of_a_method_is_cut_off(page: playwright.Page, width: int) -> None:
    page.set_viewport_size({"width": width, "height": 1600})
    open_analysis(page)
    for name in ("Kurtogram", "Cyclic coherence", "Orders (Vold–Kalman)", "Denoising", "Lyapunov exponent"):
        panel = open_method(page, name)
        panel.get_by_text("Analysed: 0 to ").first.wait_for()
        assert_figures_are_well_lettered(panel, name)


def test_readouts_have_true_minus_signs(page: playwright.Page) -> None:
    """Under the pointer, of a cursor, and in the table of peaks: of levels in dB, which are negative here."""
    page.goto(f"{page.url.partition('?')[0]}analysis?sample=damaged_tooth&view=Order%20spectrum&amplitude=dB")
    figure = page.locator(".st-key-view .figure").first
    figure.locator("svg").wait_for()
    settle(page)
    for tool in ("Peaks", "Cursor"):
        figure.get_by_role("button", name=tool).click()
    box = figure.locator("svg").bounding_box()
    page.mouse.click(box["x"] + 0.3 * box["width"], box["y"] + 0.6 * box["height"])
    said = figure.locator(".words").inner_text() + figure.locator(".tip").inner_text()
    said += figure.locator(".peaks").inner_text()
    assert "−" in said
    assert re.search(r"\border \d", said)
    assert not re.search(r"(?<![\w^])-\d", said)


def test_the_lines_of_a_run_up_lie_on_the_rays_drawn_over_them(page: playwright.Page) -> None:
    """In the map over frequency and speed: the strongest place of the upper half lies on the ray of the mesh."""
    page.goto(f"{page.url.partition('?')[0]}analysis?sample=run_up&view=Map&lines=Frequency&along=Speed")
    figure = page.locator(".st-key-view .figure svg").first
    figure.locator("image").wait_for()
    settle(page)
    image, ray = figure.locator("image"), figure.locator("path").first
    apart_px = image.evaluate(DISTANCE_OF_RIDGE, ray.element_handle())
    assert max(apart_px) < 8.0, apart_px


DISTANCE_OF_RIDGE = """async (image, ray) => {
  const bitmap = await createImageBitmap(await (await fetch(image.getAttribute('href'))).blob());
  const canvas = new OffscreenCanvas(bitmap.width, bitmap.height), context = canvas.getContext('2d');
  context.drawImage(bitmap, 0, 0);
  const at = (name) => Number(image.getAttribute(name)), points = [];
  for (let s = 0; s <= ray.getTotalLength(); s += 0.5) points.push(ray.getPointAtLength(s));
  return [0.55, 0.7, 0.85].map((share) => {
    const y = at('y') + (1 - share) * at('height');
    const on = points.reduce((a, b) => (Math.abs(a.y - y) < Math.abs(b.y - y) ? a : b));
    const middle = ((on.x - at('x')) / at('width')) * bitmap.width, reach = Math.round(bitmap.width / 20);
    const row = context.getImageData(0, Math.floor((1 - share) * bitmap.height), bitmap.width, 1).data;
    let best = 0, darkest = Infinity;
    for (let k = Math.max(0, Math.round(middle) - reach); k < middle + reach && k < bitmap.width; k++) {
      const light = row[4 * k] + row[4 * k + 1] + row[4 * k + 2];
      if (light < darkest) [darkest, best] = [light, k];
    }
    return Math.abs(best + 0.5 - middle) * at('width') / bitmap.width;
  });
}"""


@pytest.mark.study
def test_the_chosen_mode_goes_on_to_the_squeezed_transform(page: playwright.Page) -> None:
    open_analysis(page)
    panel = open_method(page, "Modes")
    panel.get_by_text("is the most impulsive").first.wait_for()
    panel.get_by_role("combobox", name="The chosen mode goes on to").click()
    page.get_by_role("option", name="Squeezed wavelet").click()
    settle(page)
    panel.locator(".figure svg image").first.wait_for()
    panel.get_by_text("Segment and further settings").click()
    panel.get_by_text("Colour range").first.wait_for()


@pytest.mark.study
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
