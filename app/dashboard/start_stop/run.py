"""A run of the start–stop drive, once for equal setups: recording, what its motion shows, the force from it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import streamlit as st

from app.dashboard.start_stop.setup import DriveSetup

if TYPE_CHECKING:
    from gearsig.checks import FloatArray
    from gearsig.motion.start_stop import StartStop
    from gearsig.motion.types import ForceEstimate, PairMotion
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
    curve_um : array or None
        Course of the compression over the mesh cycle on the drive flank; None where nothing starts and stops.
    """

    setup: DriveSetup
    recording: Recording
    examined: StartStop
    force: ForceEstimate | None
    refusal: str = ""
    curve_um: FloatArray | None = None

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
    return DriveRun(setup, recording, examine_start_stop(motion), force, refusal, _curve_um(motion))


def _curve_um(motion: PairMotion) -> FloatArray | None:
    from gearsig.errors import RefusalError
    from gearsig.gap.start_stop.cycles import cut_cycles
    from gearsig.gap.start_stop.told import Examined

    try:
        cycles = Examined(cut_cycles(motion))
    except RefusalError:
        return None
    return cycles.tell(cycles.every).contact.curve_um
