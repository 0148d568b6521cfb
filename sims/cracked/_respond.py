"""Run the model: displacements, velocities, accelerations, mesh force and transmission error."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import cos, floor, pi, sin, sqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gearsig.checks import FloatArray, known_name
from gearsig.errors import InputError
from sims.cracked._kernels import MAX_LATE, integrate
from sims.gear_pair import (
    BEARING_FIELDS,
    COORDINATES,
    DEFLECTIONS,
    FRICTION_FIELDS,
    MACHINE_FIELDS,
    PairResponse,
    RunPlan,
    StepConvergence,
    bearing_fields,
    bearing_loads_n,
    draw_roughness,
    friction_fields,
    governor_nm_s_per_rad,
    machine_fields,
    profile_points,
    shaft_place_m,
    stiffness_under_load_n_per_m,
    tilting_shares,
    total_inertia_kg_m2,
)
from sims.machine import Machine, Operation
from sims.mesh import MAX_SLICES, TimeLockedRoughness, back_stiffness_n_per_m, mesh_stiffness, mesh_table, share_torque

# The sixteen coordinates and the signals of a run.

__all__ = ["COORDINATES", "N_COORDINATES", "SIGNALS"]

N_COORDINATES = len(COORDINATES)

SIGNALS = (
    *COORDINATES,
    *(f"{name} velocity" for name in COORDINATES),
    *(f"{name} acceleration" for name in COORDINATES),
    "transmission_error_m",
    "compression_m",
    "mesh_force_n",
    "friction_n",
    "backlash_change_m",
    *DEFLECTIONS,
)
"""Signals of a run, in the order of the kernel's row.

transmission_error_m: r_b1 θ1 − r_b2 θ2. compression_m: that plus the contribution of the gears' centres. mesh_force_n:
sum of the tooth pairs' normal forces, below 0 on the back flank. friction_n: sum of the friction forces.
backlash_change_m: Δb of a roughness locked to time. For yields see `sims.gear_pair.DEFLECTIONS`.
"""

# The machine as plain numbers for compiled code.

DAMPING_RAMP_M = 2e-7
"""Depth over which the contact's damping rises to its full value."""
SCALARS = (
    "table_start",
    "table_step",
    "contact_coefficient",
    "ramp",
    "damping_time",
    "damping_ramp",
    "back_stiffness",
    "late_x",
    "late_y",
    "turn_x",
    "cos_back",
    "sin_back",
)
PER_SIDE = (
    "base_radius",
    "inertia",
    "per_mass",
    "per_inertia",
    "per_rotor",
    "mass_offset",
    "bending_stiffness",
    "bending_damping",
    "rotor_inertia",
    "tilt_x",
    "tilt_y",
)
RECORD = np.dtype(
    [(name, np.float64) for name in SCALARS]
    + [(name, np.float64, (2,)) for name in PER_SIDE]
    + [
        ("load_dependent", np.bool_),
        ("turns", np.bool_),
        ("n_slots", np.int64),
        ("n_slices", np.int64),
        ("slice_late", np.float64, (MAX_SLICES,)),
        ("slice_gap", np.float64, (MAX_SLICES,)),
        ("teeth", np.int64, (2,)),
    ]
    + MACHINE_FIELDS
    + FRICTION_FIELDS
    + BEARING_FIELDS,
    align=True,
)
"""Fields in SI units, those per side in pairs (driver, driven), those of bearings in fours; per_… are reciprocals, as
multiplication is faster than division. A record, as compiled code passes it by address, while it copies every member
of a tuple at each call."""


@dataclass(frozen=True)
class PairConstants:
    """Input of compiled code.

    Parameters
    ----------
    record : one `RECORD`
    curves : array, (n_curves, n)
        Compliance (m/N) and separation (m) of single teeth over the progress of contact, see `MeshTable`.
    rows : int array, (4, z)
        Index of the curve with the compliance of each tooth of the driver and of the driven gear, then those of their
        separations.
    pitch : array, (2, z)
        Pitch deviation of each tooth, in m. There is one array of each kind, as compiled code counts its references to
        every array in a tuple, which took as long as the mechanics.
    """

    record: Any
    curves: FloatArray
    rows: NDArray[np.int64]
    pitch: FloatArray

    @property
    def arguments(self) -> tuple[Any, FloatArray, NDArray[np.int64], FloatArray]:
        """The four fields as arguments of kernels."""
        return self.record, self.curves, self.rows, self.pitch


def constants(machine: Machine, operation: Operation, rng: np.random.Generator) -> PairConstants:
    """Convert a machine to plain numbers; draws the positions of rolling elements in bearings with a defect."""
    pair, mesh = machine.mesh.pair, machine.mesh
    table = mesh_table(mesh)
    base_radius = np.array(pair.base_radii_m)
    force = operation.torque_nm.largest / base_radius[0]
    mean_stiffness = mean_stiffness_n_per_m(machine, force)
    inertia = np.array([w.inertia_kg_m2 for w in machine.wheels])
    mass = np.array([w.mass_kg for w in machine.wheels])
    alpha = pair.working_pressure_angle_rad
    rotors = np.array([s.rotor_inertia_kg_m2 for s in machine.shafts])
    tilt = tilting_shares(machine)
    values: dict[str, Any] = {
        "table_start": table.start,
        "table_step": table.step,
        "contact_coefficient": table.slice_contact,
        "load_dependent": table.load_dependent,
        "ramp": table.ramp,
        "n_slots": floor(table.contact_ratio + mesh.overlap_ratio + table.ramp + 2.0 * MAX_LATE) + 1,
        "n_slices": len(table.late),
        "slice_late": _filled(table.late),
        "slice_gap": _filled(table.gap_m),
        "teeth": (pair.driver.teeth, pair.driven.teeth),
        "base_radius": base_radius,
        "damping_time": 2.0 * machine.mesh_damping_ratio * sqrt(mesh_mass_kg(machine) / mean_stiffness),
        "damping_ramp": DAMPING_RAMP_M,
        "back_stiffness": back_stiffness_n_per_m(mesh),
        # Base pitches per metre of displacement of the gears along their line of centres, (cos α, sin α).
        "late_x": cos(alpha) / (sin(alpha) * pair.base_pitch_mm * 1e-3),
        "late_y": 1.0 / (pair.base_pitch_mm * 1e-3),
        "turn_x": base_radius[0] / (pair.action_length_mm * pair.base_pitch_mm * 1e-6),
        "cos_back": cos(2.0 * alpha),
        "sin_back": sin(2.0 * alpha),
        "inertia": inertia,
        "per_mass": 1.0 / mass,
        "per_inertia": 1.0 / inertia,
        "per_rotor": 1.0 / rotors,
        "mass_offset": np.array([w.mass_offset_m for w in machine.wheels]),
        "turns": any(w.runout_um > 0 or w.unbalance_g_mm > 0 for w in machine.wheels),
        "bending_stiffness": np.array([s.bending_stiffness_n_per_m for s in machine.shafts]),
        "bending_damping": np.array([s.bending_damping_n_s_per_m for s in machine.shafts]),
        "rotor_inertia": rotors,
        "tilt_x": cos(alpha) * tilt,
        "tilt_y": sin(alpha) * tilt,
    }
    record = np.zeros((), RECORD)
    values |= machine_fields(machine) | friction_fields(machine, operation, force) | bearing_fields(machine, force, rng)
    for name, value in values.items():
        record[name] = value
    curves = np.vstack((table.compliance.rows, table.separation.rows))
    rows = np.vstack((table.compliance.of, table.separation.of + len(table.compliance.rows)))
    return PairConstants(record[()], curves, rows, table.pitch_m)


def _filled(values: FloatArray) -> FloatArray:
    return np.pad(values, (0, MAX_SLICES - len(values)))


def mesh_mass_kg(machine: Machine) -> float:
    """Equivalent mass of the two gears along the line of action, 1/(r_b1²/J1 + r_b2²/J2)."""
    radii = machine.mesh.pair.base_radii_m
    return 1.0 / sum(r**2 / w.inertia_kg_m2 for r, w in zip(radii, machine.wheels, strict=True))


def mean_stiffness_n_per_m(machine: Machine, force_n: float) -> float:
    """Mean mesh stiffness of healthy teeth over a cycle, at the given force if contact stiffens with the load."""
    healthy = machine.mesh.healthy
    if healthy.contact_law == "linear":
        return mesh_stiffness(healthy).mean_n_per_m
    return mesh_stiffness(healthy, force_n=max(force_n, 1.0)).mean_n_per_m


# Start of a run: static equilibrium at the initial torque and speed, so that no initial impact has to decay.


def start_state(machine: Machine, operation: Operation, start_s: float) -> tuple[FloatArray, FloatArray]:
    """Coordinates and velocities at `start_s`, (16,) each: driver tooth 0 at its entry, steady rotation.

    Friction, roughness, run-out and unbalance are neglected in the equilibrium; their effect settles in a few cycles.
    """
    torque = float(operation.torque_nm.at(start_s))
    omega = float(operation.speed_rpm.at(start_s)) * pi / 30.0
    r1, r2 = machine.mesh.pair.base_radii_m
    force = torque / r1
    delta = 0.0
    if torque > 0.0:
        delta = float(share_torque(machine.mesh, torque, np.zeros(1)).transmission_error_m[0])
    q, v = np.zeros(N_COORDINATES), np.zeros(N_COORDINATES)
    loads = bearing_loads_n(machine, force)
    for row, support in enumerate(machine.bearings):
        size = float(np.hypot(*loads[row]))
        if support.law == "hertzian":
            foot = shaft_place_m(support, loads[row])
        else:
            foot = loads[row] / support.stiffness_n_per_m
            if size > 0.0:
                foot = foot + 1e-6 * support.clearance_um * loads[row] / size
        q[8 + 2 * row : 10 + 2 * row] = foot
    beta = np.radians(machine.line_of_action_deg)
    down = -machine.gravity_mps2 * np.array([np.sin(beta), np.cos(beta)])
    for side in range(2):
        place = slice(4 + 2 * side, 6 + 2 * side)
        mesh = np.array([0.0, -force if side == 0 else force])
        load = mesh + machine.wheels[side].mass_kg * down
        bearings = 0.5 * (q[8 + 4 * side : 10 + 4 * side] + q[10 + 4 * side : 12 + 4 * side])
        q[place] = bearings + load / machine.shafts[side].bending_stiffness_n_per_m
    # δ = r1 θ1 − r2 θ2 + y1 − y2 with θ1 = 0.
    q[2] = (q[5] - q[7] - delta) / r2
    q[0] = torque / machine.shafts[0].torsional_stiffness_nm_per_rad
    q[3] = q[2] - torque * machine.ratio / machine.shafts[1].torsional_stiffness_nm_per_rad
    v[0] = v[1] = omega
    v[2] = v[3] = omega / machine.ratio
    return q, v


# The linearised machine: mass and stiffness matrices, eigenfrequencies, and the step that follows from them.

STEP_ANGLE_RAD = 0.28
"""Step times the maximum angular eigenfrequency. RK4 is stable up to 2.8; at 0.28 the error is 3e-4 of the
accelerations and 1e-6 to 1e-5 of the transmission error's rms, 1e-4 where teeth rattle."""
STABLE = 2.0
"""Step times the fastest rate of the damped machine; RK4 diverges from 2.8 on."""
STEPS_PER_RAMP = 6
"""Minimum number of steps in which a tooth pair takes up its load."""


def matrices(machine: Machine, force_n: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """M, K and C for small motions about the loaded state, with the mean mesh stiffness, (16, 16) each."""
    wheels, shafts, bearings = machine.wheels, machine.shafts, machine.bearings
    masses = [shafts[0].rotor_inertia_kg_m2, *(w.inertia_kg_m2 for w in wheels), shafts[1].rotor_inertia_kg_m2]
    masses += [w.mass_kg for w in wheels for _ in range(2)] + [b.mass_kg for b in bearings for _ in range(2)]
    mesh = mean_stiffness_n_per_m(machine, force_n)
    stiffness = _assembled(
        machine,
        mesh,
        [s.torsional_stiffness_nm_per_rad for s in shafts],
        [s.bending_stiffness_n_per_m for s in shafts],
        [
            stiffness_under_load_n_per_m(b, load)
            for b, load in zip(bearings, bearing_loads_n(machine, force_n), strict=True)
        ],
    )
    damping = _assembled(
        machine,
        2.0 * machine.mesh_damping_ratio * sqrt(mesh * mesh_mass_kg(machine)),
        [s.torsional_damping_nm_s_per_rad for s in shafts],
        [s.bending_damping_n_s_per_m for s in shafts],
        [b.damping_n_s_per_m for b in bearings],
    )
    damping[0, 0] += governor_nm_s_per_rad(machine)
    return np.diag(masses), stiffness, damping


def _assembled(
    machine: Machine, mesh: float, torsion: list[float], bending: list[float], bearings: list[float]
) -> FloatArray:
    """Assemble the springs, or the dampers, between the coordinates that they connect, (16, 16)."""
    pair, total = machine.mesh.pair, np.zeros((N_COORDINATES,) * 2)

    def join(places: list[int], signs: list[float], size: float) -> None:
        line = np.zeros(N_COORDINATES)
        line[places] = signs
        total[:] += size * np.outer(line, line)

    alpha, tilt = pair.working_pressure_angle_rad, tilting_shares(machine)
    tilted = [float(s * t * c) for t in tilt for s in (-1.0, 1.0) for c in (cos(alpha), sin(alpha))]
    r1, r2 = pair.base_radii_m
    turned = [r1, -r2, 1.0, -1.0]
    join([1, 2, 5, 7, *range(8, 16)], [*turned, *tilted], mesh)
    for side in range(2):
        join([3 * side, 1 + side], [1.0, -1.0], torsion[side])
        for axis in range(2):
            places = [4 + 2 * side + axis, 8 + 4 * side + axis, 10 + 4 * side + axis]
            join(places, [1.0, -0.5, -0.5], bending[side])
    for row, size in enumerate(bearings):
        for axis in range(2):
            join([8 + 2 * row + axis], [1.0], size)
    return total


def eigenfrequencies_hz(machine: Machine, force_n: float = 0.0) -> FloatArray:
    """Undamped eigenfrequencies in ascending order, (16,); the first is the rigid rotation, 0."""
    m, k, _ = matrices(machine, force_n)
    return _frequencies_hz(m, k)


def _frequencies_hz(m: FloatArray, k: FloatArray) -> FloatArray:
    from scipy.linalg import eigh

    squares = eigh(k, m, eigvals_only=True)
    return np.sqrt(np.maximum(squares, 0.0)) / (2.0 * pi)


def _eigenvalues_per_s(m: FloatArray, k: FloatArray, c: FloatArray) -> NDArray[np.complex128]:
    """Eigenvalues of the damped machine, (32,): to a solver, strong dampers are as stiff as springs."""
    n, per_mass = N_COORDINATES, 1.0 / np.diag(m)[:, None]
    state = np.zeros((2 * n, 2 * n))
    state[:n, n:] = np.eye(n)
    state[n:, :n], state[n:, n:] = -per_mass * k, -per_mass * c
    return np.linalg.eigvals(state).astype(np.complex128)


def mesh_force_n(machine: Machine, operation: Operation) -> float:
    """Static mesh force at the maximum torque."""
    return operation.torque_nm.largest / machine.mesh.pair.base_radii_m[0]


def slowest_decay_s(machine: Machine, operation: Operation) -> float:
    """Time in which the slowest-decaying motion, of the vibrations or of the controlled speed, falls to 1/e."""
    eigenvalues = _eigenvalues_per_s(*matrices(machine, mesh_force_n(machine, operation)))
    ringing = eigenvalues[np.abs(eigenvalues.imag) > 1.0]
    recovery = 2.0 * total_inertia_kg_m2(machine) / governor_nm_s_per_rad(machine)
    return max(recovery, 1.0 / max(float(-ringing.real.max()), 1e-3) if len(ringing) else 0.0)


def default_step_s(machine: Machine, operation: Operation, step_angle_rad: float = STEP_ANGLE_RAD) -> float:
    """Integration step that stiffness, damping and tooth passage allow."""
    m, k, c = matrices(machine, mesh_force_n(machine, operation))
    fastest = 2.0 * pi * float(_frequencies_hz(m, k)[-1])
    step = min(step_angle_rad / fastest, STABLE / float(np.abs(_eigenvalues_per_s(m, k, c)).max()))
    mesh_hz = operation.speed_rpm.largest / 60.0 * machine.mesh.pair.driver.teeth
    if mesh_hz > 0.0 and machine.mesh.ramp > 0.0:
        step = min(step, machine.mesh.ramp / mesh_hz / STEPS_PER_RAMP)
    return step


STEPS_PER_CALL = 200_000
"""Compiled code cannot be interrupted, so it returns about every quarter of a second."""


@dataclass(frozen=True)
class PairState:
    """State of a machine from which a later run can continue.

    Parameters
    ----------
    q, v : array, (16,)
        Coordinates and velocities, see `sims.cracked.COORDINATES`.
    set_angle_rad : float
        Set angle of the drive's rotor.
    """

    q: FloatArray
    v: FloatArray
    set_angle_rad: float


Response = PairResponse[PairState]
"""Response of a run: signals of `SIGNALS`, and its last state."""


@dataclass(frozen=True)
class PreparedRun:
    """A run that is ready to start: constants, initial state, set profiles and roughness."""

    constants: PairConstants
    q: FloatArray
    v: FloatArray
    speed: FloatArray
    torque: FloatArray
    roughness: TimeLockedRoughness


def prepare(
    machine: Machine,
    operation: Operation,
    rng: np.random.Generator,
    start_s: float = 0.0,
    first: PairState | None = None,
) -> PreparedRun:
    """Draw the random parts, tabulate the machine, and find the initial state if none is given."""
    rough_rng, bearing_rng = rng.spawn(2)  # the draws of each do not depend on the other
    machine, roughness = draw_roughness(machine, rough_rng)
    q, v = start_state(machine, operation, start_s) if first is None else _checked(first)
    return PreparedRun(
        constants(machine, operation, bearing_rng),
        q,
        v,
        profile_points(operation.speed_rpm, pi / 30.0),
        profile_points(operation.torque_nm, 1.0),
        roughness,
    )


def respond(
    machine: Machine,
    operation: Operation,
    *,
    duration_s: float,
    rng: np.random.Generator,
    signals: Sequence[str] = ("driver y", "driver y velocity", "driver y acceleration", "transmission_error_m"),
    start_s: float = 0.0,
    step_s: float | None = None,
    stride: int = 1,
    first: PairState | None = None,
) -> Response:
    """Integrate the sixteen coordinates from static equilibrium, or from the end of another run.

    Parameters
    ----------
    machine : Machine
    operation : Operation
        Set speed and torque; time 0 of their profiles is time 0 here.
    duration_s : float
    rng : numpy.random.Generator
        Draws the roughness, then the positions of the rolling elements.
    signals : sequence of str
        From `sims.cracked.SIGNALS`.
    start_s : float
        First time; below 0 for a lead-in.
    step_s : float or None
        None: `sims.cracked.default_step_s`.
    stride : int
        Steps per kept point.
    first : PairState or None
        `Response.last` of another run; None: static equilibrium at `start_s`.

    Raises
    ------
    InputError
        For an unknown signal, or a run of too many steps.
    RefusalError
        If the solution diverges: the step is too long.

    Notes
    -----
    Classical fourth-order Runge–Kutta method. Where a tooth pair loses contact its force has a kink, and the order is
    lower for that step.
    """
    step = default_step_s(machine, operation) if step_s is None else step_s
    plan = RunPlan(start_s, duration_s, step, stride, STEPS_PER_CALL)
    ready = prepare(machine, operation, rng, start_s, first)
    q, v = ready.q.copy(), ready.v.copy()  # the kernel overwrites them
    set_angle = q[:1].copy() if first is None else np.array([first.set_angle_rad])
    known = [known_name(name, SIGNALS, f"there is no signal {name!r}") for name in signals]
    select = np.array([SIGNALS.index(name) for name in known], dtype=np.int64)
    phasors = ready.roughness.phasors(step / 2.0)

    def march(time_s: float, n_steps: int, rows: FloatArray, energies: FloatArray) -> int:
        return int(
            integrate(
                *ready.constants.arguments,
                q,
                v,
                set_angle,
                time_s,
                step,
                n_steps,
                stride,
                ready.speed,
                ready.torque,
                phasors,
                select,
                rows,
                energies,
            )
        )

    kept, energies = plan.run(
        march,
        signals,
        with_energy=False,
        remedy="check that stiffness, damping and inertia are consistent, or give a shorter step_s",
    )
    last = PairState(q, v, float(set_angle[0]))
    return Response(start_s, step * stride, kept, step, energies, last)


def _checked(state: PairState) -> tuple[FloatArray, FloatArray]:
    """Check another run's last state; return its coordinates and velocities."""
    if state.q.shape != (N_COORDINATES,) or state.v.shape != (N_COORDINATES,):
        raise InputError(
            f"a state of {state.q.size} coordinates",
            where="first",
            allowed=f"{N_COORDINATES}, as in another run's last state",
        )
    return state.q, state.v


TOLERANCE = 1e-4
"""Relative error of the transmission error's rms that counts as converged."""


def check_convergence(
    machine: Machine,
    operation: Operation,
    rng: np.random.Generator,
    *,
    duration_s: float = 0.5,
    step_s: float | None = None,
) -> StepConvergence:
    """Compare runs of the same machine and roughness with the step in use, half of it and a quarter of it.

    Parameters
    ----------
    machine : Machine
    operation : Operation
    rng : numpy.random.Generator
    duration_s : float
        Of each run; its second half is compared. In chaotic motion (light load, rattle) no step converges, as two runs
        diverge however close they start.
    step_s : float or None
        None: the default.
    """
    step = default_step_s(machine, operation) if step_s is None else step_s
    seed = int(rng.integers(2**63))
    runs = [
        respond(
            machine,
            operation,
            duration_s=duration_s,
            rng=np.random.default_rng(seed),
            signals=("transmission_error_m",),
            step_s=step / part,
            stride=part,
        )
        for part in (1, 2, 4)
    ]
    return StepConvergence.of(runs, TOLERANCE, first=0.5)
