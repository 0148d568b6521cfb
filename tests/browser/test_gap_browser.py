"""The gap page in a real browser, with a diagnosis that answers without arithmetic: run, stop, look, download."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from app.samples import sample_folder
from tests.browser.conftest import CHROMIUM, dashboard, settle
from tests.gap.example_report import effect_report
from tests.gap.stub_diagnosis import ALL_CURVES, SECONDS, environment

pytestmark = [
    pytest.mark.browser,
    pytest.mark.skipif(CHROMIUM is None, reason="there is no Chromium on this machine"),
]
playwright = pytest.importorskip("playwright.sync_api")

TABS = ("Where", "Which", "How far", "Next and facts")


@pytest.fixture(scope="module")
def address(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """Start a dashboard whose processes answer at once."""
    with pytest.MonkeyPatch.context() as patch:
        for name, value in environment(tmp_path_factory.mktemp("site"), **{SECONDS: "4", ALL_CURVES: "1"}).items():
            patch.setenv(name, value)
        with dashboard(tmp_path_factory.mktemp("home")) as address:
            yield address


@pytest.fixture
def gap(page: playwright.Page) -> playwright.Page:
    page.set_default_timeout(60_000)
    page.get_by_role("link", name="Gap").click()
    page.get_by_role("heading", name="Gap between simulation and recording").first.wait_for()
    settle(page)
    return page


def button(page: playwright.Page, name: str) -> playwright.Locator:
    return page.get_by_role("button", name=name, exact=False).first


def test_run_look_and_download(gap: playwright.Page, tmp_path: Path) -> None:
    button(gap, "Diagnose").click()
    gap.get_by_role("progressbar").first.wait_for()
    gap.get_by_text(re.compile(r"… \d+\s+s$")).wait_for()
    gap.get_by_role("tab", name="Which").first.wait_for()
    for tab in TABS:
        gap.get_by_role("tab", name=tab).click()
        settle(gap)
    gap.get_by_role("tab", name="Where").click()
    settle(gap)
    # Three panels; two averages; two spectra against the reference and two against the simulation, each with its gap;
    # two rings.
    playwright.expect(gap.locator(".figure")).to_have_count(13, timeout=60_000)
    playwright.expect(gap.locator(".picture img")).to_have_count(1)  # of the shaft that the gap names
    with gap.expect_download() as waiting:
        button(gap, "Report (HTML)").click()
    waiting.value.save_as(tmp_path / "gap.html")
    assert effect_report().causes[0].title in (tmp_path / "gap.html").read_text()
    with gap.expect_download() as waiting:
        button(gap, "JSON").click()
    waiting.value.save_as(tmp_path / "gap.json")
    assert json.loads((tmp_path / "gap.json").read_text())["schema"] == "gearsig.gap"


def test_bars_and_rings_are_read_off_and_zoomed(gap: playwright.Page, tmp_path: Path) -> None:
    button(gap, "Diagnose").click()
    gap.get_by_role("tab", name="Which").first.wait_for()
    settle(gap)
    report = effect_report()
    panels = gap.locator(".st-key-gap-panels .figure")
    playwright.expect(panels).to_have_count(3, timeout=60_000)
    assert len({place(panel)[1] for panel in panels.all()}) == 1
    gap.set_viewport_size({"width": 800, "height": 1600})
    settle(gap)
    assert len({place(panel)[0] for panel in panels.all()}) == 1  # below each other
    gap.set_viewport_size({"width": 1280, "height": 1600})
    settle(gap)
    which = panels.nth(1)
    assert tip_at(gap, which, 0.3, 0.1).startswith(report.causes[0].title)
    with gap.expect_download() as waiting:
        which.get_by_role("button", name="CSV").click()
    waiting.value.save_as(tmp_path / "which.csv")
    rows = (tmp_path / "which.csv").read_text().splitlines()
    assert rows[1].startswith(f'"{report.causes[0].title}",0,{100 * report.causes[0].probability:g}')

    gap.get_by_role("tab", name="Which").click()
    settle(gap)
    evidence = report.causes[0].evidence[0]
    chart = gap.locator("[role=tabpanel] .figure").first
    said = tip_at(gap, chart, 0.6, 0.1)
    assert said.splitlines() == [
        evidence.feature,
        f"observed: {evidence.observed_db:g} dB",
        f"predicted: {evidence.predicted_db:g} dB",
        f"structural floor: ±{evidence.floor_db:g} dB",
    ]
    ticks = chart.locator("svg > text").all_text_contents()
    box = chart.locator("svg").bounding_box()
    gap.mouse.move(box["x"] + 0.6 * box["width"], box["y"] + 40)
    gap.mouse.down()
    gap.mouse.move(box["x"] + 0.7 * box["width"], box["y"] + 40, steps=4)
    gap.mouse.up()
    settle(gap)
    assert chart.locator("svg > text").all_text_contents() != ticks

    gap.get_by_role("tab", name="Where").click()
    settle(gap)
    said = tip_at(gap, gap.locator(".picture").first, 0.7, 0.4)
    assert ": measured " in said
    assert "dB, simulated " in said


def place(figure: playwright.Locator) -> tuple[int, int]:
    box = figure.bounding_box()
    return round(box["x"]), round(box["y"])


def tip_at(page: playwright.Page, figure: playwright.Locator, across: float, down: float) -> str:
    """Return what is read off a figure, at shares of its width and height."""
    figure.scroll_into_view_if_needed()
    box = figure.locator("svg, img").first.bounding_box()
    page.mouse.move(box["x"] + across * box["width"], box["y"] + down * box["height"])
    figure.locator(".tip").wait_for()
    return str(figure.locator(".tip").inner_text())


def test_stop_and_start_again(gap: playwright.Page) -> None:
    button(gap, "Diagnose").click()
    gap.get_by_role("progressbar").first.wait_for()
    button(gap, "Stop").click()
    gap.get_by_text("Stopped.").first.wait_for()
    button(gap, "Diagnose").click()
    gap.get_by_role("tab", name="Which").first.wait_for()


def test_own_files_stay_while_another_page_is_shown(gap: playwright.Page) -> None:
    folder = sample_folder()
    gap.get_by_text("Your files", exact=True).click()
    settle(gap)
    inputs = gap.locator("input[type=file]")
    inputs.nth(0).set_input_files([folder / "root_crack_1mm.h5", folder / "root_crack_3mm.h5"])
    settle(gap)
    inputs.nth(1).set_input_files([folder / "root_crack_3mm.toml", folder / "root_crack_1mm.toml"])
    settle(gap)
    gap.get_by_role("link", name="Analysis").click()
    gap.locator(".strip").first.wait_for()
    gap.get_by_role("link", name="Gap").click()
    gap.get_by_text("Still open: root_crack_1mm.h5, root_crack_3mm.h5").first.wait_for()
    settle(gap)
    button(gap, "Diagnose").click()
    gap.get_by_role("tab", name="Which").first.wait_for()
