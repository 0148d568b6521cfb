"""The gap page in a real browser, with a diagnosis that answers without arithmetic: run, stop, look, download."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import pytest

from app.samples import sample_folder
from tests.browser.conftest import CHROMIUM, settle
from tests.gap.example_report import effect_report
from tests.gap.stub_diagnosis import ALL_CURVES, SECONDS, environment

pytestmark = [
    pytest.mark.browser,
    pytest.mark.skipif(CHROMIUM is None, reason="there is no Chromium on this machine"),
]
playwright = pytest.importorskip("playwright.sync_api")

TABS = ("Where", "Which", "How far", "Next and facts")


@pytest.fixture(scope="module")
def stubbed(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Let the processes of this module's server answer at once."""
    with pytest.MonkeyPatch.context() as patch:
        for name, value in environment(tmp_path_factory.mktemp("site"), **{SECONDS: "4", ALL_CURVES: "1"}).items():
            patch.setenv(name, value)
        yield


@pytest.fixture(scope="module")
def address(stubbed: None, address: str) -> str:
    """Start the dashboard with the stub in force."""
    del stubbed
    return address


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
    gap.get_by_role("tab", name="Which").first.wait_for()
    for tab in TABS:
        gap.get_by_role("tab", name=tab).click()
        settle(gap)
    gap.get_by_role("tab", name="Where").click()
    settle(gap)
    # Two averages; two spectra against the reference and two against the simulation, each with its gap; two rings.
    playwright.expect(gap.locator(".figure")).to_have_count(10, timeout=60_000)
    playwright.expect(gap.locator(".picture img")).to_have_count(2)
    with gap.expect_download() as waiting:
        button(gap, "Report (HTML)").click()
    waiting.value.save_as(tmp_path / "gap.html")
    assert effect_report().causes[0].title in (tmp_path / "gap.html").read_text()
    with gap.expect_download() as waiting:
        button(gap, "JSON").click()
    waiting.value.save_as(tmp_path / "gap.json")
    assert json.loads((tmp_path / "gap.json").read_text())["schema"] == "gearsig.gap"


def test_stop_and_start_again(gap: playwright.Page) -> None:
    button(gap, "Diagnose").click()
    gap.get_by_role("progressbar").first.wait_for()
    button(gap, "Stop").click()
    gap.get_by_text("Stopped.").first.wait_for()
    button(gap, "Diagnose").click()
    gap.get_by_role("tab", name="Which").first.wait_for()


def test_own_files_stay_while_another_page_is_shown(gap: playwright.Page) -> None:
    folder = sample_folder()
    gap.get_by_text("Own files", exact=True).click()
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
