"""A run of the start–stop drive, once for equal setups: recording, what its motion shows, the force from it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import streamlit as st

from app.dashboard.start_stop.setup import DriveSetup

if TYPE_CHECKING:
    from gearsig.motion.start_stop import StartStop
    from gearsig.motion.types import ForceEstimate
    from gearsig.recording.types import Recording

N_RUNS = 12


@dataclass(frozen=True)
class DriveRun:
    """What one setup gives.

    Parameters
    ----------
    setup : DriveSetup
    recording : Recording
    examined : StartStop
    force : ForceEstimate or None
    refusal : str
        Why there is no force.
    """

    setup: DriveSetup
    recording: Recording
    examined: StartStop
    force: ForceEstimate | None
    refusal: str = ""

    def number(self, name: str) -> float:
        """Return an indicator by its name; nan where there is none."""
        return next((i.value for i in self.examined.indicators if i.name == name), float("nan"))


@st.cache_resource(max_entries=N_RUNS, show_spinner="Simulating …")
def run_drive(setup: DriveSetup) -> DriveRun:
    """Simulate, measure, examine.

    Raises
    ------
    InputError
        If a value does not fit.
    """
    from gearsig.errors import RefusalError
    from gearsig.motion.force import estimate_forces
    from gearsig.motion.measure import measure_motion
    from gearsig.motion.start_stop import examine_start_stop

    recording = setup.record()
    motion = measure_motion(recording)
    try:
        force, refusal = estimate_forces(motion), ""
    except RefusalError as error:
        force, refusal = None, str(error)
    return DriveRun(setup, recording, examine_start_stop(motion), force, refusal)
