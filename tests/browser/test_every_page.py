"""Every page in a real browser: in a narrow window, light and dark, empty, with a broken file, with two users."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from urllib.parse import unquote

import pytest

from gearsig.diagnosis import Outcome
from gearsig.indicators import Indicator
from gearsig.report import Entry, write_index
from tests.browser.conftest import CHROMIUM, settle, soon

PAGES = ("", "analysis?sample=damaged_tooth", "laboratory", "flexible", "compare", "gap", "fleet")
BROKEN = {"name": "broken.mat", "mimeType": "", "buffer": b"\x80\x04\x95 pickle"}

pytestmark = [
    pytest.mark.browser,
    pytest.mark.skipif(CHROMIUM is None, reason="there is no Chromium on this machine"),
]
playwright = pytest.importorskip("playwright.sync_api")


@pytest.fixture
def page(blank: playwright.Page) -> playwright.Page:
    """Leave the start page out: each test opens a page by its address."""
    return blank


def opened(page: playwright.Page, address: str) -> str:
    page.goto(address)
    page.get_by_test_id("stMain").wait_for()
    settle(page)
    text = page.get_by_test_id("stMain").inner_text()
    assert isinstance(text, str)
    return text


@pytest.mark.parametrize("path", [*PAGES, "analysis?sample=two_stage&view=Machine"])
def test_a_page_fits_a_narrow_window_in_light_and_dark(page: playwright.Page, address: str, path: str) -> None:
    page.set_viewport_size({"width": 800, "height": 900})
    for scheme in ("light", "dark"):
        page.emulate_media(color_scheme=scheme)
        assert len(opened(page, address + path)) > 100
        assert page.evaluate("document.documentElement.scrollWidth") <= 800
        paper = page.evaluate("getComputedStyle(document.querySelector('[data-testid=stApp]')).backgroundColor")
        lightness = sum(map(float, paper.removeprefix("rgb(").removesuffix(")").split(",")[:3])) / (3 * 255)
        assert (lightness > 0.8) == (scheme == "light")


@pytest.mark.parametrize("sample", ["damaged_tooth", "outer_race", "run_up"])
def test_verdict_picture_and_the_strip_of_views_are_on_a_narrow_first_screen(
    page: playwright.Page, address: str, sample: str
) -> None:
    page.set_viewport_size({"width": 800, "height": 900})
    opened(page, f"{address}analysis?sample={sample}")
    places = [".st-key-verdict h3", ".st-key-verdict :is(.picture, .figure)", ".strip button"]
    boxes = [page.locator(place).first.bounding_box() for place in places]
    assert [box["y"] for box in boxes] == sorted(box["y"] for box in boxes)
    assert boxes[-1]["y"] + boxes[-1]["height"] <= 900


@pytest.mark.parametrize("path", ["compare", "gap"])
def test_a_broken_file_is_one_message_on_the_other_pages(page: playwright.Page, address: str, path: str) -> None:
    opened(page, address + path)
    page.get_by_text("Your file").first.click()
    settle(page)
    page.locator("[data-testid=stFileUploader] input[type=file]").first.set_input_files(BROKEN)
    settle(page)
    if path == "gap":
        page.get_by_role("button", name="Diagnose").click()
    message = page.get_by_test_id("stAlert").filter(has_text="broken.mat").first
    message.wait_for()
    assert "Traceback" not in page.get_by_test_id("stMain").inner_text()


@pytest.mark.parametrize("path", ["compare", "fleet"])
def test_two_users_at_once_see_the_same_page_each(page: playwright.Page, address: str, path: str) -> None:
    other = page.context.browser.new_context().new_page()
    other.goto(address + path)
    mine = opened(page, address + path)
    other.get_by_test_id("stMain").wait_for()
    settle(other)
    assert len(other.get_by_test_id("stMain").inner_text()) > 0.8 * len(mine) > 80
    assert other.get_by_test_id("stException").count() == 0
    other.context.close()


def part_shown(picture: playwright.Locator) -> list[float]:
    """Return left, top, width and height of what a picture shows."""
    box = re.search(r'viewBox="([^"]*)"', unquote(picture.get_attribute("src")))
    assert box is not None
    return [float(number) for number in box[1].split()]


def test_the_ring_of_teeth_zooms_is_read_off_and_sent_as_an_address(page: playwright.Page, address: str) -> None:
    opened(page, address + "analysis?sample=damaged_tooth")
    ring = page.locator(".st-key-verdict .picture .frame")
    ring.scroll_into_view_if_needed()
    box, shown = ring.bounding_box(), ring.locator("img")
    whole = part_shown(shown)
    page.mouse.move(box["x"] + 0.55 * box["width"], box["y"] + 0.55 * box["height"])
    page.get_by_text("tooth 1").first.wait_for()  # the tip
    page.mouse.down()
    page.mouse.move(box["x"] + 0.9 * box["width"], box["y"] + 0.9 * box["height"], steps=4)
    page.mouse.up()
    page.wait_for_function("location.search.includes('zoom=')")
    settle(page)
    near = part_shown(shown)
    assert near[2] < 0.5 * whole[2]
    opened(page, page.url)
    assert part_shown(shown) == pytest.approx(near, rel=1e-5)
    ring.focus()
    page.keyboard.press("0")
    page.wait_for_function("!location.search.includes('zoom=')")
    assert part_shown(shown) == whole


def test_back_undoes_the_zoom_of_the_ring_of_teeth(page: playwright.Page, address: str) -> None:
    opened(page, address + "analysis?sample=damaged_tooth")
    ring = page.locator(".st-key-verdict .picture .frame")
    ring.scroll_into_view_if_needed()
    box, shown = ring.bounding_box(), ring.locator("img")
    views = [part_shown(shown)]
    for share in (0.8, 0.5):
        page.mouse.move(box["x"] + 0.1 * box["width"], box["y"] + 0.1 * box["height"])
        page.mouse.down()
        page.mouse.move(box["x"] + share * box["width"], box["y"] + share * box["height"], steps=4)
        page.mouse.up()
        page.wait_for_function(f"location.search !== {page.evaluate('location.search')!r}")
        settle(page)
        views.append(part_shown(shown))
    assert views[2][2] < views[1][2] < views[0][2]
    for view in (views[1], views[0]):
        page.go_back()
        assert soon(page, lambda view=view: part_shown(shown) == pytest.approx(view, rel=1e-5))
    page.go_forward()
    assert soon(page, lambda: part_shown(shown) == pytest.approx(views[1], rel=1e-5))


def test_back_undoes_the_zoom_of_a_phase_plane(page: playwright.Page, address: str) -> None:
    opened(page, address + "analysis?sample=damaged_tooth&view=Phase")
    figure = page.locator(".st-key-view .figure svg").first
    figure.scroll_into_view_if_needed()
    paths = "svg => [...svg.querySelectorAll('path')].map(path => path.getAttribute('d')).join()"
    whole = figure.evaluate(paths)
    box = figure.bounding_box()
    page.mouse.move(box["x"] + 0.4 * box["width"], box["y"] + 0.3 * box["height"])
    page.mouse.down()
    page.mouse.move(box["x"] + 0.7 * box["width"], box["y"] + 0.6 * box["height"], steps=4)
    page.mouse.up()
    page.wait_for_function("location.search.includes('zoom=')")
    settle(page)
    assert figure.evaluate(paths) != whole
    page.go_back()
    assert soon(page, lambda: figure.evaluate(paths) == whole)
    page.go_forward()
    assert soon(page, lambda: figure.evaluate(paths) != whole)


def test_a_page_of_the_navigation_bar_is_one_step_of_the_history(page: playwright.Page, address: str) -> None:
    opened(page, address)
    begun, n_entries = page.url, page.evaluate("history.length")
    for n, name in enumerate(("Analysis", "Comparison"), 1):
        page.get_by_role("link", name=name).click()
        page.wait_for_function("location.search.includes('sample=')" if n == 1 else "location.pathname == '/compare'")
        settle(page)
        assert page.evaluate("history.length") == n_entries + n
    page.go_back()
    page.locator(".strip").first.wait_for()
    settle(page)
    page.go_back()
    page.get_by_role("button", name="Open the recording").first.wait_for()
    assert page.url == begun


def test_an_index_of_recordings_with_dates_fits_a_narrow_window(browser: playwright.Browser, tmp_path: Path) -> None:
    kinds = {"overall velocity": "mm/s", "FM4": "", "sideband index": "m/s^2"}
    indicators = tuple(Indicator(name, 3.21, unit, "a1") for name, unit in kinds.items())
    names = ("gearbox_north_2026-11-28.csv.gz", "gearbox_south_2026-11-27.csv.gz")
    entries = [Entry(name, "a.html", Outcome.FAULT, "", "A verdict of a few words.", 0.93, 41.2) for name in names]
    machines = ("Workshop gearbox, outer-race defect", 200 * "W")
    filled = [replace(e, indicators=indicators, machine=m) for e, m in zip(entries, machines, strict=True)]
    write_index(filled, path=tmp_path / "index.html")
    assert "2026-11-28</td>" in (tmp_path / "index.html").read_text("utf-8")
    view = browser.new_page(viewport={"width": 800, "height": 900})
    view.goto((tmp_path / "index.html").as_uri())
    widths = "[...document.querySelectorAll('html, .scroll')].map(e => e.scrollWidth - e.clientWidth)"
    assert set(view.evaluate(widths)) == {0}
    view.close()
