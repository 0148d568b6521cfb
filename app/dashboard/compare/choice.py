"""What the recording is compared with: a file, or a simulation that is run for it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import streamlit as st

from app.dashboard import state
from app.dashboard.cached import read_recording_bytes, read_recording_file, read_rig_text, sha256_of_upload
from app.dashboard.laboratory.setup import MODEL, shown_name
from app.dashboard.state import AnalysisRequest, Upload
from app.dashboard.theme import as_typed
from app.dashboard.widgets.chooser import sample_name, text_of_upload
from app.samples import SampleRecording, samples
from gearsig.comparison import ALIGN, Comparison
from gearsig.errors import InputError
from gearsig.recording import Recording
from gearsig.rig import Rig

TWIN = "Set to the rig"
"""Instead of a preset: the rig's own geometry, the rest usual for its size."""
CHOICE_MODEL = "cracked"


@dataclass(frozen=True)
class SimulationToCompare:
    """A simulation that is run for the comparison.

    Parameters
    ----------
    machine : str
        Name of a preset, or `TWIN`.
    speed_rpm, torque_nm : float or None
        Of the driver; None: the recording's speed, the rig's or the preset's torque.
    duration_s : float
    seed : int
    """

    machine: str
    speed_rpm: float | None = None
    torque_nm: float | None = None
    duration_s: float = 5.0
    seed: int = 0


@dataclass(frozen=True)
class SimulatedFile:
    """A simulation from a file: what is known of it."""

    request: AnalysisRequest


Simulation = SimulationToCompare | SimulatedFile


def read_chosen(request: AnalysisRequest, content: Path | memoryview, rig: Rig | None) -> Recording:
    """Read a file with a rig and what the user states of it."""
    rate, speed = request.sampling_rate_hz, request.speed_rpm
    if isinstance(content, Path):
        return read_recording_file(content, rig=rig, sampling_rate_hz=rate, speed_rpm=speed)
    return read_recording_bytes(content, request.name, rig=rig, sampling_rate_hz=rate, speed_rpm=speed)


def read_simulation(request: AnalysisRequest, content: Path | memoryview, machine: Rig | None) -> Recording:
    """Read a simulation with its own rig file; without one it takes the gears of the recording's rig."""
    from gearsig.comparison import for_simulation

    own = read_rig_text(request.rig_text, request.rig_name)
    gears = for_simulation(machine) if machine is not None else None
    return read_chosen(request, content, own if own is not None else gears)


def run_simulation(run: SimulationToCompare, recorded: Recording) -> Recording:
    """Simulate the recording's machine at its speed and sampling rate.

    Raises
    ------
    GearsigError
        If the speed is not known, the machine allows less, or the rig does not say enough for a twin.
    """
    speed = run.speed_rpm if run.speed_rpm is not None else speed_of(recorded)
    rate = min(max(recorded.sampling_rate_hz, 4096.0), 102400.0)
    if run.machine == TWIN:
        return _twin(run, recorded.rig, speed, rate)
    import sims

    return sims.simulate(
        CHOICE_MODEL,
        preset=run.machine,
        parameters=teeth_of(recorded.rig),
        speed_rpm=speed,
        torque_nm=run.torque_nm,
        duration_s=run.duration_s,
        sampling_rate_hz=rate,
        seed=run.seed,
    )


def _twin(run: SimulationToCompare, rig: Rig | None, speed_rpm: float, sampling_rate_hz: float) -> Recording:
    from gearsig.gap import OperatingCondition
    from sims.machine import nominal_of
    from sims.registry import gap_simulator

    if rig is None:
        raise InputError(
            "no rig is described that the simulator could be set to", remedy="give a rig file, or choose a preset"
        )
    torque = run.torque_nm if run.torque_nm is not None else nominal_of(rig).torque_nm
    twin = gap_simulator(CHOICE_MODEL).twin_of(rig)
    point = OperatingCondition(speed_rpm, torque)
    return twin.run(point, seed=run.seed, duration_s=run.duration_s, sampling_rate_hz=sampling_rate_hz)


def teeth_of(rig: Rig | None) -> dict[str, float]:
    """Return the parameters that give a preset the rig's teeth: orders are compared, so they must be the same."""
    if rig is None or len(rig.pairs) != 1:
        return {}
    pair = rig.pairs[0]
    known = {"teeth_driver": pair.driver_teeth, "teeth_driven": pair.driven_teeth}
    return {name: float(teeth) for name, teeth in known.items() if teeth is not None}


def speed_of(recorded: Recording) -> float:
    """Return the mean speed of the driver in the recording.

    Raises
    ------
    InputError
        If it is not known.
    """
    from gearsig.errors import RefusalError
    from gearsig.prepared import refined_angle

    rig = recorded.rig or Rig()
    try:
        angle = refined_angle(recorded, rig)
    except RefusalError as refusal:
        raise InputError(
            f"the speed of the recording is not known: {refusal.reason}", remedy=f"type a speed, or {refusal.remedy}"
        ) from None
    driver = rig.pairs[0].driver if rig.pairs else ""
    return angle.mean_speed_rpm * ((rig.ratio(driver, to=angle.shaft) or 1.0) if driver else 1.0)


# --------------------
# Reading, simulating and comparing, done once for equal choices and shared between sessions.
# --------------------


Content = Path | memoryview
N_READ, N_COMPARED, N_PAGES = 3, 4, 4
Pairs = tuple[tuple[str, str], ...]


@dataclass(frozen=True)
class Both:
    """A recording and its simulation."""

    recorded: Recording
    simulated: Recording


@st.cache_resource(max_entries=N_READ, show_spinner=False)
def recorded_of(request: AnalysisRequest, _content: Content) -> Recording:
    """Return the recording with its rig."""
    return read_chosen(request, _content, read_rig_text(request.rig_text, request.rig_name))


@st.cache_resource(max_entries=N_READ, show_spinner=False)
def simulated_of(
    simulation: Simulation, request: AnalysisRequest, _content: Content | None, _recorded: Recording
) -> Recording:
    """Return the simulation for a recording; `request` stands for the recording."""
    del request
    if isinstance(simulation, SimulationToCompare):
        return run_simulation(simulation, _recorded)
    assert _content is not None  # noqa: S101 - a file has content, said to the type checker
    return read_simulation(simulation.request, _content, _recorded.rig)


@st.cache_resource(max_entries=N_COMPARED, show_spinner=False)
def compared(request: AnalysisRequest, simulation: Simulation, pairs: Pairs, align_by: str, _both: Both) -> Comparison:
    """Return the comparison; it is frozen, so that sessions may share it."""
    from gearsig.comparison import compare_recordings

    del request, simulation  # they stand for the records
    return compare_recordings(_both.simulated, _both.recorded, channels=pairs, align_by=align_by)


@st.cache_data(max_entries=N_PAGES, show_spinner=False)
def page_of(
    request: AnalysisRequest, simulation: Simulation, pairs: Pairs, align_by: str, command: str, _comparison: Comparison
) -> bytes:
    """Return the self-contained page of a comparison."""
    from gearsig.report import comparison_page

    del request, simulation, pairs, align_by
    return comparison_page(_comparison, command=command).encode("utf-8")


def command_of(request: AnalysisRequest, simulation: Simulation, pairs: Pairs, align_by: str) -> str:
    """Return the command that gives the same comparison outside the dashboard; empty for a simulation of this page."""
    import shlex

    if not isinstance(simulation, SimulatedFile):
        return ""
    words = ["gearsig", "compare", simulation.request.name, request.name]
    if request.rig_text.strip():
        words += ["--rig", request.rig_name]
    if request.sampling_rate_hz is not None:
        words += ["--fs", f"{request.sampling_rate_hz:.15g}"]
    if request.speed_rpm is not None:
        words += ["--speed-rpm", f"{request.speed_rpm:.15g}"]
    if simulation.request.rig_text.strip():
        words += ["--sim-rig", simulation.request.rig_name]
    words += [word for own, other in pairs for word in ("--channel", f"{own}={other}")]
    return shlex.join([*words, *(["--align", align_by] if align_by != "auto" else []), "-o", "comparison"])


# --------------------
# Choose the simulation in the sidebar, and the channels on the page.
# --------------------


NOW, SAMPLE, OWN = "Simulate now", "Sample", "Own file"
FILE, RIG = "simulation file", "simulation rig"
ORIGIN, MACHINE = "simulation origin", "simulation machine"
LENGTHS_S = (2.0, 5.0, 10.0)


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


def _choose_run() -> SimulationToCompare:
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
    return SimulationToCompare(str(machine), speed, torque, float(length or 5.0), int(seed))


def _choose_sample() -> tuple[SimulatedFile, Path]:
    from gearsig.recording import sha256_of

    found = samples()
    first = next((i for i, s in enumerate(found) if s.rig.stem == "healthy"), 0)
    sample: SampleRecording = st.selectbox(
        "Simulated sample",
        found,
        index=first,
        format_func=sample_name,
        key="simulation sample",
        persist_state="session",
    )
    request = AnalysisRequest(
        sample.recording.name, sha256_of(sample.recording), sample.rig.name, sample.rig.read_text("utf-8")
    )
    return SimulatedFile(request), sample.recording


def _choose_file() -> tuple[SimulatedFile, memoryview] | None:
    from gearsig.recording import FORMAT_OF_EXTENSION

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
    return SimulatedFile(AnalysisRequest(one.name, one.sha256, one.rig_name, one.rig_text)), one.content
