"""Overall vibration against the zones of ISO 20816-3, if the rig file describes the machine's size and mounting."""

from __future__ import annotations

from collections.abc import Iterable

from gearsig.diagnosis._signals import AnalysisSignals
from gearsig.diagnosis._types import VIBRATION_ZONE, Finding, Kind, Strength, Where
from gearsig.formatting import percent
from gearsig.indicators import ZONE_LIMITS_MM_PER_S, Indicator, velocity_band_hz, velocity_shares, vibration_zone
from gearsig.rig import MachineSize

OVERALL_VELOCITY = "overall-velocity"
"""Code of the finding of the overall velocity where the zones are not known."""

STANDARD = "ISO 20816-3"
MEANINGS = {
    "A": "typical of newly commissioned machines",
    "B": "fit for unrestricted long-term operation",
    "C": "not fit for long-term operation: find the cause at the next opportunity",
    "D": "severe enough to damage the machine",
}
CAN_DO_THAT = "can do that."
"""Ends the sentence on possible causes behind the source of most of the vibration."""

DOMINANT = 0.7
"""Share of the squared velocity at which one source counts as causing it."""

N_MESH_HARMONICS = 5
CAUSES = {
    "1×": "unbalance, a bent shaft, misalignment or a resonance",
    "2×": "misalignment, looseness or a resonance; at twice the mains frequency a motor's field",
    "mesh": "load, worn or uneven teeth, misaligned gears or a resonance",
}
SPEED_RANGE_RPM = (120.0, 30_000.0)
"""Of the standard."""


def detect_vibration_zone(signals: AnalysisSignals, indicators: Iterable[Indicator]) -> list[Finding]:
    """Judge the largest overall velocity by machine group and mounting, or report why the standard does not apply.

    For machines without [machine] in the rig file only the source of most of it is reported.
    """
    machine = signals.rig.machine
    velocities = [i for i in indicators if i.name == "overall velocity"]
    if machine is None:
        return [_without_zone(signals, max(velocities, key=lambda i: i.value))] if velocities else []
    reason = _why_not(machine, signals, velocities)
    if reason:
        title = f"The zones of {STANDARD} are not applicable: {reason}."
        return [Finding("vibration-zone-not-applicable", Kind.INFORMATION, title)]
    largest = max(velocities, key=lambda i: i.value)
    group, mounting = machine.group or 0, machine.mounting
    limits = ZONE_LIMITS_MM_PER_S[group, mounting]
    zone = vibration_zone(largest.value, group, mounting)
    source, causes = _source(signals, largest)
    size = (
        f"{machine.power_kw:g} kW"
        if machine.shaft_height_mm is None
        else f"shaft height {machine.shaft_height_mm:g} mm"
    )
    limit = limits[min("ABCD".index(zone), 2)]
    boundaries = f"boundaries A/B, B/C, C/D at {limits[0]:g}, {limits[1]:g}, {limits[2]:g} mm/s rms, {largest.band}"
    evidence = [
        f"Group {group} ({size}) and mounting are from the rig file; {boundaries} ({STANDARD}:2022, annex A).",
        "It applies at bearing housings, in situ and at steady speed; displacement and changes count as well.",
    ]
    if signals.rig.pairs:
        evidence.append("It is for the machine that drives the gears or is driven by them; gear units: ISO 20816-9.")
    evidence += _possible(source, causes)
    above = f"; {source}" if source and zone in "CD" else ""
    return [
        Finding(
            VIBRATION_ZONE,
            Kind.NOTICE if zone in "CD" else Kind.INFORMATION,
            f"Overall vibration {largest.value:.3g} mm/s rms in channel {largest.channel}: zone {zone} of {STANDARD} "
            f"(group {group}, {mounting}), {MEANINGS[zone]}{above}.",
            Where((largest.channel,)),
            Strength(largest.value, "mm/s", limit, "boundary of the zone", against="a boundary of"),
            confidence_basis="direct measurement",
            evidence=tuple(evidence),
        )
    ]


def _without_zone(signals: AnalysisSignals, largest: Indicator) -> Finding:
    """Return the overall velocity of a machine whose zones are unknown, and what causes most of it."""
    source, causes = _source(signals, largest)
    lowest = min(limits[2] for limits in ZONE_LIMITS_MM_PER_S.values())
    is_loud = largest.value > lowest
    loud = f", which is zone D of {STANDARD} for some machines" if is_loud else ""
    return Finding(
        OVERALL_VELOCITY,
        Kind.NOTICE if is_loud else Kind.INFORMATION,
        f"Overall vibration {largest.value:.3g} mm/s rms in channel {largest.channel}, {largest.band}{loud}"
        f"{f'; {source}' if source else ''}.",
        Where((largest.channel,)),
        confidence_basis="direct measurement",
        evidence=(*_possible(source, causes), f"Zones of {STANDARD} need [machine] in the rig file."),
        surer="[machine] in the rig file, with power and mounting." if is_loud else "",
    )


def _possible(source: str, causes: str) -> list[str]:
    return [f"{causes[0].upper()}{causes[1:]} {CAN_DO_THAT}"] if source else []


def _source(signals: AnalysisSignals, velocity: Indicator) -> tuple[str, str]:
    """Return the source of most of an overall velocity, and its possible causes; empty if no single one dominates.

    The sources are the first two orders of each shaft, and each gear pair's mesh harmonics.
    """
    if signals.angle is None:
        return "", ""
    per_order_hz = signals.frequency_per_order_hz
    places_hz: dict[str, list[float]] = {}
    causes: dict[str, str] = {}
    for name, order in signals.known_shaft_orders.items():
        for k in (1, 2):
            place = f"{k} × shaft {name or 'speed'}"
            places_hz[place], causes[place] = [k * order * per_order_hz], CAUSES[f"{k}×"]
    for name, order in signals.known_mesh_orders.items():
        place = f"the mesh harmonics of gear pair {name}"
        places_hz[place] = [k * order * per_order_hz for k in range(1, N_MESH_HARMONICS + 1)]
        causes[place] = CAUSES["mesh"]
    channel = signals.recording.channels[signals.recording.index(velocity.channel)]
    band_hz = velocity_band_hz(signals.angle.mean_speed_rpm)
    shares = velocity_shares(signals.spectra[channel.name], channel, places_hz, band_hz)
    place = max(shares, key=shares.__getitem__, default="")
    if shares.get(place, 0.0) < DOMINANT:
        return "", ""
    return f"{percent(shares[place])} of its power is at {place}", causes[place]


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
