"""Switch faults on and watch the machine answer, healthy beside faulty."""

from __future__ import annotations

import streamlit as st

from app.dashboard.laboratory.drive import show_drive
from app.dashboard.laboratory.run import LaboratoryRun, show_saving, simulated, with_complete_effects
from app.dashboard.laboratory.setup import DRIVE_MODEL, Setup, choose_preset, choose_setup
from app.dashboard.laboratory.views import show_expectation, show_legend, show_numbers, show_title, show_views
from app.dashboard.widgets.messages import show_error
from gearsig.errors import GearsigError
from sims.presets import Preset


def show() -> None:
    """Choose a machine, simulate, show; a drive that starts and stops has controls and figures of its own."""
    preset = choose_preset()
    if preset.model == DRIVE_MODEL:
        show_drive(preset)
    else:
        show_pair(preset)


def show_pair(preset: Preset) -> None:
    """Choose, simulate, show a pair that runs at a steady speed."""
    setup = choose_setup(preset)
    healthy = simulated(setup.healthy)
    faulty = faulty_run(setup)
    head, buttons = st.columns((3, 2), vertical_alignment="top")
    with head:
        show_title(healthy, faulty, impossible=faulty is None and not setup.is_healthy)
    with buttons:
        show_saving(faulty.setup if faulty else healthy.setup)
    show_expectation(healthy, faulty)
    channel = choose_channel(healthy, faulty)
    show_numbers(healthy, faulty, channel)
    show_views(healthy, faulty, channel)


def choose_channel(healthy: LaboratoryRun, faulty: LaboratoryRun | None) -> str:
    """Return the sensor that numbers and spectra are of; beside it stands which colour is which."""
    channels = healthy.vibration_channels
    with st.container(horizontal=True, vertical_alignment="center", horizontal_alignment="distribute"):
        channel = st.segmented_control(
            "Sensor",
            channels,
            default=channels[0],
            format_func="Sensor {}".format,
            key="sensor of the laboratory",
            label_visibility="collapsed",
            persist_state="session",
        )
        if faulty is not None:
            show_legend()
    return channel or channels[0]


def faulty_run(setup: Setup) -> LaboratoryRun | None:
    """Return the faulty twin; None, with the reason on the page, where there is none."""
    try:
        return None if setup.is_healthy else simulated(with_complete_effects(setup))
    except GearsigError as error:
        show_error(error)
        return None


try:
    show()
except GearsigError as error:
    show_error(error)
