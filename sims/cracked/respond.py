"""Run the model and return what it does: displacements, velocities, accelerations, mesh force, transmission error."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import ceil, pi

import numpy as np

from gearsig.checks import FloatArray, closest_match_hint, count, positive
from gearsig.errors import InputError, RefusalError
from sims.cracked.constants import Constants, constants
from sims.cracked.layout import SIGNALS
from sims.cracked.linear import default_step_s
from sims.cracked.start import start_state
from sims.gear_pair.roughness import draw_roughness
from sims.machine import Machine
from sims.machine.operation import Course, Operation
from sims.mesh.roughness import TimeLockedRoughness

MOST_STEPS = 400_000_000
"""Ten minutes of computing or so; more is taken for a mistake."""


STEPS_PER_CALL = 200_000
"""Compiled code cannot be interrupted: it comes back for a look every quarter of a second or so."""


@dataclass(frozen=True)
class State:
    """Where a machine is: what a later run needs to go on from there.

    Parameters
    ----------
    q, v : array, (16,)
        Coordinates and velocities, see `sims.cracked.layout.COORDINATES`.
    set_angle_rad : float
        Angle at which the drive wants its rotor to be.
    """

    q: FloatArray
    v: FloatArray
    set_angle_rad: float


@dataclass(frozen=True)
class Response:
    """Signals of a run on an even grid of time.

    Parameters
    ----------
    start_s, interval_s : float
    signals : mapping
        Name (see `sims.cracked.layout.SIGNALS`) → (n,), in m, rad, s, N.
    step_s : float
        Of the integrator.
    energy_j : array
        Potential, kinetic and gravitational energy, (n,), or empty where it was not asked for.
    last : State or None
        At the end of the last step: one step after the last point where every step is kept.
    """

    start_s: float
    interval_s: float
    signals: Mapping[str, FloatArray]
    step_s: float
    energy_j: FloatArray
    last: State | None = None

    @property
    def time_s(self) -> FloatArray:
        """Times of the points."""
        n = len(next(iter(self.signals.values())))
        return self.start_s + self.interval_s * np.arange(n)

    def __getitem__(self, name: str) -> FloatArray:
        """Return a signal by its name."""
        return self.signals[name]


@dataclass(frozen=True)
class Prepared:
    """A run that is ready to start: numbers, first state, set courses, roughness."""

    constants: Constants
    q: FloatArray
    v: FloatArray
    speed: FloatArray
    torque: FloatArray
    roughness: TimeLockedRoughness


def prepare(machine: Machine, operation: Operation, rng: np.random.Generator, start_s: float = 0.0) -> Prepared:
    """Draw what is random, tabulate the machine, find the first state."""
    rough_rng, bearing_rng = rng.spawn(2)  # each keeps what it draws, whatever the other does
    machine, roughness = draw_roughness(machine, rough_rng)
    q, v = start_state(machine, operation, start_s)
    return Prepared(
        constants(machine, operation, bearing_rng),
        q,
        v,
        _points(operation.speed_rpm, pi / 30.0),
        _points(operation.torque_nm, 1.0),
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
    with_energy: bool = False,
    first: State | None = None,
    on_progress: Callable[[float], None] | None = None,
) -> Response:
    """Integrate the sixteen coordinates from the static balance on, or from where another run ended.

    Parameters
    ----------
    machine : Machine
    operation : Operation
        Set speed and torque; time 0 of their courses is time 0 here.
    duration_s : float
    rng : numpy.random.Generator
        Draws the roughness, then the rolling elements' places.
    signals : sequence of str
        Of `sims.cracked.layout.SIGNALS`.
    start_s : float
        First time; below 0 for a lead-in.
    step_s : float or None
        None: `sims.cracked.linear.default_step_s`.
    stride : int
        Every how many steps a point is kept.
    with_energy : bool
    first : State or None
        `Response.last` of another run; None: the static balance at `start_s`.
    on_progress : callable or None
        Called now and then with the part that is done, 0 to 1.

    Raises
    ------
    InputError
        On an unknown signal, or a run of more than `MOST_STEPS` steps.
    RefusalError
        If the solution grows beyond all bounds: the step is too long.

    Notes
    -----
    Classic Runge–Kutta method, fourth order. Where a tooth pair loses contact its force has a kink, and the order drops
    for that step.
    """
    from sims.cracked.integrate_kernel import integrate

    positive(duration_s, "duration_s", "s")
    step = default_step_s(machine, operation) if step_s is None else positive(step_s, "step_s", "s")
    n_steps = ceil(duration_s / step - 1e-9)
    if n_steps > MOST_STEPS:
        raise InputError(
            f"{n_steps:.3g} steps of {step:.3g} s",
            where="duration_s",
            allowed=f"at most {MOST_STEPS:.0e} steps",
            remedy="simulate a shorter time, or in parts",
        )
    every = count(stride, "stride")
    ready = prepare(machine, operation, rng, start_s)
    q, v, set_angle = _first_state(ready, first)
    rows = np.empty((-(-n_steps // every), len(signals)))
    energies = np.empty(len(rows) if with_energy else 0)
    select = np.array([_place(name) for name in signals], dtype=np.int64)
    phasors = ready.roughness.phasors(step / 2.0)
    per_call = every * max(STEPS_PER_CALL // every, 1)
    for begun in range(0, n_steps, per_call):
        n = min(per_call, n_steps - begun)
        part = slice(begun // every, begun // every + -(-n // every))
        filled = integrate(
            *ready.constants.arguments,
            q,
            v,
            set_angle,
            start_s + begun * step,
            step,
            n,
            every,
            ready.speed,
            ready.torque,
            phasors,
            select,
            rows[part],
            energies[part] if with_energy else energies,
        )
        if filled < len(rows[part]) or not np.isfinite(rows[part][-1]).all():
            raise RefusalError(
                f"the solution grows beyond all bounds after {(begun + filled * every) * step:.3g} s "
                f"at a step of {step:.3g} s",
                remedy="look for stiffness, damping and inertia that do not go together, or give a shorter step_s",
            )
        if on_progress is not None:
            on_progress((begun + n) / n_steps)
    last = State(q, v, float(set_angle[0]))
    return Response(start_s, step * every, dict(zip(signals, rows.T, strict=True)), step, energies, last)


def _first_state(ready: Prepared, given: State | None) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return copies, which the kernel overwrites, of coordinates, velocities and the set angle."""
    if given is None:
        return ready.q, ready.v, ready.q[:1].copy()
    if given.q.shape != ready.q.shape or given.v.shape != ready.v.shape:
        raise InputError(
            f"a state of {given.q.size} coordinates", where="first", allowed=f"{ready.q.size}: another run's last"
        )
    return given.q.copy(), given.v.copy(), np.array([given.set_angle_rad])


def _points(course: Course, factor: float) -> FloatArray:
    return np.ascontiguousarray(np.vstack((course.times_s, factor * np.asarray(course.values))), dtype=np.float64)


def _place(name: str) -> int:
    if name not in SIGNALS:
        raise InputError(
            f"there is no signal {name!r}",
            allowed="names of sims.cracked.layout.SIGNALS",
            remedy=closest_match_hint(name, SIGNALS),
        )
    return SIGNALS.index(name)
