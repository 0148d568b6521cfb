"""The frame of the dashboard: page settings, navigation, a page's errors. Started by `gearsig dashboard`."""

from __future__ import annotations

from errno import ENOSPC
from functools import partial
from importlib import import_module
from pathlib import Path
from tempfile import gettempdir

import streamlit as st

from app.dashboard import address, state, work
from app.dashboard.widgets.texts import show_error
from gearsig.errors import GearsigError, not_written

FOLDER = Path(__file__).parent
# Module name, which is also the page's address, → title and icon; a module is imported when its page is first opened.
PAGES = {
    "start": ("Start", "home"),
    "analysis": ("Analysis", "troubleshoot"),
    "laboratory": ("Fault laboratory", "experiment"),
    "flexible": ("Flexible gears", "settings"),
    "compare": ("Comparison", "stacked_line_chart"),
    "gap": ("Gap", "compare_arrows"),
    "fleet": ("Fleet", "factory"),
}


def show(name: str) -> None:
    """Show a page, or in its place the error that prevents it."""
    try:
        import_module(f"app.dashboard.{name}").show()
    except GearsigError as error:
        show_error(error)
    except OSError as error:
        if error.errno != ENOSPC:
            raise
        remedy = "make room there, or start the dashboard with TMPDIR set to another folder"
        show_error(not_written(error, gettempdir(), remedy))


st.set_page_config(page_title="gearsig", page_icon=str(FOLDER / "icon.svg"), layout="wide")
st.html(FOLDER / "page.css")
SCRIPT = (FOLDER / "page.js").read_text("utf-8")
st.html(f'<script class="of-page">{SCRIPT}</script>', unsafe_allow_javascript=True)
st.logo(str(FOLDER / "logo.svg"), size="large")
pages = state.pages()
for name, (title, icon) in PAGES.items():
    mark, is_first = f":material/{icon}:", name == "start"
    pages[name] = st.Page(partial(show, name), title=title, icon=mark, url_path=name, default=is_first)
page = st.navigation(list(pages.values()), position="top")
work.collect_garbage_later()
with address.of_page(page.url_path):
    page.run()
