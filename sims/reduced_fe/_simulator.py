"""The pair of reduced finite-element gears as a simulator: preset and values → machine → effects → recording."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import Any

import numpy as np

from gearsig.checks import positive
from gearsig.errors import InputError
from gearsig.gap import OperatingCondition
from gearsig.recording import Recording
from gearsig.rig import SIDES, Rig
from sims.effects import effects
from sims.fe_gear import READY, GearBlank, ReducedGear, cached_gear, plan_for, ready_gear
from sims.gear_pair import (
    PARAMETERS as SHARED,
)
from sims.gear_pair import (
    Installed,
    MeasuredRun,
    Measurement,
    PairModel,
    PairTwin,
    ReadyPair,
    StepConvergence,
    build_machine,
    draw_roughness,
    gear_geometry,
)
from sims.machine import Machine, Nominal, Operation
from sims.measure import plain
from sims.mesh import Material, corner_separation_m
from sims.reduced_fe._contact import MARGIN
from sims.reduced_fe._pair import FlexiblePair, FlexiblePairConstants, constants, torsional_mode
from sims.reduced_fe._respond import (
    STEP_S,
    FlexResponse,
    FlexState,
    check_convergence,
    eigenfrequencies_hz,
    followed_step_s,
    respond,
)
from sims.simulator import Parameter, ParameterValue, ParameterValues, SimulationRequest, Values

# The parameters of the flexible pair: those shared with the 16-DOF pair, and those of its gear bodies.

MEANINGLESS: dict[str, ParameterValue | None] = {
    "contact_law": "linear",
    "mesh_ramp": 0.05,
    "gear_body": "separate",
    "face_slices": 16,
    "mass_driver_kg": None,
    "mass_driven_kg": None,
    "inertia_driver_kg_m2": None,
    "inertia_driven_kg_m2": None,
}
"""Parameters of the 16-DOF pair that this model lacks, with the values used to build its machine."""

_CHANGED = {
    "mesh_damping_ratio": {
        "meaning": "damping ratio of the torsional mode with the rotors fixed; the contact supplies what others do not",
        "default": 0.08,
    },
    "friction": {"default": "off"},
    "roughness_locked_to": {"choices": ("flank", "none")},
    "bending_stiffness_n_per_m": {"default": 1.5e10},
    "bearing_stiffness_n_per_m": {"default": 1.5e10},
}


def _bodies() -> tuple[Parameter, ...]:
    parameters: list[Parameter] = []
    for side, whose in (("driver", "the driver"), ("driven", "the driven gear")):
        parameters += [
            Parameter(f"web_thickness_{side}_mm", "mm", f"web of {whose}; none: a full disc", 0.1, 500, None),
            Parameter(f"rim_thickness_{side}_mm", "mm", f"rim of {whose}; none: 3 modules", 0.1, 500, None),
            Parameter(f"hub_thickness_{side}_mm", "mm", f"hub of {whose}; none: 3 modules", 0.1, 500, None),
            Parameter(f"hub_inertia_{side}_kg_m2", "kg m^2", f"inertia that hub and shaft add to {whose}", 0, 1e5, 0.0),
            Parameter(f"hub_mass_{side}_kg", "kg", f"mass that hub and shaft add to {whose}", 0, 1e5, 0.0),
        ]
    return tuple(parameters)


_DYNAMICS = (
    Parameter("body_damping_ratio", "", "damping ratio of the elastic modes of the gears", 0, 0.5, 0.08),
    Parameter("mode_limit_hz", "Hz", "limit of dynamic elastic modes; higher ones are quasi-static", 500, 1e5, 20000.0),
    Parameter(
        "restitution",
        "",
        "of the gears' impact at first contact after a loss, in addition to the compliance, which counts it twice; "
        "none: the compliance alone",
        0,
        1,
        None,
    ),
    Parameter(
        "step_us",
        "us",
        "maximum integration step; shortened to what the contact needs and to a fraction of the sampling interval",
        0.1,
        20,
        5.0,
    ),
    Parameter(
        "mesh_dof",
        "",
        "degrees of freedom of each gear's finite elements if no ready-made gear fits; kept on disk once reduced",
        5000,
        1e6,
        277200,
        whole=True,
    ),
)

PARAMETERS: tuple[Parameter, ...] = (
    *(replace(p, **_CHANGED.get(p.name, {})) for p in SHARED if p.name not in MEANINGLESS),  # type: ignore[arg-type]  # fields by name
    *_bodies(),
    *_DYNAMICS,
)
"""All parameters of the model."""
FLEXIBLE = frozenset(p.name for p in (*_bodies(), *_DYNAMICS))
"""Parameters that the 16-DOF pair does not have."""

NAME = "reduced-fe"


@dataclass(frozen=True)
class PreparedPair(ReadyPair):
    """A flexible pair with its effects switched on, ready to run.

    Parameters
    ----------
    pair : FlexiblePair
    """

    pair: FlexiblePair

    @property
    def step_s(self) -> float:
        """Maximum integration step."""
        return 1e-6 * float(self.values["step_us"] or 0.0)


@dataclass(frozen=True)
class ReducedPair(PairModel[PreparedPair]):
    """Spur pair of reduced finite-element gears between two rotors; see `sims.reduced_fe`.

    Not represented: gyroscopic and centrifugal terms, tilting of the gears, oil churning, heating, bending of teeth by
    friction, a shaft that lifts in its bearings or vibrates within their clearance, a change of the gears' modes due to
    a crack, contact off the line of action at corners.
    """

    name: str = NAME
    title: str = "spur pair of finite-element gears, reduced: elastic bodies, contact of slices, contact loss"
    parameters: tuple[Parameter, ...] = field(default=PARAMETERS, repr=False)
    effects: tuple[str, ...] = field(default_factory=lambda: tuple(effects()), repr=False)
    meaningless: tuple[str, ...] = (
        "surface_roughness with locked_to=time: flanks are shapes here, which repeat with their teeth.",
    )

    def _healthy(self, values: Values, sampling_rate_hz: float, installed: Installed | None) -> Machine:
        return healthy_machine(values, reduced_gears(values), sampling_rate_hz=sampling_rate_hz, installed=installed)

    def _ready(self, request: SimulationRequest, machine: Machine) -> PreparedPair:
        if machine.roughness.locked_to == "time" and machine.roughness.rms_um > 0.0:
            raise InputError(
                "a roughness locked to time has no meaning here: flanks are shapes that repeat with their teeth",
                where="locked_to of surface_roughness",
                allowed="'flank'",
            )
        pair = flexible_pair(request.values, machine, reduced_gears(request.values))
        return PreparedPair(**vars(request), machine=machine, pair=pair)

    def _run(self, ready: PreparedPair, run: MeasuredRun[FlexState]) -> Recording:
        stepped = run if run.step_s is not None else replace(run, step_s=ready.step_s)
        return simulate_pair(ready.pair, ready.operation, stepped)[0]

    def _converges(self, ready: PreparedPair, rng: np.random.Generator) -> StepConvergence:
        del rng
        return check_convergence(ready.pair, ready.operation, ready.step_s)

    def _twin(self, rig: Rig, nominal: Nominal) -> ReducedTwin:
        return ReducedTwin(rig, nominal)


# From a flexible pair to a recording: run the model, then measure it.

MAX_DEPTH_PART = 0.5
"""Maximum static approach over the corner separation at the table's ends; it leaves room for vibration."""


def simulate_pair(
    pair: FlexiblePair, operation: Operation, run: MeasuredRun[FlexState]
) -> tuple[Recording, FlexResponse]:
    """Simulate a flexible pair and measure it; return the recording and the underlying motion.

    Parameters
    ----------
    pair : FlexiblePair
    operation : Operation
        Its time 0 is the recording's start.
    run : MeasuredRun
        Its default step is `sims.reduced_fe.STEP_S`; the step is shortened to one with which the contact can be
        followed. "machine", "gears" and "solver" are added to its truth; its further signals are those of
        `signal_names`. The machine's random stream draws the roughness.

    Raises
    ------
    InputError
        If the deflection of the teeth under load exceeds half of their corner separation.
    """
    machine_rng, chain_rng = run.streams()
    machine, _ = draw_roughness(pair.machine, machine_rng)
    pair = replace(pair, machine=machine)
    check_depth(pair, operation)
    pair_constants = constants(pair, operation, rng=machine_rng)
    longest = positive(STEP_S if run.step_s is None else run.step_s, "step_s", "s")
    measured = Measurement.of(machine, run, followed_step_s(pair, pair_constants, operation, longest))
    response = respond(pair, operation, ready=pair_constants, **measured.motion)
    recording = measured.record(
        response,
        chain_rng,
        known=_known(pair, operation, pair_constants, response),
        notes=model_notes(pair, operation, pair_constants),
        source="simulation: pair of reduced finite-element gears",
        reader="sims.reduced_fe",
    )
    return recording, response


def model_notes(pair: FlexiblePair, operation: Operation, pair_constants: FlexiblePairConstants) -> tuple[str, ...]:
    """Notes on use of the model near its limits."""
    notes = []
    mesh_hz = operation.speed_rpm.largest / 60.0 * pair.machine.mesh.pair.driver.teeth
    if mesh_hz > 0.25 * pair.mode_limit_hz:
        notes.append(
            f"the mesh frequency reaches {mesh_hz:.0f} Hz: its fourth harmonic is above {pair.mode_limit_hz:.0f} Hz, "
            "the limit of the gears' dynamic modes"
        )
    if pair.machine.mesh_damping_ratio > 0.0 and float(pair_constants.record["damping_time"]) == 0.0:
        notes.append("shafts, bearings and gear bodies damp the torsional mode by more than mesh_damping_ratio")
    return tuple(notes)


def _known(
    pair: FlexiblePair, operation: Operation, pair_constants: FlexiblePairConstants, response: FlexResponse
) -> dict[str, Any]:
    """Data of the machine and the run for the truth."""
    mode = torsional_mode(pair, operation, ready=pair_constants)
    frequencies = eigenfrequencies_hz(pair, operation, np.array([0.5]), ready=pair_constants)[0]
    return {
        "machine": plain(replace(pair.machine, chain=None)),  # type: ignore[arg-type]  # it is under "measurement"
        "gears": [
            {"key": gear.key, "degrees_of_freedom": gear.n_dof, "frequencies_hz": gear.frequencies_hz.tolist()}
            for gear in pair.gears
        ],
        "solver": {
            "step_s": response.step_s,
            "torsional_hz": mode.frequency_hz,
            "mesh_stiffness_n_per_m": pair_constants.mean_stiffness_n_per_m,
            "eigenfrequencies_hz": frequencies.tolist(),
        },
    }


def check_depth(pair: FlexiblePair, operation: Operation) -> None:
    """Reject a torque under which the deflection of the teeth exceeds half of their corner separation."""
    torque = operation.torque_nm.largest
    if torque <= 0.0:
        return
    deepest = float(pair.maps(np.array([torque])).transmission_error_m.max())
    geometry = pair.machine.mesh.pair
    ends = np.array([-MARGIN, geometry.contact_ratio + MARGIN])
    apart = MAX_DEPTH_PART * float(corner_separation_m(geometry, ends).min())
    if deepest > apart:
        raise InputError(
            f"the teeth deflect by {1e6 * deepest:.0f} µm under {torque:g} N m",
            where="torque_nm",
            allowed=f"up to {1e6 * apart:.0f} µm: beyond it, corners touch further out than the model covers",
            remedy="lower the torque or widen the face",
        )


# From parameter values to a flexible pair.

Gears = tuple[ReducedGear, ReducedGear]


def reduced_gears(values: Values) -> Gears:
    """Return both gears: ready-made if they fit, else from the cache, else reduced now, which takes a minute.

    Raises
    ------
    InputError
        If a gear cannot be made or meshed, or memory is insufficient.
    """
    parameters = ParameterValues(values)
    n_dof = parameters.whole("mesh_dof")
    return reduced_gear(_blank(parameters, 0), n_dof), reduced_gear(_blank(parameters, 1), n_dof)


def healthy_machine(
    values: Values, gears: Gears, *, sampling_rate_hz: float = 20480.0, installed: Installed | None = None
) -> Machine:
    """Return the machine without effects: that of the 16-DOF pair, with the masses and inertias of gears and hubs."""
    parameters = ParameterValues(values)
    shared: Values = {name: value for name, value in values.items() if name not in FLEXIBLE}
    shared.update(MEANINGLESS)
    for side, gear in zip(SIDES, gears, strict=True):
        shared[f"mass_{side}_kg"] = gear.mass_kg + parameters.number(f"hub_mass_{side}_kg")
        hub = parameters.number(f"hub_inertia_{side}_kg_m2")
        shared[f"inertia_{side}_kg_m2"] = gear.polar_inertia_kg_m2 + hub
    return build_machine(shared, sampling_rate_hz=sampling_rate_hz, installed=installed)


def flexible_pair(values: Values, machine: Machine, gears: Gears) -> FlexiblePair:
    """Return the pair of a machine, effects included."""
    parameters = ParameterValues(values)
    return FlexiblePair(
        machine,
        gears,
        body_damping_ratio=parameters.number("body_damping_ratio"),
        restitution=parameters.optional("restitution"),
        mode_limit_hz=parameters.number("mode_limit_hz"),
    )


def _blank(values: ParameterValues, side: int) -> GearBlank:
    name = SIDES[side]
    material = Material(
        values.number("youngs_modulus_gpa"), values.number("poisson_ratio"), values.number("density_kg_m3")
    )
    return GearBlank(
        gear_geometry(values, side),
        values.optional(f"web_thickness_{name}_mm"),
        values.optional(f"rim_thickness_{name}_mm"),
        values.optional(f"hub_thickness_{name}_mm"),
        material,
    )


@lru_cache(maxsize=8)  # needed for the healthy machine and for the flexible pair made from it
def reduced_gear(blank: GearBlank, n_dof: int) -> ReducedGear:
    """Return a gear: ready-made if one fits, else from the cache, else reduced now with about `n_dof`."""
    for name, ready in READY.items():
        if ready == blank:
            return ready_gear(name)
    return cached_gear(blank, plan_for(blank, n_dof))


# The pair of finite-element gears adapted to a rig, for the gap diagnosis: see `gearsig.gap`.

MESH_DOF, MESH_DOF_PER_TOOTH = 40_000, 900
"""Mesh of a twin's gears: their compliance is within a few per cent of that of finer meshes, less than the uncertainty
of a rig file."""
TWIN_STEP_S = 8.2e-6
"""Longer than that of a single simulation: six steps per sample at 20480 Hz. Up to 10 kHz the error of acceleration
lines is 0.2 dB (median; 95 % of them below 0.8 dB), that of transmission-error lines 0.01 dB: far less than the
difference between the housings of two specimens."""


def twin_parameters(values: Mapping[str, ParameterValue], teeth: tuple[int, int]) -> dict[str, ParameterValue]:
    """Return the parameters of the 16-DOF pair that this model also has, with the mesh size of a twin's gears."""
    known = {p.name for p in PARAMETERS}
    known_values = {name: value for name, value in values.items() if name in known}
    return known_values | {"mesh_dof": float(max(MESH_DOF, MESH_DOF_PER_TOOTH * max(teeth)))}


@dataclass(frozen=True)
class ReducedTwin(PairTwin):
    """A rig's twin with finite-element gears, full discs; see `sims.gear_pair.PairTwin`."""

    @property
    def pair_model(self) -> ReducedPair:
        """The model that runs the twin."""
        return ReducedPair()

    def _model_parameters(self, values: dict[str, ParameterValue]) -> dict[str, ParameterValue]:
        return twin_parameters(values, self.nominal.teeth)

    def _step_s(self, point: OperatingCondition, seed: int) -> float:
        del point, seed
        return TWIN_STEP_S
