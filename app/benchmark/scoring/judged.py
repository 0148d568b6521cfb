"""Answer and truth side by side: what a case was, what was said of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

from app.benchmark.answer import Answer
from app.benchmark.run import Done
from app.benchmark.scoring.location import Located, located
from app.benchmark.scoring.strength import Floors, strength
from gearsig.gap.types import NONE, UNKNOWN, GapOutcome
from sims.blind import CATALOGUE, MECHANICAL


@dataclass(frozen=True)
class Row:
    """One case with one diagnoser's answer.

    Parameters
    ----------
    number : int
    source, kind : str
    effects : tuple of str
        What was wrong.
    truths : tuple of str
        Causes that are right: the effects; "none"; "unknown".
    level, strength : float
        Of the fault: 0 to 1 in its span; structural floors.
    has_reference : bool
    n_conditions : int
    answer : Answer
    located : Located
    """

    number: int
    source: str
    kind: str
    effects: tuple[str, ...]
    truths: tuple[str, ...]
    level: float
    strength: float
    has_reference: bool
    n_conditions: int
    answer: Answer
    located: Located

    @cached_property
    def ranked(self) -> tuple[str, ...]:
        """Causes, likeliest first."""
        return tuple(c.name for c in self.answer.ranked)

    @property
    def first(self) -> str:
        """The likeliest cause; empty where there is no answer."""
        return self.ranked[0] if self.ranked else ""

    @property
    def confidence(self) -> float:
        """Probability of the likeliest cause; nan where there is no answer."""
        return self.answer.probability(self.first) if self.ranked else float("nan")

    @property
    def first_mechanical(self) -> str:
        """The likeliest of the mechanical effects."""
        return next((name for name in self.ranked if name in MECHANICAL), "")

    @property
    def named(self) -> str:
        """The mechanical effect that the verdict names: as the cause, or as one of those that cannot be separated."""
        first = tuple(c.name for c in self.answer.causes[:1])
        several = self.answer.inseparable or first
        named = {GapOutcome.EFFECT.value: first, GapOutcome.CANNOT_SEPARATE.value: several}
        return next((name for name in named.get(self.answer.outcome, ()) if name in MECHANICAL), "")

    @property
    def is_mechanical(self) -> bool:
        """Whether exactly one mechanical effect was wrong."""
        return self.kind == "single" and self.effects[0] in MECHANICAL

    @property
    def is_nuisance(self) -> bool:
        """Whether nothing but the measurement chain was wrong."""
        return self.kind == "single" and not self.is_mechanical


def rows_of(cases: Sequence[Done], diagnoser: str, floors: Floors) -> list[Row]:
    """Return one row per case."""
    return [_row(done, done.answers[diagnoser], strength(done.truth, floors)) for done in cases]


def _row(done: Done, answer: Answer, strength_floors: float) -> Row:
    labels = done.truth.labels
    effects = tuple(e["name"] for e in labels["effects"])
    truths = {"none": (NONE,), "unknown": (UNKNOWN,)}.get(labels["kind"], effects)
    place = labels["effects"][0]["place"] if len(effects) == 1 else {}
    return Row(
        number=done.planned.number,
        source=done.planned.source,
        kind=labels["kind"],
        effects=effects,
        truths=truths,
        level=labels["effects"][0]["level"] if effects else float("nan"),
        strength=strength_floors,
        has_reference=labels["has_reference"],
        n_conditions=len(labels["conditions"]),
        answer=answer,
        located=located(place, effects[0] if effects else "", answer, labels["pair"]),
    )


def group_of(cause: str) -> str:
    """Group of an effect; "none" and "unknown" are their own."""
    return CATALOGUE[cause].group if cause in CATALOGUE else cause
