"""Take the README's pictures of the dashboard, and say how long each took: `python sample_data/make_screens.py`.

It starts the dashboard of this checkout and drives Chromium by Playwright.
"""

from __future__ import annotations

import shutil
import socket
import subprocess
import sys
import time
import urllib.request
from collections.abc import Callable
from pathlib import Path

from playwright.sync_api import Page, sync_playwright

PICTURES = Path(__file__).parent / "pictures"
FLAGS = ["--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-background-networking"]
SETTLED = (
    "!document.querySelector('[data-testid=stStatusWidget], [data-testid=stSpinner], [data-testid=stSkeleton]')"
    " && !document.querySelector('[data-stale=true]')"
)


def settle(page: Page) -> None:
    """Wait until the page shows its results."""
    page.wait_for_timeout(300)
    page.wait_for_function(SETTLED)


def take(page: Page) -> None:
    """Go through the pages as a first-time user would."""
    begun = time.monotonic()

    def tell(what: str) -> None:
        nonlocal begun
        settle(page)
        print(f"| {what} | {time.monotonic() - begun:.1f} |")  # noqa: T201 - a script
        begun = time.monotonic()

    page.get_by_role("button", name="Open the recording").wait_for()
    tell("start page, from its address")
    page.screenshot(path=PICTURES / "start.png")
    begun = time.monotonic()
    page.get_by_role("button", name="Open the recording").click()
    page.locator(".st-key-verdict img").wait_for()
    tell("one click to the verdict with its picture, first analysis of the server")
    page.locator(".strip").wait_for()
    settle(page)
    page.screenshot(path=PICTURES / "dashboard.png")
    for view in ("Order spectrum", "Map", "Envelope", "Machine"):
        begun = time.monotonic()
        page.locator(".strip button").filter(has_text=view).first.click()
        page.locator(".strip button[aria-pressed=true]").filter(has_text=view).wait_for()
        tell(f"view {view}")
    page.get_by_role("link", name="Fault laboratory").click()
    begun = time.monotonic()
    page.get_by_role("tab", name="Gears").wait_for(timeout=300_000)
    tell("fault laboratory, first run of the server")
    pull(page, tell)
    page.get_by_role("link", name="Comparison").click()
    begun = time.monotonic()
    page.get_by_role("tab", name="Orders").wait_for()
    tell("comparison, with a simulation of five seconds")
    page.get_by_role("link", name="Gap").click()
    page.get_by_role("button", name="Diagnose").click()
    begun = time.monotonic()
    page.get_by_role("tab", name="How far").wait_for(timeout=600_000)
    tell("gap of two samples, nothing kept of the rig")


def pull(page: Page, tell: Callable[[str], None]) -> None:
    """Pull the crack's slider by a step, and from end to end as a key that is held does."""
    slider = page.get_by_role("slider", name="Crack in a tooth root")
    slider.focus()
    for n_steps, depth in ((1, 0.02), (99, 2)):
        for _ in range(n_steps):
            page.keyboard.press("ArrowRight")
        begun = time.monotonic()
        page.get_by_role("heading", name=f"Crack in a tooth root, {depth} mm", exact=True).wait_for()
        steps = "one step of a slider" if n_steps == 1 else f"{n_steps} steps of a slider at once"
        print(f"| {steps} of the laboratory, to the preview | {time.monotonic() - begun:.1f} |")  # noqa: T201
        page.get_by_text("Preview of").wait_for(state="hidden")
        settle(page)
        print(f"| the same, to the whole recording | {time.monotonic() - begun:.1f} |")  # noqa: T201
    tell("both")
    page.screenshot(path=PICTURES / "laboratory.png")


def main() -> None:
    """Start the dashboard, take the pictures, stop it."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    command = [sys.executable, "-m", "app.cli.main", "dashboard", "--port", str(port), "--no-browser"]
    with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as server:
        try:
            for _ in range(600):
                try:
                    urllib.request.urlopen(f"http://localhost:{port}/_stcore/health", timeout=1).close()
                    break
                except OSError:
                    time.sleep(0.2)
            with sync_playwright() as driver:
                browser = driver.chromium.launch(executable_path=shutil.which("chromium"), args=FLAGS)
                page = browser.new_page(viewport={"width": 1440, "height": 900})
                page.set_default_timeout(180_000)
                page.goto(f"http://localhost:{port}/")
                take(page)
                browser.close()
        finally:
            server.terminate()


if __name__ == "__main__":
    main()
