"""What the recording is compared with: a file, or a simulation that is run for it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from app.dashboard.state import Request
from app.dashboard.uploads import read_recording_bytes, read_recording_file, read_rig_text
from gearsig.errors import InputError
from gearsig.recording.types import Recording
from gearsig.rig.types import Rig

TWIN = "Set to the rig"
"""Instead of a preset: the rig's own geometry, the rest usual for its size."""
MODEL = "cracked"


@dataclass(frozen=True)
class Run:
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

    request: Request


Simulation = Run | SimulatedFile


def read_chosen(request: Request, content: Path | memoryview, rig: Rig | None) -> Recording:
    """Read a file with a rig and what the user states of it."""
    rate, speed = request.sampling_rate_hz, request.speed_rpm
    if isinstance(content, Path):
        return read_recording_file(content, rig=rig, sampling_rate_hz=rate, speed_rpm=speed)
    return read_recording_bytes(content, request.name, rig=rig, sampling_rate_hz=rate, speed_rpm=speed)


def read_simulation(request: Request, content: Path | memoryview, machine: Rig | None) -> Recording:
    """Read a simulation with its own rig file; without one it takes the gears of the recording's rig."""
    from gearsig.compare.machine import for_simulation

    own = read_rig_text(request.rig_text, request.rig_name)
    gears = for_simulation(machine) if machine is not None else None
    return read_chosen(request, content, own if own is not None else gears)


def run_simulation(run: Run, recorded: Recording) -> Recording:
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
        MODEL,
        preset=run.machine,
        parameters=teeth_of(recorded.rig),
        speed_rpm=speed,
        torque_nm=run.torque_nm,
        duration_s=run.duration_s,
        sampling_rate_hz=rate,
        seed=run.seed,
    )


def _twin(run: Run, rig: Rig | None, speed_rpm: float, sampling_rate_hz: float) -> Recording:
    from gearsig.gap.simulator import Point
    from sims.gear_pair.usual import nominal_of
    from sims.registry import gap_simulator

    if rig is None:
        raise InputError(
            "no rig is described that the simulator could be set to", remedy="give a rig file, or choose a preset"
        )
    torque = run.torque_nm if run.torque_nm is not None else nominal_of(rig).torque_nm
    twin = gap_simulator(MODEL).twin_of(rig)
    point = Point(speed_rpm, torque)
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
    from gearsig.angle.types import ShaftAngle
    from gearsig.diagnosis.speed import determine_angle

    rig = recorded.rig or Rig()
    angle = determine_angle(recorded, rig)
    if not isinstance(angle, ShaftAngle):
        raise InputError(
            f"the speed of the recording is not known: {angle.reason}", remedy=f"type a speed, or {angle.remedy}"
        )
    driver = rig.pairs[0].driver if rig.pairs else ""
    return angle.mean_speed_rpm * ((rig.ratio(driver, to=angle.shaft) or 1.0) if driver else 1.0)
