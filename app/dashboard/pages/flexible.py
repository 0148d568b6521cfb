"""Gears of finite elements, and what three publications say of such models beside what these give."""

from __future__ import annotations

import streamlit as st

from app.dashboard import address
from app.dashboard.flexible import show_gear, show_pair, show_publications
from app.dashboard.widgets.messages import show_error
from gearsig.errors import GearsigError

TABS = {"One gear": show_gear, "Pair": show_pair, "Publications": show_publications}
st.subheader("Flexible gears", anchor=False)
st.caption(
    "Gears of finite elements: modes and stress of one, jumps and maps of a pair, three publications recomputed."
)
looks = {"key": "flexible shown", "name": "view", "label_visibility": "collapsed"}
chosen = address.ask_one(st.segmented_control, "What is shown", list(TABS), **looks)
try:
    TABS[chosen]()
except GearsigError as error:
    show_error(error)
