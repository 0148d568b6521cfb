"""From a flexible pair to a recording: run the model, then measure it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from gearsig.checks import positive
from gearsig.errors import InputError
from gearsig.recording.types import Recording
from gearsig.rig.types import Rig
from sims.gear_pair.measurement import Measurement
from sims.gear_pair.roughness import draw_roughness
from sims.machine.operation import Operation
from sims.measure.truth import plain
from sims.reduced_fe.contact_path import corner_separation_m
from sims.reduced_fe.contact_table import MARGIN
from sims.reduced_fe.dynamics_constants import Constants, FlexiblePair, constants
from sims.reduced_fe.dynamics_linear import eigenfrequencies_hz, torsional_mode
from sims.reduced_fe.dynamics_respond import STEP_S, FlexResponse, FlexState, respond
from sims.reduced_fe.dynamics_stability import followed_step_s

LARGEST_DEPTH = 0.5
"""Of what corners are apart at the table's ends: the most the static approach may take, to leave room to vibrate."""


def simulate_pair(
    pair: FlexiblePair,
    operation: Operation,
    *,
    rng: np.random.Generator,
    sampling_rate_hz: float,
    duration_s: float,
    rig: Rig | None = None,
    truth: Mapping[str, Any] | None = None,
    step_s: float = STEP_S,
    also: Sequence[str] = (),
    first: FlexState | None = None,
    noise_rng: np.random.Generator | None = None,
    on_progress: Callable[[float], None] | None = None,
) -> tuple[Recording, FlexResponse]:
    """Simulate a flexible pair and measure it; return the recording and the motion behind it.

    Parameters
    ----------
    pair : FlexiblePair
    operation : Operation
        Its time 0 is the recording's start.
    rng : numpy.random.Generator
        One stream for the machine (roughness), one for the measurement chain.
    sampling_rate_hz, duration_s : float
    rig : Rig or None
        Goes with the recording.
    truth : mapping or None
        What was asked for; "machine", "gears" and "solver" are added.
    step_s : float
        Longest step; it is shortened to what the contact can be followed with, and to a whole part of the sampling
        interval.
    also : sequence of str
        Signals of `sims.reduced_fe.dynamics_respond.signal_names` wanted besides those that are measured.
    first : FlexState or None
        Where the lead-in starts; None: at the static balance.
    noise_rng : numpy.random.Generator or None
        For the chain, instead of the stream made of `rng`.
    on_progress : callable or None
        Called now and then with the part of the motion that is done, 0 to 1.

    Raises
    ------
    InputError
        If the teeth yield further under the load than their corners are apart.
    """
    machine_rng, chain_rng = rng.spawn(2)
    machine, _ = draw_roughness(pair.machine, machine_rng)
    pair = replace(pair, machine=machine)
    check_depth(pair, operation)
    own = constants(pair, operation, rng=machine_rng)
    step = followed_step_s(pair, own, operation, positive(step_s, "step_s", "s"))
    measured = Measurement.of(machine, sampling_rate_hz=sampling_rate_hz, duration_s=duration_s, longest_step_s=step)
    response = respond(
        pair,
        operation,
        duration_s=measured.motion_s,
        signals=measured.signals(also),
        start_s=-measured.lead_in_s,
        step_s=measured.step_s,
        stride=measured.stride,
        first=first,
        ready=own,
        on_progress=on_progress,
    )
    recording = measured.record(
        response,
        rng=chain_rng if noise_rng is None else noise_rng,
        rig=rig,
        truth={**(truth or {}), **_known(pair, operation, own, response)},
        source="simulation: pair of reduced finite-element gears",
        reader="sims.reduced_fe",
    )
    return replace(recording, warnings=(*recording.warnings, *model_notes(pair, operation, own))), response


def model_notes(pair: FlexiblePair, operation: Operation, own: Constants) -> tuple[str, ...]:
    """Where the model is used near its limits."""
    notes = []
    mesh_hz = operation.speed_rpm.largest / 60.0 * pair.machine.mesh.pair.driver.teeth
    if mesh_hz > 0.25 * pair.mode_limit_hz:
        notes.append(
            f"the mesh frequency reaches {mesh_hz:.0f} Hz: its fourth harmonic lies above {pair.mode_limit_hz:.0f} Hz, "
            "up to where the gears' elastic modes move"
        )
    if pair.machine.mesh_damping_ratio > 0.0 and float(own.record["damping_time"]) == 0.0:
        notes.append("shafts, bearings and gear bodies damp the torsional mode more than mesh_damping_ratio asks for")
    return tuple(notes)


def _known(pair: FlexiblePair, operation: Operation, own: Constants, response: FlexResponse) -> dict[str, Any]:
    """What is worth knowing of the machine and the run."""
    mode = torsional_mode(pair, operation, ready=own)
    frequencies = eigenfrequencies_hz(pair, operation, np.array([0.5]), ready=own)[0]
    return {
        "machine": plain(replace(pair.machine, chain=None)),  # type: ignore[arg-type]  # it stands under "measurement"
        "gears": [
            {"key": gear.key, "degrees_of_freedom": gear.n_dof, "frequencies_hz": gear.frequencies_hz.tolist()}
            for gear in pair.gears
        ],
        "solver": {
            "step_s": response.step_s,
            "torsional_hz": mode.frequency_hz,
            "mesh_stiffness_n_per_m": own.mean_stiffness_n_per_m,
            "eigenfrequencies_hz": frequencies.tolist(),
        },
    }


def check_depth(pair: FlexiblePair, operation: Operation) -> None:
    """Refuse a torque under which the teeth yield further than half of what their corners are apart."""
    torque = operation.torque_nm.largest
    if torque <= 0.0:
        return
    deepest = float(pair.maps(np.array([torque])).transmission_error_m.max())
    geometry = pair.machine.mesh.pair
    ends = np.array([-MARGIN, geometry.contact_ratio + MARGIN])
    apart = LARGEST_DEPTH * float(corner_separation_m(geometry, ends).min())
    if deepest > apart:
        raise InputError(
            f"the teeth yield by {1e6 * deepest:.0f} µm under {torque:g} N m",
            where="torque_nm",
            allowed=f"up to {1e6 * apart:.0f} µm: beyond, corners touch further out than the model follows them",
            remedy="lower the torque or widen the face",
        )
