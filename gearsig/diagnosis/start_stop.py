"""Recordings of machines that start, stop and reverse: recognised, and examined without pretending a steady speed."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from gearsig.checks import FloatArray
from gearsig.diagnosis.comparison import beside_reference
from gearsig.diagnosis.detectors.quality import detect_data_problems
from gearsig.diagnosis.start_stop_findings import (
    backlash_findings,
    burst_finding,
    impact_findings,
    left_out,
    motion_finding,
    no_contact,
    not_examined,
    not_of_rest,
    reference_runs_on,
    refusal_findings,
    weak_teeth_findings,
)
from gearsig.diagnosis.types import Analysis, CannotTell, Finding
from gearsig.diagnosis.verdict import ranked, verdict_of
from gearsig.errors import InputError, RefusalError
from gearsig.indicators.types import Indicator
from gearsig.motion.angle_faults import check_wrap
from gearsig.motion.bursts import Burst, find_bursts
from gearsig.motion.course import Course, is_start_stop
from gearsig.motion.measure import measure_motion
from gearsig.motion.standing import refuse_standing
from gearsig.motion.start_stop import StartStop, course_of_angle, examine_start_stop
from gearsig.recording.types import Recording
from gearsig.rig.speed import EncoderChannel, SpeedChannel
from gearsig.rig.tooth_pairs import path_of_contact
from gearsig.rig.types import Rig

Settings = Mapping[str, str | float | int | None]


def start_stop_analysis(
    recording: Recording,
    rig: Rig,
    problems: list[Finding],
    settings: Settings,
    reference: Recording | None = None,
) -> Analysis | None:
    """Return the analysis of a start–stop recording, or None where the motion is not one or is not known.

    Only an encoder or a speed channel tells: both see standstill and direction. With a reference, the backlash is
    compared with its backlash instead of the rig file's, and suspicions say whether it shows them as well.

    Raises
    ------
    InputError
        If the encoder's angle starts again after each revolution and the rig does not say so.
    RefusalError
        If a machine whose contact the rig describes only stands.
    """
    found = course_of(recording, rig)
    if found is not None:
        _check_standing(found[1], recording, rig)
    if found is None or not is_start_stop(found[0]):
        return None
    course, angle_rad = found
    source = recording.speed_source or rig.speed
    if isinstance(source, EncoderChannel):  # what seems to turn back may be an encoder that wraps
        check_wrap(angle_rad, recording.sampling_rate_hz, source.channel, recording.provenance.source)
    findings = [*not_of_rest(problems, recording), motion_finding(course)]
    then = None if reference is None else _of_reference(reference, rig, settings)
    if reference is not None and then is None:
        findings.append(reference_runs_on())
    examined, told = _of_teeth(recording, rig, then)
    findings += told
    findings.append(left_out(course, examined))
    bursts = _bursts(recording, problems)
    findings += [burst_finding(name, blows, angle_rad, recording, rig) for name, blows in bursts.items() if blows]
    order = ranked(findings if then is None else beside_reference(findings, then))
    return Analysis(
        recording,
        recording.rig,
        CannotTell("What is the speed of the shafts?", "the machine starts and stops: there is no one speed"),
        (),
        _indicators(course, examined, bursts),
        order,
        verdict_of(order, has_reference=then is not None),
        dict(settings),
        reference=then,
        motion=examined,
    )


def _check_standing(angle_rad: FloatArray, recording: Recording, rig: Rig) -> None:
    """Refuse a machine that only stands, where its contact says how far its teeth are apart."""
    if rig.contact is None:
        return
    try:
        path = path_of_contact(rig)
    except RefusalError:  # without geometry the rest is examined all the same
        return
    refuse_standing(angle_rad, path, rig.contact, recording.sampling_rate_hz, recording.provenance.source)


def _of_teeth(recording: Recording, rig: Rig, then: Analysis | None) -> tuple[StartStop | None, list[Finding]]:
    """Examine the teeth, where the rig says how they touch and the recording allows it."""
    if rig.contact is None:
        return None, [no_contact()]
    try:
        examined = examine_start_stop(measure_motion(recording, rig))
    except (RefusalError, InputError) as error:
        return None, [not_examined(error)]
    return examined, [
        *backlash_findings(examined, rig, then),
        *weak_teeth_findings(examined, rig),
        *impact_findings(examined),
        *refusal_findings(examined),
    ]


def _of_reference(reference: Recording, rig: Rig, settings: Settings) -> Analysis | None:
    own = reference if reference.rig is not None else reference.with_rig(rig)
    return start_stop_analysis(own, rig, detect_data_problems(own)[0], settings)


def course_of(recording: Recording, rig: Rig) -> tuple[Course, FloatArray] | None:
    """Return the stretches of the motion and the angle in rad, from an encoder or a speed channel; None without one."""
    source = recording.speed_source or rig.speed
    rate = recording.sampling_rate_hz
    if not isinstance(source, (EncoderChannel, SpeedChannel)) or source.channel not in recording.channel_names:
        return None
    values = np.asarray(recording.values(source.channel), dtype=np.float64)
    if isinstance(source, SpeedChannel):
        angle = np.cumsum(values * source.rpm_per_unit * np.pi / 30.0) / rate
    else:
        revolutions = values / source.units_per_revolution
        angle = 2.0 * np.pi * (np.unwrap(revolutions, period=1.0) if source.wraps else revolutions)
    try:
        return course_of_angle(angle, rate), angle
    except InputError:  # too short for a speed
        return None


def _bursts(recording: Recording, problems: list[Finding]) -> dict[str, tuple[Burst, ...]]:
    """Return the blows of every acceleration that is sampled fast enough and not dead."""
    dead = {name for finding in problems if finding.code == "channel-dead" for name in finding.where.channels}
    names = [c.name for c in recording.channels if c.quantity == "acceleration" and c.name not in dead]
    found = {}
    for name in names:
        try:
            found[name] = find_bursts(np.asarray(recording.values(name), dtype=np.float64), recording.sampling_rate_hz)
        except InputError:  # too slow or too short for blows
            continue
    return found


def _indicators(
    course: Course, examined: StartStop | None, bursts: Mapping[str, tuple[Burst, ...]]
) -> tuple[Indicator, ...]:
    rows = () if examined is None else examined.indicators
    if examined is None:
        rows = (
            Indicator("starts", float(len(course.starts_s)), computed_on="motion"),
            Indicator("stops", float(len(course.stops_s)), computed_on="motion"),
            Indicator("reversals", float(course.n_reversals), computed_on="motion"),
            Indicator("standing part", course.standing_part, computed_on="motion"),
        )
    n_cycles = max(1, len(course.moving))
    blows = tuple(Indicator("blows per cycle", len(b) / n_cycles, channel=n) for n, b in bursts.items())
    return (*rows, *blows)
