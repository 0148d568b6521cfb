"""Gears of finite elements, and what three publications say of such models beside what these give."""

from __future__ import annotations

import streamlit as st

from app.dashboard.flexible import show_gear, show_pair, show_publications
from app.dashboard.widgets.messages import show_error
from gearsig.errors import GearsigError

TABS = {"One gear": show_gear, "Pair": show_pair, "Publications": show_publications}
chosen = st.segmented_control(
    "What is shown", list(TABS), default="One gear", key="flexible shown", label_visibility="collapsed"
)
try:
    TABS[chosen or "One gear"]()
except GearsigError as error:
    show_error(error)
