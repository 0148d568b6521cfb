"""What the motion of a machine that starts and stops gives rise to: one finding each."""

from __future__ import annotations

import numpy as np

from gearsig.checks import FloatArray
from gearsig.diagnosis.types import Analysis, Finding, Kind, Strength, Where
from gearsig.errors import InputError, RefusalError
from gearsig.motion.bursts import Burst
from gearsig.motion.course import Course
from gearsig.motion.start_stop import StartStop
from gearsig.motion.tooth_compliance import ToothCompliance
from gearsig.recording.types import Recording
from gearsig.rig.contact import ToothContact
from gearsig.rig.types import Rig

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
    """Leave out what a machine at rest does to sound sensors: teeth in their play carry nothing, again and again."""
    forces = {c.name for c in recording.channels if c.quantity in ("force", "torque")}
    return [p for p in problems if p.code != "channel-stuck" or not set(p.where.channels) <= forces]


def motion_finding(course: Course) -> Finding:
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


def left_out(course: Course, examined: StartStop | None) -> Finding:
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
    found = examined.backlash
    if found is None or rig.contact is None:
        return []
    drawn, deviation, whose, least = 2.0 * rig.contact.half_backlash_um, found.uncertainty_um, "rig", GROWN
    before = None if then is None or then.motion is None else then.motion.backlash
    if before is not None and before.method == found.method:
        drawn, deviation = before.backlash_um, float(np.hypot(before.uncertainty_um, deviation))
        whose, least = "reference", GROWN_SINCE
    is_pure = found.method.startswith("both flanks")
    grown = is_pure and found.backlash_um > max(least * drawn, drawn + CERTAIN * deviation)
    what = "The backlash" if is_pure else "The lost motion, deflection included,"
    title = f"{what} is {found.backlash_um:.4g} ± {found.uncertainty_um:.2g} µm along the line of action"
    title += f", where the {whose} {'says' if whose == 'rig' else 'has'} {drawn:.4g} µm." if drawn else "."
    floor = "backlash of the rig file" if whose == "rig" else "backlash of the reference"
    strength = Strength(found.backlash_um, "µm", drawn, floor, against="") if drawn else None
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
                found.method,
                f"{found.n_drive} samples on the drive flank and {found.n_back} on the back flank",
                f"scatter {found.scatter_um:.3g} µm",
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


def _teeth_alike(found: ToothCompliance, contact: ToothContact) -> Finding:
    """Say that no tooth stands out, and from which loss of stiffness on one would."""
    least = 100.0 * found.least_loss(contact.exponent)
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
