"""Features of start–stop cycles from their equations of motion, and their changes between machines."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.polynomial import Legendre
from numpy.typing import NDArray

from gearsig import motion as motions
from gearsig.checks import FloatArray
from gearsig.errors import RefusalError
from gearsig.gap._report import PlaceKind

Mask = NDArray[np.bool_]
NAN = float("nan")
PHASES = ("start", "run", "stop", "rest")
N_PLACES = 20
"""Number of parts of the mesh cycle."""
FULL_TURN = 0.7
"""Revolutions from which a wave of one cycle per revolution can be distinguished from a straight line."""
MIN_RUN_SAMPLES = 50


@dataclass(frozen=True)
class CycleFeatures:
    """Quantities from the equations of motion over some cycles; nan where they cannot be determined.

    Parameters
    ----------
    play_um, deflection_um : float
        Along the line of action: play without load; deflection of one pair under the ordinary load.
    teeth_um : array, (n_teeth,)
        Additional rotation that each tooth of the driver allows compared with the median one, while it carries the load
        alone.
    waves_um : array, (4,)
        Cosine and sine of the driver's revolution, then of the driven gear's.
    curve_um : array, (N_PLACES,)
        Profile of the compression over the mesh cycle on the drive flank, with its mean removed.
    contact_scatter_um : float
        RMS of the residual of the flanks' equation.
    zero_m : float
        Compression in the middle of the play.
    ripple : array, (n_orders,)
        Amplitude relative to the mean torque.
    ripple_waves : array, (n_orders,)
        Number of waves of each order in an ordinary run.
    inertia_kg_m2 : float
        Of the load.
    friction_nm : float
        Of the load at half the ordinary speed, sliding and viscous friction together.
    flank_friction : float
        Coefficient μ.
    off_centre_nm : array, (2,)
        Load torque by sine and cosine of the driven gear's angle.
    drive_nm : float
        Ordinary torque on the driven gear, for comparison.
    load_scatter_nm : float
        Size of the residual of the load's equation, as a torque.
    impact_mps : float
        Speed of the hardest impact of a cycle, median over the cycles.
    """

    teeth_um: FloatArray
    waves_um: FloatArray
    curve_um: FloatArray
    ripple: FloatArray
    ripple_waves: FloatArray
    off_centre_nm: FloatArray
    play_um: float = NAN
    deflection_um: float = NAN
    contact_scatter_um: float = NAN
    zero_m: float = NAN
    inertia_kg_m2: float = NAN
    friction_nm: float = NAN
    flank_friction: float = NAN
    drive_nm: float = NAN
    load_scatter_nm: float = NAN
    impact_mps: float = NAN


@dataclass(frozen=True)
class PreparedCycles:
    """A start–stop motion cut into cycles, with all derived data computed once, on demand.

    Parameters
    ----------
    motion : PairMotion
    segments : MotionSegments
        Of the driver.
    number : array of int, (n,)
        Cycle of each sample, from 0; −1 before the first start.
    phase : array of int, (n,)
        Index in `PHASES`.
    """

    motion: motions.PairMotion
    segments: motions.MotionSegments
    number: NDArray[np.int64]
    phase: NDArray[np.int64]

    @property
    def n_cycles(self) -> int:
        """Number of starts, each with what follows up to the next."""
        return int(self.number.max()) + 1

    @property
    def every(self) -> tuple[int, ...]:
        """Numbers of all cycles."""
        return tuple(range(self.n_cycles))

    @property
    def halves(self) -> tuple[tuple[int, ...], tuple[int, ...]]:
        """Every second cycle, and the others, so that drift is in both."""
        return self.every[::2], self.every[1::2]

    @cached_property
    def flanks(self) -> Flanks:
        """Samples from which the position of the flanks follows."""
        return prepare_flanks(self.motion)

    @cached_property
    def equation(self) -> LoadEquation | None:
        """Equation of the driven gear; None without torque."""
        return prepare_load(self.motion)

    @cached_property
    def orders(self) -> NDArray[np.int64]:
        """Whole orders of the driver that are evaluated, without those of the mesh and adjacent ones.

        Below the fourth order, a start and a stop look like a ripple.
        """
        z, orders = self.motion.path.teeth[0], np.arange(4, 44)
        return orders[np.abs((orders + z // 2) % z - z // 2) > 1]

    @cached_property
    def runs(self) -> dict[int, NDArray[np.intp]]:
        """Cycle → samples of its run, where it is long enough."""
        is_run = self.phase == PHASES.index("run")
        rows = {c: np.flatnonzero(is_run & (self.number == c)) for c in self.every}
        return {c: row for c, row in rows.items() if len(row) >= MIN_RUN_SAMPLES}

    @cached_property
    def _impacts(self) -> tuple[motions.Impact, ...]:
        """Impacts between flanks; empty where they cannot be detected."""
        whole = contact_features(self.motion, self.flanks, np.ones(len(self.number), dtype=bool))
        play_um = float(whole.get("play_um", NAN))
        if not np.isfinite(play_um):
            return ()
        try:
            return motions.find_impacts(self.motion, whole["zero_m"], half_backlash_m=0.5e-6 * play_um)
        except RefusalError:
            return ()

    @cached_property
    def _by_cycles(self) -> dict[tuple[int, ...], CycleFeatures]:
        return {}

    def features(self, cycles: tuple[int, ...] | None = None) -> CycleFeatures:
        """Return the features of some cycles, or of all; cached, as halves and blocks are used repeatedly."""
        cycles = self.every if cycles is None else cycles
        if cycles not in self._by_cycles:
            self._by_cycles[cycles] = self._computed(cycles)
        return self._by_cycles[cycles]

    def _computed(self, cycles: tuple[int, ...]) -> CycleFeatures:
        rows = np.isin(self.number, cycles)
        turned = [float(np.ptp(self.motion.driver_angle_rad[run])) / (2.0 * np.pi) for run in self.runs.values()]
        nothing = {
            "teeth_um": np.full(self.motion.path.teeth[0], NAN),
            "waves_um": np.full(4, NAN),
            "curve_um": np.full(N_PLACES, NAN),
            "off_centre_nm": np.full(2, NAN),
        }
        return CycleFeatures(
            **nothing
            | contact_features(self.motion, self.flanks, rows)
            | load_features(self.motion, self.equation, rows),
            ripple=self._ripple(cycles),
            ripple_waves=self.orders * (float(np.median(turned)) if turned else 0.0),
            impact_mps=self._max_impact_mps(cycles),
        )

    def _ripple(self, cycles: tuple[int, ...]) -> FloatArray:
        """Return amplitude over mean torque at each order, (n,); nan without torque.

        A_n = |Σ w (τ − trend) e^{−i n θ1}|/(½ Σ w |τ|) over the runs of the cycles, w a Hann window over each run. The
        angle continues from one cycle to the next, so a ripple adds up and oscillations excited by a start do not. The
        trend is a least-squares polynomial with one degree per quarter of a second, limited to 3 … 6.
        """
        m, nothing = self.motion, np.full(len(self.orders), NAN)
        if m.torque_nm is None:
            return nothing
        total, level = np.zeros(len(self.orders), dtype=np.complex128), 0.0
        for rows in (self.runs[c] for c in cycles if c in self.runs):
            torque, window, x = m.torque_nm[rows], np.hanning(len(rows)), np.linspace(-1.0, 1.0, len(rows))
            degree = int(np.clip(len(rows) / m.sampling_rate_hz / 0.25, 3, 6))
            ripple = torque - Legendre.fit(x, torque, degree, w=np.sqrt(window))(x)
            limit = 6.0 * motions.median_deviation(ripple)  # limits the weight of impacts
            total += np.exp(-1j * self.orders[:, None] * m.driver_angle_rad[rows]) @ (
                window * np.clip(ripple, -limit, limit)
            )
            level += 0.5 * float(np.sum(window * np.abs(torque)))
        return np.abs(total) / level if level > 0.0 else nothing

    def _max_impact_mps(self, cycles: tuple[int, ...]) -> float:
        hardest: dict[int, float] = {}
        for impact in self._impacts:
            at = min(round(impact.time_s * self.motion.sampling_rate_hz), len(self.number) - 1)
            cycle = int(self.number[at])
            hardest[cycle] = max(hardest.get(cycle, 0.0), impact.speed_mps)
        speeds = [speed for cycle, speed in hardest.items() if cycle in cycles]
        return float(np.median(speeds)) if speeds else NAN


def cut_cycles(motion: motions.PairMotion) -> PreparedCycles:
    """Cut a motion into cycles: start, run, stop, rest.

    The start phase includes 0.15 s of ringing, the stop phase 0.1 s; the fits do not depend on these times.

    Raises
    ------
    RefusalError
        If it has no starts and stops, or so few that nothing would be left to check a fit on.
    """
    motion = thin(motion)
    rate, where = motion.sampling_rate_hz, motion.source or "the recording"
    segments = motions.motion_segments(motion.driver_angle_rad, rate)
    if not motions.is_start_stop(segments) and segments.standing_part < 0.05:
        raise RefusalError(
            f"{where} turns all the time: it has none of the starts and stops that the start–stop diagnosis needs",
            remedy="record starts and stops; compare stationary running with --model cracked or reduced-fe",
        )
    n = len(segments.moving)
    if n < 2:
        raise RefusalError(
            f"{where} has {n} start{'' if n == 1 else 's'}: what is fitted to one cycle must be checked on another",
            remedy="record several starts and stops; preferably six or more",
        )
    number = np.full(len(motion.driver_angle_rad), -1, dtype=np.int64)
    phase = np.full(len(number), PHASES.index("rest"), dtype=np.int64)
    for i, segment in enumerate(segments.moving):
        first, last = segment.first, segment.last
        # The driver only slows down after the last sample at 90 % of the top speed.
        speed = np.abs(motion.driver_speed_rad_s[first:last])
        fast = np.flatnonzero(speed > 0.9 * np.quantile(speed, 0.98))
        stop = first + int(fast[-1]) + 1 if len(fast) else last
        number[first:] = i
        phase[first:stop] = PHASES.index("run")
        phase[first : min(first + round(0.15 * rate), last, stop)] = PHASES.index("start")
        phase[stop : last + round(0.1 * rate)] = PHASES.index("stop")
    return PreparedCycles(motion, segments, number, phase)


def thin(motion: motions.PairMotion) -> motions.PairMotion:
    """Return every n-th sample, without averaging, of a motion sampled faster than 2 kHz.

    The motion of shafts is slower, and vibration is not evaluated here.
    """
    step = max(1, int(motion.sampling_rate_hz / 2000.0 + 1e-9))
    values = {field.name: getattr(motion, field.name) for field in fields(motion)}
    arrays: dict[str, Any] = {name: value[::step] for name, value in values.items() if isinstance(value, np.ndarray)}
    return replace(motion, sampling_rate_hz=motion.sampling_rate_hz / step, **arrays) if step > 1 else motion


def robust_least_squares(
    design: FloatArray, y: FloatArray, usable: Mask, groups: tuple[Mask, ...] = (), *, far: float = 4.0, rounds: int = 4
) -> tuple[FloatArray, Mask]:
    """Solve y = A x by least squares without outliers, such as impacts and slipped counts.

    Outliers are judged by the scatter of a sample's own group: the back flank impacts while the drive flank runs
    smoothly, and against the latter's scatter all of its samples would be outliers.

    Parameters
    ----------
    design : array, (n, k)
    y : array, (n,)
    usable : array of bool, (n,)
    groups : tuple of array of bool, (n,)
        Groups of samples with similar scatter; empty: a single group.
    far : float
        Standard deviations, from the median deviation, beyond which a sample is an outlier.
    rounds : int

    Returns
    -------
    (array (k,), array of bool (n,))
        The solution, and the samples used for it.
    """
    keep, groups = usable, groups or (np.ones(len(y), dtype=bool),)
    size = np.sqrt(np.mean(design[keep] ** 2, axis=0)) + 1e-30
    scaled, ridge = design / size, 1e-12 * np.eye(design.shape[1])
    for _ in range(rounds):
        a = scaled[keep]
        x: FloatArray = np.linalg.solve(a.T @ a / len(a) + ridge, a.T @ y[keep] / len(a)) / size
        residual = np.abs(y - design @ x)
        near = [group & (residual < far * (_spread(residual[keep & group]) + 1e-12)) for group in groups]
        again = usable & np.logical_or.reduce(near)
        if np.array_equal(again, keep) or np.sum(again) < 4 * len(x):
            break
        keep = again
    return x, keep


def _spread(residual: FloatArray) -> float:
    return motions.median_deviation(residual) if len(residual) else 0.0


# --------------------
# From the loaded flanks: play, deflection, single teeth, the shape of worn flanks, run-out.
# --------------------

PARTED_M = 5e-5
"""Samples further than this from a common level for all places are in the play: the flanks have just separated. Worn
flanks differ by less from place to place, as the least worn pair determines the position."""


class Flanks(NamedTuple):
    """Samples from which the position of the flanks follows.

    Parameters
    ----------
    design : array, (n, k)
        Columns: side, deflection (0 without torque), and waves of the shafts.
    loaded, alone : array of bool, (n,)
        Whether one of the flanks carries load; whether a single pair carries it on the drive flank.
    place : array of int, (n,)
        Position of a sample within the mesh cycle, 0 to `N_PLACES` − 1.
    tooth : array of int, (n,)
        Tooth of the driver, from 0.
    """

    design: FloatArray
    loaded: Mask
    alone: Mask
    place: NDArray[np.int64]
    tooth: NDArray[np.int64]


def prepare_flanks(m: motions.PairMotion) -> Flanks:
    """Find the samples with loaded flanks by the torque, or by the compression where there is no torque."""
    path, force, speed = m.path, m.tooth_force_from_torque_n, np.abs(m.driver_speed_rad_s)
    turning = speed > 0.05 * float(np.quantile(speed, 0.95))
    if force is not None:  # from a tenth of the ordinary load; deflection (|F|/n)^{1/λ}
        loaded = np.abs(force) > 0.1 * float(np.quantile(np.abs(force), 0.95))
        side = np.where(force < 0.0, -1.0, 1.0)
        n_pairs = path.n_pairs(m.driver_angle_rad, side)
        elastic = side * (np.abs(force) / n_pairs) ** (1.0 / m.contact.exponent)
    else:  # loaded where the compression is near the ends of its range
        q = m.compression_m
        low, high = np.quantile(q[turning], [0.01, 0.99])
        side = np.where(q > 0.5 * (low + high), 1.0, -1.0)
        loaded = turning & (np.minimum(high - q, q - low) < 0.25 * (high - low))
        if high - low < 1e-6 * m.contact.half_backlash_um:  # one flank only: the drive flank, as motion is forwards
            side, loaded = np.ones(len(q)), turning
        elastic = np.zeros(len(q))
    # Base pitches around the entry and exit of pairs are excluded.
    u, edge = path.position(m.driver_angle_rad, side), 0.07
    clear = (u > edge) & (u < 1.0 - edge) & (np.abs(u - (path.contact_ratio - 1.0)) > edge)
    columns = [side, elastic, np.cos(m.driver_angle_rad), np.sin(m.driver_angle_rad)]
    if _turned(m) > FULL_TURN:
        columns += [np.cos(m.driven_angle_rad), np.sin(m.driven_angle_rad)]
    return Flanks(
        np.stack(columns, axis=1),
        loaded & clear,
        loaded & clear & (side > 0.0) & (u > path.contact_ratio - 1.0) & turning,
        np.clip((u * N_PLACES).astype(np.int64), 0, N_PLACES - 1),
        (path.tooth(m.driver_angle_rad) - 1.0).astype(np.int64),
    )


def _turned(m: motions.PairMotion) -> float:
    """Return the revolutions of the driven gear."""
    return float(np.ptp(m.driven_angle_rad)) / (2.0 * np.pi)


def contact_features(m: motions.PairMotion, flanks: Flanks, rows: Mask) -> dict[str, Any]:
    """Fit q = b on the back flank, d_p at place p of the mesh cycle on the drive flank, deflection and waves to both.

    q = b [s < 0] + Σ_p d_p [s > 0, p] + s κ (|F|/n)^{1/λ} + waves; the residual is sorted by tooth. Play is d̄ − b.
    With a level for each place, the deflection follows only from changes of load there, and the levels show the shape
    of worn flanks.

    Returns
    -------
    dict
        Fields of `CycleFeatures`; empty where too few places of the mesh cycle carry load.
    """
    q, drive, keep = m.compression_m, flanks.design[:, 0] > 0.0, flanks.loaded & rows
    keep = keep & _touching(flanks, q, keep, drive)
    back = keep & ~drive
    known_columns, has_back = _known_columns(flanks, keep), np.sum(back) >= 12
    counts = np.bincount(flanks.place[keep & drive], minlength=N_PLACES)
    places = np.flatnonzero(counts >= 5)
    if len(places) < N_PLACES // 3:
        return {}
    known = np.isin(flanks.place, places)
    keep = keep & ((drive & known) | (~drive & has_back))
    levels = (drive[:, None] & (flanks.place[:, None] == places)).astype(np.float64)
    columns = [levels, flanks.design[:, known_columns]] + ([(~drive)[:, None].astype(np.float64)] if has_back else [])
    design = np.concatenate(columns, axis=1)
    x, keep = robust_least_squares(design, q, keep, (drive, ~drive))
    residual = q - design @ x
    of = dict(zip(known_columns, x[len(places) : len(places) + len(known_columns)], strict=True))
    # The level of a place whose samples were all outliers has no basis.
    rests = np.bincount(flanks.place[keep & drive], minlength=N_PLACES)[places] > 0
    at_places = np.where(rests, x[: len(places)], NAN)
    middle = float(np.nanmean(at_places))
    play = middle - float(x[-1]) if has_back else NAN
    curve = np.full(N_PLACES, NAN)
    curve[places] = at_places - middle
    alone = flanks.alone & known & rows & (np.abs(residual) < PARTED_M)
    ordinary = float(np.median(np.abs(flanks.design[alone, 1]))) if np.any(alone) else NAN
    deflection = 1e6 * of.get(1, NAN) * ordinary
    teeth = np.full(m.path.teeth[0], NAN)
    for j in range(len(teeth)):
        of_tooth = alone & (flanks.tooth == j)
        if np.sum(of_tooth) >= 3:
            teeth[j] = np.median(residual[of_tooth])
    return {
        "play_um": 1e6 * play if play > 0.0 else NAN,
        "deflection_um": deflection if deflection > 0.0 else NAN,
        "teeth_um": 1e6 * (teeth - np.nanmedian(teeth) if np.any(np.isfinite(teeth)) else teeth),
        "waves_um": 1e6 * np.array([of.get(c, NAN) for c in (2, 3, 4, 5)]),
        "curve_um": 1e6 * curve,
        "contact_scatter_um": 1e6 * float(np.sqrt(np.mean(residual[keep] ** 2))),
        "zero_m": middle - 0.5 * play if has_back else NAN,
    }


def _known_columns(flanks: Flanks, keep: Mask) -> list[int]:
    """Return the columns of the design other than the side; the deflection only where there is a torque."""
    has_torque = bool(np.any(flanks.design[keep, 1]))
    return [c for c in range(1, flanks.design.shape[1]) if c != 1 or has_torque]


def _touching(flanks: Flanks, q: FloatArray, keep: Mask, drive: Mask) -> Mask:
    """Return which samples are near a common level of each flank; separate levels for places would follow outliers."""
    sides = np.stack([drive, ~drive], axis=1).astype(np.float64)
    design = np.concatenate([sides, flanks.design[:, _known_columns(flanks, keep)]], axis=1)
    if np.sum(keep) < 4 * design.shape[1]:
        return keep
    x, near = robust_least_squares(design, q, keep, (drive, ~drive))
    residual = np.abs(q - design @ x)
    limits = [max(PARTED_M, 4.0 * _spread(residual[near & flank])) for flank in (drive, ~drive)]
    return residual < np.where(drive, *limits)


# --------------------
# From the driven gear's motion: inertia, friction of its bearings and of the flanks, an eccentric load.
# --------------------


class LoadEquation(NamedTuple):
    """α2 = (r_b2 F (1 + μ G) − T sgn ω2 − c ω2 − U sin θ2 − V cos θ2)/J2, with the same smoothing on both sides.

    Parameters
    ----------
    response : array, (n,)
        α2.
    columns : array, (n, 6)
        Factors of 1/J2, μ/J2, T/J2, c/J2, U/J2, V/J2.
    turning : array of bool, (n,)
        Samples with sliding friction: from 15 % of the ordinary speed on.
    flank_loss : array or None
        (τ − J1 α1)/r_b1 less the measured force, and its derivative by μ; None where no force was measured.
    """

    response: FloatArray
    columns: FloatArray
    turning: Mask
    flank_loss: tuple[FloatArray, FloatArray] | None


def prepare_load(m: motions.PairMotion) -> LoadEquation | None:
    """Return the equation of the driven gear; None without torque."""
    force = m.tooth_force_from_torque_n
    if force is None:
        return None
    # Below 40 Hz, masses that are coupled elastically to the driven gear move with it.
    smoother = motions.local_polynomial(m.sampling_rate_hz, min(40.0, 0.1 * m.sampling_rate_hz))
    mu = 0.05
    rubbing = replace(m, contact=replace(m.contact, friction_coefficient=mu))
    shares = [motions.friction_share(rubbing, force, gear) for gear in (0, 1)]
    drive = m.path.base_radii_m[1] * force
    w, angle = m.driven_speed_rad_s, m.driven_angle_rad
    columns = (
        drive,
        drive * (shares[1] / shares[0] - 1.0) / mu,
        -np.tanh(w / (0.02 * float(np.quantile(np.abs(w), 0.95)) + 1e-12)),
        -w,
        -np.sin(angle),
        -np.cos(angle),
    )
    speed = np.abs(smoother.apply(w))
    slow = speed < 0.15 * float(np.quantile(speed, 0.95))
    near = np.convolve(slow, np.ones(2 * (smoother.window // 2) + 1), "same") > 0.5
    return LoadEquation(
        smoother.apply(m.driven_acceleration_rad_s2),
        np.stack([smoother.apply(column) for column in columns], axis=1),
        ~near,
        None if m.force_n is None else (force - m.force_n, m.force_n * (shares[0] - 1.0) / mu),
    )


def load_features(m: motions.PairMotion, equation: LoadEquation | None, rows: Mask) -> dict[str, Any]:
    """Solve the equation of the driven gear on some samples; empty where they do not determine it."""
    if equation is None or np.sum(keep := rows & equation.turning) < 100:
        return {}
    columns = equation.columns[:, : 6 if _turned(m) > FULL_TURN else 4]
    x, _ = robust_least_squares(columns, equation.response, keep, far=5.0, rounds=3)
    if not x[0] > 0.0:
        return {}
    inertia = 1.0 / x[0]
    half = 0.5 * float(np.quantile(np.abs(m.driven_speed_rad_s), 0.95))
    residual = equation.response[keep] - columns[keep] @ x
    friction = float(inertia * x[1])
    if equation.flank_loss is not None:  # a measured force reflects the driver's side alone
        y, per_friction = (values[keep] for values in equation.flank_loss)
        distance = np.abs(y - np.median(y))
        near = distance < 5.0 * (_spread(distance) + 1e-12)
        power = float(np.sum(per_friction[near] ** 2))
        friction = float(np.sum(y[near] * per_friction[near]) / power) if power > 0.0 else friction
    return {
        "inertia_kg_m2": float(inertia),
        "friction_nm": float(inertia * (x[2] + x[3] * half)),
        "flank_friction": friction,
        "off_centre_nm": inertia * x[4:6] if len(x) > 4 else np.full(2, NAN),
        "drive_nm": float(np.quantile(np.abs(equation.columns[keep, 0]), 0.9)),
        "load_scatter_nm": float(inertia * _spread(np.abs(residual))),
    }


# --------------------
# Changes of these features from one machine to another.
# --------------------


class DriveFeature(NamedTuple):
    """A compared change: its words, its kind of place, whether it is a level, whether it follows from others."""

    words: str
    kind: PlaceKind = PlaceKind.SPEED
    is_level: bool = False
    follows: bool = False


FEATURES: Mapping[str, DriveFeature] = {
    "play": DriveFeature("play, from drive to back flank", is_level=True),
    "deflection": DriveFeature("deflection of the loaded teeth", is_level=True),
    "curve": DriveFeature("curve of the drive flank over the mesh cycle", PlaceKind.MESH),
    "inertia": DriveFeature("torque per acceleration of the load", is_level=True),
    "load_friction": DriveFeature("torque that turns the load without accelerating it", is_level=True),
    "flank_friction": DriveFeature("friction of the flanks", PlaceKind.MESH),
    "tooth": DriveFeature("one tooth that yields more than all others", PlaceKind.TOOTH),
    "next_tooth": DriveFeature("teeth that differ, drive flank", PlaceKind.TOOTH, follows=True),
    "ripple": DriveFeature("one order of the torque over all others", PlaceKind.SHAFT),
    "next_ripple": DriveFeature("other orders of the torque", PlaceKind.SHAFT, follows=True),
    "driver_wave": DriveFeature("wave of the compression once per revolution of the driver", PlaceKind.SHAFT),
    "driven_wave": DriveFeature("wave of the compression once per revolution of the driven gear", PlaceKind.SHAFT),
    "off_centre": DriveFeature("torque of the load once per revolution", PlaceKind.SHAFT),
    "impact": DriveFeature("hardest impact of the flanks in a cycle", is_level=True, follows=True),
    "contact_scatter": DriveFeature("residual of the loaded flanks' equation", is_level=True, follows=True),
    "load_scatter": DriveFeature("residual of the load's equation of motion", is_level=True, follows=True),
}
NAMES = tuple(FEATURES)
"""Names of the changes, see `change_of`."""


@dataclass(frozen=True)
class LocatedDriveChange:
    """Tooth and order of a change, and the ordinary differences between teeth and between orders.

    Parameters
    ----------
    tooth : int
        Tooth of the driver, from 0.
    order : int
        Index among the orders of the ripple.
    tooth_step_um : float
        Scatter of the changes of all teeth.
    ripple_step : array, (n_orders,)
        Fraction of the mean torque that a run's own variation may contribute at each order.
    next_tooth_um : float
        Change of the tooth with the second largest change, which a cracked tooth must exceed to be seen.
    """

    tooth: int
    order: int
    tooth_step_um: float
    ripple_step: FloatArray
    next_tooth_um: float


def spot_of(now: CycleFeatures, baseline: CycleFeatures) -> LocatedDriveChange:
    """Return the tooth and the order with the largest change relative to the others.

    Teeth: relative to the scatter of their changes, 1.4826 times the median deviation and at least 1 % of the
    deflection, so that a tooth is judged by the other teeth and not by the differences between makes. Orders: relative
    to f (1 + (w₀/w)³), f = 1 % of the mean torque, w₀ = 6, w the waves of an order in one run: with fewer waves, the
    trend of a start and a stop looks like a ripple.
    """
    teeth, ripple = now.teeth_um - baseline.teeth_um, now.ripple - baseline.ripple
    known = teeth[np.isfinite(teeth)]
    scatter = _spread(np.abs(known - np.median(known))) if len(known) else 0.0
    waves = np.maximum(np.minimum(now.ripple_waves, baseline.ripple_waves), 1e-3)
    steps = 0.01 * (1.0 + (6.0 / waves) ** 3)
    tooth, order = (int(np.nanargmax(v)) if np.any(np.isfinite(v)) else 0 for v in (teeth, ripple / steps))
    next_um = max(float(np.nan_to_num(_largest_except(teeth, tooth))), 0.0)
    return LocatedDriveChange(tooth, order, float(np.hypot(scatter, 0.01 * _deflection(now, baseline))), steps, next_um)


def change_of(
    now: CycleFeatures, baseline: CycleFeatures, curve_shape: FloatArray, at: LocatedDriveChange | None = None
) -> FloatArray:
    """Return the changes of all features, (n,) by `NAMES`; nan where they cannot be determined.

    Levels (play, deflection, inertia, friction of the load, impact, scatter) are in dB. Quantities that are normally
    near zero and may have a sign are given as 20 lg e · asinh(x/2f), f the difference between healthy machines: for
    large x this is in dB over f. Tooth and ripple are relative to the next largest, with f from `spot_of`.

    Parameters
    ----------
    now, baseline : CycleFeatures
        Of two machines, or of one machine at two times; or measured and simulated.
    curve_shape : array
        Profile of the compression over the mesh cycle due to worn flanks; its mean is 0.
    at : LocatedDriveChange or None
        Tooth and order to evaluate, and their steps. None: those that changed most.
    """
    spot = at or spot_of(now, baseline)
    teeth = (now.teeth_um - baseline.teeth_um) / spot.tooth_step_um
    ripple = (now.ripple - baseline.ripple) / spot.ripple_step
    deflection, drive = _deflection(now, baseline), baseline.drive_nm
    waves, off_centre = now.waves_um - baseline.waves_um, now.off_centre_nm - baseline.off_centre_nm

    def level(name: str, minimum: float = 0.0) -> float:
        a, b = getattr(now, name), getattr(baseline, name)
        if minimum != 0.0:  # smaller values are indistinguishable from zero
            a, b = np.hypot(a, minimum), np.hypot(b, minimum)
        return 20.0 * float(np.log10(a / b)) if a > 0.0 and b > 0.0 else NAN

    def signed(value: float, step: float) -> float:
        return float(20.0 / np.log(10.0) * np.arcsinh(value / (2.0 * step))) if step > 0.0 else NAN

    next_tooth = signed(_largest_except(teeth, spot.tooth), 1.0)
    next_ripple = signed(
        _largest_except(ripple, spot.order, 2), 1.0
    )  # in a short run, a ripple leaks into adjacent orders
    values = {
        "play": level("play_um"),
        "deflection": level("deflection_um"),
        "curve": signed(_projected(now.curve_um - baseline.curve_um, curve_shape), 0.1 * deflection),
        "inertia": level("inertia_kg_m2"),
        "load_friction": level("friction_nm"),
        "flank_friction": signed(now.flank_friction - baseline.flank_friction, 0.02),
        "tooth": signed(float(teeth[spot.tooth]), 1.0) - next_tooth,
        "next_tooth": next_tooth,
        "ripple": signed(float(ripple[spot.order]) if len(ripple) else NAN, 1.0) - next_ripple,
        "next_ripple": next_ripple,
        "driver_wave": signed(float(np.hypot(*waves[:2])), 0.2 * deflection),
        "driven_wave": signed(float(np.hypot(*waves[2:])), 0.2 * deflection),
        "off_centre": signed(float(np.hypot(*off_centre)), 0.03 * drive),
        "impact": level("impact_mps"),
        "contact_scatter": level("contact_scatter_um", 0.5),
        "load_scatter": level("load_scatter_nm", 0.01 * drive),
    }
    return np.array([values[name] for name in NAMES], dtype=np.float64)


def _deflection(now: CycleFeatures, baseline: CycleFeatures) -> float:
    """Return the deflection of a pair of teeth under the ordinary load; 20 µm where it is not known without torque."""
    return next((d for d in (baseline.deflection_um, now.deflection_um) if np.isfinite(d)), 20.0)


def _projected(curve: FloatArray, shape: FloatArray) -> float:
    """Return the projection of a curve on a shape of the same length, as its peak-to-peak value."""
    known = np.isfinite(curve)
    if np.sum(known) < len(curve) // 2:
        return NAN
    s = shape[known] - np.mean(shape[known])
    c = curve[known] - np.mean(curve[known])
    return float(np.ptp(shape) * np.sum(s * c) / np.sum(s * s))


def _largest_except(values: FloatArray, place: int, n_neighbours: int = 0) -> float:
    """Return the largest of the other values, without its neighbours."""
    remaining = np.delete(values, np.arange(max(place - n_neighbours, 0), min(place + n_neighbours + 1, len(values))))
    return float(np.nanmax(remaining)) if np.any(np.isfinite(remaining)) else NAN


COMPRESSION, TORQUE = "compression", "torque"
UNITS = {COMPRESSION: "µm", TORQUE: "N·m"}


def prediction_errors(cycles: PreparedCycles, known: CycleFeatures) -> dict[tuple[str, str, str], float]:
    """Return the RMS error of prediction by quantity, phase of motion and flank.

    Compression: q − q₀ − s(a + κ(|F|/n)^{1/λ}), a and κ the known ones, q₀ such that the drive flank is right on
    average. Torque: τ − J1 α1 − (r_b1/r_b2)(J2 α2 + T sgn ω2)/(1 + μ G) within 40 Hz, while the load turns. Each error
    combines an offset and a normal scatter about it, both from medians, so that single impacts hardly count.

    Parameters
    ----------
    cycles : PreparedCycles
        Their motion is predicted.
    known : CycleFeatures
        Of the healthy machine, or of its simulation.

    Returns
    -------
    dict
        Keys are "compression" (µm along the line of action) or "torque" (of the driver's shaft, N m); a phase of
        `PHASES`; "drive", "back" or, for either flank, "".
    """
    m, flanks, equation = cycles.motion, cycles.flanks, cycles.equation
    residuals: list[tuple[str, str, FloatArray, Mask]] = []
    side, elastic = flanks.design[:, 0], flanks.design[:, 1]
    drive = flanks.loaded & (side > 0.0)
    if np.isfinite(known.play_um) and np.sum(drive) >= 20:
        ordinary = float(np.median(np.abs(elastic[flanks.alone]))) if np.any(flanks.alone) else 0.0
        per_load = known.deflection_um / ordinary if ordinary > 0.0 else 0.0
        residual = 1e6 * m.compression_m - side * 0.5 * known.play_um - np.nan_to_num(per_load) * elastic
        residual = residual - float(np.median(residual[drive]))
        residuals += [
            (COMPRESSION, "drive", residual, drive),
            (COMPRESSION, "back", residual, flanks.loaded & (side < 0.0)),
        ]
    if equation is not None and np.isfinite(known.inertia_kg_m2):
        load_torque = equation.columns[:, 0] + known.flank_friction * equation.columns[:, 1]
        needed = known.inertia_kg_m2 * equation.response - known.friction_nm * equation.columns[:, 2]
        r1, r2 = m.path.base_radii_m
        residuals.append((TORQUE, "", (load_torque - needed) * r1 / r2, equation.turning))
    errors = {}
    for quantity, flank, residual, rows in residuals:
        for number, phase in enumerate(PHASES):
            errors_of_phase = residual[rows & (cycles.phase == number) & (cycles.number >= 0)]
            if len(errors_of_phase) >= 20:
                offset = float(np.median(errors_of_phase))
                variance = (
                    np.median((errors_of_phase - offset) ** 2) / 0.455
                )  # the median of a normal variable's square
                errors[quantity, phase, flank] = float(np.sqrt(offset**2 + variance))
    return errors
