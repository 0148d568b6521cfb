"""Bearings: families of lines in the envelope, at known bearing orders or at none that the rig explains."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from math import inf
from statistics import median, median_high

import numpy as np

from gearsig.diagnosis._bearing_families import (
    PARTS,
    Candidate,
    Families,
    clearest_family,
    expected_parts,
    find_families,
    slip_of,
    slower_train,
    speed_is_only_stated,
    without_synchronous,
)
from gearsig.diagnosis._lines import speed_is_confirmed
from gearsig.diagnosis._signals import AnalysisSignals, BandEnvelope, KurtogramBand, witness_text
from gearsig.diagnosis._types import WITH_ASSUMED_DATA, Finding, Kind, Strength, Where, from_p_value, p_text
from gearsig.prepared import LOG_RATIO_LIMIT, score_needed
from gearsig.rig import hunting_tooth_order

# --------------------
# How small a bearing damage would still have shown.
# --------------------


CLEAR_MODULATION = 0.05
"""Depth of the strongest line of the envelope from which a race is called damaged, not only worth watching."""

N_HARMONICS = 6
MIN_FREE = 3
"""Harmonics that must lie beside those of the shafts for a family to be seen."""


SLIPS = (-0.5, 0.0, 0.5)
"""Parts of the range searched: slip takes a part's lines to and from those of the shafts, here a median counts too."""


def smallest_depth(envelopes: Sequence[BandEnvelope], order: float, slip: float, probability: float) -> float:
    """Return the depth of modulation at which six equal harmonics near `order` would have shown in half of the bands.

    Each line needs the log ratio score/n over its floor, where `score` is what chance reaches with `probability` and n
    the number of harmonics that no shaft hides. The depth is the amplitude of such a line over the mean envelope. The
    band in which a damage rings is not known beforehand: the best one of all says little, so that it is the median
    over the bands, each with its best channel.

    Parameters
    ----------
    envelopes : sequence of BandEnvelope
        Multiples of the shafts masked.
    order : float
    slip : float
        Relative range searched to either side.
    probability : float
        Of a false alarm in one envelope.

    Returns
    -------
    float
        inf if no depth would have shown.
    """
    best: dict[tuple[float, float], float] = {}
    for envelope in envelopes:
        depth = median(_depth_in(envelope, order * (1 + part * slip), slip, probability) for part in SLIPS)
        best[envelope.band_hz] = min(depth, best.get(envelope.band_hz, inf))
    return median_high(best.values()) if best else inf


def _depth_in(envelope: BandEnvelope, order: float, slip: float, probability: float) -> float:
    excess = envelope.excess
    places = order * np.arange(1, N_HARMONICS + 1)
    places = places[places <= excess.spectrum.positions[-1]]
    index = np.array([excess.spectrum.index_of(place) for place in places], dtype=np.int64)
    free = index[~excess.masked[index]] if len(index) else index
    if len(free) < MIN_FREE or envelope.mean <= 0:
        return inf
    needed = score_needed(excess, N_HARMONICS, order * (1 - slip), order * (1 + slip), probability) / len(free)
    if needed > LOG_RATIO_LIMIT:
        return inf
    floor = float(np.exp(np.mean(np.log(np.maximum(excess.floor[free], 1e-300)))))
    return floor * float(np.exp(needed / 2)) / envelope.mean


# --------------------
# Bearings in which nothing shows: good as far as damage would have shown, else undecided.
# --------------------


RACES = ("BPFO", "BPFI")
"""Parts that must have been examined for a bearing to be called good: nearly all damage begins there."""


def none_found(signals: AnalysisSignals, envelopes: Sequence[BandEnvelope], families: Families) -> list[Finding]:
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
    no_damage = replace(_no_damage(envelopes, examined, depths, where), surer=surer)
    return [no_damage, *_not_examined(signals, depths, where)]


def _smallest_depths(signals: AnalysisSignals, envelopes: Sequence[BandEnvelope]) -> dict[tuple[str, str], float]:
    """Return, for each part of each bearing, the depth of modulation from which it would have shown."""
    expected = expected_parts(signals)
    probability = signals.settings.false_alarm_probability / max(1, len(expected) * len(envelopes))
    return {
        (bearing.name, name): smallest_depth(envelopes, order, slip_of(signals), probability)
        for bearing, name, order in expected
    }


def _examined(signals: AnalysisSignals, depths: Mapping[tuple[str, str], float]) -> list[str]:
    """Return the bearings whose races, or what is known of them, would have shown a damage."""
    examined = []
    for bearing in signals.rig.bearings:
        depths_of_parts = {name: depth for (owner, name), depth in depths.items() if owner == bearing.name}
        decisive = [depth for name, depth in depths_of_parts.items() if name in RACES] or list(depths_of_parts.values())
        if decisive and max(decisive) <= CLEAR_MODULATION:
            examined.append(bearing.name)
    return examined


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


def _not_examined(signals: AnalysisSignals, depths: Mapping[tuple[str, str], float], where: Where) -> list[Finding]:
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


MAX_PARTS = 2
"""Parts that may be damaged at once; families at more orders than that have another cause more likely."""

WITH_STATED_SPEED = 0.85
"""Factor where the speed is a stated one, and nothing but the family itself speaks for it."""

BEYOND_SLIP = 0.5
"""Factor where the family lies beyond a bearing's slip: it is the part's only if the stated speed is wrong."""


SHARED_BY_OTHERS = 0.5
"""Factor where impacts of another machine, a belt or an unknown shaft explain the lines as well as the part does."""


WORTH_A_SUSPICION = 0.3
"""Below this confidence a family at a part's order is worth a notice: other causes are more likely together."""


def detect_bearings(
    signals: AnalysisSignals, envelopes: Sequence[BandEnvelope], kurtogram_bands: Sequence[KurtogramBand] = ()
) -> list[Finding]:
    """Name the race where the rig gives the bearing; else report families that nothing known explains.

    The bands that the kurtograms choose are searched like the others, and say what they show of a race found.
    """
    searched = [*envelopes, *(own.envelope for own in kurtogram_bands)]
    cleaned = [replace(e, excess=without_synchronous(signals, e.excess)) for e in searched]
    if signals.angle is None:
        return _over_frequency(signals, cleaned)
    if signals.angle.n_revolutions < signals.settings.minimum_revolutions:
        return [_too_short(signals)] if signals.rig.bearings else []
    families = find_families(signals, cleaned)
    findings = [_with_witness(_named_finding(signals, c, len(families.named)), kurtogram_bands) for c in families.named]
    findings += [
        _unnamed_finding(signals, c) if c.bearing is None else _named_finding(signals, c, 1) for c in families.trains
    ]
    claimed = any(f.kind in (Kind.FAULT, Kind.SUSPICION) for f in findings)
    if not claimed and signals.rig.bearings and cleaned:
        fixed = cleaned[: len(envelopes)]  # where a damage rings is not known beforehand; an own band follows it
        findings += none_found(signals, fixed, families)
    return findings


def _with_witness(finding: Finding, kurtogram_bands: Sequence[KurtogramBand]) -> Finding:
    where = finding.where
    if where.order is None or where.band_hz is None:
        return finding
    text = witness_text(kurtogram_bands, where.channels[0], where.band_hz, where.order)
    return replace(finding, evidence=(*finding.evidence, *text))


def _named_finding(signals: AnalysisSignals, candidate: Candidate, n_parts: int) -> Finding:
    bearing = candidate.bearing
    assert bearing is not None  # noqa: S101 - a named candidate has one; narrows the type
    part = PARTS[candidate.name][0]
    confidence = _confidence(signals, candidate, n_parts)
    certain = not _is_shared(candidate, n_parts) and not _is_beyond_slip(signals, candidate)
    clear = certain and candidate.modulation >= CLEAR_MODULATION and confidence >= 0.75
    place = f"the {part} of {_names(candidate)}"
    title = f"{'Damage' if clear else 'Perhaps damage'} at {place}."
    if _is_beyond_slip(signals, candidate):
        title = f"May be {place}: the speed is stated and not confirmed."
    return Finding(
        "bearing-" + part.replace(" ", "-"),
        _kind(clear, confidence),
        title,
        _where(signals, candidate),
        _strength(candidate),
        confidence,
        f"at most {_percent(confidence)}: chance that lines fall on the order so well {p_text(candidate.p_value)} (all "
        "parts, bands, channels tried); never above 95 %, as one recording is looked at",
        _named_evidence(signals, candidate, n_parts),
        "Another sensor nearer to it."
        if signals.has_reference
        else "A recording of the same bearing when it was good, or another sensor nearer to it.",
    )


def _kind(clear: bool, confidence: float) -> Kind:
    if clear:
        return Kind.FAULT
    return Kind.SUSPICION if confidence >= WORTH_A_SUSPICION else Kind.NOTICE


def _names(candidate: Candidate) -> str:
    """Name the bearing, and those that cannot be told from it."""
    bearings = [b for b in (candidate.bearing, *candidate.twins) if b is not None]
    if len({b.shaft for b in bearings}) == 1:
        return f"{_bearing(' or '.join(b.name for b in bearings))} on shaft {bearings[0].shaft}"
    return _bearing(" or ".join(f"{b.name} on shaft {b.shaft}" for b in bearings))


def _bearing(name: str) -> str:
    return name if name.lower().startswith("bearing") else f"bearing {name}"


def _named_evidence(signals: AnalysisSignals, candidate: Candidate, n_parts: int) -> tuple[str, ...]:
    slip = candidate.comb.fundamental / candidate.expected - 1
    evidence = [
        f"{_family_text(candidate)}, {100 * slip:+.2f} % from the kinematic order {candidate.expected:.4f}.",
        _modulation_text(candidate),
        *(["Bearings of the same orders cannot be told apart by their envelope."] if candidate.twins else []),
        *(f"Within its slip, the {rival} would show at the same order." for rival in candidate.rivals),
    ]
    if speed_is_only_stated(signals):
        evidence.append("The speed is a stated one that no line of a shaft or mesh confirms.")
    if candidate.name == "FTF":
        evidence.append("Belts and other machines at the same rate look the same: lines at the cage's order alone.")
    if _is_among_hunting_lines(signals, candidate):
        evidence.append("A multiple of a hunting-tooth order is there too: teeth that differ from each other do it.")
    if n_parts > MAX_PARTS:
        evidence.append(f"{n_parts} parts show at once, which a single other source of impacts explains as well.")
    return tuple(evidence)


def _confidence(signals: AnalysisSignals, candidate: Candidate, n_parts: int) -> float:
    confidence = from_p_value(candidate.p_value) * candidate.share
    if signals.rig.assumed:
        confidence *= WITH_ASSUMED_DATA
    if _is_shared(candidate, n_parts):
        confidence *= SHARED_BY_OTHERS
    if _is_among_hunting_lines(signals, candidate):
        confidence *= SHARED_BY_OTHERS
    if speed_is_only_stated(signals):
        confidence *= BEYOND_SLIP if _is_beyond_slip(signals, candidate) else WITH_STATED_SPEED
    return confidence


def _is_shared(candidate: Candidate, n_parts: int) -> bool:
    """Whether other causes explain the lines as well: at a cage's order, or at the orders of several parts."""
    return candidate.name == "FTF" or n_parts > MAX_PARTS


def _is_among_hunting_lines(signals: AnalysisSignals, candidate: Candidate) -> bool:
    """Whether a cage's order is no further from a multiple of a hunting-tooth order than a line is wide.

    Teeth that differ meet in turn, and modulate the mesh at multiples of that order: in a short record they are dense.
    """
    if candidate.name != "FTF":
        return False
    width = 2.0 * candidate.envelope.excess.spectrum.resolution
    hunting = [o for p in signals.rig.pairs if (o := hunting_tooth_order(signals.rig, p)) is not None]
    own = candidate.comb.fundamental
    return any(abs(own - round(own / order) * order) <= width for order in hunting)


def _is_beyond_slip(signals: AnalysisSignals, candidate: Candidate) -> bool:
    """Whether the order fits only if the stated speed is wrong."""
    off = abs(candidate.comb.fundamental / candidate.expected - 1)
    return speed_is_only_stated(signals) and off > signals.settings.bearing_slip


def _unnamed_finding(signals: AnalysisSignals, candidate: Candidate) -> Finding:
    order, hertz = candidate.comb.fundamental, candidate.comb.fundamental * signals.frequency_per_order_hz
    confidence = from_p_value(candidate.p_value, limit=0.99)
    shaft = signals.rig.reference_shaft or "the shaft"
    near = _near_shaft(signals, order)
    strong = candidate.modulation >= CLEAR_MODULATION and not (near and not speed_is_confirmed(signals))
    what = "which no shaft, gear or bearing of the rig explains"
    return Finding(
        "non-synchronous-impacts",
        Kind.SUSPICION if strong else Kind.NOTICE,
        f"Impacts at order {order:.4f} of {shaft} ({hertz:.5g} Hz), {what}.",
        _where(signals, candidate),
        _strength(candidate),
        confidence,
        f"at most {_percent(confidence)}, that the family exists: chance of it in noise {p_text(candidate.p_value)}, "
        "all orders and bands tried; what causes it is not known",
        (
            f"{_family_text(candidate)}.",
            _modulation_text(candidate),
            *near,
            *_other_than_bearings(signals, candidate),
        ),
        ""
        if signals.rig.bearings
        else "Give the bearings in the rig file: then the part is named, or they are ruled out.",
    )


def _near_shaft(signals: AnalysisSignals, order: float) -> list[str]:
    """State a shaft whose order is so near that a wrong speed makes the difference."""
    return [
        f"Shaft {name or 'of reference'} is near (order {shaft:.4f}, {100 * (order / shaft - 1):+.2f} %): "
        "the speed may be wrong by as much."
        for name, shaft in signals.known_shaft_orders.items()
        if abs(order / shaft - 1) <= 0.03
    ]


def _other_than_bearings(signals: AnalysisSignals, candidate: Candidate) -> list[str]:
    text = "A rolling bearing that is not in the rig file is the usual cause; other machines and belts do it too."
    if not candidate.in_train:
        return [text]
    text = "The rate is low for a race: another machine, a belt or a shaft that is not in the rig file does it."
    parts = [
        f"{PARTS[name][0]} of {bearing.name}"
        for bearing, name, order in expected_parts(signals)
        if abs(order / candidate.comb.fundamental - round(order / candidate.comb.fundamental))
        * candidate.comb.fundamental
        <= slip_of(signals) * order
        and order > candidate.comb.fundamental
    ]
    if not parts:
        return [text]
    return [text, f"Multiples fall near the order of the {', '.join(parts)} by their density: that is no damage there."]


def _percent(confidence: float) -> str:
    return f"{100 * confidence:.0f} %"


def _over_frequency(signals: AnalysisSignals, envelopes: list[BandEnvelope]) -> list[Finding]:
    """Without speed: report the clearest family of the envelope over frequency, without a cause."""
    end_hz = min((float(e.excess.spectrum.positions[-1]) for e in envelopes), default=0.0)
    best = clearest_family(envelopes, 4.0, min(1000.0, end_hz / 4))
    if best is None or best.p_value > signals.settings.false_alarm_probability:
        return []
    train = slower_train(best.envelope.excess, best.comb)
    if train is not None:
        best = replace(best, comb=train, in_train=True)
    confidence = from_p_value(best.p_value, limit=0.99)
    return [
        Finding(
            "periodic-impacts",
            Kind.NOTICE,
            f"The signal is modulated periodically at {best.comb.fundamental:.5g} Hz; by what, cannot be told.",
            replace(_where(signals, best), order=None, frequency_hz=best.comb.fundamental),
            _strength(best),
            confidence,
            f"at most {_percent(confidence)}, that the family exists: chance of it in noise {p_text(best.p_value)}",
            (f"{_family_text(best)}.", _modulation_text(best)),
            "Give the shaft speed: then shafts, gears and bearings can be told apart.",
        )
    ]


def _too_short(signals: AnalysisSignals) -> Finding:
    revolutions = signals.angle.n_revolutions if signals.angle is not None else 0.0
    return Finding(
        "bearings-not-examined",
        Kind.CANNOT_TELL,
        f"Bearings cannot be examined: the record holds {revolutions:.3g} revolutions and "
        f"{signals.settings.minimum_revolutions} are needed.",
        surer="A longer recording.",
    )


def _where(signals: AnalysisSignals, candidate: Candidate) -> Where:
    return Where(
        (candidate.envelope.channel,),
        shaft=candidate.bearing.shaft if candidate.bearing else "",
        bearing=candidate.bearing.name if candidate.bearing else "",
        order=candidate.comb.fundamental,
        order_shaft=signals.rig.reference_shaft,
        frequency_hz=candidate.comb.fundamental * signals.frequency_per_order_hz if signals.angle is not None else None,
        band_hz=candidate.envelope.band_hz,
    )


def _strength(candidate: Candidate) -> Strength:
    ratio = max(candidate.comb.ratios_db, default=None)
    low, high = candidate.envelope.band_hz
    floor_is = f"noise floor of the envelope spectrum, band {low:.0f} to {high:.0f} Hz"
    unit = candidate.envelope.excess.spectrum.unit
    return Strength(candidate.comb.amplitude, unit, candidate.comb.floor, floor_is, ratio)


def _family_text(candidate: Candidate) -> str:
    comb = candidate.comb
    ratios = ", ".join(f"{r:.0f}" for r in comb.ratios_db[:6]) + (", …" if len(comb.ratios_db) > 6 else "")
    return (
        f"{len(comb.positions)} of {_n_harmonics(candidate)} harmonics of {comb.fundamental:.4f} stand out in the "
        f"envelope of {candidate.envelope.channel} ({ratios} dB over the floor)"
    )


def _n_harmonics(candidate: Candidate) -> int:
    """Return how many multiples were looked at: six, or all up to the last line of a train."""
    if not candidate.in_train:
        return 6
    return round(candidate.comb.positions[-1] / candidate.comb.fundamental) if candidate.comb.positions else 0


def _modulation_text(candidate: Candidate) -> str:
    return f"The strongest line is {100 * candidate.modulation:.1f} % of the mean envelope."
