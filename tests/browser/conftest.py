"""A dashboard of one's own and a browser that shows it, for the tests of this folder."""

from __future__ import annotations

import shutil
import socket
import subprocess
import sys
import time
import urllib.error
import urllib.request
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

playwright = pytest.importorskip("playwright.sync_api")

CHROMIUM = next((path for name in ("chromium", "chromium-browser") if (path := shutil.which(name))), None)
FLAGS = [
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
]


OPEN = """
[theme]
base = "http://127.0.0.1:9/theme.toml"
[server]
baseUrlPath = "elsewhere"
address = "0.0.0.0"
enableCORS = false
enableXsrfProtection = false
corsAllowedOrigins = ["http://evil.example"]
allowedHosts = ["*"]
"""


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Run a failed test of this folder once more: a server, a browser and the machine's load share one clock here."""
    for item in items:
        if item.path.parent == Path(__file__).parent:
            item.add_marker(pytest.mark.flaky(reruns=1))


@pytest.fixture(scope="session")
def address(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """Start a dashboard, one for all tests of a process: imports and analyses of samples are made once."""
    folder = tmp_path_factory.mktemp("home")
    with dashboard(folder) as address:
        yield address
    assert not list(folder.glob("*.ran")), "the start folder's secrets became variables"


@contextmanager
def dashboard(folder: Path) -> Iterator[str]:
    """Run `gearsig dashboard` on a free port, in a folder whose configuration would open it to everybody."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    (folder / ".streamlit").mkdir()
    (folder / ".streamlit" / "config.toml").write_text(OPEN)
    (folder / "effect.py").write_text("from pathlib import Path; Path(__file__).with_suffix('.ran').touch()")
    (folder / ".streamlit" / "secrets.toml").write_text(f"GEARSIG_EFFECTS = {str(folder / 'effect.py')!r}")
    command = [sys.executable, "-m", "app.cli.main", "dashboard", "--port", str(port), "--no-browser"]
    log = (folder / "log.txt").open("w+")
    server = subprocess.Popen(command, cwd=folder, stdout=log, stderr=log)
    try:
        wait_until_up(f"http://localhost:{port}/_stcore/health", server)
        yield f"http://localhost:{port}/"
    finally:
        server.terminate()
        server.wait(60)
        log.close()


def wait_until_up(health: str, server: subprocess.Popen[bytes]) -> None:
    for _ in range(600):
        assert server.poll() is None, "the server stopped"
        try:
            with urllib.request.urlopen(health, timeout=1):  # noqa: S310 - http on localhost
                return
        except (urllib.error.URLError, OSError):
            time.sleep(0.1)
    pytest.fail("the server does not answer")


@pytest.fixture(scope="session")
def browser() -> Iterator[playwright.Browser]:
    with playwright.sync_playwright() as driver:
        chromium = driver.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
        yield chromium
        chromium.close()


@pytest.fixture(scope="session")
def window(browser: playwright.Browser) -> Iterator[playwright.BrowserContext]:
    """Open a window for all tests, each in a tab of its own: scripts of the page are fetched and compiled once."""
    with browser.new_context(viewport={"width": 1280, "height": 1600}) as window:
        yield window


@pytest.fixture
def blank(window: playwright.BrowserContext) -> Iterator[playwright.Page]:
    """Open an empty tab; afterwards nothing may have gone wrong in it, nor left this machine."""
    view = window.new_page()
    view.set_default_timeout(90_000)  # the first analysis compiles
    wrong: list[str] = []
    view.on("pageerror", lambda error: wrong.append(str(error)))
    view.on("console", lambda message: wrong.append(message.text) if is_error(message) else None)
    view.on("request", lambda request: None if is_local(request.url) else wrong.append(request.url))
    yield view
    exceptions = view.get_by_test_id("stException").all_inner_texts()
    broken = view.evaluate("[...document.images].filter(i => i.complete && !i.naturalWidth).map(i => i.src)")
    view.close()
    assert not exceptions
    assert not broken
    assert not wrong


@pytest.fixture
def page(blank: playwright.Page, address: str) -> playwright.Page:
    """Open the dashboard's start page."""
    blank.goto(address)
    blank.get_by_role("button", name="Open the recording").first.wait_for()
    return blank


def is_error(message: playwright.ConsoleMessage) -> bool:
    """Say whether a message tells of an error; a picture that a rerun replaced before it was fetched is none.

    Streamlit drops the old picture at once. Those that stay on the page are looked at in the end.
    """
    url = message.location.get("url", "")
    replaced = "/media/" in message.text or "/media/" in url
    return bool(message.type == "error" and not replaced)


def is_local(url: str) -> bool:
    return url.startswith(("http://localhost:", "ws://localhost:", "data:", "blob:"))


def open_view(page: playwright.Page, name: str) -> playwright.Locator:
    """Open a view of the strip, and return what it shows."""
    page.locator(".strip button").filter(has_text=name).first.click()
    page.locator(".strip button[aria-pressed=true]").filter(has_text=name).first.wait_for()
    settle(page)
    return page.locator(".st-key-view")


def settle(page: playwright.Page) -> None:
    """Wait until the script has run, and has not started again a moment later: a click takes a while to reach it."""
    idle = """() => document.querySelector('[data-testid=stApp]')?.dataset.testScriptState === 'notRunning'
        && !document.querySelector('[data-testid=stSpinner], [data-stale=true]')"""
    for _ in range(2):
        page.wait_for_timeout(250)
        page.wait_for_function(idle)


def soon(page: playwright.Page, is_so: Callable[[], bool]) -> bool:
    """Wait up to a minute until something is so."""
    for _ in range(300):
        if is_so():
            return True
        page.wait_for_timeout(200)
    return False
