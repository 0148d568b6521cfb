"""Recordings of machines that start, stop and reverse: recognised, and examined without pretending a steady speed."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from gearsig.checks import FloatArray
from gearsig.diagnosis._reference import beside_reference
from gearsig.diagnosis._types import Analysis, CannotTell, Finding, Kind, Strength, Where
from gearsig.diagnosis._verdict import detect_data_problems, ranked, verdict_of
from gearsig.errors import InputError, RefusalError
from gearsig.indicators import Indicator
from gearsig.motion import (
    Burst,
    MotionSegments,
    StartStop,
    YieldingTeeth,
    check_wrap,
    examine_start_stop,
    find_bursts,
    is_start_stop,
    measure_motion,
    motion_segments,
    refuse_standing,
)
from gearsig.recording import Recording
from gearsig.rig import EncoderChannel, Rig, SpeedChannel, ToothContact, path_of_contact

# --------------------
# What the motion of a machine that starts and stops gives rise to: one finding each.
# --------------------


GROWN = 1.15
"""Backlash over the rig's from which on it is worth a suspicion."""
GROWN_SINCE = 1.05
"""The same over the reference's: temperature and load move it less."""
BASIS = {
    "rig": "as far as the rig file's backlash is that of the new gears",
    "reference": "as far as temperature and load are the reference's",
}
CERTAIN = 4.0
"""Standard deviations that the excess must have, too."""


def not_of_rest(problems: list[Finding], recording: Recording) -> list[Finding]:
    """Leave out what a machine at rest does to good sensors: teeth in their play carry nothing, again and again."""
    forces = {c.name for c in recording.channels if c.quantity in ("force", "torque")}
    return [p for p in problems if p.code != "channel-stuck" or not set(p.where.channels) <= forces]


def motion_finding(course: MotionSegments) -> Finding:
    """Say how often the machine starts and stops, and when it moves."""
    top = max((s.top_speed_rad_s for s in course.moving), default=0.0) * 30.0 / np.pi
    title = (
        f"The machine starts and stops: {course.summary}, at rest for {100.0 * course.standing_part:.3g} % of the "
        f"time, {course.n_reversals} change(s) of direction, up to {top:.4g} rpm."
    )
    return Finding(
        "start-stop",
        Kind.INFORMATION,
        title,
        evidence=tuple(
            f"{'forwards' if s.direction > 0 else 'backwards'} from {s.start_s:.4g} to {s.end_s:.4g} s by "
            f"{s.turned_rad / (2.0 * np.pi):.4g} revolutions"
            for s in course.moving[:8]
        ),
    )


def reference_runs_on() -> Finding:
    """Say that a reference of steady rotation is of no use here."""
    return Finding(
        "reference-not-compared",
        Kind.CANNOT_TELL,
        "The reference does not start and stop: nothing is compared with it.",
        surer="A reference of the same cycle.",
    )


def left_out(course: MotionSegments, examined: StartStop | None) -> Finding:
    """Name what wants a steady speed and is not examined."""
    without_teeth = examined is None or examined.teeth is None
    what = "Cracks, bearings, shafts and meshing" if without_teeth else "Bearings, shafts and meshing"
    back = f", and it turns back by {course.backwards_rad:.3g} rad" if course.backwards_rad > 0.0 else ""
    return Finding(
        "stationary-methods-left-out",
        Kind.CANNOT_TELL,
        f"{what} are not examined: spectra, orders and averages want a speed that lasts.",
        evidence=(f"the speed falls to zero {len(course.stops_s)} time(s){back}",),
        surer="A recording in continuous rotation, some tens of revolutions at a steady speed.",
    )


def no_contact() -> Finding:
    """Say that the rig lacks what the teeth's examination wants."""
    return Finding(
        "contact-not-described",
        Kind.CANNOT_TELL,
        "Backlash and impacts are not examined: the rig does not say how the teeth touch.",
        surer="A [contact] table in the rig file, and encoders on both shafts.",
    )


def not_examined(error: RefusalError | InputError) -> Finding:
    """Say why the teeth could not be examined."""
    return Finding(
        "teeth-not-examined", Kind.CANNOT_TELL, "Backlash and impacts cannot be told.", evidence=(str(error),)
    )


def backlash_findings(examined: StartStop, rig: Rig, then: Analysis | None) -> list[Finding]:
    """Give the backlash beside the reference's, else beside the rig file's."""
    backlash = examined.backlash
    if backlash is None or rig.contact is None:
        return []
    drawn, deviation, whose, least = 2.0 * rig.contact.half_backlash_um, backlash.uncertainty_um, "rig", GROWN
    before = None if then is None or then.motion is None else then.motion.backlash
    if before is not None and before.method == backlash.method:
        drawn, deviation = before.backlash_um, float(np.hypot(before.uncertainty_um, deviation))
        whose, least = "reference", GROWN_SINCE
    is_pure = backlash.method.startswith("both flanks")
    grown = is_pure and backlash.backlash_um > max(least * drawn, drawn + CERTAIN * deviation)
    what = "The backlash" if is_pure else "The lost motion, deflection included,"
    title = f"{what} is {backlash.backlash_um:.4g} ± {backlash.uncertainty_um:.2g} µm along the line of action"
    title += f", where the {whose} {'says' if whose == 'rig' else 'has'} {drawn:.4g} µm." if drawn else "."
    floor = "backlash of the rig file" if whose == "rig" else "backlash of the reference"
    strength = Strength(backlash.backlash_um, "µm", drawn, floor, against="") if drawn else None
    pair = rig.contact.pair or rig.pairs[0].name
    return [
        Finding(
            "backlash-grown" if grown and drawn else "backlash",
            Kind.SUSPICION if grown and drawn else Kind.INFORMATION,
            title,
            Where(gear=pair),
            strength,
            confidence=0.9 if grown else 1.0,
            confidence_basis=BASIS[whose] if grown else "",
            evidence=(
                backlash.method,
                f"{backlash.n_drive} samples on the drive flank and {backlash.n_back} on the back flank",
                f"scatter {backlash.scatter_um:.3g} µm",
            ),
            surer="A recording of the same machine when it was new." if grown and whose == "rig" else "",
        )
    ]


def weak_teeth_findings(examined: StartStop, rig: Rig) -> list[Finding]:
    """Name teeth of the driver that yield more than the others, as a cracked one does."""
    found = examined.teeth
    if found is None or rig.contact is None:
        return []
    if not found.weak_teeth:
        return [_teeth_alike(found, rig.contact)]
    pair = rig.contact.pair or rig.pairs[0].name
    return [
        Finding(
            "weak-tooth",
            Kind.SUSPICION,
            f"Tooth {tooth} of the driver yields {found.extra_um[tooth - 1]:.3g} µm more than the others while it "
            f"carries alone: it has lost {100.0 * found.stiffness_loss(tooth, rig.contact.exponent):.2g} % of its "
            "stiffness.",
            Where(gear=pair, tooth=tooth),
            Strength(
                float(found.extra_um[tooth - 1]),
                "µm",
                float(found.uncertainty_um[tooth - 1]),
                "scatter of the teeth",
            ),
            confidence=0.9,
            confidence_basis="it stands out by five standard deviations; a crack, or a tooth out of place",
            evidence=(
                f"{found.n_samples[tooth - 1]} samples of that tooth; a pair yields {found.deflection_um:.3g} µm there",
            ),
            surer="A look at the root: a tooth that stands back from its place by as much looks the same at one load.",
        )
        for tooth in found.weak_teeth
    ]


def _teeth_alike(found: YieldingTeeth, contact: ToothContact) -> Finding:
    """Say that no tooth stands out, and from which loss of stiffness on one would."""
    least = 100.0 * found.min_loss(contact.exponent)
    seen = int(np.count_nonzero(np.isfinite(found.extra_um)))
    return Finding(
        "teeth-alike",
        Kind.INFORMATION,
        f"Of {seen} teeth of the driver none yields more than the others; one that had lost {least:.2g} % of its "
        "stiffness would show.",
        Where(gear=contact.pair),
        evidence=(f"compression that torque and contact do not explain; a pair yields {found.deflection_um:.3g} µm",),
        surer="A longer recording: more passes of each tooth.",
    )


def impact_findings(examined: StartStop) -> list[Finding]:
    """Count the impacts and name the hardest."""
    if not examined.impacts:
        return []
    hardest = max(examined.impacts, key=lambda impact: impact.speed_mps)
    side = "drive" if hardest.flank > 0 else "back"
    n_back = sum(impact.flank < 0 for impact in examined.impacts)
    lost = np.nansum([i.lost_j for i in examined.impacts])
    return [
        Finding(
            "flank-impacts",
            Kind.NOTICE,
            f"The flanks meet {len(examined.impacts)} times, {n_back} of them backwards; hardest at "
            f"{hardest.time_s:.5g} s with {hardest.speed_mps:.3g} m/s on the {side} flank of tooth "
            f"{hardest.driver_tooth}.",
            Where(
                tooth=hardest.driver_tooth, angle_deg=hardest.driver_angle_deg, time_s=(hardest.time_s, hardest.time_s)
            ),
            evidence=(
                f"energy {hardest.energy_j:.3g} J in the hardest, {lost:.3g} J lost in all of which a rebound was seen",
            ),
        )
    ]


def refusal_findings(examined: StartStop) -> list[Finding]:
    """Say what the motion does not tell."""
    return [
        Finding("start-stop-refusal", Kind.CANNOT_TELL, f"Cannot tell the {text.partition(':')[0]}.", evidence=(text,))
        for text in examined.refusals
    ] + [Finding("start-stop-note", Kind.NOTICE, text) for text in examined.notes]


def burst_finding(
    name: str, blows: tuple[Burst, ...], angle_rad: FloatArray, recording: Recording, rig: Rig
) -> Finding:
    """Count the blows in a vibration and place the hardest."""
    hardest = max(blows, key=lambda blow: blow.peak)
    unit = recording.channels[recording.index(name)].unit
    angle = float(angle_rad[round(hardest.time_s * recording.sampling_rate_hz)])
    return Finding(
        "vibration-blows",
        Kind.NOTICE,
        f"{len(blows)} blow(s) in {name}, the hardest with {hardest.peak:.3g} {unit} at {hardest.time_s:.5g} s.",
        Where(channels=(name,), shaft=rig.reference_shaft, angle_deg=float(np.degrees(angle) % 360.0)),
        evidence=("only blows of more than a third of the hardest, at least 4 ms apart, are counted",),
    )


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
    motion_and_angle = course_of(recording, rig)
    if motion_and_angle is not None:
        _check_standing(motion_and_angle[1], recording, rig)
    if motion_and_angle is None or not is_start_stop(motion_and_angle[0]):
        return None
    course, angle_rad = motion_and_angle
    source = recording.speed_source or rig.speed
    if isinstance(source, EncoderChannel):  # what seems to turn back may be an encoder that wraps
        check_wrap(angle_rad, recording.sampling_rate_hz, source.channel, recording.provenance.source)
    findings = [*not_of_rest(problems, recording), motion_finding(course)]
    reference_analysis = None if reference is None else _of_reference(reference, rig, settings)
    if reference is not None and reference_analysis is None:
        findings.append(reference_runs_on())
    examined, teeth_findings = _of_teeth(recording, rig, reference_analysis)
    findings += teeth_findings
    findings.append(left_out(course, examined))
    bursts = _bursts(recording, problems)
    findings += [burst_finding(name, blows, angle_rad, recording, rig) for name, blows in bursts.items() if blows]
    order = ranked(findings if reference_analysis is None else beside_reference(findings, reference_analysis))
    return Analysis(
        recording,
        recording.rig,
        CannotTell("What is the speed of the shafts?", "the machine starts and stops: there is no one speed"),
        (),
        _indicators(course, examined, bursts),
        order,
        verdict_of(order, has_reference=reference_analysis is not None),
        dict(settings),
        reference=reference_analysis,
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


def course_of(recording: Recording, rig: Rig) -> tuple[MotionSegments, FloatArray] | None:
    """Return the segments of the motion and the angle in rad, from an encoder or a speed channel; None without one."""
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
        return motion_segments(angle, rate), angle
    except InputError:  # too short for a speed
        return None


def _bursts(recording: Recording, problems: list[Finding]) -> dict[str, tuple[Burst, ...]]:
    """Return the blows of every acceleration that is sampled fast enough and not dead."""
    dead = {name for finding in problems if finding.code == "channel-dead" for name in finding.where.channels}
    names = [c.name for c in recording.channels if c.quantity == "acceleration" and c.name not in dead]
    bursts = {}
    for name in names:
        try:
            bursts[name] = find_bursts(np.asarray(recording.values(name), dtype=np.float64), recording.sampling_rate_hz)
        except InputError:  # too slow or too short for blows
            continue
    return bursts


def _indicators(
    course: MotionSegments, examined: StartStop | None, bursts: Mapping[str, tuple[Burst, ...]]
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
