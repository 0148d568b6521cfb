"""Motion of one shaft: segments forwards, backwards and at rest; starts, stops, reversals; signals over its angle."""

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
"""The first segment starts from rest if its mean speed in the first FIRST_S seconds is below this share of its top."""


@dataclass(frozen=True)
class MotionSegment:
    """A period in which a shaft turns in one direction, or is at rest.

    Parameters
    ----------
    direction : int
        1, −1, or 0 at rest.
    first, last : int
        Samples; the last is exclusive.
    start_s, end_s : float
    turned_rad : float
    top_speed_rad_s : float
        Maximum magnitude.
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
    """The segments of a recording, and their totals.

    Parameters
    ----------
    segments : tuple of MotionSegment
        Consecutive, without gaps.
    starts_at_once : bool
        Whether the shaft is at rest in the first sample and moves from then on: a start without a preceding rest.
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
        """Numbers of starts and stops in words, and whether the record begins or ends in motion."""
        counts = f"{counted(len(self.starts_s), 'start')} and {counted(len(self.stops_s), 'stop')}"
        moves = {"begins": self.segments[0].direction and not self.starts_at_once, "ends": self.segments[-1].direction}
        ends = [name for name, is_moving in moves.items() if is_moving]
        return f"{counts} in a record that {' and '.join(ends)} in motion" if ends else counts

    @property
    def n_reversals(self) -> int:
        """Number of changes of direction, with or without a rest between."""
        return sum(a.direction != b.direction for a, b in pairwise(self.moving))

    @property
    def standing_part(self) -> float:
        """Fraction of the time at rest."""
        total = sum(s.duration_s for s in self.segments)
        return sum(s.duration_s for s in self.segments if not s.direction) / total

    @property
    def top_speed_rpm(self) -> float:
        """Maximum speed of all segments; 0 if nothing turns."""
        return max((s.top_speed_rad_s for s in self.moving), default=0.0) * 30.0 / np.pi

    @property
    def backwards_rad(self) -> float:
        """Angle turned against the predominant direction."""
        turned = [sum(abs(s.turned_rad) for s in self.segments if s.direction == d) for d in (1, -1)]
        return float(min(turned))

    def _pairs(self) -> list[tuple[MotionSegment, MotionSegment]]:
        return list(pairwise(self.segments))


def motion_segments(
    angle_rad: FloatArray, sampling_rate_hz: float, speed_rad_s: FloatArray | None = None
) -> MotionSegments:
    """Divide a shaft's motion into segments forwards, backwards and at rest.

    The shaft is at rest if its speed is below 2 % of the 95 % quantile, or within five standard deviations of its
    sample-to-sample noise, for at least 30 ms. A segment that turns by less than 2 % of the longest is also rest.

    Parameters
    ----------
    angle_rad : array, (n,)
        Continuous.
    sampling_rate_hz : float
    speed_rad_s : array, (n,), or None
        None: derived from the angle up to 50 Hz, see `shaft_speed_rad_s`.

    Raises
    ------
    InputError
        If the lengths differ, or there are fewer than 8 samples.
    """
    positive(sampling_rate_hz, "sampling_rate_hz", "Hz")
    if speed_rad_s is None:
        speed_rad_s = shaft_speed_rad_s(angle_rad, sampling_rate_hz)
    if len(angle_rad) != len(speed_rad_s) or len(speed_rad_s) < 8:
        raise InputError(f"{len(angle_rad)} angles for {len(speed_rad_s)} speeds", allowed="equal numbers, at least 8")
    scatter = median_deviation(np.diff(speed_rad_s, 2)) / np.sqrt(6.0)
    threshold = max(0.02 * float(np.quantile(np.abs(speed_rad_s), 0.95)), 5.0 * scatter, 1e-12)
    directions = np.where(np.abs(speed_rad_s) < threshold, 0, np.sign(speed_rad_s)).astype(np.int64)
    # A shorter rest is the turning point of an oscillation, a shorter motion a tremor.
    shortest = max(2, round(0.03 * sampling_rate_hz))
    _absorb(directions, shortest)
    segments = _cut(directions, angle_rad, speed_rad_s, sampling_rate_hz)
    # A segment that turns by less than 2 % of the longest is a machine at rest that is struck, not started.
    min_turned_rad = 0.02 * max(abs(s.turned_rad) for s in segments)
    for segment in segments:
        if abs(segment.turned_rad) < min_turned_rad:
            directions[segment.first : segment.last] = 0
    final = _cut(directions, angle_rad, speed_rad_s, sampling_rate_hz)
    return MotionSegments(final, _starts_at_once(final[0], angle_rad, sampling_rate_hz))


def is_start_stop(segments: MotionSegments) -> bool:
    """Whether a motion starts and stops, or reverses, so that it has no speed for orders.

    Not so for a run-up from rest, which can be tracked in revolutions, or for less than 5 % of the time at rest or
    0.1 rad turned backwards.
    """
    rests = bool(segments.starts_s) and bool(segments.stops_s) and segments.standing_part >= 0.05
    return rests or segments.backwards_rad >= 0.1


def _starts_at_once(first: MotionSegment, angle_rad: FloatArray, rate_hz: float) -> bool:
    """Whether the first segment moves and started with the record."""
    n = min(max(2, round(FIRST_S * rate_hz)), first.last - 1)
    speed = abs(float(angle_rad[n] - angle_rad[0])) * rate_hz / n
    return bool(first.direction) and speed < AT_ONCE * first.top_speed_rad_s


def _absorb(directions: np.ndarray, shortest: int) -> None:
    """Give runs that are too short the direction of the run before, shortest first; in place."""
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
    """Return the starts of runs of one direction, and the end of the last."""
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
    """A named period: `RUN_UP`, `RUNNING`, `RUN_DOWN` or `AT_REST`."""

    name: str
    start_s: float
    end_s: float


def shaft_speed_rad_s(angle_rad: FloatArray, sampling_rate_hz: float) -> FloatArray:
    """Return the speed of a shaft up to 50 Hz, (n,), from its angle."""
    # Starts and stops of a shaft are slower than 50 Hz; anything faster is ringing.
    smoother = local_polynomial(sampling_rate_hz, min(50.0, 0.1 * sampling_rate_hz))
    return smoother.apply(angle_rad, 1)


def find_phases(segments: MotionSegments, speed_rad_s: FloatArray, sampling_rate_hz: float) -> tuple[Phase, ...]:
    """Divide each moving segment where it first reaches, and where it last has, 90 % of its maximum speed.

    Parameters
    ----------
    segments : MotionSegments
    speed_rad_s : array, (n,)
        The smoothed speed that the segments were found from: with ringing, the result would be wrong.
    sampling_rate_hz : float

    Returns
    -------
    tuple of Phase
        Consecutive, from the start of the record to its end, without phases of zero length. A segment cut off by the
        end of the record has no run-down, and one cut off by its start no run-up.
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
    """Level of a signal in each tooth pitch of a shaft, separately for forward and backward motion.

    Parameters
    ----------
    n_teeth : int
    rms_forwards, rms_backwards : arrays, (n_teeth,)
        In the signal's unit; nan if a tooth was never passed in that direction.
    passes_forwards, passes_backwards : array of int, (n_teeth,)
    """

    n_teeth: int
    rms_forwards: FloatArray
    rms_backwards: FloatArray
    passes_forwards: NDArray[np.int64]
    passes_backwards: NDArray[np.int64]


def angle_profile(values: FloatArray, angle_rad: FloatArray, segments: MotionSegments, n_teeth: int) -> AngleProfile:
    """Return the RMS over angle of a signal within each tooth pitch.

    The angle itself assigns samples to teeth, so that stops within a tooth and reversals need no speed. Samples are
    weighted by the angle they cover, so that a slow passage counts no more than a fast one. Samples at rest are left
    out.

    Parameters
    ----------
    values : array, (n,)
    angle_rad : array, (n,)
        Of the shaft, continuous.
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
    """Return the order spectrum of all segments of one direction, at any speed.

    Each segment is divided into equal steps of angle that hold the signal's mean, ∫x dθ/Δθ: slow passages are averaged
    and do not alias, and motion from and to rest needs no speed. Blocks of whole steps are windowed (Hann), and their
    power is averaged over all segments.

    Parameters
    ----------
    values : array, (n,)
    angle_rad : array, (n,)
        Of the shaft, continuous.
    segments : MotionSegments
    direction : str
        "forwards" or "backwards"; orders are positive in both.
    revolutions_per_block : float
        Shorter segments are left out. The line spacing is its reciprocal.
    unit, source, shaft : str

    Returns
    -------
    Spectrum
        Over order, "amplitude peak".

    Raises
    ------
    InputError
        If the direction is unknown, or values and angles differ in number.
    RefusalError
        If no segment of that direction is long enough.

    Notes
    -----
    Phases differ between segments and are not kept. A resonance, which rings in time, is smeared over orders.
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
            f"no segment {direction} holds {revolutions_per_block:g} revolutions (the longest has {longest:.3g})",
            remedy="give fewer revolutions per block: the resolution is then coarser",
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
    """Steps of angle per revolution: as many as the fastest passage has samples."""
    step = max(float(np.quantile(np.abs(np.diff(angle_rad[s.first : s.last])), 0.99)) for s in segments)
    n_orders = floor(2.0 * np.pi / step)
    if n_orders < MIN_SAMPLES:
        raise RefusalError(
            f"the shaft turns by {step:.3g} rad between samples: {n_orders} samples per revolution",
            remedy="record at a higher rate",
        )
    return n_orders


def _mean(spectra: list[Spectrum], per_revolution: int, unit: str, source: str, shaft: str) -> Spectrum:
    """Mean power of the segments, as amplitude over order, corrected for the attenuation of the steps' means."""
    weights = np.array([s.n_averages for s in spectra], dtype=np.float64)
    power = np.average([s.values for s in spectra], axis=0, weights=weights)
    first = spectra[0]
    # At a quarter of the samples per revolution the mean over a step attenuates by a tenth, which is corrected.
    keep = first.positions <= 0.25 * per_revolution
    lost = np.sinc(first.positions[keep] / per_revolution)
    amplitude = np.sqrt(2.0 * power[keep]) / lost
    amplitude[0] /= np.sqrt(2.0)  # the amplitude of a mean is its value
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
    """A burst: time of its onset and maximum magnitude in its first milliseconds."""

    time_s: float
    peak: float


def find_bursts(values: FloatArray, sampling_rate_hz: float) -> tuple[Burst, ...]:
    """Find where a vibration rises suddenly, far above its quiet level.

    Bursts below 35 % of the hardest are left out. The level is the RMS over 2 ms; the quiet level is its 20 % quantile,
    which exists for machines that rest at times.

    Raises
    ------
    InputError
        If the rate is below 2 kHz, where a burst would be a single sample, or the record is shorter than 40 ms.
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
    # White noise does not reach 8 times the quiet level in an hour; an impact rises suddenly, ringing does not.
    rises = (ahead > 8.0 * quiet) & (ahead > 2.0 * behind)
    bursts: list[Burst] = []
    # An impact rings; look for the next one after 4 ms, where it exceeds the ringing.
    dead, next_free = round(4e-3 * sampling_rate_hz), 0
    for i in map(int, np.flatnonzero(rises)):
        if i < next_free:
            continue
        segment = np.abs(centred[i + n : i + n + dead])
        begin = i + n + int(np.argmax(segment > 0.25 * segment.max()))
        bursts.append(Burst(begin / sampling_rate_hz, float(segment.max())))
        next_free = i + dead
    hardest = max((burst.peak for burst in bursts), default=0.0)
    # Below a third of the hardest burst, teeth that only take up their load would be counted, too.
    return tuple(burst for burst in bursts if burst.peak >= 0.35 * hardest)
