"""What is kept of a gap report for scoring."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

from gearsig.gap import GapCause, GapReport, Shrinkage


@dataclass(frozen=True)
class AnsweredShrinkage:
    """How far adding the cause shrinks the gap on held-out data; see `gearsig.gap.Shrinkage`."""

    shrink: float
    slope: float
    placebo: float
    held_out: str
    n_placebos: int
    of_all: float | None = None


@dataclass(frozen=True)
class AnsweredCause:
    """A cause with its probability and where it was put.

    Parameters
    ----------
    name : str
    probability : float
    options : mapping
        Of the fitted setting: gear, tooth, bearing, order …; empty where there is none.
    shrinkage : AnsweredShrinkage or None
    """

    name: str
    probability: float
    options: Mapping[str, float | str] = field(default_factory=dict)
    shrinkage: AnsweredShrinkage | None = None


@dataclass(frozen=True)
class AnsweredPlace:
    """A place of the gap; see `gearsig.gap.GapPlace`."""

    kind: str
    shaft: str
    orders: tuple[float, ...]
    angle_deg: float | None
    tooth: int | None


@dataclass(frozen=True)
class Answer:
    """One diagnoser's answer to one case.

    Parameters
    ----------
    outcome : str
        Value of `GapOutcome`; empty where it failed.
    causes : tuple of AnsweredCause
        As the report has them: what its outcome names first, the others by probability.
    inseparable : tuple of str
    places : tuple of AnsweredPlace
    size : float
        Of the gap in structural floors.
    seconds, cpu_seconds : float
        What it took, start of the process left out.
    error : str
        Why there is no answer.
    """

    outcome: str
    causes: tuple[AnsweredCause, ...] = ()
    inseparable: tuple[str, ...] = ()
    places: tuple[AnsweredPlace, ...] = ()
    size: float = float("nan")
    seconds: float = 0.0
    cpu_seconds: float = 0.0
    error: str = ""

    @property
    def ranked(self) -> tuple[AnsweredCause, ...]:
        """The causes by probability, whatever the outcome puts first; of those alike, the first stays first."""
        return tuple(sorted(self.causes, key=lambda cause: -cause.probability))

    def probability(self, name: str) -> float:
        """Probability of a cause; 0 for one that is not listed."""
        return next((c.probability for c in self.causes if c.name == name), 0.0)

    def cause(self, name: str) -> AnsweredCause | None:
        """The cause of this name."""
        return next((c for c in self.causes if c.name == name), None)


def answer_of(report: GapReport, seconds: float, cpu_seconds: float) -> Answer:
    """Reduce a report to what is scored."""
    return Answer(
        outcome=report.outcome.value,
        causes=tuple(_cause(c) for c in report.causes),
        inseparable=report.inseparable or (),
        places=tuple(
            AnsweredPlace(p.kind.value, p.shaft, tuple(p.orders), p.angle_deg, p.tooth) for p in report.places
        ),
        size=report.size.value,
        seconds=seconds,
        cpu_seconds=cpu_seconds,
    )


def _cause(cause: GapCause) -> AnsweredCause:
    options = dict(cause.fitted.options) if cause.fitted is not None else {}
    return AnsweredCause(cause.name, float(cause.probability), options, _shrinkage(cause.shrinkage))


def _shrinkage(shrinkage: Shrinkage | None) -> AnsweredShrinkage | None:
    if shrinkage is None:
        return None
    return AnsweredShrinkage(
        float(shrinkage.shrink.value),
        float(shrinkage.slope),
        float(shrinkage.placebo),
        shrinkage.held_out,
        shrinkage.n_placebos,
        shrinkage.of_all,
    )


def to_text(answers: Mapping[str, Answer]) -> str:
    """Write the answers of several diagnosers as JSON."""
    return json.dumps({name: asdict(answer) for name, answer in answers.items()}, indent=1) + "\n"


def from_text(text: str) -> dict[str, Answer]:
    """Read what `to_text` wrote."""
    return {name: _answer(data) for name, data in json.loads(text).items()}


def _answer(data: dict[str, Any]) -> Answer:
    causes = tuple(
        AnsweredCause(
            c["name"],
            c["probability"],
            c["options"],
            AnsweredShrinkage(**c["shrinkage"]) if c["shrinkage"] is not None else None,
        )
        for c in data.pop("causes")
    )
    places = tuple(AnsweredPlace(**{**p, "orders": tuple(p["orders"])}) for p in data.pop("places"))
    return Answer(causes=causes, places=places, inseparable=tuple(data.pop("inseparable")), **data)
