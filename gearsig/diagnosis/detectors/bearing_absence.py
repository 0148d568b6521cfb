"""Bearings in which nothing shows: good as far as damage would have shown, else undecided."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from gearsig.diagnosis.confirmation import speed_is_confirmed
from gearsig.diagnosis.detectors.bearing_family import PARTS, Families, expected_parts, slip_of
from gearsig.diagnosis.detectors.bearing_limit import CLEAR_MODULATION, smallest_depth
from gearsig.diagnosis.envelopes import BandEnvelope
from gearsig.diagnosis.signals import Signals
from gearsig.diagnosis.types import Finding, Kind, Where

RACES = ("BPFO", "BPFI")
"""Parts that must have been examined for a bearing to be called good: nearly all damage begins there."""


def none_found(signals: Signals, envelopes: Sequence[BandEnvelope], families: Families) -> list[Finding]:
    """State that nothing shows as far as it would have shown, and which parts could not have shown."""
    where = Where(channels=tuple(dict.fromkeys(e.channel for e in envelopes)))
    if not speed_is_confirmed(signals):
        why = "no line of a mesh or shaft stands where the speed puts it, so that bearing orders may be elsewhere"
        return [_undecided(why, "A tachometer, or a sensor nearer to the gears.", where)]
    if families.unclear:
        parts = ", ".join(f"{PARTS[c.name][0]} of {c.bearing.name}" for c in families.unclear if c.bearing)
        why = f"lines stand at the order of the {parts}, but families beside it are as clear"
        return [_undecided(why, "A longer recording, or another sensor.", where)]
    depths = _smallest_depths(signals, envelopes)
    examined = _examined(signals, depths)
    if not examined:
        why = f"a modulation of {100 * CLEAR_MODULATION:.0f} % would not have stood out at the orders of their races"
        return [_undecided(why, "A longer recording: the floor of the envelope spectrum falls with its root.", where)]
    surer = (
        "Another sensor nearer to the bearings, or a longer recording."
        if signals.has_reference
        else "An earlier recording of the same machine: then smaller changes show."
    )
    sound = replace(_no_damage(envelopes, examined, depths, where), surer=surer)
    return [sound, *_not_examined(signals, depths, where)]


def _smallest_depths(signals: Signals, envelopes: Sequence[BandEnvelope]) -> dict[tuple[str, str], float]:
    """Return, for each part of each bearing, the depth of modulation from which it would have shown."""
    expected = expected_parts(signals)
    probability = signals.settings.false_alarm_probability / max(1, len(expected) * len(envelopes))
    return {
        (bearing.name, name): smallest_depth(envelopes, order, slip_of(signals), probability)
        for bearing, name, order in expected
    }


def _examined(signals: Signals, depths: Mapping[tuple[str, str], float]) -> list[str]:
    """Return the bearings whose races, or what is known of them, would have shown a damage."""
    found = []
    for bearing in signals.rig.bearings:
        own = {name: depth for (owner, name), depth in depths.items() if owner == bearing.name}
        decisive = [depth for name, depth in own.items() if name in RACES] or list(own.values())
        if decisive and max(decisive) <= CLEAR_MODULATION:
            found.append(bearing.name)
    return found


def _no_damage(
    envelopes: Sequence[BandEnvelope], examined: list[str], depths: Mapping[tuple[str, str], float], where: Where
) -> Finding:
    shown = {key: depth for key, depth in depths.items() if key[0] in examined and depth <= CLEAR_MODULATION}
    bearing, name = max(shown, key=lambda key: shown[key])
    limit = f"{100 * min(shown.values()):.2g} to {100 * shown[bearing, name]:.2g} % of the mean envelope"
    return Finding(
        "no-bearing-damage",
        Kind.INFORMATION,
        f"No damage shows in the bearings ({', '.join(examined)}).",
        where,
        confidence=0.8,
        confidence_basis="early damage may be hidden below the gears",
        evidence=(
            f"No family at their orders in {len(envelopes)} envelope spectra (channels × bands).",
            f"Six equal harmonics of {limit} would have shown in half of the bands.",
            f"The most is needed at the {PARTS[name][0]} of {bearing}.",
        ),
    )


def _not_examined(signals: Signals, depths: Mapping[tuple[str, str], float], where: Where) -> list[Finding]:
    hidden = [f"{PARTS[name][0]} of {bearing}" for (bearing, name), depth in depths.items() if depth > CLEAR_MODULATION]
    findings = []
    if hidden:
        findings.append(
            Finding(
                "bearing-part-hidden",
                Kind.CANNOT_TELL,
                f"Not examined: {', '.join(hidden)}. Their orders fall on multiples of a shaft within the resolution, "
                f"or the floor there is too high for a modulation of {100 * CLEAR_MODULATION:.0f} % to show.",
                where,
                surer="A longer recording: orders that are close need many revolutions to be told apart.",
            )
        )
    unknown = [b.name for b in signals.rig.bearings if b.name not in {owner for owner, _ in depths}]
    if unknown:
        why = f"of {', '.join(unknown)} the geometry or the speed of the shaft is not known"
        findings.append(
            _undecided(why, "Geometry or orders of the bearing, and the teeth that drive its shaft.", where)
        )
    return findings


def _undecided(why: str, surer: str, where: Where) -> Finding:
    return Finding(
        "bearings-undecided",
        Kind.CANNOT_TELL,
        f"Whether the bearings are damaged cannot be told: {why}.",
        where,
        surer=surer,
    )
