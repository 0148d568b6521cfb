"""Damage at one tooth: energy of the difference signal gathered at one angle, revolution after revolution."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gearsig.checks import FloatArray
from gearsig.diagnosis.confidence import WITH_ASSUMED_DATA, from_p_value
from gearsig.diagnosis.localisation import Localisation, localise
from gearsig.diagnosis.signals import ShaftSignals, Signals
from gearsig.diagnosis.types import Finding, Kind, Strength, Where

REPEATABLE = 0.7
"""Correlation of odd and even revolutions in the window; chance impacts give about 0."""

ABOVE_MESH = 3.5
"""Multiple of the highest mesh order above which knocks ring and teeth that merely differ do not show."""

WORTH_SAYING = (0.01, 8.0)
CLEAR = (0.001, 10.0)
"""p-value at most, and dB of the window over the median window at least."""


def detect_tooth_damage(signals: Signals) -> list[Finding]:
    """Look at each shaft's difference signals for a local event."""
    tested = [(s, _localised(s, signals)) for s in signals.shafts if s.separated]
    if not tested:
        return _why_not(signals)
    findings = [f for s, place in tested if (f := _finding(signals, s, place, len(tested))) is not None]
    if findings:
        return _without_images(signals, findings)
    return [_none_found(signals, tested)]


def _localised(shaft: ShaftSignals, signals: Signals) -> Localisation:
    """Test the difference signals in full and above the mesh harmonics; return the surer result, paid for by two tests.

    The window is one pitch of the coarsest gear: the events last about as long as the tooth is in mesh.
    """
    names = list(shaft.separated)
    full = np.stack([shaft.separated[name].difference.values for name in names])
    halves = np.stack([shaft.halves[name] for name in names])
    lowest_order = round(ABOVE_MESH * max(shaft.teeth))
    highest = int(min(shaft.averages[name].highest_order for name in names))
    starts = [0] if highest < 1.5 * lowest_order else [0, lowest_order]
    results = [
        localise(
            _above(full, start),
            _above(halves, start),
            1.0 / min(shaft.teeth),
            signals.settings.n_surrogates,
            np.random.default_rng(signals.settings.seed),
        )
        for start in starts
    ]
    best = min(results, key=lambda r: (r.p_value, -r.ratio_db))
    return replace(best, p_value=min(1.0, best.p_value * len(results)))


def _above(values: FloatArray, lowest_order: int) -> FloatArray:
    """Return periodic signals, (…, n_angles), without the orders below `lowest_order`."""
    if lowest_order == 0:
        return values
    lines = np.fft.rfft(values, axis=-1)
    lines[..., :lowest_order] = 0
    return np.asarray(np.fft.irfft(lines, values.shape[-1], axis=-1))


def _finding(signals: Signals, shaft: ShaftSignals, place: Localisation, n_tests: int) -> Finding | None:
    p_value = min(1.0, place.p_value * n_tests)
    if place.repeatability < REPEATABLE or not _reaches(WORTH_SAYING, p_value, place):
        return None
    confidence = from_p_value(p_value)
    assumed = [fact for fact in signals.rig.assumed if fact]
    if assumed:
        confidence *= WITH_ASSUMED_DATA
    clear = _reaches(CLEAR, p_value, place) and not assumed
    names = list(shaft.separated)
    strongest = names[int(np.argmax(place.channel_shares))]
    tooth = int(place.angle_rev * shaft.teeth[0]) + 1 if len(shaft.teeth) == 1 else None
    at = f"at {360 * place.angle_rev:.0f}° of shaft {shaft.shaft}"
    return Finding(
        "tooth-local-damage",
        Kind.FAULT if clear else Kind.SUSPICION,
        f"{'Local tooth damage' if clear else 'A local event, perhaps tooth damage,'} {at}"
        + (f" (tooth {tooth} of {shaft.teeth[0]})." if tooth is not None else "."),
        Where(
            tuple(n for n, share in zip(names, place.channel_shares, strict=True) if share >= 4.0) or (strongest,),
            shaft=shaft.shaft,
            gear=_gear_name(signals, shaft),
            angle_deg=360 * place.angle_rev,
            tooth=tooth,
        ),
        _strength(shaft, strongest, place),
        confidence=confidence,
        confidence_basis=f"chance of this on a gear whose teeth merely differ: {p_value:.1g}"
        + (f"; halved because {', '.join(assumed)} are assumed" if assumed else "")
        + "; at most 0.95 without a healthy reference",
        evidence=_evidence(signals, shaft, place),
        surer=_surer(signals),
    )


def _reaches(level: tuple[float, float], p_value: float, place: Localisation) -> bool:
    return p_value <= level[0] and place.ratio_db >= level[1]


def _strength(shaft: ShaftSignals, channel: str, place: Localisation) -> Strength:
    difference = shaft.separated[channel].difference
    n = len(difference.values)
    width = round(place.width_rev * n)
    start = round(place.start_rev * n)
    inside = np.arange(start, start + width) % n
    value = float(np.sqrt(np.mean(difference.values[inside] ** 2)))
    share = place.channel_shares[list(shaft.separated).index(channel)]
    floor = value / np.sqrt(share) if share > 0 else 0.0
    ratio = 10 * float(np.log10(share)) if share > 0 else None
    return Strength(value, difference.unit, float(floor), f"median tooth of the difference signal in {channel}", ratio)


def _evidence(signals: Signals, shaft: ShaftSignals, place: Localisation) -> tuple[str, ...]:
    texts = [
        f"Energy in one tooth pitch is {place.ratio_db:.1f} dB over the median pitch, all channels together.",
        f"{shaft.angle.n_revolutions:.0f} revolutions were averaged.",
        f"It comes back: odd and even revolutions correlate there by {place.repeatability:.2f}.",
    ]
    if signals.angle is not None and signals.angle.method in ("tachless", "constant", "speed channel"):
        texts.append("There is no tachometer: the angle counts from the start of the record, not from a mark.")
    elif shaft.shaft != signals.rig.reference_shaft:
        texts.append(
            f"The mark is on shaft {signals.rig.reference_shaft}: this shaft's angle counts from where it stood at the "
            "first mark of the record."
        )
    if len(shaft.teeth) == 1:
        texts.append(
            "Teeth count from 1 at the zero of the angle, as they engage; the place is good to about one tooth."
        )
    if len(shaft.teeth) > 1:
        texts.append(
            f"The shaft carries {len(shaft.teeth)} gears ({', '.join(map(str, shaft.teeth))} teeth); it may be either."
        )
    return tuple(texts)


def _surer(signals: Signals) -> str:
    if signals.rig.assumed:
        return "Confirm what is assumed of the rig: " + ", ".join(signals.rig.assumed) + "."
    if signals.angle is not None and signals.angle.method in ("tachless", "constant"):
        return "A recording with a tachometer, at another load, or of the same gearbox when it was good."
    return (
        "A recording at another load or speed (damage stays at its tooth), or one of the same gearbox when it was good."
    )


def _without_images(signals: Signals, findings: list[Finding]) -> list[Finding]:
    """Drop the image that a fault on a fast shaft leaves in the average of a shaft that is slower by a whole number."""
    kept = []
    for finding in findings:
        own = signals.rig.ratio(finding.where.shaft) or 1.0
        faster = [signals.rig.ratio(f.where.shaft) or 1.0 for f in findings if f is not finding]
        if not any(other > own and abs(other / own - round(other / own)) < 1e-9 for other in faster):
            kept.append(finding)
    return kept


def _none_found(signals: Signals, tested: list[tuple[ShaftSignals, Localisation]]) -> Finding:
    texts = [
        f"Shaft {s.shaft}: largest tooth {place.ratio_db:.1f} dB over the median one; a gear whose teeth "
        f"merely differ does as much with probability {place.p_value:.2g}."
        for s, place in tested
    ]
    shafts = ", ".join(s.shaft for s, _ in tested)
    where = Where(channels=tuple(tested[0][0].separated), shaft=tested[0][0].shaft if len(tested) == 1 else "")
    if signals.rig.assumed:
        assumed = ", ".join(signals.rig.assumed)
        return Finding(
            "tooth-damage-undecided",
            Kind.CANNOT_TELL,
            f"Nothing shows at the teeth of shaft(s) {shafts}, but {assumed} are assumed: damage may not show.",
            where,
            confidence_basis="a wrong tooth count or sampling rate averages over the wrong revolution",
            evidence=tuple(texts),
            surer=_surer(signals),
        )
    return Finding(
        "no-tooth-local-damage",
        Kind.INFORMATION,
        f"No local tooth damage shows on shaft(s) {shafts}.",
        where,
        confidence=0.8,
        confidence_basis="small damage may be hidden below the mesh's own variation",
        evidence=tuple(texts),
        surer=_surer(signals),
    )


def _why_not(signals: Signals) -> list[Finding]:
    if not signals.rig.pairs:
        return []
    if signals.angle is None:
        reason = "the speed is not known"
    elif signals.angle.n_revolutions < signals.settings.minimum_revolutions:
        reason = (
            f"the record holds {signals.angle.n_revolutions:.3g} revolutions and "
            f"{signals.settings.minimum_revolutions} are needed"
        )
    else:
        reason = "no gear has known teeth and a mesh below half the sampling rate"
    return [
        Finding(
            "tooth-not-examined",
            Kind.CANNOT_TELL,
            f"Teeth cannot be examined: {reason}.",
            surer="A longer recording with a tachometer, and the teeth of the gears.",
        )
    ]


def _gear_name(signals: Signals, shaft: ShaftSignals) -> str:
    pairs = [p.name for p in signals.rig.pairs if shaft.shaft in (p.driver, p.driven)]
    return f"{pairs[0]}/{shaft.shaft}" if len(pairs) == 1 else ""
