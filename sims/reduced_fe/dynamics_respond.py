"""Run a flexible pair and return what it does: transmission error, forces, displacements, accelerations."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import ceil, pi

import numpy as np
from numpy.typing import NDArray

from gearsig.checks import FloatArray, closest_match_hint, count, positive
from gearsig.errors import InputError, RefusalError
from sims.gear_pair.measurement import COORDINATES
from sims.machine.operation import Course, Operation
from sims.reduced_fe.dynamics_constants import Constants, FlexiblePair, back_rows, constants
from sims.reduced_fe.dynamics_stability import check_step
from sims.reduced_fe.dynamics_start import start_state
from sims.reduced_fe.integrate_coefficients import Method, step_coefficients

STEP_S = 5e-6
"""Step where none is given; see `sims.reduced_fe.dynamics_convergence` for what it costs in accuracy."""
MOST_STEPS = 400_000_000
"""Half an hour of computing or so; more is taken for a mistake."""
STEPS_PER_CALL = 100_000
"""Compiled code cannot be interrupted: it comes back for a look every quarter of a second or so."""
MOVING = COORDINATES
"""Places in rad and m, each also with " velocity" and " acceleration". Those of gears are of their hubs."""
EXTRAS = ("mesh_force_n", "back_force_n", "mesh_cycles", "approach_m", "contact_torque_nm", "friction_n")
"""Sum of the contact forces, the force behind, c, the greatest approach of flanks, torque of moving stiffness, friction
along x on the driven gear."""
TRANSMISSION_ERROR = "transmission_error_m"
"""r_b1 θ1 − r_b2 θ2 of the hubs."""
KINDS = ("", " velocity", " acceleration")


@dataclass(frozen=True)
class FlexState:
    """Where a flexible pair is: what a later run needs to go on from there; see `integrate_kernel.march`."""

    q: FloatArray
    v: FloatArray
    f: FloatArray
    f_before: FloatArray
    force: FloatArray
    root: FloatArray
    pair: FloatArray
    rest: FloatArray

    @property
    def arrays(self) -> tuple[FloatArray, ...]:
        """Copies, which the kernel overwrites."""
        fields = (self.q, self.v, self.f, self.f_before, self.force, self.root, self.pair, self.rest)
        return tuple(np.array(a) for a in fields)


@dataclass(frozen=True)
class FlexResponse:
    """Signals of a run on an even grid of time.

    Parameters
    ----------
    start_s, interval_s : float
    signals : mapping
        Name → (n,), in m, rad, s, N.
    step_s : float
        Of the integrator.
    energy_j : array
        (n,), or empty where it was not asked for.
    last : FlexState
    """

    start_s: float
    interval_s: float
    signals: Mapping[str, FloatArray]
    step_s: float
    energy_j: FloatArray
    last: FlexState

    @property
    def time_s(self) -> FloatArray:
        """Times of the points."""
        return self.start_s + self.interval_s * np.arange(len(next(iter(self.signals.values()))))

    def __getitem__(self, name: str) -> FloatArray:
        """Return a signal by its name."""
        return self.signals[name]


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
    ready: Constants | None = None,
    on_progress: Callable[[float], None] | None = None,
) -> FlexResponse:
    """Integrate from the static balance on, or from where another run ended.

    Parameters
    ----------
    pair : FlexiblePair
    operation : Operation
        Set speed and torque; time 0 of their courses is time 0 here.
    duration_s : float
    signals : sequence of str
        Of `signal_names`.
    start_s : float
        First time; below 0 for a lead-in.
    step_s : float
    stride : int
        Every how many steps a point is kept.
    method : str
        "exponential": fast, each step taken once. "newmark": the reference; average acceleration, each step repeated
        until forces stay to 1e-11.
    with_energy : bool
        Meaningful without set speed, damping, governor and weight.
    first : FlexState or None
        `FlexResponse.last` of another run; None: the static balance at `start_s`.
    ready : Constants or None
        Of this pair and operation, where they are at hand.
    on_progress : callable or None
        Called now and then with the part that is done, 0 to 1.

    Raises
    ------
    InputError
        On an unknown signal, a run of more than `MOST_STEPS` steps, or a contact damped more than its gears can follow.
    RefusalError
        If the solution grows beyond all bounds.
    """
    from sims.reduced_fe.integrate_kernel import march, room

    step, every = positive(step_s, "step_s", "s"), count(stride, "stride")
    n_steps = ceil(positive(duration_s, "duration_s", "s") / step - 1e-9)
    if n_steps > MOST_STEPS:
        raise InputError(
            f"{n_steps:.3g} steps of {step:.3g} s", where="duration_s", allowed=f"at most {MOST_STEPS:.0e} steps"
        )
    own = constants(pair, operation) if ready is None else ready
    lines = _lines(own, signals)
    coefficients = np.array([step_coefficients(s.omega_rad_s, s.damping_rate, step, method) for s in own.sides])
    check_step(pair, own, operation, coefficients, method)
    state = (start_state(pair, own, operation, start_s) if first is None else first).arrays
    fixed = (
        own.record,
        own.table.arrays,
        own.stacked("rows"),
        own.turn(),
        coefficients,
        np.array([[s.omega_rad_s**2, s.damping_rate] for s in own.sides]),
        own.stacked("inputs"),
        own.stacked("rigid"),
        back_rows(pair.machine, own.sides),
    )
    courses = course_points(operation.speed_rpm, pi / 30.0), course_points(operation.torque_nm, 1.0)
    scratch = room(state[4].shape, state[0].shape[1], fixed[2].shape[3])
    rows = np.empty((-(-n_steps // every), len(signals)))
    energies = np.empty(len(rows) if with_energy else 0)
    per_call = every * max(STEPS_PER_CALL // every, 1)
    for begun in range(0, n_steps, per_call):
        n = min(per_call, n_steps - begun)
        part = slice(begun // every, begun // every + -(-n // every))
        energy = energies[part] if with_energy else energies
        time = start_s + begun * step
        found = rows[part]
        filled = march(
            *fixed, state, *courses, time, step, n, every, method == "newmark", lines, found, energy, scratch
        )
        if filled < len(found) or not np.isfinite(found).all():
            raise RefusalError(
                f"the solution grows beyond all bounds after {(begun + filled * every) * step:.3g} s",
                remedy="lower mesh_damping_ratio, look for inertias that do not go together, or give a shorter step",
            )
        if on_progress is not None:
            on_progress((begun + n) / n_steps)
    return FlexResponse(
        start_s, step * every, dict(zip(signals, rows.T, strict=True)), step, energies, FlexState(*state)
    )


def signal_names(ready: Constants) -> tuple[str, ...]:
    """Return all signals a run can give."""
    moving = [f"{name}{kind}" for kind in KINDS for name in (*MOVING, TRANSMISSION_ERROR)]
    return (*moving, *EXTRAS, *slot_names(ready))


def slot_names(ready: Constants) -> tuple[str, ...]:
    """Forces of the pairs that may touch, the newest first, then of their slices."""
    slots, slices = range(ready.table.n_slots), range(ready.table.n_slices)
    return (
        *(f"pair {j} force_n" for j in slots),
        *(f"pair {j} slice {s} force_n" for j in slots for s in slices),
    )


def course_points(course: Course, factor: float) -> FloatArray:
    """Times and values as kernels take them, (2, n)."""
    return np.ascontiguousarray(np.vstack((course.times_s, factor * np.asarray(course.values))), dtype=np.float64)


def _lines(own: Constants, signals: Sequence[str]) -> tuple[NDArray[np.int64], FloatArray, FloatArray]:
    """Kind, factors and factor of the set angle of each signal."""
    shape = (len(signals), 2, own.sides[0].n_modes)
    kinds, factors, along = np.zeros(len(signals), dtype=np.int64), np.zeros(shape), np.zeros(len(signals))
    extras = (*EXTRAS, *slot_names(own))
    for line, name in enumerate(signals):
        if name in extras:
            kinds[line] = 3 + extras.index(name)
            continue
        kind = next((i for i in (2, 1) if name.endswith(KINDS[i])), 0)
        place = name.removesuffix(KINDS[kind]) if kind else name
        if place not in (*MOVING, TRANSMISSION_ERROR):
            known = signal_names(own)
            raise InputError(f"there is no signal {name!r}", remedy=closest_match_hint(name, known))
        kinds[line] = kind
        along[line] = _place(own, place, factors[line])
    return kinds, factors, along


def _place(own: Constants, name: str, factors: FloatArray) -> float:
    """Fill the modal factors of a place; return that of the set angle."""
    one, two = own.sides
    if name == TRANSMISSION_ERROR:
        factors[0], factors[1] = one.hub, -two.hub
        return 0.0
    number = MOVING.index(name)
    if number < 4:
        side = number // 2
        rotor = number in (0, 3)
        factors[side] = own.sides[side].shapes[0] if rotor else own.sides[side].hub / own.base_radius_m[side]
        return 1.0 if side == 0 else 1.0 / float(own.record["ratio"])
    if number < 8:
        factors[(number - 4) // 2] = own.sides[(number - 4) // 2].shapes[8 + number % 2]
    else:
        factors[(number - 8) // 4] = own.sides[(number - 8) // 4].shapes[4 + (number - 8) % 4]
    return 0.0
