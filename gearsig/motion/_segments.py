"""How one shaft moves: segments forwards, backwards and at rest; starts, stops, reversals; signals over its angle."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from math import floor

import numpy as np
from numpy.typing import NDArray

from gearsig.checks import FloatArray, count, one_of, positive
from gearsig.errors import InputError, RefusalError
from gearsig.formatting import counted
from gearsig.motion._measure import local_polynomial, median_deviation
from gearsig.results import Result
from gearsig.spectra import Spectrum, amplitude_spectrum

AT_ONCE, FIRST_S = 0.15, 0.01
"""Of the top speed of the first segment: slower on average in its first hundredth of a second, it begins from rest."""


@dataclass(frozen=True)
class MotionSegment:
    """A time in which a shaft turns one way, or stands.

    Parameters
    ----------
    direction : int
        1, −1, or 0 at rest.
    first, last : int
        Samples; the last is not in it.
    start_s, end_s : float
    turned_rad : float
    top_speed_rad_s : float
        Largest magnitude.
    """

    direction: int
    first: int
    last: int
    start_s: float
    end_s: float
    turned_rad: float
    top_speed_rad_s: float

    @property
    def duration_s(self) -> float:
        """From start to end."""
        return self.end_s - self.start_s


@dataclass(frozen=True)
class MotionSegments(Result, rows="segments"):
    """The segments of a recording, and what they add up to.

    Parameters
    ----------
    segments : tuple of MotionSegment
        One after the other, without gaps.
    starts_at_once : bool
        Whether the shaft stands at the first sample and moves from it on: a start without a rest ahead of it.
    """

    segments: tuple[MotionSegment, ...]
    starts_at_once: bool = False

    @property
    def moving(self) -> tuple[MotionSegment, ...]:
        """Segments in which the shaft turns."""
        return tuple(s for s in self.segments if s.direction)

    @property
    def starts_s(self) -> tuple[float, ...]:
        """Times at which motion begins after a rest in the record, or from rest at its first sample."""
        at_once = (self.segments[0].start_s,) if self.starts_at_once else ()
        return (*at_once, *(b.start_s for a, b in self._pairs() if not a.direction and b.direction))

    @property
    def stops_s(self) -> tuple[float, ...]:
        """Times at which motion ends in a rest."""
        return tuple(b.start_s for a, b in self._pairs() if a.direction and not b.direction)

    @property
    def summary(self) -> str:
        """Starts and stops in words; a record that begins or ends in motion holds one less of them."""
        counts = f"{counted(len(self.starts_s), 'start')} and {counted(len(self.stops_s), 'stop')}"
        moves = {"begins": self.segments[0].direction and not self.starts_at_once, "ends": self.segments[-1].direction}
        ends = [name for name, is_moving in moves.items() if is_moving]
        return f"{counts} in a record that {' and '.join(ends)} in motion" if ends else counts

    @property
    def n_reversals(self) -> int:
        """Changes from one direction to the other, with or without a rest between."""
        return sum(a.direction != b.direction for a, b in pairwise(self.moving))

    @property
    def standing_part(self) -> float:
        """Part of the time at rest."""
        total = sum(s.duration_s for s in self.segments)
        return sum(s.duration_s for s in self.segments if not s.direction) / total

    @property
    def top_speed_rpm(self) -> float:
        """Highest speed of all segments; 0 where nothing turns."""
        return max((s.top_speed_rad_s for s in self.moving), default=0.0) * 30.0 / np.pi

    @property
    def backwards_rad(self) -> float:
        """Angle turned against the direction in which most is turned."""
        turned = [sum(abs(s.turned_rad) for s in self.segments if s.direction == d) for d in (1, -1)]
        return float(min(turned))

    def _pairs(self) -> list[tuple[MotionSegment, MotionSegment]]:
        return list(pairwise(self.segments))


def motion_segments(
    angle_rad: FloatArray, sampling_rate_hz: float, speed_rad_s: FloatArray | None = None
) -> MotionSegments:
    """Cut a shaft's motion into segments forwards, backwards and at rest.

    At rest is a speed below 2 % of its 95 % quantile, or within five standard deviations of its scatter from sample to
    sample, for at least 30 ms. A segment that turns by less than 2 % of the longest one is rest as well.

    Parameters
    ----------
    angle_rad : array, (n,)
        Running on.
    sampling_rate_hz : float
    speed_rad_s : array, (n,), or None
        None: derived from the angle within 50 Hz, see `shaft_speed_rad_s`.

    Raises
    ------
    InputError
        If the lengths differ, or there are fewer than 8 samples.
    """
    positive(sampling_rate_hz, "sampling_rate_hz", "Hz")
    if speed_rad_s is None:
        speed_rad_s = shaft_speed_rad_s(angle_rad, sampling_rate_hz)
    if len(angle_rad) != len(speed_rad_s) or len(speed_rad_s) < 8:
        raise InputError(f"{len(angle_rad)} angles for {len(speed_rad_s)} speeds", allowed="as many, at least 8")
    scatter = median_deviation(np.diff(speed_rad_s, 2)) / np.sqrt(6.0)
    threshold = max(0.02 * float(np.quantile(np.abs(speed_rad_s), 0.95)), 5.0 * scatter, 1e-12)
    directions = np.where(np.abs(speed_rad_s) < threshold, 0, np.sign(speed_rad_s)).astype(np.int64)
    # A shorter rest is the turning point of a swing, a shorter motion a tremor.
    shortest = max(2, round(0.03 * sampling_rate_hz))
    _absorb(directions, shortest)
    segments = _cut(directions, angle_rad, speed_rad_s, sampling_rate_hz)
    # What turns by less than 2 % of the longest segment is a standing machine that is struck, not started.
    min_turned_rad = 0.02 * max(abs(s.turned_rad) for s in segments)
    for segment in segments:
        if abs(segment.turned_rad) < min_turned_rad:
            directions[segment.first : segment.last] = 0
    final = _cut(directions, angle_rad, speed_rad_s, sampling_rate_hz)
    return MotionSegments(final, _starts_at_once(final[0], angle_rad, sampling_rate_hz))


def is_start_stop(segments: MotionSegments) -> bool:
    """Say whether a motion starts and stops, or reverses: no speed to count orders by.

    A run-up from rest does not: what follows can be counted in revolutions. Nor does less than 5 % of the time at rest,
    or a tenth of a radian turned back.
    """
    rests = bool(segments.starts_s) and bool(segments.stops_s) and segments.standing_part >= 0.05
    return rests or segments.backwards_rad >= 0.1


def _starts_at_once(first: MotionSegment, angle_rad: FloatArray, rate_hz: float) -> bool:
    """Say whether the first segment moves, and began to with the record."""
    n = min(max(2, round(FIRST_S * rate_hz)), first.last - 1)
    speed = abs(float(angle_rad[n] - angle_rad[0])) * rate_hz / n
    return bool(first.direction) and speed < AT_ONCE * first.top_speed_rad_s


def _absorb(directions: np.ndarray, shortest: int) -> None:
    """Give runs that are too short the direction of the run before them, the shortest first; in place."""
    while True:
        bounds = _bounds(directions)
        lengths = np.diff(bounds)
        if len(lengths) < 2 or lengths.min() >= shortest:
            return
        i = int(np.argmin(lengths))
        giver = bounds[i] - 1 if i else bounds[1]
        directions[bounds[i] : bounds[i + 1]] = directions[giver]


def _cut(
    directions: np.ndarray, angle_rad: FloatArray, speed_rad_s: FloatArray, rate_hz: float
) -> tuple[MotionSegment, ...]:
    return tuple(
        _segment(int(directions[a]), int(a), int(b), angle_rad, speed_rad_s, rate_hz)
        for a, b in pairwise(_bounds(directions))
    )


def _bounds(directions: np.ndarray) -> NDArray[np.intp]:
    """Return where runs of one direction begin, and where the last one ends."""
    return np.concatenate([[0], np.flatnonzero(np.diff(directions)) + 1, [len(directions)]])


def _segment(
    direction: int, first: int, last: int, angle_rad: FloatArray, speed_rad_s: FloatArray, rate_hz: float
) -> MotionSegment:
    end = min(last, len(angle_rad) - 1)
    turned = float(angle_rad[end] - angle_rad[first])
    top = float(np.max(np.abs(speed_rad_s[first:last])))
    return MotionSegment(direction, first, last, first / rate_hz, last / rate_hz, turned, top)


RUN_UP, RUNNING, RUN_DOWN, AT_REST = "run-up", "running", "run-down", "at rest"


@dataclass(frozen=True)
class Phase:
    """A time with a name: one of `RUN_UP`, `RUNNING`, `RUN_DOWN`, `AT_REST`."""

    name: str
    start_s: float
    end_s: float


def shaft_speed_rad_s(angle_rad: FloatArray, sampling_rate_hz: float) -> FloatArray:
    """Return the speed of a shaft within 50 Hz, (n,), from its angle."""
    # A shaft starts and stops within 50 Hz; what is faster is ringing.
    smoother = local_polynomial(sampling_rate_hz, min(50.0, 0.1 * sampling_rate_hz))
    return smoother.apply(angle_rad, 1)


def find_phases(segments: MotionSegments, speed_rad_s: FloatArray, sampling_rate_hz: float) -> tuple[Phase, ...]:
    """Cut every segment in motion where it first reaches, and where it last has, 90 % of its highest speed.

    Parameters
    ----------
    segments : MotionSegments
    speed_rad_s : array, (n,)
        The smoothed one that the segments were found from: ringing would pass for running.
    sampling_rate_hz : float

    Returns
    -------
    tuple of Phase
        One after the other from the record's begin to its end; a phase of no length is left out. A segment that is
        cut by the record's end has no run-down, one that is cut by its begin no run-up.
    """
    phases: list[Phase] = []
    for segment in segments.segments:
        if segment.direction:
            phases += _of_motion(segment, np.abs(speed_rad_s[segment.first : segment.last]), sampling_rate_hz)
        else:
            phases.append(Phase(AT_REST, segment.start_s, segment.end_s))
    return tuple(phases)


def _of_motion(segment: MotionSegment, speed_rad_s: FloatArray, rate_hz: float) -> list[Phase]:
    fast = np.flatnonzero(speed_rad_s >= 0.9 * float(speed_rad_s.max()))
    up, down = segment.start_s + fast[0] / rate_hz, segment.start_s + (fast[-1] + 1) / rate_hz
    edges = [(RUN_UP, segment.start_s, up), (RUNNING, up, down), (RUN_DOWN, down, segment.end_s)]
    return [Phase(name, float(a), float(b)) for name, a, b in edges if b - a > 0.5 / rate_hz]


@dataclass(frozen=True)
class AngleProfile:
    """Level of a signal in each tooth pitch of a shaft, forwards and backwards apart.

    Parameters
    ----------
    n_teeth : int
    rms_forwards, rms_backwards : arrays, (n_teeth,)
        In the signal's unit; nan where a tooth was never passed that way.
    passes_forwards, passes_backwards : array of int, (n_teeth,)
    """

    n_teeth: int
    rms_forwards: FloatArray
    rms_backwards: FloatArray
    passes_forwards: NDArray[np.int64]
    passes_backwards: NDArray[np.int64]


def angle_profile(values: FloatArray, angle_rad: FloatArray, segments: MotionSegments, n_teeth: int) -> AngleProfile:
    """Return the root mean square over angle of a signal within each tooth pitch.

    Every segment of one direction is followed by its own angle, so that a stop in the middle of a tooth or a turn back
    needs no speed; samples weigh by the angle they cover, so that a slow passage counts no more than a fast one.
    Samples at rest have no angle and are left out.

    Parameters
    ----------
    values : array, (n,)
    angle_rad : array, (n,)
        Of the shaft, running on.
    segments : MotionSegments
    n_teeth : int

    Raises
    ------
    InputError
        If the lengths differ.
    """
    count(n_teeth, "n_teeth", minimum=3)
    if len(values) != len(angle_rad):
        raise InputError(f"{len(values)} values for {len(angle_rad)} angles", allowed="equal lengths")
    sums, weights = np.zeros((2, n_teeth)), np.zeros((2, n_teeth))
    passes = np.zeros((2, n_teeth), dtype=np.int64)
    for segment in segments.moving:
        row = 0 if segment.direction > 0 else 1
        x = angle_rad[segment.first : segment.last] * n_teeth / (2.0 * np.pi)
        covered = np.abs(np.gradient(x)) if len(x) > 1 else np.zeros(len(x))
        pitch = np.floor(x).astype(np.int64)
        tooth = pitch % n_teeth
        np.add.at(sums[row], tooth, covered * values[segment.first : segment.last] ** 2)
        np.add.at(weights[row], tooth, covered)
        np.add.at(passes[row], np.unique(pitch) % n_teeth, 1)
    with np.errstate(invalid="ignore"):
        rms = np.sqrt(np.where(weights > 0.0, sums / np.where(weights > 0.0, weights, 1.0), np.nan))
    return AngleProfile(n_teeth, rms[0], rms[1], passes[0], passes[1])


MIN_SAMPLES = 16
"""Per revolution."""


def segment_order_spectrum(
    values: FloatArray,
    angle_rad: FloatArray,
    segments: MotionSegments,
    *,
    direction: str = "forwards",
    revolutions_per_block: float = 1.0,
    unit: str = "",
    source: str = "",
    shaft: str = "",
) -> Spectrum:
    """Return the order spectrum of all segments of one direction, however fast, slow or short they are.

    Each segment is cut into equal steps of angle; a step holds the signal's mean over it, ∫x dθ/Δθ, so that slow
    passages are averaged and do not fold back, and the passage to and from standstill needs no speed. Blocks of
    whole steps are windowed (Hann), and their power is averaged over all segments.

    Parameters
    ----------
    values : array, (n,)
    angle_rad : array, (n,)
        Of the shaft, running on.
    segments : MotionSegments
    direction : str
        "forwards" or "backwards"; backwards orders count up as well.
    revolutions_per_block : float
        Segments that are shorter are left out. The lines lie 1/this apart.
    unit, source, shaft : str

    Returns
    -------
    Spectrum
        Over order, "amplitude peak".

    Raises
    ------
    InputError
        On another direction, or if values and angles differ in number.
    RefusalError
        If no segment of that direction is long enough.

    Notes
    -----
    Phases differ from segment to segment and are not kept. A resonance that rings on in time smears here.
    """
    one_of(direction, "direction", ("forwards", "backwards"))
    positive(revolutions_per_block, "revolutions_per_block")
    if len(values) != len(angle_rad):
        raise InputError(f"{len(values)} values for {len(angle_rad)} angles", allowed="equal lengths")
    sign = 1 if direction == "forwards" else -1
    chosen = [s for s in segments.moving if s.direction == sign]
    turns = [abs(s.turned_rad) / (2.0 * np.pi) for s in chosen]
    long = [s for s, n in zip(chosen, turns, strict=True) if n >= revolutions_per_block]
    if not long:
        longest = max(turns, default=0.0)
        raise RefusalError(
            f"no segment {direction} holds {revolutions_per_block:g} revolutions (the longest {longest:.3g})",
            remedy="give fewer revolutions per block: the lines then lie further apart",
        )
    per_revolution = _samples_per_revolution(angle_rad, long)
    n_block = floor(revolutions_per_block * per_revolution)
    spectra = []
    for segment in long:
        steps = steps_of_angle(values, sign * angle_rad, segment, per_revolution)
        if len(steps) >= n_block:
            spectra.append(
                amplitude_spectrum(steps, float(per_revolution), unit=unit, scaling="power", n_per_block=n_block)
            )
    if not spectra:
        raise RefusalError(f"no segment {direction} holds a whole block", remedy="give fewer revolutions per block")
    return _mean(spectra, per_revolution, unit, f"{source}, {counted(len(spectra), 'segment')} {direction}", shaft)


def steps_of_angle(
    values: FloatArray, angle_rad: FloatArray, segment: MotionSegment, per_revolution: int
) -> FloatArray:
    """Mean of a signal over equal steps of a rising angle within a segment, (n_steps,)."""
    rising = np.maximum.accumulate(angle_rad[segment.first : segment.last]) / (2.0 * np.pi)
    x = np.asarray(values[segment.first : segment.last], dtype=np.float64)
    integral = np.concatenate([[0.0], np.cumsum(0.5 * (x[1:] + x[:-1]) * np.diff(rising))])
    first, last = np.ceil(rising[0] * per_revolution), np.floor(rising[-1] * per_revolution)
    edges = np.arange(first, last + 1) / per_revolution
    steps: FloatArray = np.diff(np.interp(edges, rising, integral)) * per_revolution
    return steps


def _samples_per_revolution(angle_rad: FloatArray, segments: list[MotionSegment]) -> int:
    """As many as the fastest passage has samples, no more."""
    step = max(float(np.quantile(np.abs(np.diff(angle_rad[s.first : s.last])), 0.99)) for s in segments)
    n_orders = floor(2.0 * np.pi / step)
    if n_orders < MIN_SAMPLES:
        raise RefusalError(
            f"the shaft turns by {step:.3g} rad between samples: {n_orders} samples a revolution",
            remedy="record at a higher rate",
        )
    return n_orders


def _mean(spectra: list[Spectrum], per_revolution: int, unit: str, source: str, shaft: str) -> Spectrum:
    """Mean power of the segments, as amplitude over order, what the steps' means lost made up."""
    weights = np.array([s.n_averages for s in spectra], dtype=np.float64)
    power = np.average([s.values for s in spectra], axis=0, weights=weights)
    first = spectra[0]
    # At a quarter of the samples per revolution the mean over a step of angle has lost a tenth, which is made up.
    keep = first.positions <= 0.25 * per_revolution
    lost = np.sinc(first.positions[keep] / per_revolution)
    amplitude = np.sqrt(2.0 * power[keep]) / lost
    amplitude[0] /= np.sqrt(2.0)  # of a mean the amplitude is the value itself
    return Spectrum(
        amplitude,
        first.positions[keep],
        "order",
        "amplitude peak",
        unit,
        first.resolution,
        first.noise_bandwidth,
        first.window,
        int(weights.sum()),
        source,
        shaft,
    )


@dataclass(frozen=True)
class Burst:
    """A blow: time of its beginning and largest magnitude in its first milliseconds."""

    time_s: float
    peak: float


def find_bursts(values: FloatArray, sampling_rate_hz: float) -> tuple[Burst, ...]:
    """Find where a vibration rises at once, far over its quiet level.

    Those below 35 % of the hardest are left out. The level is the root mean square over 2 ms; quiet is its 20 %
    quantile, which a machine that stands now and then has.

    Raises
    ------
    InputError
        If the rate is below 2 kHz, where a blow would be a single sample, or the record is shorter than 40 ms.
    """
    positive(sampling_rate_hz, "sampling_rate_hz", "Hz")
    if sampling_rate_hz < 2000.0:
        raise InputError(f"sampling_rate_hz is {sampling_rate_hz:g} Hz", allowed="2 kHz and more")
    n = max(2, round(2e-3 * sampling_rate_hz))
    if len(values) < 20 * n:
        raise InputError(f"{len(values)} samples are too few", allowed=f"{20 * n} or more")
    centred = values - np.median(values)
    power = np.concatenate([[0.0], np.cumsum(centred**2)])
    level = np.sqrt((power[n:] - power[:-n]) / n)  # level[i] covers samples i to i + n
    quiet = float(np.quantile(level, 0.2))
    ahead, behind = level[n:], level[:-n]
    # White noise does not reach 8 times the quiet level in an hour; a blow begins at once, ringing does not.
    rises = (ahead > 8.0 * quiet) & (ahead > 2.0 * behind)
    bursts: list[Burst] = []
    # A blow rings; the next one is looked for after 4 ms, where it stands out of the ringing.
    dead, next_free = round(4e-3 * sampling_rate_hz), 0
    for i in map(int, np.flatnonzero(rises)):
        if i < next_free:
            continue
        segment = np.abs(centred[i + n : i + n + dead])
        begin = i + n + int(np.argmax(segment > 0.25 * segment.max()))
        bursts.append(Burst(begin / sampling_rate_hz, float(segment.max())))
        next_free = i + dead
    hardest = max((burst.peak for burst in bursts), default=0.0)
    # Below a third of the hardest blow, teeth that merely take up their load are counted as well.
    return tuple(burst for burst in bursts if burst.peak >= 0.35 * hardest)
