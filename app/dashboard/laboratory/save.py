"""The simulated machine as a recording: files to keep, or straight to the analysis page."""

from __future__ import annotations

import zipfile
from dataclasses import replace
from hashlib import sha256
from io import BytesIO
from pathlib import Path
from tempfile import TemporaryDirectory

import streamlit as st

from app.dashboard import state
from app.dashboard.laboratory.setup import Setup
from app.dashboard.state import Chosen, Request
from gearsig.recording.types import Recording

ENDINGS = (".h5", ".csv", ".parquet", ".mat", ".wav")
LENGTHS_S = (2.0, 5.0, 10.0, 20.0)
ANALYSIS_ENDING = ".h5"


def show_saving(setup: Setup) -> None:
    """Offer the files, and the way to the analysis page."""
    with st.container(horizontal=True, horizontal_alignment="right"):
        with st.popover("Save as recording", icon=":material/save:"):
            length = st.segmented_control(
                "Length (s)", LENGTHS_S, default=5.0, key="length of the saved recording", persist_state="session"
            )
            ending = st.selectbox("Format", ENDINGS, key="ending of the saved recording", persist_state="session")
            twin = st.toggle("With its healthy twin", key="twin of the saved recording", persist_state="session")
            kept = replace(setup, duration_s=float(length or 5.0))
            st.download_button(
                "Download",
                data=lambda: zipped((kept, kept.healthy) if twin else (kept,), ending),
                file_name=f"{setup.file_stem}.zip",
                mime="application/zip",
                icon=":material/download:",
                on_click="ignore",
                type="primary",
            )
            st.caption("A zip with the recording, its rig file, and what was put in (truth).")
        if st.button("Open in the analysis page", icon=":material/troubleshoot:"):
            with st.spinner("Simulating the recording …"):
                state.open_simulated(chosen_of(replace(setup, duration_s=float(length or 5.0))))
            st.switch_page(state.ANALYSIS_PAGE)


def record(setup: Setup) -> Recording:
    """Simulate the recording that the command line makes of the same settings."""
    from sims import simulate

    return simulate(
        setup.model,
        preset=setup.preset,
        parameters=dict(setup.parameters),
        effects=setup.effects,
        speed_rpm=setup.speed_rpm,
        torque_nm=setup.torque_nm,
        duration_s=setup.duration_s,
        sampling_rate_hz=setup.sampling_rate_hz,
        seed=setup.seed,
    )


def zipped(setups: tuple[Setup, ...], ending: str) -> bytes:
    """Return a zip file with recording, rig file and truth of each setup."""
    return zip_of({name: content for setup in _distinct(setups) for name, content in files(setup, ending).items()})


def zip_of(contents: dict[str, bytes]) -> bytes:
    """Return files as one zip file."""
    buffer = BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in contents.items():
            archive.writestr(name, content)
    return buffer.getvalue()


def files(setup: Setup, ending: str) -> dict[str, bytes]:
    """Return recording, rig file and truth, in this order, by file name."""
    return files_of(record(setup), setup.file_stem, ending)


def files_of(recording: Recording, stem: str, ending: str) -> dict[str, bytes]:
    """Return a simulated recording, its rig file and its truth, in this order, by file name."""
    from sims.files import file_set, write_set

    with TemporaryDirectory(prefix="gearsig-") as folder:
        names = file_set(Path(folder) / f"{stem}{ending}")
        write_set(recording, names)
        return {path.name: path.read_bytes() for path in names}


def chosen_of(setup: Setup) -> Chosen:
    """Return the recording as the analysis page takes an upload."""
    return chosen_of_files(files(setup, ANALYSIS_ENDING))


def chosen_of_files(contents: dict[str, bytes]) -> Chosen:
    """Return recording and rig file as the analysis page takes an upload."""
    (name, content), (rig_name, rig), _ = contents.items()
    request = Request(name, sha256(content).hexdigest(), rig_name, rig.decode("utf-8"))
    return Chosen(request, memoryview(content))


def _distinct(setups: tuple[Setup, ...]) -> tuple[Setup, ...]:
    return tuple(setup for place, setup in enumerate(setups) if setup not in setups[:place])
