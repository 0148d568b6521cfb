"""The dashboard's frame: page settings and navigation. Started by `gearsig dashboard`."""

from __future__ import annotations

from pathlib import Path

import streamlit as st

from app.dashboard import address, work

PAGES = Path(__file__).parent / "pages"

st.set_page_config(page_title="gearsig", page_icon=str(PAGES.parent / "icon.svg"), layout="wide")
st.html(PAGES.parent / "page.css")
SCRIPT = (PAGES.parent / "page.js").read_text("utf-8")
st.html(f'<script class="of-page">{SCRIPT}</script>', unsafe_allow_javascript=True)
st.logo(str(PAGES.parent / "logo.svg"), size="large")
page = st.navigation(
    [
        st.Page(PAGES / "start.py", title="Start", icon=":material/home:", default=True),
        st.Page(PAGES / "analysis.py", title="Analysis", icon=":material/troubleshoot:"),
        st.Page(PAGES / "laboratory.py", title="Fault laboratory", icon=":material/experiment:"),
        st.Page(PAGES / "flexible.py", title="Flexible gears", icon=":material/settings:"),
        st.Page(PAGES / "compare.py", title="Comparison", icon=":material/stacked_line_chart:"),
        st.Page(PAGES / "gap.py", title="Gap", icon=":material/compare_arrows:"),
        st.Page(PAGES / "fleet.py", title="Fleet", icon=":material/factory:"),
    ],
    position="top",
)
work.tidy_later()
with address.of_page(page.url_path):
    page.run()
