"""Impacts of the flanks from the motion of both gears: time, tooth, speed and restitution."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from math import pi

import numpy as np

from gearsig.checks import FloatArray, positive
from gearsig.errors import RefusalError
from gearsig.motion._force import depth
from gearsig.motion._measure import PairMotion, median_deviation

MAX_SAMPLES = 60


@dataclass(frozen=True)
class FlightFit:
    """q(t) = c0 + c1 t + c2 t² near one end of a flight, with t from `origin_s`."""

    origin_s: float
    coefficients: tuple[float, float, float]

    def rate(self, time_s: float) -> float:
        """Compression rate."""
        _, c1, c2 = self.coefficients
        return c1 + 2.0 * c2 * (time_s - self.origin_s)

    def crossing(self, level_m: float, low_s: float, high_s: float) -> float:
        """Time at which the parabola reaches a level between two times; the closer of these if it does not."""
        c0, c1, c2 = self.coefficients
        roots = np.roots([c2, c1, c0 - level_m]) if c2 else np.array([(level_m - c0) / c1 if c1 else np.nan])
        times = roots[np.isreal(roots)].real + self.origin_s
        inside = times[(times >= low_s) & (times <= high_s)]
        if len(inside):
            return float(inside[0])
        ends = np.array([low_s, high_s])
        t = ends - self.origin_s
        return float(ends[np.argmin(np.abs(c0 + c1 * t + c2 * t**2 - level_m))])


def fit_flight(
    compression_m: FloatArray,
    rate_mps: FloatArray | None,
    first: int,
    last: int,
    sampling_rate_hz: float,
    scatter: tuple[float, float],
    *,
    at_end: bool,
) -> FlightFit:
    """Fit a parabola to the samples of a flight at its end, or at its beginning.

    Motor, brake and friction are constant over a few milliseconds, so the flanks approach at constant acceleration.

    Parameters
    ----------
    compression_m : array
    rate_mps : array or None
        Measured independently; None: derived from the compression, and of no additional use so close to an impact.
    first, last : int
        Samples of the flight; the last is exclusive.
    sampling_rate_hz : float
    scatter : (float, float)
        Standard deviations of compression and rate.
    at_end : bool
    """
    # 3 ms next to the flank: further away, a moving valve or reversing friction has changed the acceleration.
    n_max = int(np.clip(round(3e-3 * sampling_rate_hz), 3, MAX_SAMPLES))
    chosen = np.arange(max(first, last - n_max), last) if at_end else np.arange(first, min(last, first + n_max))
    t = (chosen - chosen[0]) / sampling_rate_hz
    rows = [np.stack([np.ones_like(t), t, t**2], axis=1) / max(scatter[0], 1e-12)]
    values = [compression_m[chosen] / max(scatter[0], 1e-12)]
    if rate_mps is not None:
        rows.append(np.stack([np.zeros_like(t), np.ones_like(t), 2.0 * t], axis=1) / max(scatter[1], 1e-9))
        values.append(rate_mps[chosen] / max(scatter[1], 1e-9))
    design = np.vstack(rows)
    n_terms = min(3, len(design))
    x, *_ = np.linalg.lstsq(design[:, :n_terms], np.concatenate(values), rcond=None)
    c0, c1, c2 = np.concatenate([x, np.zeros(3 - n_terms)])
    return FlightFit(float(chosen[0]) / sampling_rate_hz, (float(c0), float(c1), float(c2)))


NOISE_DEPTH = 4.0
"""Minimum depth of a contact, in standard deviations of the compression's noise."""
MIN_FLIGHT_SAMPLES = 2
"""Minimum samples in the gap before a contact: with fewer, the contact counts as never interrupted."""


@dataclass(frozen=True)
class Impact:
    """One impact of the flanks.

    Parameters
    ----------
    time_s : float
        Interpolated between samples, where the fitted approach crosses the flank.
    flank : int
        1: drive flank; −1: back flank.
    driver_tooth, driven_tooth : int
        Teeth that last entered contact, from 1, counted from the zero of the angles.
    driver_angle_deg : float
        0 to 360.
    speed_mps : float
        Approach speed along the line of action.
    energy_j : float
        ½ m v², with m the mass of both gears reduced to the line of action; nan if an inertia is not known.
    restitution : float
        Separation speed divided by approach speed; nan if the flanks stayed in contact, or if the estimate is above 1,
        which is impossible: see `note`.
    lost_j : float
        ½ m v² (1 − e²); nan in the same cases.
    peak_force_n : float
        From the maximum depth and the contact stiffness; too low if samples are sparse.
    note : str
        Problem with this impact; empty if none.
    """

    time_s: float
    flank: int
    driver_tooth: int
    driven_tooth: int
    driver_angle_deg: float
    speed_mps: float
    energy_j: float
    restitution: float
    lost_j: float
    peak_force_n: float
    note: str = ""


def find_impacts(motion: PairMotion, datum_m: float, *, half_backlash_m: float | None = None) -> tuple[Impact, ...]:
    """Find the impacts of the flanks after a flight through the backlash.

    Approaches slower than five standard deviations of the compression rate's noise are left out.

    Parameters
    ----------
    motion : PairMotion
    datum_m : float
        Compression at the middle of the backlash, from `estimate_backlash` or `find_datum`.
    half_backlash_m : float or None
        None: the rig's. A measured value allows for worn flanks.

    Raises
    ------
    RefusalError
        If the compression's noise is a quarter of the backlash or more, or the backlash is not known.

    Notes
    -----
    An impact lasts about a millisecond and its rebounds follow within a few more: at 1 kHz, those with fewer than two
    samples of flight are missed. Teeth are counted from the zero of the angles.
    """
    a = (
        motion.contact.half_backlash_um * 1e-6
        if half_backlash_m is None
        else positive(half_backlash_m, "half_backlash_m")
    )
    if a == 0.0:
        raise RefusalError(
            "the rig says that there is no backlash, so that there are no impacts",
            remedy="give half_backlash_um in its [contact] table, or record a braked stop, which shows it",
        )
    q, rate = motion.compression_m - datum_m, motion.compression_rate_mps
    noise = scatter_of(q)
    if noise > 0.5 * a:
        raise RefusalError(
            f"the noise of the compression is {1e6 * noise:.3g} µm in a backlash of {2e6 * a:.3g} µm: it hides flights",
            remedy="use encoders of more counts; if the motion is slow, --bandwidth of gearsig start-stop",
        )
    g = depth(q, a)
    rate_noise = scatter_of(rate)
    flights = _Flights(motion, q, a, (noise, rate_noise))
    runs = _runs(np.where(np.abs(g) > 0.0, np.sign(g), 0.0).astype(np.int64), g, NOISE_DEPTH * noise)
    impacts = []
    for before, run, after in zip(runs[:-1], runs[1:], [*runs[2:], None][: len(runs) - 1], strict=True):
        if run[0] == 0 or before[0] != 0 or before[2] - before[1] < MIN_FLIGHT_SAMPLES:
            continue
        impact = _impact(motion, flights, g, before, run, after)
        if impact.speed_mps > 5.0 * rate_noise:
            impacts.append(impact)
    return tuple(impacts)


def meeting_speeds(motion: PairMotion, datum_m: float, half_backlash_m: float) -> FloatArray:
    """Impact speed of the contact of each sample in m/s, (n,), at least the floor; nan if the flight was too short.

    Samples in the backlash also have the floor.
    """
    q = motion.compression_m - datum_m
    scatter = (scatter_of(q), scatter_of(motion.compression_rate_mps))
    flights = _Flights(motion, q, half_backlash_m, scatter)
    g = depth(q, half_backlash_m)
    speeds = np.full(len(q), motion.contact.impact_speed_floor_mps)
    runs = _runs(np.sign(g).astype(np.int64), g, NOISE_DEPTH * scatter[0])
    for before, run in pairwise(runs):
        if run[0] != 0:
            long_enough = before[0] == 0 and before[2] - before[1] >= MIN_FLIGHT_SAMPLES
            speed = flights.meets(before, run[0])[1] if long_enough else np.nan
            speeds[run[1] : run[2]] = np.maximum(speed, motion.contact.impact_speed_floor_mps)
    return speeds


def reduced_mass_kg(motion: PairMotion) -> float:
    """1/(r_b1²/J1 + r_b2²/J2), where J1 includes the motor; nan if an inertia is not known."""
    contact = motion.contact
    driver = contact.driver_inertia_kg_m2 + contact.motor_inertia_kg_m2
    if driver <= 0.0 or contact.driven_inertia_kg_m2 is None:
        return float("nan")
    r1, r2 = motion.path.base_radii_m
    return 1.0 / (r1**2 / driver + r2**2 / contact.driven_inertia_kg_m2)


def scatter_of(values: FloatArray) -> float:
    """Standard deviation of sample-to-sample noise, by the median of second differences, robust to impacts."""
    moving = np.diff(values, 2)
    moving = moving[moving != 0.0]
    return median_deviation(moving) / np.sqrt(6.0) if len(moving) else 0.0


Run = tuple[int, int, int]
"""Flank (0: in the gap), first sample, sample after the last."""


def _runs(side: np.ndarray, g: FloatArray, min_depth_m: float) -> list[Run]:
    """Segments on one flank or in the gap; a contact no deeper than the noise counts as flight."""
    runs: list[Run] = []
    edges = np.flatnonzero(np.diff(side)) + 1
    for first, last in zip(np.concatenate([[0], edges]), np.concatenate([edges, [len(side)]]), strict=True):
        flank = int(side[first])
        if flank and float(np.max(np.abs(g[first:last]))) < min_depth_m:
            flank = 0
        if runs and runs[-1][0] == flank:
            runs[-1] = (flank, runs[-1][1], int(last))
        else:
            runs.append((flank, int(first), int(last)))
    return runs


@dataclass(frozen=True)
class _Flights:
    """Fits to the flights before and after a contact."""

    motion: PairMotion
    compression_m: FloatArray
    half_backlash_m: float
    scatter: tuple[float, float]

    def meets(self, flight: Run, flank: int) -> tuple[float, float]:
        """Time and approach speed at which a flight ends on a flank."""
        fit = self._fit(flight, at_end=True)
        rate = self.motion.sampling_rate_hz
        time = fit.crossing(flank * self.half_backlash_m, (flight[2] - 1) / rate, flight[2] / rate)
        return time, flank * fit.rate(time)

    def leaves(self, flight: Run, flank: int) -> float:
        """Separation speed at which a flight begins on a flank."""
        fit = self._fit(flight, at_end=False)
        rate = self.motion.sampling_rate_hz
        time = fit.crossing(flank * self.half_backlash_m, (flight[1] - 1) / rate, flight[1] / rate)
        return -flank * fit.rate(time)

    def _fit(self, flight: Run, *, at_end: bool) -> FlightFit:
        derived = any("derivative" in self.motion.methods.get(f"{side} speed", "") for side in ("driver", "driven"))
        rates = None if derived else self.motion.compression_rate_mps
        return fit_flight(
            self.compression_m, rates, flight[1], flight[2], self.motion.sampling_rate_hz, self.scatter, at_end=at_end
        )


def _impact(motion: PairMotion, flights: _Flights, g: FloatArray, before: Run, run: Run, after: Run | None) -> Impact:
    flank, first, last = run
    time, speed = flights.meets(before, flank)
    step = 1.0 / motion.sampling_rate_hz
    mass = reduced_mass_kg(motion)
    angle = float(np.interp(time, [(first - 1) * step, first * step], motion.driver_angle_rad[first - 1 : first + 1]))
    restitution, note = float("nan"), ""
    bounced = after is not None and after[0] == 0 and after[2] - after[1] >= MIN_FLIGHT_SAMPLES
    # A contact longer than six free elastic impacts carries load and is no bounce.
    if bounced and speed > 0.0 and (last - first - 1) * step < 6.0 * _bounce_s(motion, speed, mass):
        assert after is not None  # noqa: S101  bounced says so
        restitution = max(flights.leaves(after, flank), 0.0) / speed
        if restitution > 1.0:
            note = f"separation is {restitution:.3g} times as fast as approach: noise, or too few samples in flight"
            restitution = float("nan")
    energy = 0.5 * mass * speed**2
    deepest = float(np.max(np.abs(g[first:last])))
    contact, path = motion.contact, motion.path
    z1, z2 = path.teeth
    pitch = int(np.floor(angle * z1 / (2.0 * pi) - path.phase))
    n = float(path.n_pairs(np.array(angle), float(flank)))
    return Impact(
        time,
        flank,
        pitch % z1 + 1,
        pitch % z2 + 1,
        float(np.degrees(angle) % 360.0),
        speed,
        energy,
        restitution,
        energy * (1.0 - restitution**2),
        n * contact.stiffness_n_per_m_lambda * deepest**contact.exponent,
        note,
    )


def _bounce_s(motion: PairMotion, speed_mps: float, mass_kg: float) -> float:
    """Duration of a free elastic impact on one tooth pair, B (m g_max)/(v …): 2.94 g_max/v for λ = 1.5.

    g_max follows from ½ m v² = k g^(λ+1)/(λ+1).
    """
    contact = motion.contact
    if not mass_kg > 0.0:
        return 5e-3
    power = contact.exponent + 1.0
    deepest = (0.5 * power * mass_kg * speed_mps**2 / contact.stiffness_n_per_m_lambda) ** (1.0 / power)
    return 2.94 * float(deepest) / speed_mps
