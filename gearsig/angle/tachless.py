"""Shaft angle without a tachometer, from the lines that gears put into the vibration."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from gearsig.angle.comb_decision import CombDecision, decide
from gearsig.angle.comb_lines import CombLines, comb_of_rig
from gearsig.angle.comb_score import score_speeds
from gearsig.angle.line_evidence import line_evidence
from gearsig.angle.phase_refinement import refine_by_phase
from gearsig.angle.resample import resample_to_angle
from gearsig.angle.slopes import monotone_slopes
from gearsig.angle.speed_ridge import track_speed
from gearsig.angle.types import ShaftAngle
from gearsig.checks import FloatArray, positive
from gearsig.errors import InputError, RefusalError
from gearsig.recording.types import Recording
from gearsig.rig.types import Rig

LOWEST_QUALITY = 0.35
"""Below it no speed is claimed: on simulated and measured recordings, wrong speeds stay below."""

_WIDEST_RPM = (30.0, 30_000.0)
_FEWEST_REVOLUTIONS = 20.0
_TOP = 0.45  # of the sampling rate; above it lie the anti-aliasing filters of recorders
_DIVISIONS = (1, 4, 16)  # of the recording's length: long segments for steady lines, short ones for wandering lines
_BLOCKS = (96, 24, 384)  # per recording, for following a changing speed
_ACCELERATION_PER_S = 0.04  # standard deviation of the change of log speed
_CORRECTION_SPANS = (0.05, 0.02)
_CLEAR = 0.9  # quality beyond which no other block length is tried
_GAIN = 3.0  # a varying angle has to score so much better than the constant one


@dataclass(frozen=True)
class _Search:
    """What is searched where."""

    recording: Recording
    channels: tuple[str, ...]
    samples: FloatArray
    comb: CombLines
    shaft: str
    low: float
    high: float


@dataclass(frozen=True)
class _Candidate:
    angle: ShaftAngle
    decision: CombDecision


def estimate_shaft_angle(
    recording: Recording,
    rig: Rig,
    *,
    channels: Sequence[str] | None = None,
    speed_range_rpm: tuple[float, float] | None = None,
) -> ShaftAngle:
    """Estimate the angle of the reference shaft from mesh harmonics, their sidebands and shaft harmonics.

    First at constant speed: the comb of orders is laid over a whitened spectrum at each speed of the range. If its lines are
    smeared, the speed is followed from block to block. Either angle is then made exact by the phase of the mesh harmonics,
    and weighed by the comb over the order spectrum: against chance, other speeds, other teeth.

    Parameters
    ----------
    recording : Recording
    rig : Rig
        At least one mesh order must be known.
    channels : sequence of str, optional
        Default: the vibration channels.
    speed_range_rpm : (float, float), optional
        Of the reference shaft. Default: the rig's nominal speed with its tolerance, else 30 to 30000 rpm as far as sampling rate
        and duration allow.

    Returns
    -------
    ShaftAngle
        With quality and uncertainty; angle zero is arbitrary.

    Raises
    ------
    RefusalError
        If no teeth are known, the recording is too short, or no comb stands out: noise, a bearing alone, wrong teeth or
        sampling rate, or a scale of the speed that stays ambiguous.

    Notes
    -----
    Not for friction or belt drives, nor for speeds that change by more than a few per cent within a revolution.
    """
    search = _search(recording, rig, channels, speed_range_rpm)
    steady = _constant_speed(search)
    varying = _varying_speed(search, steady if _is_sharp(search, steady) else None)
    candidate = _better(search, steady, varying)
    if candidate is None or candidate.decision.quality < LOWEST_QUALITY:
        raise _refusal(search, candidate, rig)
    return _finished(search, candidate)


def _is_sharp(search: _Search, steady: _Candidate | None) -> bool:
    """Whether a constant speed was found from lines as narrow as the recording's length allows."""
    return (
        steady is not None
        and steady.decision.quality >= LOWEST_QUALITY
        and steady.decision.bin_width * search.recording.duration_s < 1.5
    )


def _better(search: _Search, steady: _Candidate | None, varying: _Candidate | None) -> _Candidate | None:
    """Return the varying angle if it is trustworthy and scores better, else the constant one."""
    if steady is None:
        return varying
    if not _is_sharp(search, steady) and not steady.decision.narrow:
        # Smeared lines of an unknown speed: half and double speed look much alike.
        steady = replace(steady, decision=replace(steady.decision, coverage=0.8))
    sure = steady.decision.quality >= LOWEST_QUALITY
    if varying is not None and varying.decision.quality >= LOWEST_QUALITY:
        return varying if not sure or varying.decision.score > steady.decision.score + _GAIN else steady
    return steady if sure or varying is None else varying


def comb_evidence(recording: Recording, rig: Rig, stated_speed_rpm: float) -> str:
    """Say at which multiple of a stated speed the comb of the gears does lie; empty if nowhere.

    For "sampling rate, speed and teeth disagree": a factor of exactly 2 or of two common sampling rates names the culprit.
    """
    positive(stated_speed_rpm, "stated_speed_rpm", "rpm")
    stated = stated_speed_rpm / 60.0
    try:
        search = _search(recording, rig, None, (stated_speed_rpm / 8.0, stated_speed_rpm * 8.0))
    except (RefusalError, InputError):
        return ""
    found = _constant_speed(search)
    if found is None or found.decision.quality < LOWEST_QUALITY:
        return ""
    factor = found.decision.speed / stated
    if abs(factor - 1.0) < 0.002:
        return ""
    mesh = search.comb.meshes[0]
    return (
        f"Mesh lines with sidebands lie at {mesh * found.decision.speed:.5g} Hz and its multiples, {factor:.4g} times where "
        f"speed and teeth put them ({found.decision.evidence()}): sampling rate, speed or teeth are wrong."
    )


def _search(
    recording: Recording,
    rig: Rig,
    channels: Sequence[str] | None,
    speed_range_rpm: tuple[float, float] | None,
) -> _Search:
    comb = comb_of_rig(rig)
    if comb is None:
        raise RefusalError(
            "no mesh order is known: the speed cannot be read from mesh lines",
            remedy="give the teeth of at least one gear on a shaft whose ratio is known, or a speed source",
        )
    names = tuple(channels) if channels is not None else recording.vibration_names()
    rows = [recording.index(name) for name in names]
    alive = [i for i in rows if float(np.ptp(recording.samples[i])) > 0.0]
    if not alive:
        raise RefusalError("no vibration channel moves", remedy="check sensors and channel quantities")
    low, high = _range(recording, rig, comb, speed_range_rpm)
    return _Search(
        recording,
        tuple(recording.channel_names[i] for i in alive),
        np.asarray(recording.samples[alive], dtype=np.float64),
        comb,
        rig.reference_shaft,
        low,
        high,
    )


def _range(
    recording: Recording, rig: Rig, comb: CombLines, speed_range_rpm: tuple[float, float] | None
) -> tuple[float, float]:
    """Range of speeds in rev/s."""
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
        low = max(low, _FEWEST_REVOLUTIONS / recording.duration_s)
    high = min(high, _TOP * recording.sampling_rate_hz / comb.meshes[0])
    if high * recording.duration_s < _FEWEST_REVOLUTIONS or low >= high:
        raise RefusalError(
            f"within {recording.duration_s:.3g} s at {recording.sampling_rate_hz:.6g} Hz there are fewer than "
            f"{_FEWEST_REVOLUTIONS:.0f} revolutions with a mesh line below {_TOP * recording.sampling_rate_hz:.4g} Hz at "
            f"{60 * low:.4g} to {60 * high:.4g} rpm",
            remedy="record longer or with a higher sampling rate, or check speed and teeth",
        )
    return low, high


def _constant_speed(search: _Search) -> _Candidate | None:
    """Best comb over the spectrum of the whole recording, or of its parts where the lines are wider."""
    rate = search.recording.sampling_rate_hz
    decision = _best_decision(search.samples, rate, search.comb, search.low, search.high)
    if decision is None:
        return None
    times = np.array([0.0, search.recording.duration_s])
    angle = ShaftAngle(search.shaft, times, decision.speed * times, np.repeat(decision.speed, 2), "tachless")
    return _Candidate(angle, decision)


def _best_decision(samples: FloatArray, rate: float, comb: CombLines, low: float, high: float) -> CombDecision | None:
    decisions = [
        decide(line_evidence(samples, rate, n, _TOP * rate), comb, low, high)
        for n in (samples.shape[1] // d for d in _DIVISIONS)
        # Sidebands need four bins between them and the mesh line.
        if n >= 256 and high * n / rate > 4.0
    ]
    return max(decisions, key=lambda d: (d.quality >= LOWEST_QUALITY, d.score), default=None)


def _varying_speed(search: _Search, start: _Candidate | None) -> _Candidate | None:
    """Best of the refined angles, from the constant one or from tracking with blocks of several lengths."""
    candidates: list[_Candidate] = []
    for angle in [start.angle] if start is not None else _rough_angles(search):
        candidate = _refined(search, angle)
        if candidate is not None and abs(candidate.decision.speed - 1.0) > 0.02:
            # Over the true course of speed the comb is sharp at its true scale only: take it from there.
            candidate = _refined(search, angle.of_shaft(angle.shaft, candidate.decision.speed))
        if candidate is not None and abs(candidate.decision.speed - 1.0) <= 0.02:
            candidates.append(candidate)
            if candidate.decision.quality > _CLEAR:
                break
    return max(candidates, key=lambda c: (c.decision.quality >= LOWEST_QUALITY, c.decision.score), default=None)


def _refined(search: _Search, angle: ShaftAngle) -> _Candidate | None:
    refined = refine_by_phase(search.recording, search.channels, angle, _mesh_harmonics(search.comb))
    decision = _decision_over_angle(search, refined)
    return None if decision is None else _Candidate(refined, decision)


def _mesh_harmonics(comb: CombLines) -> tuple[float, ...]:
    return tuple(k * m for m in comb.meshes for k in (1, 2, 3))


def _rough_angles(search: _Search) -> Iterator[ShaftAngle]:
    """Follow the speed with blocks of several lengths, the middle one first: it fits most machines."""
    rate, n = search.recording.sampling_rate_hz, search.samples.shape[1]
    for n_blocks in _BLOCKS:
        n_block = 2 * n // n_blocks
        low = max(search.low, 2.0 * rate / n_block)  # two turns per block, or its spectrum does not show orders
        if n_block < 512 or low >= search.high:
            continue
        change = _ACCELERATION_PER_S * 0.5 * n_block / rate
        ridge = track_speed(search.samples, rate, search.comb, low, search.high, _TOP * rate, n_block, change)
        angle = _integrated(search, ridge.time_s, ridge.speed_rev_per_s)
        for span in _CORRECTION_SPANS:
            angle = _corrected(search, angle, span, n_blocks)
        yield angle


def _corrected(search: _Search, angle: ShaftAngle, span: float, n_blocks: int) -> ShaftAngle:
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
    ridge = track_speed(signal.samples, n_per_rev, search.comb, 1 - span, 1 + span, _TOP * n_per_rev, n_block, 0.0)
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


def _integrated(search: _Search, time_s: FloatArray, speed: FloatArray) -> ShaftAngle:
    """Angle from speeds at the middles of blocks."""
    smooth = _smooth(speed)
    t = np.concatenate([[0.0], time_s, [search.recording.duration_s]])
    v = np.concatenate([[smooth[0]], smooth, [smooth[-1]]])
    angle = np.concatenate([[0.0], np.cumsum(0.5 * (v[1:] + v[:-1]) * np.diff(t))])
    return ShaftAngle(search.shaft, t, angle, monotone_slopes(t, angle), "tachless")


def _decision_over_angle(search: _Search, angle: ShaftAngle) -> CombDecision | None:
    """Weigh the comb over the order spectrum, where a right angle makes all its lines sharp."""
    try:
        signal = resample_to_angle(
            search.recording, angle, channels=search.channels, highest_order=_highest_order(search, angle)
        )
    except RefusalError:
        return None
    mean = angle.mean_speed_rpm / 60.0
    # The search was at least this wide; a known nominal speed leaves a margin for the runner-up.
    low = max(search.low / mean, 0.15) if search.high / search.low > 1.35 else 0.95
    high = min(search.high / mean, 6.0) if search.high / search.low > 1.35 else 1.05
    n_per_rev = float(signal.samples_per_revolution)
    decision = _best_decision(signal.samples, n_per_rev, search.comb, min(low, 0.95), max(high, 1.05))
    return None if decision is None else replace(decision, coverage=_coverage(signal.samples, n_per_rev, search.comb))


def _highest_order(search: _Search, angle: ShaftAngle) -> float:
    """Twice the comb, so that a speed of twice the true one shows itself; less where the recording has no more."""
    top = _TOP * search.recording.sampling_rate_hz / (angle.speed_range_rpm[1] / 60.0)
    return min(2.0 * search.comb.highest, top)


def _coverage(samples: FloatArray, n_per_rev: float, comb: CombLines) -> float:
    """Share of the recording, in eighths, in which the comb lies where the angle says, and not a few per cent beside."""
    n_part = samples.shape[1] // 8
    if n_part < 4 * n_per_rev or n_part < 512:
        return 1.0
    right = 0
    for part in range(8):
        evidence = line_evidence(samples[:, part * n_part : (part + 1) * n_part], n_per_rev, n_part, _TOP * n_per_rev)
        scores = score_speeds(evidence, comb, 0.94, 1.06)
        width = 2.0 * evidence.bin_width / comb.meshes[0]
        right += abs(scores.best()[0] - 1.0) <= width
    return right / 8.0


def _finished(search: _Search, found: _Candidate) -> ShaftAngle:
    decision, angle = found.decision, found.angle
    constant = len(angle.time_s) == 2
    notes = [
        f"estimated from the vibration of {', '.join(search.channels)}: {decision.evidence('rev/s' if constant else 'times')}"
    ]
    if not constant:
        notes.append("the speed varies; its course follows the phase of the mesh harmonics")
    notes.append("the angle's zero is arbitrary")
    if constant and decision.bin_width * search.recording.duration_s > 1.5:
        share = 50.0 * decision.bin_width / (search.comb.meshes[0] * decision.speed)
        notes.append(
            f"the lines are wider than the recording's length explains: the speed may wander by ± {share:.2g} %"
        )
    return replace(
        angle,
        shaft=search.shaft,
        relative_speed_uncertainty=_uncertainty(search, found),
        quality=decision.quality,
        notes=tuple(notes),
    )


def _uncertainty(search: _Search, found: _Candidate) -> float:
    """A third of a bin at the third harmonic of the mesh, where the line was sharp; half a bin at the first, where it was not."""
    decision, mesh = found.decision, search.comb.meshes[-1]
    if len(found.angle.time_s) == 2 and decision.bin_width * search.recording.duration_s > 1.5:
        return float(0.5 * decision.bin_width / (search.comb.meshes[0] * decision.speed))
    speed = found.angle.mean_speed_rpm / 60.0
    return float(0.1 / (search.recording.duration_s * mesh * speed))


def _refusal(search: _Search, best: _Candidate | None, rig: Rig) -> RefusalError:
    """Explain what was searched and found instead, also outside of the nominal range."""
    reason = f"no comb of mesh lines stands out between {60 * search.low:.4g} and {60 * search.high:.4g} rpm"
    if best is not None:
        reason += f" ({best.decision.evidence()}; quality {best.decision.quality:.2f}, needed {LOWEST_QUALITY})"
    middle = 60.0 * float(np.sqrt(search.low * search.high))
    if search.high / search.low < 4.0:
        elsewhere = comb_evidence(search.recording, rig, middle)
        if elsewhere:
            reason += ". " + elsewhere
    return RefusalError(
        reason, remedy="give a tachometer or the speed, check teeth and sampling rate, or record longer under load"
    )
