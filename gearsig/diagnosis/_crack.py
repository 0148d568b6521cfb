"""Depth of a root crack: asked where it can be answered, and made one statement with a damaged tooth found before."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace

from gearsig.diagnosis._types import (
    WITH_ASSUMED_DATA,
    WITHOUT_REFERENCE,
    CannotTell,
    Finding,
    Kind,
    Where,
    from_p_value,
    p_text,
)
from gearsig.diagnosis._verdict import DEPTH_UNKNOWN
from gearsig.errors import RefusalError
from gearsig.prepared import PreparedRecording, prepare
from gearsig.recording import Recording
from gearsig.rig import GearPair, Rig
from gearsig.severity import CRACKED, CrackEstimate, NoCrackSeen

SAME_PLACE_PITCHES = 1.5
"""The largest event and the crack's estimate each are good to about one tooth."""

CLEAR = 0.7
"""Confidence from which a crack seen by itself is called a fault. With the calibration's fifty or so healthy machines
no p-value is below 2 %: what is clearer than all of them must be enough."""

PRIOR_WITH_REFERENCE = 0.5
PRIOR_ALONE = 0.1
"""Probability of a crack before looking: who has a reference at hand has a reason to ask."""

CAUSE = 0.9
"""Share of such changes that are damage to the tooth, not a key, a rub or an assembly that was changed."""

LIMIT_WITH_REFERENCE = 0.98

SETTLED_PERCENT = 50.0
"""If a crack through half of the root would have shown against the reference, the teeth count as examined."""

SETTLED_BY_REFERENCE = ("tooth-damage-undecided", "tooth-not-examined")
"""Codes of findings about teeth that a comparison with the reference settles: it looks at both gears of the pair."""

BESIDE_ANOTHER_FAULT = 0.5
"""Factor where a damaged bearing knocks as well: what it leaves in an average changes single teeth, too."""

WORTH_A_SUSPICION = 0.35

OTHER_DAMAGE = "chipped or spalled"
"""Kind of an estimate that is no crack's."""

_INTERVAL = "90 % of simulated cracks lie within such intervals"

Answer = CrackEstimate | NoCrackSeen | CannotTell


def crack_depth(
    recording: Recording | PreparedRecording,
    rig: Rig,
    reference: Recording | PreparedRecording | None,
    torque_nm: float | None,
    dead: Collection[str] = (),
) -> Answer | None:
    """Return the depth of a crack, that none is seen, or why it cannot be told; None where nobody asked and none is.

    Nobody asks for a crack of a machine that is described without gears.

    Parameters
    ----------
    recording : Recording or PreparedRecording
    rig : Rig
    reference : Recording, PreparedRecording or None
        Of the same gears when they were healthy. Without it only a crack is an answer: that none is seen says little,
        and that it cannot be told says nothing.
    torque_nm : float or None
        Of the operating point's shaft, instead of its own.
    dead : collection of str
        Channels to leave out.

    Raises
    ------
    InputError
        If the reference has other channels, or is the recording itself.
    """
    from gearsig.severity import estimate_crack

    if rig.bearings and not rig.pairs:
        return None
    prepared = prepare(recording, rig)
    alive = [c.name for c in prepared.recording.channels if c.quantity == "acceleration" and c.name not in dead]
    try:
        answer = estimate_crack(prepared, reference=reference, torque_nm=torque_nm, channels=alive)
    except RefusalError as refusal:
        if reference is None:
            return None
        return CannotTell("How deep is a crack in a tooth root?", refusal.reason, refusal.remedy)
    return answer if reference is not None or isinstance(answer, CrackEstimate) else None


def with_crack(findings: Sequence[Finding], answer: Answer | None, rig: Rig) -> list[Finding]:
    """Return the findings with what is known of a crack: a tooth found both ways is one finding, with its depth."""
    if answer is None:
        return list(findings)
    if isinstance(answer, CannotTell):
        return [*findings, _cannot_tell(answer)]
    if isinstance(answer, NoCrackSeen):
        return [*_unsettled(findings, answer, rig), _none_seen(answer, rig)]
    same = next((f for f in findings if _is_same_tooth(f, answer, rig)), None)
    if same is not None:
        return [_merged(same, answer, rig) if f is same else f for f in findings if not _is_superseded(f, answer, rig)]
    crack_finding = _beside_others(_seen(answer, rig), findings)
    if not answer.with_reference and crack_finding.confidence < CLEAR:
        return list(findings)
    return [*(f for f in findings if not _is_superseded(f, answer, rig)), crack_finding]


def _beside_others(crack_finding: Finding, findings: Sequence[Finding]) -> Finding:
    """Return the finding of a crack, less sure where a fault of a bearing explains a small change as well."""
    if not any(f.kind is Kind.FAULT and f.where.bearing for f in findings):
        return crack_finding
    confidence = BESIDE_ANOTHER_FAULT * crack_finding.confidence
    kind = Kind.SUSPICION if confidence >= WORTH_A_SUSPICION else Kind.NOTICE
    text = "Knocks of the damaged bearing may have made the change as well."
    return replace(crack_finding, kind=kind, confidence=confidence, evidence=(*crack_finding.evidence, text))


def _merged(tooth_finding: Finding, crack: CrackEstimate, rig: Rig) -> Finding:
    """Return the finding of a damaged tooth with the depth that its crack would have."""
    crack_finding = _seen(crack, rig)
    place = f"tooth {crack.tooth}" if crack.tooth is not None else f"{crack.angle_deg:.0f}°"
    return replace(
        tooth_finding,
        kind=min(tooth_finding.kind, crack_finding.kind, key=list(Kind).index),
        title=f"Local tooth damage at {place} of {crack.gear}{_mate(crack)}{_what(crack)}.",
        where=replace(crack_finding.where, channels=tooth_finding.where.channels),
        confidence=max(tooth_finding.confidence, crack_finding.confidence),
        confidence_basis=f"{tooth_finding.confidence_basis}; {_INTERVAL}",
        evidence=tuple(dict.fromkeys((*tooth_finding.evidence, *crack_finding.evidence))),
        surer=tooth_finding.surer if not crack.with_reference else crack_finding.surer,
    )


def _seen(crack: CrackEstimate, rig: Rig) -> Finding:
    prior, limit = (
        (PRIOR_WITH_REFERENCE, LIMIT_WITH_REFERENCE) if crack.with_reference else (PRIOR_ALONE, WITHOUT_REFERENCE)
    )
    confidence = from_p_value(crack.p_value, prior=prior, limit=limit) * CAUSE
    confidence *= WITH_ASSUMED_DATA if rig.assumed else 1.0
    tooth = crack.tooth
    return Finding(
        "tooth-local-damage" if crack.likelier_other else "root-crack",
        Kind.FAULT if confidence >= CLEAR else Kind.SUSPICION,
        crack.text,
        Where(shaft=crack.shaft, gear=crack.gear, angle_deg=crack.angle_deg, tooth=tooth),
        confidence=confidence,
        confidence_basis="chance of as clear a change on healthy gears "
        f"{p_text(crack.p_value)}, by simulation; {_INTERVAL}",
        evidence=(_share_text(crack), *_kind_text(crack), *crack.reasons),
        surer="Look at the tooth." if crack.with_reference else "A recording of the same gears when they were healthy.",
    )


def _none_seen(answer: NoCrackSeen, rig: Rig) -> Finding:
    return Finding(
        "no-crack-seen",
        Kind.INFORMATION,
        answer.text,
        Where(gear=rig.pairs[0].name),
        confidence=0.95,
        confidence_basis="that a deeper crack would have been seen, on either gear, by simulation",
        evidence=answer.reasons,
        surer="A longer recording, or one at a higher load.",
    )


def _cannot_tell(answer: CannotTell) -> Finding:
    return Finding(
        DEPTH_UNKNOWN,
        Kind.CANNOT_TELL,
        f"The depth of a root crack cannot be told: {answer.reason}.",
        surer=answer.remedy[:1].upper() + answer.remedy[1:] + "." if answer.remedy else "",
    )


def _unsettled(findings: Sequence[Finding], answer: NoCrackSeen, rig: Rig) -> list[Finding]:
    """Return the findings without the doubt about teeth that the comparison with the reference settles."""
    settled = answer.with_reference and answer.below_percent <= SETTLED_PERCENT and not rig.assumed
    return [f for f in findings if not (settled and f.code in SETTLED_BY_REFERENCE)]


def _is_superseded(finding: Finding, crack: CrackEstimate, rig: Rig) -> bool:
    """Whether a finding says that nothing shows at teeth one of which has a crack."""
    if finding.code == "tooth-damage-undecided":
        return crack.with_reference
    pair = _pair(crack, rig)
    shafts = {crack.shaft} if crack.gear_is_certain or pair is None else {pair.driver, pair.driven}
    return finding.code == "no-tooth-local-damage" and (not finding.where.shaft or finding.where.shaft in shafts)


def _is_same_tooth(finding: Finding, crack: CrackEstimate, rig: Rig) -> bool:
    if finding.code != "tooth-local-damage" or finding.where.angle_deg is None:
        return False
    if finding.where.shaft != crack.shaft:
        return (
            not crack.gear_is_certain
        )  # gears that show it alike: the event is on one, the crack put down to the other
    pair = _pair(crack, rig)
    teeth = pair.teeth(crack.shaft) if pair is not None else None
    off = (finding.where.angle_deg - crack.angle_deg + 180.0) % 360.0 - 180.0
    return teeth is not None and abs(off) <= SAME_PLACE_PITCHES * 360.0 / teeth


def _pair(crack: CrackEstimate, rig: Rig) -> GearPair | None:
    return next((pair for pair in rig.pairs if crack.gear == f"{pair.name}/{crack.shaft}"), None)


def _depth(crack: CrackEstimate) -> str:
    return f"{crack.depth_mm:.1f} mm ({crack.interval_mm[0]:.1f} to {crack.interval_mm[1]:.1f} mm)"


def _what(crack: CrackEstimate) -> str:
    if crack.kind == OTHER_DAMAGE:
        return f", {OTHER_DAMAGE} rather than cracked"
    if crack.likelier_other:
        return f": {OTHER_DAMAGE}, or a root crack of {_depth(crack)}"
    doubt = "; or it is chipped or spalled" if crack.kind != CRACKED else ""
    return f": as a root crack {_depth(crack)}{doubt}"


def _kind_text(crack: CrackEstimate) -> tuple[str, ...]:
    if not crack.kind_probabilities:
        return ()
    shares = ", ".join(f"{kind} {100 * share:.0f} %" for kind, share in crack.kind_probabilities.items())
    return (f"By its shape it is {shares}, if cracks are as frequent as chips and spalls together.",)


def _share_text(crack: CrackEstimate) -> str:
    low, high = crack.interval_percent
    return f"A crack of {_depth(crack)} takes {crack.depth_percent:.0f} % of the root ({low:.0f} to {high:.0f} %)."


def _mate(crack: CrackEstimate) -> str:
    return "" if crack.gear_is_certain else " (or its mate)"
