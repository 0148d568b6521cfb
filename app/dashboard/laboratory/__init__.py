"""The fault laboratory: the user switches faults on and sees the machine respond, healthy beside faulty."""

from __future__ import annotations

from contextlib import suppress
from time import sleep

import streamlit as st

from app.dashboard import address
from app.dashboard.compiled import is_being_made
from app.dashboard.laboratory import views
from app.dashboard.laboratory.drive import show_drive
from app.dashboard.laboratory.run import (
    LaboratoryRun,
    all_simulated,
    faulty_of,
    preview_of,
    show_saving,
    simulated,
    with_all_options,
)
from app.dashboard.laboratory.setup import DRIVE_MODEL, Setup, choose_preset, choose_setup, wait_for_rest
from app.dashboard.work import let_user_act
from gearsig.errors import GearsigError
from sims.presets import Preset

LENGTHS_S = (2.0, 5.0, 10.0, 20.0)
"""Lengths offered for saved recordings."""


def show() -> None:
    """Choose a machine, simulate, show; a drive that starts and stops has its own controls and figures."""
    preset = choose_preset()
    if preset.model == DRIVE_MODEL:
        show_drive(preset)
    else:
        show_pair(preset)


def show_pair(preset: Preset) -> None:
    """Choose, simulate and show a pair that runs at a steady speed."""
    wait_for_rest()
    setup = choose_setup(preset)
    # Results fade at once while another machine is simulated, so that none is mistaken for the new one's.
    with st.container(key="results"):
        show_results(setup)


def show_results(setup: Setup) -> None:
    """Show healthy and faulty machine: at once from a short recording, marked as such, until the whole one is ready."""
    wait_for_compiled_code()
    preview = preview_of(setup)
    if preview is None or all_simulated(setup):
        show_machines(setup, *find_machines(setup))
        return
    machines = find_machines(preview)
    wholes = (with_all_options(setup), setup.healthy)
    with simulated.ahead(*wholes):  # while the page draws
        show_machines(preview, *machines, whole_s=setup.duration_s)
    for whole in wholes:
        with suppress(GearsigError):  # the preview has already shown it
            simulated(whole)
    st.rerun()


def wait_for_compiled_code() -> None:
    """Say that the simulators are being compiled; any user action ends the wait."""
    if not is_being_made():
        return
    with st.spinner("Compiling the simulators, once after an installation …", show_time=True):
        st.caption("This takes about a minute. You can use the other pages meanwhile.")
        while is_being_made():
            sleep(0.1)
            let_user_act()
    st.rerun()


def find_machines(setup: Setup) -> tuple[LaboratoryRun, LaboratoryRun | None]:
    """Simulate both machines; messages meanwhile have their own place, so that nothing below them moves."""
    with st.container():
        return simulated(setup.healthy), faulty_of(setup, simulated)


def show_machines(
    setup: Setup, healthy: LaboratoryRun, faulty: LaboratoryRun | None, *, whole_s: float | None = None
) -> None:
    """Show both machines; `whole_s` is the length that follows a preview."""
    views.mark_slider_values()
    shown = faulty or healthy
    head, buttons = st.columns((3, 2), vertical_alignment="top")
    with head:
        views.show_title(setup, is_shown=faulty is not None)
        about = " · ".join(views.frequencies(shown))
        preview = f":orange-badge[Preview of {setup.duration_s:.2g} s; {whole_s:g} s follow] " if whole_s else ""
        st.caption(preview + about)
    with buttons:
        show_saving(shown.setup, LENGTHS_S)
    views.show_expectation(healthy, faulty)
    channel = choose_channel(healthy, faulty)
    views.show_numbers(healthy, faulty, channel)
    views.show_views(healthy, faulty, channel)


def choose_channel(healthy: LaboratoryRun, faulty: LaboratoryRun | None) -> str:
    """Return the sensor chosen for numbers and spectra, and show the legend of colours beside it."""
    channels = healthy.vibration_channels
    with st.container(horizontal=True, vertical_alignment="center", horizontal_alignment="distribute"):
        channel = address.ask_one(
            st.segmented_control,
            "Sensor",
            channels,
            format_func="Sensor {}".format,
            name="sensor",
            label_visibility="collapsed",
        )
        if faulty is not None:
            views.show_legend()
    return str(channel)
