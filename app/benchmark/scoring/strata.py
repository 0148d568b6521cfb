"""The parts of the cases that are scored one by one, and the whole result."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import isfinite

import numpy as np

from app.benchmark.plan import BLIND, SAME
from app.benchmark.run import Done, Wanted
from app.benchmark.scoring.calibration_curve import error_by_chance
from app.benchmark.scoring.intervals import Score
from app.benchmark.scoring.judged import Row, rows_of
from app.benchmark.scoring.scores import is_one_answer, scores, strong_only
from app.benchmark.scoring.strength import STRONG, known_floors

WITHOUT, WITH = "without reference", "with reference"
PARTS: dict[str, Callable[[Row], bool]] = {
    "all": lambda _: True,
    WITHOUT: lambda row: not row.has_reference,
    WITH: lambda row: row.has_reference,
    "one condition": lambda row: row.n_conditions == 1,
    "two conditions": lambda row: row.n_conditions == 2,
}
"""Name → whether a case belongs to it."""


@dataclass(frozen=True)
class Part:
    """The figures of one part of the cases.

    Parameters
    ----------
    diagnoser, source, name : str
    strong : bool
        Whether faults below `STRONG` are left out.
    n : int
        Cases.
    scores : mapping of str to Score
    """

    diagnoser: str
    source: str
    name: str
    strong: bool
    n: int
    scores: Mapping[str, Score]


@dataclass(frozen=True)
class Result:
    """A benchmark's outcome.

    Parameters
    ----------
    wanted : Wanted
    rows : mapping
        Diagnoser → its rows.
    parts : tuple of Part
    chance_error : float
        Calibration error that true probabilities would show with so many cases.
    strengths_known : bool
        Whether there is a floor to measure strength in; if not, figures are of all faults.
    """

    wanted: Wanted
    rows: Mapping[str, Sequence[Row]]
    parts: tuple[Part, ...]
    chance_error: float
    strengths_known: bool

    @property
    def judged(self) -> str:
        """The diagnoser under judgement."""
        return self.wanted.diagnosers[0]

    def part(self, name: str, *, diagnoser: str = "", source: str = BLIND, strong: bool | None = None) -> Part:
        """Return a part; `strong` None: strong faults only, where strength is known."""
        wanted = self.strengths_known if strong is None else strong
        own = diagnoser or self.judged
        return next(p for p in self.parts if (p.diagnoser, p.source, p.name, p.strong) == (own, source, name, wanted))


def judge(wanted: Wanted, cases: Sequence[Done]) -> Result:
    """Score all answers."""
    floors = known_floors([done.truth for done in cases if done.planned.source == BLIND])
    rows = {name: rows_of(cases, name, floors) for name in wanted.diagnosers}
    first = rows[wanted.diagnosers[0]]
    parts = [
        _part(name, source, part, strong, own, wanted.plan.seed)
        for name, own in rows.items()
        for source in ((BLIND, SAME) if wanted.plan.same_simulator else (BLIND,))
        for part in PARTS
        for strong in (True, False)
    ]
    confidence = [r.confidence for r in first if r.source == BLIND and is_one_answer(r)]
    return Result(
        wanted,
        rows,
        tuple(parts),
        error_by_chance(confidence, np.random.default_rng(wanted.plan.seed)),
        any(isfinite(row.strength) for row in first),
    )


def _part(diagnoser: str, source: str, name: str, strong: bool, rows: Sequence[Row], seed: int) -> Part:
    own = [row for row in rows if row.source == source and PARTS[name](row)]
    chosen = strong_only(own, STRONG) if strong else own
    return Part(diagnoser, source, name, strong, len(chosen), scores(chosen, seed))
