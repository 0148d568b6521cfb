"""Overall vibration against the zones of ISO 20816-3, where the rig file says what the machine is."""

from __future__ import annotations

from collections.abc import Iterable

from gearsig.diagnosis._signals import AnalysisSignals
from gearsig.diagnosis._types import Finding, Kind, Strength, Where
from gearsig.indicators import ZONE_LIMITS_MM_PER_S, Indicator, vibration_zone
from gearsig.rig import MachineSize

VIBRATION_ZONE = "vibration-zone"
STANDARD = "ISO 20816-3"
MEANINGS = {
    "A": "as of machines newly set to work",
    "B": "fit for service without limit",
    "C": "not fit for long service: find the cause at the next opportunity",
    "D": "severe enough to damage the machine",
}
SPEED_RANGE_RPM = (120.0, 30_000.0)
"""Of the standard."""


def detect_vibration_zone(signals: AnalysisSignals, found: Iterable[Indicator]) -> list[Finding]:
    """Judge the largest overall velocity by machine group and mounting, or say why the standard does not apply.

    Nothing is said of machines whose rig file has no [machine].
    """
    machine = signals.rig.machine
    if machine is None:
        return []
    velocities = [i for i in found if i.name == "overall velocity"]
    reason = _why_not(machine, signals, velocities)
    if reason:
        title = f"The zones of {STANDARD} are not applicable: {reason}."
        return [Finding("vibration-zone-not-applicable", Kind.INFORMATION, title)]
    largest = max(velocities, key=lambda i: i.value)
    group, mounting = machine.group or 0, machine.mounting
    limits = ZONE_LIMITS_MM_PER_S[group, mounting]
    zone = vibration_zone(largest.value, group, mounting)
    size = (
        f"{machine.power_kw:g} kW"
        if machine.shaft_height_mm is None
        else f"shaft height {machine.shaft_height_mm:g} mm"
    )
    limit = limits[min("ABCD".index(zone), 2)]
    boundaries = f"boundaries A/B, B/C, C/D at {limits[0]:g}, {limits[1]:g}, {limits[2]:g} mm/s rms, {largest.band}"
    evidence = [
        f"Group {group} ({size}) and mounting are from the rig file; {boundaries} ({STANDARD}:2022, annex A).",
        "It holds at bearing housings, in place and at steady speed; displacement and changes count as well.",
    ]
    if signals.rig.pairs:
        evidence.append("Of the machine that the gears drive or are driven by; gear units themselves: ISO 20816-9.")
    return [
        Finding(
            VIBRATION_ZONE,
            Kind.NOTICE if zone in "CD" else Kind.INFORMATION,
            f"Overall vibration {largest.value:.3g} mm/s rms in channel {largest.channel}: zone {zone} of {STANDARD} "
            f"(group {group}, {mounting}), {MEANINGS[zone]}.",
            Where((largest.channel,)),
            Strength(largest.value, "mm/s", limit, "boundary of the zone", against="a boundary of"),
            confidence_basis="direct measurement",
            evidence=tuple(evidence),
        )
    ]


def _why_not(machine: MachineSize, signals: AnalysisSignals, velocities: list[Indicator]) -> str:
    """Return why the standard's zones do not apply, empty where they do."""
    low, high = signals.angle.speed_range_rpm if signals.angle is not None else SPEED_RANGE_RPM
    reasons = {
        "neither power_kw nor shaft_height_mm is in [machine] of the rig file": machine.power_kw is None
        and machine.shaft_height_mm is None,
        "it is for machines above 15 kW, or from a shaft height of 160 mm": machine.group is None,
        "the mounting, rigid or flexible, is not in [machine] of the rig file": not machine.mounting,
        f"it is for 120 to 30000 rpm, and the machine turns at {low:.4g} rpm": not (
            SPEED_RANGE_RPM[0] <= low and high <= SPEED_RANGE_RPM[1]
        ),
        "it is for steady speeds": signals.angle is not None and high > 1.1 * low,
        "no channel is an acceleration or a velocity in a known unit, sampled above 2 kHz for a second or more": (
            not velocities
        ),
    }
    return next((reason for reason, applies in reasons.items() if applies), "")
