"""Shaft angle without a tachometer, from the lines that gears put into the vibration."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from gearsig.angle.speed_search import LOWEST_QUALITY, SpeedCandidate, SpeedSearch, best_decision, search_of
from gearsig.angle.types import ShaftAngle
from gearsig.angle.varying_speed import varying_speed
from gearsig.checks import positive
from gearsig.errors import InputError, RefusalError
from gearsig.recording.types import Recording
from gearsig.rig.types import Rig

_GAIN = 3.0  # a varying angle has to score so much better than the constant one


def estimate_shaft_angle(
    recording: Recording,
    rig: Rig,
    *,
    channels: Sequence[str] | None = None,
    speed_range_rpm: tuple[float, float] | None = None,
) -> ShaftAngle:
    """Estimate the angle of the reference shaft from mesh harmonics, their sidebands and shaft harmonics.

    First at constant speed: the comb of orders is laid over a whitened spectrum at each speed of the range. If its
    lines are smeared, the speed is followed from block to block. Either angle is then made exact by the phase of the
    mesh harmonics, and weighed by the comb over the order spectrum: against chance, other speeds, other teeth.

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
    search = search_of(recording, rig, channels, speed_range_rpm)
    steady = _constant_speed(search)
    varying = varying_speed(search, steady if _is_sharp(search, steady) else None)
    candidate = _better(search, steady, varying)
    if candidate is None or candidate.decision.quality < LOWEST_QUALITY:
        raise _refusal(search, candidate, rig)
    usual = _range_without_slips(candidate.angle)
    if usual is None:
        return _finished(search, candidate)
    low, high = 60.0 * search.low, 60.0 * search.high
    if usual[1] - usual[0] > 0.9 * (high - low):  # the range is narrow already, and the course still jumps
        raise RefusalError(
            "the speed that follows from the mesh lines jumps for moments, as no shaft does: the phase slips by cycles",
            remedy="give a tachometer, or a recording with less noise",
        )
    return estimate_shaft_angle(recording, rig, channels=channels, speed_range_rpm=usual)


def _range_without_slips(angle: ShaftAngle) -> tuple[float, float] | None:
    """Return the range of speeds (rpm) to search again if the course leaves its usual range for moments; else None.

    A phase that slips by a cycle shows as a short excursion far beyond the speeds of all other times.
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
        and steady.decision.quality >= LOWEST_QUALITY
        and steady.decision.bin_width * search.recording.duration_s < 1.5
    )


def _better(
    search: SpeedSearch, steady: SpeedCandidate | None, varying: SpeedCandidate | None
) -> SpeedCandidate | None:
    """Return the varying angle if it is trustworthy and scores better, else the constant one."""
    if steady is None:
        return varying
    if not _is_sharp(search, steady) and not steady.decision.narrow:
        # Smeared lines of an unknown speed: half and double speed look much alike.
        steady = replace(steady, decision=replace(steady.decision, coverage=0.95))
    sure = steady.decision.quality >= LOWEST_QUALITY
    if varying is not None and varying.decision.quality >= LOWEST_QUALITY:
        return varying if not sure or varying.decision.score > steady.decision.score + _GAIN else steady
    return steady if sure or varying is None else varying


def comb_evidence(recording: Recording, rig: Rig, stated_speed_rpm: float) -> str:
    """Say at which multiple of a stated speed the comb of the gears does lie; empty if nowhere.

    For "sampling rate, speed and teeth disagree": a factor of 2, or of two common sampling rates, names the culprit.
    """
    positive(stated_speed_rpm, "stated_speed_rpm", "rpm")
    stated = stated_speed_rpm / 60.0
    try:
        search = search_of(recording, rig, None, (stated_speed_rpm / 8.0, stated_speed_rpm * 8.0))
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
        f"Mesh lines with sidebands lie at {mesh * found.decision.speed:.5g} Hz and its multiples, {factor:.4g} times "
        f"where speed and teeth put them ({found.decision.evidence()}): sampling rate, speed or teeth are wrong."
    )


def _constant_speed(search: SpeedSearch) -> SpeedCandidate | None:
    """Best comb over the spectrum of the whole recording, or of its parts where the lines are wider."""
    rate = search.recording.sampling_rate_hz
    decision = best_decision(search.samples, rate, search.comb, search.low, search.high)
    if decision is None:
        return None
    times = np.array([0.0, search.recording.duration_s])
    angle = ShaftAngle(search.shaft, times, decision.speed * times, np.repeat(decision.speed, 2), "tachless")
    return SpeedCandidate(angle, decision)


def _finished(search: SpeedSearch, found: SpeedCandidate) -> ShaftAngle:
    decision, angle = found.decision, found.angle
    constant = len(angle.time_s) == 2
    notes = [
        f"estimated from the vibration of {', '.join(search.channels)}: "
        + decision.evidence("rev/s" if constant else "times the angle's speed")
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


def _uncertainty(search: SpeedSearch, found: SpeedCandidate) -> float:
    """A tenth of a bin at the mesh order where its line was sharp, half a bin where it was not."""
    decision, mesh = found.decision, search.comb.meshes[-1]
    if len(found.angle.time_s) == 2 and decision.bin_width * search.recording.duration_s > 1.5:
        return float(0.5 * decision.bin_width / (search.comb.meshes[0] * decision.speed))
    speed = found.angle.mean_speed_rpm / 60.0
    return float(0.1 / (search.recording.duration_s * mesh * speed))


def _refusal(search: SpeedSearch, best: SpeedCandidate | None, rig: Rig) -> RefusalError:
    """Explain what was searched and found instead, also outside of the nominal range."""
    reason = f"no comb of mesh lines stands out between {60 * search.low:.4g} and {60 * search.high:.4g} rpm"
    if best is not None:
        reason += f" ({best.decision.evidence()}; quality {best.decision.quality:.2f}, needed {LOWEST_QUALITY})"
    middle = 30.0 * (search.low + search.high)
    if search.high / search.low < 4.0:
        elsewhere = comb_evidence(search.recording, rig, middle)
        if elsewhere:
            reason += ". " + elsewhere
    return RefusalError(
        reason, remedy="give a tachometer or the speed, check teeth and sampling rate, or record longer under load"
    )
