"""Lower findings based on unreliable input, order the findings, and put the most important into one sentence."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

from gearsig.angle import ShaftAngle
from gearsig.diagnosis._lines import MESH_ELSEWHERE, NEAR_ZERO, SPEED_UNKNOWN, SURER_BEYOND_ZERO
from gearsig.diagnosis._overall import CAN_DO_THAT, OVERALL_VELOCITY
from gearsig.diagnosis._sampling_rate import SAMPLING_RATE
from gearsig.diagnosis._types import (
    CHANGED,
    EXAMINED,
    HINDERING,
    LEVELS_MATCH,
    REFERENCE_NOT_HEALTHY,
    REFERENCE_UNFIT,
    UNCHANGED,
    VIBRATION_ZONE,
    CannotTell,
    Finding,
    Kind,
    Outcome,
    Strength,
    Where,
    outcome_of,
)
from gearsig.formatting import percent, sentence
from gearsig.prepared import PreparedRecording, magnetic_pull_near
from gearsig.recording import SEPARATE_RUNS, ChannelProblem
from gearsig.rig import Rig

DEPTH_UNKNOWN = "crack-depth-unknown"
"""Code of the finding that a crack's depth cannot be told although a reference was given."""

NOT_ALONE = "{} and misalignment would only show against an earlier recording."
"""What one recording alone cannot show: its lines are those of healthy machines, only higher."""

NO_FAULT, CANNOT_TELL = "No fault shows.", "Cannot tell."

SURER_WITH, WHAT_WOULD_HELP = "More certain with: ", "What would help: "
"""Start of the last sentence of a verdict that cannot tell."""

_RANK = {kind: i for i, kind in enumerate(Kind)}


def ranked(findings: Iterable[Finding]) -> tuple[Finding, ...]:
    """Return the findings, most important first: faults, then by change, kind, confidence and strength."""

    def key(finding: Finding) -> tuple[bool, bool, int, float, float]:
        ratio = finding.strength.ratio_db if finding.strength is not None else None
        return (
            finding.kind is not Kind.FAULT,
            finding.code != CHANGED,
            _RANK[finding.kind],
            -finding.confidence,
            -(ratio or 0.0),
        )

    return tuple(sorted(findings, key=key))


def verdict_of(findings: tuple[Finding, ...], *, has_reference: bool = False, brief: bool = False) -> str:
    """Return the sentences for a reader in a hurry: an uncertain rate, what has changed, and the outcome.

    They always include why a given reference did not help, or that it shows a fault itself. A brief verdict stands
    beside its outcome: it does not repeat it, and leaves out the changes and the remedy.
    """
    doubt = said_first(findings, claims=outcome_of(findings) in (Outcome.FAULT, Outcome.SUSPICION))
    unfit = next((f.title for f in findings if f.code in (REFERENCE_UNFIT, REFERENCE_NOT_HEALTHY)), "")
    noticed = (f for f in findings if f.code in (VIBRATION_ZONE, OVERALL_VELOCITY) and f.kind is Kind.NOTICE)
    loud = next(noticed, None)
    zone = loud.title if loud is not None else ""
    changed, unchanged = (next((f.title for f in findings if f.code == code), "") for code in (CHANGED, UNCHANGED))
    others = tuple(f for f in findings if f.code not in (CHANGED, UNCHANGED, VIBRATION_ZONE))
    claims = [f for f in others if f.is_claim]
    # A change that no pattern explains is a suspicion in itself, and has been reported already.
    if not claims and any(f.code == CHANGED and f.is_claim for f in findings):
        return " ".join(filter(None, (doubt, changed, zone, unfit)))
    opener, said, remedy = _said(others, has_reference=has_reference)
    if brief:
        changed = opener = remedy = ""
    if loud is not None and loud.code == VIBRATION_ZONE and not claims:
        # nothing shows the cause, but the machine is not healthy
        causes = (text for text in loud.evidence if text.endswith(CAN_DO_THAT))
        opener, zone = f"{zone} {next(causes, 'What is wrong does not show.')}", ""
    if claims:  # what is claimed may be new
        unchanged = unchanged.replace(LEVELS_MATCH, f"Other {LEVELS_MATCH.lower()}")
    return " ".join(filter(None, (doubt, changed, opener, said, remedy, zone, unchanged, unfit)))


def _said(findings: tuple[Finding, ...], *, has_reference: bool) -> tuple[str, str, str]:
    """Return the outcome, what it rests on, and what would make it more certain."""
    outcome = outcome_of(findings)
    unused = [f for f in findings if f.code == DEPTH_UNKNOWN and f.kind is Kind.CANNOT_TELL]
    if outcome in (Outcome.FAULT, Outcome.SUSPICION):
        kind = Kind.FAULT if outcome is Outcome.FAULT else Kind.SUSPICION
        first, *more = (f for f in findings if f.kind is kind)
        claim = first.title.removesuffix(".")
        claim += f" (at most {percent(first.confidence)} sure)" if kind is Kind.FAULT else ""
        claim += f", and {len(more)} more" if more else ""
        return f"{kind.value.capitalize()}:", " ".join([f"{claim}.", *(f.title for f in unused)]), ""
    titles = [f.title for f in findings if f.code in EXAMINED]
    if outcome is Outcome.NO_FAULT:
        has_teeth = any(f.code == "no-tooth-local-damage" for f in findings)
        is_steady = has_teeth or bool(titles)  # a drive that starts and stops has no lines to examine
        open_ones = NOT_ALONE.format("Damage of many teeth, unbalance" if has_teeth else "Unbalance")
        depth = [f.title for f in findings if f.code == DEPTH_UNKNOWN and f.kind is Kind.NOTICE]
        return NO_FAULT, " ".join([*titles, *([open_ones] if is_steady and not has_reference else depth)]), ""
    others = [f for f in findings if f not in unused and (f.code in HINDERING or f.kind is Kind.CANNOT_TELL)]
    gaps = [*unused, *others]
    nothing = "Nothing was examined that would show a fault."
    if any(f.code == SAMPLING_RATE for f in findings):
        nothing = "Parts are not judged until it is right: all orders would be wrong."
    elif has_reference:
        nothing = "What shows is in the reference as well."
    why = " ".join(f.title for f in gaps[:2]) or nothing
    return CANNOT_TELL, " ".join([why, *titles]), _remedy(gaps)


def _remedy(gaps: list[Finding]) -> str:
    """Return in one sentence what would settle the most important of the open questions."""
    first = next((finding for finding in gaps if finding.surer), None)
    if first is None:
        return ""
    surer = first.surer.partition(". ")[0].rstrip(".")
    # Say what to do, not what to have, where a value is missing.
    opener = WHAT_WOULD_HELP if first.code in (DEPTH_UNKNOWN, SPEED_UNKNOWN) else SURER_WITH
    return f"{opener}{surer[:1].lower()}{surer[1:]}."


def _problem_title(problem: ChannelProblem) -> str:
    """Return a problem as a title; for a line at an even multiple of the mains, with magnetism as another cause."""
    pull = magnetic_pull_near(problem.frequency_hz) if problem.kind == "hum" and problem.frequency_hz else None
    if pull is not None:
        line = f"One line, {pull[1]:g} Hz, dominates channel {problem.channel}"
        return f"{line}: the magnetic field of a motor or transformer, or mains hum."
    return problem.title


def detect_data_problems(prepared: PreparedRecording) -> tuple[list[Finding], frozenset[str]]:
    """Return findings on the data, and the names of dead channels, which are not analysed further."""
    findings = [
        Finding(
            f"channel-{p.kind}",
            Kind.DATA_PROBLEM,
            _problem_title(p),
            Where((p.channel,), frequency_hz=p.frequency_hz),
            confidence=0.95,
            confidence_basis="direct inspection of the samples",
            evidence=(p.evidence,),
            surer=p.remedy,
        )
        for p in prepared.problems
    ]
    for text in prepared.recording.warnings:
        are_runs = text.startswith(SEPARATE_RUNS)
        code, kind = ("separate-runs", Kind.DATA_PROBLEM) if are_runs else ("reader-note", Kind.NOTICE)
        findings.append(Finding(code, kind, sentence(text), confidence_basis="stated by the reader of the file"))
    return findings, frozenset(p.channel for p in prepared.problems if p.kind == "dead")


# --------------------
# Problems of the input lower the findings based on it: one place, for every problem and every finding.
# --------------------


OFF_NOMINAL = "speed-off-nominal"
MAINS_OR_SHAFT = "line-of-mains-or-shaft"

TRUST = {
    SAMPLING_RATE: 0.5,
    OFF_NOMINAL: 0.75,
    NEAR_ZERO: 0.5,
    "mesh-above-sampling": 0.5,
    "mesh-absent": 0.75,
    MESH_ELSEWHERE: 0.5,
    "separate-runs": 0.75,
    "channel-clipped": 0.7,
    "channel-wrapped": 0.0,
    "channel-stepped": 0.75,
    "channel-reversed": 0.5,
    "channel-hum": 0.75,
    "channel-faded": 0.75,
}
"""Problem → factor on the confidence: a judgement, not a probability. 0.5 where places or frequencies are probably
wrong, 0.7 and 0.75 where places are right but sizes or what channels show together are unreliable, 0 where nothing is
usable."""

TRUST_OF_SHARED_LINE = 0.5
"""The same for a finding based on a line that the mains may cause as well: nothing tells which of the two does."""

SAME_LINE = 2e-3
"""Relative distance: the line is within a thousandth of the supply's multiple, and the speed is known no better."""

SURE = 0.7
"""Below this confidence a fault becomes a suspicion."""

FASTEST_RPM = 5e5
"""Dental drills and the smallest turbines come close to it."""

NEAR_ZERO_SHARE = 0.1
"""Share of the highest speed: a tachometer does not show whether a shaft that slows down this far reverses."""


def speed_warnings(angle: ShaftAngle | CannotTell, rig: Rig) -> list[Finding]:
    """Compare the speed with the rig's nominal speed and tolerance, and check whether it comes near standstill."""
    if not isinstance(angle, ShaftAngle):
        return []
    doubts = []
    low, high = angle.speed_range_rpm
    nominal = rig.nominal_speed_rpm(angle.shaft if angle.shaft in rig.shaft_names else "")
    tolerance = rig.operating_point.speed_tolerance_percent / 100
    if nominal and not low * (1 - tolerance) <= nominal <= high * (1 + tolerance):
        ratio = angle.mean_speed_rpm / nominal
        near = min((f for n in range(2, 11) for f in (n, 1 / n)), key=lambda f: abs(ratio / f - 1))
        explained = f" {near:.3g} pulses per revolution would explain it." if abs(ratio / near - 1) < 0.03 else ""
        if angle.method == "constant":
            in_hz = abs(60 * ratio - 1) < tolerance
            explained = f" {nominal / 60:.4g} Hz, stated as rpm, would explain it." if in_hz else ""
        title = f"The speed, {angle.mean_speed_rpm:.5g} rpm, is {ratio:.3g} times the nominal {nominal:.5g} rpm"
        doubts.append(
            Finding(
                OFF_NOMINAL,
                Kind.DATA_PROBLEM,
                f"{title} ± {100 * tolerance:.3g} %.",
                Where(shaft=angle.shaft),
                Strength(angle.mean_speed_rpm, "rpm", nominal, "nominal speed", against="a nominal speed of"),
                confidence_basis="comparison with the rig file or the stated speed",
                evidence=(f"How it was found: {angle.method}.{explained}",),
                surer="Check sampling rate, pulses per revolution and the nominal speed.",
            )
        )
    elif high > FASTEST_RPM:
        title = f"The speed, {high:.3g} rpm, is beyond that of any machine with gears or rolling bearings."
        surer = "Check sampling rate and pulses per revolution."
        doubts.append(Finding(OFF_NOMINAL, Kind.DATA_PROBLEM, title, Where(shaft=angle.shaft), surer=surer))
    if low < NEAR_ZERO_SHARE * high or angle.standstills_s:
        lowest = "near standstill between two pulses" if angle.standstills_s else f"to {low:.3g} rpm, near standstill"
        title = f"The speed falls {lowest}: whether the shaft then reverses is not known."
        where = Where(shaft=angle.shaft)
        doubts.append(Finding(NEAR_ZERO, Kind.DATA_PROBLEM, title, where, surer=SURER_BEYOND_ZERO))
    return doubts


def with_doubt(findings: Sequence[Finding], doubt: Finding) -> list[Finding]:
    """Add a doubtful sampling rate, which takes the place of a speed off its nominal: one problem from two sides."""
    off, others = ([f for f in findings if (f.code == OFF_NOMINAL) is is_off] for is_off in (True, False))
    return [*others, replace(doubt, evidence=(*doubt.evidence, *(text for f in off for text in f.evidence)))]


def without_synchronous_hum(findings: Iterable[Finding], angle: ShaftAngle | CannotTell, rig: Rig) -> list[Finding]:
    """Make hum a notice where one to four times a shaft's speed is the same frequency: it may be the shaft."""
    turns_hz = []
    if isinstance(angle, ShaftAngle):
        ratios = {name: rig.ratio(name) for name in rig.shaft_names} or {angle.shaft: 1.0}
        turns_hz = [(name, angle.mean_speed_rpm / 60 * ratio) for name, ratio in ratios.items() if ratio is not None]
    return [_perhaps_the_shafts(f, turns_hz) if f.code == "channel-hum" else f for f in findings]


def _perhaps_the_shafts(hum: Finding, turns_hz: Sequence[tuple[str, float]]) -> Finding:
    line_hz = hum.where.frequency_hz or 0.0
    for name, turn_hz in turns_hz:
        for multiple in (1, 2, 3, 4):
            if abs(multiple * turn_hz / line_hz - 1) < SAME_LINE:
                of = f"{multiple} × {name or 'the shaft'}"
                title = f"One line, {line_hz:.5g} Hz, dominates channel {hum.where.channels[0]}: {of}, or mains hum."
                return replace(hum, code=MAINS_OR_SHAFT, kind=Kind.NOTICE, title=title)
    return hum


def lowered(findings: Iterable[Finding], channels: Sequence[str]) -> list[Finding]:
    """Return the findings with faults and suspicions lowered, or withheld, by the problems among them.

    A problem of a channel affects what was seen in it; one of speed or sampling rate affects everything. A line that
    may be the mains' affects what is said of that line, except that it has changed.
    """
    findings = list(findings)
    problems = [f for f in findings if f.code in TRUST or f.code == MAINS_OR_SHAFT]
    return [_lowered(f, problems, channels) if f.is_claim else f for f in findings]


def _lowered(finding: Finding, problems: Sequence[Finding], channels: Sequence[str]) -> Finding:
    seen_in = set(finding.where.channels or channels)
    touching = [p for p in problems if p.code != finding.code and (not _of_channels(p) or seen_in & _of_channels(p))]
    touching = [p for p in touching if p.code != MAINS_OR_SHAFT or _rests_on(finding, p)]
    confidence, kind = finding.confidence, finding.kind
    for problem in touching:
        confidence *= TRUST.get(problem.code, TRUST_OF_SHARED_LINE)
    if not touching:
        return finding
    because = " ".join(p.title for p in touching)
    if confidence == 0.0:
        kind, confidence = Kind.CANNOT_TELL, 1.0
        finding = replace(finding, code=f"withheld-{finding.code}", title=f"Withheld: {finding.title} {because}")
    elif confidence < SURE:
        kind = Kind.SUSPICION
    evidence = (*finding.evidence, f"Its confidence is lowered: {because}")
    return replace(finding, kind=kind, confidence=confidence, evidence=evidence)


def _rests_on(finding: Finding, line: Finding) -> bool:
    """Whether a finding is based on a line, and not only on its change."""
    own_hz, line_hz = finding.where.frequency_hz, line.where.frequency_hz
    return bool(finding.code != CHANGED and own_hz and line_hz and abs(own_hz / line_hz - 1) < SAME_LINE)


def _of_channels(problem: Finding) -> set[str]:
    of_channel = problem.code.startswith("channel-") or problem.code == MAINS_OR_SHAFT
    return set(problem.where.channels) if of_channel else set()


def spoiled(findings: Iterable[Finding], channels: Sequence[str]) -> frozenset[str]:
    """Return the channels from which no crack depth must be estimated."""
    spoiled_channels: set[str] = set()
    for finding in findings:
        if finding.code in TRUST:
            spoiled_channels |= _of_channels(finding) or set(channels)
    return frozenset(spoiled_channels)


def withheld_crack(findings: Iterable[Finding], *, is_asked: bool) -> CannotTell | None:
    """Return why a crack's depth is withheld if every channel is unusable; None if nobody asked for it."""
    if not is_asked:
        return None
    reason = " ".join(f.title for f in findings if f.code in TRUST).rstrip(".")  # it ends a sentence
    return CannotTell("How deep is a crack?", reason, "Correct what is doubtful, or measure again.")


def said_first(findings: Sequence[Finding], *, claims: bool) -> str:
    """Return the problems that open the verdict: rate or speed always, those of channels if something is claimed."""
    titles = {f.code: f.title for f in findings if f.code in TRUST and f.kind is Kind.DATA_PROBLEM}
    first = [title for code, title in titles.items() if not code.startswith("channel-") and code != NEAR_ZERO]
    return " ".join([*first, *(t for t in titles.values() if claims and t not in first)])
