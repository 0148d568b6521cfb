"""Shaft angle without a tachometer, from the lines that gears cause in the vibration."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gearsig.angle._comb import (
    CLEAR,
    MIN_QUALITY,
    NARROW,
    TOP,
    CombLines,
    SpeedCandidate,
    SpeedSearch,
    best_decision,
    candidate_speeds,
    line_evidence,
    score_speeds,
    search_of,
)
from gearsig.angle._resample import resample_to_angle, times_of_revolutions
from gearsig.angle._types import AngleSignal, ShaftAngle, monotone_slopes
from gearsig.checks import ComplexArray, FloatArray, positive
from gearsig.errors import InputError, RefusalError
from gearsig.recording import Recording
from gearsig.rig import Rig

# Speed over time from short-time comb scores: the path with the highest score that does not jump.


def track_speed(
    samples: FloatArray, rate: float, comb: CombLines, low: float, high: float, n_block: int, change: float
) -> tuple[FloatArray, FloatArray]:
    """Return the most likely speed profile: times of the blocks' middles, and the speed there, (n_blocks,) each.

    `change` is the standard deviation of the change of log speed from block to block; σ is at least six steps of the
    grid. Half-overlapping blocks are scored for all speeds; the path maximises Σ score - Σ min((Δ ln
    speed)²/(2σ²), 20), found by dynamic programming over the 200 best candidates of each block (A. J. Viterbi, *Error
    bounds for convolutional codes …*, IEEE Trans. Inf. Theory 13 (1967)). The limit of 20 keeps a few blocks without
    lines from determining the rest.
    """
    starts = np.arange(0, samples.shape[1] - n_block + 1, max(1, n_block // 2))
    reach = comb.highest * high
    blocks = (samples[:, start : start + n_block] for start in starts)
    evidence = [line_evidence(block, rate, n_block, TOP * rate, reach) for block in blocks]
    speeds = candidate_speeds(low, high, comb, evidence[0])
    scores = np.array([score_speeds(e, comb, speeds) for e in evidence])
    inner = scores[:, 1:-1]
    peaks = np.full(scores.shape, -np.inf)
    peaks[:, 1:-1] = np.where((inner >= scores[:, :-2]) & (inner >= scores[:, 2:]), inner, inner - 1e6)
    n_kept = min(200, scores.shape[1])
    kept = np.argpartition(peaks, -n_kept, axis=1)[:, -n_kept:]
    sigma = max(6.0 * float(np.log(speeds[1] / speeds[0])), change)
    path = _best_path(np.log(speeds)[kept] / sigma, np.take_along_axis(scores, kept, axis=1), 20.0)
    return (starts + n_block / 2) / rate, speeds[kept[np.arange(len(path)), path]]


def _best_path(places: FloatArray, scores: FloatArray, highest_cost: float) -> list[int]:
    """Return the candidate per block on the path with the highest Σ score - Σ min((Δ place)²/2, highest_cost)."""
    total, came_from = scores[0], []
    for before, here, score in zip(places[:-1], places[1:], scores[1:], strict=True):
        values = total - np.minimum(0.5 * (here[:, None] - before) ** 2, highest_cost)
        came_from.append(values.argmax(axis=1))
        total = values.max(axis=1) + score
    path = [int(np.argmax(total))]
    for came in reversed(came_from):
        path.append(int(came[path[-1]]))
    return path[::-1]


# Refinement of a rough shaft angle by the phase of mesh harmonics.


_PER_WIDTH = 4  # points per reciprocal half width; the sampling theorem requires two


@dataclass(frozen=True)
class _Harmonic:
    """Baseband of one mesh harmonic in all channels, (n_channels, n), its prominence, and its sampling step."""

    order: float
    baseband: FloatArray
    ratio: float
    step_rev: float


def refine_by_phase(
    recording: Recording,
    channels: tuple[str, ...],
    angle: ShaftAngle,
    orders: tuple[float, ...],
    *,
    transforms: Sequence[ComplexArray] = (),
) -> ShaftAngle:
    """Return the angle over which the strongest mesh harmonics have constant phase.

    Over the estimated angle, a harmonic of order o has the phase 2πo(θ_true - θ), so θ_true = θ + phase/(2πo). Phase
    steps from sample to sample are summed over all channels; harmonics are weighted by o² times their height over the
    neighbourhood. This is repeated, each time over a better angle and finally with narrower bands.

    Parameters
    ----------
    recording : Recording
    channels : tuple of str
    angle : ShaftAngle
        Wrong by less than half an order at the mesh harmonic, i.e. 2 % for 23 teeth.
    orders : tuple of float
        Mesh harmonics.
    transforms : sequence of arrays
        The `rfft` of each channel, if known.

    Notes
    -----
    Source: F. Bonnardot, M. El Badaoui, R. B. Randall, J. Danière, F. Guillet, *Use of the acceleration signal of a
    gearbox in order to perform angular resampling*, Mech. Syst. Signal Process. 19 (2005); J. Urbanek, T. Barszcz, J.
    Antoni, *A two-step procedure for estimation of instantaneous rotational speed with large fluctuations*, ibid. 38
    (2013).
    """
    if orders:
        highest_hz = (max(orders) + 2.0) * angle.speed_range_rpm[1] / 60.0
        recording = _thinned(recording, channels, highest_hz, transforms)
    # In orders of the shaft around the mesh order: below one, so that the shaft's sidebands stay outside.
    for half_width in (0.45, 0.45, 0.3, 0.2):
        refined = _refined_once(recording, channels, angle, orders, half_width)
        if refined is None:
            return angle
        angle = refined
    return angle


def _thinned(
    recording: Recording, channels: tuple[str, ...], highest_hz: float, transforms: Sequence[ComplexArray]
) -> Recording:
    """Return the channels decimated to 3.5 times the highest frequency of interest, if that halves the rate or more."""
    from scipy.fft import irfft, next_fast_len, rfft

    n, rate = recording.n_samples, recording.sampling_rate_hz
    n_padded = n if transforms else next_fast_len(n, real=True)
    n_thin = next_fast_len(math.ceil(3.5 * highest_hz / rate * n_padded), real=True)
    if n_thin > n_padded / 2:
        return recording
    hertz = np.arange(n_thin // 2 + 1) * rate / n_padded
    kept = np.clip((hertz[-1] - hertz) / (hertz[-1] - 1.2 * highest_hz), 0.0, 1.0)
    response = n_thin / n_padded * np.sin(np.pi / 2 * kept) ** 2
    thin = np.empty((len(channels), n * n_thin // n_padded))
    known = transforms or (rfft(recording.values(name), n_padded) for name in channels)  # in the samples' precision
    for lines, row in zip(known, thin, strict=True):
        row[:] = irfft(lines[: len(response)] * response, n_thin, overwrite_x=True)[: len(row)]
    return replace(recording.select(channels), samples=thin, sampling_rate_hz=rate * n_thin / n_padded)


def _refined_once(
    recording: Recording, channels: tuple[str, ...], angle: ShaftAngle, orders: tuple[float, ...], half_width: float
) -> ShaftAngle | None:
    from scipy.fft import next_fast_len, rfft

    top_speed = angle.speed_range_rpm[1] / 60.0
    usable = [o for o in orders if (o + 1) * top_speed < 0.4 * recording.sampling_rate_hz]
    if not usable:
        return None
    try:
        signal = resample_to_angle(recording, angle, channels=channels, highest_order=max(usable) + 2.0)
    except RefusalError:
        return None
    n_per_rev, n_samples = signal.samples_per_revolution, signal.samples.shape[1]
    n_padded = next_fast_len(n_samples, real=True)
    spectra = rfft(signal.samples, n_padded, axis=1)
    harmonics = [_demodulate(spectra, n_samples, n_padded, n_per_rev, o, half_width) for o in usable]
    best = sorted((h for h in harmonics if h is not None), key=lambda h: -h.ratio)[:3]
    # Power of the band over its median line: 0.5 for noise. A band of noise must not be bent into a line.
    best = [h for h in best if h.ratio > max(2.0, 0.05 * best[0].ratio)]
    if not best or best[0].baseband.shape[1] < 8:
        return None
    n = best[0].baseband.shape[1]
    revolutions = signal.start_revolution + np.arange(n) * best[0].step_rev
    times = times_of_revolutions(angle, revolutions[0], revolutions[1] - revolutions[0], n)
    return _tachless(angle.shaft, times, np.maximum.accumulate(revolutions + _common_shift(best)))


def _tachless(shaft: str, time_s: FloatArray, revolutions: FloatArray) -> ShaftAngle:
    return ShaftAngle(shaft, time_s, revolutions, monotone_slopes(time_s, revolutions), "tachless")


def _demodulate(
    spectra: NDArray[np.complexfloating], n_samples: int, n_padded: int, n_per_rev: int, order: float, half_width: float
) -> _Harmonic | None:
    """Shift one order to zero and keep ± half_width around it, sampled accordingly, without the padding.

    `spectra` are transforms of `n_padded` samples, the last of which are zeros.
    """
    from scipy.fft import ifft, next_fast_len

    per_order = n_padded / n_per_rev  # bins per order
    reach = int(half_width * per_order)
    middle = round(order * per_order)
    n = next_fast_len(max(int(per_order * _PER_WIDTH * half_width), 2 * reach + 1))
    if reach < 4 or middle + reach >= n_padded // 2 or middle <= reach:
        return None
    taper = 0.5 + 0.5 * np.cos(np.pi * np.arange(-reach, reach + 1) / (reach + 1))
    basebands = []
    for row in spectra:
        lines = row[middle - reach : middle + reach + 1]
        # Normalised by the neighbourhood, so that no channel dominates the others.
        floor = float(np.median(np.abs(lines))) or 1.0
        spread = np.zeros(n, dtype=complex)
        spread[np.arange(-reach, reach + 1)] = lines * taper / floor
        basebands.append(ifft(spread)[: n * n_samples // n_padded] * n)
    baseband = np.array(basebands)
    # The middle is a whole number of bins; the rest of the shift is a slow rotation.
    turn = np.exp(2j * np.pi * (middle / per_order - order) * per_order * np.arange(baseband.shape[1]) / n)
    z = baseband * turn
    power = np.square(np.abs(z)).sum() / (z.size * (2 * reach + 1))
    return _Harmonic(order, z, float(power), n_padded / n_per_rev / n)


def _common_shift(harmonics: list[_Harmonic]) -> FloatArray:
    """Return the angle by which the shaft leads the estimate, in revolutions, from all harmonics, (n,)."""
    n = harmonics[0].baseband.shape[1]
    total, weights = np.zeros(n), 0.0
    for h in harmonics:
        product = (h.baseband[:, 1:] * np.conj(h.baseband[:, :-1])).sum(axis=0)
        phase = np.concatenate([[0.0], np.cumsum(np.angle(product))])
        weight = h.order**2 * h.ratio
        total += weight * phase / (2 * np.pi * h.order)
        weights += weight
    shift = total / weights
    # The filter's ringing corrupts both ends over half a reciprocal width of revolutions.
    edge = min(n // 4, max(1, int(_PER_WIDTH / 2)))
    shift[:edge] = shift[edge]
    shift[n - edge :] = shift[n - edge - 1]
    centred: FloatArray = shift - shift.mean()
    return centred


# Shaft angle at varying speed: tracked block by block, refined by phase, scored over orders.


def varying_speed(search: SpeedSearch, start: SpeedCandidate | None) -> SpeedCandidate | None:
    """Return the best refined angle, from the constant one or from tracking with blocks of several lengths."""
    candidates: list[SpeedCandidate] = []
    for angle in _starts(search, start):
        candidate = _refined(search, angle)
        if candidate is not None and abs(candidate.decision.speed - 1.0) > 0.02:
            # Over the true speed profile, the comb is sharp only at its true scale: start again from there.
            candidate = _refined(search, angle.of_shaft(angle.shaft, candidate.decision.speed))
        if candidate is not None and abs(candidate.decision.speed - 1.0) <= 0.02:
            candidates.append(candidate)
            if candidate.decision.quality > CLEAR:
                break
    best = max(candidates, key=_rank, default=None)
    if best is None or best.decision.quality < MIN_QUALITY or search.high < NARROW * search.low:
        return best
    # If the scale is open, half, double, triple and a third of the speed are refined as well and must score lower.
    mean = best.angle.mean_speed_rpm / 60.0
    factors = [factor for factor in (2.0, 0.5, 3.0, 1.0 / 3.0) if search.low <= factor * mean <= search.high]
    alternatives = [_refined(search, best.angle.of_shaft(best.angle.shaft, factor)) for factor in factors]
    return max([best, *(o for o in alternatives if o is not None and abs(o.decision.speed - 1.0) <= 0.02)], key=_rank)


def _starts(search: SpeedSearch, start: SpeedCandidate | None) -> Iterator[ShaftAngle]:
    """Yield the angle at constant speed, if any; unless its quality is clear, also the tracked profiles."""
    if start is not None:
        yield start.angle
        if start.decision.quality >= CLEAR:
            return
    from scipy.integrate import cumulative_trapezoid

    rate, n = search.recording.sampling_rate_hz, search.samples.shape[1]
    # Blocks per recording: the middle one first, as it fits most machines. One is enough to contradict a steady speed.
    for n_blocks in (96, 24, 384) if start is None else (96,):
        n_block = 2 * n // n_blocks
        low = max(search.low, 2.0 * rate / n_block)  # fewer than two turns per block would not resolve orders
        if n_block < 512 or low >= search.high:
            continue
        change = 0.04 * 0.5 * n_block / rate  # log speed changes by 0.04 per second
        time_s, speed = track_speed(search.samples, rate, search.comb, low, search.high, n_block, change)
        if np.abs(np.diff(np.log(speed))).max() > 0.2:
            continue  # such a jump is a change to a multiple of the speed
        smooth = _smooth(speed)
        t = np.concatenate([[0.0], time_s, [search.recording.duration_s]])
        v = np.concatenate([[smooth[0]], smooth, [smooth[-1]]])
        angle = _tachless(search.shaft, t, cumulative_trapezoid(v, t, initial=0))
        for span in (0.05, 0.02):
            angle = _corrected(search, angle, span, n_blocks)
        yield angle


def _rank(candidate: SpeedCandidate) -> tuple[bool, float]:
    return candidate.decision.rank


def _refined(search: SpeedSearch, angle: ShaftAngle) -> SpeedCandidate | None:
    """Refine an angle by phase and score the comb over the order spectrum, where a correct angle gives sharp lines."""
    refined = refine_by_phase(
        search.recording, search.channels, angle, search.comb.mesh_harmonics, transforms=search.transforms
    )
    signal = _over_angle(search, refined)
    if signal is None:
        return None
    mean = refined.mean_speed_rpm / 60.0
    # The search was at least this wide; for a known nominal speed there is a margin for the runner-up.
    low = max(search.low / mean, 0.15) if search.high / search.low > NARROW else 0.95
    high = min(search.high / mean, 6.0) if search.high / search.low > NARROW else 1.05
    n_per_rev = float(signal.samples_per_revolution)
    decision = best_decision(signal.samples, n_per_rev, search.comb, min(low, 0.95), max(high, 1.05))
    if decision is None:
        return None
    coverage = _coverage(signal.samples, n_per_rev, search.comb)
    return SpeedCandidate(refined, replace(decision, coverage=coverage))


def _over_angle(search: SpeedSearch, angle: ShaftAngle) -> AngleSignal | None:
    """Resample up to twice the comb's highest order, so that twice the true speed would show, or as far as possible.

    Return None if the angle covers less than one revolution of the recording.
    """
    top = TOP * search.recording.sampling_rate_hz / (angle.speed_range_rpm[1] / 60.0)
    highest = min(2.0 * search.comb.highest, top)
    try:
        return resample_to_angle(search.recording, angle, channels=search.channels, highest_order=highest)
    except RefusalError:
        return None


def _corrected(search: SpeedSearch, angle: ShaftAngle, span: float, n_blocks: int) -> ShaftAngle:
    """Track the remaining change of speed over the angle found so far, where the lines are already sharper."""
    from scipy.integrate import cumulative_trapezoid

    signal = _over_angle(search, angle)
    if signal is None:
        return angle
    n_per_rev, n = float(signal.samples_per_revolution), signal.samples.shape[1]
    n_block = max(512, 2 * n // n_blocks)
    if n_block > n // 4:
        return angle
    turned, factor = track_speed(signal.samples, n_per_rev, search.comb, 1 - span, 1 + span, n_block, 0.0)
    fine = np.linspace(angle.start_s, angle.end_s, max(len(angle.time_s), 4 * n_blocks))
    theta = angle.revolutions_at(fine)
    # The "time" of this profile is revolutions over the estimated angle.
    factor = np.interp(theta, signal.start_revolution + turned, _smooth(factor))
    return _tachless(search.shaft, fine, cumulative_trapezoid(factor, theta, initial=0))


def _smooth(speed: FloatArray) -> FloatArray:
    """Smooth the steps of the speed grid by a short Gaussian filter."""
    from scipy.ndimage import gaussian_filter1d

    smooth: FloatArray = gaussian_filter1d(speed, 1.0, mode="nearest")
    return smooth


def _coverage(samples: FloatArray, n_per_rev: float, comb: CombLines) -> float:
    """Return the share of the recording, in eighths, in which the comb lies where the angle predicts it."""
    n_part = samples.shape[1] // 8
    if n_part < 4 * n_per_rev or n_part < 512:
        return 1.0
    right = 0
    for part in range(8):
        rows = samples[:, part * n_part : (part + 1) * n_part]
        evidence = line_evidence(rows, n_per_rev, n_part, TOP * n_per_rev, 1.06 * comb.highest)
        speeds = candidate_speeds(0.94, 1.06, comb, evidence)
        scores = score_speeds(evidence, comb, speeds)
        here = np.abs(speeds - 1.0) <= 2.0 * evidence.bin_width / comb.meshes[0]
        right += scores.max() - scores[here].max() <= 4.0  # another speed must win by this margin there
    return right / 8.0


def estimate_shaft_angle(
    recording: Recording,
    rig: Rig,
    *,
    channels: Sequence[str] | None = None,
    speed_range_rpm: tuple[float, float] | None = None,
    explained: bool = True,
    transform: Callable[[str], ComplexArray] | None = None,
) -> ShaftAngle:
    """Estimate the angle of the reference shaft from mesh harmonics, their sidebands and shaft harmonics.

    First, constant speed is assumed: the comb of orders is compared with a whitened spectrum at each speed of the
    range. If its lines are smeared, the speed is tracked from block to block. Either angle is then refined by the phase
    of the mesh harmonics, and the comb over the order spectrum is scored against chance, other speeds and other teeth.

    Parameters
    ----------
    recording : Recording
    rig : Rig
        At least one mesh order must be known.
    channels : sequence of str, optional
        Default: the vibration channels.
    speed_range_rpm : (float, float), optional
        Of the reference shaft. Default: the rig's nominal speed with its tolerance, else 30 to 30000 rpm as far as
        sampling rate and duration allow.
    explained : bool
        Whether a refusal states at which other speed a comb was found, which takes about as long as the search.
    transform : callable, optional
        Returns a channel's `rfft`, to reuse it; not used unless it is of all samples.

    Returns
    -------
    ShaftAngle
        With quality and uncertainty; the zero of the angle is arbitrary.

    Raises
    ------
    RefusalError
        If no teeth are known, the recording is too short, or no comb stands out: noise, only a bearing, wrong teeth or
        sampling rate, or a speed scale that remains ambiguous.

    Notes
    -----
    Not for friction or belt drives, nor for speeds that change by more than a few per cent within a revolution.
    """
    search = search_of(recording, rig, channels, speed_range_rpm, transform)
    steady = _constant_speed(search)
    varying = varying_speed(search, steady if _is_sharp(search, steady) else None)
    candidate = _better(search, steady, varying)
    if candidate is None or candidate.decision.quality < MIN_QUALITY:
        raise _refusal(search, candidate, rig, explained=explained)
    usual = _range_without_slips(candidate.angle)
    if usual is None:
        return _finished(search, candidate)
    low, high = 60.0 * search.low, 60.0 * search.high
    if usual[1] - usual[0] > 0.9 * (high - low):  # the range is narrow already, and the profile still jumps
        raise RefusalError(
            "the speed that follows from the mesh lines jumps briefly, as no shaft can: the phase slips by cycles",
            remedy="give a tachometer, or a recording with less noise",
        )
    return estimate_shaft_angle(
        recording, rig, channels=channels, speed_range_rpm=usual, explained=explained, transform=transform
    )


def _range_without_slips(angle: ShaftAngle) -> tuple[float, float] | None:
    """Return the speed range (rpm) to search again if the profile briefly leaves its usual range; otherwise None.

    A phase slip of one cycle appears as a short excursion far beyond the speeds at all other times.
    """
    speed = angle.speed_rpm_at(np.linspace(angle.start_s, angle.end_s, 4096))
    low, middle, high = (float(q) for q in np.quantile(speed, (0.05, 0.5, 0.95)))
    farthest = float(np.abs(speed - middle).max())
    if farthest < max(3.0 * (high - low), 0.01 * middle):
        return None
    margin = max(high - low, 0.002 * middle)
    return low - margin, high + margin


def _is_sharp(search: SpeedSearch, steady: SpeedCandidate | None) -> bool:
    """Whether a constant speed was found from lines as narrow as the recording's length allows."""
    return (
        steady is not None
        and steady.decision.quality >= MIN_QUALITY
        and steady.decision.bin_width * search.recording.duration_s < 1.5
    )


def _better(
    search: SpeedSearch, steady: SpeedCandidate | None, varying: SpeedCandidate | None
) -> SpeedCandidate | None:
    """Return the varying angle if it is trustworthy and scores better, else the constant one."""
    if steady is None:
        return varying
    if not _is_sharp(search, steady) and not steady.decision.narrow:
        # With smeared lines and an unknown speed, half and double speed look much alike.
        steady = replace(steady, decision=replace(steady.decision, coverage=0.95))
    sure = steady.decision.quality >= MIN_QUALITY
    if varying is not None and varying.decision.quality >= MIN_QUALITY:
        return varying if not sure or varying.decision.score > steady.decision.score + 3.0 else steady
    return steady if sure or varying is None else varying


@dataclass(frozen=True)
class OffsetComb:
    """A comb of mesh lines at another speed than speed and teeth predict.

    Parameters
    ----------
    factor : float
        Its speed relative to the stated speed.
    text : str
        The finding in one sentence.
    """

    factor: float
    text: str


FARTHEST_COMB = 12.5
"""Factor on the stated speed up to which the comb is searched: sampling rates are often wrong by 10 or 2.56."""


def find_offset_comb(recording: Recording, rig: Rig, stated_speed_rpm: float) -> OffsetComb | None:
    """Return the multiple of a stated speed at which the gears' comb actually lies; None if there is no other.

    For "sampling rate, speed and teeth disagree": a factor of 2, or the ratio of two common sampling rates, points to
    the cause.
    """
    positive(stated_speed_rpm, "stated_speed_rpm", "rpm")
    stated = stated_speed_rpm / 60.0
    try:
        limits = (stated_speed_rpm / FARTHEST_COMB, stated_speed_rpm * FARTHEST_COMB)
        search = search_of(recording, rig, None, limits)
    except (RefusalError, InputError):
        return None
    candidate = _constant_speed(search)
    if candidate is None or candidate.decision.quality < MIN_QUALITY:
        return None
    factor = candidate.decision.speed / stated
    if abs(factor - 1.0) < 0.002:
        return None
    mesh = search.comb.meshes[0]
    return OffsetComb(
        factor,
        f"Mesh lines with sidebands lie at {mesh * candidate.decision.speed:.5g} Hz and its multiples, "
        f"{factor:.4g} times where speed and teeth predict them ({candidate.decision.evidence()}): "
        "sampling rate, speed or teeth are wrong.",
    )


def _constant_speed(search: SpeedSearch) -> SpeedCandidate | None:
    """Return the best comb over the spectrum of the whole recording, or of shorter parts if its lines are wider."""
    rate = search.recording.sampling_rate_hz
    decision = best_decision(search.samples, rate, search.comb, search.low, search.high, search.transforms)
    if decision is None:
        return None
    times = np.array([0.0, search.recording.duration_s])
    angle = ShaftAngle(search.shaft, times, decision.speed * times, np.repeat(decision.speed, 2), "tachless")
    return SpeedCandidate(angle, decision)


def _finished(search: SpeedSearch, candidate: SpeedCandidate) -> ShaftAngle:
    decision, angle = candidate.decision, candidate.angle
    constant, duration_s, meshes = len(angle.time_s) == 2, search.recording.duration_s, search.comb.meshes
    smeared = constant and decision.bin_width * duration_s > 1.5
    # A tenth of a bin at the mesh order if its line is sharp, half a bin otherwise.
    uncertainty = 0.1 / (duration_s * meshes[-1] * angle.mean_speed_rpm / 60.0)
    unit = "rev/s" if constant else "times the angle's speed"
    notes = [f"estimated from the vibration of {', '.join(search.channels)}: {decision.evidence(unit)}"]
    if not constant:
        notes.append("the speed varies; its profile follows the phase of the mesh harmonics")
    notes.append("the angle's zero is arbitrary")
    if smeared:
        uncertainty = 0.5 * decision.bin_width / (meshes[0] * decision.speed)
        wander = f"the speed may wander by ± {100.0 * uncertainty:.2g} %"
        notes.append(f"the lines are wider than the recording's length explains: {wander}")
    return replace(
        angle,
        shaft=search.shaft,
        relative_speed_uncertainty=float(uncertainty),
        quality=decision.quality,
        notes=tuple(notes),
    )


def _refusal(search: SpeedSearch, best: SpeedCandidate | None, rig: Rig, *, explained: bool) -> RefusalError:
    """Return the refusal, stating what was searched and what was found instead, also outside the nominal range."""
    reason = f"no comb of mesh lines stands out between {60 * search.low:.4g} and {60 * search.high:.4g} rpm"
    if best is not None:
        reason += f" ({best.decision.evidence()}; quality {best.decision.quality:.2f}, needed {MIN_QUALITY})"
    middle = 30.0 * (search.low + search.high)
    if explained and search.high / search.low < 4.0:
        elsewhere = find_offset_comb(search.recording, rig, middle)
        if elsewhere is not None:
            reason += ". " + elsewhere.text
    return RefusalError(
        reason, remedy="give a tachometer or the speed, check teeth and sampling rate, or record longer under load"
    )
