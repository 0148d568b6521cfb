"""A drive that starts, stops and strikes back: what it does, and what a recording of it tells."""

from __future__ import annotations

import streamlit as st

from app.dashboard.as_typed import as_typed
from app.dashboard.laboratory.setup import effect_text
from app.dashboard.start_stop.controls import choose_drive
from app.dashboard.start_stop.run import DriveRun, run_drive
from app.dashboard.start_stop.setup import DriveSetup
from app.dashboard.start_stop.view import show_numbers, show_saving, show_views
from app.dashboard.widgets.errors import show_error
from gearsig.errors import GearsigError
from sims.presets import Preset


def show_drive(preset: Preset) -> None:
    """Choose, simulate, show."""
    setup = choose_drive(preset)
    sound = run_drive(setup.sound)
    faulty = faulty_run(setup)
    head, buttons = st.columns((3, 2), vertical_alignment="top")
    with head:
        titles = [effect_text(setting) for setting in setup.effects] if faulty else []
        title = " + ".join(titles)
        st.subheader(as_typed(title[:1].upper() + title[1:] or "Sound: nothing is switched on"), anchor=False)
        st.caption(
            "Forging manipulator: pinion and wheel with gripper and piece. Every number is read from the recording, as "
            "of a measured one."
        )
    with buttons:
        show_saving(faulty or sound)
    show_numbers(sound, faulty)
    show_views(sound, faulty)


def faulty_run(setup: DriveSetup) -> DriveRun | None:
    """Return the run with effects; None, with the reason on the page, where there is none."""
    try:
        return run_drive(setup) if setup.effects else None
    except GearsigError as error:
        show_error(error)
        return None
