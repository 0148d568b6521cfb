"""Damage at one tooth: a local event of the difference signal that comes back every revolution of its shaft."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

from gearsig.diagnosis.confidence import WITH_ASSUMED_DATA, from_p_value, p_text
from gearsig.diagnosis.confirmation import mesh_is_confirmed
from gearsig.diagnosis.detectors.mesh import teeth_are_contradicted
from gearsig.diagnosis.detectors.other_events import (
    event_in_some_revolutions,
    event_strength,
    several_events,
    single_shock,
)
from gearsig.diagnosis.events import LocalEvent, largest_event
from gearsig.diagnosis.signals import ShaftSignals, Signals
from gearsig.diagnosis.types import Finding, Kind, Where
from gearsig.severity.shaft_lines import has_mark

WORTH_SAYING = (0.01, 8.0)
CLEAR = (0.001, 10.0)
"""p-value at most, and dB of the window over the median window at least."""

REPEATABLE = 0.7
"""Correlation of odd and even revolutions in the window; chance impacts give about 0."""

SMALLEST_SHARE = 0.05
SMALLEST_SIGNIFICANCE = 3.0
"""Rms in the window against that of the whole average, and against the average's standard error there: below, an event
is too small to matter, or is made by the ends of the record."""

EVERY_REVOLUTION = 0.75
"""Part of the revolutions that must carry an event for it to be this shaft's, and not a slower one's."""

TEETH_THAT_DIFFER_DB = 14.7
"""Largest of some forty teeth over the median one that one gear in a hundred reaches: chi-square, one degree."""

LARGEST_BLIND_SHARE = 0.5
"""If an event as large as half of the average's rms would not have shown, nothing is said about the teeth."""

CAUSE = 0.9
"""Share of once-per-revolution events on a shaft with gears that are damage to a tooth, not a key, coupling or rub."""

NEAR_MARK_DEG = 6.0

ASK_FOR_REFERENCE = (
    "A recording of the same gears when they were sound, given with --reference: what teeth are made with cancels."
)
MORE_SURER = "More revolutions, a sensor nearer to the gears, a higher load; certain data of the machine."


@dataclass(frozen=True)
class _Examined:
    shaft: ShaftSignals
    event: LocalEvent
    p_value: float


def detect_tooth_damage(signals: Signals) -> list[Finding]:
    """Look at each shaft's difference signals for a local event, and say which shafts could not be examined."""
    able = [s for s in signals.shafts if s.separated and _why_blind(signals, s) == ""]
    tested = [(s, largest_event(s, signals)) for s in able]
    examined = [_Examined(s, event, min(1.0, event.place.p_value * len(tested))) for s, event in tested]
    found = [(e, _finding(signals, e)) for e in _one_per_pair_of_twins(signals, examined)]
    findings = [f for _, f in found if f is not None]
    codes = {f.code for f in findings}
    shocks = [f for f in findings if f.code == "single-shock"]
    findings = [f for f in findings if f not in shocks[1:]]  # every shaft's average shows the same one
    if "tooth-local-damage" in codes:  # events of other shafts are its images
        findings = [f for f in findings if f.code in ("tooth-local-damage", "single-shock")]
    elif "event-in-some-revolutions" not in codes:  # with it, even the speed is in doubt
        findings += _nothing_found(signals, [e for e, f in found if f is None])
        covered = [e for e, f in found if f is not None]
        reason, given = "other local events would cover damage", signals.has_reference
        findings += [_undecided(covered, reason, has_reference=given)] if covered else []
    return findings + _not_examined(signals, {s.shaft for s in able})


def _finding(signals: Signals, examined: _Examined) -> Finding | None:
    """Return what an event is: damage, several events, one that is not in every revolution; None if it is nothing."""
    event = examined.event
    if event.is_equally_spaced and _is_steady(event) and event.place.ratio_db >= WORTH_SAYING[1]:
        return several_events(examined.shaft, event)  # their own energy raises the median: the test is not for them
    if not _reaches(WORTH_SAYING, examined) or event.rms < SMALLEST_SHARE * event.average_rms:
        return None
    if event.single_revolution is not None:
        return single_shock(examined.shaft, event)
    if event.share_of_revolutions < EVERY_REVOLUTION:
        return event_in_some_revolutions(signals, examined.shaft, event)
    return _damage(signals, examined) if _is_steady(event) else None


def _is_steady(event: LocalEvent) -> bool:
    """Whether an event is of some size, and in odd and even revolutions alike."""
    large = event.rms >= max(SMALLEST_SHARE * event.average_rms, SMALLEST_SIGNIFICANCE * event.error_rms)
    return large and event.place.repeatability >= REPEATABLE


def _damage(signals: Signals, examined: _Examined) -> Finding:
    shaft, event = examined.shaft, examined.event
    assumed = ", ".join(signals.rig.assumed)
    at_mark = _at_mark(signals, examined)
    confidence = from_p_value(examined.p_value) * CAUSE * (WITH_ASSUMED_DATA if assumed or at_mark else 1.0)
    clear = _reaches(CLEAR, examined) and not assumed and not at_mark
    place = event.place
    tooth = int(place.angle_rev * shaft.teeth[0]) + 1 if len(shaft.teeth) == 1 and _has_mark(signals, shaft) else None
    at = f"at {360 * place.angle_rev:.0f}°, tooth {tooth} of {shaft.teeth[0]}," if tooth else "at one place"
    basis = f"chance of it on a gear whose teeth merely differ: {p_text(examined.p_value)}; one in ten such events has "
    basis += "another cause on the shaft (key, coupling, rub)"
    what = "Local tooth damage" if clear else "A local event, perhaps tooth damage,"
    return Finding(
        "tooth-local-damage",
        Kind.FAULT if clear else Kind.SUSPICION,
        f"{what} {at} of shaft {_names(signals, shaft)}.",
        Where(
            _channels(shaft, event),
            shaft=shaft.shaft,
            gear=_gear_name(signals, shaft),
            angle_deg=360 * place.angle_rev,
            tooth=tooth,
        ),
        event_strength(examined.shaft, event),
        confidence=confidence,
        confidence_basis=basis + (f"; halved because {assumed} are assumed" if assumed else ""),
        evidence=_evidence(signals, examined),
        surer=_surer(signals),
    )


def _one_per_pair_of_twins(signals: Signals, examined: list[_Examined]) -> list[_Examined]:
    """Keep one of two shafts of equal speed: their averages hold the same events."""
    kept = list(examined)
    for one, other in combinations(examined, 2):
        equal = abs((signals.rig.ratio(one.shaft.shaft) or 1) / (signals.rig.ratio(other.shaft.shaft) or 1) - 1) < 1e-9
        if equal and one in kept and other in kept:
            kept.remove(other)
    return kept


def _names(signals: Signals, shaft: ShaftSignals) -> str:
    own = signals.rig.ratio(shaft.shaft) or 1.0
    twins = [n for n, order in signals.known_shaft_orders.items() if abs(order / own - 1) < 1e-9 and n != shaft.shaft]
    return " or ".join([shaft.shaft, *twins])


def _reaches(level: tuple[float, float], examined: _Examined) -> bool:
    return examined.p_value <= level[0] and examined.event.place.ratio_db >= level[1]


def _has_mark(signals: Signals, shaft: ShaftSignals) -> bool:
    """Whether the angle of this very shaft counts from a mark that is there once per revolution."""
    return has_mark(signals.recording, signals.rig, shaft.shaft)


def _at_mark(signals: Signals, examined: _Examined) -> bool:
    """Whether the event is where the tachometer's pulse is, which crosses over into bad cables."""
    degrees = 360 * examined.event.place.angle_rev
    return _has_mark(signals, examined.shaft) and min(degrees, 360 - degrees) < NEAR_MARK_DEG


def _channels(shaft: ShaftSignals, event: LocalEvent) -> tuple[str, ...]:
    strong = [n for n, s in zip(shaft.separated, event.place.channel_shares, strict=True) if s >= 4.0]
    return tuple(strong) or (event.channel,)


def _evidence(signals: Signals, examined: _Examined) -> tuple[str, ...]:
    shaft, event = examined.shaft, examined.event
    texts = [
        f"Energy in one tooth pitch is {event.place.ratio_db:.1f} dB over the median pitch, all channels together.",
        f"{shaft.averages[event.channel].n_revolutions} revolutions were averaged.",
        f"It comes back: odd and even revolutions correlate there by {event.place.repeatability:.2f}.",
        f"Its rms is {100 * event.rms / event.average_rms:.0f} % of the whole average's.",
    ]
    if len(event.peaks_rev) > 1:
        texts.append(f"It is the largest of {len(event.peaks_rev)} local events: several teeth, or another cause.")
    if _at_mark(signals, examined):
        texts.append("It is at the tachometer's mark: cross-talk from its cable would look the same.")
    if not _has_mark(signals, shaft):
        texts.append("No once-per-revolution mark is on this shaft: the angle holds for this record's average only.")
    elif len(shaft.teeth) == 1:
        texts.append("Teeth count from 1 at the mark, as they engage; the place is good to about one tooth.")
    if len(shaft.teeth) > 1:
        teeth = ", ".join(map(str, shaft.teeth))
        texts.append(f"The shaft carries {len(shaft.teeth)} gears ({teeth} teeth); it may be on either.")
    return tuple(texts)


def _surer(signals: Signals) -> str:
    if signals.rig.assumed:
        return "Confirm what is assumed of the rig: " + ", ".join(signals.rig.assumed) + "."
    good = "" if signals.has_reference else ", or of the same gearbox when it was good"
    if signals.angle is not None and signals.angle.method in ("tachless", "constant", "speed channel"):
        return f"A recording with a tachometer, or at another load{good}."
    return f"A recording at another load or speed (damage stays at its tooth){good}."


def _nothing_found(signals: Signals, examined: list[_Examined]) -> list[Finding]:
    """State that nothing shows, of those shafts where damage of a useful size would have shown."""
    given = signals.has_reference
    if examined and signals.rig.assumed:
        assumed = ", ".join(signals.rig.assumed)
        return [_undecided(examined, f"{assumed} are assumed: damage may not show", has_reference=given)]
    sharp = [e for e in examined if _smallest_visible(e.event) <= LARGEST_BLIND_SHARE * e.event.average_rms]
    blunt = [e for e in examined if e not in sharp]
    findings = []
    if sharp:
        shafts = ", ".join(e.shaft.shaft for e in sharp)
        findings.append(
            Finding(
                "no-tooth-local-damage",
                Kind.INFORMATION,
                f"No local tooth damage shows on shaft(s) {shafts}.",
                Where(channels=tuple(sharp[0].shaft.separated), shaft=sharp[0].shaft.shaft if len(sharp) == 1 else ""),
                confidence=0.8,
                confidence_basis="small damage may be hidden below the mesh's own variation",
                evidence=tuple(_visible_text(e) for e in sharp),
                surer=_surer(signals),
            )
        )
    noisy = [e for e in blunt if _is_noise(e.event)]
    uneven = [e for e in blunt if e not in noisy]
    if noisy:
        reason = "noise would hide an event of half the average's size"
        findings.append(_undecided(noisy, reason, has_reference=given))
    if uneven:
        reason = "they differ so much from each other that damage may hide among them"
        findings.append(_undecided(uneven, reason, has_reference=given))
    return findings


def _undecided(examined: list[_Examined], reason: str, *, has_reference: bool) -> Finding:
    shafts = ", ".join(e.shaft.shaft for e in examined)
    return Finding(
        "tooth-damage-undecided",
        Kind.CANNOT_TELL,
        f"Nothing shows at the teeth of shaft(s) {shafts}, but {reason}.",
        Where(channels=tuple(examined[0].shaft.separated)),
        evidence=tuple(_visible_text(e) for e in examined),
        surer=MORE_SURER if has_reference else f"{ASK_FOR_REFERENCE} Or {MORE_SURER[0].lower()}{MORE_SURER[1:]}",
    )


def _is_noise(event: LocalEvent) -> bool:
    """Whether the median tooth's part of the difference signal is mostly noise that the average has left."""
    return event.median_rms <= SMALLEST_SIGNIFICANCE * event.error_rms


def _smallest_visible(event: LocalEvent) -> float:
    """Return the rms in a window from which an event stands out from teeth that merely differ."""
    return event.median_rms * float(10 ** (TEETH_THAT_DIFFER_DB / 20))


def _visible_text(examined: _Examined) -> str:
    event = examined.event
    smallest = _smallest_visible(event)
    share = 100 * smallest / event.average_rms if event.average_rms > 0 else 0.0
    return (
        f"Shaft {examined.shaft.shaft}: the largest tooth is {event.place.ratio_db:.1f} dB over the median (chance if "
        f"teeth merely differ: {p_text(examined.p_value)}). An event of {smallest:.3g} rms in {event.channel}, "
        f"{share:.0f} % of the average, would have shown."
    )


def _why_blind(signals: Signals, shaft: ShaftSignals) -> str:
    """Return why the teeth of a shaft cannot be looked at although there is an average; empty if they can."""
    pairs = [p for p in signals.rig.pairs if shaft.shaft in (p.driver, p.driven)]
    for pair in pairs:
        real = teeth_are_contradicted(signals, pair)
        if real is not None:
            return f"the mesh of {pair.name} is at order {real:.5g}, not where its teeth put it"
    if not any(mesh_is_confirmed(signals, pair) for pair in pairs):
        return "no mesh line stands where speed and teeth put it"
    return ""


def _not_examined(signals: Signals, examined: set[str]) -> list[Finding]:
    """Say of each shaft with gears why its teeth were not looked at."""
    reasons: dict[str, list[str]] = {}
    for shaft in dict.fromkeys(s for pair in signals.rig.pairs for s in (pair.driver, pair.driven)):
        if shaft not in examined:
            reasons.setdefault(_reason(signals, shaft), []).append(shaft)
    return [
        Finding(
            "tooth-not-examined",
            Kind.CANNOT_TELL,
            f"Teeth on shaft(s) {', '.join(shafts)} cannot be examined: {reason}.",
            surer="A longer recording with a tachometer, the right teeth of all gears, a higher sampling rate.",
        )
        for reason, shafts in reasons.items()
    ]


def _reason(signals: Signals, name: str) -> str:
    if signals.angle is None:
        return "the speed is not known"
    ratio = signals.rig.ratio(name)
    if ratio is None:
        return "a tooth count on the way to it is missing"
    revolutions, needed = signals.angle.n_revolutions * ratio, signals.settings.minimum_revolutions
    if revolutions < needed:
        return f"the record holds {revolutions:.3g} of its revolutions and {needed} are needed"
    for shaft in signals.shafts:
        if shaft.shaft == name and shaft.separated:
            return _why_blind(signals, shaft)
    return "its gear has no known teeth, its mesh is above half the sampling rate, or the record is too short"


def _gear_name(signals: Signals, shaft: ShaftSignals) -> str:
    pairs = [p.name for p in signals.rig.pairs if shaft.shaft in (p.driver, p.driven)]
    return f"{pairs[0]}/{shaft.shaft}" if len(pairs) == 1 else ""
