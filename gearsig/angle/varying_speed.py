"""Shaft angle of a changing speed: followed block by block, made exact by phase, weighed over orders."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from gearsig.angle.comb_decision import NARROW, CombDecision
from gearsig.angle.comb_lines import CombLines
from gearsig.angle.comb_score import score_speeds
from gearsig.angle.line_evidence import line_evidence
from gearsig.angle.phase_refinement import refine_by_phase
from gearsig.angle.resample import resample_to_angle
from gearsig.angle.slopes import monotone_slopes
from gearsig.angle.speed_ridge import track_speed
from gearsig.angle.speed_search import LOWEST_QUALITY, TOP, SpeedCandidate, SpeedSearch, best_decision
from gearsig.angle.types import ShaftAngle
from gearsig.checks import FloatArray
from gearsig.errors import RefusalError

_BLOCKS = (96, 24, 384)  # per recording
_ACCELERATION_PER_S = 0.04  # standard deviation of the change of log speed
_CORRECTION_SPANS = (0.05, 0.02)
_LARGEST_JUMP = 0.2  # of log speed between blocks; a path that changes to a multiple of the speed jumps further
_LOST = 4.0  # score by which another speed has to win in a part for the angle to be wrong there
_CLEAR = 0.9  # quality beyond which no other block length is tried


def varying_speed(search: SpeedSearch, start: SpeedCandidate | None) -> SpeedCandidate | None:
    """Best of the refined angles, from the constant one or from tracking with blocks of several lengths."""
    candidates: list[SpeedCandidate] = []
    for angle in _starts(search, start):
        candidate = _refined(search, angle)
        if candidate is not None and abs(candidate.decision.speed - 1.0) > 0.02:
            # Over the true course of speed the comb is sharp at its true scale only: take it from there.
            candidate = _refined(search, angle.of_shaft(angle.shaft, candidate.decision.speed))
        if candidate is not None and abs(candidate.decision.speed - 1.0) <= 0.02:
            candidates.append(candidate)
            if candidate.decision.quality > _CLEAR:
                break
    best = max(candidates, key=_rank, default=None)
    if best is None or best.decision.quality < LOWEST_QUALITY or search.high < NARROW * search.low:
        return best
    # With the scale open, half, double and triple speed are refined as well and have to lose.
    others = [
        other
        for factor in (2.0, 0.5, 3.0, 1.0 / 3.0)
        if search.low <= factor * best.angle.mean_speed_rpm / 60.0 <= search.high
        and (other := _refined(search, best.angle.of_shaft(best.angle.shaft, factor))) is not None
        and abs(other.decision.speed - 1.0) <= 0.02
    ]
    return max([best, *others], key=_rank)


def _starts(search: SpeedSearch, start: SpeedCandidate | None) -> Iterator[ShaftAngle]:
    """Yield the constant speed where there is one; unless that is beyond doubt, the courses followed as well."""
    if start is not None:
        yield start.angle
    if start is None or start.decision.quality < _CLEAR:
        # One block length is enough to contradict a steady speed; without one, all are tried.
        yield from _rough_angles(search, _BLOCKS if start is None else _BLOCKS[:1])


def _rank(candidate: SpeedCandidate) -> tuple[bool, float]:
    return candidate.decision.quality >= LOWEST_QUALITY, candidate.decision.score


def _refined(search: SpeedSearch, angle: ShaftAngle) -> SpeedCandidate | None:
    refined = refine_by_phase(search.recording, search.channels, angle, _mesh_harmonics(search.comb))
    decision = _decision_over_angle(search, refined)
    return None if decision is None else SpeedCandidate(refined, decision)


def _mesh_harmonics(comb: CombLines) -> tuple[float, ...]:
    return tuple(k * m for m in comb.meshes for k in (1, 2, 3))


def _rough_angles(search: SpeedSearch, block_counts: tuple[int, ...]) -> Iterator[ShaftAngle]:
    """Follow the speed with blocks of several lengths, the middle one first: it fits most machines."""
    rate, n = search.recording.sampling_rate_hz, search.samples.shape[1]
    for n_blocks in block_counts:
        n_block = 2 * n // n_blocks
        low = max(search.low, 2.0 * rate / n_block)  # two turns per block, or its spectrum does not show orders
        if n_block < 512 or low >= search.high:
            continue
        change = _ACCELERATION_PER_S * 0.5 * n_block / rate
        ridge = track_speed(search.samples, rate, search.comb, low, search.high, TOP * rate, n_block, change)
        if np.abs(np.diff(np.log(ridge.speed_rev_per_s))).max() > _LARGEST_JUMP:
            continue
        angle = _integrated(search, ridge.time_s, ridge.speed_rev_per_s)
        for span in _CORRECTION_SPANS:
            angle = _corrected(search, angle, span, n_blocks)
        yield angle


def _corrected(search: SpeedSearch, angle: ShaftAngle, span: float, n_blocks: int) -> ShaftAngle:
    """Follow what is left of the change of speed over the angle found so far, where the lines are already sharper."""
    try:
        signal = resample_to_angle(
            search.recording, angle, channels=search.channels, highest_order=_highest_order(search, angle)
        )
    except RefusalError:
        return angle
    n_per_rev, n = float(signal.samples_per_revolution), signal.samples.shape[1]
    n_block = max(512, 2 * n // n_blocks)
    if n_block > n // 4:
        return angle
    ridge = track_speed(signal.samples, n_per_rev, search.comb, 1 - span, 1 + span, TOP * n_per_rev, n_block, 0.0)
    # The "time" of this ridge is revolutions over the estimated angle.
    revolutions = signal.start_revolution + ridge.time_s
    factor = _smooth(ridge.speed_rev_per_s)
    fine = np.linspace(angle.start_s, angle.end_s, max(len(angle.time_s), 4 * n_blocks))
    theta = angle.revolutions_at(fine)
    factor = np.interp(theta, revolutions, factor)
    corrected = np.concatenate([[0.0], np.cumsum(0.5 * (factor[1:] + factor[:-1]) * np.diff(theta))])
    return ShaftAngle(search.shaft, fine, corrected, monotone_slopes(fine, corrected), "tachless")


def _smooth(speed: FloatArray) -> FloatArray:
    """Take out the steps of the speed grid by a short running mean."""
    from scipy.ndimage import gaussian_filter1d

    smooth: FloatArray = gaussian_filter1d(speed, 1.0, mode="nearest")
    return smooth


def _integrated(search: SpeedSearch, time_s: FloatArray, speed: FloatArray) -> ShaftAngle:
    """Angle from speeds at the middles of blocks."""
    smooth = _smooth(speed)
    t = np.concatenate([[0.0], time_s, [search.recording.duration_s]])
    v = np.concatenate([[smooth[0]], smooth, [smooth[-1]]])
    angle = np.concatenate([[0.0], np.cumsum(0.5 * (v[1:] + v[:-1]) * np.diff(t))])
    return ShaftAngle(search.shaft, t, angle, monotone_slopes(t, angle), "tachless")


def _decision_over_angle(search: SpeedSearch, angle: ShaftAngle) -> CombDecision | None:
    """Weigh the comb over the order spectrum, where a right angle makes all its lines sharp."""
    try:
        signal = resample_to_angle(
            search.recording, angle, channels=search.channels, highest_order=_highest_order(search, angle)
        )
    except RefusalError:
        return None
    mean = angle.mean_speed_rpm / 60.0
    # The search was at least this wide; a known nominal speed leaves a margin for the runner-up.
    low = max(search.low / mean, 0.15) if search.high / search.low > NARROW else 0.95
    high = min(search.high / mean, 6.0) if search.high / search.low > NARROW else 1.05
    n_per_rev = float(signal.samples_per_revolution)
    decision = best_decision(signal.samples, n_per_rev, search.comb, min(low, 0.95), max(high, 1.05))
    return None if decision is None else replace(decision, coverage=_coverage(signal.samples, n_per_rev, search.comb))


def _highest_order(search: SpeedSearch, angle: ShaftAngle) -> float:
    """Twice the comb, so that a speed of twice the true one shows itself; less where the recording has no more."""
    top = TOP * search.recording.sampling_rate_hz / (angle.speed_range_rpm[1] / 60.0)
    return min(2.0 * search.comb.highest, top)


def _coverage(samples: FloatArray, n_per_rev: float, comb: CombLines) -> float:
    """Share of the recording, in eighths, in which the comb lies where the angle says and not beside."""
    n_part = samples.shape[1] // 8
    if n_part < 4 * n_per_rev or n_part < 512:
        return 1.0
    right = 0
    for part in range(8):
        evidence = line_evidence(samples[:, part * n_part : (part + 1) * n_part], n_per_rev, n_part, TOP * n_per_rev)
        scores = score_speeds(evidence, comb, 0.94, 1.06)
        width = 2.0 * evidence.bin_width / comb.meshes[0]
        here = np.abs(scores.speeds - 1.0) <= width
        right += scores.best()[1] - scores.scores[here].max() <= _LOST
    return right / 8.0
