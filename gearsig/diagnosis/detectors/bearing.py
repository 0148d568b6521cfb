"""Bearings: families of lines in the envelope, at known bearing orders or at none that the rig explains."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import exp
from typing import TypeGuard

from gearsig.diagnosis.comb import Comb, LineExcess, best_comb
from gearsig.diagnosis.confidence import WITH_ASSUMED_DATA, from_p_value
from gearsig.diagnosis.envelopes import BandEnvelope
from gearsig.diagnosis.signals import Signals
from gearsig.diagnosis.types import Finding, Kind, Strength, Where
from gearsig.rig.types import Bearing

PARTS = {
    "BPFO": ("outer race", 1.0),
    "BPFI": ("inner race", 1.0),
    "BSF": ("rolling element", 2.0),
    "FTF": ("cage", 1.0),
}
"""Part that strikes at each order, and strikes per cycle: a damaged rolling element strikes both races each spin."""

TYPICAL_SLIP = 0.007
"""Standard deviation of the relative distance from the kinematic order, where parts compete for one family of lines."""

RARE = 0.3
"""Prior weight of rolling elements and cages against races, which are damaged far more often."""

CLEAR_MODULATION = 0.05
"""Depth of the strongest line of the envelope from which a race is called damaged, not only worth watching."""

MINIMUM_LINES = 3
"""Lines of a family over 6 dB that must be there: two may coincide by chance with the harmonics of something else."""


@dataclass(frozen=True)
class Candidate:
    """One family found, and what it may be; `share` is the named part's among all that would show at that order."""

    comb: Comb
    envelope: BandEnvelope
    p_value: float
    bearing: Bearing | None = None
    name: str = ""
    expected: float = 0.0
    rivals: tuple[str, ...] = ()
    share: float = 1.0

    @property
    def modulation(self) -> float:
        """Amplitude of the strongest line over the mean envelope."""
        return self.comb.amplitude / self.envelope.mean if self.envelope.mean > 0 else 0.0


def detect_bearings(signals: Signals, envelopes: list[BandEnvelope]) -> list[Finding]:
    """Name the race where the rig gives the bearing; else report families that nothing known explains."""
    cleaned = [replace(e, excess=without_synchronous(signals, e.excess)) for e in envelopes]
    if signals.angle is None:
        return _over_frequency(signals, cleaned)
    if signals.angle.n_revolutions < signals.settings.minimum_revolutions:
        return [_too_short(signals)] if signals.rig.bearings else []
    named = _best_named(signals, cleaned)
    if named:  # combinations with shaft orders make further families, which are no second fault
        return [_named_finding(signals, c) for c in named]
    unnamed = _best_unnamed(signals, cleaned)
    if unnamed is not None:
        known = _known_multiple(signals, unnamed)
        return [_unnamed_finding(signals, unnamed) if known is None else _named_finding(signals, known)]
    return _none_found(signals, cleaned) if signals.rig.bearings and cleaned else []


def without_synchronous(signals: Signals, excess: LineExcess) -> LineExcess:
    """Mask the multiples of every known shaft order: gears and shafts, not bearings."""
    for order in signals.known_shaft_orders.values():
        excess = excess.without_multiples(order)
    return excess


def _expected(signals: Signals) -> list[tuple[Bearing, str, float]]:
    """Return every known bearing part with the order at which its damage would strike."""
    return [
        (bearing, name, order * ratio * PARTS[name][1])
        for bearing in signals.rig.bearings
        if (ratio := signals.rig.ratio(bearing.shaft)) is not None
        for name, order in bearing.orders().items()
    ]


def _best_named(signals: Signals, envelopes: list[BandEnvelope]) -> list[Candidate]:
    """Return the significant bearing parts, surest first; one that shares its lines with a surer one is left out."""
    slip = signals.settings.bearing_slip
    expected = _expected(signals)
    found = []
    for bearing, name, order in expected:
        best: Candidate | None = None
        for envelope in envelopes:
            comb = best_comb(envelope.excess, order * (1 - slip), order * (1 + slip))
            if _is_better(comb, best):
                best = Candidate(comb, envelope, comb.p_value, bearing, name, order)
        if best is not None:
            best = replace(best, p_value=min(1.0, best.p_value * len(expected) * len(envelopes)))
            if best.p_value <= signals.settings.false_alarm_probability:
                found.append(best)
    found.sort(key=lambda c: -_weight(c.name, c.comb.fundamental / c.expected - 1))
    kept: list[Candidate] = []
    for candidate in found:
        if not any(_shares_lines(candidate.comb, other.comb) for other in kept):
            kept.append(_with_rivals(signals, candidate))
    return sorted(kept, key=lambda c: c.p_value)


def _weight(name: str, slip: float) -> float:
    """Return how likely a part is, by how far from its kinematic order the lines are."""
    return exp(-0.5 * (slip / TYPICAL_SLIP) ** 2) * (RARE if name in ("BSF", "FTF") else 1.0)


def _with_rivals(signals: Signals, candidate: Candidate) -> Candidate:
    """Note the other parts whose order is so near, or half or twice, that slip alone could make it this one."""
    own = _weight(candidate.name, candidate.comb.fundamental / candidate.expected - 1)
    others, rivals = 0.0, []
    for bearing, name, order in _expected(signals):
        if (bearing, name) == (candidate.bearing, candidate.name):
            continue
        slip = min((candidate.comb.fundamental / (order * m) - 1 for m in (0.5, 1.0, 2.0)), key=abs)
        if abs(slip) <= signals.settings.bearing_slip:
            others += _weight(name, slip)
            rivals.append(f"{PARTS[name][0]} of {bearing.name}")
    return replace(candidate, rivals=tuple(rivals), share=own / (own + others))


def _known_multiple(signals: Signals, candidate: Candidate) -> Candidate | None:
    """Return the candidate named, if its fundamental is a low harmonic of a known part: paths may hide the first."""
    for bearing, name, order in _expected(signals):
        for m in (1, 2, 3):
            if abs(candidate.comb.fundamental / (m * order) - 1) <= signals.settings.bearing_slip:
                named = replace(candidate, bearing=bearing, name=name, expected=m * order)
                return _with_rivals(signals, named)
    return None


def _is_better(comb: Comb | None, best: Candidate | None) -> TypeGuard[Comb]:
    """Whether a family has lines enough and is surer than the best so far."""
    if comb is None or len(comb.positions) < MINIMUM_LINES:
        return False
    return best is None or (comb.p_value, -comb.score) < (best.p_value, -best.comb.score)


def _shares_lines(comb: Comb, surer: Comb) -> bool:
    """Whether most lines of a family are those of a surer one."""
    shared = [p for p in comb.positions if any(abs(p / q - 1) < 0.005 for q in surer.positions)]
    return len(shared) >= len(comb.positions) / 2


def _best_unnamed(signals: Signals, envelopes: list[BandEnvelope]) -> Candidate | None:
    """Return the clearest family that is no shaft's. Impacts of bearings come about 1.5 to 14 times per revolution."""
    slowest = min(signals.known_shaft_orders.values(), default=1.0)
    fastest = max(signals.known_shaft_orders.values(), default=1.0)
    best: Candidate | None = None
    for envelope in envelopes:
        comb = best_comb(envelope.excess, 1.5 * slowest, 14.0 * fastest)
        if _is_better(comb, best):
            best = Candidate(comb, envelope, comb.p_value)
    if best is None:
        return None
    best = replace(best, p_value=min(1.0, best.p_value * len(envelopes)))
    return best if best.p_value <= signals.settings.false_alarm_probability else None


def _named_finding(signals: Signals, candidate: Candidate) -> Finding:
    bearing, comb = candidate.bearing, candidate.comb
    assert bearing is not None  # noqa: S101 - a named candidate has one; narrows the type
    part = PARTS[candidate.name][0]
    confidence = from_p_value(candidate.p_value) * candidate.share
    if signals.rig.assumed:
        confidence *= WITH_ASSUMED_DATA
    clear = candidate.modulation >= CLEAR_MODULATION and confidence >= 0.75
    slip = comb.fundamental / candidate.expected - 1
    return Finding(
        "bearing-" + part.replace(" ", "-"),
        Kind.FAULT if clear else Kind.SUSPICION,
        f"{'Damage' if clear else 'Perhaps damage'} at the {part} of bearing {bearing.name} on shaft {bearing.shaft}.",
        _where(signals, candidate),
        _strength(candidate),
        confidence,
        f"chance that lines fall on the order so well: {candidate.p_value:.1g} (all parts, bands, channels tried); "
        "at most 0.95 without a healthy reference",
        (
            f"{_family_text(candidate)}, {100 * slip:+.2f} % from the kinematic order {candidate.expected:.4f}.",
            _modulation_text(candidate),
            *(f"Within its slip, the {rival} would show at the same order." for rival in candidate.rivals),
        ),
        "A recording of the same bearing when it was good, or another sensor nearer to it.",
    )


def _unnamed_finding(signals: Signals, candidate: Candidate) -> Finding:
    order, hertz = candidate.comb.fundamental, candidate.comb.fundamental * signals.frequency_per_order_hz
    confidence = from_p_value(candidate.p_value, limit=0.99)
    return Finding(
        "non-synchronous-impacts",
        Kind.SUSPICION if candidate.modulation >= CLEAR_MODULATION else Kind.NOTICE,
        f"Impacts at order {order:.4f} of {signals.rig.reference_shaft or 'the shaft'} ({hertz:.5g} Hz), "
        "which no shaft, gear or bearing of the rig explains.",
        _where(signals, candidate),
        _strength(candidate),
        confidence,
        f"that the family exists: chance of it in noise {candidate.p_value:.1g}, all orders and bands tried; "
        "what causes it is not known",
        (
            f"{_family_text(candidate)}.",
            _modulation_text(candidate),
            "A rolling bearing that is not in the rig file is the usual cause; other machines and belts do it too.",
        ),
        "Give the bearings in the rig file: then the part is named, or the bearings are ruled out.",
    )


def _over_frequency(signals: Signals, envelopes: list[BandEnvelope]) -> list[Finding]:
    """Without speed: report the clearest family of the envelope over frequency, without a cause."""
    best: Candidate | None = None
    for envelope in envelopes:
        comb = best_comb(envelope.excess, 4.0, min(1000.0, float(envelope.excess.spectrum.positions[-1]) / 4))
        if _is_better(comb, best):
            best = Candidate(comb, envelope, comb.p_value)
    if best is None or best.p_value * len(envelopes) > signals.settings.false_alarm_probability:
        return []
    best = replace(best, p_value=best.p_value * len(envelopes))
    return [
        Finding(
            "periodic-impacts",
            Kind.NOTICE,
            f"The signal is modulated periodically at {best.comb.fundamental:.5g} Hz; by what, cannot be told.",
            replace(_where(signals, best), order=None, frequency_hz=best.comb.fundamental),
            _strength(best),
            from_p_value(best.p_value, limit=0.99),
            f"that the family exists: chance of it in noise {best.p_value:.1g}",
            (f"{_family_text(best)}.", _modulation_text(best)),
            "Give the shaft speed: then shafts, gears and bearings can be told apart.",
        )
    ]


def _too_short(signals: Signals) -> Finding:
    revolutions = signals.angle.n_revolutions if signals.angle is not None else 0.0
    return Finding(
        "bearings-not-examined",
        Kind.CANNOT_TELL,
        f"Bearings cannot be examined: the record holds {revolutions:.3g} revolutions and "
        f"{signals.settings.minimum_revolutions} are needed.",
        surer="A longer recording.",
    )


def _none_found(signals: Signals, envelopes: list[BandEnvelope]) -> list[Finding]:
    """State that nothing shows, and which parts could not have shown."""
    where = Where(channels=tuple(dict.fromkeys(e.channel for e in envelopes)))
    hidden = [
        f"{PARTS[name][0]} of {bearing.name}"
        for bearing, name, order in _expected(signals)
        if all(e.excess.masked[e.excess.spectrum.index_of(order)] for e in envelopes)
    ]
    findings = [
        Finding(
            "no-bearing-damage",
            Kind.INFORMATION,
            f"No damage shows in the bearings ({', '.join(b.name for b in signals.rig.bearings)}).",
            where,
            confidence=0.8,
            confidence_basis="early damage may be hidden below the gears",
            evidence=(f"No family at their orders in {len(envelopes)} envelope spectra (channels × bands).",),
        )
    ]
    if hidden:
        findings.append(
            Finding(
                "bearing-part-hidden",
                Kind.CANNOT_TELL,
                f"Not examined: {', '.join(hidden)}. Their orders fall on multiples of a shaft within the resolution.",
                where,
                surer="A longer recording: orders that are close need many revolutions to be told apart.",
            )
        )
    return findings


def _where(signals: Signals, candidate: Candidate) -> Where:
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
    ratios = ", ".join(f"{r:.0f}" for r in candidate.comb.ratios_db)
    return (
        f"{len(candidate.comb.positions)} of 6 harmonics of {candidate.comb.fundamental:.4f} stand out in the envelope "
        f"of {candidate.envelope.channel} ({ratios} dB over the floor)"
    )


def _modulation_text(candidate: Candidate) -> str:
    return f"The strongest line is {100 * candidate.modulation:.1f} % of the mean envelope."
