"""What stands out of a recording of gears by itself, found by the analysis: impacts, and lines of nothing known."""

from __future__ import annotations

from collections.abc import Sequence

from app.gap.standing_out import LINE, RACES, Standing, carrying, examined
from gearsig.angle.types import ShaftAngle
from gearsig.diagnosis.analyze import analyze
from gearsig.diagnosis.speed import determine_angle
from gearsig.diagnosis.types import Analysis, CannotTell, Kind, Outcome
from gearsig.gap.types import GapOutcome
from gearsig.recording.types import Recording
from gearsig.rig.types import Rig

HIGHEST_HARMONIC, SAME_ORDER = 40, 1e-3
"""Of a family of impacts, at which a line still belongs to it; relative."""


def stood_out(
    recording: Recording, rig: Rig, references: Sequence[Recording], reference_rigs: Sequence[Rig], name: str
) -> tuple[list[Standing], list[str], list[str]]:
    """Return the families of impacts, beyond the reference's, that no shaft repeats, surest first; remarks; doubts.

    The catalogue's effects are compared by features of known places; a strange family is one feature among a hundred
    there and easily lost. The analysis looks for it by itself. A strange line and a family that may well be chance are
    remarks; a fault of the reference is a doubt about everything else.
    """
    now = _analysed(recording, rig)
    if now is None:
        return [], [], []
    nearest = _nearest(now[1].mean_speed_rpm, references, reference_rigs)
    healthy = None if nearest is None else _analysed(*nearest)
    found = examined(name, now, [healthy] if healthy is not None else [])
    doubts = [] if healthy is None else _fault_of_reference(healthy[0], now[0], name)
    weak = [one for one in found.standing if one.finding.code == LINE or one.finding.kind is Kind.NOTICE]
    strong = [one for one in found.standing if one not in weak]
    remarks = [
        f"Not explained by the gear model, in {name}: {one.finding.title.rstrip('.')}{_odds(one)}."
        for one in weak
        if not (one.finding.code == LINE and any(_is_harmonic(one, family) for family in strong))
    ]
    return strong, remarks, doubts


def beside_standing(outcome: GapOutcome, standing: Sequence[Standing]) -> tuple[GapOutcome, list[str]]:
    """Return what a diagnosis that names no effect comes to where impacts stand out, and what is to be checked first.

    Impacts that no shaft repeats are a gap, however few features see them: unknown. Those of a bearing's race are in
    the catalogue; that the forests see too little of them leaves it undecided.
    """
    if not standing or outcome not in (GapOutcome.NO_GAP, GapOutcome.UNDECIDED):
        return outcome, []
    races = [one for one in standing if one.finding.code in RACES]
    if len(races) < len(standing):
        return GapOutcome.UNKNOWN, []
    return GapOutcome.UNDECIDED, [
        f"{one.recording}: {one.finding.title.rstrip('.')}{_odds(one)}, by the search for bearing orders; few of the "
        "features that are compared show it."
        for one in races
    ]


def _is_harmonic(line: Standing, family: Standing) -> bool:
    """Whether a line is a multiple of a family's order: the family explains it."""
    order, base = line.finding.where.order, family.finding.where.order
    if not (order and base and line.finding.where.shaft == family.finding.where.shaft):
        return False
    n = round(order / base)
    return 1 <= n <= HIGHEST_HARMONIC and abs(order / (n * base) - 1.0) < SAME_ORDER


def _odds(one: Standing) -> str:
    return "" if one.finding.code == LINE else f" (at most {100 * one.finding.confidence:.0f} %)"


def _fault_of_reference(reference: Analysis, now: Analysis, name: str) -> list[str]:
    """Say so where the reference shows a fault by itself; most of all where the recording shows none."""
    if reference.outcome is not Outcome.FAULT:
        return []
    fault = reference.findings[0].title.rstrip(".")
    perhaps = "" if now.outcome is Outcome.FAULT else " and the recording shows no fault: they may have been exchanged"
    remark = (
        f"The reference of {name} does not look healthy ({fault}){perhaps}. What is named may be what the "
        "reference has and the recording has not."
    )
    return [remark]


def _nearest(speed_rpm: float, references: Sequence[Recording], rigs: Sequence[Rig]) -> tuple[Recording, Rig] | None:
    """Return the reference at the speed nearest to the recording's; only that is analysed."""
    pairs = list(zip(references, rigs, strict=True))
    if len(pairs) < 2:
        return pairs[0] if pairs else None
    speeds = [determine_angle(carrying(one, rig), rig) for one, rig in pairs]
    known = [(abs(a.mean_speed_rpm - speed_rpm), i) for i, a in enumerate(speeds) if not isinstance(a, CannotTell)]
    return pairs[min(known)[1]] if known else None


def _analysed(recording: Recording, rig: Rig) -> tuple[Analysis, ShaftAngle] | None:
    """Return a recording's analysis with its angle; None where it has no speed."""
    analysis = analyze(carrying(recording, rig))
    return None if isinstance(analysis.shaft_angle, CannotTell) else (analysis, analysis.shaft_angle)
