"""One simulation of the page: the recording, and the motion behind it that no sensor shows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from app.dashboard.laboratory.setup import MODEL, Setup
from gearsig.checks import FloatArray
from gearsig.recording.types import Recording
from gearsig.rig.types import Rig
from sims.cracked.respond import Response
from sims.cracked.simulate import simulate_with_motion
from sims.gear_pair.build import build_rig
from sims.machine import Machine
from sims.machine.operation import Operation
from sims.reduced_fe.dynamics_constants import FlexiblePair
from sims.reduced_fe.dynamics_respond import FlexResponse

MOTION = (
    "driver angle",
    "driven angle",
    "driver y",
    "driver y velocity",
    "driven y",
    "driven y velocity",
    "transmission_error_m",
    "mesh_force_n",
)
MOTION_HZ = 80_000.0
"""Points of the motion per second that are kept, at least."""


@dataclass(frozen=True)
class Run:
    """A setup and what it gives.

    Parameters
    ----------
    setup : Setup
    machine : Machine
        With its effects.
    recording : Recording
        With rig and truth.
    response : Response
        Motion from the recording's start on; see `MOTION` for its signals.
    pair : FlexiblePair or None
        Of the model with finite-element gears.
    """

    setup: Setup
    machine: Machine
    recording: Recording
    response: Response
    pair: FlexiblePair | None = None

    @property
    def rig(self) -> Rig:
        """Rig of the recording; a simulated one always has it."""
        assert self.recording.rig is not None  # noqa: S101 - said to the type checker
        return self.recording.rig

    @property
    def vibration_channels(self) -> tuple[str, ...]:
        """Names of the acceleration channels."""
        return tuple(c.name for c in self.recording.channels if c.quantity == "acceleration")

    @cached_property
    def mesh_cycles(self) -> FloatArray:
        """Mesh cycles at each point of the motion: tooth k of the driver enters at k - 1 and every revolution."""
        cycles: FloatArray = self.response["driver angle"] * self.machine.mesh.pair.driver.teeth / (2.0 * np.pi)
        return cycles


def run_setup(setup: Setup) -> Run:
    """Simulate once, and take both from it: the recording, sample by sample that of `sims.simulate`, and the motion.

    Raises
    ------
    InputError
        If a value is out of its range, or the machine allows less.
    """
    from sims.cracked.simulator import CrackedPair

    if setup.model != MODEL:
        return _run_flexible(setup)
    operation = Operation.steady(setup.speed_rpm, setup.torque_nm)
    rng = np.random.default_rng(setup.seed)
    ready = CrackedPair().prepare(
        dict(setup.parameters),
        setup.effects,
        operation,
        rng,
        preset_name=setup.preset,
        sampling_rate_hz=setup.sampling_rate_hz,
    )
    recording, response = simulate_with_motion(
        ready.machine,
        operation,
        rng=rng,
        sampling_rate_hz=setup.sampling_rate_hz,
        duration_s=setup.duration_s,
        rig=build_rig(ready.machine, operation, name=f"simulated: {setup.preset}"),
        truth=ready.truth(),
        also=MOTION,
    )
    return Run(setup, ready.machine, recording, _shown_part(response, setup.duration_s))


def _run_flexible(setup: Setup) -> Run:
    """Simulate the pair of finite-element gears."""
    from sims.reduced_fe.simulate import simulate_pair
    from sims.reduced_fe.simulator import ReducedPair

    operation = Operation.steady(setup.speed_rpm, setup.torque_nm)
    rng = np.random.default_rng(setup.seed)
    ready = ReducedPair().prepare(
        dict(setup.parameters),
        setup.effects,
        operation,
        rng,
        preset_name=setup.preset,
        sampling_rate_hz=setup.sampling_rate_hz,
    )
    machine = ready.pair.machine
    recording, response = simulate_pair(
        ready.pair,
        operation,
        rng=rng,
        sampling_rate_hz=setup.sampling_rate_hz,
        duration_s=setup.duration_s,
        rig=build_rig(machine, operation, name=f"simulated: {setup.preset}"),
        truth=ready.truth(),
        step_s=ready.step_s,
        also=MOTION,
    )
    return Run(setup, machine, recording, _shown_part(response, setup.duration_s), ready.pair)


def _shown_part(response: Response | FlexResponse, duration_s: float) -> Response:
    """Keep the signals that are shown, as many points as that takes, from the recording's start to its end."""
    every = max(int(1.0 / (MOTION_HZ * response.interval_s)), 1)
    time = response.time_s
    first, last = (int(i) for i in np.searchsorted(time, (0.0, duration_s)))
    signals = {name: response[name][first:last:every].copy() for name in MOTION}
    return Response(float(time[first]), response.interval_s * every, signals, response.step_s, response.energy_j)


def lines_per_period(run: Run, n_per_revolution: float) -> FloatArray:
    """Times at which the driver has turned by another 1/n of a revolution (a Poincaré section's strobe)."""
    turned = run.response["driver angle"] * n_per_revolution / (2.0 * np.pi)
    return times_of(run, turned, np.arange(np.ceil(turned[0]), np.floor(turned[-1]) + 1.0))


def times_of(run: Run, phase: FloatArray, wanted: FloatArray | Sequence[float]) -> FloatArray:
    """Times at which a rising phase takes the wanted values."""
    result: FloatArray = np.interp(wanted, phase, run.response.time_s)
    return result
