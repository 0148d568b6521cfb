"""Choose the simulation in the sidebar, and the channels on the page."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import streamlit as st

from app.dashboard import state
from app.dashboard.as_typed import as_typed
from app.dashboard.cached import sha256_of_upload
from app.dashboard.compare.cached import Pairs
from app.dashboard.compare.choice import TWIN, Run, SimulatedFile, Simulation
from app.dashboard.laboratory.controls import shown_name
from app.dashboard.laboratory.setup import MODEL
from app.dashboard.state import Request, Upload
from app.dashboard.widgets.chooser import text_of_upload
from app.dashboard.widgets.comparison import sample_name
from app.samples import Sample, samples
from gearsig.compare.recordings import ALIGN

if TYPE_CHECKING:
    from gearsig.recording.types import Recording

NOW, SAMPLE, OWN = "Simulate now", "Sample", "Own file"
FILE, RIG = "simulation file", "simulation rig"
ORIGIN, MACHINE = "simulation origin", "simulation machine"
LENGTHS_S = (2.0, 5.0, 10.0)
Content = Path | memoryview


def choose_simulation() -> tuple[Simulation, Content | None] | None:
    """Return what the recording is compared with, None while there is nothing.

    Raises
    ------
    InputError
        If a rig file is no text.
    """
    with st.sidebar:
        st.divider()
        made = state.simulated()
        origins = (NOW, SAMPLE, OWN) if made is None else (NOW, SAMPLE, OWN, state.OF_LABORATORY)
        origin = st.radio("Simulation", origins, horizontal=True, key=ORIGIN, persist_state="session")
        if origin == NOW:
            return _choose_run(), None
        if origin == state.OF_LABORATORY and made is not None:
            st.caption(f"{as_typed(made.request.name)}, from the fault laboratory.")
            return SimulatedFile(made.request), made.content
        return _choose_sample() if origin == SAMPLE else _choose_file()


def choose_alignment() -> str:
    """Return how the averages are aligned."""
    with st.sidebar:
        chosen = st.selectbox(
            "Align by",
            ALIGN,
            key="comparison alignment",
            persist_state="session",
            help="Marks: angle 0 is the same tooth in both. Correlation: the simulation is turned to where the "
            "averages fit best. Auto: marks for shafts that have one in both.",
        )
    return str(chosen)


def choose_pairs(simulated: Recording, recorded: Recording) -> Pairs:
    """Return the channels that are compared: those of equal names, or two that the user names."""
    own, other = simulated.vibration_names(), recorded.vibration_names()
    common = [name for name in other if name in own]
    if common and len(other) == len(common):
        return tuple((name, name) for name in common)
    if not own or not other:
        return ()  # the comparison says what is missing
    source = f"{recorded.provenance.sha256} {' '.join(own)}"
    left, right = st.columns(2)
    first = common[0] if common else other[0]
    chosen = left.selectbox(
        "Channel of the recording",
        other,
        index=other.index(first),
        key=state.source_key("recorded channel", source),
    )
    mate = right.selectbox(
        "Channel of the simulation",
        own,
        index=own.index(chosen) if chosen in own else 0,
        key=state.source_key(f"simulated channel for {chosen}", source),
    )
    return ((str(mate), str(chosen)),)


def _choose_run() -> Run:
    from sims.presets import presets

    found = presets(MODEL)

    def title(name: str) -> str:
        return name if name == TWIN else f"Preset {shown_name(name)}"

    machine = st.selectbox(
        "Machine",
        [TWIN, *found],
        format_func=title,
        key=MACHINE,
        persist_state="session",
        help="Set to the rig: its teeth, module and face width, all else usual for its size. A preset keeps its own "
        "geometry but takes the rig's teeth.",
    )
    if machine != TWIN:
        st.caption(found[machine].title)
    speed = st.number_input(
        "Speed of the driver (rpm)",
        min_value=1.0,
        value=None,
        placeholder="the recording's",
        key="simulation speed",
        persist_state="session",
    )
    torque = st.number_input(
        "Torque on the driver (N·m)",
        min_value=0.0,
        value=None,
        placeholder="the rig's or the preset's",
        key="simulation torque",
        persist_state="session",
    )
    length = st.segmented_control(
        "Length (s)", LENGTHS_S, default=5.0, key="simulation length", persist_state="session"
    )
    seed = st.number_input("Seed", min_value=0, value=0, key="simulation seed", persist_state="session")
    return Run(str(machine), speed, torque, float(length or 5.0), int(seed))


def _choose_sample() -> tuple[SimulatedFile, Path]:
    from gearsig.recording.read import sha256_of

    found = samples()
    first = next((i for i, s in enumerate(found) if s.rig.stem == "healthy"), 0)
    sample: Sample = st.selectbox(
        "Simulated sample",
        found,
        index=first,
        format_func=sample_name,
        key="simulation sample",
        persist_state="session",
    )
    request = Request(
        sample.recording.name, sha256_of(sample.recording), sample.rig.name, sample.rig.read_text("utf-8")
    )
    return SimulatedFile(request), sample.recording


def _choose_file() -> tuple[SimulatedFile, memoryview] | None:
    from gearsig.recording.identify import FORMAT_OF_EXTENSION

    file = st.file_uploader(
        "Simulated signals",
        type=[*FORMAT_OF_EXTENSION, ".gz"],
        key=FILE,
        on_change=state.keep_files,
        args=(FILE, ()),
        help="CSV (also .gz), MAT, WAV, HDF5, Parquet, TDMS or UFF58.",
    )
    rig_file = st.file_uploader(
        "Its rig file (TOML), if it has one",
        type=["toml"],
        key=RIG,
        max_upload_size=1,
        help="Without one it is read as the file states, with the gears of the recording's rig.",
    )
    if file is not None:
        content = file.getbuffer()
        upload = Upload(file.name, sha256_of_upload(file.file_id, content), content)
        if rig_file is not None:
            upload = replace(upload, rig_name=rig_file.name, rig_text=text_of_upload(rig_file))
        state.keep_files(FILE, (upload,))
    kept = state.kept_files(FILE)
    if not kept:
        return None
    if file is None:
        st.caption(f"Still open: {as_typed(kept[0].name)}")
        st.button("Close", on_click=state.keep_files, args=(FILE, ()), key="close the simulation")
    one = kept[0]
    return SimulatedFile(Request(one.name, one.sha256, one.rig_name, one.rig_text)), one.content
