"""The comb of orders that a gear train causes in a spectrum: mesh harmonics, sidebands, shaft harmonics."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gearsig.angle._types import ShaftAngle
from gearsig.checks import ComplexArray, FloatArray, listed, positive
from gearsig.compiled import njit
from gearsig.errors import InputError, RefusalError
from gearsig.peaks import parabola_vertex
from gearsig.recording import Recording, check_recording
from gearsig.rig import Rig, check_rig, shaft_ratios

N_MESH_HARMONICS = 5
N_SIDEBANDS = 2
N_SHAFT_HARMONICS = 3
IntArray = NDArray[np.integer[Any]]
BoolArray = NDArray[np.bool_]
Stages = tuple[tuple[float, tuple[float, ...]], ...]

# Probabilities that a line of the comb is present. They distinguish a speed from half of it: low harmonics and near
# sidebands are more likely.
PRESENCE = (0.8, 0.6, 0.4, 0.25)
_MESH_CLASSES = (0, 1, 2, 2, 3)
_SIDEBAND_CLASSES = (1, 3)
_SHAFT_CLASSES = (1, 2, 3)

_SAME = 0.02  # orders closer than this are one line


@dataclass(frozen=True)
class CombLines:
    """Orders of the reference shaft at which a gear train causes lines.

    Parameters
    ----------
    orders : array, (n_lines,)
    presence : array of int, (n_lines,)
        Index into `PRESENCE`, the probability that each line is present.
    is_mesh : array of bool, (n_lines,)
        True for mesh harmonics; the others are sidebands and shaft harmonics, which determine the scale of the speed.
    stages : tuple of (float, tuple of float)
        Mesh order and orders of the shafts in mesh, per stage.
    """

    orders: FloatArray
    presence: IntArray
    is_mesh: BoolArray
    stages: Stages

    @property
    def meshes(self) -> tuple[float, ...]:
        """Fundamental mesh orders, lowest first."""
        return tuple(sorted({m for m, _ in self.stages}))

    @property
    def mesh_harmonics(self) -> tuple[float, ...]:
        """First three harmonics of each mesh order."""
        return tuple(k * m for m in self.meshes for k in (1, 2, 3))

    @property
    def highest(self) -> float:
        """Highest order of the comb."""
        return float(self.orders.max())


def comb_of_rig(rig: Rig) -> CombLines | None:
    """Return the comb of a rig; None if no mesh order is known.

    It includes each mesh that can be related to the reference shaft, with sidebands of the shafts whose ratio is known.
    """
    ratios = shaft_ratios(rig)
    known = [(p, m) for p in rig.pairs if (m := rig.mesh_order(p)) is not None]
    if not known:
        return None
    stages = [(m, tuple(ratios[s] for s in (p.driver, p.driven) if s in ratios)) for p, m in known]
    return comb_of_stages(tuple(stages))


@lru_cache(maxsize=64)
def comb_of_stages(stages: Stages) -> CombLines:
    """Return the comb of stages, given as (mesh order, shaft orders) each."""
    turning = {round(s, 9) for _, shafts in stages for s in shafts}
    lines = [(k * m, _MESH_CLASSES[k - 1]) for m, _ in stages for k in range(1, N_MESH_HARMONICS + 1)]
    n_mesh = len(lines)
    lines += [(k * s, _SHAFT_CLASSES[k - 1]) for s in turning for k in range(1, N_SHAFT_HARMONICS + 1)]
    lines += [
        (k * m + sign * j * shaft, _SIDEBAND_CLASSES[j - 1])
        for m, shafts in stages
        for k in range(1, N_MESH_HARMONICS)
        for shaft in shafts
        for j in range(1, N_SIDEBANDS + 1)
        for sign in (-1, 1)
    ]
    orders: list[float] = []
    classes: list[int] = []
    is_mesh: list[bool] = []
    # If two lines coincide, the more likely one counts: mesh harmonics first, then by class.
    ranked = sorted(enumerate(lines), key=lambda item: (item[0] >= n_mesh, item[1][1], item[1][0]))
    taken: list[float] = []  # sorted
    for place, (order, presence) in ranked:
        at = bisect_left(taken, order)
        if order > 0.05 and all(abs(order - neighbour) > _SAME for neighbour in taken[max(at - 1, 0) : at + 1]):
            taken.insert(at, order)
            orders.append(order)
            classes.append(presence)
            is_mesh.append(place < n_mesh)
    return CombLines(np.array(orders), np.array(classes), np.array(is_mesh), stages)


def with_other_teeth(comb: CombLines) -> list[CombLines]:
    """Return the combs of the same shafts with one to four teeth more or fewer on each stage's first gear.

    A harmonic series without a mesh, such as a bearing's, fits all of them equally well.
    """
    combs = []
    for change in (-4, -3, -2, -1, 1, 2, 3, 4):
        stages = tuple((m + change * (shafts[0] if shafts else 1.0), shafts) for m, shafts in comb.stages)
        if all(m > 0 for m, _ in stages):
            combs.append(comb_of_stages(stages))
    return combs


# Evidence for a line at each frequency: height over the local floor, converted by rank to a log likelihood ratio.


@dataclass(frozen=True)
class LineEvidence:
    """Log likelihood ratio for "a line of the comb is here" in each interval between two bins.

    Parameters
    ----------
    ratios : array, (n_classes, n_intervals)
        For each class of `PRESENCE`; interval i spans i to i + 1 bins.
    log_ratio : array, (n_bins,)
        ln(power / floor), mean over the channels.
    bin_width : float
        In Hz or orders.
    top : float
        Upper limit of the range considered.
    """

    ratios: FloatArray
    log_ratio: FloatArray
    bin_width: float
    top: float


def line_evidence(
    samples: FloatArray,
    rate: float,
    n_segment: int,
    top: float,
    reach: float = np.inf,
    transforms: Sequence[ComplexArray] = (),
) -> LineEvidence:
    """Return the evidence for lines in all channels together.

    Power is averaged over half-overlapping Hann windows of `n_segment` samples, and log heights over the floor are
    averaged over the channels. Computed in the samples' precision, at least single: rounding stays below that of the
    samples.

    Parameters
    ----------
    samples : array, (n_channels, n_samples)
    rate : float
        Samples per second, or per revolution.
    n_segment : int
        Shortened slightly to a fast FFT length.
    top : float
        In the unit of `rate`.
    reach : float
        Upper limit of the evidence returned, in the same unit; a line is still ranked among all lines.
    transforms : sequence of arrays
        The `rfft` of each channel, if known and the segment is the whole of it.
    """
    from scipy.fft import prev_fast_len

    n_segment = n_segment if transforms else prev_fast_len(n_segment, real=True)
    n_keep = min(n_segment // 2, int(top / rate * n_segment) + 4)
    powers = map(_windowed_power, transforms) if transforms else (_mean_power(row, n_segment) for row in samples)
    ratios = [_log_ratio(power[:n_keep]) for power in powers]
    log_ratio = np.mean(ratios, axis=0)
    height = _interval_heights(log_ratio)
    high = np.flatnonzero(height)
    positive = height[high]
    order = np.argsort(positive)
    ascending = positive[order]
    first = np.maximum.accumulate(np.where(np.diff(ascending, prepend=-1.0) > 0.0, np.arange(len(order)), 0))
    rank = np.empty(len(order))
    rank[order] = (len(order) - first) / len(height)
    # A line that is present is among the top ranks q, with density a·q^(a-1), a = 0.3. ln(1 - p + p·a·q^(a-1)): a
    # missing line costs little, a line of high rank adds much, and none decides alone.
    n_asked = int(min(len(height), reach / rate * n_segment + 2))
    high = high[: np.searchsorted(high, n_asked)]
    density = 0.3 * rank[: len(high)] ** (0.3 - 1.0)
    likelihoods = np.empty((len(PRESENCE), n_asked), log_ratio.dtype)
    for row, present in zip(likelihoods, PRESENCE, strict=True):
        row[:] = np.log(1.0 - present + present * 0.3)  # rank 1: everything that is not a peak
        row[high] = np.log(1.0 - present + present * density)
    return LineEvidence(likelihoods, log_ratio, rate / n_segment, top)


def _interval_heights(x: FloatArray) -> FloatArray:
    """Return the height of the higher end of each interval between two bins; 0 where neither is a line.

    The skirts of a line are not lines: only the largest bin within two bins on either side counts. A candidate may thus
    miss a line's centre by half a bin.
    """
    beyond = np.pad(x, 2, mode="edge")
    pairs = np.maximum(beyond[:-1], beyond[1:])
    largest = np.maximum(np.maximum(pairs[:-3], pairs[2:-1]), beyond[4:])  # of five
    lines = np.where(x >= largest, x, 0.0)
    return np.maximum(np.maximum(lines[:-1], lines[1:]), 0.0)


def _mean_power(x: FloatArray, n_segment: int) -> FloatArray:
    from scipy.fft import rfft

    precision = np.result_type(x.dtype, np.float32)
    window = _hann(n_segment, precision)
    step = max(1, n_segment // 2)
    power = np.zeros(n_segment // 2 + 1, precision)
    for start in range(0, len(x) - n_segment + 1, step):
        segment = x[start : start + n_segment]
        lines = rfft((segment - segment.mean(dtype=np.float64)).astype(precision) * window, overwrite_x=True)
        power += lines.real**2 + lines.imag**2
    return power


def _windowed_power(lines: ComplexArray) -> FloatArray:
    """Return the power under a Hann window, without the mean, from the `rfft` of all samples, but for the last line.

    A cosine in time shifts the lines by one either way: half of each less a quarter of its neighbours.
    """
    beside = np.concatenate([lines[1:2].conj(), [0.0], lines[1:]], dtype=lines.dtype)
    windowed = 0.5 * beside[1:-1] - 0.25 * (beside[:-2] + beside[2:])
    power: FloatArray = windowed.real**2 + windowed.imag**2
    return power


@lru_cache(maxsize=1)  # blocks of the same length follow each other
def _hann(n: int, precision: np.dtype[Any]) -> FloatArray:
    window: FloatArray = 0.5 - 0.5 * np.cos(np.arange(n, dtype=precision) * precision.type(2 * np.pi / n))
    return window


def _log_ratio(power: FloatArray) -> FloatArray:
    """Return ln(power/floor), with the floor from medians of blocks of 96 bins, interpolated linearly in decibels.

    Values are clipped at 9, i.e. 39 dB: a higher line is no stronger evidence of a line.
    """
    tiny = max(float(power.max()) * 1e-24, float(np.finfo(power.dtype).tiny))
    log_power = np.log(np.maximum(power, tiny))
    length = min(96, len(power))
    n_blocks = len(power) // length
    # Vector instructions sort such short rows ten times as fast as they are partitioned.
    ascending = np.sort(log_power[: n_blocks * length].reshape(n_blocks, length), axis=1)
    medians = ascending[:, (length - 1) // 2 : length // 2 + 1].mean(axis=1)
    middles = (np.arange(n_blocks) + 0.5) * length
    over: FloatArray = log_power - np.interp(np.arange(len(power)), middles, medians).astype(power.dtype)
    return np.clip(over, -2.0, 9.0)


# Scores of comb candidates over speed, and the distribution of the best score by chance.


def candidate_speeds(low: float, high: float, comb: CombLines, evidence: LineEvidence) -> FloatArray:
    """Return speeds at equal ratios, spaced so that the highest line considered moves by one bin per step."""
    # Lines above the top are ignored, so the highest line moves by at most as much as the top.
    step = evidence.bin_width / min(comb.highest * high, evidence.top)
    n = int(np.clip(np.ceil(np.log(high / low) / step), 2, 4_000_000))
    return np.geomspace(low, high, n + 1)


def score_speeds(
    evidence: LineEvidence, comb: CombLines, speeds: FloatArray, orders: FloatArray | None = None
) -> FloatArray:
    """Return the score of each speed, the sum of its lines' log likelihood ratios; `orders` replaces the comb's."""
    scores = np.empty(len(speeds))
    orders, speeds = comb.orders if orders is None else orders, np.ascontiguousarray(speeds)
    _score(evidence.ratios, 1.0 / evidence.bin_width, evidence.top, orders, comb.presence, comb.is_mesh, speeds, scores)
    return scores


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator,unused-ignore]
def _score(ratios, per_bin, top, orders, presence, is_mesh, speeds, out):  # type: ignore[no-untyped-def]
    """out[i] = Σ of the log likelihood ratios at order · speed, over the lines below top."""
    limit = min(int(top * per_bin), ratios.shape[1] - 1)
    for i in range(speeds.shape[0]):
        total = 0.0
        # Sidebands closer than four bins to their mesh line cannot be resolved.
        resolved = speeds[i] * per_bin >= 4.0
        for j in range(orders.shape[0]):
            k = int(orders[j] * speeds[i] * per_bin)
            if k < limit and (is_mesh[j] or resolved):
                total += ratios[presence[j], k]
        out[i] = total


# Whether the best comb is the true one, compared with chance, other speeds and other teeth.


# Ranges narrower than this ratio come from a known nominal speed, so that the scale of the speed is certain.
NARROW = 1.35

FARTHEST_MOVED = 0.12
"""Maximum log shift (about 12 %) of a line in a random comb."""


@dataclass(frozen=True)
class CombDecision:
    """The best comb, and the evidence for and against it.

    Parameters
    ----------
    speed : float
        In the unit of the evidence: rev/s, or relative speed.
    score : float
        Sum of log likelihood ratios.
    chance_mean, chance_deviation : float
        Mean and standard deviation of the best score of random combs.
    runner_up_speed, runner_up_score : float
        Best other speed and its score.
    other_teeth_score : float
        Best score of the same shafts with other teeth.
    side_score : float
        Part of the score from sidebands and shaft harmonics.
    narrow : bool
        Whether the search range was narrow enough to fix the scale of the speed.
    bin_width : float
        Bin width of the spectrum in which it was found.
    coverage : float
        Share of the recording in which the comb lies where a varying angle predicts it.
    """

    speed: float
    score: float
    chance_mean: float
    chance_deviation: float
    runner_up_speed: float
    runner_up_score: float
    other_teeth_score: float
    side_score: float
    narrow: bool
    bin_width: float
    coverage: float = 1.0

    @property
    def significance(self) -> float:
        """Score over chance, in standard deviations."""
        return (self.score - self.chance_mean) / self.chance_deviation

    @property
    def quality(self) -> float:
        """0 to 1: product of the confidences against chance, another speed and other teeth.

        The scales were set on simulated and measured recordings, see the tests; they are not theoretical probabilities.
        """
        parts = [_sure(self.significance, 4.0, 3.0), _sure(self.score - self.runner_up_score, 2.0, 4.0)]
        parts.append(_sure(self.score - self.other_teeth_score, 2.0, 4.0))
        if not self.narrow:
            # Mesh lines alone fit any number of teeth at another speed; sidebands determine the scale.
            parts.append(_sure(self.side_score, 2.0, 4.0))
        # An angle that is correct only most of the time is not fit for averaging.
        parts.append(self.coverage**12)
        return float(np.prod(parts))

    @property
    def rank(self) -> tuple[bool, float]:
        """Sort key: any trustworthy decision ranks above all others, then the score counts."""
        return self.quality >= MIN_QUALITY, self.score

    def evidence(self, unit: str = "rev/s") -> str:
        """Return the scores in one sentence."""
        return (
            f"best comb at {self.speed:.5g} {unit}: score {self.score:.1f}, by chance {self.chance_mean:.1f} ± "
            f"{self.chance_deviation:.1f}, next best speed ({self.runner_up_speed / self.speed:.4g} times) "
            f"{self.runner_up_score:.1f}, other teeth {self.other_teeth_score:.1f}"
        )


def decide(evidence: LineEvidence, comb: CombLines, low: float, high: float) -> CombDecision:
    """Find the best comb between `low` and `high` and compare it with chance, other speeds and other teeth.

    Chance is represented by random combs: each line is moved by its own random share of up to ± 12 %, which keeps the
    number and spread of the lines but not their harmonic relation. They are searched over the same range, which
    accounts for its many trials.
    """
    speeds = candidate_speeds(low, high, comb, evidence)
    scores = score_speeds(evidence, comb, speeds)
    best = int(np.argmax(scores))
    speed = refine_speed(evidence, comb, float(speeds[best]))
    # Within three bins of the lowest mesh line it is the same comb; for a slow machine these reach down to zero.
    same = min(1.0, 3.0 * evidence.bin_width / (comb.meshes[0] * speed))
    elsewhere = np.where(np.abs(speeds / speed - 1.0) > same, scores, -np.inf)
    runner_up = int(np.argmax(elsewhere))
    rng = np.random.default_rng(20_230_501)  # fixed: the same recording gives the same answer
    tried = speeds if len(speeds) <= 200_000 else speeds[:: len(speeds) // 200_000 + 1]
    moved = [comb.orders * np.exp(rng.uniform(-FARTHEST_MOVED, FARTHEST_MOVED, len(comb.orders))) for _ in range(16)]
    chance = [float(score_speeds(evidence, comb, tried, orders).max()) for orders in moved]
    around = (speed * (1 - same / 2), speed * (1 + same / 2))
    teeth = (score_speeds(evidence, c, candidate_speeds(*around, c, evidence)).max() for c in with_other_teeth(comb))
    places = (comb.orders * speed / evidence.bin_width).astype(int)
    side = ~comb.is_mesh & (places < evidence.ratios.shape[1]) & (places * evidence.bin_width < evidence.top)
    return CombDecision(
        speed=speed,
        score=float(scores[best]),
        chance_mean=float(np.mean(chance)),
        chance_deviation=max(float(np.std(chance, ddof=1)), 1.0),
        runner_up_speed=float(speeds[runner_up]) if np.isfinite(elsewhere[runner_up]) else 0.0,
        runner_up_score=float(elsewhere[runner_up]),
        other_teeth_score=max((float(score) for score in teeth), default=-np.inf),
        side_score=float(evidence.ratios[comb.presence[side], places[side]].sum()),
        narrow=high / low <= NARROW,
        bin_width=evidence.bin_width,
    )


def refine_speed(evidence: LineEvidence, comb: CombLines, speed: float) -> float:
    """Refine a speed from the centres of the lines that are present.

    Parabolas through the logarithm of each line's three highest bins give its frequency; the speed is the least-squares
    slope of frequency over order, weighted by the lines' heights, without lines off by more than 1.5 bins.
    """
    lines = [
        (order, place, height)
        for order in comb.orders
        if order * speed < evidence.top and (line := _line_at(evidence, order * speed)) is not None
        for place, height in (line,)
    ]
    if not lines:
        return speed
    orders, places, weights = np.array(lines).T
    refined = speed
    for _ in range(3):
        near = np.abs(places - orders * refined) < 1.5 * evidence.bin_width
        if not near.any():
            return speed
        weight = weights[near]
        refined = float((weight * orders[near]) @ places[near] / ((weight * orders[near]) @ orders[near]))
    return refined


def _line_at(evidence: LineEvidence, position: float) -> tuple[float, float] | None:
    """Return position and height of the line within about a bin of `position`; None if nothing stands out."""
    x = evidence.log_ratio
    k = int(np.floor(position / evidence.bin_width))
    if k < 2 or k + 3 >= len(x):
        return None
    p = k - 1 + int(np.argmax(x[k - 1 : k + 3]))
    if x[p] < 3.0 or x[p] < x[p - 1] or x[p] < x[p + 1]:
        return None
    offset, _ = parabola_vertex(*x[p - 1 : p + 2])
    return float((p + offset) * evidence.bin_width), float(x[p])


def _sure(value: float, zero: float, scale: float) -> float:
    return 1.0 - float(np.exp(-max(0.0, value - zero) / scale))


# Scope of the search when the speed is estimated from the vibration.


MIN_QUALITY = 0.5
"""Quality below which no speed is reported: on simulated and measured recordings, hardly any wrong speed exceeds it."""

CLEAR = 0.9
"""Quality of the best decision so far beyond which no other block length is tried."""

TOP = 0.45
"""Upper limit of the analysis relative to the sampling rate; above it, the recorder's anti-aliasing filter acts."""

_WIDEST_RPM = (30.0, 30_000.0)
_MIN_REVOLUTIONS = 20.0
_DIVISIONS = (1, 4, 16)  # of the recording's length: long segments for steady lines, short ones for wandering lines


@dataclass(frozen=True)
class SpeedSearch:
    """Data, comb and speed range (rev/s) of a search for the speed; the channels' `rfft`, if known."""

    recording: Recording
    channels: tuple[str, ...]
    samples: FloatArray
    comb: CombLines
    shaft: str
    low: float
    high: float
    transforms: tuple[ComplexArray, ...] = ()


def search_of(
    recording: Recording,
    rig: Rig,
    channels: Sequence[str] | None,
    speed_range_rpm: tuple[float, float] | None,
    transform: Callable[[str], ComplexArray] | None = None,
) -> SpeedSearch:
    """Check the basis of the search (teeth, channels with a signal, a speed range with enough revolutions)."""
    check_recording(recording)
    check_rig(rig, needed=True)
    comb = comb_of_rig(rig)
    if comb is None:
        raise RefusalError(
            "no mesh order is known: the speed cannot be read from mesh lines",
            remedy="give the teeth of at least one gear on a shaft whose ratio is known, or a speed source",
        )
    names = listed(channels, "channels", str) if channels is not None else recording.vibration_names()
    rows = [recording.index(name) for name in names]
    alive = [i for i in rows if float(np.ptp(recording.samples[i])) > 0.0]
    if not alive:
        raise RefusalError("all vibration channels are constant", remedy="check sensors and channel quantities")
    low, high = _range(recording, rig, comb, speed_range_rpm)
    used = tuple(recording.channel_names[i] for i in alive)
    transforms = () if transform is None else tuple(transform(name) for name in used)
    return SpeedSearch(
        recording,
        used,
        recording.samples[alive],
        comb,
        rig.reference_shaft,
        low,
        high,
        transforms if all(len(lines) == recording.n_samples // 2 + 1 for lines in transforms) else (),
    )


def _range(
    recording: Recording, rig: Rig, comb: CombLines, speed_range_rpm: tuple[float, float] | None
) -> tuple[float, float]:
    """Return the lowest and highest speed of the search in rev/s."""
    nominal = rig.nominal_speed_rpm()
    if speed_range_rpm is not None:
        low, high = (positive(v, "speed_range_rpm", "rpm") / 60.0 for v in speed_range_rpm)
        if not low < high:
            raise InputError(f"speed_range_rpm is {speed_range_rpm}", allowed="(low, high) with low < high")
    elif nominal is not None:
        if nominal == 0.0:
            raise RefusalError("the machine is at rest: its nominal speed is 0 rpm", remedy="record while it turns")
        share = rig.operating_point.speed_tolerance_percent / 100.0
        low, high = nominal * (1 - share) / 60.0, nominal * (1 + share) / 60.0
    else:
        low, high = (v / 60.0 for v in _WIDEST_RPM)
        low = max(low, _MIN_REVOLUTIONS / recording.duration_s)
    high = min(high, TOP * recording.sampling_rate_hz / comb.meshes[0])
    if high * recording.duration_s < _MIN_REVOLUTIONS or low >= high:
        raise RefusalError(
            f"within {recording.duration_s:.3g} s at {recording.sampling_rate_hz:.6g} Hz there are fewer than "
            f"{_MIN_REVOLUTIONS:.0f} revolutions with a mesh line below {TOP * recording.sampling_rate_hz:.4g} Hz "
            f"at {60 * low:.4g} to {60 * high:.4g} rpm",
            remedy="record longer or with a higher sampling rate, or check speed and teeth",
        )
    return low, high


@dataclass(frozen=True)
class SpeedCandidate:
    """An angle, and the decision on its comb."""

    angle: ShaftAngle
    decision: CombDecision


def best_decision(
    samples: FloatArray, rate: float, comb: CombLines, low: float, high: float, transforms: Sequence[ComplexArray] = ()
) -> CombDecision | None:
    """Return the best decision on the comb over spectra of several resolutions; None if the samples are too few.

    `rate` is in samples per second, or per revolution; `low` and `high` accordingly. `transforms` are the rows' `rfft`,
    if known.
    """
    best: CombDecision | None = None
    # Random combs and combs with other teeth extend further up.
    reach = high * max(np.exp(FARTHEST_MOVED) * comb.highest, *(c.highest for c in with_other_teeth(comb)), 0.0)
    for n in (samples.shape[1] // d for d in _DIVISIONS):
        # Sidebands must be at least four bins from the mesh line.
        if n >= 256 and high * n / rate > 4.0:
            known = transforms if n == samples.shape[1] else ()
            decision = decide(line_evidence(samples, rate, n, TOP * rate, reach, known), comb, low, high)
            if best is None or decision.rank > best.rank:
                best = decision
            if best.quality >= CLEAR:
                break
    return best
