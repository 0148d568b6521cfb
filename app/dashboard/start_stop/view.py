"""What the page of the start–stop drive shows: numbers beside the sound drive's, pictures, impacts, files."""

from __future__ import annotations

from math import isfinite

import pandas as pd
import streamlit as st

from app.dashboard import state
from app.dashboard.as_typed import as_typed
from app.dashboard.laboratory.save import ANALYSIS_ENDING, ENDINGS, chosen_of_files, files_of, zip_of
from app.dashboard.laboratory.summary import change, shown
from app.dashboard.start_stop.run import DriveRun
from app.dashboard.widgets.picture import show_picture

NUMBERS = {
    "backlash": "µm",
    "impacts per cycle": "",
    "back impacts per cycle": "",
    "hardest impact": "m/s",
    "impact loss per cycle": "J",
}
"""Indicators on top of the page, with the unit for people."""
TOGETHER = "Sound beside faulty"
VIEWS = ("Motion", "Force between the teeth", "Impacts", "Indicators")


def show_numbers(sound: DriveRun, faulty: DriveRun | None) -> None:
    """Show the indicators, of the faulty drive with the sound one's below."""
    with st.container(horizontal=True):
        for name, unit in NUMBERS.items():
            own = sound.number(name)
            label = name[:1].upper() + name[1:]
            if faulty is None:
                st.metric(label, _told(own, unit))
                continue
            value = faulty.number(name)
            below = f"sound {_told(own, unit)}{change(own, value)}"
            st.metric(label, _told(value, unit), below, delta_color="off", delta_arrow="off")


def _told(value: float, unit: str) -> str:
    return shown(value, unit) if isfinite(value) else "not told"


def show_views(sound: DriveRun, faulty: DriveRun | None) -> None:
    """Show one of the views, of either drive."""
    with st.container(horizontal=True, horizontal_alignment="distribute", vertical_alignment="center"):
        view = st.segmented_control(
            "View", VIEWS if faulty is None else (TOGETHER, *VIEWS), default=VIEWS[0] if faulty is None else TOGETHER,
            key=f"view of the {'sound' if faulty is None else 'faulty'} drive", label_visibility="collapsed",
            persist_state="session",
        )  # fmt: skip
        which = "Faulty"
        if faulty is not None and view != TOGETHER:
            which = st.segmented_control(
                "Drive", ("Faulty", "Sound"), default="Faulty", key="side of the drive", label_visibility="collapsed"
            ) or "Faulty"  # fmt: skip
    run = sound if faulty is None or which == "Sound" else faulty
    if view == TOGETHER and faulty is not None:
        _show_together(sound, faulty)
    elif view == VIEWS[1]:
        _show_force(run)
    elif view == VIEWS[2]:
        _show_impacts(run)
    elif view == VIEWS[3]:
        st.dataframe(
            pd.DataFrame([{"indicator": i.name, "value": i.value, "unit": i.unit} for i in run.examined.indicators]),
            hide_index=True,
        )
    else:
        _show_motion(run)
    for text in run.examined.refusals:
        st.caption(f":material/info: {as_typed(f'Cannot tell the {text}')}")
    for text in run.examined.notes:
        st.caption(f":material/info: {as_typed(text)}")


def show_saving(run: DriveRun) -> None:
    """Offer the files, and the way to the analysis page."""
    with st.container(horizontal=True, horizontal_alignment="right"):
        with st.popover("Save as recording", icon=":material/save:"):
            ending = st.selectbox("Format", ENDINGS, key="ending of the drive", persist_state="session")
            st.download_button(
                "Download",
                data=lambda: zip_of(files_of(run.recording, run.setup.file_stem, ending)),
                file_name=f"{run.setup.file_stem}.zip",
                mime="application/zip",
                icon=":material/download:",
                on_click="ignore",
                type="primary",
            )
        if st.button("Open in the analysis page", icon=":material/troubleshoot:", key="analyse the drive"):
            state.open_simulated(chosen_of_files(files_of(run.recording, run.setup.file_stem, ANALYSIS_ENDING)))
            st.switch_page(state.ANALYSIS_PAGE)


def _show_motion(run: DriveRun) -> None:
    from gearsig.plot.start_stop import start_stop_figure

    words = "Speed of the pinion with the impacts, phase plane of the teeth, torque over twist"
    show_picture(start_stop_figure(run.examined, title=run.setup.preset), words)


def _show_together(sound: DriveRun, faulty: DriveRun) -> None:
    from gearsig.plot.start_stop_pair import start_stop_pair_figure

    curves = None if sound.curve_um is None or faulty.curve_um is None else (sound.curve_um, faulty.curve_um)
    words = "Sound and faulty drive: speed, phase plane, torque over twist, drive flank over the mesh cycle, teeth"
    show_picture(start_stop_pair_figure(sound.examined, faulty.examined, curves_um=curves), words)


def _show_force(run: DriveRun) -> None:
    from gearsig.plot.force import force_figure

    if run.force is None:
        st.info(as_typed(run.refusal))
        return
    words = "Force between the teeth: measured, piecewise model, Hunt–Crossley; below, the errors"
    show_picture(force_figure(run.force, title=run.setup.preset), words)
    rows = [
        {
            "model": e.model,
            "against": e.reference,
            "rms (N)": round(e.rms_n),
            "rms (%)": round(100.0 * e.relative_rms, 1),
        }
        for e in run.force.errors
    ]
    st.dataframe(pd.DataFrame(rows), hide_index=True)


def _show_impacts(run: DriveRun) -> None:
    if not run.examined.impacts:
        st.info("No impacts were seen.")
        return
    from gearsig.plot.impacts import impacts_figure

    motion = run.examined.motion
    figure = impacts_figure(run.examined.impacts, motion.path.teeth[0], restitution=motion.contact.restitution)
    show_picture(figure, "Energy of the impacts over time and over the tooth, restitution over speed")
    rows = [
        {
            "time (s)": i.time_s,
            "flank": "drive" if i.flank > 0 else "back",
            "tooth": i.driver_tooth,
            "speed (m/s)": i.speed_mps,
            "energy (J)": i.energy_j,
            "restitution": i.restitution,
        }
        for i in run.examined.impacts
    ]
    st.dataframe(pd.DataFrame(rows), hide_index=True)
