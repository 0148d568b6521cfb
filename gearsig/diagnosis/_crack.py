"""Depth of a root crack: estimated where possible, and merged with a damaged tooth found before into one statement."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace

from gearsig.diagnosis._tooth import AGREES
from gearsig.diagnosis._types import (
    WITH_ASSUMED_DATA,
    WITHOUT_REFERENCE,
    CannotTell,
    Finding,
    Kind,
    Where,
    cannot_tell,
    from_p_value,
    p_text,
)
from gearsig.diagnosis._verdict import DEPTH_UNKNOWN
from gearsig.errors import RefusalError
from gearsig.formatting import odds_text
from gearsig.prepared import PreparedRecording, prepare
from gearsig.recording import Recording
from gearsig.rig import GearPair, Rig
from gearsig.severity import CRACKED, OTHER_DAMAGE, CrackEstimate, NoCrackSeen

CLEAR = 0.7
"""Confidence at which a crack found on its own is called a fault. With the calibration's fifty or so healthy machines
no p-value is below 2 %: being clearer than all of them must be enough."""

_INTERVAL = "90 % of simulated cracks lie within such intervals"

Answer = CrackEstimate | NoCrackSeen | CannotTell


def crack_depth(
    recording: Recording | PreparedRecording,
    rig: Rig,
    reference: Recording | PreparedRecording | None,
    torque_nm: float | None,
    dead: Collection[str] = (),
) -> Answer | None:
    """Return a crack's depth, that none is seen, or why it cannot be told; None if nobody asked and none is seen.

    For a machine described without gears, a crack counts as not asked for.

    Parameters
    ----------
    recording : Recording or PreparedRecording
    rig : Rig
    reference : Recording, PreparedRecording or None
        Of the same gears when healthy. Without it only a crack is returned: that none is seen says little, and that it
        cannot be told says nothing.
    torque_nm : float or None
        On the shaft of the operating point, in place of its torque.
    dead : collection of str
        Channels to leave out.

    Raises
    ------
    InputError
        If the reference has other channels, or is the recording itself.
    """
    from gearsig.severity import estimate_crack

    if not rig.pairs:
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
    """Return the findings with the result on a crack; a tooth found both ways is one finding, with its depth."""
    if answer is None:
        return list(findings)
    if isinstance(answer, CannotTell):
        surer = answer.remedy[:1].upper() + answer.remedy[1:] + "." if answer.remedy else ""
        title = f"The depth of a root crack cannot be told: {answer.reason}."
        finding = cannot_tell(DEPTH_UNKNOWN, title, surer=surer)
        # For several pairs, or teeth of unknown size, a depth can never be given; this does not make the reference
        # useless, because changes at the teeth, or their absence, are reported without it.
        is_never_told = len(rig.pairs) > 1 or any(None in (p.module_mm, p.face_width_mm) for p in rig.pairs)
        told = {f.code for f in findings}
        are_examined = "no-tooth-local-damage" in told and not told & {"tooth-damage-undecided", "tooth-not-examined"}
        kind = Kind.INFORMATION if is_never_told else Kind.NOTICE if are_examined else finding.kind
        return [*findings, replace(finding, kind=kind)]
    if isinstance(answer, NoCrackSeen):
        # Both gears of the pair are searched: if a crack through half of the root would have shown, the teeth count as
        # examined.
        settled = answer.with_reference and answer.below_percent <= 50.0 and not (answer.stands_out or rig.assumed)
        codes = ("tooth-damage-undecided", "tooth-not-examined") if settled else ()
        return [*(f for f in findings if f.code not in codes), _none_seen(answer, rig)]
    crack_finding = _seen(answer, rig)
    same = next((f for f in findings if _is_same_tooth(f, answer, rig)), None)
    left = [f for f in findings if not _is_superseded(f, answer, rig)]
    if same is not None:
        merged = replace(
            same,
            kind=min(same.kind, crack_finding.kind, key=list(Kind).index),
            title=f"Local tooth damage at {answer.place}{_what(answer)}.",
            where=replace(crack_finding.where, channels=same.where.channels),
            confidence=max(same.confidence, crack_finding.confidence),
            confidence_basis=f"{same.confidence_basis}; {_INTERVAL}",
            evidence=tuple(dict.fromkeys((*same.evidence, *crack_finding.evidence))),
            surer=same.surer if not answer.with_reference else crack_finding.surer,
        )
        return [merged if f is same else f for f in left]
    # Impacts of a damaged bearing left in an average also change single teeth; so does a change of all teeth.
    impacts = any(f.kind is Kind.FAULT and f.where.bearing for f in findings)
    if impacts or (answer.agreement is not None and answer.agreement < AGREES):
        confidence = 0.5 * crack_finding.confidence
        kind = Kind.SUSPICION if confidence >= 0.35 else Kind.NOTICE
        cause = "Impacts of the damaged bearing" if impacts else "What has changed all teeth of the gear"
        evidence = (*crack_finding.evidence, f"{cause} may have caused this change as well.")
        crack_finding = replace(crack_finding, kind=kind, confidence=confidence, evidence=evidence)
    if not answer.with_reference and crack_finding.confidence < CLEAR:
        return list(findings)
    return [*left, crack_finding]


def _seen(crack: CrackEstimate, rig: Rig) -> Finding:
    # A user who provides a reference has a reason to ask.
    prior, limit = (0.5, 0.98) if crack.with_reference else (0.1, WITHOUT_REFERENCE)
    # One such change in ten comes from a key, a rub or a changed assembly, not from damage to the tooth.
    confidence = from_p_value(crack.p_value, prior=prior, limit=limit) * 0.9
    confidence *= WITH_ASSUMED_DATA if rig.assumed else 1.0
    low, high = crack.interval_percent
    root = f"{crack.depth_percent:.0f} % of the root ({low:.0f} to {high:.0f} %)"
    evidence = [f"A crack of {crack.size} takes {root}."]
    if crack.kind_probabilities:
        shares = ", ".join(f"{kind} {odds_text(share)}" for kind, share in crack.kind_probabilities.items())
        evidence.append(f"By its shape it is {shares}, if cracks are as frequent as chips and spalls together.")
    chance = f"chance of as clear a change on healthy gears {p_text(crack.p_value)}, by simulation"
    return Finding(
        "tooth-local-damage" if crack.likelier_other else "root-crack",
        Kind.FAULT if confidence >= CLEAR else Kind.SUSPICION,
        crack.text,
        Where(shaft=crack.shaft, gear=crack.gear, angle_deg=crack.angle_deg, tooth=crack.tooth),
        confidence=confidence,
        confidence_basis=f"{chance}; {_INTERVAL}",
        evidence=(*evidence, *crack.reasons),
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


def _is_superseded(finding: Finding, crack: CrackEstimate, rig: Rig) -> bool:
    """Whether a finding says that nothing shows at teeth of which one has a crack."""
    if finding.code == "tooth-damage-undecided":
        return crack.with_reference
    pair = _pair(crack, rig)
    shafts = {crack.shaft} if crack.gear_is_certain or pair is None else {pair.driver, pair.driven}
    return finding.code == "no-tooth-local-damage" and (not finding.where.shaft or finding.where.shaft in shafts)


def _is_same_tooth(finding: Finding, crack: CrackEstimate, rig: Rig) -> bool:
    """Whether a damaged tooth is the crack's: event and estimate are each located to about one tooth."""
    if finding.code != "tooth-local-damage" or finding.where.angle_deg is None:
        return False
    if finding.where.shaft != crack.shaft:  # both gears show it: the event is on one, the crack on the other
        return not crack.gear_is_certain
    teeth = rig.teeth_of(crack.gear)
    off = (finding.where.angle_deg - crack.angle_deg + 180.0) % 360.0 - 180.0
    return teeth is not None and abs(off) <= 1.5 * 360.0 / teeth


def _pair(crack: CrackEstimate, rig: Rig) -> GearPair | None:
    return next((pair for pair in rig.pairs if crack.gear == f"{pair.name}/{crack.shaft}"), None)


def _what(crack: CrackEstimate) -> str:
    if crack.kind == OTHER_DAMAGE:
        return f", {OTHER_DAMAGE} rather than cracked"
    if crack.likelier_other:
        return f": {OTHER_DAMAGE}, or a root crack of {crack.size}"
    doubt = "; or it is chipped or spalled" if crack.kind != CRACKED else ""
    return f": as a root crack {crack.size}{doubt}"
