"""Everything that some cycles of a start–stop recording tell, and how it changes from one machine to another."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from gearsig.checks import FloatArray
from gearsig.errors import RefusalError
from gearsig.motion import (
    Impact,
    MotionSegments,
    PairMotion,
    find_impacts,
    friction_share,
    is_start_stop,
    local_polynomial,
    motion_segments,
)

# --------------------
# A start–stop recording cut into its cycles: start, run, stop, rest.
# --------------------


MIN_CYCLES = 2
MIN_STANDING = 0.05
"""Of the time: a machine that stands so long has stopped."""
MAX_RATE_HZ = 2000.0
"""Motion of shafts is slower; vibration is not looked at here."""
STARTING_S, SETTLING_S = 0.15, 0.1
"""How long a start rings, and a stop: times of the shares over phases, not of the fits."""
PHASES = ("start", "run", "stop", "rest")


@dataclass(frozen=True)
class CycledMotion:
    """A motion and its cycles.

    Parameters
    ----------
    motion : PairMotion
    course : Course
        Of the driver.
    number : array of int, (n,)
        Cycle of each sample, from 0; −1 ahead of the first start.
    phase : array of int, (n,)
        Place in `PHASES`.
    """

    motion: PairMotion
    course: MotionSegments
    number: NDArray[np.int64]
    phase: NDArray[np.int64]

    @property
    def n_cycles(self) -> int:
        """Starts with what follows them, up to the next."""
        return int(self.number.max()) + 1

    def samples_of(self, cycles: tuple[int, ...]) -> NDArray[np.bool_]:
        """Which samples belong to some cycles."""
        found: NDArray[np.bool_] = np.isin(self.number, cycles)
        return found


def cut_cycles(motion: PairMotion) -> CycledMotion:
    """Cut a motion into cycles.

    Raises
    ------
    RefusalError
        If it does not start and stop, or hardly ever: nothing would be left to check a fit on.
    """
    thinned = thin(motion)
    course = motion_segments(thinned.driver_angle_rad, thinned.sampling_rate_hz)
    where = thinned.source or "the recording"
    if not is_start_stop(course) and course.standing_part < MIN_STANDING:
        raise RefusalError(
            f"{where} turns all the time: no start and stop is in it, and the start–stop diagnosis rests on them",
            remedy="record starts and stops; compare stationary running with --model cracked or reduced-fe",
        )
    moving = course.moving
    if len(moving) < MIN_CYCLES:
        n = f"{len(moving)} start{'' if len(moving) == 1 else 's'}"
        raise RefusalError(
            f"{where} has {n}: what is fitted to one cycle must be checked on another",
            remedy="record several starts and stops; six or more tell most",
        )
    number = np.full(len(thinned.driver_angle_rad), -1, dtype=np.int64)
    phase = np.full(len(number), PHASES.index("rest"), dtype=np.int64)
    rate = thinned.sampling_rate_hz
    for i, stretch in enumerate(moving):
        number[stretch.first :] = i
        begun = min(stretch.first + round(STARTING_S * rate), stretch.last)
        stops = _stop_of(thinned, stretch.first, stretch.last)
        phase[stretch.first : stops] = PHASES.index("run")
        phase[stretch.first : min(begun, stops)] = PHASES.index("start")
        phase[stops : stretch.last + round(SETTLING_S * rate)] = PHASES.index("stop")
    return CycledMotion(thinned, course, number, phase)


def halves(cycles: CycledMotion) -> tuple[tuple[int, ...], tuple[int, ...]]:
    """Every second cycle, and the others: what drifts is in both."""
    n = cycles.n_cycles
    return tuple(range(0, n, 2)), tuple(range(1, n, 2))


def thin(motion: PairMotion) -> PairMotion:
    """Return every n-th sample of a motion that is sampled faster than shafts move: instants stay instants."""
    step = max(1, int(motion.sampling_rate_hz / MAX_RATE_HZ + 1e-9))
    if step == 1:
        return motion

    def every(values: FloatArray) -> FloatArray:
        return values[::step]

    return replace(
        motion,
        sampling_rate_hz=motion.sampling_rate_hz / step,
        driver_angle_rad=every(motion.driver_angle_rad),
        driven_angle_rad=every(motion.driven_angle_rad),
        driver_speed_rad_s=every(motion.driver_speed_rad_s),
        driven_speed_rad_s=every(motion.driven_speed_rad_s),
        driver_acceleration_rad_s2=every(motion.driver_acceleration_rad_s2),
        driven_acceleration_rad_s2=every(motion.driven_acceleration_rad_s2),
        torque_nm=None if motion.torque_nm is None else every(motion.torque_nm),
        force_n=None if motion.force_n is None else every(motion.force_n),
    )


def _stop_of(motion: PairMotion, first: int, last: int) -> int:
    """Sample from which the driver only slows down: the last at which it has 90 % of the stretch's top speed."""
    speed = np.abs(motion.driver_speed_rad_s[first:last])
    fast = np.flatnonzero(speed > 0.9 * np.quantile(speed, 0.98))
    return first + int(fast[-1]) + 1 if len(fast) else last


# --------------------
# What the loaded flanks tell: play, deflection, single teeth, the shape of worn flanks, run-out.
# --------------------


Mask = NDArray[np.bool_]
LOADED = 0.1
"""Part of the ordinary load from which on a sample tells where a flank is."""
LEAST_SAMPLES, LEAST_OF_A_TOOTH, LEAST_OF_A_PLACE = 12, 3, 5
EDGE = 0.07
"""Base pitches around the entry and exit of pairs that are left out."""
FAR, MAX_ROUNDS = 4.0, 4
PARTED_M = 5e-5
"""A sample further from one level for all places lies in the play: the flanks have just parted. Worn flanks differ by
less from place to place, as the least worn pair decides."""
FULL_TURN = 0.7
"""Revolutions from which on a wave of one cycle per revolution is told from a straight line."""
N_PLACES = 20
"""Parts of the mesh cycle."""


@dataclass(frozen=True)
class Flanks:
    """Samples that tell where the flanks are, prepared once per recording.

    Parameters
    ----------
    design : array, (n, k)
        Columns: side, deflection (0 without torque), and waves of the shafts.
    loaded, alone : array of bool, (n,)
        One of the flanks carries; a single pair carries on the drive flank.
    place : array of int, (n,)
        Of a sample within the mesh cycle, 0 to `N_PLACES` − 1.
    tooth : array of int, (n,)
        Of the driver, from 0.
    """

    motion: PairMotion
    design: FloatArray
    loaded: Mask
    alone: Mask
    place: NDArray[np.int64]
    tooth: NDArray[np.int64]


@dataclass(frozen=True)
class ContactPart:
    """What was found; lengths in µm along the line of action, nan where it cannot be told.

    Parameters
    ----------
    play_um, deflection_um : float
        Without load; of one pair under the ordinary load.
    teeth_um : array, (n_teeth,)
        How much further each tooth of the driver lets the gears turn than the middling one, while it carries alone.
    waves_um : array, (4,)
        Cosine and sine of the driver's revolution, then of the driven gear's.
    curve_um : array, (N_PLACES,)
        Course of the compression over the mesh cycle on the drive flank, its mean taken off.
    scatter_um : float
        Root mean square of what is left over.
    zero_m : float
        Compression in the middle of the play.
    """

    play_um: float
    deflection_um: float
    teeth_um: FloatArray
    waves_um: FloatArray
    curve_um: FloatArray
    scatter_um: float
    zero_m: float = float("nan")


def prepare_flanks(cycles: CycledMotion) -> Flanks:
    """Find the samples that tell where the flanks are."""
    m = cycles.motion
    force = m.tooth_force_from_torque_n
    side, loaded, elastic = _by_load(m, force) if force is not None else _by_place(m)
    speed = np.abs(m.driver_speed_rad_s)
    path = m.path
    u = path.position(m.driver_angle_rad, side)
    clear = (u > EDGE) & (u < 1.0 - EDGE) & (np.abs(u - (path.contact_ratio - 1.0)) > EDGE)
    alone = loaded & clear & (side > 0.0) & (u > path.contact_ratio - 1.0)
    alone &= speed > 0.05 * float(np.quantile(speed, 0.95))
    columns = [side, elastic, np.cos(m.driver_angle_rad), np.sin(m.driver_angle_rad)]
    turned = float(np.ptp(m.driven_angle_rad)) / (2.0 * np.pi)
    if turned > FULL_TURN:
        columns += [np.cos(m.driven_angle_rad), np.sin(m.driven_angle_rad)]
    place = np.clip((u * N_PLACES).astype(np.int64), 0, N_PLACES - 1)
    tooth = (path.tooth(m.driver_angle_rad) - 1.0).astype(np.int64)
    return Flanks(m, np.stack(columns, axis=1), loaded & clear, alone, place, tooth)


def contact_part(flanks: Flanks, wanted: Mask) -> ContactPart:
    """Fit q = b on the back flank, d_p at place p of the mesh cycle on the drive flank, deflection and waves to both.

    q = b [s < 0] + Σ_p d_p [s > 0, p] + s κ (|F|/n)^{1/λ} + waves; what is left is sorted by tooth. Play is d̄ − b. A
    level for each place leaves the deflection to what the load changes there, and shows the shape of worn flanks.
    """
    m, q = flanks.motion, flanks.motion.compression_m
    drive = flanks.design[:, 0] > 0.0
    keep = flanks.loaded & wanted
    keep &= _touching(flanks, q, keep, drive)
    back = keep & ~drive
    has_torque, has_back = bool(np.any(flanks.design[keep, 1])), np.sum(back) >= LEAST_SAMPLES
    counts = np.bincount(flanks.place[keep & drive], minlength=N_PLACES)
    places = np.flatnonzero(counts >= LEAST_OF_A_PLACE)
    if len(places) < N_PLACES // 3:
        return _nothing(m)
    known = np.isin(flanks.place, places)
    keep = keep & ((drive & known) | (~drive & has_back))
    levels = (drive[:, None] & (flanks.place[:, None] == places)).astype(np.float64)
    others = [c for c in range(1, flanks.design.shape[1]) if c != 1 or has_torque]
    columns = [levels, flanks.design[:, others]] + ([(~drive)[:, None].astype(np.float64)] if has_back else [])
    design = np.concatenate(columns, axis=1)
    x, keep = _robust(design, q, keep, drive)
    left = q - design @ x
    of = dict(zip(others, x[len(places) : len(places) + len(others)], strict=True))
    middle = float(np.mean(x[: len(places)]))
    play = middle - float(x[-1]) if has_back else np.nan
    curve = np.full(N_PLACES, np.nan)
    curve[places] = x[: len(places)] - middle
    alone = flanks.alone & known & wanted & (np.abs(left) < PARTED_M)
    ordinary = float(np.median(np.abs(flanks.design[alone, 1]))) if np.any(alone) else np.nan
    deflection = 1e6 * of.get(1, np.nan) * ordinary
    return ContactPart(
        1e6 * play if play > 0.0 else float("nan"),
        deflection if deflection > 0.0 else float("nan"),
        1e6 * _by_tooth(flanks, left, alone),
        1e6 * np.array([of.get(c, np.nan) for c in (2, 3, 4, 5)]),
        1e6 * curve,
        1e6 * float(np.sqrt(np.mean(left[keep] ** 2))),
        middle - 0.5 * play if has_back else float("nan"),
    )


def _by_load(m: PairMotion, force: FloatArray) -> tuple[FloatArray, Mask, FloatArray]:
    """Side, loaded samples and (|F|/n)^{1/λ} from the torque."""
    loaded = np.abs(force) > LOADED * float(np.quantile(np.abs(force), 0.95))
    side = np.where(force < 0.0, -1.0, 1.0)
    n_pairs = m.path.n_pairs(m.driver_angle_rad, side)
    return side, loaded, side * (np.abs(force) / n_pairs) ** (1.0 / m.contact.exponent)


def _by_place(m: PairMotion) -> tuple[FloatArray, Mask, FloatArray]:
    """The same without torque: a flank carries where the compression is near the ends of its range."""
    q, speed = m.compression_m, np.abs(m.driver_speed_rad_s)
    turning = speed > 0.05 * float(np.quantile(speed, 0.95))
    low, high = np.quantile(q[turning], [0.01, 0.99])
    drawn = 2e-6 * m.contact.half_backlash_um
    side = np.where(q > 0.5 * (low + high), 1.0, -1.0)
    loaded = turning & (np.minimum(high - q, q - low) < 0.25 * (high - low))
    if high - low < 0.5 * drawn:  # only one flank: the motion goes forwards, so it drives
        side, loaded = np.ones(len(q)), turning
    return side, loaded, np.zeros(len(q))


def _touching(flanks: Flanks, q: FloatArray, keep: Mask, drive: Mask) -> Mask:
    """Say which samples are near one level for each flank: a place's own level would follow what flies past it."""
    has_torque = bool(np.any(flanks.design[keep, 1]))
    others = [c for c in range(1, flanks.design.shape[1]) if c != 1 or has_torque]
    design = np.concatenate([np.stack([drive, ~drive], axis=1).astype(np.float64), flanks.design[:, others]], axis=1)
    if np.sum(keep) < 4 * design.shape[1]:
        return keep
    x, near = _robust(design, q, keep, drive)
    left = np.abs(q - design @ x)
    limits = [max(PARTED_M, FAR * _spread(left[near & f])) for f in (drive, ~drive)]
    return left < np.where(drive, *limits)


def _spread(left: FloatArray) -> float:
    return 1.4826 * float(np.median(left)) if len(left) else 0.0


def _robust(design: FloatArray, q: FloatArray, keep: Mask, drive: Mask) -> tuple[FloatArray, Mask]:
    """Least squares without samples far off: blows, slipped counts.

    Far off is said by the scatter of a sample's own flank: the back flank knocks while the drive flank runs smoothly,
    and without noise all of it would lie far off.
    """
    wanted = keep
    size = np.sqrt(np.mean(design[keep] ** 2, axis=0)) + 1e-30
    scaled, least = design / size, 1e-12 * np.eye(design.shape[1])
    for _ in range(MAX_ROUNDS):
        a = scaled[keep]
        x: FloatArray = np.linalg.solve(a.T @ a / len(a) + least, a.T @ q[keep] / len(a)) / size
        left = np.abs(q - design @ x)
        limits = [FAR * (_spread(left[keep & f]) + 1e-12) for f in (drive, ~drive)]
        again = wanted & (left < np.where(drive, *limits))
        if np.array_equal(again, keep) or np.sum(again) < 4 * len(x):
            break
        keep = again
    return x, keep


def _by_tooth(flanks: Flanks, left: FloatArray, alone: Mask) -> FloatArray:
    """Median of what is left of each tooth of the driver, less that of the middling tooth."""
    teeth = np.full(flanks.motion.path.teeth[0], np.nan)
    for j in range(len(teeth)):
        here = alone & (flanks.tooth == j)
        if np.sum(here) >= LEAST_OF_A_TOOTH:
            teeth[j] = np.median(left[here])
    if np.any(np.isfinite(teeth)):
        teeth -= np.nanmedian(teeth)
    return teeth


def _nothing(m: PairMotion) -> ContactPart:
    nan = float("nan")
    return ContactPart(nan, nan, np.full(m.path.teeth[0], nan), np.full(4, nan), np.full(N_PLACES, nan), nan)


# --------------------
# What the driven gear's motion tells: inertia, friction of its bearings and of the flanks, a load off centre.
# --------------------


BANDWIDTH_HZ = 40.0
"""Of the equation: masses that swing behind the driven gear are stiff below it."""
TURNING = 0.15
"""Part of the ordinary speed from which on friction slides."""
UNIT_FRICTION = 0.05
FAR_LOAD, MAX_LOAD_ROUNDS = 5.0, 3


@dataclass(frozen=True)
class LoadEquation:
    """α2 = (r_b2 F (1 + μ G) − T sgn ω2 − c ω2 − U sin θ2 − V cos θ2)/J2, smoothed on both sides alike.

    Parameters
    ----------
    motion : PairMotion
    response : array, (n,)
        α2.
    columns : array, (n, 6)
        What 1/J2, μ/J2, T/J2, c/J2, U/J2, V/J2 multiply.
    turning : array of bool, (n,)
    flank_loss : array or None
        (τ − J1 α1)/r_b1 less the measured force, over it, per unit of μ; where a force was measured.
    """

    motion: PairMotion
    response: FloatArray
    columns: FloatArray
    turning: Mask
    flank_loss: tuple[FloatArray, FloatArray] | None


@dataclass(frozen=True)
class LoadPart:
    """What was found; nan where it cannot be told.

    Parameters
    ----------
    inertia_kg_m2 : float
    friction_nm : float
        Of the load at half the ordinary speed, sliding and viscous together.
    flank_friction : float
        μ.
    off_centre_nm : array, (2,)
        U and V.
    drive_nm : float
        Ordinary torque on the driven gear, for comparison.
    scatter_nm : float
        Root mean square of what is left over, as a torque.
    """

    inertia_kg_m2: float
    friction_nm: float
    flank_friction: float
    off_centre_nm: FloatArray
    drive_nm: float
    scatter_nm: float


def prepare_load(cycles: CycledMotion) -> LoadEquation | None:
    """Return the equation of the driven gear; None without torque."""
    m = cycles.motion
    if m.torque_nm is None:
        return None
    smoother = local_polynomial(m.sampling_rate_hz, min(BANDWIDTH_HZ, 0.1 * m.sampling_rate_hz))
    force = m.tooth_force_from_torque_n
    assert force is not None  # noqa: S101  there is a torque
    unit = replace(m, contact=replace(m.contact, friction_coefficient=UNIT_FRICTION))
    shares = [friction_share(unit, force, gear) for gear in (0, 1)]
    drive = m.path.base_radii_m[1] * force
    w, angle = m.driven_speed_rad_s, m.driven_angle_rad
    columns = (
        drive,
        drive * (shares[1] / shares[0] - 1.0) / UNIT_FRICTION,
        -np.tanh(w / (0.02 * float(np.quantile(np.abs(w), 0.95)) + 1e-12)),
        -w,
        -np.sin(angle),
        -np.cos(angle),
    )
    speed = np.abs(smoother.apply(w))
    slow = speed < TURNING * float(np.quantile(speed, 0.95))
    reach = smoother.window // 2
    near = np.convolve(slow, np.ones(2 * reach + 1), "same") > 0.5
    loss = None
    if m.force_n is not None:
        loss = (force - m.force_n, m.force_n * (shares[0] - 1.0) / UNIT_FRICTION)
    return LoadEquation(
        m,
        smoother.apply(m.driven_acceleration_rad_s2),
        np.stack([smoother.apply(column) for column in columns], axis=1),
        ~near,
        loss,
    )


def load_part(equation: LoadEquation | None, wanted: Mask) -> LoadPart:
    """Solve the equation on the samples wanted."""
    nan = float("nan")
    nothing = LoadPart(nan, nan, nan, np.full(2, nan), nan, nan)
    if equation is None:
        return nothing
    keep = wanted & equation.turning
    if np.sum(keep) < 100:
        return nothing
    m = equation.motion
    turned = float(np.ptp(m.driven_angle_rad)) / (2.0 * np.pi)
    used = [0, 1, 2, 3, 4, 5] if turned > FULL_TURN else [0, 1, 2, 3]
    x = _robust_load(equation.columns[:, used], equation.response, keep)
    if not x[0] > 0.0:
        return nothing
    inertia = 1.0 / x[0]
    half = 0.5 * float(np.quantile(np.abs(m.driven_speed_rad_s), 0.95))
    left = equation.response[keep] - equation.columns[keep][:, used] @ x
    drive = float(np.quantile(np.abs(equation.columns[keep, 0]), 0.9))
    off_centre = inertia * x[4:6] if len(used) > 4 else np.full(2, nan)
    return LoadPart(
        float(inertia),
        float(inertia * (x[2] + x[3] * half)),
        _flank_friction(equation, keep, float(inertia * x[1])),
        off_centre,
        drive,
        float(inertia * 1.4826 * np.median(np.abs(left))),
    )


def _flank_friction(equation: LoadEquation, keep: Mask, from_load: float) -> float:
    """μ from the measured force where there is one, which feels the driver's side alone; else from the load."""
    if equation.flank_loss is None:
        return from_load
    y, per_friction = (values[keep] for values in equation.flank_loss)
    near = np.abs(y - np.median(y)) < FAR_LOAD * (1.4826 * float(np.median(np.abs(y - np.median(y)))) + 1e-12)
    power = float(np.sum(per_friction[near] ** 2))
    return float(np.sum(y[near] * per_friction[near]) / power) if power > 0.0 else from_load


def _robust_load(columns: FloatArray, response: FloatArray, keep: Mask) -> FloatArray:
    scale = np.sqrt(np.mean(columns[keep] ** 2, axis=0)) + 1e-30
    wanted, least = keep, 1e-12 * np.eye(columns.shape[1])
    for _ in range(MAX_LOAD_ROUNDS):
        a = columns[keep] / scale
        x: FloatArray = np.linalg.solve(a.T @ a / len(a) + least, a.T @ response[keep] / len(a)) / scale
        left = np.abs(response - columns @ x)
        keep = wanted & (left < FAR_LOAD * (1.4826 * float(np.median(left[keep])) + 1e-12))
    return x


# --------------------
# What of the torque turns with the driver: amplitudes by order, over the mean torque.
# --------------------


LOWEST_ORDER, N_ORDERS = 4, 40
"""Below, a start and a stop look like a ripple."""
MIN_CYCLES_SAMPLES, FAR_RIPPLE = 50, 6.0
TREND_S = 0.25
"""Knots of the trend that is taken off each run."""


def orders_of(cycles: CycledMotion) -> NDArray[np.int64]:
    """Whole orders of the driver that are looked at: not those of the mesh and beside it."""
    z = cycles.motion.path.teeth[0]
    orders = np.arange(LOWEST_ORDER, LOWEST_ORDER + N_ORDERS)
    beside = np.abs((orders + z // 2) % z - z // 2)
    found: NDArray[np.int64] = orders[beside > 1]
    return found


def runs_of(cycles: CycledMotion) -> list[FloatArray]:
    """Return the driver's angle in each run that is long enough."""
    runs = cycles.phase == PHASES.index("run")
    found = [cycles.motion.driver_angle_rad[runs & (cycles.number == c)] for c in range(cycles.n_cycles)]
    return [angle for angle in found if len(angle) >= MIN_CYCLES_SAMPLES]


def ripple_part(cycles: CycledMotion, wanted: tuple[int, ...], orders: NDArray[np.int64]) -> FloatArray:
    """Return amplitude over mean torque at each order, (n,); nan without torque.

    A_n = |Σ w (τ − trend) e^{−i n θ1}|/(½ Σ w |τ|) over the runs of the cycles wanted, w a Hann window over each: the
    angle goes on from one cycle to the next, so that a ripple adds up and what a start excites does not.
    """
    m = cycles.motion
    nothing = np.full(len(orders), np.nan)
    if m.torque_nm is None:
        return nothing
    runs = cycles.phase == PHASES.index("run")
    total, level = np.zeros(len(orders), dtype=np.complex128), 0.0
    for c in wanted:
        rows = np.flatnonzero(runs & (cycles.number == c))
        if len(rows) < MIN_CYCLES_SAMPLES:
            continue
        torque, window = m.torque_nm[rows], np.hanning(len(rows))
        ripple = torque - _trend(torque, window, m.sampling_rate_hz)
        limit = FAR_RIPPLE * 1.4826 * float(np.median(np.abs(ripple)))
        ripple = window * np.clip(ripple, -limit, limit)
        total += np.exp(-1j * orders[:, None] * m.driver_angle_rad[rows]) @ ripple
        level += 0.5 * float(np.sum(window * np.abs(torque)))
    return np.abs(total) / level if level > 0.0 else nothing


def _trend(torque: FloatArray, window: FloatArray, rate_hz: float) -> FloatArray:
    """Return a least-squares polynomial, a degree more for each quarter of a second, 3 to 6."""
    from numpy.polynomial import Legendre

    x = np.linspace(-1.0, 1.0, len(torque))
    degree = int(np.clip(len(torque) / rate_hz / TREND_S, 3, 6))
    found: FloatArray = Legendre.fit(x, torque, degree, w=np.sqrt(window))(x)
    return found


NAMES = (
    "play",
    "deflection",
    "curve",
    "inertia",
    "load_friction",
    "flank_friction",
    "tooth",
    "next_tooth",
    "ripple",
    "next_ripple",
    "driver_wave",
    "driven_wave",
    "off_centre",
    "impact",
    "contact_scatter",
    "load_scatter",
)
"""Of the changes, see `change_of`."""

CURVE_PART, WAVE_PART = 0.1, 0.2
"""Of the deflection under the ordinary load: curve and waves of healthy gears differ by that."""
TOOTH_PART = 0.01
"""Of it: teeth differ by that at least; by how much they do is read off the recording, see `spot_of`."""
RIPPLE_PART, OFF_CENTRE_PART, FRICTION_STEP = 0.01, 0.03, 0.02
"""Of the mean torque; of the ordinary drive; of the coefficient: below it nothing is told from nothing."""
FEW_WAVES = 6.0
"""Of an order in one run: fewer, and the course of a start and a stop passes for a ripple."""
ORDINARY_DEFLECTION_UM = 20.0
BESIDE = 2
"""Orders on either side into which a ripple leaks: a run is short."""
MIN_SCATTER_UM, MIN_SCATTER_PART = 0.5, 0.01


@dataclass(frozen=True)
class CycleFeatures:
    """What the equations of motion give for some cycles.

    Parameters
    ----------
    contact : ContactPart
    load : LoadPart
    ripple : array, (n_orders,)
        Amplitude over mean torque.
    impact_mps : float
        Median over the cycles of the hardest impact; nan where none can be seen.
    ripple_waves : array, (n_orders,)
        How many waves of each order an ordinary run holds.
    """

    contact: ContactPart
    load: LoadPart
    ripple: FloatArray
    impact_mps: float
    ripple_waves: FloatArray


@dataclass(frozen=True)
class LocatedDriveChange:
    """Where a change was found, and what teeth and orders differ by ordinarily.

    Parameters
    ----------
    tooth : int
        Of the driver, from 0.
    order : int
        Place among the orders of the ripple.
    tooth_step_um : float
        Scatter of the changes of all teeth.
    ripple_step : array, (n_orders,)
        Part of the mean torque that a run's own course may put there.
    next_tooth_um : float
        Change of the tooth that changed next most: a cracked one must yield more to be seen.
    """

    tooth: int
    order: int
    tooth_step_um: float
    ripple_step: FloatArray
    next_tooth_um: float


@dataclass(frozen=True)
class PreparedCycles:
    """A recording with all that is prepared once."""

    cycles: CycledMotion

    @cached_property
    def flanks(self) -> Flanks:
        """Samples that tell where the flanks are."""
        return prepare_flanks(self.cycles)

    @cached_property
    def equation(self) -> LoadEquation | None:
        """Of the driven gear."""
        return prepare_load(self.cycles)

    @cached_property
    def orders(self) -> NDArray[np.int64]:
        """Of the ripple."""
        return orders_of(self.cycles)

    @cached_property
    def impacts(self) -> tuple[Impact, ...]:
        """Flanks that met; none where they cannot be seen."""
        m = self.cycles.motion
        whole = contact_part(self.flanks, np.ones(len(m.driver_angle_rad), dtype=bool))
        if not np.isfinite(whole.play_um):
            return ()
        try:
            return find_impacts(m, whole.zero_m, half_backlash_m=0.5e-6 * whole.play_um)
        except RefusalError:
            return ()

    @property
    def every(self) -> tuple[int, ...]:
        """Numbers of all cycles."""
        return tuple(range(self.cycles.n_cycles))

    @cached_property
    def _by_cycles(self) -> dict[tuple[int, ...], CycleFeatures]:
        """By cycles: halves and blocks are asked for again and again."""
        return {}

    def features(self, wanted: tuple[int, ...]) -> CycleFeatures:
        """Return what some cycles tell."""
        if wanted not in self._by_cycles:
            self._by_cycles[wanted] = self._computed(wanted)
        return self._by_cycles[wanted]

    def _computed(self, wanted: tuple[int, ...]) -> CycleFeatures:
        rows = self.cycles.samples_of(wanted)
        return CycleFeatures(
            contact_part(self.flanks, rows),
            load_part(self.equation, rows),
            ripple_part(self.cycles, wanted, self.orders),
            self._hardest(wanted),
            self.orders * self._revolutions_of_a_run,
        )

    @cached_property
    def _revolutions_of_a_run(self) -> float:
        """Median over the runs."""
        turned = [float(np.ptp(angle)) / (2.0 * np.pi) for angle in runs_of(self.cycles)]
        return float(np.median(turned)) if turned else 0.0

    def _hardest(self, wanted: tuple[int, ...]) -> float:
        rate = self.cycles.motion.sampling_rate_hz
        last = len(self.cycles.number) - 1
        by_cycle: dict[int, float] = {}
        for impact in self.impacts:
            cycle = int(self.cycles.number[min(round(impact.time_s * rate), last)])
            by_cycle[cycle] = max(by_cycle.get(cycle, 0.0), impact.speed_mps)
        found = [speed for cycle, speed in by_cycle.items() if cycle in wanted]
        return float(np.median(found)) if found else float("nan")


def spot_of(now: CycleFeatures, other: CycleFeatures) -> LocatedDriveChange:
    """Return the tooth and the order that changed most over what the others did.

    Teeth: the scatter of their changes, 1.4826 of the median deviation, so that a tooth is judged by the other teeth
    and not by what another make differs by. Orders: f (1 + (w₀/w)³), w the waves of an order in one run: the trend of a
    run of one revolution cannot be told from an order of four.
    """
    teeth, ripple = now.contact.teeth_um - other.contact.teeth_um, now.ripple - other.ripple
    known = teeth[np.isfinite(teeth)]
    scatter = 1.4826 * float(np.median(np.abs(known - np.median(known)))) if len(known) else 0.0
    tooth_step = float(np.hypot(scatter, TOOTH_PART * _deflection(now, other)))
    waves = np.maximum(np.minimum(now.ripple_waves, other.ripple_waves), 1e-3)
    steps = RIPPLE_PART * (1.0 + (FEW_WAVES / waves) ** 3)
    tooth = _largest(teeth)
    return LocatedDriveChange(
        tooth, _largest(ripple / steps), tooth_step, steps, max(float(np.nan_to_num(_but(teeth, tooth))), 0.0)
    )


def change_of(
    now: CycleFeatures, other: CycleFeatures, curve_shape: FloatArray, at: LocatedDriveChange | None = None
) -> FloatArray:
    """Return how far what is told changed, (n,) by `NAMES`; nan where it cannot be told.

    Levels (play, deflection, inertia, friction of the load, impact, scatter) in dB. What is ordinarily near zero and
    may have a sign is given as 20 lg e · asinh(x/2f), f what healthy machines differ by: for large x in dB over it.
    Tooth and ripple are given over the next largest, f as `spot_of` says.

    Parameters
    ----------
    now, other : CycleFeatures
        Of two machines, or one machine at two times; or measured and simulated.
    curve_shape : array
        Course of the compression over the mesh cycle that worn flanks give; its mean is 0.
    at : Spot or None
        Tooth and order to look at, and their steps. None: those that changed most.
    """
    c, d = now.contact, other.contact
    a, b = now.load, other.load
    spot = at or spot_of(now, other)
    teeth = (c.teeth_um - d.teeth_um) / spot.tooth_step_um
    ripple = (now.ripple - other.ripple) / spot.ripple_step
    deflection, drive = _deflection(now, other), b.drive_nm
    values = (
        _level(c.play_um, d.play_um),
        _level(c.deflection_um, d.deflection_um),
        _signed(_projected(c.curve_um - d.curve_um, curve_shape), CURVE_PART * deflection),
        _level(a.inertia_kg_m2, b.inertia_kg_m2),
        _level(a.friction_nm, b.friction_nm),
        _signed(a.flank_friction - b.flank_friction, FRICTION_STEP),
        _signed(_at(teeth, spot.tooth), 1.0) - _signed(_but(teeth, spot.tooth), 1.0),
        _signed(_but(teeth, spot.tooth), 1.0),
        _signed(_at(ripple, spot.order), 1.0) - _signed(_but(ripple, spot.order, BESIDE), 1.0),
        _signed(_but(ripple, spot.order, BESIDE), 1.0),
        _signed(_size(c.waves_um[:2] - d.waves_um[:2]), WAVE_PART * deflection),
        _signed(_size(c.waves_um[2:] - d.waves_um[2:]), WAVE_PART * deflection),
        _signed(_size(a.off_centre_nm - b.off_centre_nm), OFF_CENTRE_PART * drive),
        _level(now.impact_mps, other.impact_mps),
        _level(np.hypot(c.scatter_um, MIN_SCATTER_UM), np.hypot(d.scatter_um, MIN_SCATTER_UM)),
        _level(np.hypot(a.scatter_nm, MIN_SCATTER_PART * drive), np.hypot(b.scatter_nm, MIN_SCATTER_PART * drive)),
    )
    return np.array(values, dtype=np.float64)


def _deflection(now: CycleFeatures, other: CycleFeatures) -> float:
    """Return what a pair of teeth yields under the ordinary load; an ordinary value where no torque tells it."""
    known = (one.contact.deflection_um for one in (other, now) if np.isfinite(one.contact.deflection_um))
    return float(next(known, ORDINARY_DEFLECTION_UM))


def _level(now: float, other: float) -> float:
    return 20.0 * float(np.log10(now / other)) if now > 0.0 and other > 0.0 else float("nan")


def _signed(value: float, step: float) -> float:
    """Return 20 lg e · asinh(x/2f)."""
    return float(20.0 / np.log(10.0) * np.arcsinh(value / (2.0 * step))) if step > 0.0 else float("nan")


def _projected(curve: FloatArray, shape: FloatArray) -> float:
    """Return how far a curve runs along a shape of the same length, as the span between its ends."""
    known = np.isfinite(curve)
    if np.sum(known) < len(curve) // 2:
        return float("nan")
    s = shape[known] - np.mean(shape[known])
    c = curve[known] - np.mean(curve[known])
    return float(np.ptp(shape) * np.sum(s * c) / np.sum(s * s))


def _largest(values: FloatArray) -> int:
    return int(np.nanargmax(values)) if np.any(np.isfinite(values)) else 0


def _at(values: FloatArray, place: int) -> float:
    return float(values[place]) if len(values) else float("nan")


def _but(values: FloatArray, place: int, beside: int = 0) -> float:
    """Return the largest of the others, those beside it left out."""
    rest = np.delete(values, np.arange(max(place - beside, 0), min(place + beside + 1, len(values))))
    return float(np.nanmax(rest)) if np.any(np.isfinite(rest)) else float("nan")


def _size(vector: FloatArray) -> float:
    return float(np.hypot(*vector))


# --------------------
# How far motion and torque are from what known play, inertia and friction predict: by phase of motion and by flank.
# --------------------


MIN_SAMPLES_OF_A_PHASE = 20
COMPRESSION, TORQUE = "compression", "torque"
UNITS = {COMPRESSION: "µm", TORQUE: "N·m"}
MEDIAN_OF_SQUARES = 0.455
"""Of a normal variable of variance 1: single blows do not decide."""


def prediction_errors(examined: PreparedCycles, known: CycleFeatures) -> dict[tuple[str, str, str], float]:
    """Return the root mean square error of prediction by quantity, phase and flank.

    Compression: q − q₀ − s(a + κ(|F|/n)^{1/λ}), a and κ those known, q₀ so that the drive flank lies right on average.
    Keys are "compression" (µm along the line of action) or "torque" (of the driver's shaft, N m); a phase of
    `gearsig.gap.start_stop.PHASES`; "drive", "back" or, for either, nothing.

    Torque: τ − J1 α1 − (r_b1/r_b2)(J2 α2 + T sgn ω2)/(1 + μ G) within 40 Hz, while the load turns.

    Parameters
    ----------
    examined : Examined
        Whose motion is predicted.
    known : CycleFeatures
        Of the healthy machine, or of its simulation.
    """
    found = _compressions(examined, examined.flanks, known)
    if examined.equation is not None:
        found |= _torques(examined, examined.equation, known)
    return found


def _compressions(examined: PreparedCycles, flanks: Flanks, known: CycleFeatures) -> dict[tuple[str, str, str], float]:
    play = known.contact.play_um
    if not np.isfinite(play):
        return {}
    q, side, elastic = 1e6 * flanks.motion.compression_m, flanks.design[:, 0], flanks.design[:, 1]
    ordinary = float(np.median(np.abs(elastic[flanks.alone]))) if np.any(flanks.alone) else 0.0
    per_load = known.contact.deflection_um / ordinary if ordinary > 0.0 else 0.0
    left = q - side * 0.5 * play - np.nan_to_num(per_load) * elastic
    drive = flanks.loaded & (side > 0.0)
    if np.sum(drive) < MIN_SAMPLES_OF_A_PHASE:
        return {}
    left = left - float(np.median(left[drive]))
    rows = {"drive": drive, "back": flanks.loaded & (side < 0.0)}
    return _by_phase(examined, COMPRESSION, left, rows)


def _torques(
    examined: PreparedCycles, equation: LoadEquation, known: CycleFeatures
) -> dict[tuple[str, str, str], float]:
    load = known.load
    if not np.isfinite(load.inertia_kg_m2):
        return {}
    r1, r2 = equation.motion.path.base_radii_m
    drive, per_friction, against = (equation.columns[:, i] for i in (0, 1, 2))
    needed = load.inertia_kg_m2 * equation.response - load.friction_nm * against
    left = (drive + load.flank_friction * per_friction - needed) * r1 / r2
    return _by_phase(examined, TORQUE, left, {"": equation.turning})


def _by_phase(
    examined: PreparedCycles, quantity: str, left: FloatArray, rows: dict[str, np.ndarray]
) -> dict[tuple[str, str, str], float]:
    found = {}
    for flank, wanted in rows.items():
        for number, phase in enumerate(PHASES):
            here = wanted & (examined.cycles.phase == number) & (examined.cycles.number >= 0)
            if np.sum(here) >= MIN_SAMPLES_OF_A_PHASE:
                found[quantity, phase, flank] = _root_mean_square(left[here])
    return found


def _root_mean_square(left: FloatArray) -> float:
    """Return it of an offset and a normal scatter about it, both by medians."""
    offset = float(np.median(left))
    return float(np.sqrt(offset**2 + np.median((left - offset) ** 2) / MEDIAN_OF_SQUARES))
