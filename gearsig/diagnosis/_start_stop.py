"""Recordings of machines that start, stop and reverse: recognised, and examined without assuming a steady speed."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from gearsig import motion as motions
from gearsig.checks import FloatArray
from gearsig.diagnosis._reference import beside_reference
from gearsig.diagnosis._types import Analysis, CannotTell, Finding, Kind, Strength, Where, cannot_tell
from gearsig.diagnosis._verdict import detect_data_problems, ranked, verdict_of
from gearsig.errors import InputError, RefusalError
from gearsig.formatting import counted
from gearsig.indicators import Indicator
from gearsig.motion import Burst, MotionSegments, StartStop
from gearsig.prepared import prepare
from gearsig.recording import Recording
from gearsig.rig import EncoderChannel, Rig, SpeedChannel, path_of_contact

Settings = Mapping[str, str | float | int | None]


def start_stop_analysis(
    recording: Recording, rig: Rig, problems: list[Finding], settings: Settings, reference: Recording | None = None
) -> Analysis | None:
    """Return the analysis of a start–stop recording, or None if the motion is of another kind or unknown.

    Only an encoder or a speed channel can decide, as both show standstill and direction. With a reference, the backlash
    is compared with the reference's instead of the rig file's, and suspicions say whether the reference shows them as
    well.

    Raises
    ------
    InputError
        If the encoder's angle restarts after each revolution and the rig does not say so.
    RefusalError
        If a machine whose contact the rig describes is always at rest.
    """
    angle_rad = _angle_rad(recording, rig)
    try:
        segments = None if angle_rad is None else motions.motion_segments(angle_rad, recording.sampling_rate_hz)
    except InputError:  # too short for a speed
        segments = None
    if angle_rad is None or segments is None:
        return None
    _check_standing(angle_rad, recording, rig)
    if not motions.is_start_stop(segments):
        return None
    source = recording.speed_source or rig.speed
    if isinstance(source, EncoderChannel):  # an apparent reversal may be an encoder that wraps
        motions.check_wrap(angle_rad, recording.sampling_rate_hz, source.channel, recording.provenance.source)
    # What healthy sensors do on a machine at rest is no problem: teeth within their backlash carry nothing repeatedly.
    forces = {c.name for c in recording.channels if c.quantity in ("force", "torque")}
    findings = [p for p in problems if p.code != "channel-stuck" or not set(p.where.channels) <= forces]
    findings.append(_motion_finding(segments))
    reference_analysis = None
    if reference is not None:
        healthy = reference if reference.rig is not None else reference.with_rig(rig)
        reference_analysis = start_stop_analysis(healthy, rig, detect_data_problems(prepare(healthy))[0], settings)
        if reference_analysis is None:
            title = "The reference does not start and stop: nothing is compared with it."
            findings.append(cannot_tell("reference-not-compared", title, surer="A reference of the same cycle."))
    examined, of_teeth = _examined_teeth(recording, rig, reference_analysis)
    findings += [*of_teeth, _left_out(segments, examined)]
    bursts = _bursts(recording, problems)
    findings += [
        _burst_finding(name, impacts, angle_rad, recording, rig) for name, impacts in bursts.items() if impacts
    ]
    order = ranked(findings if reference_analysis is None else beside_reference(findings, reference_analysis))
    return Analysis(
        recording,
        recording.rig,
        CannotTell("What is the speed of the shafts?", "the machine starts and stops: there is no one speed"),
        (),
        _indicators(segments, examined, bursts),
        order,
        verdict_of(order, has_reference=reference_analysis is not None),
        dict(settings),
        reference=reference_analysis,
        motion=examined,
    )


def _angle_rad(recording: Recording, rig: Rig) -> FloatArray | None:
    """Return the shaft's angle in rad from an encoder or a speed channel; None without one."""
    source = recording.speed_source or rig.speed
    if not isinstance(source, (EncoderChannel, SpeedChannel)) or source.channel not in recording.channel_names:
        return None
    values = np.asarray(recording.values(source.channel), dtype=np.float64)
    angle: FloatArray
    if isinstance(source, SpeedChannel):
        angle = np.cumsum(values * source.rpm_per_unit * np.pi / 30.0) / recording.sampling_rate_hz
    else:
        revolutions = values / source.units_per_revolution
        angle = 2.0 * np.pi * (np.unwrap(revolutions, period=1.0) if source.wraps else revolutions)
    return angle


def _check_standing(angle_rad: FloatArray, recording: Recording, rig: Rig) -> None:
    """Refuse a machine that is always at rest, if its contact gives the distance between its teeth."""
    if rig.contact is None:
        return
    try:
        path = path_of_contact(rig)
    except RefusalError:  # without geometry the rest can still be examined
        return
    motions.check_driver_turns(angle_rad, path, rig.contact, recording.sampling_rate_hz, recording.provenance.source)


def _motion_finding(segments: MotionSegments) -> Finding:
    """Return the finding on how often the machine starts and stops, and when it moves."""
    top_rpm = segments.top_speed_rpm
    return Finding(
        "start-stop",
        Kind.INFORMATION,
        f"The machine starts and stops: {segments.summary}, at rest for {100.0 * segments.standing_part:.3g} % of the "
        f"time, {counted(segments.n_reversals, 'change')} of direction, up to {top_rpm:.4g} rpm.",
        evidence=tuple(
            f"{'forwards' if s.direction > 0 else 'backwards'} from {s.start_s:.4g} to {s.end_s:.4g} s by "
            f"{s.turned_rad / (2.0 * np.pi):.4g} revolutions"
            for s in segments.moving[:8]
        ),
    )


def _left_out(segments: MotionSegments, examined: StartStop | None) -> Finding:
    """Return the finding on what requires a steady speed and is not examined."""
    without_teeth = examined is None or examined.teeth is None
    what = "Cracks, bearings, shafts and meshing" if without_teeth else "Bearings, shafts and meshing"
    back = f", and it turns back by {segments.backwards_rad:.3g} rad" if segments.backwards_rad > 0.0 else ""
    return cannot_tell(
        "stationary-methods-left-out",
        f"{what} are not examined: spectra, orders and averages need a steady speed.",
        evidence=(f"the speed falls to zero {counted(len(segments.stops_s), 'time')}{back}",),
        surer="A recording in continuous rotation, some tens of revolutions at a steady speed.",
    )


def _examined_teeth(recording: Recording, rig: Rig, then: Analysis | None) -> tuple[StartStop | None, list[Finding]]:
    """Examine the teeth, if the rig describes their contact and the recording allows it."""
    if rig.contact is None:
        finding = cannot_tell(
            "contact-not-described",
            "Backlash and impacts are not examined: the rig does not say how the teeth touch.",
            surer="A [contact] table in the rig file, and encoders on both shafts.",
        )
        return None, [finding]
    try:
        examined = motions.examine_start_stop(motions.measure_motion(recording, rig))
    except (RefusalError, InputError) as error:
        title = "Backlash and impacts cannot be told."
        return None, [cannot_tell("teeth-not-examined", title, evidence=(str(error),))]
    findings = [*_backlash(examined, rig, then), *_weak_teeth(examined, rig), *_impacts(examined)]
    findings += [
        cannot_tell("start-stop-refusal", f"Cannot tell the {text.partition(':')[0]}.", evidence=(text,))
        for text in examined.refusals
    ]
    return examined, findings + [Finding("start-stop-note", Kind.NOTICE, text) for text in examined.notes]


def _backlash(examined: StartStop, rig: Rig, then: Analysis | None) -> Iterator[Finding]:
    """Yield the backlash compared with the reference's, else with the rig file's.

    It has grown if it exceeds that by 5 % and by four standard deviations; over the rig file's value by 15 %, because
    temperature and load change it less than drawings are off.
    """
    backlash = examined.backlash
    if backlash is None or rig.contact is None:
        return
    usual_um, deviation_um = 2.0 * rig.contact.half_backlash_um, backlash.uncertainty_um
    whose, minimum_ratio = "rig", 1.15
    basis = "as far as the rig file's backlash is that of the new gears"
    before = None if then is None or then.motion is None else then.motion.backlash
    if before is not None and before.method == backlash.method:
        usual_um, deviation_um = before.backlash_um, float(np.hypot(before.uncertainty_um, deviation_um))
        whose, minimum_ratio, basis = "reference", 1.05, "as far as temperature and load are the reference's"
    is_pure = backlash.method.startswith("both flanks")
    grown_um = max(minimum_ratio * usual_um, usual_um + 4.0 * deviation_um)
    grown = is_pure and usual_um > 0.0 and backlash.backlash_um > grown_um
    what = "The backlash" if is_pure else "The lost motion, deflection included,"
    title = f"{what} is {backlash.backlash_um:.4g} ± {backlash.uncertainty_um:.2g} µm along the line of action"
    title += f", where the {whose} {'says' if whose == 'rig' else 'has'} {usual_um:.4g} µm." if usual_um else "."
    floor = "backlash of the rig file" if whose == "rig" else "backlash of the reference"
    yield Finding(
        "backlash-grown" if grown else "backlash",
        Kind.SUSPICION if grown else Kind.INFORMATION,
        title,
        Where(gear=rig.contact.pair or rig.pairs[0].name),
        Strength(backlash.backlash_um, "µm", usual_um, floor, against="") if usual_um else None,
        confidence=0.9 if grown else 1.0,
        confidence_basis=basis if grown else "",
        evidence=(
            backlash.method,
            f"{backlash.n_drive} samples on the drive flank and {backlash.n_back} on the back flank",
            f"scatter {backlash.scatter_um:.3g} µm",
        ),
        surer="A recording of the same machine when it was new." if grown and whose == "rig" else "",
    )


def _weak_teeth(examined: StartStop, rig: Rig) -> Iterator[Finding]:
    """Yield driver teeth more compliant than the others, as if cracked; or the loss of stiffness that would show."""
    teeth, contact = examined.teeth, rig.contact
    if teeth is None or contact is None:
        return
    for tooth in teeth.weak_teeth:
        extra_um, deviation_um = (float(v[tooth - 1]) for v in (teeth.extra_um, teeth.uncertainty_um))
        lost_percent = 100.0 * teeth.stiffness_loss(tooth, contact.exponent)
        yield Finding(
            "weak-tooth",
            Kind.SUSPICION,
            f"Tooth {tooth} of the driver yields {extra_um:.3g} µm more than the others while it carries alone: it has "
            f"lost {lost_percent:.2g} % of its stiffness.",
            Where(gear=contact.pair or rig.pairs[0].name, tooth=tooth),
            Strength(extra_um, "µm", deviation_um, "scatter of the teeth"),
            confidence=0.9,
            confidence_basis="it stands out by five standard deviations; a crack, or a tooth out of place",
            evidence=(
                f"{teeth.n_samples[tooth - 1]} samples of that tooth; a pair yields {teeth.deflection_um:.3g} µm there",
            ),
            surer="A look at the root: a tooth that stands back from its place by as much looks the same at one load.",
        )
    if not teeth.weak_teeth:
        seen = int(np.count_nonzero(np.isfinite(teeth.extra_um)))
        yield Finding(
            "teeth-alike",
            Kind.INFORMATION,
            f"Of {seen} teeth of the driver none yields more than the others; one that had lost "
            f"{100.0 * teeth.min_loss(contact.exponent):.2g} % of its stiffness would show.",
            Where(gear=contact.pair),
            evidence=(
                f"compression that torque and contact do not explain; a pair yields {teeth.deflection_um:.3g} µm",
            ),
            surer="A longer recording: more passes of each tooth.",
        )


def _impacts(examined: StartStop) -> Iterator[Finding]:
    """Yield the finding on the number of impacts and the hardest."""
    if not examined.impacts:
        return
    hardest = max(examined.impacts, key=lambda impact: impact.speed_mps)
    side = "drive" if hardest.flank > 0 else "back"
    n_back = sum(impact.flank < 0 for impact in examined.impacts)
    lost_j = np.nansum([i.lost_j for i in examined.impacts])
    tooth, at = hardest.driver_tooth, (hardest.time_s, hardest.time_s)
    yield Finding(
        "flank-impacts",
        Kind.NOTICE,
        f"The flanks meet {len(examined.impacts)} times, {n_back} of them backwards; hardest at {hardest.time_s:.5g} s "
        f"with {hardest.speed_mps:.3g} m/s on the {side} flank of tooth {tooth}.",
        Where(tooth=tooth, angle_deg=hardest.driver_angle_deg, time_s=at),
        evidence=(
            f"energy {hardest.energy_j:.3g} J in the hardest, {lost_j:.3g} J lost in all with a visible rebound",
        ),
    )


def _bursts(recording: Recording, problems: list[Finding]) -> dict[str, tuple[Burst, ...]]:
    """Return the impacts in every acceleration channel that is sampled fast enough and not dead."""
    dead = {name for finding in problems if finding.code == "channel-dead" for name in finding.where.channels}
    bursts = {}
    for channel in recording.channels:
        if channel.quantity == "acceleration" and channel.name not in dead:
            values = np.asarray(recording.values(channel.name), dtype=np.float64)
            try:
                bursts[channel.name] = motions.find_bursts(values, recording.sampling_rate_hz)
            except InputError:  # sampled too slowly or too short for impacts
                continue
    return bursts


def _burst_finding(
    name: str, impacts: tuple[Burst, ...], angle_rad: FloatArray, recording: Recording, rig: Rig
) -> Finding:
    """Return the finding on the number of impacts in a vibration, and the time of the hardest."""
    hardest = max(impacts, key=lambda impact: impact.peak)
    unit = recording.channels[recording.index(name)].unit
    angle = float(angle_rad[round(hardest.time_s * recording.sampling_rate_hz)])
    return Finding(
        "vibration-impacts",
        Kind.NOTICE,
        f"{counted(len(impacts), 'impact')} in {name}, the hardest with {hardest.peak:.3g} {unit} "
        f"at {hardest.time_s:.5g} s.",
        Where(channels=(name,), shaft=rig.reference_shaft, angle_deg=float(np.degrees(angle) % 360.0)),
        evidence=("only impacts of more than a third of the hardest, at least 4 ms apart, are counted",),
    )


def _indicators(
    segments: MotionSegments, examined: StartStop | None, bursts: Mapping[str, tuple[Burst, ...]]
) -> tuple[Indicator, ...]:
    counts = {
        "starts": len(segments.starts_s),
        "stops": len(segments.stops_s),
        "reversals": segments.n_reversals,
        "standing part": segments.standing_part,
    }
    rows = tuple(Indicator(name, float(value), computed_on="motion") for name, value in counts.items())
    n_cycles = max(1, len(segments.moving))
    impacts = tuple(Indicator("impacts per cycle", len(b) / n_cycles, channel=n) for n, b in bursts.items())
    return (*(rows if examined is None else examined.indicators), *impacts)
