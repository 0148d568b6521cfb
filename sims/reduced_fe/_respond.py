"""The response of a flexible pair: transmission error, forces, displacements, accelerations; its eigenfrequencies."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from math import pi
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gearsig.checks import FloatArray, closest_match_hint, count, positive
from gearsig.errors import InputError
from gearsig.results import Result
from sims.fe_gear import MeshSize, ReductionPlan, Spread, one_thread, reduce_gear
from sims.gear_pair import COORDINATES, DEFLECTIONS, PairResponse, RunPlan, StepConvergence, profile_points
from sims.machine import Operation, Profile
from sims.mesh import one_mesh_cycle
from sims.reduced_fe._contact import force_map
from sims.reduced_fe._integrate import Method, march, room, step_coefficients
from sims.reduced_fe._pair import (
    FlexiblePair,
    FlexiblePairConstants,
    back_rows,
    constants,
    contact_rows,
    hub_inertia,
    torsional_over_cycle,
    undamped_modes,
)

# Stability of a step: errors must not grow from step to step.
#
# A contact that is stiff or strongly damped relative to the light parts behind it amplifies errors at each step. The
# result is bounded by the loss of contact and looks like impacts.

MAX_GROWTH = 1e-4
"""Maximum growth of errors per step. Without damping, steps of 5 µs have 4e-7; unstable steps have 1e-2 and more."""
N_POINTS = 5
MAX_HALVINGS = 3
USUAL_HUB = 2.0
"""Upper end of usual hub inertias, relative to the toothed body."""


def followed_step_s(
    pair: FlexiblePair, pair_constants: FlexiblePairConstants, operation: Operation, longest_s: float
) -> float:
    """Return the step, or its half, quarter or eighth, with which one pass can follow the contact.

    If none can, return the longest; `check_step` then gives the reason.
    """
    for halvings in range(MAX_HALVINGS + 1):
        step = longest_s * 0.5**halvings
        coefficients = np.array([step_coefficients(s.omega_rad_s, s.damping_rate, step) for s in pair_constants.sides])
        if growth(pair, pair_constants, operation, coefficients) <= MAX_GROWTH:
            return step
    return longest_s


def growth(
    pair: FlexiblePair, pair_constants: FlexiblePairConstants, operation: Operation, coefficients: FloatArray
) -> float:
    """Return the growth of errors of the loaded, linear pair in a one-pass step, at the worst of several mesh angles.

    It is the spectral radius, less 1, of the map of (q, v, f, f of the step before) by `march`, with the contact as
    springs S and dampers τS between ∂D/∂η·q.

    Parameters
    ----------
    pair : FlexiblePair
    pair_constants : FlexiblePairConstants
    operation : Operation
    coefficients : array, (2, 8, n_modes)
        See `step_coefficients`.
    """
    qq, qv, vq, vv, q0, q1, v0, v1 = (np.diag(np.concatenate(c)) for c in np.moveaxis(coefficients, 1, 0))
    nothing, same = np.zeros_like(qq), np.eye(len(qq))
    extrapolated = np.hstack((nothing, nothing, 2.0 * same, -same))
    free_q, free_v = np.hstack((qq, qv, q0, nothing)), np.hstack((vq, vv, v0, nothing))
    extrapolated_motion = (
        free_q + q1 @ extrapolated + float(pair_constants.record["damping_time"]) * (free_v + v1 @ extrapolated)
    )
    worst = 0.0
    for cycles in one_mesh_cycle(N_POINTS):
        rows, stiff = contact_rows(pair, pair_constants, operation, cycles)
        force = -rows.T @ stiff @ rows @ extrapolated_motion
        step = np.vstack(
            (free_q + q1 @ force, free_v + v1 @ force, force, np.hstack((nothing, nothing, same, nothing)))
        )
        worst = max(worst, float(np.abs(np.linalg.eigvals(step)).max()))
    return worst - 1.0


def check_step(
    pair: FlexiblePair,
    pair_constants: FlexiblePairConstants,
    operation: Operation,
    coefficients: FloatArray,
    method: Method,
) -> None:
    """Reject a step in which errors grow, or, for the method with repeated passes, one whose passes do not converge.

    Raises
    ------
    InputError
        If hubs are too heavy for their teeth, the damping ratio is too high, or the step is too long.
    """
    if method == "exponential" and growth(pair, pair_constants, operation, coefficients) <= MAX_GROWTH:
        return
    if method == "newmark" and _pass_gain(pair, pair_constants, operation, coefficients) <= 1.0:
        return
    hubs = [hub_inertia(pair.machine, i, gear)[1] / gear.polar_inertia_kg_m2 for i, gear in enumerate(pair.gears)]
    worst = int(np.argmax(hubs))
    raise InputError(
        f"the contact is too stiff or too strongly damped for its gears: hubs have {hubs[0]:.2g} and "
        f"{hubs[1]:.2g} times the inertia of the toothed bodies, damping ratio {pair.machine.mesh_damping_ratio:g}",
        where=f"hub_inertia_{('driver', 'driven')[worst]}_kg_m2" if hubs[worst] > USUAL_HUB else "mesh_damping_ratio",
        allowed="about 6 times at a damping ratio of 0.08, or 0.2 with lighter hubs",
        remedy="give hubs that suit the gears, lower mesh_damping_ratio, or give a shorter step",
    )


def _pass_gain(
    pair: FlexiblePair, pair_constants: FlexiblePairConstants, operation: Operation, coefficients: FloatArray
) -> float:
    """Change of a contact force over that of the force assumed in a pass: passes converge if it is below 1."""
    moved = np.concatenate(coefficients[:, 5] + float(pair_constants.record["damping_time"]) * coefficients[:, 7])
    gain = 0.0
    for cycles in one_mesh_cycle(N_POINTS):
        rows, stiff = contact_rows(pair, pair_constants, operation, cycles)
        gain = max(gain, float(np.abs(np.linalg.eigvals(stiff @ (rows * moved) @ rows.T)).max(initial=0.0)))
    return gain


STEP_S = 5e-6
"""Default step; see `check_convergence` for its accuracy."""
STEPS_PER_CALL = 100_000
"""Compiled code cannot be interrupted, so it returns about every quarter of a second."""
MOVING = COORDINATES
"""Coordinates in rad and m, each also with " velocity" and " acceleration". Those of gears are of their hubs."""
EXTRAS = ("mesh_force_n", "back_force_n", "mesh_cycles", "approach_m", "contact_torque_nm", "friction_n", *DEFLECTIONS)
"""Sum of the contact forces, back-flank force, c, maximum approach of flanks, torque of the moving stiffness, friction
along x on the driven gear, and `sims.gear_pair.DEFLECTIONS`."""
TRANSMISSION_ERROR = "transmission_error_m"
"""r_b1 θ1 − r_b2 θ2 of the hubs."""
KINDS = ("", " velocity", " acceleration")


class FlexState(NamedTuple):
    """State of a flexible pair from which a later run can continue; see `march`."""

    q: FloatArray
    v: FloatArray
    f: FloatArray
    f_before: FloatArray
    force: FloatArray
    root: FloatArray
    pair: FloatArray
    rest: FloatArray


FlexResponse = PairResponse[FlexState]
"""Response of a run: signals of `signal_names`, and its last state."""


@one_thread()
def respond(
    pair: FlexiblePair,
    operation: Operation,
    *,
    duration_s: float,
    signals: Sequence[str] = (TRANSMISSION_ERROR, "mesh_force_n"),
    start_s: float = 0.0,
    step_s: float = STEP_S,
    stride: int = 1,
    method: Method = "exponential",
    with_energy: bool = False,
    first: FlexState | None = None,
    ready: FlexiblePairConstants | None = None,
) -> FlexResponse:
    """Integrate a flexible pair from static equilibrium, or from the end of another run.

    Parameters
    ----------
    pair : FlexiblePair
    operation : Operation
        Set speed and torque; time 0 of their profiles is time 0 here.
    duration_s : float
    signals : sequence of str
        From `signal_names`.
    start_s : float
        First time; below 0 for a lead-in.
    step_s : float
    stride : int
        Steps per kept point.
    method : str
        "exponential": fast, one pass per step. "newmark": the reference; average acceleration, each step repeated
        until forces converge to 1e-11.
    with_energy : bool
        Meaningful without set speed, damping, governor and weight.
    first : FlexState or None
        `FlexResponse.last` of another run; None: static equilibrium at `start_s`.
    ready : FlexiblePairConstants or None
        Those of this pair and operation, if already made.

    Raises
    ------
    InputError
        For an unknown signal, a run of too many steps, or a contact too strongly damped for its gears.
    RefusalError
        If the solution diverges.
    """
    step = positive(step_s, "step_s", "s")
    plan = RunPlan(start_s, duration_s, step, stride, STEPS_PER_CALL)
    pair_constants = constants(pair, operation) if ready is None else ready
    lines = _lines(pair_constants, signals)
    coefficients = np.array(
        [step_coefficients(s.omega_rad_s, s.damping_rate, step, method) for s in pair_constants.sides]
    )
    check_step(pair, pair_constants, operation, coefficients, method)
    begin = start_state(pair, pair_constants, operation, start_s) if first is None else first
    state = tuple(np.array(a) for a in begin)  # copies, which the kernel overwrites
    fixed = (
        pair_constants.record,
        pair_constants.table.arrays,
        pair_constants.stacked("rows"),
        pair_constants.turn(),
        coefficients,
        np.array([[s.omega_rad_s**2, s.damping_rate] for s in pair_constants.sides]),
        pair_constants.stacked("inputs"),
        pair_constants.stacked("rigid"),
        back_rows(pair.machine, pair_constants.sides),
    )
    profiles = profile_points(operation.speed_rpm, pi / 30.0), profile_points(operation.torque_nm, 1.0)
    scratch = room(state[4].shape, state[0].shape[1], fixed[2].shape[3])

    def part(time_s: float, n_steps: int, rows: FloatArray, energies: FloatArray) -> int:
        is_newmark = method == "newmark"
        return int(
            march(*fixed, state, *profiles, time_s, step, n_steps, stride, is_newmark, lines, rows, energies, scratch)
        )

    kept, energies = plan.run(
        part,
        signals,
        with_energy=with_energy,
        remedy="lower mesh_damping_ratio, check that the inertias are consistent, or give a shorter step",
    )
    return FlexResponse(start_s, step * stride, kept, step, energies, FlexState(*state))


def signal_names(ready: FlexiblePairConstants) -> tuple[str, ...]:
    """Return the names of all signals of a run."""
    moving = [f"{name}{kind}" for kind in KINDS for name in (*MOVING, TRANSMISSION_ERROR)]
    return (*moving, *EXTRAS, *slot_names(ready))


def slot_names(ready: FlexiblePairConstants) -> tuple[str, ...]:
    """Names of the forces of the pairs that may be in contact, the newest first, then of their slices."""
    slots, slices = range(ready.table.n_slots), range(ready.table.n_slices)
    return (
        *(f"pair {j} force_n" for j in slots),
        *(f"pair {j} slice {s} force_n" for j in slots for s in slices),
    )


def _lines(
    pair_constants: FlexiblePairConstants, signals: Sequence[str]
) -> tuple[NDArray[np.int64], FloatArray, FloatArray]:
    """Kind, modal factors and factor of the set angle of each signal."""
    shape = (len(signals), 2, pair_constants.sides[0].n_modes)
    kinds, factors, along = np.zeros(len(signals), dtype=np.int64), np.zeros(shape), np.zeros(len(signals))
    extras = (*EXTRAS, *slot_names(pair_constants))
    for line, name in enumerate(signals):
        if name in extras:
            kinds[line] = 3 + extras.index(name)
            continue
        kind = next((i for i in (2, 1) if name.endswith(KINDS[i])), 0)
        place = name.removesuffix(KINDS[kind]) if kind else name
        if place not in (*MOVING, TRANSMISSION_ERROR):
            known = signal_names(pair_constants)
            raise InputError(f"there is no signal {name!r}", remedy=closest_match_hint(name, known))
        kinds[line] = kind
        along[line] = _place(pair_constants, place, factors[line])
    return kinds, factors, along


def _place(pair_constants: FlexiblePairConstants, name: str, factors: FloatArray) -> float:
    """Fill the modal factors of a coordinate; return that of the set angle."""
    driver, driven = pair_constants.sides
    if name == TRANSMISSION_ERROR:
        factors[0], factors[1] = driver.hub, -driven.hub
        return 0.0
    number = MOVING.index(name)
    if number < 4:
        side = number // 2
        rotor = number in (0, 3)
        factors[side] = (
            pair_constants.sides[side].shapes[0]
            if rotor
            else pair_constants.sides[side].hub / pair_constants.base_radius_m[side]
        )
        return 1.0 if side == 0 else 1.0 / float(pair_constants.record["ratio"])
    if number < 8:
        factors[(number - 4) // 2] = pair_constants.sides[(number - 4) // 2].shapes[8 + number % 2]
    else:
        factors[(number - 8) // 4] = pair_constants.sides[(number - 8) // 4].shapes[4 + (number - 8) % 4]
    return 0.0


# Start of a run: static equilibrium at the initial torque, so that no initial impact has to decay.

DEEPEST_M = 1e-3
"""Bound above any approach of flanks."""
MIN_HZ = 1.0
"""Minimum frequency of modes that deflect in the equilibrium; slower ones are rigid motion."""


def start_state(
    pair: FlexiblePair, pair_constants: FlexiblePairConstants, operation: Operation, start_s: float
) -> FlexState:
    """Return the state in which the flanks carry the initial torque in steady rotation, with tooth 0 at its entry.

    The modes have the deflection under the mean contact force; the driven side is turned until the contact carries it.
    """
    torque = float(operation.torque_nm.at(start_s))
    q = np.zeros((2, pair_constants.sides[0].n_modes))
    force = torque / pair_constants.base_radius_m[0]
    column = pair_constants.table.column(0.0)
    for index, side in enumerate(pair_constants.sides):
        drive = torque if index == 0 else -torque * float(pair_constants.record["ratio"])
        load = side.inputs[0] * drive
        load[: side.rows.shape[-1]] -= force * side.rows[column].mean(axis=0)
        soft = side.omega_rad_s > 2.0 * np.pi * MIN_HZ
        q[index, soft] = load[soft] / side.omega_rad_s[soft] ** 2
    shape = pair_constants.table.n_slots, pair_constants.table.n_slices
    small = float(pair_constants.record["small"])
    state = FlexState(
        q,
        np.zeros_like(q),
        np.zeros_like(q),
        np.zeros_like(q),
        np.zeros(shape),
        np.full(shape, small**-0.1),
        np.full(pair_constants.table.n_slots, -1e9),
        np.zeros(3),
    )
    return state if force <= 0.0 else _closed(pair, pair_constants, state, force)


def _closed(pair: FlexiblePair, pair_constants: FlexiblePairConstants, state: FlexState, force: float) -> FlexState:
    """Return the state with the driven side turned rigidly until the flanks carry `force` at ζ = 0."""
    from scipy.optimize import brentq

    table = pair_constants.table
    rigid = pair_constants.sides[1]
    free = np.flatnonzero(rigid.omega_rad_s == 0.0)
    free = free[np.abs(rigid.hub[free]) > 0.0][0]
    column = table.column(0.0)

    def approach(q: FloatArray) -> float:
        total = 0.0
        for index, side in enumerate(pair_constants.sides):
            n = side.rows.shape[-1]
            total += float(side.rows[column].mean(axis=0) @ q[index, :n])
        return total

    def missing(depth: float) -> float:
        return float(force_map(table, pair.machine.mesh, np.array([depth]), np.zeros(1)).force_n[0, 0]) - force

    # Below 0: a tooth that is ahead of its position carries before the others would touch.
    depth = float(brentq(missing, -DEEPEST_M, DEEPEST_M, xtol=1e-12))
    q = state.q.copy()
    per_unit = float(rigid.rows[column].mean(axis=0)[free])
    q[1, free] += (depth - approach(q)) / per_unit
    return state._replace(q=q)


# Slow sweeps over speed, up or down: rms of the dynamic transmission error, contact loss, jumps.

STRIDE = 10
"""Steps per kept point."""
JUMP = 1.4
"""Ratio of rms values from which a change counts as a jump."""


@dataclass(frozen=True)
class SpeedSweep(Result):
    """Results of a sweep in equal parts of its time.

    Parameters
    ----------
    speed_rpm : array, (n,)
        Mean of each part, in time order.
    mesh_hz : array, (n,)
    rms_m : array, (n,)
        Of the dynamic transmission error about its mean in each part.
    minimum_force_n : array, (n,)
        Minimum of the mesh force.
    lost_part : array, (n,)
        Fraction of the time without contact on the driving flanks.
    n_steps : int
    step_s : float
    """

    speed_rpm: FloatArray
    mesh_hz: FloatArray
    rms_m: FloatArray
    minimum_force_n: FloatArray
    lost_part: FloatArray
    n_steps: int
    step_s: float

    def peak_hz(self, low_hz: float, high_hz: float) -> float:
        """Mesh frequency of the maximum rms value between two frequencies."""
        inside = (self.mesh_hz >= low_hz) & (self.mesh_hz <= high_hz)
        if not np.any(inside):
            raise InputError(f"no part of the sweep lies in {low_hz:g} to {high_hz:g} Hz", where="peak_hz")
        return float(self.mesh_hz[inside][np.argmax(self.rms_m[inside])])

    def jump_hz(self, low_hz: float, high_hz: float) -> float | None:
        """Mesh frequency of the largest jump of the rms value in a range; None if none reaches `JUMP`."""
        inside = np.flatnonzero((self.mesh_hz >= low_hz) & (self.mesh_hz <= high_hz))
        level = np.log(self.rms_m[inside])
        change = np.abs(level[2:] - level[:-2])
        place = int(np.argmax(change))
        return float(self.mesh_hz[inside[place + 1]]) if change[place] >= np.log(JUMP) else None


def speed_sweep(
    pair: FlexiblePair,
    torque_nm: float,
    first_rpm: float,
    last_rpm: float,
    duration_s: float,
    *,
    n_parts: int = 200,
    step_s: float = STEP_S,
) -> SpeedSweep:
    """Run a pair through a range of speeds at constant torque.

    Parameters
    ----------
    pair : FlexiblePair
    torque_nm : float
        On the driver. The drive also supplies the torque that accelerates the rotors.
    first_rpm, last_rpm : float
        Of the driver; up or down.
    duration_s : float
        Jumps shift with the rate of a fast sweep: 100 to 400 rpm/s is slow for a pair with a few kHz.
    n_parts : int
    step_s : float
    """
    positive(duration_s, "duration_s", "s")
    operation = Operation(Profile.of([0.0, duration_s], [first_rpm, last_rpm]), Profile.constant(torque_nm))
    run = respond(
        pair,
        operation,
        duration_s=duration_s,
        signals=(TRANSMISSION_ERROR, "mesh_force_n"),
        step_s=step_s,
        stride=STRIDE,
        ready=constants(pair, operation),
    )
    n = len(run[TRANSMISSION_ERROR]) // count(n_parts, "n_parts")
    error, force = (run[name][: n * n_parts].reshape(n_parts, n) for name in (TRANSMISSION_ERROR, "mesh_force_n"))
    speed = np.asarray(operation.speed_rpm.at((np.arange(n_parts) + 0.5) * n * run.interval_s))
    return SpeedSweep(
        speed,
        speed / 60.0 * pair.machine.mesh.pair.driver.teeth,
        error.std(axis=1),
        force.min(axis=1),
        (force <= 0.0).mean(axis=1),
        round(duration_s / step_s),
        step_s,
    )


ALLOWED = 0.01
"""Allowed relative difference of rms values: with contact loss they are not known more accurately."""


def check_convergence(pair: FlexiblePair, operation: Operation, step_s: float, time_s: float = 0.05) -> StepConvergence:
    """Compare the fast method with Newmark's method at a quarter of the step, from the same static equilibrium.

    Where teeth lose contact and the motion is chaotic, single values diverge after a while at any step; rms values do
    not.

    Parameters
    ----------
    pair : FlexiblePair
    operation : Operation
    step_s : float
        Maximum step of the fast method, see `followed_step_s`.
    time_s : float
        Duration of the compared runs.
    """
    pair_constants = constants(pair, operation)
    step = followed_step_s(pair, pair_constants, operation, positive(step_s, "step_s", "s"))
    signals = (TRANSMISSION_ERROR, "mesh_force_n", "driver angle acceleration")
    run = partial(respond, pair, operation, duration_s=time_s, signals=signals, ready=pair_constants)
    return StepConvergence.of([run(step_s=step), run(step_s=step / 4, stride=4, method="newmark")], ALLOWED)


# --------------------
# Eigenfrequencies of the pair over the mesh angle, linearised about its loaded state.
# --------------------


def eigenfrequencies_hz(
    pair: FlexiblePair,
    operation: Operation,
    mesh_cycles: FloatArray | None = None,
    *,
    ready: FlexiblePairConstants | None = None,
) -> FloatArray:
    """Undamped eigenfrequencies of small motions about the loaded state at each mesh angle, (n_c, n), ascending.

    K = diag(ω²) + Σ rows S rowsᵀ with S = (R + h'(N))⁻¹ over the points in contact at the set torque.

    Parameters
    ----------
    pair : FlexiblePair
    operation : Operation
        Its maximum torque loads the contact.
    mesh_cycles : array or None
        None: 50 points of a cycle.
    ready : FlexiblePairConstants or None
        If already made.
    """
    pair_constants = constants(pair, operation) if ready is None else ready
    cycles = one_mesh_cycle(50) if mesh_cycles is None else mesh_cycles
    return np.array(
        [np.sqrt(np.maximum(undamped_modes(pair, pair_constants, operation, c)[0], 0.0)) / (2.0 * pi) for c in cycles]
    )


# --------------------
# Effect of the way in which contact forces are distributed over nodes: the check of RBE3 patches.
# --------------------


SPREADS: tuple[Spread, ...] = ("node", "patch", "section")
SIZE = MeshSize(n_across=3, n_gap=1, n_up=6, n_rim=2, n_body=2, n_along=1)
"""A coarse mesh shows the influence of nodes best: about six rows of cells up the flank."""
N_HEIGHTS = 41
"""About three points between two rows of nodes."""
DEGREE = 4
"""Degree of the polynomial in the roll angle that counts as smooth."""


@dataclass(frozen=True)
class SpreadingCheck:
    """The torsional mode over the mesh angle for each distribution of contact forces over nodes.

    Parameters
    ----------
    mesh_cycles : array, (n_c,)
    frequency_hz : mapping of "node", "patch", "section" to arrays, (n_c,)
    ripple : mapping
        Relative rms deviation of a tooth's compliance from a smooth curve over the height of its flank.
    """

    mesh_cycles: FloatArray
    frequency_hz: dict[Spread, FloatArray]
    ripple: dict[Spread, float]


def spreading_check(pair: FlexiblePair, operation: Operation, mesh_cycles: FloatArray) -> SpreadingCheck:
    """Reduce the pair's gears again on a coarse mesh, once per distribution, and follow the torsional mode.

    Parameters
    ----------
    pair : FlexiblePair
    operation : Operation
        Its maximum torque loads the contact.
    mesh_cycles : array

    Notes
    -----
    "node": force and motion of one line of nodes across the face, interpolated between lines: the local indentation
    depends on the contact's position between nodes. "patch": RBE3 over the flank's nodes around the point. "section":
    the whole cross-section at that height, as used in the simulations; its frequencies are higher, as the indentation
    is that of Hertz alone, while nodes and patches add their own.
    """
    frequency: dict[Spread, FloatArray] = {}
    ripple: dict[Spread, float] = {}
    first, second = (gear.blank for gear in pair.gears)
    for spread in SPREADS:
        plan = ReductionPlan(SIZE, n_heights=N_HEIGHTS, n_slices=1, spread=spread)
        reduced = reduce_gear(first, plan)
        gears = (reduced, reduced if second == first else reduce_gear(second, plan))
        respread = replace(pair, gears=gears)
        frequency[spread] = torsional_over_cycle(respread, constants(respread, operation), operation, mesh_cycles)[:, 0]
        inner = slice(2, N_HEIGHTS - 2)  # the ends of the involute have neighbours on one side only
        compliance = np.log(np.diag(reduced.clamped_compliance_m_per_n[0])[:N_HEIGHTS][inner])
        roll = reduced.grid.roll_rad[inner]
        smooth = np.polyval(np.polyfit(roll, compliance, DEGREE), roll)
        ripple[spread] = float(np.std(compliance - smooth))
    return SpreadingCheck(mesh_cycles, frequency, ripple)
