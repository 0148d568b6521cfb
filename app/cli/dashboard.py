"""`gearsig dashboard`: the Streamlit app on this machine."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated, Any, NoReturn

import typer

MAIN_PAGE = Path(__file__).parents[1] / "dashboard" / "main.py"

OPTIONS = (
    "server.address=localhost",
    "server.allowedHosts=localhost",  # reject other names that may point at this machine
    "server.allowedHosts=127.0.0.1",
    "server.maxUploadSize=2000",  # MB; the readers refuse files that do not fit into memory
    "server.fileWatcherType=none",
    "server.showEmailPrompt=false",
    "server.enableCORS=true",
    "server.enableXsrfProtection=true",
    "global.developmentMode=false",  # would allow every origin
    "browser.gatherUsageStats=false",
    "client.toolbarMode=minimal",
    "client.showErrorLinks=false",
    "logger.level=warning",
    "runner.postScriptGC=false",  # the pages collect while nobody waits, see `work.collect_garbage_later`
)
"""Flags override environment variables of the user; files are not read, see `_read_no_configuration`."""


def dashboard(
    port: Annotated[int, typer.Option(help="Port on localhost.", min=1, max=65535)] = 8501,
    browser: Annotated[bool, typer.Option(help="Open a browser window.")] = True,
) -> None:
    """Open the dashboard in a browser. It listens only on localhost and sends no data anywhere."""
    from app.dashboard import compiled

    _read_no_configuration()
    _hide_streamlit_offers()
    _print_also_to_nobody()
    _say_where_it_is(port)
    with TemporaryDirectory(prefix="gearsig-") as folder:
        _tell_page_its_server(Path(folder))
        compiled.begin()
        _run(port, browser=browser)


def _run(port: int, *, browser: bool) -> NoReturn:
    from streamlit import net_util
    from streamlit.web import cli as streamlit_cli

    from app.dashboard.theme import THEME_OPTIONS

    net_util.get_external_ip = lambda: None  # it would ask an external server for our address to check an origin
    server_options = (
        f"server.port={port}",
        f"server.headless={str(not browser).lower()}",
        f"server.corsAllowedOrigins=http://localhost:{port}",
    )
    sys.argv = [
        "streamlit",
        "run",
        str(MAIN_PAGE),
        *(f"--{option}" for option in (*OPTIONS, *THEME_OPTIONS, *server_options)),
    ]
    sys.exit(streamlit_cli.main())


def _read_no_configuration() -> None:
    """Keep Streamlit from reading `.streamlit` in the working folder, as it may have come with recordings.

    Its base theme may be an external address, its path moves the pages, a file that is not text stops the start, and
    its secrets become environment variables, one of which names Python files that are executed.
    """
    from streamlit import config

    def none_of(file_name: str) -> list[str]:
        del file_name
        return []

    config.get_config_files = none_of


def _hide_streamlit_offers() -> None:
    """Keep Streamlit from offering its add-ons on the page; older versions have no such module."""
    from importlib import import_module
    from importlib.util import find_spec

    if find_spec("streamlit.web.skills") is not None:
        skills: Any = import_module("streamlit.web.skills")
        skills.nudge_suppression_reason = lambda *_: "not for the users of an application"
        skills.are_skills_installed = lambda *_, **__: True


def _print_also_to_nobody() -> None:
    """Let the server start and stop where its output cannot be written: the reader has gone (`| head`), a disk is full.

    Streamlit says that it stops before it does, and an error of the one would keep it from the other.
    """
    from streamlit import cli_util

    print_to_cli = cli_util.print_to_cli

    def print_if_read(message: str, **style: Any) -> None:
        try:
            print_to_cli(message, **style)
        except OSError:  # what is still to be flushed goes nowhere too
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())

    cli_util.print_to_cli = print_if_read


def _say_where_it_is(port: int) -> None:
    """Print one line once the server answers, in place of Streamlit's own."""
    from streamlit import cli_util
    from streamlit.web import bootstrap

    def say(is_running_hello: bool) -> None:
        del is_running_hello
        cli_util.print_to_cli(f"The dashboard is at http://localhost:{port} (Ctrl-C ends it).")

    bootstrap._print_url = say


def _tell_page_its_server(folder: Path) -> None:
    """Make the first page name its server, in a copy of the page in `folder`.

    At an address with a path such as /analysis, Streamlit's script first looks for its server below that path, and the
    browser reports two errors. This remains so if symbolic links are not allowed or another version keeps its page
    elsewhere.
    """
    from streamlit import file_util

    static = Path(file_util.get_static_dir())
    page = (static / "index.html").read_text(encoding="utf-8") if (static / "index.html").exists() else ""
    try:
        for entry in static.iterdir():
            if entry.name != "index.html":
                (folder / entry.name).symlink_to(entry, target_is_directory=entry.is_dir())
    except OSError:
        return
    here = "<script>window.__streamlit = { BACKEND_BASE_URL: location.origin + '/' }</script>"
    (folder / "index.html").write_text(page.replace("<head>", f"<head>{here}", 1), encoding="utf-8")
    file_util.get_static_dir = lambda: str(folder)
