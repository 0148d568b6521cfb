"""Take the README's pictures of the dashboard, and say how long each took: `python sample_data/make_screens.py`.

It starts the dashboard of this checkout and drives Chromium by Playwright. Seconds are those of the clock, from the
click until the page stands still, and those that the server worked, which do not tell of other work on the machine.
"""

from __future__ import annotations

import os
import shutil
import socket
import subprocess
import sys
import time
import urllib.request
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from playwright.sync_api import Page, sync_playwright

from gearsig.recording import Channel, Recording, write_recording

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


class Clock:
    """Tells what an interaction took since the last call of `start`."""

    def __init__(self, page: Page, server: int) -> None:
        self._page, self._server = page, server
        self.start()

    def start(self) -> None:
        """Begin here."""
        self._begun, self._worked = time.monotonic(), processor_s(self._server)

    def tell(self, what: str, *, settled: bool = True) -> None:
        """Print the row of a table, once the page stands still."""
        if settled:
            settle(self._page)
        seconds, worked = time.monotonic() - self._begun, processor_s(self._server) - self._worked
        print(f"| {what} | {seconds:.1f} | {worked:.2f} |", flush=True)  # noqa: T201 - a script


def processor_s(server: int) -> float:
    """Return the processor time of the server and of the processes that it waited for; nan where there is no /proc."""
    stat = Path(f"/proc/{server}/stat")
    if not stat.exists():
        return float("nan")
    return sum(map(int, stat.read_text().rpartition(")")[2].split()[11:15])) / os.sysconf("SC_CLK_TCK")


def take(page: Page, clock: Clock) -> None:
    """Go through the pages as a first-time user would."""
    page.get_by_role("button", name="Open the recording").wait_for()
    clock.tell("start page, from its address")
    page.screenshot(path=PICTURES / "start.png")
    clock.start()
    page.get_by_role("button", name="Open the recording").click()
    page.locator(".st-key-verdict img").wait_for()
    clock.tell("one click to the verdict with its picture, first analysis of the server")
    page.locator(".strip").wait_for()
    settle(page)
    page.screenshot(path=PICTURES / "dashboard.png")
    for view in ("Order spectrum", "Map", "Envelope", "Machine"):
        clock.start()
        page.locator(".strip button").filter(has_text=view).first.click()
        page.locator(".strip button[aria-pressed=true]").filter(has_text=view).wait_for()
        clock.tell(f"view {view}")
    clock.start()
    page.get_by_role("link", name="Fault laboratory").click()
    page.get_by_role("tab", name="Gears").wait_for(timeout=300_000)
    clock.tell("fault laboratory, first run of the server")
    pull(page, clock)
    clock.start()
    page.get_by_role("link", name="Comparison").click()
    page.get_by_role("tab", name="Orders").wait_for()
    clock.tell("comparison, with a simulation of five seconds")
    flexible_and_fleet(page, clock)
    page.get_by_role("link", name="Gap").click()
    settle(page)
    clock.start()
    page.get_by_role("button", name="Diagnose").click()
    page.get_by_role("tab", name="How far").wait_for(timeout=600_000)
    clock.tell("gap of two samples, nothing kept of the rig")
    page.set_viewport_size({"width": 1280, "height": 1040})
    page.mouse.move(0, 0)  # a button under the pointer looks otherwise
    settle(page)
    page.screenshot(path=PICTURES / "gap.png")
    with TemporaryDirectory() as folder:
        long_recording(page, clock, Path(folder))


def flexible_and_fleet(page: Page, clock: Clock) -> None:
    """Look at one gear, at a pair, and at the fleet's example."""
    clock.start()
    page.get_by_role("link", name="Flexible gears").click()
    page.locator(".solid").first.wait_for()
    clock.tell("flexible gear: mesh, modes and stress")
    clock.start()
    page.get_by_text("Pair", exact=True).click()
    page.locator(".figure svg").first.wait_for(timeout=600_000)
    clock.tell("flexible pair: both sweeps and all maps")
    clock.start()
    page.get_by_text("Mesh stiffness", exact=True).click()
    clock.tell("its view *Mesh stiffness*")
    clock.start()
    page.get_by_role("link", name="Fleet").click()
    page.get_by_role("button", name="See an example").wait_for()
    clock.tell("fleet, empty")
    clock.start()
    page.get_by_role("button", name="See an example").click()
    page.locator(".figure svg").first.wait_for()
    clock.tell("its example, analysed at first")


N_LONG, RATE_HZ = 2**20, 25600.0


def long_recording(page: Page, clock: Clock, folder: Path) -> None:
    """Open a million samples, zoom into a thousandth of them, and move the pointer over what is shown."""
    time_s = np.arange(N_LONG) / RATE_HZ
    tones = sum(np.sin(2 * np.pi * order * 24.3 * time_s) / order for order in (1, 29, 58, 87))
    samples = tones + 0.1 * np.random.default_rng(1).standard_normal(N_LONG)
    file = folder / "million.h5"
    write_recording(Recording(samples[None], RATE_HZ, (Channel("a1", "acceleration", "m/s^2"),)), file)
    page.get_by_role("link", name="Analysis").click()
    page.get_by_text("Your file", exact=True).click()
    settle(page)
    clock.start()
    page.locator("input[type=file]").first.set_input_files(file)
    page.get_by_text("million.h5").first.wait_for()
    page.locator(".strip").wait_for()
    clock.tell("a million samples, to the verdict")
    clock.start()
    page.locator(".strip button").filter(has_text="Waveform").first.click()
    page.locator(".strip button[aria-pressed=true]").filter(has_text="Waveform").wait_for()
    clock.tell("their view *Waveform*")
    figure = page.locator(".figure svg").last
    figure.scroll_into_view_if_needed()
    box = figure.bounding_box()
    assert box is not None  # noqa: S101 - a script
    left, y = box["x"] + 0.5 * box["width"], box["y"] + 0.5 * box["height"]
    for part in ("a thirtieth", "a thousandth"):
        clock.start()
        page.mouse.move(left, y)
        page.mouse.down()
        page.mouse.move(left + box["width"] / 30, y, steps=4)
        page.mouse.up()
        clock.tell(f"zoom into {part} of them")
    page.evaluate(FRAMES)
    for i in range(100):
        page.mouse.move(left - 200 + 4 * i, y)
    worst = page.evaluate("window.frames_ms.sort((a, b) => b - a)[4]")
    print(f"pointer over them: 95 of 100 frames within {worst:.0f} ms")  # noqa: T201 - a script


FRAMES = """() => {
  window.frames_ms = [];
  let last = performance.now();
  const frame = (now) => {
    window.frames_ms.push(now - last);
    last = now;
    if (window.frames_ms.length < 100) requestAnimationFrame(frame);
  };
  requestAnimationFrame(frame);
}"""


def pull(page: Page, clock: Clock) -> None:
    """Pull the crack's slider by a step, and from end to end as a key that is held does."""
    slider = page.get_by_role("slider", name="Crack in a tooth root")
    slider.focus()
    for n_steps, depth in ((1, 0.02), (99, 2)):
        clock.start()
        for _ in range(n_steps):
            page.keyboard.press("ArrowRight")
        page.get_by_role("heading", name=f"Crack in a tooth root, {depth} mm", exact=True).wait_for()
        steps = "one step of a slider" if n_steps == 1 else f"{n_steps} steps of a slider at once"
        clock.tell(f"{steps} of the laboratory, to the preview", settled=False)
        page.get_by_text("Preview of").wait_for(state="hidden")
        clock.tell("the same, to the whole recording")
    page.screenshot(path=PICTURES / "laboratory.png")


def main() -> None:
    """Start the dashboard, take the pictures, stop it."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    command = [sys.executable, "-m", "app.cli.main", "dashboard", "--port", str(port), "--no-browser"]
    # An empty cache: what runs before have kept would be taken for speed.
    with (
        TemporaryDirectory(ignore_cleanup_errors=True) as cache,
        subprocess.Popen(
            command,
            env={**os.environ, "GEARSIG_CACHE": cache},
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        ) as server,
    ):
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
                take(page, Clock(page, server.pid))
                browser.close()
        finally:
            server.terminate()


if __name__ == "__main__":
    main()
