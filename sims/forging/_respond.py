"""Run the drive and return what it does: angles, torque, interaction force, every contact."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import ceil, pi
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gearsig.checks import FloatArray, known_name, one_of, positive, within
from gearsig.errors import InputError, RefusalError
from gearsig.results import Result
from gearsig.rig import damping_ratio_s_per_m
from sims.forging._drive import CONTINUOUS, Cycle, ForgingDrive, Schedule, schedule
from sims.machine import Profile

# The drive as plain numbers, which compiled code reads.

STATES = ("θ1", "ω1", "q", "q̇", "tooth bristle A", "tooth bristle B", "motor bristle", "load bristle")
"""What is integrated: angle and speed of the pinion, compression and its rate, four bristles; then three energies."""
ENERGIES = ("work put in", "lost in contact", "lost in friction")
N_STATES = len(STATES) + len(ENERGIES)

SIGNALS = (
    "pinion angle", "pinion speed", "pinion acceleration",
    "wheel angle", "wheel speed", "wheel acceleration",
    "torque", "interaction force", "compression", "compression rate", "pairs in contact", "tooth friction",
    "motor torque", "energy", "work put in", "lost in contact", "lost in friction",
)  # fmt: skip
"""What a run returns, in rad, s, N m, N, m, J. "torque" is that of a sensor between motor and pinion."""

CONTACT_COLUMNS = (
    "start_s", "flank", "start_speed_mps", "pitch", "driver_angle_rad", "end_s", "end_speed_mps", "peak_force_n",
    "lost_j", "is_latched_at_floor",
)  # fmt: skip
"""What is kept of every contact: from when its flanks touched to when they parted (nan: still touching)."""

_FIELDS = (
    "motor_inertia", "pinion_inertia", "wheel_inertia", "rb1", "rb2", "half_backlash", "stiffness", "exponent",
    "damping_at_1_mps", "speed_floor", "cycles_per_rad", "phase", "contact_ratio", "ramp", "start", "base_pitch",
    "length", "mirror", "tooth_friction", "tooth_static_ratio", "tooth_stribeck", "tooth_presliding", "speed_limit",
    "speed_band", "ripple_fraction", "ripple_order", "drag", "drag_viscous", "motor_static_ratio", "motor_stribeck",
    "motor_presliding", "motor_bristle_time", "load_friction", "load_viscous", "load_static_ratio", "load_stribeck",
    "load_presliding", "load_bristle_time", "unbalance_torque", "unbalance_angle", "weak_teeth", "weak_tooth",
    "weak_loss", "is_worn",
)  # fmt: skip
N_WEAR = 65
"""Points of the table of wear over the path of contact."""
RECORD = np.dtype(
    [(name, np.float64) for name in _FIELDS] + [(name, np.float64, (N_WEAR,)) for name in ("wear", "wear_slope")]
)
"""Numbers in SI units by name; compiled code reads them as attributes."""


def drive_numbers(drive: ForgingDrive) -> Any:
    """Return the drive as a record of `RECORD`."""
    path, contact = drive.path, drive.contact
    motor, load, flanks = drive.motor, drive.load, drive.flanks
    k = np.zeros(1, dtype=RECORD).view(np.recarray)[0]
    k["motor_inertia"], k["pinion_inertia"] = motor.inertia_kg_m2, contact.driver_inertia_kg_m2
    k["wheel_inertia"] = contact.driven_inertia_kg_m2
    k["rb1"], k["rb2"] = path.base_radii_m
    k["half_backlash"] = contact.half_backlash_um * 1e-6
    k["stiffness"], k["exponent"] = contact.stiffness_n_per_m_lambda, contact.exponent
    k["damping_at_1_mps"] = damping_ratio_s_per_m(contact.damping_law, contact.restitution, 1.0)
    k["speed_floor"] = contact.impact_speed_floor_mps
    k["cycles_per_rad"], k["phase"] = path.teeth[0] / (2.0 * pi), path.phase
    k["contact_ratio"], k["ramp"] = path.contact_ratio, path.ramp
    k["start"], k["base_pitch"], k["length"] = path.start_m, path.base_pitch_m, path.length_m
    k["mirror"] = 2.0 * path.pitch_point + 0.5
    k["tooth_friction"] = contact.friction_coefficient
    k["tooth_static_ratio"], k["tooth_stribeck"] = flanks.static_ratio, flanks.stribeck_speed
    k["tooth_presliding"] = flanks.presliding
    k["speed_limit"], k["speed_band"] = drive.speed_limit_rad_s, motor.speed_band
    k["ripple_fraction"], k["ripple_order"] = motor.ripple_fraction, motor.ripple_order
    k["drag"], k["drag_viscous"] = motor.drag.level, motor.drag.viscous
    k["load_friction"], k["load_viscous"] = load.friction.level, load.friction.viscous
    for name, bristle in (("motor", motor.drag), ("load", load.friction)):
        k[f"{name}_static_ratio"], k[f"{name}_stribeck"] = bristle.static_ratio, bristle.stribeck_speed
        k[f"{name}_presliding"], k[f"{name}_bristle_time"] = bristle.presliding, bristle.damping_time_s
    k["unbalance_torque"], k["unbalance_angle"] = load.unbalance_nm, load.unbalance_angle_rad
    weak = drive.weak_tooth
    k["weak_teeth"] = path.teeth[0 if weak is None else weak.gear]
    depths = drive.wear_um
    if len(depths):
        k["is_worn"] = 1.0
        table = np.interp(np.linspace(0.0, 1.0, N_WEAR), np.linspace(0.0, 1.0, len(depths)), 1e-6 * np.asarray(depths))
        k["wear"], k["wear_slope"] = table, np.gradient(table)
    k["weak_tooth"], k["weak_loss"] = (0.0, 0.0) if weak is None else (weak.tooth, weak.loss)
    return k


TOLERANCE = 1e-6
"""Relative error of a step; absolute errors of the states go with it."""
ABSOLUTE = np.array([1e-8, 1e-6, 1e-10, 1e-7, 1e-4, 1e-4, 1e-4, 1e-4])
"""At `TOLERANCE`, in rad, rad/s, m, m/s, and bristles in their sliding friction; a loaded flank yields 2e-5 m."""
CONTACTS_PER_SECOND = 2000
"""More than any rattle makes; beyond, the run is stopped."""
MAX_POINTS = 60_000_000


@dataclass(frozen=True)
class FirstState:
    """Where a run begins: angle and speed of the pinion, compression between the flanks and its rate."""

    pinion_angle_rad: float = 0.0
    pinion_speed_rad_s: float = 0.0
    compression_m: float = 0.0
    compression_rate_mps: float = 0.0


@dataclass(frozen=True)
class DriveResponse(Result, columns=("time_s", "signals")):
    """A run of the drive on an even grid of time from 0, and its contacts.

    Parameters
    ----------
    interval_s : float
    signals : mapping
        Name (see `sims.forging.SIGNALS`) → (n,).
    contacts : array, (n_contacts, 10)
        See `sims.forging.CONTACT_COLUMNS`: exact to the events' accuracy, not to the grid's.
    n_steps, n_refused : int
        Of the integrator.
    """

    interval_s: float
    signals: Mapping[str, FloatArray]
    contacts: FloatArray
    n_steps: int
    n_refused: int = 0

    @property
    def time_s(self) -> FloatArray:
        """Times of the points."""
        return self.interval_s * np.arange(len(next(iter(self.signals.values()))))

    def __getitem__(self, name: str) -> FloatArray:
        """Return a signal by its name."""
        return self.signals[known_name(name, self.signals, f"there is no signal {name!r}")]

    def contact(self, column: str) -> FloatArray:
        """Return a column of the contacts by its name."""
        values: FloatArray = self.contacts[:, CONTACT_COLUMNS.index(column)]
        return values


def respond(
    drive: ForgingDrive,
    profiles: Schedule,
    *,
    duration_s: float,
    interval_s: float = 1e-3,
    first: FirstState | None = None,
    tolerance: float = TOLERANCE,
    signals: Sequence[str] = SIGNALS,
) -> DriveResponse:
    """Integrate the drive from rest, or from a given state.

    Dormand–Prince 5(4) with error control; a step ends where flanks meet or part, so that the speed at which they meet
    is latched exactly, and where a profile bends.

    Parameters
    ----------
    drive : ForgingDrive
    profiles : Schedule
    duration_s, interval_s : float
        The grid is 0, interval, … below the duration.
    first : FirstState or None
        None: at rest, the teeth in the middle of the backlash.
    tolerance : float
        1e-12 to 1e-3.
    signals : sequence of str
        What is kept, of `sims.forging.SIGNALS`. The steps, and so the motion, do not depend on it.

    Raises
    ------
    RefusalError
        If flanks touch and part without end, or the state grows without bound.
    """
    positive(duration_s, "duration_s", "s")
    positive(interval_s, "interval_s", "s")
    within(tolerance, "tolerance", 1e-12, 1e-3)
    run = _DriveRun.begin(drive, first or FirstState(), signals, duration_s, interval_s)
    for begin, end in pairwise(profiles.segments(duration_s)):
        run.advance(begin, end, profiles.straight(begin, end), tolerance)
    return run.response(signals)


@dataclass
class _DriveRun:
    """A run on its way: states, contact, and what has been kept; arrays that the kernel fills in place."""

    k: Any
    y: FloatArray
    mode: FloatArray
    counts: NDArray[np.int64]
    select: NDArray[np.int64]
    output: FloatArray
    contacts: FloatArray
    interval_s: float
    step_s: float = 1e-6

    @classmethod
    def begin(
        cls, drive: ForgingDrive, start: FirstState, signals: Sequence[str], duration_s: float, interval_s: float
    ) -> _DriveRun:
        """Make room for the signals, and put the drive into its first state."""
        from sims.forging._kernels import open_contact, reach

        n = ceil(duration_s / interval_s - 1e-9)
        if n > MAX_POINTS:
            raise InputError(f"{n} points are wanted", allowed=f"up to {MAX_POINTS}", remedy="shorten the run")
        select = np.array([SIGNALS.index(one_of(name, "signals", SIGNALS)) for name in signals], dtype=np.int64)
        contacts = np.zeros((1000 + int(CONTACTS_PER_SECOND * duration_s), len(CONTACT_COLUMNS)))
        y, mode, counts = np.zeros(N_STATES), np.zeros(3), np.zeros(4, dtype=np.int64)
        y[:4] = start.pinion_angle_rad, start.pinion_speed_rad_s, start.compression_m, start.compression_rate_mps
        k = drive_numbers(drive)
        flank = float(np.sign(y[2]))
        if flank * y[2] > reach(k, y[0], flank)[0]:
            open_contact(k, y, 0.0, flank, mode, contacts[0])
            counts[1] = 1
        return cls(k, y, mode, counts, select, np.full((n, len(select)), np.nan), contacts, interval_s)

    def advance(self, begin_s: float, end_s: float, profile: FloatArray, tolerance: float) -> None:
        """Integrate over one segment of straight profiles."""
        from sims.forging._kernels import DONE, integrate

        absolute = ABSOLUTE * (tolerance / TOLERANCE)
        self.step_s, status = integrate(
            self.k, self.y, self.mode, begin_s, end_s, min(self.step_s, 1e-5), profile, absolute, tolerance,
            self.interval_s, self.select, self.counts, self.output, self.contacts,
        )  # fmt: skip
        if status != DONE or not np.isfinite(self.y).all():
            raise _failure(status, end_s)

    def response(self, signals: Sequence[str]) -> DriveResponse:
        """Return what was kept."""
        filled = int(self.counts[0])
        self.output[filled:] = self.output[filled - 1]  # rounding may leave the last point just beyond the end
        kept = {name: np.ascontiguousarray(self.output[:, i]) for i, name in enumerate(signals)}
        contacts = self.contacts[: self.counts[1]].copy()
        return DriveResponse(self.interval_s, kept, contacts, int(self.counts[2]), int(self.counts[3]))


def _failure(status: int, before_s: float) -> RefusalError:
    from sims.forging._kernels import STUCK, TOO_MANY_CONTACTS

    reasons = {
        TOO_MANY_CONTACTS: "flanks touch and part more often than any rattle",
        STUCK: "no step is short enough for the motion",
    }
    return RefusalError(
        f"the simulation stops before {before_s:g} s: {reasons.get(status, 'the motion grows without bound')}",
        remedy="check inertias, stiffness and backlash",
    )


# Are the steps short enough? A cycle at the tolerance in use, beside one at a hundred-thousandth of it.

EXACT = 1e-5
"""Of the tolerance in use."""
ALLOWED_S, ALLOWED = 1e-6, 1e-3
"""Of the impact's time, and relative of its energy, the force's rms and the balance of energy."""
CONTINUOUS_S = 3.0


@dataclass(frozen=True)
class ForgingConvergence:
    """What a far smaller tolerance changes.

    Parameters
    ----------
    impact : str
        Which one is looked at.
    time_s, exact_time_s : float
        Of that impact.
    energy_error : float
        Relative difference of its energy.
    force_error : float
        Relative difference of the interaction force's rms.
    balance_error : float
        Largest energy that appears or is lost, over the work put in.
    n_steps, n_exact_steps : int
    """

    impact: str
    time_s: float
    exact_time_s: float
    energy_error: float
    force_error: float
    balance_error: float
    n_steps: int
    n_exact_steps: int

    @property
    def converged(self) -> bool:
        """Whether all differences are allowed ones."""
        errors = (self.energy_error, self.force_error, self.balance_error)
        return abs(self.time_s - self.exact_time_s) <= ALLOWED_S and max(errors) <= ALLOWED

    @property
    def text(self) -> str:
        """For people."""
        late_s = abs(self.time_s - self.exact_time_s)
        limits = f"(allowed {ALLOWED_S:.0e} s)", f"(allowed {ALLOWED:g})"
        lines = [
            f"{self.n_steps} steps beside {self.n_exact_steps} at a tolerance {1 / EXACT:.0e} times as small:",
            f"  {self.impact} at {self.exact_time_s:.6g} s: off by {late_s:.1e} s {limits[0]}",
            f"  its energy: off by {self.energy_error:.1e} {limits[1]}",
            f"  rms of the interaction force: off by {self.force_error:.1e} {limits[1]}",
            f"  energy that appears or is lost: {self.balance_error:.1e} of the work put in {limits[1]}",
        ]
        return "\n".join([*lines, "converged" if self.converged else "NOT converged: flanks may rattle chaotically"])


def check_convergence(
    drive: ForgingDrive, cycle: Cycle, torque_nm: Profile, *, tolerance: float = TOLERANCE
) -> ForgingConvergence:
    """Run one cycle twice.

    The impact is the first one backwards after the torque has gone, in continuous rotation the first of all. What
    rattles afterwards may part however close two runs start: it is compared by the force's rms alone.

    Raises
    ------
    RefusalError
        If flanks never meet.
    """
    runs_on = cycle.mode == CONTINUOUS
    lasts_s = CONTINUOUS_S if runs_on else cycle.on_s + cycle.off_s
    profiles = schedule(cycle, torque_nm, lasts_s)
    ours, exact = (respond(drive, profiles, duration_s=lasts_s, tolerance=t) for t in (tolerance, EXACT * tolerance))
    flank, after_s = (0.0, 0.0) if runs_on else (-1.0, cycle.on_s)
    (time_s, speed), (exact_s, exact_speed) = (_first(run, flank, after_s) for run in (ours, exact))
    rms = [float(np.sqrt(np.mean(run["interaction force"] ** 2))) for run in (ours, exact)]
    balance = ours["energy"] - ours["work put in"] + ours["lost in contact"] + ours["lost in friction"]
    return ForgingConvergence(
        "first impact" if runs_on else "back-impact after the torque has gone",
        time_s,
        exact_s,
        abs((speed / exact_speed) ** 2 - 1.0),
        abs(rms[0] / rms[1] - 1.0),
        float(np.max(np.abs(balance)) / np.max(np.abs(ours["work put in"]))),
        ours.n_steps,
        exact.n_steps,
    )


def _first(run: DriveResponse, flank: float, after_s: float) -> tuple[float, float]:
    """Time and speed of the first contact on a flank (0: either) after a time."""
    fitting = (run.contact("start_s") > after_s) & ((run.contact("flank") == flank) | (flank == 0.0))
    if not np.any(fitting):
        raise RefusalError("the flanks never meet there: there is nothing to compare", remedy="give torque, or a brake")
    row = int(np.argmax(fitting))
    return float(run.contact("start_s")[row]), float(run.contact("start_speed_mps")[row])
