"""Which cause what stands out has, where no simulation could be compared with: probabilities and the outcome."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from app.gap.standing_out import IMPACTS, LINE, PARTS, RACES, Examined, Standing, bearings_text, shafts_of_unknown_speed
from gearsig.diagnosis.types import Finding, Kind
from gearsig.gap.simulator import GapEffect
from gearsig.gap.types import NONE, UNKNOWN, GapCause, GapOutcome
from gearsig.rig.types import Rig

HIDDEN = 0.2
"""Probability of something that does not show, where damage of a race would have shown."""
UNDECIDED = 0.5
"""Share of unknown in what is left over, where nothing tells it from none."""

Races = Mapping[str, Standing]
"""Name of an effect → the surest finding of it."""


def causes_of(
    standing: Sequence[Standing], every: Sequence[Examined], rig: Rig, effects: Mapping[str, GapEffect]
) -> tuple[tuple[GapCause, ...], GapOutcome]:
    """Return the causes, that of the outcome first, and the outcome.

    A race has the confidence c of its finding; of the rest 1 − Σc a share u goes to unknown and 1 − u to none. u is
    the confidence of other impacts or lines where they stand out alone, 1/2 beside a race, and where nothing stands
    out 1/5 if a damage would have shown, else 1/2. An effect is named only if the finding is a fault.

    Parameters
    ----------
    standing : sequence of Standing
        Most important first.
    every : sequence of Examined
    rig : Rig
    effects : mapping
        Those that may be named.
    """
    races = {name: one for one in reversed(standing) if (name := RACES.get(one.finding.code, "")) in effects}
    outcome, why = _outcome(standing, races, every, rig)
    total = sum(one.finding.confidence for one in races.values())
    left = 1.0 - min(total, 1.0)
    unknown = left * _share_of_unknown(standing, races, every)
    causes = [
        _race(effects[name], races.get(name), rig, scale=1.0 / max(total, 1.0))
        for name in RACES.values()
        if name in effects
    ]
    strange = [one.finding for one in standing if one not in races.values()]
    causes += [
        GapCause(
            UNKNOWN,
            UNKNOWN,
            why if outcome is GapOutcome.UNKNOWN else "something else",
            "",
            unknown,
            remarks=_remarks(strange[0]) if strange and outcome is GapOutcome.UNKNOWN else (),
        ),
        GapCause(NONE, NONE, why if outcome is GapOutcome.NO_GAP else "no damage", "", left - unknown),
    ]
    firsts = {GapOutcome.UNKNOWN: UNKNOWN, GapOutcome.NO_GAP: NONE}
    first = firsts.get(outcome) or RACES[_sure(races)[0].finding.code]
    return tuple(sorted(causes, key=lambda cause: (cause.name != first, -cause.probability))), outcome


def _sure(races: Races) -> list[Standing]:
    """Return the races whose damage the search is sure of, surest first."""
    found = [one for one in races.values() if one.finding.kind is Kind.FAULT]
    return sorted(found, key=lambda one: -one.finding.confidence)


def _outcome(standing: Sequence[Standing], races: Races, every: Sequence[Examined], rig: Rig) -> tuple[GapOutcome, str]:
    """Return the outcome and its reason."""
    if _sure(races):
        return GapOutcome.EFFECT, ""
    if standing:
        return GapOutcome.UNKNOWN, _why_unknown(standing[0], races, rig)
    if all(one.reference is not None for one in every):
        return GapOutcome.NO_GAP, "nothing stands out that the healthy reference does not show"
    if all(one.is_sound for one in every):
        return GapOutcome.NO_GAP, "nothing stands out, and damage of a race would have"
    return GapOutcome.UNKNOWN, "nothing stands out, but damage of a race might not have"


def _why_unknown(one: Standing, races: Races, rig: Rig) -> str:
    code = one.finding.code
    if code in RACES:
        is_known = one in races.values()
        return (
            "the lines of the race are not clear enough" if is_known else "the race is not among the effects asked for"
        )
    if code in PARTS:
        return f"damage of a {PARTS[code][0]} is not in the catalogue"
    why = "what makes the line is not known" if code == LINE else "what makes the impacts is not known"
    loose = shafts_of_unknown_speed(rig)
    return f"{why}; it may turn with {loose}, whose speed the rig file does not tell" if loose else why


def _share_of_unknown(standing: Sequence[Standing], races: Races, every: Sequence[Examined]) -> float:
    impacts = [one.finding.confidence for one in standing if one.finding.code in IMPACTS]
    if races:  # a line may be the ringing of the race's impacts, and says nothing beside them
        return max([UNDECIDED, *impacts])
    if standing:
        return max(one.finding.confidence for one in standing)
    return HIDDEN if all(one.is_sound for one in every) else UNDECIDED


def _race(effect: GapEffect, found: Standing | None, rig: Rig, *, scale: float) -> GapCause:
    if found is None:
        return GapCause(effect.name, effect.group, effect.title, effect.unit, 0.0)
    return GapCause(
        effect.name,
        effect.group,
        effect.title,
        effect.unit,
        scale * found.finding.confidence,
        place=bearings_text(found.finding, rig),
        remarks=_remarks(found.finding),
    )


def _remarks(finding: Finding) -> tuple[str, ...]:
    basis = finding.confidence_basis
    return (*finding.evidence, *((f"{basis[:1].upper()}{basis[1:]}.",) if basis else ()))
