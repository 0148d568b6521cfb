"""Which cases a benchmark makes: kinds in fixed shares, effects and severities in balance, all in a shuffled order."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from app.benchmark.shares import SHARES, counts_of
from gearsig.checks import count, one_of, within
from sims.blind import CATALOGUE, OUTSIDE, ROLES

REFERENCES = ("both", "with", "without")
BLIND, SAME = "blind", "same"
"""Where the recordings of a case come from: the independent rig, or the diagnosing simulator itself."""


@dataclass(frozen=True)
class PlannedCase:
    """One case before it is drawn.

    Parameters
    ----------
    number : int
        From 1, in the order of the run.
    source : str
        `BLIND` or `SAME`.
    kind : str
    effect : str or None
        None: nothing, or drawn with the case (pairs).
    level : float
        0 (barely noticeable) to 1 (strong).
    with_reference : bool
    n_conditions : int
    repeats : int or None
        Number of the blind case with the same gears, conditions and effects; None: it is blind itself.
    """

    number: int
    source: str
    kind: str
    effect: str | None
    level: float
    with_reference: bool
    n_conditions: int
    repeats: int | None = None


@dataclass(frozen=True)
class Plan:
    """What decides a benchmark's cases.

    Parameters
    ----------
    n_cases : int
        Of the independent rig.
    seed : int
    role : str
        "development", "calibration" or "evaluation"; they share no gear geometry.
    reference : str
        "with" or "without" healthy references, or "both" in equal shares.
    same_simulator : bool
        Whether the same cases are made by the diagnosing simulator too, but for the unknown, which it cannot make.
    longest_s : float or None
        Recordings are cut to this; None: 4 to 8 s as drawn.
    least_level : float
        0 (barely noticeable) to 1 (strong), from which the levels of effects go up to 1; above 0 more cases are as
        strong as the targets ask, which one in thirty is otherwise.
    """

    n_cases: int = 200
    seed: int = 1
    role: str = "evaluation"
    reference: str = "both"
    same_simulator: bool = False
    longest_s: float | None = None
    least_level: float = 0.0

    def __post_init__(self) -> None:
        count(self.n_cases, "cases")
        one_of(self.role, "role", ROLES)
        one_of(self.reference, "reference", REFERENCES)
        within(self.least_level, "least level", 0, 1)

    def definition(self) -> dict[str, Any]:
        """What decides the cases, as plain values."""
        return {
            "n_cases": self.n_cases,
            "seed": self.seed,
            "role": self.role,
            "reference": self.reference,
            "same_simulator": self.same_simulator,
            "longest_s": self.longest_s,
            "least_level": self.least_level,
        }

    def cases(self) -> list[PlannedCase]:
        """Return the cases in the order of the run."""
        blind = _shuffled(self, np.random.default_rng([self.seed, 0]))
        if not self.same_simulator:
            return blind
        again = [c for c in blind if c.kind != "unknown"]
        return blind + [
            replace(c, number=len(blind) + i, source=SAME, repeats=c.number) for i, c in enumerate(again, 1)
        ]

    def rng_of(self, case: PlannedCase) -> np.random.Generator:
        """Return the generator that a case is drawn from: a repeated case is drawn as the blind one was."""
        return np.random.default_rng([self.seed, 1, case.number if case.repeats is None else case.repeats])

    def rng_of_run(self, case: PlannedCase) -> np.random.Generator:
        """Return the generator of what the diagnosing simulator draws for itself: severities, places, noise."""
        return np.random.default_rng([self.seed, 2, case.number])


def _shuffled(plan: Plan, rng: np.random.Generator) -> list[PlannedCase]:
    drawn = [one for kind, n in counts_of(SHARES, plan.n_cases).items() for one in _of_kind(kind, n, plan, rng)]
    order = rng.permutation(len(drawn))
    return [PlannedCase(i, BLIND, *drawn[place]) for i, place in enumerate(order, 1)]


def _of_kind(
    kind: str, n: int, plan: Plan, rng: np.random.Generator
) -> Iterator[tuple[str, str | None, float, bool, int]]:
    """Yield kind, effect, level, reference, conditions; levels in balance within an effect, the others throughout."""
    names: Sequence[str | None] = {"single": tuple(CATALOGUE), "unknown": tuple(OUTSIDE)}.get(kind, (None,))
    chosen = [names[i] for i in rng.permutation(len(names))]
    effects = [chosen[i % len(chosen)] for i in range(n)]
    turn = int(rng.integers(4))
    for effect in dict.fromkeys(effects):
        k = effects.count(effect)
        for level in (rng.permutation(k) + rng.random(k)) / k:
            turn = (turn + 1) % 4
            reference = turn % 2 == 0 if plan.reference == "both" else plan.reference == "with"
            yield kind, effect, plan.least_level + (1.0 - plan.least_level) * float(level), reference, 1 + turn // 2
