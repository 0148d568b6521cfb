"""The cracked spur pair as a simulator: preset and values → machine → effects → recording."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache

import numpy as np

from gearsig.gap import AddedEffect, OperatingCondition
from gearsig.recording import Recording
from gearsig.rig import Rig
from sims.cracked._respond import (
    PairState,
    Response,
    check_convergence,
    default_step_s,
    eigenfrequencies_hz,
    mesh_force_n,
    respond,
)
from sims.effects import effects
from sims.gear_pair import (
    PARAMETERS,
    MeasuredRun,
    Measurement,
    PairModel,
    PairTwin,
    ReadyPair,
    StepConvergence,
)
from sims.machine import Machine, Nominal, Operation
from sims.measure import plain
from sims.mesh import friction_over_mesh
from sims.simulator import Parameter, SimulationRequest

NAME = "cracked"


@dataclass(frozen=True)
class CrackedPair(PairModel[ReadyPair]):
    """Spur gear pair on four bearings between two rotors, with 16 degrees of freedom; see `sims.cracked`."""

    name: str = NAME
    title: str = "spur gear pair with root crack: 16 degrees of freedom, friction, backlash, roughness"
    parameters: tuple[Parameter, ...] = field(default=PARAMETERS, repr=False)
    effects: tuple[str, ...] = field(default_factory=lambda: tuple(effects()), repr=False)

    def _ready(self, request: SimulationRequest, machine: Machine) -> ReadyPair:
        return ReadyPair(**vars(request), machine=machine)

    def _run(self, ready: ReadyPair, run: MeasuredRun[PairState]) -> Recording:
        return simulate_with_motion(ready.machine, ready.operation, run)[0]

    def _converges(self, ready: ReadyPair, rng: np.random.Generator) -> StepConvergence:
        return check_convergence(ready.machine, ready.operation, rng)

    def _twin(self, rig: Rig, nominal: Nominal) -> CrackedTwin:
        return CrackedTwin(rig, nominal)


# From a machine to a recording: run the model, then measure it.


def simulate_with_motion(
    machine: Machine, operation: Operation, run: MeasuredRun[PairState]
) -> tuple[Recording, Response]:
    """Simulate the sixteen coordinates and measure them; return the recording and the underlying motion.

    Parameters
    ----------
    machine : Machine
    operation : Operation
        Its time 0 is the recording's start.
    run : MeasuredRun
        Its default step is `sims.cracked.default_step_s`. "machine" and "solver" are added to its truth; its further
        signals are from `sims.cracked.SIGNALS`.

    Returns
    -------
    recording : Recording
        With warnings where the model uses a formula outside its range.
    motion : Response
        Including the lead-in, so it begins before time 0.
    """
    longest = default_step_s(machine, operation) if run.step_s is None else run.step_s
    measured = Measurement.of(machine, run, longest)
    machine_rng, chain_rng = run.streams()
    response = respond(machine, operation, rng=machine_rng, **measured.rest)
    if run.before is not None:
        response = run.before.followed_by(response)
    frequencies = eigenfrequencies_hz(machine, mesh_force_n(machine, operation))
    recording = measured.record(
        response,
        chain_rng,
        known={
            "machine": plain(replace(machine, chain=None)),  # type: ignore[arg-type]  # it is under "measurement"
            "solver": {"step_s": response.step_s, "eigenfrequencies_hz": [float(f) for f in frequencies]},
        },
        notes=model_notes(machine, operation),
        source="simulation: cracked 16-DOF spur pair",
        reader="sims.cracked",
    )
    return recording, response


def model_notes(machine: Machine, operation: Operation) -> tuple[str, ...]:
    """Notes on formulas used outside their range of validity."""
    notes = list(machine.mesh.notes)
    speed, torque = operation.speed_rpm.largest, operation.torque_nm.largest
    if machine.lubrication.friction and speed > 0.0 and torque > 0.0:
        oil = machine.lubrication.viscosity_cp, machine.roughness.rms_um
        notes += friction_over_mesh(machine.mesh, torque, speed, *oil).notes
    mesh_hz = speed / 60.0 * machine.mesh.pair.driver.teeth
    if mesh_hz > 0.8 * float(eigenfrequencies_hz(machine)[-1]):
        notes.append(
            f"the mesh frequency reaches {mesh_hz:.0f} Hz, near or above the model's highest eigenfrequency: "
            "modes of gear bodies and teeth, which the model lacks, would contribute"
        )
    return tuple(notes)


# The cracked pair adapted to a rig, for the gap diagnosis: see `gearsig.gap`.

STEP_ANGLE_RAD = 0.9
"""Step times the maximum angular eigenfrequency: three times that of a single simulation, see `_step_s`."""


@dataclass(frozen=True)
class CrackedTwin(PairTwin):
    """A rig's twin with 16 degrees of freedom; see `sims.gear_pair.PairTwin`."""

    @property
    def pair_model(self) -> CrackedPair:
        """The model that runs the twin."""
        return CrackedPair()

    def _planned(
        self, point: OperatingCondition, added: Sequence[AddedEffect], seed: int, sampling_rate_hz: float
    ) -> tuple[ReadyPair, MeasuredRun[PairState]]:
        """Introduce tooth faults while the healthy specimen runs; its start is simulated once for all such faults.

        A tooth fault acts during one engagement and so does not disturb the drive or a body on soft mounts, which
        settle slowly. The motion's rate follows from the step: the model has no modes that would alias.
        """
        ready, run = super()._planned(point, added, seed, sampling_rate_hz)
        run = replace(run, min_motion_hz=0.0)
        if not added or not all("tooth" in a.options for a in added):
            return ready, run
        return ready, replace(run, before=_lead_in(self, point, seed, sampling_rate_hz))

    def _step_s(self, point: OperatingCondition, seed: int) -> float:
        """Integration step of the healthy machine, so that effects do not change the drawn noise.

        It is longer than that of a single simulation; the error of the accelerations is 2 to 4 parts in a thousand.
        """
        return _healthy_step_s(self, point, seed)


# Cached for the specimens and operating points of the last diagnosis, whose trials need them repeatedly.


@lru_cache(maxsize=4)
def _healthy_step_s(twin: CrackedTwin, point: OperatingCondition, seed: int) -> float:
    healthy = twin._prepared(twin.preset(point, seed=seed), np.random.default_rng(0))
    return default_step_s(healthy.machine, healthy.operation, STEP_ANGLE_RAD)


@lru_cache(maxsize=4)
def _lead_in(twin: CrackedTwin, point: OperatingCondition, seed: int, sampling_rate_hz: float) -> Response | None:
    """Return the motion of a healthy specimen up to its recording's start, about 5 MB; None without lead-in."""
    healthy, run = twin._planned(point, (), seed, sampling_rate_hz)
    lead_in = Measurement.of(healthy.machine, run, run.step_s or 0.0).lead_in
    return None if lead_in is None else respond(healthy.machine, healthy.operation, rng=run.streams()[0], **lead_in)
