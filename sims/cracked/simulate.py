"""From a machine to a recording: run the model, then measure it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from gearsig.recording.types import Recording
from gearsig.rig.types import Rig
from sims.cracked.linear import default_step_s, eigenfrequencies_hz
from sims.cracked.respond import Response, State, respond
from sims.gear_pair.measurement import Measurement
from sims.machine import Machine
from sims.machine.operation import Operation
from sims.measure.truth import plain
from sims.mesh import friction_over_mesh


def simulate_machine(
    machine: Machine,
    operation: Operation,
    *,
    rng: np.random.Generator,
    sampling_rate_hz: float,
    duration_s: float,
    rig: Rig | None = None,
    truth: Mapping[str, Any] | None = None,
    step_s: float | None = None,
    noise_rng: np.random.Generator | None = None,
    on_progress: Callable[[float], None] | None = None,
) -> Recording:
    """Simulate the sixteen coordinates and measure them; see `simulate_with_motion`."""
    recording, _ = simulate_with_motion(
        machine,
        operation,
        rng=rng,
        sampling_rate_hz=sampling_rate_hz,
        duration_s=duration_s,
        rig=rig,
        truth=truth,
        step_s=step_s,
        noise_rng=noise_rng,
        on_progress=on_progress,
    )
    return recording


def simulate_with_motion(
    machine: Machine,
    operation: Operation,
    *,
    rng: np.random.Generator,
    sampling_rate_hz: float,
    duration_s: float,
    rig: Rig | None = None,
    truth: Mapping[str, Any] | None = None,
    step_s: float | None = None,
    also: Sequence[str] = (),
    first: State | None = None,
    noise_rng: np.random.Generator | None = None,
    on_progress: Callable[[float], None] | None = None,
) -> tuple[Recording, Response]:
    """Simulate the sixteen coordinates and measure them; return the recording and the motion behind it.

    Parameters
    ----------
    machine : Machine
    operation : Operation
        Its time 0 is the recording's start.
    rng : numpy.random.Generator
        Two streams are made of it, one for the machine and one for the chain: the same seed gives the same noise
        whatever the machine draws.
    sampling_rate_hz, duration_s : float
    rig : Rig or None
        Goes with the recording.
    truth : mapping or None
        What was asked for; "machine" and "solver" are added.
    step_s : float or None
        Longest step; None: `sims.cracked.linear.default_step_s`. It is shortened to a whole part of the sampling
        interval.
    also : sequence of str
        Signals of `sims.cracked.layout.SIGNALS` wanted in the motion besides those that are measured.
    first : State or None
        Where the lead-in starts; None: at the static balance.
    noise_rng : numpy.random.Generator or None
        For the chain, instead of the stream made of `rng`: the same machine with other noise.
    on_progress : callable or None
        Called now and then with the part of the motion that is done, 0 to 1.

    Returns
    -------
    recording : Recording
        With notes of the model as warnings: where a formula is used outside its range.
    motion : Response
        Lead-in included: it begins before time 0.
    """
    longest = default_step_s(machine, operation) if step_s is None else step_s
    measured = Measurement.of(machine, sampling_rate_hz=sampling_rate_hz, duration_s=duration_s, longest_step_s=longest)
    machine_rng, chain_rng = rng.spawn(2)
    response = respond(
        machine,
        operation,
        duration_s=measured.motion_s,
        rng=machine_rng,
        signals=measured.signals(also),
        start_s=-measured.lead_in_s,
        step_s=measured.step_s,
        stride=measured.stride,
        first=first,
        on_progress=on_progress,
    )
    known = {
        "machine": plain(replace(machine, chain=None)),  # type: ignore[arg-type]  # the chain stands under "measurement"
        "solver": {
            "step_s": response.step_s,
            "eigenfrequencies_hz": [float(f) for f in eigenfrequencies_hz(machine, _force_n(machine, operation))],
        },
    }
    recording = measured.record(
        response,
        rng=chain_rng if noise_rng is None else noise_rng,
        rig=rig,
        truth={**(truth or {}), **known},
        source="simulation: cracked 16-DOF spur pair",
        reader="sims.cracked",
    )
    return replace(recording, warnings=(*recording.warnings, *model_notes(machine, operation))), response


def model_notes(machine: Machine, operation: Operation) -> tuple[str, ...]:
    """Where formulas are used outside the range they were made for."""
    notes = list(machine.mesh.notes)
    speed, torque = operation.speed_rpm.largest, operation.torque_nm.largest
    if machine.lubrication.friction and speed > 0.0 and torque > 0.0:
        oil = machine.lubrication.viscosity_cp, machine.roughness.rms_um
        notes += friction_over_mesh(machine.mesh, torque, speed, *oil).notes
    mesh_hz = speed / 60.0 * machine.mesh.pair.driver.teeth
    if mesh_hz > 0.8 * float(eigenfrequencies_hz(machine)[-1]):
        notes.append(
            f"the mesh frequency reaches {mesh_hz:.0f} Hz, near or above the model's highest eigenfrequency: "
            "modes of gear bodies and teeth, which it lacks, would take part"
        )
    return tuple(notes)


def _force_n(machine: Machine, operation: Operation) -> float:
    return operation.torque_nm.largest / (machine.mesh.pair.driver.base_radius_mm * 1e-3)
