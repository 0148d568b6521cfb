"""Run the drive: angles, torque, interaction force, every contact; and the time integration."""

# mypy: allow-untyped-defs, allow-untyped-calls

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import ceil, cos, exp, floor, pi, sin
from typing import Any

import numpy as np
from scipy.integrate import RK45

from gearsig.checks import FloatArray, known_name, one_of, positive, within
from gearsig.compiled import copy, njit
from gearsig.errors import InputError, RefusalError
from gearsig.results import Result
from gearsig.rig import damping_ratio_s_per_m
from sims.forging._drive import CONTINUOUS, Cycle, ForgingDrive, Schedule, schedule
from sims.machine import Profile

# The drive as plain numbers for compiled code.

STATES = ("θ1", "ω1", "q", "q̇", "tooth bristle A", "tooth bristle B", "motor bristle", "load bristle")
"""Integrated states: angle and speed of the pinion, compression and its rate, four bristles; then three energies."""
ENERGIES = ("work put in", "lost in contact", "lost in friction")
N_STATES = len(STATES) + len(ENERGIES)

SIGNALS = (
    "pinion angle", "pinion speed", "pinion acceleration",
    "wheel angle", "wheel speed", "wheel acceleration",
    "torque", "interaction force", "compression", "compression rate", "pairs in contact", "tooth friction",
    "motor torque", "energy", "work put in", "lost in contact", "lost in friction",
)  # fmt: skip
"""Signals of a run, in rad, s, N m, N, m, J. "torque" is that of a sensor between motor and pinion."""

CONTACT_COLUMNS = (
    "start_s", "flank", "start_speed_mps", "pitch", "driver_angle_rad", "end_s", "end_speed_mps", "peak_force_n",
    "lost_j", "is_latched_at_floor",
)  # fmt: skip
"""Data of every contact, from the time its flanks touch to the time they separate (nan: still in contact)."""

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
"""Fields in SI units; compiled code reads them as attributes."""


def drive_numbers(drive: ForgingDrive) -> Any:
    """Return the drive as a record of `RECORD`."""
    path, contact = drive.path, drive.contact
    flanks = drive.flanks
    k = np.zeros(1, dtype=RECORD).view(np.recarray)[0]
    k["motor_inertia"], k["pinion_inertia"] = contact.motor_inertia_kg_m2, contact.driver_inertia_kg_m2
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
    k["speed_limit"], k["speed_band"] = drive.speed_limit_rad_s, drive.speed_band
    k["ripple_fraction"], k["ripple_order"] = drive.ripple_fraction, drive.ripple_order
    k["drag"], k["drag_viscous"] = drive.drag.level, drive.drag.viscous
    k["load_friction"], k["load_viscous"] = drive.load_friction.level, drive.load_friction.viscous
    for name, bristle in (("motor", drive.drag), ("load", drive.load_friction)):
        k[f"{name}_static_ratio"], k[f"{name}_stribeck"] = bristle.static_ratio, bristle.stribeck_speed
        k[f"{name}_presliding"], k[f"{name}_bristle_time"] = bristle.presliding, bristle.damping_time_s
    k["unbalance_torque"], k["unbalance_angle"] = drive.unbalance_nm, drive.unbalance_angle_rad
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
"""Relative error of a step; the absolute errors of the states scale with it."""
ABSOLUTE = np.array([1e-8, 1e-6, 1e-10, 1e-7, 1e-4, 1e-4, 1e-4, 1e-4])
"""Absolute errors at `TOLERANCE`, in rad, rad/s, m, m/s, and bristles in units of sliding friction; a loaded flank
deflects by 2e-5 m."""
CONTACTS_PER_SECOND = 2000
"""More than in any rattle; beyond this rate the run is stopped."""
MAX_POINTS = 60_000_000


@dataclass(frozen=True)
class FirstState:
    """Initial state of a run: angle and speed of the pinion, compression between the flanks and its rate."""

    pinion_angle_rad: float = 0.0
    pinion_speed_rad_s: float = 0.0
    compression_m: float = 0.0
    compression_rate_mps: float = 0.0


@dataclass(frozen=True)
class DriveResponse(Result, columns=("time_s", "signals")):
    """A run of the drive on an even time grid from 0, and its contacts.

    Parameters
    ----------
    interval_s : float
    signals : mapping
        Name (see `SIGNALS`) → (n,).
    contacts : array, (n_contacts, 10)
        See `CONTACT_COLUMNS`: as accurate as the event detection, not limited by the grid.
    n_steps, n_refused : int
        Steps of the integrator, and rejected ones.
    """

    interval_s: float
    signals: Mapping[str, FloatArray]
    contacts: FloatArray
    n_steps: int
    n_refused: int = 0

    @property
    def time_s(self) -> FloatArray:
        """Times of the points, (n,)."""
        return self.interval_s * np.arange(len(next(iter(self.signals.values()))))

    def __getitem__(self, name: str) -> FloatArray:
        """Return a signal by its name."""
        return self.signals[known_name(name, self.signals, f"there is no signal {name!r}")]

    def contact(self, column: str) -> FloatArray:
        """Return a column of the contacts by its name."""
        return self.contacts[:, CONTACT_COLUMNS.index(column)]


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

    Dormand–Prince 5(4) with error control. Steps end where flanks meet or separate, so that the impact speed is latched
    exactly, and at the knots of a profile.

    Parameters
    ----------
    drive : ForgingDrive
    profiles : Schedule
    duration_s, interval_s : float
        The grid is 0, interval, … below the duration.
    first : FirstState or None
        None: at rest, with the teeth in the middle of the backlash.
    tolerance : float
        1e-12 to 1e-3.
    signals : sequence of str
        Signals to keep, from `SIGNALS`. The steps, and hence the motion, do not depend on them.

    Raises
    ------
    RefusalError
        If flanks touch and separate endlessly, or the state diverges.
    """
    positive(duration_s, "duration_s", "s")
    positive(interval_s, "interval_s", "s")
    within(tolerance, "tolerance", 1e-12, 1e-3)
    n = ceil(duration_s / interval_s - 1e-9)
    if n > MAX_POINTS:
        raise InputError(f"{n} points are too many", allowed=f"up to {MAX_POINTS}", remedy="shorten the run")
    select = np.array([SIGNALS.index(one_of(name, "signals", SIGNALS)) for name in signals], dtype=np.int64)
    output = np.full((n, len(select)), np.nan)
    contacts = np.zeros((1000 + int(CONTACTS_PER_SECOND * duration_s), len(CONTACT_COLUMNS)))
    y, mode, counts = np.zeros(N_STATES), np.zeros(3), np.zeros(4, dtype=np.int64)
    start = first or FirstState()
    y[:4] = start.pinion_angle_rad, start.pinion_speed_rad_s, start.compression_m, start.compression_rate_mps
    k = drive_numbers(drive)
    flank = float(np.sign(y[2]))
    if flank * y[2] > reach(k, y[0], flank)[0]:
        open_contact(k, y, 0.0, flank, mode, contacts[0])
        counts[1] = 1
    step_s, absolute = 1e-6, ABSOLUTE * (tolerance / TOLERANCE)
    for begin, end in pairwise(profiles.segments(duration_s)):
        step_s, status = integrate(
            k, y, mode, begin, end, min(step_s, 1e-5), profiles.straight(begin, end), absolute, tolerance,
            interval_s, select, counts, output, contacts,
        )  # fmt: skip
        if status != DONE or not np.isfinite(y).all():
            raise _failure(status, end)
    n_filled, n_contacts, n_steps, n_refused = counts.tolist()
    output[n_filled:] = output[n_filled - 1]  # rounding may put the last point just beyond the end
    kept = {name: np.ascontiguousarray(output[:, i]) for i, name in enumerate(signals)}
    return DriveResponse(interval_s, kept, contacts[:n_contacts].copy(), n_steps, n_refused)


def _failure(status: int, before_s: float) -> RefusalError:
    reasons = {
        TOO_MANY_CONTACTS: "flanks touch and separate more often than in any rattle",
        STUCK: "no step is short enough for the motion",
    }
    return RefusalError(
        f"the simulation stops before {before_s:g} s: {reasons.get(status, 'the motion grows without bound')}",
        remedy="check inertias, stiffness and backlash",
    )


# Convergence: a cycle at the tolerance in use, compared with one at a hundred-thousandth of it.

EXACT = 1e-5
"""Tolerance of the reference run over that in use."""
ALLOWED_S, ALLOWED = 1e-6, 1e-3
"""Allowed error of the impact's time, and relative error of its energy, the rms force and the energy balance."""
CONTINUOUS_S = 3.0


@dataclass(frozen=True)
class ForgingConvergence:
    """Effect of a far smaller tolerance.

    Parameters
    ----------
    impact : str
        The impact that is compared.
    time_s, exact_time_s : float
        Of that impact.
    energy_error : float
        Relative difference of its energy.
    force_error : float
        Relative difference of the interaction force's rms.
    balance_error : float
        Maximum energy that appears or is lost, over the work put in.
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
        """Whether all differences are within the allowed ones."""
        errors = (self.energy_error, self.force_error, self.balance_error)
        return abs(self.time_s - self.exact_time_s) <= ALLOWED_S and max(errors) <= ALLOWED

    @property
    def text(self) -> str:
        """Readable summary."""
        late_s = abs(self.time_s - self.exact_time_s)
        limits = f"(allowed {ALLOWED_S:.0e} s)", f"(allowed {ALLOWED:g})"
        lines = [
            f"{self.n_steps} steps, compared with {self.n_exact_steps} at a tolerance smaller by {1 / EXACT:.0e}:",
            f"  {self.impact} at {self.exact_time_s:.6g} s: off by {late_s:.1e} s {limits[0]}",
            f"  its energy: off by {self.energy_error:.1e} {limits[1]}",
            f"  rms of the interaction force: off by {self.force_error:.1e} {limits[1]}",
            f"  energy that appears or is lost: {self.balance_error:.1e} of the work put in {limits[1]}",
        ]
        return "\n".join([*lines, "converged" if self.converged else "NOT converged: flanks may rattle chaotically"])


def check_convergence(
    drive: ForgingDrive, cycle: Cycle, torque_nm: Profile, *, tolerance: float = TOLERANCE
) -> ForgingConvergence:
    """Run one cycle at two tolerances and compare.

    The compared impact is the first one on the back flank after the torque is off; in continuous rotation, the first of
    all. Rattle after it may diverge however close two runs start, so it is compared only by the rms force.

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
    """Time and speed of the first contact on a flank (0: any) after a given time."""
    fitting = (run.contact("start_s") > after_s) & ((run.contact("flank") == flank) | (flank == 0.0))
    if not np.any(fitting):
        raise RefusalError("the flanks never meet, so there is nothing to compare", remedy="give torque, or a brake")
    row = int(np.argmax(fitting))
    return float(run.contact("start_s")[row]), float(run.contact("start_speed_mps")[row])


# --------------------
# Compiled: integration over one segment of linear profiles, with detection of every gain and loss of contact.
# --------------------


# Compiled: which tooth pairs carry load, where worn ones touch, and the contact force.


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _step(x):
    """Smooth step from 0 to 1 with two continuous derivatives, and its slope."""
    if x <= 0.0:
        return 0.0, 0.0
    if x >= 1.0:
        return 1.0, 0.0
    return x * x * x * (10.0 + x * (6.0 * x - 15.0)), 30.0 * x * x * (1.0 - x) * (1.0 - x)


@njit(cache=True, nogil=True, error_model="numpy")
def weight(k, p):
    """Fraction of its full stiffness that a pair has p base pitches after its entry, and its slope over p."""
    rise, up = _step(p / k.ramp + 0.5)
    stay, down = _step((k.contact_ratio - p) / k.ramp + 0.5)
    return rise * stay, (up * stay - rise * down) / k.ramp


@njit(cache=True, nogil=True, error_model="numpy")
def later_pair(k, angle, flank):
    """Number of the younger of the two pairs that may be in contact.

    The pairs are renumbered halfway through single contact, after the old pair has left and before the new one arrives,
    so that nothing jumps in either direction.
    """
    x = angle * k.cycles_per_rad - k.phase
    if flank < 0:
        x = k.mirror - x
    return floor(x - 0.5 * k.contact_ratio) + 1.0


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def position(k, angle, flank, younger):
    """Base pitches of the younger pair from its entry, and the slope over the pinion's angle."""
    x = angle * k.cycles_per_rad - k.phase
    if flank < 0:
        return k.mirror - x - younger, -k.cycles_per_rad
    return x - younger, k.cycles_per_rad


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def stiffness_share(k, number, flank):
    """Fraction of a pair's stiffness that remains: less than 1 for a weak tooth on its drive flank."""
    if flank > 0 and k.weak_loss > 0.0 and number - floor(number / k.weak_teeth) * k.weak_teeth == k.weak_tooth:
        return 1.0 - k.weak_loss
    return 1.0


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def worn_off(k, p, flank):
    """Wear depth of a pair p base pitches after its entry, on drive flanks only, and its slope over p.

    Cubic between the points of the table, with their slopes; constant beyond the path of contact.
    """
    if flank < 0 or k.is_worn == 0.0:
        return 0.0, 0.0
    x = p / k.contact_ratio * (k.wear.shape[0] - 1)
    if x <= 0.0:
        return k.wear[0], 0.0
    if x >= k.wear.shape[0] - 1:
        return k.wear[-1], 0.0
    i = int(x)
    u = x - i
    a, b, c, d = k.wear[i], k.wear[i + 1], k.wear_slope[i], k.wear_slope[i + 1]
    depth = a + u * (c + u * (3.0 * (b - a) - 2.0 * c - d + u * (2.0 * (a - b) + c + d)))
    slope = c + u * (2.0 * (3.0 * (b - a) - 2.0 * c - d) + u * 3.0 * (2.0 * (a - b) + c + d))
    return depth, slope * (k.wear.shape[0] - 1) / k.contact_ratio


@njit(cache=True, nogil=True, error_model="numpy")
def reach(k, angle, flank):
    """Compression in a flank's direction at which its first pair touches, and its slope over the angle."""
    if flank < 0 or k.is_worn == 0.0:
        return k.half_backlash, 0.0
    p, slope = position(k, angle, flank, later_pair(k, angle, flank))
    smallest, change = 1e9, 0.0
    for i in range(2):
        if -0.5 * k.ramp < p + i < k.contact_ratio + 0.5 * k.ramp:
            depth, over = worn_off(k, p + i, flank)
            if depth < smallest:
                smallest, change = depth, over * slope
    return k.half_backlash + smallest, change


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def one_pair(k, depth, closing, damping):
    """Force of one tooth pair at full stiffness, elastic and with damping; never tensile."""
    if depth <= 0.0:
        return 0.0, 0.0
    elastic = k.stiffness * (depth * depth**0.5 if k.exponent == 1.5 else depth**k.exponent)
    return elastic, max(elastic * (1.0 + damping * closing), 0.0)


@njit(cache=True, nogil=True, error_model="numpy")
def stored_energy(k, angle, q, flank, younger):
    """Energy in the teeth in contact, Σ n_i(θ1) k g_i^(λ+1)/(λ+1)."""
    if flank == 0 or flank * q <= k.half_backlash:
        return 0.0
    p, _ = position(k, angle, flank, younger)
    total = 0.0
    for i in range(2):
        depth = flank * q - k.half_backlash - worn_off(k, p + i, flank)[0]
        if depth > 0.0:
            n = weight(k, p + i)[0] * stiffness_share(k, younger - i, flank)
            total += n * k.stiffness * depth ** (k.exponent + 1.0) / (k.exponent + 1.0)
    return total


# Compiled: LuGre friction of a shaft, and of tooth flanks with varying normal force.


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def bristle(v, z, static_ratio, stribeck, presliding, bristle_time):
    """Force over its sliding level, and dz/dt; see `sims.forging.Bristle`."""
    stribeck_weight = exp(-((v / stribeck) ** 2))
    rate = (v - abs(v) * z / (1.0 + (static_ratio - 1.0) * stribeck_weight)) / presliding
    return z + bristle_time * stribeck_weight * rate, rate


# Compiled: the equations of motion of the drive.


@njit(cache=True, nogil=True, error_model="numpy")
def tooth_friction(k, n, p, z, w1, w2, flank):
    """Friction force of a pair with normal force n, its moments about both axes, power loss, and its bristle's rate.

    v_s = −ω1 ρ1 + ω2 ρ2 on the drive flank, mirrored on the back flank; the bristle z tends to ±μ.
    """
    rho_1 = k.start + p * k.base_pitch
    rho_2 = k.length - rho_1
    v = flank * (w2 * rho_2 - w1 * rho_1)
    coefficient = k.tooth_friction * (1.0 + (k.tooth_static_ratio - 1.0) * exp(-((v / k.tooth_stribeck) ** 2)))
    rate = (v * k.tooth_friction - abs(v) * z * k.tooth_friction / coefficient) / k.tooth_presliding
    f = n * z
    return f, f * rho_1, f * rho_2, f * v, rate


@njit(cache=True, nogil=True, error_model="numpy")
def rates(k, y, flank, younger, damping, torque, brake, press, dy, out):
    """Fill `dy` with the rates of the states and `out` with the other signals at this time.

    J1 ω̇1 = T_m − T_1 − rb1 F + Σ f ρ1 − ∂V/∂θ1,  J2 ω̇2 = rb2 F − Σ f ρ2 − T_2 + T_press − T_weight.
    ∂V/∂θ1 is the torque due to the changing number of pairs (J.-J. Oh, K. Grosh, J. R. Barber, Energy conserving
    equations of motion for gear systems, 2005): without it the mesh would drive or brake the motor. Worn flanks act in
    the same way: δ_i = ±q − a − h(p_i), so that N_i h'(p_i) dp/dθ1 acts on the pinion.
    """
    w1, q, q_rate = y[1], y[2], y[3]
    w2 = (k.rb1 * w1 - q_rate) / k.rb2
    force, turn_1, turn_2, loss, friction = 0.0, 0.0, 0.0, 0.0, 0.0
    pairs, damped = 0.0, 0.0
    dy[4], dy[5] = 0.0, 0.0
    if flank != 0 and flank * q > k.half_backlash:
        p, slope = position(k, y[0], flank, younger)
        for i in range(2):
            worn, over = worn_off(k, p + i, flank)
            depth = flank * q - k.half_backlash - worn
            w, dw = weight(k, p + i)
            if depth <= 0.0 or w <= 0.0:
                continue
            share = stiffness_share(k, younger - i, flank)
            w, dw = w * share, dw * share
            closing = flank * q_rate - over * slope * w1
            elastic, pressed = one_pair(k, depth, closing, damping)
            pairs += w
            force += flank * w * pressed
            turn_1 += slope * (over * w * pressed - dw * elastic * depth / (k.exponent + 1.0))
            damped += w * (pressed - elastic) * closing
            if k.tooth_friction > 0.0:
                f, on_1, on_2, lost, rate = tooth_friction(k, w * pressed, p + i, y[4 + i], w1, w2, flank)
                turn_1 += flank * on_1
                turn_2 -= flank * on_2
                loss += lost
                friction += f
                dy[4 + i] = rate
    share_1, dy[6] = bristle(w1, y[6], k.motor_static_ratio, k.motor_stribeck, k.motor_presliding, k.motor_bristle_time)
    share_2, dy[7] = bristle(w2, y[7], k.load_static_ratio, k.load_stribeck, k.load_presliding, k.load_bristle_time)
    drag = (k.drag + brake) * share_1 + k.drag_viscous * w1
    held = k.load_friction * share_2 + k.load_viscous * w2
    motor = torque * (1.0 + k.ripple_fraction * cos(k.ripple_order * y[0]))
    if k.speed_limit > 0.0:
        motor *= min(1.0, max(-1.0, (k.speed_limit - w1) / (k.speed_band * k.speed_limit)))
    angle_2 = (k.rb1 * y[0] - q) / k.rb2
    outside = press - k.unbalance_torque * sin(angle_2 + k.unbalance_angle)
    a1 = (motor - drag - k.rb1 * force + turn_1) / (k.motor_inertia + k.pinion_inertia)
    a2 = (k.rb2 * force + turn_2 - held + outside) / k.wheel_inertia
    dy[0], dy[1], dy[2], dy[3] = w1, a1, q_rate, k.rb1 * a1 - k.rb2 * a2
    dy[8] = motor * w1 + outside * w2
    dy[9] = damped
    dy[10] = loss + drag * w1 + held * w2
    out[0], out[1], out[2] = y[0], w1, a1
    out[3], out[4], out[5] = angle_2, w2, a2
    out[6], out[7] = motor - drag - k.motor_inertia * a1, force
    out[8], out[9], out[10], out[11], out[12] = q, q_rate, pairs, friction, motor


@njit(cache=True, nogil=True, error_model="numpy")
def energy(k, y, flank, younger):
    """Kinetic energy plus the energy stored in the teeth."""
    w2 = (k.rb1 * y[1] - y[3]) / k.rb2
    kinetic = 0.5 * (k.motor_inertia + k.pinion_inertia) * y[1] ** 2 + 0.5 * k.wheel_inertia * w2**2
    return kinetic + stored_energy(k, y[0], y[2], flank, younger)


# Compiled: one step of the Dormand–Prince pair 5(4), its error, and its dense output.
#
# Source of the coefficients: `scipy.integrate.RK45` (J. R. Dormand, P. J. Prince, A family of embedded Runge-Kutta
# formulae, 1980; dense output by L. F. Shampine, Some practical Runge-Kutta formulas, 1986).

N_STAGES = 7
NODES = np.append(RK45.C, 1.0)
STAGES = np.zeros((N_STAGES, N_STAGES - 1))
STAGES[: N_STAGES - 1, : N_STAGES - 2] = RK45.A
STAGES[N_STAGES - 1] = RK45.B
ERROR = np.asarray(RK45.E)
DENSE = np.asarray(RK45.P)


@njit(cache=True, nogil=True, error_model="numpy")
def step(k, y, t, h, mode, profile, stages, end, out):
    """Step from y (first stage already in `stages[0]`) to `end`; `out` holds the signals at the step's end.

    mode : flank, younger pair, damping.
    profile : time 0 and values of torque, brake, press with their slopes.
    """
    n = y.shape[0]
    for s in range(1, N_STAGES):
        for i in range(n):
            total = 0.0
            for j in range(s):
                total += STAGES[s, j] * stages[j, i]
            end[i] = y[i] + h * total
        evaluate(k, end, t + NODES[s] * h, mode, profile, stages[s], out)


@njit(cache=True, nogil=True, error_model="numpy")
def evaluate(k, y, t, mode, profile, dy, out):
    """Fill `dy` with the rates, and `out`, at time t."""
    since = t - profile[0]
    rates(
        k, y, mode[0], mode[1], mode[2],
        profile[1] + profile[2] * since, profile[3] + profile[4] * since, profile[5] + profile[6] * since, dy, out,
    )  # fmt: skip


@njit(cache=True, nogil=True, error_model="numpy")
def error_norm(y, end, h, stages, absolute, relative):
    """Maximum ratio of a state's error to the allowed error."""
    worst = 0.0
    for i in range(absolute.shape[0]):
        error = 0.0
        for j in range(N_STAGES):
            error += ERROR[j] * stages[j, i]
        allowed = absolute[i] + relative * max(abs(y[i]), abs(end[i]))
        worst = max(worst, abs(h * error) / allowed)
    return worst


@njit(cache=True, nogil=True, error_model="numpy")
def within_step(y, h, stages, x, i):
    """State i at the fraction x of a step, 0 to 1, to fourth order."""
    total = 0.0
    for j in range(N_STAGES):
        total += stages[j, i] * (x * (DENSE[j, 0] + x * (DENSE[j, 1] + x * (DENSE[j, 2] + x * DENSE[j, 3]))))
    return y[i] + h * total


N_OUT = 13
N_SIGNALS = 17
LONGEST_STEP_S = 1e-3
SHORTEST_STEP_S = 1e-12
MAX_TURN = 0.03
"""Maximum base pitches in one step, so that pairs are renumbered within single contact."""
ROOT_M = 1e-16
DONE, TOO_MANY_CONTACTS, STUCK = 0, 1, 2


@njit(cache=True, nogil=True, error_model="numpy")
def integrate(
    k, y, mode, t, t_end, first_step, profile, absolute, relative, interval, select, counts, output, contacts
):
    """Run from t to `t_end`; fill rows of `output` at multiples of `interval` and rows of `contacts`.

    y : states, left at their final values.
    mode : flank (−1, 0, 1), younger pair, damping of the contact; left at their final values.
    profile : start time, then value and slope of torque, brake and press.
    select : indices of the requested signals in `SIGNALS`.
    counts : rows filled so far in `output` and in `contacts` (an unfinished contact is the last row), steps taken,
        steps rejected; updated.
    Returns the last step's length and a status.
    """
    n = y.shape[0]
    stages, end = np.empty((N_STAGES, n)), np.empty(n)
    out, spare = np.empty(N_OUT), np.empty((2, n))
    h = first_step
    evaluate(k, y, t, mode, profile, stages[0], out)
    while t < t_end - 1e-15 * max(1.0, t_end):
        turn = abs(y[1]) * k.cycles_per_rad
        h = min(h, LONGEST_STEP_S, MAX_TURN / turn if turn > 0.0 else LONGEST_STEP_S)
        free = h
        h = min(h, t_end - t)
        step(k, y, t, h, mode, profile, stages, end, out)
        error = error_norm(y, end, h, stages, absolute, relative)
        if not error <= 1.0:
            counts[3] += 1
            h *= max(0.2, 0.9 * error**-0.2) if error < 1e30 else 0.1
            if h < SHORTEST_STEP_S:
                return h, STUCK
            continue
        counts[2] += 1
        next_flank = _flank_after(k, y, end, h, stages, mode[0])
        changes = next_flank != mode[0]
        if changes:
            h = _to_event(k, y, t, h, mode, profile, stages, end, out, next_flank)
        if counts[0] < output.shape[0] and counts[0] * interval <= t + h:
            _fill_rows(k, y, t, h, mode, profile, stages, interval, select, counts, output, spare)
        t += h
        copy(end, y)
        if mode[0] != 0.0:
            contacts[counts[1] - 1, 7] = max(contacts[counts[1] - 1, 7], abs(out[7]))
        if changes:
            if not _change_contact(k, y, t, next_flank, mode, counts, contacts):
                return h, TOO_MANY_CONTACTS
            evaluate(k, y, t, mode, profile, stages[0], out)
            h = min(free, 1e-5)
            continue
        if mode[0] != 0.0 and _hand_over(k, y, mode):
            evaluate(k, y, t, mode, profile, stages[0], out)
        else:
            copy(stages[N_STAGES - 1], stages[0])
        grown = h * min(5.0, 0.9 * max(error, 1e-10) ** -0.2)
        h = max(grown, free) if h < free else grown
    return h, DONE


@njit(cache=True, nogil=True, error_model="numpy")
def _fill_rows(k, y, t, h, mode, profile, stages, interval, select, counts, output, spare):
    """Fill the rows of `output` whose times are within a step."""
    extra, row = np.empty(N_OUT), np.empty(N_SIGNALS)
    at = spare[0]
    while counts[0] < output.shape[0] and counts[0] * interval <= t + h:
        x = (counts[0] * interval - t) / h
        for i in range(y.shape[0]):
            at[i] = within_step(y, h, stages, x, i)
        evaluate(k, at, t + x * h, mode, profile, spare[1], extra)
        copy(extra, row)
        row[N_OUT] = energy(k, at, mode[0], mode[1])
        row[N_OUT + 1], row[N_OUT + 2], row[N_OUT + 3] = at[8], at[9], at[10]
        for i in range(select.shape[0]):
            output[counts[0], i] = row[select[i]]
        counts[0] += 1


@njit(cache=True, nogil=True, error_model="numpy")
def _change_contact(k, y, t, next_flank, mode, counts, contacts):
    """End the present contact and begin the next; false if no row is left for it."""
    if mode[0] != 0.0:
        row = contacts[counts[1] - 1]
        row[5], row[6], row[8] = t, abs(y[3]), y[9] - row[8]
    if next_flank != 0.0:
        if counts[1] == contacts.shape[0]:
            return False
        open_contact(k, y, t, next_flank, mode, contacts[counts[1]])
        counts[1] += 1
    mode[0] = next_flank
    return True


@njit(cache=True, nogil=True, error_model="numpy")
def open_contact(k, y, t, flank, mode, row):
    """Latch the impact speed and the resulting damping; the bristles of the flanks start undeflected."""
    mode[0] = flank
    mode[1] = later_pair(k, y[0], flank)
    speed = abs(flank * y[3] - reach(k, y[0], flank)[1] * y[1])
    mode[2] = k.damping_at_1_mps / max(speed, k.speed_floor)
    y[4], y[5] = 0.0, 0.0
    row[0], row[1], row[2] = t, flank, speed
    row[3], row[4] = floor(y[0] * k.cycles_per_rad - k.phase), y[0]
    row[5], row[6], row[7] = np.nan, np.nan, 0.0
    row[8], row[9] = y[9], 1.0 if speed < k.speed_floor else 0.0


@njit(cache=True, nogil=True, error_model="numpy")
def _hand_over(k, y, mode):
    """Move the bristles to the next slot if the younger pair has changed; return whether it has."""
    younger = later_pair(k, y[0], mode[0])
    if younger == mode[1]:
        return False
    if younger > mode[1]:
        y[4], y[5] = 0.0, y[4]
    else:
        y[4], y[5] = y[5], 0.0
    mode[1] = younger
    return True


@njit(cache=True, nogil=True, error_model="numpy")
def _flank_after(k, y, end, h, stages, flank):
    """Flank in contact at the end of the step, or first touched during it."""
    if flank != 0.0:
        return 0.0 if flank * end[2] < reach(k, end[0], flank)[0] else flank
    if abs(end[2]) > k.half_backlash:
        side = 1.0 if end[2] > 0.0 else -1.0
        if side * end[2] > reach(k, end[0], side)[0]:
            return side
    if y[3] * end[3] < 0.0:  # the motion reversed during the step, possibly beyond the flank
        x = y[3] / (y[3] - end[3])
        q = within_step(y, h, stages, x, 2)
        side = 1.0 if q > 0.0 else -1.0
        if side * q > reach(k, within_step(y, h, stages, x, 0), side)[0]:
            return side
    return 0.0


@njit(cache=True, nogil=True, error_model="numpy")
def _to_event(k, y, t, h, mode, profile, stages, end, out, next_flank):
    """Shorten the step to the time at which the flanks meet or separate; return its length.

    First by bisection on the interpolant, then by Newton's method with actual steps.
    """
    flank = next_flank if next_flank != 0.0 else mode[0]
    entering = next_flank != 0.0
    low, high = 0.0, 1.0
    if entering and not flank * end[2] > reach(k, end[0], flank)[0]:
        high = y[3] / (y[3] - end[3])
    for _ in range(50):
        middle = 0.5 * (low + high)
        edge = reach(k, within_step(y, h, stages, middle, 0), flank)[0]
        if (flank * within_step(y, h, stages, middle, 2) > edge) == entering:
            high = middle
        else:
            low = middle
    length = high * h
    for _ in range(4):
        length = min(max(length, 1e-15), h)
        step(k, y, t, length, mode, profile, stages, end, out)
        edge, over = reach(k, end[0], flank)
        distance = flank * end[2] - edge
        speed = flank * end[3] - over * end[1]
        if abs(distance) < ROOT_M or speed == 0.0:
            break
        change = distance / speed
        if abs(change) > 0.1 * h:
            break
        length -= change
    return length
