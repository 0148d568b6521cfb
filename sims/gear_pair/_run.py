"""A run of a gear pair: its drive, interruptible integration, signals on an even grid, and the measurement."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import ceil, cos, floor, pi, radians, sin
from typing import Any, Generic, TypeVar

import numpy as np

from gearsig.checks import FloatArray, count, positive
from gearsig.compiled import UNCOUNTED, njit
from gearsig.errors import InputError, RefusalError
from gearsig.recording import Recording
from gearsig.results import Result
from gearsig.rig import Rig
from sims.machine import RECOVERY_S, Machine, Operation, Profile
from sims.measure import MeasurementChain, Motion
from sims.mesh import (
    FlankRoughness,
    FractalSurface,
    TimeLockedRoughness,
    contact_friction_n,
    oil_terms,
    reduced_modulus_pa,
)

# --------------------
# Drive, inertias and friction as plain numbers for compiled code.
# --------------------


MAX_LINES = 8
"""Maximum number of torque ripples, and of speed swings."""
MACHINE_FIELDS: list[Any] = [
    *(
        (name, np.float64)
        for name in (
            *("governor", "governor_spring", "total_inertia", "ratio"),
            *("cycles_per_rad", "backlash", "gravity_x", "gravity_y"),
        )
    ),
    *(
        (name, np.float64, (2,))
        for name in (
            *("mass", "mass_angle", "runout", "runout_angle"),
            *("torsional_stiffness", "torsional_damping", "hooke", "hooke_force", "coupling_bending"),
        )
    ),
    ("n_ripples", np.int64),
    ("ripples", np.float64, (MAX_LINES, 3)),
    ("n_swings", np.int64),
    ("swings", np.float64, (MAX_LINES, 3)),
]
"""Fields common to both models' records, in SI units; those per side in pairs (driver, driven)."""


def machine_fields(machine: Machine) -> dict[str, Any]:
    """Values of `MACHINE_FIELDS`."""
    wheels, shafts, beta = machine.wheels, machine.shafts, radians(machine.line_of_action_deg)
    hooke_rad = np.array([radians(s.coupling_angle_deg) for s in shafts])
    drive, governor, total = machine.drive, governor_nm_s_per_rad(machine), total_inertia_kg_m2(machine)
    swings = [(s.fraction, 2.0 * pi * s.frequency_hz, s.phase_rad) for s in drive.swings]
    return {
        "governor": governor,
        "governor_spring": governor**2 / (4.0 * total),
        "total_inertia": total,
        "ratio": machine.ratio,
        "cycles_per_rad": machine.mesh.pair.driver.teeth / (2.0 * pi),
        "backlash": 2e-6 * machine.half_backlash_um,
        "gravity_x": -machine.gravity_mps2 * sin(beta),
        "gravity_y": -machine.gravity_mps2 * cos(beta),
        "mass": [w.mass_kg for w in wheels],
        "mass_angle": np.radians([w.unbalance_angle_deg for w in wheels]),
        "runout": [w.runout_um * 1e-6 for w in wheels],
        "runout_angle": np.radians([w.runout_angle_deg for w in wheels]),
        "torsional_stiffness": [s.torsional_stiffness_nm_per_rad for s in shafts],
        "torsional_damping": [s.torsional_damping_nm_s_per_rad for s in shafts],
        "hooke": hooke_rad**2 / 4.0,
        "hooke_force": hooke_rad / np.array([2.0 * s.bearing_distance_m for s in shafts]),
        "coupling_bending": [s.coupling_bending_nm_per_rad for s in shafts],
        "n_ripples": len(drive.ripples),
        "n_swings": len(drive.swings),
        "ripples": _rows([(r.order, r.fraction, r.phase_rad) for r in drive.ripples], "torque ripples"),
        "swings": _rows(swings, "speed swings"),
    }


def total_inertia_kg_m2(machine: Machine) -> float:
    """Total rotating inertia referred to the input shaft."""
    (input_shaft, output_shaft), (driver, driven) = machine.shafts, machine.wheels
    far = driven.inertia_kg_m2 + output_shaft.rotor_inertia_kg_m2
    return input_shaft.rotor_inertia_kg_m2 + driver.inertia_kg_m2 + far / machine.ratio**2


def governor_nm_s_per_rad(machine: Machine) -> float:
    """Governor gain g of the drive; if none is stated, such that the speed recovers in `RECOVERY_S`."""
    stated = machine.drive.governor_nm_s_per_rad
    return 2.0 * total_inertia_kg_m2(machine) / RECOVERY_S if stated is None else stated


def _rows(items: list[tuple[float, float, float]], kind: str) -> FloatArray:
    if len(items) > MAX_LINES:
        raise InputError(f"{len(items)} {kind}", allowed=f"at most {MAX_LINES}")
    rows = np.zeros((MAX_LINES, 3))
    rows[: len(items)] = np.array(items, dtype=np.float64).reshape(-1, 3)
    return rows


# Friction between the teeth as plain numbers for compiled code.

STICKING, STICKING_S = 0.1, 1e-5
"""Friction coefficient, and time within which it must not reverse a gear's sliding: near standstill the smoothed sign
is as stiff as a spring, and a fixed step would chatter."""
SIGN_THRESHOLD = 0.01
"""Sliding speed below which the sign of friction is smoothed, relative to the mesh's maximum sliding speed."""
FRICTION_FIELDS: list[Any] = [
    ("friction", np.bool_),
    *(
        (name, np.float64)
        for name in (
            *("start_radius", "base_pitch", "action_length", "contact_ratio"),
            *("friction_factor", "dry_friction", "width", "reduced_modulus"),
            *("log10_oil", "oil_constant", "sign_threshold"),
        )
    ),
]
"""Fields of the record that `friction_of_pair` needs."""


def friction_fields(machine: Machine, operation: Operation, force_n: float) -> dict[str, Any]:
    """Values of `FRICTION_FIELDS` at the set mesh force."""
    mesh, pair = machine.mesh, machine.mesh.pair
    log10_oil, oil_constant = oil_terms(machine.lubrication.viscosity_cp, machine.roughness.rms_um)
    sliding = greatest_sliding_mps(machine, operation.speed_rpm.largest * pi / 30.0)
    lightest = min(w.mass_kg for w in machine.wheels)
    return {
        "friction": machine.lubrication.friction,
        "start_radius": pair.start_radius_mm * 1e-3,
        "base_pitch": pair.base_pitch_mm * 1e-3,
        "action_length": pair.action_length_mm * 1e-3,
        "contact_ratio": pair.contact_ratio,
        "friction_factor": machine.lubrication.factor,
        "dry_friction": machine.lubrication.dry_coefficient,
        "width": mesh.face_width_m,
        "reduced_modulus": reduced_modulus_pa(mesh.material_1, mesh.material_2),
        "log10_oil": log10_oil,
        "oil_constant": oil_constant,
        "sign_threshold": max(SIGN_THRESHOLD * sliding, STICKING * force_n * STICKING_S / lightest, 1e-6),
    }


def greatest_sliding_mps(machine: Machine, omega_rad_s: float) -> float:
    """Maximum sliding speed, reached at one end of the path of contact."""
    pair = machine.mesh.pair
    cycles = np.array([0.0, pair.contact_ratio])
    return float(np.max(np.abs(pair.sliding_speed_m_s(cycles, omega_rad_s * 30.0 / pi))))


@njit(cache=True, nogil=True, error_model="numpy", **UNCOUNTED)  # type: ignore[untyped-decorator,unused-ignore]
def friction_of_pair(k, force, progress, omega_1, omega_2, slip_x, width):  # type: ignore[no-untyped-def]
    """(f, fρ1, fρ2) of a pair at ζ; the film depends on the rolling speeds, the sign of friction also on `slip_x`."""
    rho_1 = k.start_radius + progress * k.base_pitch
    rho_2 = k.action_length - rho_1
    rubbing = contact_friction_n(
        force,
        omega_1 * rho_1,
        omega_2 * rho_2,
        slip_x,
        rho_1 * rho_2 / k.action_length,
        width,
        k.reduced_modulus,
        k.log10_oil,
        k.oil_constant,
        k.sign_threshold,
        k.friction_factor,
        k.dry_friction,
    )
    return rubbing, rubbing * rho_1, rubbing * rho_2


# Random roughness of a pair's flanks.


def draw_roughness(machine: Machine, rng: np.random.Generator) -> tuple[Machine, TimeLockedRoughness]:
    """Draw a profile for every tooth, or an endless one for the backlash; return the machine and the endless profile.

    The composite roughness S is divided evenly between the two flanks of a pair: each has S/√2.
    """
    rough, pair = machine.roughness, machine.mesh.pair
    endless = FractalSurface.of_roughness(rough.rms_um if rough.locked_to == "time" else 0.0, rough.dimension)
    profile = TimeLockedRoughness.draw(endless, rng)
    if rough.locked_to == "flank" and rough.rms_um > 0.0:
        surface = FractalSurface.of_roughness(rough.rms_um / np.sqrt(2.0), rough.dimension)
        flanks = [FlankRoughness.draw(surface, gear.teeth, rng) for gear in (pair.driver, pair.driven)]
        machine = replace(machine, mesh=replace(machine.mesh, roughness_1=flanks[0], roughness_2=flanks[1]))
    return machine, profile


# --------------------
# Running: in interruptible parts, with output on an even grid.
# --------------------


State = TypeVar("State")
March = Callable[[float, int, FloatArray, FloatArray], int]
"""(time_s, n_steps, rows, energies) → number of rows filled, fewer than available if the solution diverges."""


@dataclass(frozen=True)
class PairResponse(Result, Generic[State], columns=("time_s", "signals")):
    """Signals of a run on an even grid of time.

    Parameters
    ----------
    start_s, interval_s : float
    signals : mapping
        Name → (n,), in m, rad, s, N.
    step_s : float
        Of the integrator.
    energy_j : array
        Sum of potential, kinetic and gravitational energy, (n,), or empty if not requested.
    last : state of the model or None
        At the end of the last step: one step after the last point if every step is kept.
    """

    start_s: float
    interval_s: float
    signals: Mapping[str, FloatArray]
    step_s: float
    energy_j: FloatArray
    last: State | None = None

    @property
    def time_s(self) -> FloatArray:
        """Times of the points, (n,)."""
        return self.start_s + self.interval_s * np.arange(len(next(iter(self.signals.values()))))

    @property
    def ends_s(self) -> float:
        """Start time of a run that continues from `last`."""
        return self.start_s + self.interval_s * len(self.time_s)

    def __getitem__(self, name: str) -> FloatArray:
        """Return a signal by its name."""
        return self.signals[name]

    def followed_by(self, other: PairResponse[State]) -> PairResponse[State]:
        """Return this run joined with one that continued from its last state, with the same signals."""
        signals = {name: np.concatenate((values, other[name])) for name, values in self.signals.items()}
        return replace(
            other, start_s=self.start_s, signals=signals, energy_j=np.concatenate((self.energy_j, other.energy_j))
        )


MAX_STEPS = 400_000_000
"""About ten minutes to half an hour of computing; more is taken for a mistake."""


@dataclass(frozen=True)
class RunPlan:
    """Steps of a run, and which of them are kept.

    Parameters
    ----------
    start_s, duration_s, step_s : float
    stride : int
        Steps per kept point.
    steps_per_call : int
        Steps after which compiled code returns, so that the run can be interrupted.
    """

    start_s: float
    duration_s: float
    step_s: float
    stride: int
    steps_per_call: int

    def __post_init__(self) -> None:
        positive(self.duration_s, "duration_s", "s")
        positive(self.step_s, "step_s", "s")
        count(self.stride, "stride")
        if self.n_steps > MAX_STEPS:
            raise InputError(
                f"{self.n_steps:.3g} steps of {self.step_s:.3g} s",
                where="duration_s",
                allowed=f"at most {MAX_STEPS:.0e} steps",
                remedy="simulate a shorter time, or in parts",
            )

    @property
    def n_steps(self) -> int:
        """Number of steps to the end."""
        return ceil(self.duration_s / self.step_s - 1e-9)

    def run(
        self, march: March, signals: Sequence[str], *, with_energy: bool, remedy: str
    ) -> tuple[dict[str, FloatArray], FloatArray]:
        """Return the signals by name, and the energies if requested.

        Raises
        ------
        RefusalError
            If the solution diverges.
        """
        every, n_steps = self.stride, self.n_steps
        rows = np.empty((-(-n_steps // every), len(signals)))
        energies = np.empty(len(rows) if with_energy else 0)
        per_call = every * max(self.steps_per_call // every, 1)
        for begun in range(0, n_steps, per_call):
            n = min(per_call, n_steps - begun)
            part = slice(begun // every, begun // every + -(-n // every))
            filled = march(
                self.start_s + begun * self.step_s, n, rows[part], energies[part] if with_energy else energies
            )
            if filled < len(rows[part]) or not np.isfinite(rows[part]).all():
                raise RefusalError(
                    f"the solution diverges after {(begun + filled * every) * self.step_s:.3g} s "
                    f"at a step of {self.step_s:.3g} s",
                    remedy=remedy,
                )
        return dict(zip(signals, rows.T, strict=True)), energies


@dataclass(frozen=True)
class StepConvergence:
    """Effect of a shorter integration step.

    Parameters
    ----------
    steps_s : tuple of float
        The step in use first, that of the most accurate run last.
    rms : mapping
        Name of a signal → rms about its mean at each step.
    allowed : float
        Relative error that counts as converged.
    """

    steps_s: tuple[float, ...]
    rms: Mapping[str, tuple[float, ...]]
    allowed: float

    @classmethod
    def of(cls, runs: Sequence[PairResponse[State]], allowed: float, *, first: float = 0.0) -> StepConvergence:
        """Compare runs with the same signals, omitting the initial fraction `first` of each."""

        def rms(values: FloatArray) -> float:
            return float(np.std(values[int(first * len(values)) :]))

        return cls(tuple(r.step_s for r in runs), {n: tuple(rms(r[n]) for r in runs) for n in runs[0].signals}, allowed)

    @property
    def error(self) -> float:
        """Maximum relative difference of an rms at the step in use from that of the most accurate run."""
        return max(abs(values[0] / values[-1] - 1.0) for values in self.rms.values())

    @property
    def converged(self) -> bool:
        """Whether the error is within the allowed one."""
        return self.error <= self.allowed

    @property
    def text(self) -> str:
        """Readable summary: a line for each step and signal, and the verdict."""
        lines = [
            f"step {1e6 * step:8.4f} us: rms of {name} {values[i]:.6g}"
            for name, values in self.rms.items()
            for i, step in enumerate(self.steps_s)
        ]
        verdict = "converged" if self.converged else "NOT converged: take a shorter step"
        return "\n".join([*lines, f"relative error {self.error:.1e} (allowed {self.allowed:.0e}): {verdict}"])


def profile_points(profile: Profile, factor: float) -> FloatArray:
    """Times and scaled values in the form that kernels read, (2, n)."""
    return np.ascontiguousarray(np.vstack((profile.times_s, factor * np.asarray(profile.values))), dtype=np.float64)


# --------------------
# From the motion to a recording: what the measurement chain needs from a model, and the measurement.
# --------------------


COORDINATES = (
    "input rotor angle",
    "driver angle",
    "driven angle",
    "output rotor angle",
    "driver x",
    "driver y",
    "driven x",
    "driven y",
    *(f"bearing {i} {axis}" for i in (1, 2, 3, 4) for axis in ("x", "y")),
)
"""Coordinates in rad and m; models also give their velocities and accelerations."""
ANGLES = COORDINATES[1:3]
DEFLECTIONS = tuple(f"{name} yield" for name in COORDINATES[8:])
"""Deflection of each bearing's spring in m: its force over its stiffness without clearance, or, with individual ball
contacts, over the stiffness at the load. That force moves the housing; the shaft also follows the passing elements, and
little of that motion reaches the housing."""
POSITIONS = (*COORDINATES[4:], *DEFLECTIONS)
"""Positions at which a transfer path can start, each with its direction."""
POINTS_PER_CYCLE = 6
"""Points per cycle of the fastest resonance in path and sensor, in the motion passed to the measurement chain."""
MIN_MOTION_HZ = 80_000.0
"""Minimum rate of that motion: content above half of it would alias."""
CONTINUED_LEAD_IN_S = 0.1
"""Last part of the lead-in, which is simulated separately in a run that continues another."""
SETTLING = 6.0
"""Time constants of the slowest start-up motion that are discarded before the recording."""


@dataclass(frozen=True)
class MeasuredRun(Generic[State]):
    """Request for a measured run.

    Parameters
    ----------
    rng : numpy.random.Generator
        Spawns two streams, one for the machine and one for the chain: the same seed gives the same noise whatever the
        machine draws.
    sampling_rate_hz, duration_s : float
        Of the recording.
    rig : Rig or None
        Stored in the recording.
    truth : mapping
        The inputs; the model adds its data of machine and solver.
    step_s : float or None
        Maximum step of the integrator; None: the model's. It is shortened to what the model needs, and to an integer
        fraction of the sampling interval.
    also : sequence of str
        Signals of the model required in addition to those that are measured.
    first : state of the model or None
        Start of the lead-in; None: static equilibrium.
    before : PairResponse or None
        `Measurement.lead_in` of the same machine in another state: the run continues from its end, as when a tooth
        breaks.
    min_motion_hz : float
        Minimum rate of the motion passed to the measurement chain.
    noise_rng : numpy.random.Generator or None
        For the chain, instead of the stream from `rng`: the same machine with other noise.
    """

    rng: np.random.Generator
    sampling_rate_hz: float
    duration_s: float
    rig: Rig | None = None
    truth: Mapping[str, Any] = field(default_factory=dict)
    step_s: float | None = None
    also: Sequence[str] = ()
    first: State | None = None
    before: PairResponse[State] | None = None
    min_motion_hz: float = MIN_MOTION_HZ
    noise_rng: np.random.Generator | None = None

    def streams(self) -> tuple[np.random.Generator, np.random.Generator]:
        """Return the generators for the machine and for the chain; to be called only once."""
        machine_rng, chain_rng = self.rng.spawn(2)
        return machine_rng, chain_rng if self.noise_rng is None else self.noise_rng


@dataclass(frozen=True)
class Measurement(Generic[State]):
    """Plan of a measured run, and its recording; time 0 of the profiles is a sample.

    Parameters
    ----------
    machine : Machine
    run : MeasuredRun
    chain : MeasurementChain
        At the sampling rate of the recording.
    lead_in_s : float
        Simulated time before the recording.
    step_s : float
        Of the integrator, an integer fraction of the sampling interval.
    stride : int
        Steps per kept point.
    positions : tuple of str
        Positions at which the channels' paths start.
    """

    machine: Machine
    run: MeasuredRun[State]
    chain: MeasurementChain
    lead_in_s: float
    step_s: float
    stride: int
    positions: tuple[str, ...]

    @classmethod
    def of(cls, machine: Machine, run: MeasuredRun[State], longest_step_s: float) -> Measurement[State]:
        """Plan a recording; the step is `longest_step_s`, or less where the chain needs it.

        Raises
        ------
        InputError
            If rate, duration or step is not above 0.
        """
        positive(run.duration_s, "duration_s", "s")
        rate = positive(run.sampling_rate_hz, "sampling_rate_hz", "Hz")
        chain = replace(machine.chain, sampling_rate_hz=rate)
        rate_hz = motion_rate_hz(chain, run.min_motion_hz)
        per_sample = ceil(max(1.0 / positive(longest_step_s, "step_s", "s"), rate_hz) / rate - 1e-9)
        return cls(
            machine,
            run,
            chain,
            ceil(lead_in_s(machine, chain) * rate) / rate,
            1.0 / (rate * per_sample),
            max(floor(rate * per_sample / rate_hz + 1e-9), 1),
            used_positions(chain),
        )

    @property
    def motion(self) -> dict[str, Any]:
        """Keyword arguments for the model's response: times, steps, signals, first state."""
        needed = [name for position in self.positions for name in self._signals_at(position)]
        return {
            "duration_s": self.chain.simulated_s(self.run.duration_s, self.lead_in_s)
            + 4.0 / self.chain.sampling_rate_hz,
            "signals": tuple(dict.fromkeys((*ANGLES, *needed, *self.run.also))),
            "start_s": -self.lead_in_s,
            "step_s": self.step_s,
            "stride": self.stride,
            "first": self.run.first,
        }

    @property
    def lead_in(self) -> dict[str, Any] | None:
        """The same up to `CONTINUED_LEAD_IN_S` before the recording, where runs in another state continue."""
        n_points = floor((self.lead_in_s - CONTINUED_LEAD_IN_S) / (self.step_s * self.stride))
        return {**self.motion, "duration_s": n_points * self.step_s * self.stride} if n_points > 0 else None

    @property
    def rest(self) -> dict[str, Any]:
        """The same from the end of the run before."""
        before = self.run.before
        if before is None:
            return self.motion
        at_s = before.ends_s
        duration_s = self.motion["duration_s"] - (at_s + self.lead_in_s)
        return {**self.motion, "start_s": at_s, "duration_s": duration_s, "first": before.last}

    def _signals_at(self, position: str) -> tuple[str, ...]:
        place = position.removesuffix(" yield")
        return (f"{place} acceleration", *((place, position) if self._rolls(position) else ()))

    def _rolls(self, position: str) -> bool:
        """Whether the shaft moves with the passing elements, apart from the spring's deflection."""
        return position in DEFLECTIONS and self.machine.bearings[DEFLECTIONS.index(position) // 2].elements_pass

    def _acceleration(self, response: PairResponse[State], position: str) -> FloatArray:
        """Return a position's acceleration; a yield's includes second differences of its deviation from the shaft."""
        place = position.removesuffix(" yield")
        acceleration = response[f"{place} acceleration"]
        if not self._rolls(position):
            return acceleration
        less = np.pad(np.diff(response[position] - response[place], 2), 1)
        return acceleration + less / response.interval_s**2

    def record(
        self,
        response: PairResponse[State],
        rng: np.random.Generator,
        *,
        known: Mapping[str, Any],
        notes: Sequence[str],
        source: str,
        reader: str,
    ) -> Recording:
        """Return the recording of a run that began at −`lead_in_s`; see `MeasurementChain.record`.

        Parameters
        ----------
        response : PairResponse
        rng : numpy.random.Generator
            Of the chain.
        known : mapping
            What the model adds to the truth.
        notes : sequence of str
            Formulas used outside their range; they become warnings of the recording.
        source, reader : str
            For its provenance.
        """
        motion = Motion(
            response.interval_s,
            self.positions,
            np.column_stack([self._acceleration(response, name) for name in self.positions]),
            dict(zip(self.machine.shaft_names, (response[name] for name in ANGLES), strict=True)),
        )
        recording = self.chain.record(
            motion,
            rng=rng,
            rig=self.run.rig,
            duration_s=self.run.duration_s,
            lead_in_s=self.lead_in_s,
            truth={**self.run.truth, **known},
            source=source,
            reader=reader,
        )
        return replace(recording, warnings=(*recording.warnings, *notes))


def lead_in_s(machine: Machine, chain: MeasurementChain) -> float:
    """Simulated time before the recording, in which filters, the governor and the start-up ringing settle."""
    recovery = 2.0 * total_inertia_kg_m2(machine) / governor_nm_s_per_rad(machine)
    return max(chain.lead_in_s, SETTLING * recovery, 0.1)


def motion_rate_hz(chain: MeasurementChain, min_motion_hz: float) -> float:
    """Minimum rate of the motion that the chain needs, in points per second."""
    modes = [mode.frequency_hz for channel in chain.channels for mode in channel.path.modes]
    sensors = [channel.accelerometer.resonance_hz or 0.0 for channel in chain.channels]
    return max(POINTS_PER_CYCLE * max([*modes, *sensors, 0.0]), min_motion_hz, 4.0 * chain.sampling_rate_hz)


def used_positions(chain: MeasurementChain) -> tuple[str, ...]:
    """Positions at which the channels' paths start, in the model's order; the chain rejects unknown ones."""
    used = {
        name
        for channel in chain.channels
        for gains in (channel.path.direct, *(mode.gains for mode in channel.path.modes))
        for name in gains
    }
    return tuple(name for name in POSITIONS if name in used) or POSITIONS[:1]
