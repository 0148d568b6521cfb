"""Reading, simulating and comparing, done once for equal choices and shared between sessions."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import streamlit as st

from app.dashboard.compare.choice import Run, SimulatedFile, Simulation, read_chosen, read_simulation, run_simulation
from app.dashboard.state import Request
from app.dashboard.uploads import read_rig_text
from gearsig.compare.types import Comparison
from gearsig.recording.types import Recording

Content = Path | memoryview
N_READ, N_COMPARED, N_PAGES = 3, 4, 4
Pairs = tuple[tuple[str, str], ...]


@dataclass(frozen=True)
class Both:
    """A recording and its simulation."""

    recorded: Recording
    simulated: Recording


@st.cache_resource(max_entries=N_READ, show_spinner=False)
def recorded_of(request: Request, _content: Content) -> Recording:
    """Return the recording with its rig."""
    return read_chosen(request, _content, read_rig_text(request.rig_text, request.rig_name))


@st.cache_resource(max_entries=N_READ, show_spinner=False)
def simulated_of(simulation: Simulation, request: Request, _content: Content | None, _recorded: Recording) -> Recording:
    """Return the simulation for a recording; `request` stands for the recording."""
    del request
    if isinstance(simulation, Run):
        return run_simulation(simulation, _recorded)
    assert _content is not None  # noqa: S101 - a file has content, said to the type checker
    return read_simulation(simulation.request, _content, _recorded.rig)


@st.cache_resource(max_entries=N_COMPARED, show_spinner=False)
def compared(request: Request, simulation: Simulation, pairs: Pairs, align_by: str, _both: Both) -> Comparison:
    """Return the comparison; it is frozen, so that sessions may share it."""
    from gearsig.compare.recordings import compare_recordings

    del request, simulation  # they stand for the records
    return compare_recordings(_both.simulated, _both.recorded, channels=pairs, align_by=align_by)


@st.cache_data(max_entries=N_PAGES, show_spinner=False)
def page_of(
    request: Request, simulation: Simulation, pairs: Pairs, align_by: str, command: str, _comparison: Comparison
) -> bytes:
    """Return the self-contained page of a comparison."""
    from gearsig.report.compare_page import comparison_page

    del request, simulation, pairs, align_by
    return comparison_page(_comparison, command=command).encode("utf-8")


def command_of(request: Request, simulation: Simulation, pairs: Pairs, align_by: str) -> str:
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
