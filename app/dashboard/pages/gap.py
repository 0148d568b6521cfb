"""From recordings and a simulator to the effect that is missing in it."""

from __future__ import annotations

from contextlib import suppress

import streamlit as st

from app.dashboard.gap.choice import Choice, choose, set_alike, simulator_title
from app.dashboard.gap.view import show_finished, show_running
from app.dashboard.theme import as_typed
from app.dashboard.widgets.messages import show_error
from gearsig.errors import GearsigError

WELCOME = """
The page says **where** recordings differ from the simulation of their rig, **which** effect that the simulator lacks
causes it, **how far** the gap shrinks with it, and what to record next. Sizes are in *structural floors*: one is how
far even healthy machines differ, so that less means nothing.

Surest with recordings at several speeds and loads, and with one of the same rig when it was healthy. A diagnosis
takes up to a minute on two free cores; the rig's simulations are kept for the next one.
"""


def show() -> None:
    """Choose, run, show."""
    choice = choose()
    names = ", ".join(one.name for one in choice.recordings)
    st.subheader("Gap between simulation and recording", anchor=False)
    if choice.recordings:
        against = f", against {', '.join(one.name for one in choice.references)}" if choice.references else ""
        st.caption(as_typed(f"{names}{against}; simulator of {simulator_title(choice.model)}"))
    finished = show_running(choice)
    if finished is None:
        st.markdown(WELCOME)
        show_set_alike(choice)
        return
    if finished.key != choice.key:
        st.info("This is the answer to what was chosen before. Diagnose again for what is chosen now.")
    show_finished(finished)


def show_set_alike(choice: Choice) -> None:
    """Say what the simulator will be set to."""
    with suppress(GearsigError):  # said when it is started
        for text in set_alike(choice) if choice.recordings else ():
            st.markdown(f":green[:material/check:] {as_typed(text)}")


try:
    show()
except GearsigError as error:
    show_error(error)
